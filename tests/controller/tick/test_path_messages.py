"""The queue of the path by itself: stops out of it, what a message may change of it and what it leaves."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.path_bench import (
    SPEED,
    T,
    along_x,
    braking,
    even,
    follower,
    loaded,
    message,
    piece_of,
    plan,
    steps,
)
from support.machines.shipped_kinds import machine

from controller.ipc.handoff import StopTable, dwell
from controller.motion.pieces import commit_lead_s
from controller.state.queue_refusals import QueueRefusal
from controller.tick.follow import Step

# ---- stops


def stop_at(start_s: float, ticks: int, speed: float = SPEED) -> StopTable:
    """Out of the even speed, to rest: acceleration down, and up again."""
    half = ticks // 2
    jerk = speed / (half * T) ** 2
    return StopTable.of(start_s, T, T, [[-jerk] * half + [jerk] * half])


def test_while_it_is_to_go_no_stop_begins() -> None:
    follow = loaded(plan(1.0), [stop_at(n * T, 10) for n in range(100)])
    steps(follow, 100)
    assert not follow.stopping and follow.tau == 100 * T


@pytest.mark.parametrize("speed", [SPEED, 0.25])
def test_a_stop_runs_along_the_path_its_rate_falls_to_nothing_and_the_queue_is_void(speed: float) -> None:
    bound = piece_of(even(0.0, 1.0, speed))._replace(binds=((0.0, 11),))
    follow = loaded([bound], [stop_at(20 * T, 10, speed)])
    steps(follow, 20)
    assert follow.limited_by == 11
    rates = []
    for _ in range(10):
        follow.step(False)
        assert follow.stopping
        assert follow.rate == pytest.approx(follow.feed / speed)
        assert follow.joints[0] == pytest.approx(follow.s, abs=1e-9)
        assert follow.limited_by == 0, "no limit of the plan's holds it now"
        assert not follow.accept(message(follow, [dwell(1.0)]))
        assert follow.refusal is QueueRefusal.STOPPING
        rates.append(follow.rate)
    assert rates == sorted(rates, reverse=True) and rates[0] > 0.9 and rates[-1] == 0.0
    assert follow.tau == 20 * T, "the clock stands"
    place = follow.s
    follow.step(False)
    assert (follow.stopping, follow.epoch, follow.pending) == (False, 1, False)
    assert follow.s == place and follow.piece is not None and follow.joints[0] == pytest.approx(place)
    late = message(follow, [piece_of(even(place, 1.0))], {0: along_x()})
    assert not follow.accept(replace(late, epoch=0)), "made for what is void"
    assert follow.accept(late)
    steps(follow, 10)
    assert follow.joints[0] == pytest.approx(place + SPEED * 10 * T) and follow.limited_by == 0


def test_each_stop_is_an_epoch_and_so_is_a_position_that_is_taken_over_behind_one() -> None:
    follow = follower()
    for k in range(3):
        begin = follow.joints[0]
        stop = stop_at(follow.tau + 20 * T, 10)
        assert follow.accept(message(follow, [piece_of(even(begin, 1.0))], {0: along_x()}, stops=[stop]))
        steps(follow, 20)
        steps(follow, 11, go=False)
        assert follow.epoch == k + 1
    follow.set_joints(follow.joints)
    assert follow.epoch == 4, "where it stood on the path is no longer known"


def test_a_step_that_is_taken_back_is_made_again_the_same() -> None:
    for at in (5, 24):  # on the plan; along the stop
        follow = loaded(plan(1.0), [stop_at(20 * T, 10)])
        for n in range(at):
            follow.step(n < 20)
        before = follow.joints, follow.tau, follow.rate, follow.last, follow.before
        follow.step(at < 20)
        after = follow.joints, follow.tau, follow.rate, follow.last, follow.before
        follow.revert()
        assert (follow.joints, follow.tau, follow.rate, follow.last, follow.before) == before
        follow.step(at < 20)
        assert (follow.joints, follow.tau, follow.rate, follow.last, follow.before) == after


def test_put_to_rest_nothing_moves() -> None:
    follow = loaded(plan(1.0))
    steps(follow, 10)
    assert not follow.at_rest
    follow.put(follow.joints)
    assert follow.at_rest and follow.rate == 0.0 and follow.feed == 0.0


@pytest.mark.parametrize("back", [False, True])
def test_a_path_that_stands_with_the_drives_is_at_rest_at_the_setpoint_they_have(back: bool) -> None:
    """``back``: they have not used the last one."""
    follow = loaded(plan(1.0))
    steps(follow, 10)
    assert follow.stand(back)
    at = SPEED * (9 if back else 10) * T
    assert follow.joints[0] == pytest.approx(at) and follow.s == pytest.approx(at)
    assert follow.at_rest and follow.rate == 0.0 and follow.stopping
    follow.step(True)
    assert (follow.stopping, follow.epoch, follow.pending) == (False, 1, False)
    assert follow.joints[0] == pytest.approx(at)


def test_a_step_is_not_taken_back_into_what_has_been_forgotten_of_the_queue() -> None:
    follow = loaded(plan(0.01, 1.0))
    steps(follow, 5)
    assert follow.accept(message(follow, [dwell(1.0)])), "with it the first piece is forgotten"
    assert follow.stand(True)
    assert follow.joints[0] == pytest.approx(SPEED * 5 * T) and follow.s == pytest.approx(SPEED * 5 * T)


def test_a_stop_that_has_come_to_rest_stands_anyway() -> None:
    follow = loaded(plan(1.0), [stop_at(20 * T, 10)])
    steps(follow, 20)
    steps(follow, 5, go=False)
    assert follow.stand(False) and follow.at_rest, "in the middle of it"
    follow = loaded(plan(1.0), [stop_at(20 * T, 10)])
    steps(follow, 20)
    steps(follow, 10, go=False)
    assert not follow.stand(False) and follow.stopping


def test_where_the_plan_rests_there_is_nothing_to_stand_still() -> None:
    follow = loaded([dwell(1.0)])
    steps(follow, 10)
    assert not follow.stand(True) and not follow.stand(False)
    assert follow.epoch == 0 and follow.tau == 10 * T


# ---- messages


def test_between_the_commit_point_and_the_queues_end_a_message_is_taken() -> None:
    follow = loaded(plan(1.0))
    assert follow.commit_s == 0.0, "before it goes all of it may be replaced"
    steps(follow, 10)
    assert follow.commit_s == pytest.approx(10 * T + commit_lead_s(T))
    rest = [dwell(0.1)]
    assert not follow.accept(message(follow, rest, at_s=follow.commit_s - 1e-6))
    assert not follow.accept(message(follow, rest, at_s=follow.queue_end_s + 1e-6))
    assert follow.accept(message(follow, rest, at_s=follow.queue_end_s))
    assert follow.accept(message(follow, rest, at_s=follow.commit_s))
    assert follow.queue_end_s == pytest.approx(10 * T + commit_lead_s(T) + 0.1)


def test_where_a_piece_is_cut_its_marks_are_gone_with_its_end_and_the_new_law_holds() -> None:
    marked = piece_of(even(0.0, 1.0), stop=True, optional_stop=True, block_end=True, end=True)
    follow = loaded([marked])
    assert follow.accept(message(follow, [piece_of(even(4.0, 1.0, SPEED / 4.0))], at_s=0.1))
    follow.heed(True, True)
    for n in range(1, 540):
        assert follow.step(True) is Step.MOVED
        t = n * T
        assert follow.joints[0] == pytest.approx(SPEED * min(t, 0.1) + SPEED / 4.0 * max(t - 0.1, 0.0))
        assert follow.tau == n * T


@pytest.mark.parametrize("at_s", [0.05, 0.1, 0.15, 0.2, 0.25])
def test_what_begins_later_than_a_replacement_is_gone(at_s: float) -> None:
    follow = loaded(plan(0.1, 0.1, 0.1))
    new = [piece_of(even(SPEED * at_s, 0.1, SPEED / 4.0)), dwell(0.3)]
    assert follow.accept(message(follow, new, at_s=at_s))
    assert follow.queue_end_s == pytest.approx(at_s + 0.4)
    steps(follow, 190)
    assert follow.joints[0] == pytest.approx(SPEED * at_s + SPEED / 4.0 * 0.1)


def test_at_the_queues_end_a_message_begins_at_that_end_whatever_was_rounded_on_its_way() -> None:
    follow = loaded(plan(1.0))
    assert follow.accept(message(follow, [dwell(1.0)], at_s=1.0 - 5e-10))
    assert follow.queue_end_s == 2.0
    assert follow.accept(message(follow, [dwell(1.0)], at_s=2.0 + 5e-10))
    assert follow.queue_end_s == 3.0


def test_another_motion_may_begin_at_a_boundary_ahead() -> None:
    """That it begins where the one before it ends each setpoint will tell."""
    follow = loaded(plan(0.1, 0.5))
    new = message(follow, [piece_of(even(0.0, 1.0), 1)], {1: along_x(4.0, 500.0)}, at_s=0.1)
    assert follow.accept(new)
    steps(follow, 100)
    assert follow.joints[0] == pytest.approx(SPEED * 100 * T)


def test_places_that_are_one_to_a_drive_are_one() -> None:
    follow, axes = follower(), machine().axes
    for i, axis in enumerate(axes):
        count = max(1.0 / abs(axis.counts_per_unit), 1e-6)
        for share, same in ((0.9, True), (-0.9, True), (1.5, False), (-1.5, False)):
            there = tuple(share * count if k == i else 0.0 for k in range(len(axes)))
            assert follow.same_place((0.0,) * len(axes), there) is same


def test_where_a_piece_ends_just_there_its_marks_stay() -> None:
    first, second = plan(0.1, 0.5)
    follow = loaded([first._replace(stop=True), dwell(0.0, optional_stop=True), second])
    follow.heed(True, True)
    assert follow.accept(message(follow, [piece_of(even(4.0, 0.7))], at_s=0.1))
    assert follow.queue_end_s == pytest.approx(0.8)
    found = steps(follow, 60)
    assert [n for n, step in enumerate(found) if step is Step.STOP] == [49, 50]


def test_a_message_that_goes_on_elsewhere_on_the_same_motion_is_refused() -> None:
    follow = loaded(plan(1.0))
    assert not follow.accept(message(follow, [piece_of(even(4.0 + 1e-4, 1.0))], at_s=0.1))
    assert not follow.accept(message(follow, [piece_of(even(1e-2, 1.0))], at_s=0.0))
    assert follow.accept(message(follow, [piece_of(even(4.0, 1.0))], at_s=0.1))


def test_a_dwell_behind_a_piece_that_was_cut_stands_where_it_was_cut() -> None:
    follow = loaded(plan(1.0))
    assert follow.accept(message(follow, [dwell(0.5)], at_s=0.1))
    steps(follow, 200)
    assert follow.joints[0] == pytest.approx(SPEED * 0.1)


def test_where_the_clock_is_any_motion_must_begin_at_the_joints() -> None:
    follow = loaded(plan(1.0))
    piece = piece_of(even(0.0, 1.0), 1)
    assert not follow.accept(message(follow, [piece], {1: along_x(5.0, 500.0)}, at_s=0.0))
    assert follow.accept(message(follow, [piece], {1: along_x(0.0, 500.0)}, at_s=0.0))


def test_a_boundary_within_a_motion_is_checked_and_what_is_appended_ahead_is_not() -> None:
    follow = loaded(plan(0.1, 0.5))
    assert not follow.accept(message(follow, [piece_of(even(4.001, 1.0))], at_s=0.1))
    assert follow.accept(message(follow, [piece_of(even(SPEED * 0.6, 1.0))]))
    assert follow.queue_end_s == pytest.approx(1.6)


def test_a_plan_that_rests_at_the_boundary_still_does_when_what_follows_is_replaced() -> None:
    """Under the clock stays the piece that ends there, not one before it, which ended at speed."""
    pieces = [piece_of(even(0.0, 0.1)), piece_of(braking(4.0, 0.1)), dwell(0.5), dwell(0.5)]
    follow = loaded(pieces)
    steps(follow, 100)
    steps(follow, 1, go=False)
    assert follow.tau == 100 * T and follow.at_rest is False
    assert follow.accept(message(follow, [dwell(0.3)], at_s=100 * T))
    steps(follow, 10, go=False)
    assert follow.tau == 100 * T and follow.at_rest and follow.joints[0] == pytest.approx(6.0)


def test_an_accepted_message_begins_here_only_where_nothing_of_the_queue_is_left_before_it() -> None:
    follow = loaded([dwell(0.1)])
    move = piece_of(even(0.0, 1.0))
    assert follow.begins_here(message(follow, [move], at_s=0.0))
    assert not follow.begins_here(message(follow, [move], at_s=0.1))
    assert not follow.begins_here(message(follow, [dwell(1.0)], at_s=0.0)), "it moves nothing"


def test_a_rehearsal_changes_nothing() -> None:
    plain, rehearsed = (loaded(plan(0.0113, 0.0171, 0.5), [stop_at(20 * T, 10)]) for _ in range(2))
    follower().rehearse()
    for n in range(40):
        rehearsed.rehearse()
        assert rehearsed.step(n < 20) is plain.step(n < 20)
        assert (rehearsed.joints, rehearsed.tau, rehearsed.s) == (plain.joints, plain.tau, plain.s)


def test_by_hand_the_clock_stands_and_the_queue_stays() -> None:
    follow = loaded([dwell(0.1), *plan(1.0)])
    steps(follow, 5)
    follow.move_to((0.01, 0.0, 0.0, 0.0, 0.0))
    assert (follow.tau, follow.rate, follow.feed, follow.pending) == (5 * T, 0.0, 0.0, True)
    assert follow.commit_s == follow.tau, "all of it may be replaced"
    assert follow.joints[0] == 0.01 and not follow.at_rest
    follow.revert()
    assert follow.joints[0] == 0.0
