"""What the tick and the process of an inverter on a serial line (``runtime.inverter_process``) exchange.

Two boards in shared memory, each with one writer, so neither waits for the other:

```
   tick  --  Wanted (every tick: its counter is the heartbeat)  -->  process  ==  serial line  ==  inverter
         <--  Reported (after every answer: its counter likewise)  --
```
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from controller.ipc.handoff import Board


class Commanded(NamedTuple):
    """``rev_min``: signed, positive as M3; 0: stop. ``order``: its number; ``resets``: asked for so far."""

    rev_min: float = 0.0
    order: int = 0
    resets: int = 0


class Reported(NamedTuple):
    """``rev_min``: as it turns now, whichever way; ``order``: the last one that it has acknowledged."""

    rev_min: float = 0.0
    order: int = 0
    running: bool = False
    fault: bool = False


class InverterSlot:
    """Both boards; ``paths``: two files in memory, none where one process has both ends."""

    def __init__(self, paths: tuple[str, str] | None = None, create: bool = True) -> None:
        first, second = (None, None) if paths is None else paths
        self._wanted = Board(struct.Struct("<dQQ"), first, create)
        self._reported = Board(struct.Struct("<dQ??"), second, create)

    def want(self, wanted: Commanded) -> None:
        self._wanted.write(wanted)

    def report(self, reported: Reported) -> None:
        self._reported.write(reported)

    def commanded(self) -> tuple[Commanded, int]:
        """The newest, and how many there have been."""
        values = self._wanted.newest()
        return (Commanded(), 0) if values is None else (Commanded(*values), self._wanted.count)

    def reported(self) -> tuple[Reported, int]:
        """The newest, and how many there have been."""
        values = self._reported.newest()
        return (Reported(), 0) if values is None else (Reported(*values), self._reported.count)
