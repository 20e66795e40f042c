"""What a tick leaves for others: the snapshot of the machine, and a row of the flight recorder.

What they hold is declared in ``live_state``; here is what no other part of the tick has as an attribute.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from controller.ipc.handoff import ROW, STANDSTILL, Recorder, SnapshotBoard
from controller.machine.model import Machine
from controller.state.live_state import DRIVES, OWNERS, Flat, again, gather
from controller.state.modes import Fault
from controller.tick.parts import Parts

_COLUMNS: Final = len(ROW)
_FOLLOWING_ERROR: Final = Fault.FOLLOWING_ERROR  # an enum's members are slow to look up


class StatusPublisher:
    """Reads the parts of the tick; changes none."""

    def __init__(self, cycle: object, parts: Parts, snapshot: SnapshotBoard, recorder: Recorder) -> None:
        """``cycle``: that of these parts, which owns values of the live state, too."""
        machine, group = parts.machine, parts.group
        self._group, self._modes = group, parts.modes
        self._follow, self._jogging = parts.follow, parts.jogging
        self._encoder = parts.encoder
        others = {"status": self, "cycle": cycle, DRIVES: group.drives}
        self._owners = tuple([others.get(name) or getattr(parts, name) for name in OWNERS])
        self._gather = gather(len(machine.axes))
        self._snapshot, self._recorder = snapshot, recorder
        self._buses = _timed(machine, group.lines)
        self._last: Flat = ()  # of the last tick
        self.motion_id = STANDSTILL
        self.cutting = False
        self._loads = [(i, drive.load) for i, drive in enumerate(group.drives) if drive.load is not None]
        self.load_off = [0.0] * len(group.drives)
        self.fault_off = 0.0
        self.bus_share = 0.0
        self.lost_frames = 0

    def publish(self) -> None:
        """The snapshot of this tick."""
        self._look()
        self._snapshot.write(self._gather(*self._owners))

    def record(self) -> None:
        """The snapshot of this tick and its row, which are the same values."""
        self._look()
        self._look_at_buses()
        self._leave(self._gather(*self._owners))

    def _leave(self, values: Flat) -> None:
        self._last = values
        self._snapshot.write(values)
        self._recorder.write(values[:_COLUMNS])

    def repeat(self) -> None:
        """Snapshot and row of the last tick, again with the number of this one."""
        self._leave(again(self._last))

    def rehearse(self) -> None:
        """Writes snapshot and row where nobody reads yet, for the caches alone: ``record`` writes over it."""
        self._look()
        values = self._gather(*self._owners)
        self._snapshot.fill(values)
        self._recorder.fill(values[:_COLUMNS])

    def _look(self) -> None:
        piece = self._follow.piece
        self.motion_id = piece.motion_id if piece else STANDSTILL
        self.cutting = piece is not None and piece.cutting and not self._jogging.active
        for i, load in self._loads:
            self.load_off[i] = self._encoder.to_units(i, load.off)
        self.fault_off = self._off()

    def _off(self) -> float:
        """How far the axis is from its command that stopped for that reason."""
        i = self._modes.fault_axis
        if self._modes.fault is not _FOLLOWING_ERROR or i < 0:
            return 0.0
        return float(self._encoder.to_units(i, self._group.drives[i].following_error.actual))

    def _look_at_buses(self) -> None:
        """How full the fullest was since the last row, counted anew from here on; frames lost on all."""
        fullest, lost = 0.0, 0
        for line, share_per_bit in self._buses:
            share = line.bits * share_per_bit
            line.bits = 0
            lost += line.lost
            if share > fullest:
                fullest = share
        self.bus_share, self.lost_frames = fullest, lost


def _timed(machine: Machine, lines: Sequence[Any]) -> tuple[tuple[Any, float], ...]:
    """Each bus with what one bit takes of a period; one without bit timing takes nothing."""
    rates = {bus.name: bus.bit_rate for bus in machine.buses}
    return tuple(
        (line, 1.0 / (rates[line.bus] * machine.period_s) if rates[line.bus] else 0.0) for line in lines
    )
