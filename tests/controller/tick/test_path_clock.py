"""The clock of the path by itself: its grid, the marks that it halts at and passes, what it goes by, threads.

Times of the plan are set against the grid of SYNCs, and joints against the law. On a whole machine:
``test_follow.py``.
"""

from __future__ import annotations

import pytest
from support.machines.path_bench import (
    SPEED,
    T,
    along_x,
    even,
    follower,
    loaded,
    message,
    piece_of,
    plan,
    steps,
)
from support.machines.shipped_kinds import machine

from controller.geometry.curves import Line
from controller.ipc.handoff import Piece, dwell
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Joints
from controller.motion.motions import Motion, ThreadMove
from controller.tick.coupling import Coupling
from controller.tick.follow import Follow, Step

MARKS = ("stop", "optional_stop", "block_end", "end")
HALTS = {"stop": Step.STOP, "optional_stop": Step.STOP, "block_end": Step.STOP, "end": Step.END}


# ---- the grid


def test_tick_by_tick_the_joints_are_the_plans_at_that_time() -> None:
    """Also in the first tick of a piece, and of the last one; boundaries lie between SYNCs."""
    follow = loaded(plan(0.0113, 0.0171, 0.0316))
    for n in range(1, 31):
        assert follow.step(True) is Step.MOVED
        assert follow.tau == n * T, "unmarked boundaries do not hold the clock"
        assert follow.joints[0] == pytest.approx(SPEED * n * T, abs=1e-9)
        assert follow.s == pytest.approx(SPEED * n * T, abs=1e-9)
        assert follow.rate == 1.0 and follow.feed == (SPEED if n < 30 else 0.0)


def test_the_clock_is_a_count_of_syncs_and_no_sum_of_periods() -> None:
    """Two thousand additions of 2 ms would be off the grid; also where it stood and was added to."""
    follow = loaded([dwell(0.2), *plan(5.0)])
    steps(follow, 7)
    steps(follow, 5, go=False)
    assert follow.accept(message(follow, [dwell(1.0)]))
    for n in range(8, 2000):
        follow.step(True)
        assert follow.tau == n * T


def test_a_runs_clock_counts_from_its_own_beginning() -> None:
    """To the last bit: the same run is the same whatever ran before it."""
    follow = loaded(plan(5 * T))
    steps(follow, 5)
    steps(follow, 2, go=False)
    begin = follow.tau
    assert follow.accept(message(follow, [dwell(1.0)]))
    for n in range(1, 200):
        follow.step(True)
        assert follow.tau == begin + n * T


def test_a_run_that_was_started_before_its_plan_begins_at_the_first_sync_behind_it() -> None:
    follow = follower()
    steps(follow, 5)
    assert follow.tau == 0.0 and follow.rate == 1.0
    assert follow.accept(message(follow, plan(1.0), {0: along_x()}))
    follow.step(True)
    assert follow.tau == T and follow.joints[0] == pytest.approx(SPEED * T)


def test_the_queues_end_is_not_overrun() -> None:
    follow = loaded(plan(0.0101))
    steps(follow, 9)
    assert follow.tau == follow.queue_end_s == pytest.approx(0.0101)
    assert not follow.pending and follow.joints[0] == pytest.approx(SPEED * 0.0101)
    assert follow.at_rest


def test_what_lies_behind_the_clock_is_forgotten_and_the_joints_are_right_all_the_same() -> None:
    follow = follower()
    for identity in range(60):
        begin = 40.0 * identity
        pieces = [piece_of(even(0.0, 0.5), identity), piece_of(even(20.0, 0.5), identity), dwell(0.1)]
        assert follow.accept(message(follow, pieces, {identity: along_x(begin, begin + 40.0)}))
        steps(follow, 275)
        n = follow.tau - 1.1 * identity
        assert n == pytest.approx(0.55, abs=1e-9)
        assert follow.joints[0] == pytest.approx(begin + SPEED * n, abs=1e-6)
        steps(follow, 275)
        assert len(follow._queue) <= 6 and len(follow._queue._motions) <= 2


def test_a_dwell_stands_where_the_motion_before_it_ended_also_when_that_is_long_ago() -> None:
    follow = loaded([*plan(0.1), dwell(0.05)])
    steps(follow, 60)
    for _ in range(4):
        assert follow.accept(message(follow, [dwell(0.05)]))
        steps(follow, 25)
        assert follow.joints[0] == pytest.approx(SPEED * 0.1)


# ---- marks


@pytest.mark.parametrize("mark", MARKS)
def test_the_clock_halts_at_a_mark_between_two_syncs_and_passes_it_once(mark: str) -> None:
    first, second = plan(0.0113, 0.5)
    follow = loaded([first._replace(**{mark: True}), second])  # type: ignore[arg-type]
    follow.heed(True, True)
    assert steps(follow, 6) == [Step.MOVED] * 5 + [HALTS[mark]]
    assert follow.tau == first.duration_s and follow.joints[0] == pytest.approx(SPEED * first.duration_s)
    assert steps(follow, 50) == [Step.MOVED] * 50
    assert follow.tau == pytest.approx(first.duration_s + 50 * T, abs=1e-12)
    assert follow.joints[0] == pytest.approx(SPEED * follow.tau)


@pytest.mark.parametrize("mark", ["optional_stop", "block_end"])
@pytest.mark.parametrize("other", [False, True])
def test_a_mark_that_the_operator_does_not_want_holds_nothing(mark: str, other: bool) -> None:
    first, second = plan(0.0113, 0.5)
    follow = loaded([first._replace(**{mark: True}), second])  # type: ignore[arg-type]
    if other:  # before anybody has asked for it, too
        follow.heed(mark != "optional_stop", mark != "block_end")
    assert steps(follow, 50) == [Step.MOVED] * 50
    assert follow.tau == 50 * T


def test_the_operators_switches_make_no_mark_where_the_program_has_none() -> None:
    follow = loaded(plan(0.0113, 0.5))
    follow.heed(True, True)
    assert steps(follow, 50) == [Step.MOVED] * 50 and follow.tau == 50 * T


def test_a_mark_without_duration_behind_a_boundary_between_two_syncs_is_met_at_its_time() -> None:
    first, second = plan(0.0113, 0.5)
    follow = loaded([first, dwell(0.0, stop=True), second])
    assert steps(follow, 6)[-1] is Step.STOP
    assert follow.tau == first.duration_s


def test_a_machine_that_is_held_finds_the_mark_when_it_goes_on() -> None:
    follow = loaded([*plan(0.01), dwell(0.0, stop=True), dwell(0.0, end=True)])
    assert steps(follow, 10, go=False)[-1] is Step.MOVED, "no stop begins here: it runs to the queue's end"
    assert follow.tau == pytest.approx(0.01)
    assert steps(follow, 3, go=False) == [Step.MOVED] * 3
    assert follow.step(True) is Step.STOP
    assert follow.step(True) is Step.END


def test_spindle_and_outputs_are_told_once_and_before_the_stop_of_the_same_piece() -> None:
    first, second = plan(0.01, 0.5)
    told = first._replace(sets=True, stop=True, outputs=(4, 2, ((0, 1.5),)), spindle_rev_min=800.0)
    follow = loaded([told, second])
    assert steps(follow, 5) == [Step.MOVED] * 4 + [Step.SET]
    assert follow.setting == told
    assert follow.piece is not None and follow.piece.outputs == (0, 0, ()) and not follow.piece.sets
    assert [follow.step(True), follow.step(True)] == [Step.STOP, Step.MOVED]


def test_a_position_that_was_taken_over_has_no_queue_and_another_epoch_where_there_was_one() -> None:
    follow = loaded(plan(0.5))
    steps(follow, 10)
    follow.set_joints((7.0, 0.0, 0.0, 0.0, 0.0))
    assert (follow.epoch, follow.piece, follow.s, follow.rate, follow.feed) == (1, None, 0.0, 0.0, 0.0)
    assert (follow.line, follow.limited_by) == (0, 0)
    assert follow.at_rest and not follow.pending and follow.queue_end_s == follow.tau
    follow.set_joints((8.0, 0.0, 0.0, 0.0, 0.0))
    assert follow.epoch == 1, "nothing was given up"
    assert follow.accept(message(follow, [dwell(0.1)]))
    follow.set_joints((9.0, 0.0, 0.0, 0.0, 0.0))
    assert follow.epoch == 2


def test_what_is_given_up_is_another_epoch_each_time_and_where_it_stood_stays_known() -> None:
    follow = loaded([dwell(1.0, 7)])
    for epoch in (1, 2, 3):
        steps(follow, 3)
        follow.give_up()
        assert (follow.epoch, follow.pending) == (epoch, False)
        assert follow.piece is not None and follow.piece.line == 7
        follow.give_up()
        assert follow.epoch == epoch, "there was nothing"
        assert follow.accept(message(follow, [dwell(1.0, 7)]))


def test_before_anything_was_planned_there_is_nothing() -> None:
    follow = follower()
    told = (follow.tau, follow.rate, follow.s, follow.feed, follow.line, follow.limited_by, follow.epoch)
    assert not any(told) and follow.piece is None and follow.at_rest and not follow.pending
    assert follow.commit_s == 0.0


@pytest.mark.parametrize("go", [False, True])
def test_standing_it_tells_whether_the_clock_would_run_and_feeds_nothing(go: bool) -> None:
    follow = follower()
    steps(follow, 3, go)
    assert (follow.rate, follow.feed, follow.tau) == (1.0 if go else 0.0, 0.0, 0.0)


def test_a_run_that_is_repeated_goes_by_the_clock_it_is_given() -> None:
    follow = follower()
    follow.set_clock(3.0)
    assert follow.commit_s == follow.tau == follow.queue_end_s == 3.0
    assert follow.accept(message(follow, plan(1.0), {0: along_x()}))
    follow.step(True)
    assert follow.tau == 3.0 + T and follow.joints[0] == pytest.approx(SPEED * T)


# ---- whether it goes


@pytest.mark.parametrize("rapid", [False, True])
def test_an_override_of_nothing_stops_what_it_is_for(rapid: bool) -> None:
    """From the first look at it on: nothing of it has been stepped yet."""
    follow = loaded([piece_of(even(0.0, 1.0), rapid=rapid)])
    for _ in range(2):
        assert follow.goes(True, 1.0, 1.0) and not follow.goes(False, 1.0, 1.0)
        assert follow.goes(True, 0.0, 1.0) is rapid
        assert follow.goes(True, 1.0, 0.0) is not rapid
        follow.step(True)


def test_without_anything_planned_it_goes_as_it_is_to() -> None:
    assert follower().goes(True, 0.0, 0.0) and not follower().goes(False, 1.0, 1.0)


def test_a_dwell_and_a_feed_of_its_own_heed_no_override() -> None:
    assert loaded([dwell(1.0)]).goes(True, 0.0, 0.0)
    follow = loaded([piece_of(even(0.0, 1.0), own_feed=True)])
    assert follow.goes(True, 0.0, 0.0)
    assert not follow.own_feed, "not under the clock yet"
    follow.step(True)
    assert follow.own_feed


def test_the_input_for_feed_counts_where_the_program_lets_it_from_the_first_look_on() -> None:
    assert follower().heeds_stop and loaded(plan(1.0)).heeds_stop
    assert not loaded([piece_of(even(0.0, 1.0), heeds_stop=False)]).heeds_stop


def test_ahead_is_the_piece_under_the_clock_or_the_next_where_that_is_over() -> None:
    pieces = [dwell(0.01, 1, stop=True), dwell(0.0, 2), dwell(0.5, 3)]
    follow = loaded(pieces)
    assert follow.ahead == pieces[0] and follower().ahead is None
    steps(follow, 5)
    assert follow.ahead == pieces[2]


# ---- a thread


class Tie:
    """Ties the axes to a spindle that is a millimetre behind, and has come when the test says so."""

    def __init__(self, active: bool = True) -> None:
        self.active, self.settled, self.releasing = active, False, False
        self.stayed = 0

    def look(self) -> None: ...

    def follow(self, thread: ThreadMove, s: float, v: float, a: float) -> float:
        return max(s - 1.0, 0.0)

    def place(self, thread: ThreadMove, s: float) -> float:
        return s

    def stay(self, joints: Joints, kinematics: Kinematics) -> Joints:
        self.stayed += 1
        return (joints[0] + 0.5, *joints[1:])

    def end(self) -> None:
        self.active = False

    def save(self) -> None: ...

    def restore(self, saved: None) -> None: ...


THREAD = ThreadMove(Line((0.0, 0.0, 0.0), (8.0, 0.0, 0.0)), 8.0, (0.0, 0.0), (0.0, 0.0))
AGAIN = ThreadMove(Line((8.0, 0.0, 0.0), (1000.0, 0.0, 0.0)), 992.0, (0.0, 0.0), (0.0, 0.0))
INTO = [
    piece_of(even(0.0, 0.0511)),
    piece_of(even(SPEED * 0.0511, 0.2 - 0.0511)),
]  # all of THREAD, in two pieces
OUT = piece_of(even(0.0, 1.0), 1)


def threading(*after: Piece, motion: Motion = AGAIN, active: bool = True) -> tuple[Follow, Tie]:
    built, tie = machine(), Tie(active)
    follow = Follow(built, kinematics_of(built), tie)  # type: ignore[arg-type]
    assert follow.accept(message(follow, [*INTO, *after], {0: THREAD, 1: motion}))
    return follow, tie


def test_the_clock_leaves_a_thread_only_when_the_spindle_has_come() -> None:
    follow, tie = threading(OUT)
    for n in range(1, 101):
        follow.step(True)
        assert follow.tau == n * T, "a piece that ends within the thread is passed"
    for _ in range(20):
        assert follow.step(True) is Step.MOVED
        assert follow.tau == pytest.approx(0.2) and follow.s == pytest.approx(8.0)
        assert follow.joints[0] == pytest.approx(7.0)
    tie.settled = True
    steps(follow, 5)
    assert follow.tau == pytest.approx(0.2 + 5 * T)


def test_without_a_tie_a_thread_is_a_line_like_others() -> None:
    follow, tie = threading(OUT, active=False)
    steps(follow, 120)
    assert follow.tau == 120 * T and not tie.releasing


@pytest.mark.parametrize(
    ("after", "motion", "releases"),
    [
        ([OUT], AGAIN, False),
        ([OUT], along_x(8.0, 1000.0), True),
        ([dwell(0.1), OUT], AGAIN, False),
        ([dwell(0.1), OUT], along_x(8.0, 1000.0), True),
        ([dwell(0.1)._replace(sets=True), OUT], AGAIN, True),
        ([dwell(0.0, end=True), OUT], AGAIN, True),
        ([dwell(0.1)], AGAIN, True),
        ([], AGAIN, True),
    ],
)
def test_the_spindle_is_let_go_where_no_other_thread_follows(
    after: list[Piece], motion: Motion, releases: bool
) -> None:
    """A dwell between two of them keeps it; not what tells the spindle something, and not the end."""
    follow, tie = threading(*after, motion=motion)
    steps(follow, 110)
    assert tie.releasing is releases and follow.tau == pytest.approx(0.2)


def test_a_path_that_stands_in_a_thread_stays_with_the_spindle_and_without_one_stays() -> None:
    for active in (False, True):
        built, tie = machine(), Tie(active)
        follow = Follow(built, kinematics_of(built), tie)  # type: ignore[arg-type]
        steps(follow, 3, go=False)
        assert tie.stayed == (3 if active else 0) and follow.joints[0] == (1.5 if active else 0.0)
        follow.set_joints((0.0,) * 5)
        assert follow.accept(message(follow, [dwell(1.0)]))
        follow.step(True)
        assert tie.stayed == (4 if active else 0) and follow.joints[0] == (0.5 if active else 0.0)


def test_the_tie_to_the_spindle_is_the_one_it_was_given() -> None:
    built = machine()
    tie = Coupling(built, None)
    assert Follow(built, kinematics_of(built), tie).coupling is tie
