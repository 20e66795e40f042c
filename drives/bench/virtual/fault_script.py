"""Faults on the virtual bus, written down: what happens to which frames or nodes, and when.

    seed 7                                     for the odds, if there are any
    at 2.5 s: drop 203 x 2                     two frames with identifier 203h reach nobody
    at sync 1200: delay rpdo 3 by 500 us       from the 1200th SYNC on the wire, itself included
    at 2 s: delay rpdo 3 by 40 ms for 10 s     each of them, in their order to the end
    at 3 s: duplicate tpdo 1 x 4               each is sent twice
    at 3 s: reorder 203                        it comes after the next one of its identifier
    at 3 s: repeat rpdo 3 for 2 s              with the content of the last one before
    at 3 s: corrupt heartbeat 3 x 40           bit errors: error frames, counters, tried again
    at 4 s: falsify tpdo 3 byte 0 xor 08 x 3   a wrong content with a right check sum
    at 4 s: drop sync for 10 ms odds 0.3       each of them by chance
    at 5 s: babble 001 for 20 ms               a node that does not stop sending
    at 6 s: bus_off 3 for 50 ms                or "master"; without "for", for good
    at 7 s: node_reset 2                       power off and on
    at 8 s: silence 4 for 100 ms               it hears, and nothing of it comes
    at 9 s: queue_full master for 5 ms         sending is refused (ENOBUFS)

What befalls the drive itself; without "for" it stays so:

    at 2 s: jam 3 for 500 ms                   the motor stops hard, and no torque moves it
    at 2 s: weak 3 to 20 %                     so much of its torque is left
    at 2 s: sto 3 for 50 ms                    safe torque off: it coasts
    at 2 s: power 3 for 100 ms                 no supply: silent and deaf, it coasts, and boots afterwards
    at 2 s: limit 3 at 12345                   a limit switch at this position, in counts
    at 2 s: switch 3 high for 1 s              the switch at its upper (or low) end is pressed

What a stranger on the bus does, with frames of his own:

    at 3 s: mode 3 to 1                        writes 6060h by SDO
    at 3 s: nmt 3 stop                         or start, preop, reset, reset_communication
    at 3 s: foreign rpdo 3 data 0F00 for 1 s   with this identifier every millisecond; else zeros
    at 3 s: second 3                           another node with this id answers, too

Identifiers are hexadecimal, or by meaning: ``rpdo 3``, ``tpdo 3``, ``rpdo2 3``, ``emcy 3``,
``heartbeat 3``, ``sync``. ``x N`` counts frames (1 if neither ``x`` nor ``for`` is there);
times are seconds of the bus' clock since the script was injected at its origin.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drives.bench.virtual.fault_grammar import parse
from drives.bench.virtual.fault_kinds import MASTER, Action, Injection, ScriptError, When
from drives.texts import message

if TYPE_CHECKING:
    from drives.bench.virtual.fault_injector import Injector
    from drives.bench.virtual.virtual_bus import SteppedBus

__all__ = ["MASTER", "Action", "FaultScript", "Injection", "ScriptError", "When", "parse"]


@dataclass(frozen=True, slots=True)
class FaultScript:
    """Faults in the order of writing. Made by ``read``, or in Python from ``Injection``."""

    injections: tuple[Injection, ...] = ()
    seed: int = 0

    @staticmethod
    def read(text: str) -> FaultScript:
        """Raises ScriptError with the number of the line."""
        seed, found = 0, []
        for number, line in enumerate(text.splitlines(), 1):
            words = line.partition("#")[0].strip()
            try:
                if words.startswith("seed"):
                    seed = _seed(words)
                elif words:
                    found.append(parse(words))
            except ScriptError as error:
                raise ScriptError(message("script.line", line=number, why=error)) from None
        return FaultScript(tuple(found), seed)

    def inject(self, bus: SteppedBus, origin_s: float = 0.0) -> Injector:
        """Have these faults happen on a bus; times count from ``origin_s`` of its clock.

        Raises ScriptError for a node that is not on the bus. More may be added to what is returned.
        """
        from drives.bench.virtual.fault_injector import Injector

        injector = Injector(bus, origin_s, self.seed)
        for injection in self.injections:
            injector.add(injection)
        return injector


def _seed(words: str) -> int:
    found = re.fullmatch(r"seed\s+(\d+)", words)
    if found is None:
        raise ScriptError(message("script.seed", words=words))
    return int(found[1])
