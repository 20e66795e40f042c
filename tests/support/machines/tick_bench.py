"""A tick on a bench: a machine, drives that obey at once, sockets, and a stepped clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from support.machines.shipped_kinds import machine as make_machine
from support.parts.paper_surfaces import example_2

from controller.geometry import arc_length
from controller.geometry.curves import Line
from controller.geometry.vectors import Frame
from controller.ipc.handoff import (
    COLUMN,
    Jog,
    Law,
    Outcome,
    Piece,
    PieceInbox,
    PieceMessage,
    PieceOutbox,
    Recorder,
    RequestInbox,
    Snapshot,
    SnapshotBoard,
    StopTable,
    dwell,
    piece_pair,
    request_pair,
    send_jog,
    send_request,
)
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Joints, Machine
from controller.motion.motions import JointMove, Motion, SurfaceCut
from controller.plan.feed.law import straight as closed_form
from controller.state.modes import Mode, Request
from controller.tick.cycle import Cycle
from controller.tick.loop import Loop, SteppedClock
from drives.cia402 import State, Wanted
from drives.cyclic.chatter import Chatter
from drives.cyclic.drive import DriveFault

Stops = Callable[[Piece, float, float], StopTable]  # of a piece that begins at a plan time; period


class FakeFollowingError:
    """Of a drive without lag."""

    actual = 0
    early = False


class FakeDrive:
    """Is where it was told to be one SYNC later; homes in three ticks."""

    def __init__(self, position: int = 0) -> None:
        self.position = position
        self.state = State.SWITCH_ON_DISABLED
        self.statusword = 0
        self.wanted = Wanted.OFF
        self.following = False
        self.cyclic = True
        self.homing_done = False
        self.homing_error = False
        self.homing_to = 0
        self.following_error = FakeFollowingError()
        self.in_position = True
        self.malformed = self.overdue = 0
        self.load = None
        self.missed = -1
        self.next = position
        self.velocity_units = 1.0
        self._homing = -1

    def want(self, wanted: Wanted) -> None:
        self.wanted = wanted

    def set_velocity_units(self, per_count_s: float) -> None:
        self.velocity_units = per_count_s

    def homing(self, start: bool) -> None:
        if start:
            self.cyclic = self.following = False
            self.homing_done = self.homing_error = False
        self._homing = 3 if start else -1

    def resume_cyclic(self) -> None:
        self.cyclic = True

    def step(self) -> None:
        """One SYNC: take the latched setpoint, and one step of the state machine."""
        if self.following:
            self.position = self.next
        enabled = self.wanted is Wanted.ENABLED
        self.state = State.OPERATION_ENABLED if enabled else State.SWITCH_ON_DISABLED
        self.following = enabled and self.cyclic
        if self._homing > 0 and enabled:
            self._homing -= 1
            if self._homing == 0:
                self.position, self.homing_done = self.homing_to, True


class FakeGroup:
    """Five of them on a bus without frames; notes when SYNC and setpoints went out."""

    def __init__(self, positions: Sequence[int]) -> None:
        self.drives = [FakeDrive(p) for p in positions]
        self.positions = list(positions)
        self.deaf = False  # the bus takes no SYNC
        self.failure: tuple[DriveFault, int] = (DriveFault.NONE, -1)
        self.unseen: dict[int, DriveFault] = {}
        self.wanted = Wanted.OFF
        self.spindle: Any = None
        self.io: Sequence[Any] = ()
        self.lines: Sequence[Any] = ()
        self.chatter = Chatter()
        self.syncs: list[float] = []
        self.commands: list[tuple[float, tuple[int, ...]]] = []

    def receive(self, now_s: float) -> None:
        self.positions[:] = [drive.position for drive in self.drives]

    def sync(self, now_s: float) -> bool:
        if self.deaf:
            return False
        self.syncs.append(now_s)
        for drive in self.drives:
            drive.step()
        return True

    def command(self, setpoints: Sequence[int], now_s: float) -> bool:
        self.commands.append((now_s, tuple(setpoints)))
        for drive, setpoint in zip(self.drives, setpoints, strict=True):
            drive.next = setpoint
        return True

    def want(self, wanted: Wanted) -> None:
        self.wanted = wanted
        for drive in self.drives:
            drive.want(wanted)

    def following(self) -> bool:
        return all(drive.following for drive in self.drives)

    def fault(self, now_s: float) -> tuple[DriveFault, int]:
        return self.failure

    def fault_of(self, index: int, now_s: float) -> DriveFault:
        return self.failure[0] if index == self.failure[1] else DriveFault.NONE

    def out_of_sight(self, index: int, now_s: float) -> DriveFault:
        return self.unseen.get(index, DriveFault.NONE)


class Bench:
    """A cycle with both ends of its sockets in hand; ``rows`` is what the recorder saw."""

    def __init__(
        self,
        machine: Machine | None = None,
        start: Joints = (0.0, 0.0, 0.0, 0.0, 0.0),
        lateness: Callable[[int], float] | None = None,
        spindle: Any = None,
        io: Sequence[Any] = (),
    ) -> None:
        self.machine = machine or make_machine()
        counts = [round(q * a.counts_per_unit) for q, a in zip(start, self.machine.axes, strict=True)]
        self.group = FakeGroup(counts)
        self.group.spindle, self.group.io = spindle, io
        plan_end, tick_end = piece_pair()
        self.requests, request_end = request_pair()
        self.outbox = PieceOutbox(plan_end)
        self.board = SnapshotBoard()
        self.recorder = Recorder()
        self.clock = SteppedClock((), lateness)
        self.cycle = Cycle(
            self.machine,
            self.group,
            PieceInbox(tick_end),
            RequestInbox(request_end),
            self.board,
            self.recorder,
            self.clock.now_s,
        )
        self.loop = Loop(self.cycle, self.clock)
        self.sequence = self.asked = 0  # numbers of the last message, and of the last request
        self.planner_alive = True
        self._ends = (plan_end, tick_end, self.requests, request_end)

    @property
    def snapshot(self) -> Snapshot:
        found = self.board.read()
        assert found is not None
        return found

    def ask(self, request: Request, value: float = 0.0) -> None:
        self.asked += 1
        send_request(self.requests, request, value, self.asked)

    def jog(self, order: Jog) -> None:
        self.asked += 1
        send_jog(self.requests, order, self.asked)

    @property
    def refused(self) -> bool:
        """Whether the tick has refused what was asked for last."""
        came = self.snapshot.came_of(self.asked)[0]
        assert came is not Outcome.NONE, "it is not answered yet"
        return came is Outcome.REFUSED

    def send(
        self,
        pieces: Sequence[Piece],
        motions: dict[int, Motion],
        at_s: float | None = None,
        stops: Stops | None = None,
        epoch: int | None = None,
        alone: bool = False,
    ) -> None:
        """A message for the queue's end, or for ``at_s``; with ``stops`` out of its first piece."""
        self.sequence += 1
        follow = self.cycle.follow
        start = follow.queue_end_s if at_s is None else at_s
        tables = () if stops is None else (stops(pieces[0], start, self.machine.period_s),)
        made_for = follow.epoch if epoch is None else epoch
        message = PieceMessage(self.sequence, start, motions, tuple(pieces), tables, made_for, alone)
        assert self.outbox.send(message)

    def tick(self, count: int = 1) -> None:
        for _ in range(count):
            if self.planner_alive and self.cycle.tick % 10 == 0:
                self.outbox.send(PieceMessage(self.sequence, 0.0))
            self.loop.tick()

    def until(self, mode: Mode, most: int = 100_000) -> None:
        for _ in range(most):
            self.tick()
            if self.cycle.modes.mode is mode:
                return
        raise AssertionError(f"{mode!r} was not reached in {most} ticks, but {self.snapshot}")

    def until_rest(self, most: int = 5000) -> None:
        for _ in range(most):
            self.tick()
            if self.cycle.follow.at_rest:
                return
        raise AssertionError("no standstill")

    def enable(self) -> None:
        self.ask(Request.ENABLE)
        self.until(Mode.READY, 20)

    def start_line(self, begin: Joints, end: Joints) -> None:
        """Have a line started, at 100 mm/s, with which the program ends."""
        piece, move = straight(begin, end, lambda n: s_curve(n, 100.0, 1900.0, 48000.0))
        self.send([piece, dwell(0.0, end=True)], {0: move})
        self.tick()
        self.ask(Request.START)

    def rows(self) -> NDArray[np.float64]:
        """Rows of the recorder since the last call."""
        return self.recorder.drain()

    def end_planner(self) -> None:
        """Its process is gone, and its end of the socket with it."""
        self.planner_alive = False
        self._ends[0].close()

    def close(self) -> None:
        for end in self._ends:
            end.close()


def commands(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Commanded joints of the ticks that sent a SYNC, (N, 5)."""
    first = COLUMN["joint_command_0"]
    return rows[rows[:, COLUMN["sync_sent"]] > 0.0, first : first + 5]


def excess(machine: Machine, joints: NDArray[np.float64]) -> tuple[float, float, float]:
    """Largest first, second and third difference of joints (N, 5), as shares of the limits."""
    T = machine.period_s
    shares = []
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        limits = np.array([getattr(axis.limits, name) for axis in machine.axes]) * T**order
        shares.append(float((np.abs(np.diff(joints, order, axis=0)) / limits).max()))
    return shares[0], shares[1], shares[2]


def s_curve(length: float, speed: float, acceleration: float, jerk: float) -> Law:
    """From rest to rest with constant jerks; speed is taken as reached."""
    ramp = acceleration / jerk
    flat = speed / acceleration - ramp
    assert flat >= 0.0 and length >= speed * (speed / acceleration + ramp), "too short for its speed"
    even = length / speed - (2.0 * ramp + flat)
    phases = ((ramp, jerk), (flat, 0.0), (ramp, -jerk), (even, 0.0), (ramp, -jerk), (flat, 0.0), (ramp, jerk))
    knots, rows = [0.0], []
    s = v = a = 0.0
    for t, j in phases:
        rows.append((s, v, a / 2.0, j / 6.0, 0.0, 0.0))
        knots.append(knots[-1] + t)
        s, v, a = s + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j
    return Law(tuple(knots), tuple(rows))


def straight(
    start: Joints, end: Joints, law: Callable[[float], Law], identity: int = 0, **more: object
) -> tuple[Piece, Motion]:
    """A move in a straight line of the joints of a machine with X Y Z first."""
    length = math.dist(start[:3], end[:3])
    move = JointMove(Line(start[:3], end[:3]), length, start[3:], end[3:])
    found = law(length)
    return Piece(identity, 1, found, found.duration_s, **more), move  # type: ignore[arg-type]


def rapid_law(length: float) -> Law:
    """At the very limits of X, Y and Z of the test machine."""
    return s_curve(length, 200.0, 2000.0, 50000.0)


def ruled_cut(machine: Machine, number: int = 0, feed: float = 1000.0 / 60.0) -> tuple[Piece, SurfaceCut]:
    """A surface of Example 2 with the ready-to-run cutter (left, r = 1.5), gently started and ended."""
    surface = example_2()[number]
    cut = SurfaceCut(surface, arc_length.of(surface.lower), -1.5, 0.0, machine.offsets[0])
    law = s_curve(cut.end, feed, 50.0, 400.0)
    return Piece(number + 10, 5, law, law.duration_s, cutting=True), cut


def cut_start(machine: Machine, cut: SurfaceCut, s: float = 0.0) -> Joints:
    """Joints at the start of a cut, on the branch that tilts forward."""
    found = cut.joints(s, (0.5, 0.0), kinematics_of(machine))
    assert found is not None
    return found


def part_tip(cut: SurfaceCut, joints: Joints, kinematics: Kinematics) -> tuple[float, float, float]:
    """The tool tip in the part frame."""
    pose = kinematics.forward(joints, cut.length_mm)
    tip: tuple[float, float, float] = Frame.from_parent(cut.part, pose.tip)
    return tip


@cache
def gentle_stop(v: float, a: float, acceleration: float, jerk: float, T: float) -> tuple[float, ...]:
    """Jerks, one a tick, that bring (v, a) to rest: the least squares over ticks enough."""
    n = 2
    while n < 5000:
        # The jerks are even + slope (left - mean), left = n - k - 1/2 the ticks that each has from its middle
        # to the end: their sums must take a and v away.
        even, mean = -a / (n * T), n / 2.0
        slope = ((-v - n * T * a) / T**2 - even * n * mean) / (n * (n * n - 1) / 12.0)
        if abs(even) + abs(slope) * (n - 1) / 2.0 <= jerk:
            jerks = even + slope * (n - np.arange(n) - 0.5 - mean)
            if np.abs(a + T * np.cumsum(jerks)).max() <= acceleration:
                return tuple(map(float, jerks))
        n += 1 + n // 16
    raise AssertionError("no stop")


def stops(acceleration: float, jerk: float) -> Stops:
    """Stops out of a piece every second tick; none where it ends sooner by itself."""

    def table(piece: Piece, start_s: float, T: float) -> StopTable:
        rows, end = list[tuple[float, ...]](), piece.law.at(piece.duration_s)[0]
        for i in range(int(piece.duration_s / (2.0 * T))):
            s, v, a = piece.law.at(2 * i * T)
            row = gentle_stop(v, a, acceleration, jerk, T) if v > 1e-6 else ()
            place, speed, slope = s, v, a
            for j in row:
                place += T * (speed + T * (slope / 2.0 + T * j / 6.0))
                speed, slope = speed + T * (slope + T * j / 2.0), slope + T * j
            rows.append(row if place < end else ())
        return StopTable.of(start_s, 2.0 * T, T, rows)

    return table


def rest_of(piece: Piece, s: float, speed: float, acceleration: float, jerk: float) -> Piece:
    """The piece's motion from rest at ``s`` to where the piece ends."""
    end = piece.law.at(piece.duration_s)[0]
    law = closed_form(end - s, speed, acceleration, jerk)
    rows = tuple((row[0] + s, *row[1:]) for row in law.coefficients)
    law = Law(law.knots_s, rows)
    return piece._replace(law=law, duration_s=law.duration_s)
