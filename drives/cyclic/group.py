"""All nodes of a machine as the tick sees them: four calls per tick.

    receive(now)              drain every bus: feedback, emergencies, signs of life, inputs
    sync(now)                 SYNC: all drives latch the setpoints of the previous tick at once
    command(setpoints, now)   the setpoints for the next SYNC; what else is due after them
    fault(now)                what is wrong, as a value

SYNC goes out first, into an empty queue, so that it waits for one frame at most; on
several buses each gets its own. A TPDO is owed for each SYNC sent: a skipped one owes none.

Nothing here locks, logs, raises, or allocates anything that stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from drives import pdo
from drives.cia402 import Wanted
from drives.cyclic.chatter import Chatter
from drives.cyclic.drive import Drive
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.enabling import Enabling
from drives.cyclic.following_error import MEASURE_EVERY
from drives.cyclic.io_node import IoNode
from drives.cyclic.line import MAX_FRAMES, MAX_PERIODS, Line
from drives.cyclic.spindle import SpindleDrive
from drives.cyclic.supervised import Supervised
from drives.ports.port import Port
from drives.pump.plan_memory import Memory
from drives.pump.wires import BusWire
from drives.settings import MasterSettings

__all__ = ["MAX_FRAMES", "DriveFault", "Group"]

_NONE: Final = DriveFault.NONE
# What a drive is missed for, or says of us, on a bus on which frames do not get through: its emergencies for
# our heartbeat (8130h) and SYNC (8100h; 8700h, CiA 402-1), and for the setpoints.
MISSED: Final = (DriveFault.FEEDBACK_LOST, DriveFault.HEARTBEAT_LOST, DriveFault.SETPOINTS_LOST)
UNHEARD: Final = (0x8100, 0x8130, 0x8700)
_BUS_FLOODED: Final = DriveFault.BUS_FLOODED
_SEND_FAILED: Final = DriveFault.SEND_FAILED
_FINE: Final = (_NONE, -1)


class Group:
    """The drives in the order of the axes, on one or more buses, with spindle and inputs and outputs.

    Read: ``positions`` (counts, per drive), ``drives``, ``spindle``, ``io``, ``lines`` (the
    buses), ``chatter`` (who sends too much).
    """

    def __init__(
        self,
        drives: Sequence[Drive],
        ports: Mapping[str, Port],
        master: MasterSettings,
        spindle: SpindleDrive | None = None,
        io: Sequence[IoNode] = (),
    ) -> None:
        """``ports`` by name of the bus. Raises KeyError if a node's bus has none."""
        self.drives = tuple(drives)
        self.spindle = spindle
        self.io = tuple(io)
        self.master = master
        self.wanted = Wanted.OFF
        self.positions = [0] * len(self.drives)
        others = (*(() if spindle is None else (spindle,)), *self.io)
        self.chatter = Chatter()
        self.lines = _lines(self.drives, others, ports, master, self.chatter)
        self._line_of = tuple(next(line for line in self.lines if d in line.drives) for d in self.drives)
        self._turns = tuple(
            (line, tuple((self.drives.index(drive), drive) for drive in line.drives)) for line in self.lines
        )
        self._talkers = tuple(
            (line, node)
            for line in self.lines
            for node in (
                *(drive for drive in line.drives if drive.feed_forward),
                *line.others,
                *(
                    one.analogue
                    for one in line.others
                    if isinstance(one, IoNode) and one.analogue is not None
                ),
            )
        )
        self._guarded: tuple[tuple[Line, Supervised], ...] = tuple(
            (line, node) for line in self.lines for node in (*line.drives, *line.others) if node.guarded
        )
        self._measures = tuple(self.drives[turn::MEASURE_EVERY] for turn in range(MEASURE_EVERY))
        self._measured = 0
        self._guard_turn = 0
        self._guard_due_s = -math.inf if self._guarded else math.inf
        self._enabling = Enabling(self.drives)
        self._sync_frame = pdo.frame(pdo.SYNC)
        state = bytes([pdo.NMT_OPERATIONAL])
        self._heartbeat_frame = pdo.frame(pdo.HEARTBEAT + master.node_id, state)
        self._heartbeat_due_s = -math.inf
        self._judged = False  # something is wanted, so something can be wrong
        self._send_failed = False
        self._send_failed_at = -1

    @property
    def foreign_syncs(self) -> int:
        """SYNCs of another producer since start."""
        return sum(line.foreign_syncs for line in self.lines)

    def close(self) -> None:
        """Leaves every bus; silence makes the drives stop by their own supervision."""
        for line in self.lines:
            line.port.close()

    # -- every tick

    def receive(self, now_s: float, periods: int = 1, late: bool = False) -> None:
        """Takes what came in on every bus, and settles whether the feedback owed has come.

        ``periods`` since it was done last; ``late``: the answers to the newest SYNC may be there already, and
        are left for the next time.
        """
        most = MAX_FRAMES * (periods if periods < MAX_PERIODS else MAX_PERIODS)
        for line in self.lines:
            if late and line.has_answers(most):
                line.drain_answers(now_s)
            else:
                line.drain(now_s, most)
        self._received(now_s)

    def receive_answers(self, now_s: float, periods: int) -> bool:
        """For a period whose tick has not been run: what the drives have answered to one SYNC.

        ``periods`` since anything was received. False: nothing has come, and nothing is judged to be missing.
        """
        most = MAX_FRAMES * min(periods, MAX_PERIODS)
        if not any([line.has_answers(most) for line in self.lines]):
            return False
        for line in self.lines:
            line.drain_answers(now_s)
        self._received(now_s)
        return True

    def _received(self, now_s: float) -> None:
        positions = self.positions
        for i, drive in enumerate(self.drives):
            positions[i] = drive.position
        self._measured = turn = (self._measured + 1) % MEASURE_EVERY
        for drive in self._measures[turn]:
            drive.measure()
        if self._enabling.waits:
            self._enabling.progress(now_s)

    def sync(self, now_s: float) -> bool:
        """Sends SYNC on every bus; True if it went out."""
        good = True
        for line in self.lines:
            if line.off:
                good = False
            elif line.put(self._sync_frame, 0):
                line.expect()
            else:
                good = self._failed(line.first)
        return good

    def command(self, setpoints: Sequence[int], now_s: float) -> bool:
        """Sends each drive its setpoint (counts, order of ``drives``); True if all went out."""
        good = True
        for line, turns in self._turns:
            if line.off:
                good = False
                continue
            for i, drive in turns:
                refused = drive.refused
                frame = drive.frame(setpoints[i], now_s)
                if drive.refused != refused or not (line.packs or line.send(frame)):
                    good = self._failed(i)
            line.bits += line.setpoint_bits
            if line.packs and not line.send(line.packet):
                good = self._failed(line.first)
        good = self._send_events(now_s) and good
        if now_s >= self._heartbeat_due_s:
            good = self._beat(now_s) and good
        if now_s >= self._guard_due_s:
            good = self._guard(now_s) and good
        return good

    # -- with a pump, which sends SYNC, setpoints and our heartbeat in place of ``sync`` and ``command``

    @property
    def wires(self) -> tuple[BusWire, ...]:
        """What the pump sends by, in the order of ``lines``."""
        return tuple(
            BusWire(
                line.port,
                [(place, drive.wire) for place, drive in turns],
                line.packs,
                self.spindle.wire if self.spindle is not None and self.spindle in line.others else None,
            )
            for line, turns in self._turns
        )

    def show(self, memory: Memory) -> None:
        """Controlwords, positions and silent buses, as the pump is to have them from its next period on."""
        words, positions, units = memory.words, memory.positions, memory.velocity_units
        for i, drive in enumerate(self.drives):
            word = drive.word
            if word != words[i] or not drive.following:  # of one that follows nothing else changes
                positions[i], units[i] = drive.position, drive.velocity_per_period
                words[i] = word
        if self.spindle is not None:
            words[memory.drives], units[memory.drives] = self.spindle.word, self.spindle.units_per_rev_s
        muted = 0
        for i, line in enumerate(self.lines):
            muted |= line.off << i
        memory.muted = muted

    def was_played(self, setpoints: Sequence[int], beat: bool, rev_s: float | None = None) -> None:
        """One period has gone out: SYNC, then these setpoints, and our heartbeat if ``beat``.

        ``rev_s``: the spindle was led; None: it was not.
        """
        for line in self.lines:
            line.was_played(beat)
        for drive, setpoint in zip(self.drives, setpoints, strict=True):
            drive.was_sent(setpoint)
        if self.spindle is not None and rev_s is not None and self.spindle.was_led(rev_s):
            for line in self.lines:
                if self.spindle in line.others:
                    line.count(pdo.PDO_BYTES)

    def look_for_unsent(self, buses: int) -> None:
        """What the pump could not send: bit n, the n-th bus took nothing."""
        for i, line in enumerate(self.lines):
            if buses >> i & 1:
                self._failed(line.first)

    def send_events(self, now_s: float) -> None:
        """What is due besides: event-driven controlwords, spindle, outputs, guarding."""
        self._send_events(now_s)
        if now_s >= self._guard_due_s:
            self._guard(now_s)

    # -- what is due besides

    def _send_events(self, now_s: float) -> bool:
        good = True
        for line, node in self._talkers:
            if not line.off:
                event = node.event_frame(now_s, self.master.heartbeat_s)
                if event is None:
                    continue
                if not line.put(event, event[pdo.LENGTH_AT]):
                    good = self._failed(line.first)
        return good

    def _beat(self, now_s: float) -> bool:
        """Our heartbeat on every bus, also on one that is off: its answer tells when that is over."""
        self._heartbeat_due_s = now_s + self.master.heartbeat_s
        good = True
        for line in self.lines:
            if not line.put(self._heartbeat_frame, 1):
                good = self._failed(line.first)
        return good

    def _guard(self, now_s: float) -> bool:
        """Asks the next guarded node; each has its turn once a heartbeat, so that the bus is not crowded."""
        share_s = self.master.heartbeat_s / len(self._guarded)
        self._guard_due_s = max(self._guard_due_s, now_s - share_s) + share_s
        line, node = self._guarded[self._guard_turn]
        self._guard_turn = (self._guard_turn + 1) % len(self._guarded)
        node.request_sent(now_s)
        return line.put(node.guard_frame, 0) or self._failed(line.first)

    def _failed(self, index: int) -> bool:
        self._send_failed = True
        self._send_failed_at = index
        return False

    # -- state

    def want(self, wanted: Wanted) -> None:
        """Sets the goal of every drive, once per request; ENABLED and OFF group by group.

        RESET and ENABLED forget bus faults; RESET has a controller that is bus-off join again.
        """
        if wanted is Wanted.RESET or (wanted is Wanted.ENABLED and wanted is not self.wanted):
            self._forget(wanted is Wanted.RESET)
        self.wanted = wanted
        self._judged = wanted is Wanted.ENABLED or wanted is Wanted.QUICK_STOP
        self._enabling.want(wanted)
        if self.spindle is not None:
            self.spindle.want(wanted)
        for node in self.io:
            node.judge(self._judged)

    def _forget(self, reset: bool) -> None:
        self._send_failed = False
        self.chatter.forget()
        for line in self.lines:
            line.forget()
            if reset:
                line.restart()
        for node in self.io:
            node.forget(reset)

    def following(self) -> bool:
        """Whether every drive uses the commanded setpoints."""
        return all(drive.following for drive in self.drives)

    def fault(self, now_s: float) -> tuple[DriveFault, int]:
        """The first thing wrong and the index of its drive (of a bus: of its first drive; else -1).

        NONE with index -1 if all is well, or while nothing is wanted (OFF, RESET).
        """
        if not self._judged:
            return _FINE
        for line in self.lines:
            if line.fault is not _NONE:
                return line.fault, -1 if line.fault is _BUS_FLOODED else line.first
        consumer_s = self.master.consumer_s
        for i, drive in enumerate(self.drives):
            fault = drive.fault(now_s, consumer_s)
            if fault is not _NONE:
                missed = fault in MISSED or drive.emcy_code in UNHEARD
                floods = missed and self._line_of[i].floods(now_s, fault, drive.node)
                return (_BUS_FLOODED, -1) if floods else (fault, i)
        found = self._fault_of_others(now_s, consumer_s)
        if found is not _NONE and any(line.floods(now_s, found) for line in self.lines):
            found = _BUS_FLOODED
        if found is not _NONE:
            return found, self._send_failed_at if found is _SEND_FAILED else -1
        return _FINE

    def _fault_of_others(self, now_s: float, consumer_s: float) -> DriveFault:
        """What is wrong besides the drives."""
        if self.spindle is not None and self.spindle.fault(now_s, consumer_s) is not _NONE:
            return DriveFault.SPINDLE_LOST
        for node in self.io:
            if node.fault(now_s, consumer_s) is not _NONE:
                return DriveFault.IO_LOST
        return _SEND_FAILED if self._send_failed else _NONE

    def fault_of(self, index: int, now_s: float) -> DriveFault:
        """What is wrong with one drive, whatever else is wrong."""
        return self.drives[index].fault(now_s, self.master.consumer_s)

    def out_of_sight(self, index: int, now_s: float) -> DriveFault:
        """Whether one drive cannot be seen, or was not for a while, whatever it has reported before."""
        return self.drives[index].out_of_sight(now_s, self.master.consumer_s)


def _lines(
    drives: Sequence[Drive],
    others: Sequence[SpindleDrive | IoNode],
    ports: Mapping[str, Port],
    master: MasterSettings,
    told: Chatter,
) -> tuple[Line, ...]:
    """The buses in the order in which drives, spindle and inputs and outputs first name them."""
    lines = []
    for bus in dict.fromkeys(node.settings.bus for node in (*drives, *others)):
        here = [drive for drive in drives if drive.settings.bus == bus]
        more = [other for other in others if other.settings.bus == bus]
        first = drives.index(here[0]) if here else -1
        own = _own(here, master)
        lines.append(Line(ports[bus], here, first, more, bus, own, master.period_s, told))
    return tuple(lines)


def _own(drives: Sequence[Drive], master: MasterSettings) -> frozenset[int]:
    """Identifiers of setpoints, controlwords and heartbeat, which nobody else sends."""
    numbers = (
        (d.node, n) for d in drives for n in (d.settings.profile.rpdo, d.settings.profile.command_rpdo)
    )
    return frozenset((pdo.HEARTBEAT + master.node_id, *(pdo.rpdo(n, node) for node, n in numbers)))
