"""The planner keeps the queue full, window by window, never says half a thing, and follows the operator."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
import pytest
from support.machines import traced_programs
from support.machines.stepped_runs import program, shipped

from controller.ipc.handoff import Law, Piece, PieceMessage, Snapshot
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.messages import message
from controller.plan.planner import AHEAD_S, Planner
from controller.plan.segment import ContinuousPath, PathItem
from controller.program.program import ProgramError
from controller.state.modes import Fault, Mode

MOVES = "G0 X100.\nG1 F600. X120.\nX120. Y30.\nG4 P1.5\nM0\nG1 X0. Y0.\nM30\n"
LONG = "G0 X10. Y0.\nG2 F600. X10. Y0. I40. J0. P2\nM30\n"  # two turns: 50 s
BEGIN_S = 7.0
LEAD_S = 0.02


class Desk:
    """A planner, and a tick that takes (or refuses) what it says and stands where it is told to."""

    def __init__(self, source: str, machine: Machine | None = None) -> None:
        self.machine = machine or shipped()
        home = tuple(axis.homing.position for axis in self.machine.axes)
        self.items = traced_programs.trace(source, self.machine, home).items  # type: ignore[arg-type]
        self.sent: list[PieceMessage] = []
        self.queue: list[tuple[float, Piece]] = []  # begin and piece, as the tick would have them
        self.planner = Planner(self.machine, kinematics_of(self.machine), self._send)
        self.planner.load(self.items, BEGIN_S)
        five = (0.0,) * 5
        fields = dict.fromkeys(Snapshot._fields, 0) | {
            "mode": Mode.RUNNING,
            "fault": Fault.NONE,
            "override": 1.0,
            "rapid_override": 1.0,
            "joints": five,
            "actual": five,
            "drive_states": (0,) * 5,
        }
        self.now = Snapshot(**fields)  # type: ignore[arg-type]
        self.at(BEGIN_S)

    def _send(self, message: PieceMessage) -> bool:
        self.sent.append(message)
        return True

    @property
    def end_s(self) -> float:
        return self.queue[-1][0] + self.queue[-1][1].duration_s if self.queue else BEGIN_S

    def at(self, plan_time_s: float, **changes: object) -> None:
        """The tick has come to a plan time."""
        commit_s = min(plan_time_s + LEAD_S, max(self.end_s, plan_time_s))
        self.now = self.now._replace(plan_time_s=plan_time_s, commit_s=commit_s, **changes)  # type: ignore[arg-type]

    def turn(self, take: bool = True) -> PieceMessage | None:
        """One turn of the planner; what it said, if it did."""
        before = len(self.sent)
        self.planner.work(self.now)
        assert len(self.sent) <= before + 1
        if len(self.sent) == before:
            return None
        message = self.sent[-1]
        if take:
            self._take(message)
        else:
            self.now = self.now._replace(rejected=message.sequence)
        return message

    def _take(self, message: PieceMessage) -> None:
        start = message.replace_from_s
        assert start <= self.end_s + 1e-9
        kept = [(at, piece) for at, piece in self.queue if at < start - 1e-9]
        if kept:
            at, piece = kept[-1]
            kept[-1] = (at, piece._replace(duration_s=min(piece.duration_s, start - at)))
        for piece in message.pieces:
            kept.append((start, piece))
            start += piece.duration_s
        self.queue = kept
        self.now = self.now._replace(accepted=message.sequence)

    def fill(self) -> None:
        """Turns at the present plan time until nothing more is said."""
        while self.turn() is not None:
            pass

    def run(self, step_s: float = 0.4) -> None:
        """All of the program."""
        self.fill()
        while not self.planner.finished or self.now.plan_time_s < self.end_s:
            self.at(self.now.plan_time_s + step_s)
            self.fill()

    def speeds(self, from_s: float, to_s: float, step_s: float = 0.01) -> np.ndarray:
        """ds/dt of the queue."""
        return np.array([self.state(t)[1] for t in np.arange(from_s, to_s, step_s)])

    def state(self, t: float) -> tuple[float, float, float]:
        at, piece = next((at, p) for at, p in reversed(self.queue) if at <= t)
        return piece.law.at(t - at)


def on_grid(t: float, machine: Machine) -> bool:
    ticks = (t - BEGIN_S) / machine.period_s
    return abs(ticks - round(ticks)) < 1e-6


def test_messages_go_on_where_the_last_one_ended_and_rests_are_on_the_ticks_grid() -> None:
    desk = Desk(MOVES)
    desk.run()
    end_s = BEGIN_S
    assert [m.sequence for m in desk.sent] == list(range(1, len(desk.sent) + 1))
    for sent in desk.sent:
        assert sent.replace_from_s <= end_s + 1e-9 and on_grid(sent.replace_from_s, desk.machine)
        end_s = sent.replace_from_s + sum(piece.duration_s for piece in sent.pieces)
        assert on_grid(end_s, desk.machine)
    assert desk.planner.finished and desk.planner.finished_path
    assert len(desk.sent[0].pieces) == 1  # the first motion comes soon


def test_every_message_ends_at_rest_and_brings_the_motions_it_names() -> None:
    desk = Desk(program("example2_ready.ngc", "3000."), shipped())
    desk.run()
    for sent in desk.sent:
        last = [piece for piece in sent.pieces if piece.motion_id >= 0]
        if last:
            assert abs(last[-1].law.at(last[-1].duration_s)[1]) < 1e-6
        assert {piece.motion_id for piece in sent.pieces} - {-1} >= set(sent.motions)
    assert {p.motion_id for m in desk.sent for p in m.pieces} - {-1} == {
        name for m in desk.sent for name in m.motions
    }


def test_only_the_last_piece_of_the_program_ends_it_and_a_stop_stops() -> None:
    desk = Desk(MOVES)
    desk.run()
    ends = [piece.end for _, piece in desk.queue]
    assert ends[-1] and not any(ends[:-1])
    assert [piece.stop for _, piece in desk.queue].count(True) == 1


def test_a_dwell_lasts_as_the_program_says() -> None:
    desk = Desk(MOVES)
    desk.run()
    assert any(p.duration_s == pytest.approx(1.5) for _, p in desk.queue if p.motion_id == -1)


def test_a_full_queue_gets_no_more() -> None:
    desk = Desk(LONG)
    desk.fill()
    assert desk.end_s - BEGIN_S > AHEAD_S
    assert desk.end_s - BEGIN_S < 15.0 and not desk.planner.finished


def test_a_long_course_comes_in_windows_that_join_smoothly_and_lose_no_speed() -> None:
    desk = Desk(LONG)
    desk.run()
    seams = [m.replace_from_s for m in desk.sent if m.pieces[0].law.at(0.0)[1] > 0.0]
    assert len(seams) >= 5
    for seam in seams:
        assert on_grid(seam, desk.machine)
        before, after = desk.state(seam - 1e-9), desk.state(seam)
        assert after == pytest.approx(before, abs=1e-5)
    first = next(at for at, p in desk.queue if not p.rapid)
    assert desk.speeds(first + 1.0, desk.end_s - 1.0).min() == pytest.approx(10.0, rel=1e-3)


def test_there_are_always_two_seconds_of_motion_ahead() -> None:
    desk = Desk(LONG)
    desk.fill()
    while not desk.planner.finished:
        desk.at(desk.now.plan_time_s + 0.1)
        desk.fill()
        assert desk.planner.finished or desk.end_s - desk.now.plan_time_s > 2.0


def test_what_is_planned_does_not_depend_on_when_the_planner_is_asked() -> None:
    early, late = Desk(LONG), Desk(LONG)
    early.run(0.1)
    late.run(1.7)
    assert early.queue == late.queue


def test_a_refused_message_is_said_again() -> None:
    desk = Desk(MOVES)
    first = desk.turn(take=False)
    again = desk.turn()
    assert first is not None and again is not None
    assert again.pieces == first.pieces and again.sequence == first.sequence + 1


def test_until_the_tick_has_answered_nothing_more_is_said() -> None:
    desk = Desk(MOVES)
    desk.planner.work(desk.now)
    desk.planner.work(desk.now)
    assert len(desk.sent) == 1


def test_a_keepalive_carries_nothing() -> None:
    desk = Desk(MOVES)
    desk.turn()
    desk.planner.keepalive()
    assert desk.sent[-1].is_keepalive


def test_after_a_drop_nothing_more_is_sent_and_the_path_is_not_called_finished() -> None:
    desk = Desk(MOVES)
    desk.turn()
    desk.planner.drop()
    desk.at(1e9)
    assert desk.turn() is None
    assert desk.planner.finished and not desk.planner.finished_path


def test_a_new_path_after_a_drop_starts_at_the_queue_it_is_given() -> None:
    desk = Desk(MOVES)
    desk.planner.drop()
    desk.planner.load(desk.items, 3.25, 4)
    desk.at(3.25, epoch=4)
    desk.queue = [(3.25, desk.items and Piece(-1, 0, Law((0.0, 0.0), ((0.0,) * 6,)), 0.0))]  # type: ignore[list-item]
    message = desk.turn()
    assert message is not None and (message.replace_from_s, message.epoch) == (3.25, 4)
    assert not desk.planner.finished_path


@pytest.mark.parametrize("override", [0.3, 2.0])
def test_a_changed_override_is_planned_out_of_the_motion_that_is_there(override: float) -> None:
    desk = Desk(LONG)
    desk.fill()
    at = BEGIN_S + 6.0
    while desk.now.plan_time_s < at:
        desk.at(desk.now.plan_time_s + 0.25)
        desk.fill()
    before = list(desk.queue)
    desk.at(desk.now.plan_time_s, override=override)
    message = desk.turn()
    assert message is not None
    ahead = message.replace_from_s - desk.now.commit_s
    assert 0.0 <= ahead <= 0.1 and on_grid(message.replace_from_s, desk.machine)
    old = next(
        p.law.at(message.replace_from_s - t) for t, p in reversed(before) if t <= message.replace_from_s
    )
    assert message.pieces[0].law.at(0.0) == pytest.approx(old, abs=1e-6)
    desk.fill()
    assert desk.speeds(at + 1.0, at + 2.0).max() == pytest.approx(10.0 * override, rel=1e-3)


def test_an_override_planned_too_late_is_planned_again_from_further_ahead() -> None:
    desk = Desk(LONG)
    desk.fill()
    desk.at(BEGIN_S + 3.0)
    desk.fill()
    desk.at(BEGIN_S + 3.0, override=0.5)
    first = desk.turn(take=False)
    again = desk.turn()
    assert first is not None and again is not None
    assert again.replace_from_s > first.replace_from_s


@pytest.mark.parametrize("override", [0.0, 1e-3])
def test_an_override_of_next_to_nothing_makes_finite_laws_or_none(override: float) -> None:
    desk = Desk("G1 F600. X20.\nM30\n")
    desk.at(BEGIN_S, override=override)
    message = desk.turn()
    assert (message is None) is (override == 0.0)
    if message is not None:
        assert all(math.isfinite(p.duration_s) for p in message.pieces)


def test_rapids_are_planned_at_their_own_override() -> None:
    desk = Desk("G0 X100.\nG1 F600. X200.\nM30\n")
    desk.at(BEGIN_S, override=0.5, rapid_override=0.25)
    desk.fill()
    rapid, feed = (p for _, p in desk.queue if p.motion_id >= 0)
    assert rapid.rapid and rapid.override == 0.25 and feed.override == 0.5
    x = desk.machine.axes[0].limits.velocity * desk.machine.rapid_share
    assert rapid.law.at(rapid.duration_s / 2)[1] == pytest.approx(0.25 * x, rel=0.01)
    assert feed.law.at(feed.duration_s / 2)[1] == pytest.approx(5.0, rel=1e-6)


def stopped_at(desk: Desk, t: float, epoch: int = 1) -> tuple[int, float]:
    """The tick has stopped on the path where the plan was at ``t``: queue empty, epoch up."""
    t = BEGIN_S + round((t - BEGIN_S) / desk.machine.period_s) * desk.machine.period_s
    at, piece = next((at, p) for at, p in reversed(desk.queue) if at <= t)
    s = piece.law.at(t - at)[0]
    desk.queue = [(t, piece._replace(duration_s=0.0))]
    desk.at(t, mode=Mode.HOLD, epoch=epoch, motion_id=piece.motion_id, s=s, queue_end_s=t)
    desk.now = desk.now._replace(commit_s=t)
    return piece.motion_id, s


def test_after_a_stop_the_path_is_planned_from_where_the_tick_stands() -> None:
    desk = Desk(MOVES)
    desk.fill()
    t = next(at for at, p in desk.queue if not p.rapid and p.motion_id >= 0) + 1.0
    motion, s = stopped_at(desk, t)
    message = desk.turn()
    assert message is not None and message.epoch == 1
    assert message.replace_from_s == desk.now.plan_time_s
    first = message.pieces[0]
    assert first.motion_id == motion and motion in message.motions
    assert first.law.at(0.0) == pytest.approx((s, 0.0, 0.0), abs=1e-9)
    desk.run()
    assert desk.queue[-1][1].end and desk.planner.finished_path


def test_a_stop_of_the_program_drops_what_was_not_sent() -> None:
    desk = Desk(MOVES)
    desk.fill()
    desk.at(BEGIN_S + 1.0, mode=Mode.READY, epoch=1, motion_id=-1)
    assert desk.turn() is None
    assert not desk.planner.finished_path


def test_with_single_block_each_block_ends_at_rest_with_its_mark() -> None:
    desk = Desk("G0 X0. Y0.\nG1 F3000. X40.\nX70.\nX100.\nM30\n")
    desk.at(BEGIN_S, switched=1)
    desk.run()
    moves = [p for _, p in desk.queue if p.motion_id >= 0]
    assert len(moves) == 4 and all(p.block_end for p in moves)
    assert all(abs(p.law.at(p.duration_s)[1]) < 1e-6 for p in moves)
    through = Desk("G0 X0. Y0.\nG1 F3000. X40.\nX70.\nX100.\nM30\n")
    through.run()
    assert [p.law.at(p.duration_s)[1] > 1.0 for _, p in through.queue if not p.rapid][:2] == [True, True]


def test_the_path_is_read_only_as_far_as_it_is_needed_and_forgotten_behind() -> None:
    desk = Desk("G1 F600. X10.\nM30\n")
    chain = next(item for item in desk.items if isinstance(item, ContinuousPath))
    read = 0

    def endless() -> Iterator[PathItem]:
        nonlocal read
        back = traced_programs.trace("G1 F600. X10.\nX0.\nM30\n", desk.machine, chain.segments[0].start).items
        while read < 10_000:
            read += 1
            yield from (item for item in back if isinstance(item, ContinuousPath))

    desk.planner.load(endless(), BEGIN_S)
    desk.fill()
    assert read < 20
    for _ in range(40):
        desk.at(desk.now.plan_time_s + 0.5)
        desk.fill()
    assert 5 < read < 60
    assert len(desk.planner._track._kept) < 20 and len(desk.planner.segments) == 0


def test_a_program_refused_on_the_way_ends_at_rest_and_says_why() -> None:
    desk = Desk(MOVES)

    def refused(items: Iterable[PathItem]) -> Iterator[PathItem]:
        yield from list(items)[:2]
        raise ProgramError("part.ngc", 9, 1, message("path.nothing"))

    desk.planner.load(refused(desk.items), BEGIN_S)
    desk.run()
    assert desk.planner.finished and not desk.planner.finished_path
    assert isinstance(desk.planner.error, ProgramError)
    assert not any(p.end for _, p in desk.queue)
