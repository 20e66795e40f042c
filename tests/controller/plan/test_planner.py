"""The planner keeps the queue full, window by window, never says half a thing, and follows the operator."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import pytest
from support.machines import traced_programs
from support.machines.planner_bench import BEGIN_S, PlannerBench
from support.machines.stepped_runs import program, shipped

from controller.ipc.handoff import Law, Piece
from controller.machine.model import Machine
from controller.messages import message
from controller.plan.planner import AHEAD_S
from controller.plan.segment import ContinuousPath, PathItem
from controller.program.program import ProgramError
from controller.state.modes import Mode

MOVES = "G0 X100.\nG1 F600. X120.\nX120. Y30.\nG4 P1.5\nM0\nG1 X0. Y0.\nM30\n"
LONG = "G0 X10. Y0.\nG2 F600. X10. Y0. I40. J0. P2\nM30\n"  # two turns: 50 s


def on_grid(t: float, machine: Machine) -> bool:
    ticks = (t - BEGIN_S) / machine.period_s
    return abs(ticks - round(ticks)) < 1e-6


def test_messages_go_on_where_the_last_one_ended_and_rests_are_on_the_ticks_grid() -> None:
    bench = PlannerBench(MOVES)
    bench.run()
    end_s = BEGIN_S
    assert [m.sequence for m in bench.sent] == list(range(1, len(bench.sent) + 1))
    for sent in bench.sent:
        assert sent.replace_from_s <= end_s + 1e-9 and on_grid(sent.replace_from_s, bench.machine)
        end_s = sent.replace_from_s + sum(piece.duration_s for piece in sent.pieces)
        assert on_grid(end_s, bench.machine)
    assert bench.planner.finished and bench.planner.finished_path
    assert len(bench.sent[0].pieces) == 1  # the first motion comes soon


def test_every_message_ends_at_rest_and_brings_the_motions_it_names() -> None:
    bench = PlannerBench(program("example2_ready.ngc", "3000."), shipped())
    bench.run()
    for sent in bench.sent:
        last = [piece for piece in sent.pieces if piece.motion_id >= 0]
        if last:
            assert abs(last[-1].law.at(last[-1].duration_s)[1]) < 1e-6
        assert {piece.motion_id for piece in sent.pieces} - {-1} >= set(sent.motions)
    assert {p.motion_id for m in bench.sent for p in m.pieces} - {-1} == {
        name for m in bench.sent for name in m.motions
    }


def test_only_the_last_piece_of_the_program_ends_it_and_a_stop_stops() -> None:
    bench = PlannerBench(MOVES)
    bench.run()
    ends = [piece.end for _, piece in bench.queue]
    assert ends[-1] and not any(ends[:-1])
    assert [piece.stop for _, piece in bench.queue].count(True) == 1


def test_a_dwell_lasts_as_the_program_says() -> None:
    bench = PlannerBench(MOVES)
    bench.run()
    assert any(p.duration_s == pytest.approx(1.5) for _, p in bench.queue if p.motion_id == -1)


def test_a_full_queue_gets_no_more() -> None:
    bench = PlannerBench(LONG)
    bench.fill()
    assert bench.end_s - BEGIN_S > AHEAD_S
    assert bench.end_s - BEGIN_S < 15.0 and not bench.planner.finished


def test_a_long_course_comes_in_windows_that_join_smoothly_and_lose_no_speed() -> None:
    bench = PlannerBench(LONG)
    bench.run()
    seams = [m.replace_from_s for m in bench.sent if m.pieces[0].law.at(0.0)[1] > 0.0]
    assert len(seams) >= 5
    for seam in seams:
        assert on_grid(seam, bench.machine)
        before, after = bench.state(seam - 1e-9), bench.state(seam)
        assert after == pytest.approx(before, abs=1e-5)
    first = next(at for at, p in bench.queue if not p.rapid)
    assert bench.speeds(first + 1.0, bench.end_s - 1.0).min() == pytest.approx(10.0, rel=1e-3)


def test_there_are_always_two_seconds_of_motion_ahead() -> None:
    bench = PlannerBench(LONG)
    bench.fill()
    while not bench.planner.finished:
        bench.at(bench.now.plan_time_s + 0.1)
        bench.fill()
        assert bench.planner.finished or bench.end_s - bench.now.plan_time_s > 2.0


def test_what_is_planned_does_not_depend_on_when_the_planner_is_asked() -> None:
    early, late = PlannerBench(LONG), PlannerBench(LONG)
    early.run(0.1)
    late.run(1.7)
    assert early.queue == late.queue


def test_a_refused_message_is_said_again() -> None:
    bench = PlannerBench(MOVES)
    first = bench.turn(take=False)
    again = bench.turn()
    assert first is not None and again is not None
    assert again.pieces == first.pieces and again.sequence == first.sequence + 1


def test_until_the_tick_has_answered_nothing_more_is_said() -> None:
    bench = PlannerBench(MOVES)
    bench.planner.work(bench.now)
    bench.planner.work(bench.now)
    assert len(bench.sent) == 1


def test_a_keepalive_carries_nothing() -> None:
    bench = PlannerBench(MOVES)
    bench.turn()
    bench.planner.keepalive()
    assert bench.sent[-1].is_keepalive


def test_after_a_drop_nothing_more_is_sent_and_the_path_is_not_called_finished() -> None:
    bench = PlannerBench(MOVES)
    bench.turn()
    bench.planner.drop()
    bench.at(1e9)
    assert bench.turn() is None
    assert bench.planner.finished and not bench.planner.finished_path


def test_a_new_path_after_a_drop_starts_at_the_queue_it_is_given() -> None:
    bench = PlannerBench(MOVES)
    bench.planner.drop()
    bench.planner.load(bench.items, 3.25, 4)
    bench.at(3.25, epoch=4)
    bench.queue = [(3.25, bench.items and Piece(-1, 0, Law((0.0, 0.0), ((0.0,) * 6,)), 0.0))]  # type: ignore[list-item]
    message = bench.turn()
    assert message is not None and (message.replace_from_s, message.epoch) == (3.25, 4)
    assert not bench.planner.finished_path


@pytest.mark.parametrize("override", [0.3, 2.0])
def test_a_changed_override_is_planned_out_of_the_motion_that_is_there(override: float) -> None:
    bench = PlannerBench(LONG)
    bench.fill()
    at = BEGIN_S + 6.0
    while bench.now.plan_time_s < at:
        bench.at(bench.now.plan_time_s + 0.25)
        bench.fill()
    before = list(bench.queue)
    bench.at(bench.now.plan_time_s, override=override)
    message = bench.turn()
    assert message is not None
    ahead = message.replace_from_s - bench.now.commit_s
    assert 0.0 <= ahead <= 0.1 and on_grid(message.replace_from_s, bench.machine)
    old = next(
        p.law.at(message.replace_from_s - t) for t, p in reversed(before) if t <= message.replace_from_s
    )
    assert message.pieces[0].law.at(0.0) == pytest.approx(old, abs=1e-6)
    bench.fill()
    assert bench.speeds(at + 1.0, at + 2.0).max() == pytest.approx(10.0 * override, rel=1e-3)


def test_an_override_planned_too_late_is_planned_again_from_further_ahead() -> None:
    bench = PlannerBench(LONG)
    bench.fill()
    bench.at(BEGIN_S + 3.0)
    bench.fill()
    bench.at(BEGIN_S + 3.0, override=0.5)
    first = bench.turn(take=False)
    again = bench.turn()
    assert first is not None and again is not None
    assert again.replace_from_s > first.replace_from_s


@pytest.mark.parametrize("override", [0.0, 1e-3])
def test_an_override_of_next_to_nothing_makes_finite_laws_or_none(override: float) -> None:
    bench = PlannerBench("G1 F600. X20.\nM30\n")
    bench.at(BEGIN_S, override=override)
    message = bench.turn()
    assert (message is None) is (override == 0.0)
    if message is not None:
        assert all(math.isfinite(p.duration_s) for p in message.pieces)


def test_rapids_are_planned_at_their_own_override() -> None:
    bench = PlannerBench("G0 X100.\nG1 F600. X200.\nM30\n")
    bench.at(BEGIN_S, override=0.5, rapid_override=0.25)
    bench.fill()
    rapid, feed = (p for _, p in bench.queue if p.motion_id >= 0)
    assert rapid.rapid and rapid.override == 0.25 and feed.override == 0.5
    x = bench.machine.axes[0].limits.velocity * bench.machine.rapid_share
    assert rapid.law.at(rapid.duration_s / 2)[1] == pytest.approx(0.25 * x, rel=0.01)
    assert feed.law.at(feed.duration_s / 2)[1] == pytest.approx(5.0, rel=1e-6)


def stopped_at(bench: PlannerBench, t: float, epoch: int = 1) -> tuple[int, float]:
    """The tick has stopped on the path where the plan was at ``t``: queue empty, epoch up."""
    t = BEGIN_S + round((t - BEGIN_S) / bench.machine.period_s) * bench.machine.period_s
    at, piece = next((at, p) for at, p in reversed(bench.queue) if at <= t)
    s = piece.law.at(t - at)[0]
    bench.queue = [(t, piece._replace(duration_s=0.0))]
    bench.at(t, mode=Mode.HOLD, epoch=epoch, motion_id=piece.motion_id, s=s, queue_end_s=t)
    bench.now = bench.now._replace(commit_s=t)
    return piece.motion_id, s


def test_after_a_stop_the_path_is_planned_from_where_the_tick_stands() -> None:
    bench = PlannerBench(MOVES)
    bench.fill()
    t = next(at for at, p in bench.queue if not p.rapid and p.motion_id >= 0) + 1.0
    motion, s = stopped_at(bench, t)
    message = bench.turn()
    assert message is not None and message.epoch == 1
    assert message.replace_from_s == bench.now.plan_time_s
    first = message.pieces[0]
    assert first.motion_id == motion and motion in message.motions
    assert first.law.at(0.0) == pytest.approx((s, 0.0, 0.0), abs=1e-9)
    bench.run()
    assert bench.queue[-1][1].end and bench.planner.finished_path


def test_a_stop_of_the_program_drops_what_was_not_sent() -> None:
    bench = PlannerBench(MOVES)
    bench.fill()
    bench.at(BEGIN_S + 1.0, mode=Mode.READY, epoch=1, motion_id=-1)
    assert bench.turn() is None
    assert not bench.planner.finished_path


def test_with_single_block_each_block_ends_at_rest_with_its_mark() -> None:
    bench = PlannerBench("G0 X0. Y0.\nG1 F3000. X40.\nX70.\nX100.\nM30\n")
    bench.at(BEGIN_S, switched=1)
    bench.run()
    moves = [p for _, p in bench.queue if p.motion_id >= 0]
    assert len(moves) == 4 and all(p.block_end for p in moves)
    assert all(abs(p.law.at(p.duration_s)[1]) < 1e-6 for p in moves)
    through = PlannerBench("G0 X0. Y0.\nG1 F3000. X40.\nX70.\nX100.\nM30\n")
    through.run()
    assert [p.law.at(p.duration_s)[1] > 1.0 for _, p in through.queue if not p.rapid][:2] == [True, True]


def test_the_path_is_read_only_as_far_as_it_is_needed_and_forgotten_behind() -> None:
    bench = PlannerBench("G1 F600. X10.\nM30\n")
    chain = next(item for item in bench.items if isinstance(item, ContinuousPath))
    read = 0

    def endless() -> Iterator[PathItem]:
        nonlocal read
        back = traced_programs.trace(
            "G1 F600. X10.\nX0.\nM30\n", bench.machine, chain.segments[0].start
        ).items
        while read < 10_000:
            read += 1
            yield from (item for item in back if isinstance(item, ContinuousPath))

    bench.planner.load(endless(), BEGIN_S)
    bench.fill()
    assert read < 20
    for _ in range(40):
        bench.at(bench.now.plan_time_s + 0.5)
        bench.fill()
    assert 5 < read < 60
    assert len(bench.planner._track._kept) < 20 and len(bench.planner.segments) == 0


def test_a_program_refused_on_the_way_ends_at_rest_and_says_why() -> None:
    bench = PlannerBench(MOVES)

    def refused(items: Iterable[PathItem]) -> Iterator[PathItem]:
        yield from list(items)[:2]
        raise ProgramError("part.ngc", 9, 1, message("path.nothing"))

    bench.planner.load(refused(bench.items), BEGIN_S)
    bench.run()
    assert bench.planner.finished and not bench.planner.finished_path
    assert isinstance(bench.planner.error, ProgramError)
    assert not any(p.end for _, p in bench.queue)
