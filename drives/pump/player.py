"""What the pump does in one period: SYNC, the setpoints, our heartbeat; and it says so.

It decides nothing: what is sent in which period the plan says, also what comes after its end. Times are its
caller's, so that it is the same on a stepped clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from drives import pdo
from drives.pdo import INT32_MAX, INT32_MIN
from drives.pump.braking import Braking, led_rev_s
from drives.pump.plan_memory import FOLLOWS, NOTHING_PLAYED, Memory, Phase, PlanReader, Played
from drives.pump.setpoint_frame import SetpointFrame
from drives.pump.wires import BusWire

# SYNCs in a row that did not come: drives that hold their last setpoint have stopped meanwhile, and
# to go on at full feed would be a step for them. Fewer are a dip that a servo smooths.
LONG_GAP: Final = 4
LATE_SHARE: Final = 0.25  # of the period: a SYNC that is later would shift the drives' interpolation
EARLY_SHARE: Final = 0.2  # of the period: what it sends is chosen so long before


class _Bus:
    def __init__(self, wire: BusWire) -> None:
        self.send = wire.port.send
        self.frames = [(place, SetpointFrame(*one)) for place, one in wire.drives]
        self.spindle = None if wire.spindle is None else SetpointFrame(*wire.spindle)
        # None on a bus without drives, too: an empty packet is what a hub takes for our end.
        packs = wire.packs and bool(self.frames)
        self.packet = bytearray(pdo.FRAME_BYTES * len(self.frames)) if packs else None
        if self.packet is not None:
            room = memoryview(self.packet)
            for i, (_, frame) in enumerate(self.frames):
                frame.place(room[i * pdo.FRAME_BYTES : (i + 1) * pdo.FRAME_BYTES])


class Player:
    """The pump without its clock."""

    def __init__(
        self, memory: Memory, buses: Sequence[BusWire], period_s: float, master: int, beat_every: int
    ) -> None:
        """``master``: our node; ``beat_every``: periods from one of its heartbeats to the next."""
        self._memory, self._plan, self._period_s = memory, PlanReader(memory), period_s
        self._buses = [_Bus(wire) for wire in buses]
        self._sync = pdo.frame(pdo.SYNC)
        self._heartbeat = pdo.frame(pdo.HEARTBEAT + master, bytes([pdo.NMT_OPERATIONAL]))
        self._beat_every = beat_every
        self._braking: Braking | None = None
        self._held = 0  # periods at the end of the plan
        self._counts: Sequence[int] = ()
        self._rev_s: float | None = None  # of the spindle on a thread; None: on none
        self._led_rev_s: float | None = None  # that it is told, there or by its ramp; None: nothing
        self._before: Sequence[int] = ()
        self.phase = Phase.SILENT
        self._since, self._phase_before = -1, Phase.SILENT
        self._played = NOTHING_PLAYED
        self.period = -1
        self.slips = 0
        self._finishing = False
        self.unsent = 0  # bit n: the n-th bus took nothing in this period

    def slip(self, periods: float) -> None:
        """The pump was late by so much, and every later period is: after a long gap the motors stand."""
        self.slips += 1
        if periods > LONG_GAP and self.phase is not Phase.SILENT:
            self.phase, self._held = Phase.GAP, 0

    def finish(self) -> None:
        """No further plan is taken: what is there is played to its end."""
        self._finishing = True

    def prepare(self) -> None:
        """What the next period sends, from the newest plan: before its time."""
        self.period += 1
        plan = self._plan
        plan.begin_report()
        begins = self.phase in (Phase.SILENT, Phase.GAP)
        if not self._finishing and plan.take(self.period, begins):
            self._braking, self._held = None, 0
            if begins:
                self.phase = Phase.NOMINAL
        plan.report(self._chosen(self._played))
        self._before = self._counts
        if self.phase is Phase.GAP:
            self._hold()
        elif self.phase is not Phase.SILENT:
            self._choose(self.period - plan.first)
        self._led_rev_s = plan.ramp.at(self.period) if self._rev_s is None else self._rev_s

    def _choose(self, i: int) -> None:
        plan = self._plan
        if i < plan.nominal:
            row, drives = plan.row(i), self._memory.drives
            self.phase, self._counts = Phase.NOMINAL, to_counts(row[1 : 1 + drives])
            self._rev_s = led_rev_s(row[1 + drives :])
            return
        if plan.stop is not None and self._braking is None:
            at, thread = plan.nominal - 1, self._memory.thread
            self._braking = Braking(plan.stop, self._period_s, plan.row, at, plan.rows, thread)
        if self._braking is not None and not self._braking.over:
            self.phase, self._counts = Phase.BRAKING, to_counts(self._braking.step())
            self._rev_s = self._braking.rev_s
            return
        self.phase = Phase.HOLDING
        self._hold()

    def _hold(self) -> None:
        if self._rev_s is not None:
            self._rev_s = 0.0
        self._held += 1
        if self._held > self._plan.hold:
            self.phase = Phase.SILENT

    def send(self, due_ns: int, late_ns: int) -> None:
        """Hands the period over, and records it; ``due_ns``: when the next one is due."""
        unsent, muted = 0, self._memory.muted
        if self.phase is not Phase.SILENT:
            for i, bus in enumerate(self._buses):
                if not muted >> i & 1 and not bus.send(self._sync):
                    unsent |= 1 << i
            for i, bus in enumerate(self._buses):
                if not muted >> i & 1 and not self._send_setpoints(bus):
                    unsent |= 1 << i
            if self.period % self._beat_every == 0:
                for i, bus in enumerate(self._buses):
                    if not bus.send(self._heartbeat):
                        unsent |= 1 << i
        if self.phase is not self._phase_before:
            self._phase_before, self._since = self.phase, self.period
        plan = self._plan
        self.unsent = unsent
        played = self.period, plan.number, self.phase, self.slips, unsent, due_ns, plan.refused, late_ns
        self._played = self._chosen(Played(*played, self._since))
        plan.report(self._played)

    def _chosen(self, played: Played) -> Played:
        plan = self._plan
        return played._replace(number=plan.number, refused=plan.refused, prepared=self.period, seen=plan.seen)

    def _send_setpoints(self, bus: _Bus) -> bool:
        memory, counts, before, good = self._memory, self._counts, self._before, True
        for i, frame in bus.frames:
            word = memory.words[i]
            follows = word & FOLLOWS
            setpoint = counts[i] if follows else memory.positions[i]
            if frame.feed_forward:
                moved = setpoint - before[i] if before and follows else 0
                frame.pack_velocity(setpoint, round(moved * memory.velocity_units[i]))
            else:
                frame.pack_word(word & 0xFFFF, setpoint)
            if bus.packet is None:
                good = bus.send(frame.buffer) and good
        if bus.packet is not None:
            good = bus.send(bus.packet)
        spindle, word = bus.spindle, memory.words[memory.drives]
        if spindle is not None and self._led_rev_s is not None and word & FOLLOWS:
            spindle.pack_word(word & 0xFFFF, to_speed(self._led_rev_s, memory.velocity_units[memory.drives]))
            good = bus.send(spindle.buffer) and good
        return good


def beat_every(period_s: float, heartbeat_s: float) -> int:
    """Periods from one of our heartbeats to the next."""
    return max(1, int(heartbeat_s / period_s + 1e-9))


def to_counts(counts: Sequence[float]) -> Sequence[int]:
    """As they go out: rounded, and within 32 bits."""
    found = list(map(round, counts))
    if min(found) >= INT32_MIN and max(found) <= INT32_MAX:
        return found
    return [max(INT32_MIN, min(INT32_MAX, one)) for one in found]


def to_speed(rev_s: float, units: float) -> int:
    """A spindle's speed as it goes out; ``units`` in one rev/s."""
    return max(INT32_MIN, min(INT32_MAX, round(rev_s * units)))
