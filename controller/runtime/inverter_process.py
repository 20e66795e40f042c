"""The process of a spindle's inverter on a serial line: it asks and orders it, so that the tick never waits.

Both sides watch each other. A tick that is silent for ``TICK_SILENT_S`` has the spindle stopped; a spindle
that nothing is heard of for ``silent_s`` of the machine file stops the path. Where both are gone, the
inverter's own watchdog stops it, which the operator sets (``watchdog`` of its profile).
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from controller.ipc.inverter_slot import Commanded, InverterSlot, Reported
from controller.machine import inverter_profiles
from controller.machine.spindle import Modbus, Spindle
from controller.messages import Message, message, text
from controller.runtime import children, inverter_line
from controller.runtime.inverter_line import LineError

TICK_SILENT_S = 0.5
ROUND_S = 0.02  # from one exchange to the next, at least
AGAIN_S = 0.2  # likewise after a failure


@dataclass(frozen=True, slots=True)
class Job:
    """``paths``: of the slot; ``simulated``: an inverter that is none turns."""

    spindle: Spindle
    paths: tuple[str, str]
    simulated: bool


class Inverter(Protocol):
    """What is asked and ordered."""

    def exchange(self, wanted: Commanded, /) -> Reported: ...


def main(job: Job) -> None:
    """Until SIGTERM; then the spindle is stopped. Raises ConfigError."""
    asked = children.EndRequest()
    modbus = job.spindle.modbus
    assert modbus is not None
    slot = InverterSlot(job.paths, create=False)
    serve(
        slot,
        _inverter(job.spindle, modbus, job.simulated),
        lambda: not asked.yes,
        lambda error: _tell(
            message("inverter.silent", port=modbus.port, station=modbus.station, why=str(error))
        ),
    )


def _inverter(spindle: Spindle, modbus: Modbus, simulated: bool) -> Inverter:
    if simulated:
        from controller.runtime import simulation

        return simulation.inverter(spindle, time.monotonic)
    watchdog = inverter_profiles.load(modbus.profile).watchdog
    _tell(message("inverter.watchdog", port=modbus.port, watchdog=watchdog))
    return inverter_line.opened(modbus)


def _tell(what: Message) -> None:
    """For the journal."""
    with contextlib.suppress(OSError):  # nobody may be there to read it
        print(text(what), file=sys.stderr, flush=True)


def serve(
    slot: InverterSlot, inverter: Inverter, going: Callable[[], bool], tell: Callable[[LineError], None]
) -> None:
    """Exchange after exchange; each answer is reported, and a failure is a silence.

    ``tell``: called with the first failure after an answer.
    """
    heard, heard_s, answers = 0, time.monotonic(), True
    while going():
        wanted, count = slot.commanded()
        now_s = time.monotonic()
        if count != heard:
            heard, heard_s = count, now_s
        elif now_s - heard_s > TICK_SILENT_S:
            wanted = _stopped(wanted)
        try:
            slot.report(inverter.exchange(wanted))
            answers = True
            time.sleep(ROUND_S)
        except LineError as error:
            if answers:
                tell(error)
            answers = False
            time.sleep(AGAIN_S)
    with contextlib.suppress(LineError):
        inverter.exchange(_stopped(slot.commanded()[0]))


def _stopped(wanted: Commanded) -> Commanded:
    """Nobody's order: to stop."""
    return Commanded(resets=wanted.resets)
