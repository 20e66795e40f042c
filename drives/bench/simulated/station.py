"""What the parts of one simulated device share: its way to the bus, its timers, its NMT state.

A station owns no clock: the bus calls ``timer`` when ``due_s`` is reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from drives import pdo
from drives.bench.simulated.dictionary import Dictionary
from drives.bench.simulated.parameters import Parameters
from drives.bench.virtual.virtual_bus import Link
from drives.pdo import FRAME
from drives.text_file import Source

INITIALISING, STOPPED = pdo.NMT_BOOT_UP, pdo.NMT_STOPPED
OPERATIONAL, PRE_OPERATIONAL = pdo.NMT_OPERATIONAL, pdo.NMT_PRE_OPERATIONAL

Alarm = Callable[[float], None]  # called with the time
_NO_ALARM: tuple[float, Alarm] = (math.inf, lambda _now_s: None)


class Station:
    """The common part of a device on the virtual bus."""

    def __init__(self, node: int, parameters: Parameters, eds: Source) -> None:
        self.node = node
        self.parameters = parameters
        self.dictionary = Dictionary(node, eds)
        self.nmt = INITIALISING
        self.due_s = math.inf
        self.watch_s = math.inf  # when ``watch`` runs next; what is put off all the time is no alarm
        self.now_s = 0.0  # when the device was last spoken to
        self.link: Link | None = None
        self.in_tune = True  # the bit rate is the bus's; otherwise deaf and silent
        self.supplied = True
        self._alarms: dict[str, tuple[float, Alarm]] = {}
        self._alarm_s = math.inf  # the first of them, or before it

    def timer(self, now_s: float) -> None:
        """Run what is due."""
        if self.watch_s <= now_s:
            self.watch(now_s)
        if self._alarm_s <= now_s:
            self._run_alarms(now_s)
        self.due_s = self.watch_s if self.watch_s < self._alarm_s else self._alarm_s

    def _run_alarms(self, now_s: float) -> None:
        alarms = self._alarms
        for name in [name for name, (at_s, _) in alarms.items() if at_s <= now_s]:
            # An alarm that ran before may have taken this one back or put it off.
            at_s, alarm = alarms.get(name, _NO_ALARM)
            if at_s <= now_s:
                del alarms[name]
                alarm(now_s)
        self._alarm_s = min([at_s for at_s, _ in alarms.values()], default=math.inf)

    def watch(self, now_s: float) -> None:
        """Look whether something has stayed away; sets ``watch_s`` anew."""
        self.watch_s = math.inf

    def watch_from(self, at_s: float) -> None:
        """Begin to watch."""
        self.watch_s = at_s
        self._wake(at_s)

    def alarm(self, name: str, at_s: float, what: Alarm) -> None:
        """Call ``what`` at a time; a name has one alarm, the newest."""
        self._alarms[name] = (at_s, what)
        if at_s < self._alarm_s:
            self._alarm_s = at_s
        self._wake(at_s)

    def _wake(self, at_s: float) -> None:
        if at_s < self.due_s:
            self.due_s = at_s
        if self.link is not None:
            self.link.wake(at_s)

    def waiting(self, name: str) -> bool:
        return name in self._alarms

    def cancel(self, name: str) -> None:
        self._alarms.pop(name, None)

    def cancel_all(self) -> None:
        self._alarms.clear()
        self.watch_s = math.inf

    def send(self, at_s: float, can_id: int, data: bytes) -> None:
        """Put a frame up for arbitration; ``at_s`` may lie ahead."""
        if self.link is not None and self.in_tune and self.supplied:
            self.link.send(at_s, can_id, FRAME.pack(can_id, len(data), data))
