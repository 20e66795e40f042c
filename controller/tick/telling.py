"""What a tick leaves for others: the snapshot of the machine, and a row of the flight recorder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from controller.handoff import OPTIONAL_STOP, SINGLE_BLOCK, STANDSTILL, Recorder, SnapshotBoard
from controller.machine import Machine
from controller.state import Fault
from controller.tick.drives import Drives
from controller.tick.follow import Follow
from controller.tick.jog import Jogging
from controller.tick.joints import Encoder
from controller.tick.mode import Modes
from controller.tick.peripherals import Peripherals


class Telling:
    """Reads the parts of the tick; changes none."""

    def __init__(
        self,
        machine: Machine,
        group: Drives,
        modes: Modes,
        follow: Follow,
        jogging: Jogging,
        encoder: Encoder,
        snapshot: SnapshotBoard,
        recorder: Recorder,
    ) -> None:
        self._group, self._modes, self._follow, self._jogging = group, modes, follow, jogging
        self._encoder = encoder
        self._snapshot, self._recorder = snapshot, recorder
        self._states = [0] * len(group.drives)
        self._buses = _timed(machine, group.lines)

    def publish(
        self,
        tick: int,
        skips: int,
        late_max_s: float,
        accepted: int,
        rejected: int,
        peripherals: Peripherals,
        answers: Sequence[int],
    ) -> None:
        """The snapshot of this tick."""
        follow, modes, states = self._follow, self._modes, self._states
        piece = follow.piece
        for i, drive in enumerate(self._group.drives):
            states[i] = drive.state
        self._snapshot.write(
            tick,
            modes.mode,
            modes.fault,
            modes.fault_axis,
            follow.tau,
            follow.commit_s,
            follow.queue_end_s,
            follow.rate,
            modes.override,
            modes.rapid_override,
            follow.s,
            piece.motion_id if piece else STANDSTILL,
            follow.line,
            piece is not None and piece.cutting and not self._jogging.active,
            modes.homed,
            *follow.joints,
            *self._encoder.actual,
            *states,
            skips,
            late_max_s,
            accepted,
            rejected,
            peripherals.rev_min,
            peripherals.coolant,
            follow.at_rest,
            follow.epoch,
            follow.stopping,
            follow.limited_by,
            modes.single_block,
            modes.optional_stop,
            modes.interlock,
            peripherals.actual_rev_min,
            peripherals.at_speed,
            peripherals.waiting,
            peripherals.inputs,
            peripherals.outputs,
            modes.warning,
            modes.untrusted,
            self._jogging.active,
            modes.away,
            self._fault_off(),
            *answers,
        )

    def _fault_off(self) -> float:
        """How far the axis is from its command that stopped for that reason."""
        i = self._modes.fault_axis
        if self._modes.fault is not Fault.FOLLOWING_ERROR or i < 0:
            return 0.0
        return float(self._encoder.to_units(i, self._group.drives[i].following_error.actual))

    def record(
        self, tick: int, lateness_s: float, sent: bool, accepted: int, flags: int, request: int
    ) -> None:
        """The row of this tick; ``flags``: those of "switches" that are not the operator's."""
        follow, modes, encoder = self._follow, self._modes, self._encoder
        piece = follow.piece
        self._recorder.write(
            tick,
            modes.mode,
            modes.fault,
            piece.motion_id if piece else STANDSTILL,
            follow.line,
            piece is not None and piece.cutting and not self._jogging.active,
            follow.tau,
            follow.s,
            follow.rate,
            follow.feed,
            *follow.joints,
            *encoder.setpoints,
            *encoder.actual,
            lateness_s,
            sent,
            accepted,
            follow.limited_by,
            modes.override,
            modes.rapid_override,
            SINGLE_BLOCK * modes.single_block + OPTIONAL_STOP * modes.optional_stop + flags,
            request,
            self._bus_share(),
        )

    def _bus_share(self) -> float:
        """How full the fullest bus was since the last row; counted anew from here on."""
        fullest = 0.0
        for line, share_per_bit in self._buses:
            share = line.bits * share_per_bit
            line.bits = 0
            if share > fullest:
                fullest = share
        return fullest


def _timed(machine: Machine, lines: Sequence[Any]) -> tuple[tuple[Any, float], ...]:
    """Each bus with what one bit takes of a period; one without bit timing takes nothing."""
    rates = {bus.name: bus.bit_rate for bus in machine.buses}
    return tuple(
        (line, 1.0 / (rates[line.bus] * machine.period_s) if rates[line.bus] else 0.0) for line in lines
    )
