"""Following the plan: taking pieces, holding anywhere on the path, overrides, stops."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.machines.tick_bench import (
    Bench,
    commands,
    cut_start,
    excess,
    part_tip,
    rapid_law,
    rest_of,
    ruled_cut,
    s_curve,
    stops,
    straight,
)

from controller.ipc.handoff import COLUMN, Piece, PieceMessage, dwell
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints
from controller.motion.motions import Motion, SurfaceCut
from controller.plan.feed.law import split
from controller.state.modes import Fault, Mode, Request
from controller.state.queue_refusals import QueueRefusal

HERE: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE: Joints = (100.0, 60.0, -80.0, 1.0, 2.0)


RAPID = (170.0, 1900.0, 48000.0)  # speed, acceleration and jerk along the line from HERE to THERE
CUT = (1000.0 / 60.0, 50.0, 400.0)


class Ride(NamedTuple):
    """A bench whose one piece has just started, with all that is needed to send it again."""

    bench: Bench
    piece: Piece
    motion: Motion
    limits: tuple[float, float, float]

    @property
    def ticks(self) -> int:
        return int(self.piece.duration_s / self.bench.machine.period_s)

    def send_rest(self) -> None:
        """What the planner does after a stop: the path from where the tick stands."""
        found = rest_of(self.piece, self.bench.snapshot.s, *self.limits)
        self.bench.send([found, END], {found.motion_id: self.motion}, stops=stops(*self.limits[1:]))


END = dwell(0.0, end=True)
MARKS = (("block_end", Request.SINGLE_BLOCK), ("optional_stop", Request.OPTIONAL_STOP))


def started(bench: Bench, piece: Piece, motion: Motion, limits: tuple[float, float, float]) -> Ride:
    bench.enable()
    bench.send([piece, END], {piece.motion_id: motion}, stops=stops(*limits[1:]))
    bench.tick()
    bench.ask(Request.START)
    bench.tick()
    return Ride(bench, piece, motion, limits)


def move_ride() -> Ride:
    return started(Bench(), *straight(HERE, THERE, lambda n: s_curve(n, *RAPID)), RAPID)


def running_move() -> Bench:
    """A bench in the middle of nothing yet: one feed move near all limits, started."""
    return move_ride().bench


def cut_ride(number: int) -> Ride:
    built = machine()
    piece, cut = ruled_cut(built, number)
    return started(Bench(built, start=cut_start(built, cut)), piece, cut, CUT)


RIDES: dict[str, Callable[[], Ride]] = {
    "line": move_ride,
    "first surface": lambda: cut_ride(0),
    "second surface": lambda: cut_ride(1),
}


def distance_to_path(bench: Bench, cut: SurfaceCut, rows: np.ndarray) -> float:
    """Largest distance (mm) between commanded tips and the cut's own tip at the recorded s."""
    kinematics = kinematics_of(bench.machine)
    worst = 0.0
    # Before the start the joints are those of the drives, rounded to counts.
    cutting = rows[(rows[:, COLUMN["cutting"]] > 0) & (rows[:, COLUMN["mode"]] != Mode.READY)]
    for row, joints in zip(cutting, commands(cutting), strict=True):
        tip = part_tip(cut, tuple(joints), kinematics)
        worst = max(worst, float(np.linalg.norm(np.subtract(tip, cut.pose(row[COLUMN["s"]]).tip))))
    return worst


def test_a_move_arrives_and_the_program_ends_ready() -> None:
    bench = running_move()
    bench.until(Mode.READY)
    assert bench.cycle.follow.joints == pytest.approx(THERE, abs=1e-9)
    assert max(excess(bench.machine, commands(bench.rows()))) <= 1.0 + 1e-9
    bench.close()


def test_a_planned_motion_starts_at_full_rate_in_the_tick_after_start() -> None:
    bench = running_move()
    assert bench.cycle.follow.rate == 1.0 and bench.cycle.follow.tau == bench.machine.period_s
    bench.close()


def assert_smooth(rows: np.ndarray, bench: Bench, where: str) -> None:
    velocity, acceleration, jerk = excess(bench.machine, commands(rows))
    assert velocity <= 1.0 + 1e-6 and acceleration <= 1.0 + 1e-6 and jerk <= 1.0 + 1e-6, where


@pytest.mark.parametrize("kind", RIDES)
def test_hold_and_resume_anywhere_keep_every_limit_and_the_path(kind: str) -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for _ in range(3):
        ride = RIDES[kind]()
        bench, at = ride.bench, rng.randrange(3, int(0.6 * ride.ticks))
        where = f"seed {seed}, held at tick {at}"
        bench.tick(at)
        bench.ask(Request.HOLD)
        bench.tick(2)
        assert bench.snapshot.stopping and bench.snapshot.epoch == 0, where
        bench.until_rest()
        assert bench.snapshot.epoch == 1 and bench.snapshot.motion_id == ride.piece.motion_id, where
        assert not bench.cycle.follow.pending, where
        ride.send_rest()
        bench.tick(3)
        assert bench.snapshot.accepted == bench.sequence and bench.snapshot.at_rest, where
        bench.ask(Request.RESUME)
        bench.until(Mode.READY)
        rows = bench.rows()
        assert_smooth(rows, bench, where)
        assert bench.snapshot.fault is Fault.NONE, where
        if isinstance(ride.motion, SurfaceCut):
            assert distance_to_path(bench, ride.motion, rows) < 1e-6, where
        bench.close()


@pytest.mark.slow
@pytest.mark.parametrize("kind", RIDES)
@pytest.mark.parametrize("first", range(1, 5 * 29, 29))
def test_hold_at_every_29th_tick_keeps_every_limit(first: int, kind: str) -> None:
    """A fifth of these ticks each."""
    at = first
    ticks = first + 1
    while at < ticks:
        ride = RIDES[kind]()
        ticks = ride.ticks
        ride.bench.tick(at)
        ride.bench.ask(Request.HOLD)
        ride.bench.until_rest()
        assert_smooth(ride.bench.rows(), ride.bench, f"held at {at}")
        ride.bench.close()
        at += 5 * 29


def test_a_hold_at_rest_just_stands_and_keeps_the_queue() -> None:
    ride = move_ride()
    ride.bench.close()
    bench = Bench()
    bench.enable()
    bench.send([dwell(0.1), ride.piece, END], {ride.piece.motion_id: ride.motion})
    bench.ask(Request.START)
    bench.tick(10)
    bench.ask(Request.HOLD)
    bench.tick(100)
    assert bench.snapshot.epoch == 0 and bench.cycle.follow.pending and bench.snapshot.rate == 0.0
    bench.ask(Request.RESUME)
    bench.until(Mode.READY)
    assert bench.cycle.follow.joints == pytest.approx(THERE, abs=1e-9)
    bench.close()


def test_without_a_stop_for_its_time_a_hold_takes_the_next_one() -> None:
    ride = move_ride()
    ride.bench.tick(150)  # stops begin at every second tick: one of these two has none
    for odd in range(2):
        ride.bench.tick(1 + odd)
        ride.bench.ask(Request.HOLD)
        ride.bench.tick(1)
        at_once = ride.bench.snapshot.stopping
        ride.bench.tick(1)
        assert ride.bench.snapshot.stopping
        ride.bench.until_rest()
        ride.bench.close()
        if not at_once:
            return
        ride = move_ride()
        ride.bench.tick(150)
    raise AssertionError("a stop began at both")


def test_without_any_stop_a_hold_runs_on_to_the_queues_end() -> None:
    ride = move_ride()
    ride.bench.close()
    bench = Bench()
    bench.enable()
    bench.send([ride.piece, END], {ride.piece.motion_id: ride.motion})
    bench.ask(Request.START)
    bench.tick(100)
    bench.ask(Request.HOLD)
    bench.until_rest()
    assert bench.snapshot.epoch == 0 and bench.snapshot.rate == 0.0
    assert bench.cycle.follow.joints == pytest.approx(THERE, abs=1e-9)
    assert_smooth(bench.rows(), bench, "to the end")
    bench.ask(Request.RESUME)
    bench.until(Mode.READY, 20)
    bench.close()


def test_a_resume_during_the_stop_finishes_the_stop_first() -> None:
    ride = move_ride()
    bench = ride.bench
    bench.tick(150)
    bench.ask(Request.HOLD)
    bench.tick(5)
    bench.ask(Request.RESUME)
    bench.until_rest()
    assert bench.snapshot.epoch == 1 and bench.snapshot.mode is Mode.RUNNING
    ride.send_rest()
    bench.until(Mode.READY)
    assert_smooth(bench.rows(), bench, "resumed while stopping")
    bench.close()


def test_while_stopping_and_for_another_epoch_no_message_is_taken() -> None:
    ride = move_ride()
    bench = ride.bench
    bench.tick(150)
    bench.ask(Request.HOLD)
    bench.tick(5)
    bench.send([dwell(1.0)], {})
    bench.tick()
    assert bench.snapshot.rejected == bench.sequence
    bench.until_rest()
    bench.send([dwell(1.0)], {}, epoch=0)
    bench.tick()
    assert bench.snapshot.rejected == bench.sequence
    ride.send_rest()
    bench.tick()
    assert bench.snapshot.accepted == bench.sequence
    bench.close()


def test_a_stop_runs_on_from_motion_to_motion() -> None:
    """One line given as two motions: the stop begins in the first and ends in the second."""
    whole, _ = straight(HERE, THERE, lambda n: s_curve(n, *RAPID))
    length = whole.law.at(whole.duration_s)[0]
    half = whole.law.at(whole.duration_s / 2.0)[0] / length
    middle = tuple(half * q for q in THERE)
    _, first = straight(HERE, middle, lambda n: whole.law, 0)  # type: ignore[arg-type]
    _, second = straight(middle, THERE, lambda n: whole.law, 1)  # type: ignore[arg-type]
    begins = np.array([0.0, first.end, length])
    laws = split(np.array(whole.law.knots_s), np.array(whole.law.coefficients), begins, begins[:-1])
    pieces = [whole._replace(motion_id=k, law=law, duration_s=law.duration_s) for k, law in enumerate(laws)]
    bench = Bench()
    bench.enable()
    bench.send(
        [*pieces, END], {0: first, 1: second}, stops=lambda _, start, T: stops(*RAPID[1:])(whole, start, T)
    )
    bench.ask(Request.START)
    bench.tick(int(0.97 * laws[0].duration_s / bench.machine.period_s))
    assert bench.snapshot.motion_id == 0
    bench.ask(Request.HOLD)
    bench.until_rest()
    assert bench.snapshot.motion_id == 1 and bench.snapshot.epoch == 1
    share = np.array(bench.snapshot.joints) / np.array(THERE)
    assert np.ptp(share) < 1e-12
    assert_smooth(bench.rows(), bench, "across")
    bench.close()


def test_an_override_of_nothing_stops_what_it_is_for_and_only_that() -> None:
    ride = move_ride()
    bench = ride.bench
    bench.tick(100)
    bench.ask(Request.RAPID_OVERRIDE, 0.0)
    bench.tick(50)
    assert bench.cycle.follow.rate == 1.0  # the piece is a feed move
    bench.ask(Request.OVERRIDE, 0.0)
    bench.tick(2)
    assert bench.snapshot.stopping
    bench.until_rest()
    assert bench.snapshot.epoch == 1 and bench.snapshot.mode is Mode.RUNNING and bench.snapshot.rate == 0.0
    ride.send_rest()
    bench.tick(20)
    assert bench.snapshot.at_rest
    bench.ask(Request.OVERRIDE, 0.5)  # slower is the planner's business
    bench.until(Mode.READY)
    assert_smooth(bench.rows(), bench, "override 0 and back")
    bench.close()


@pytest.mark.parametrize(("mark", "switch"), MARKS)
def test_the_operators_switches_decide_at_the_mark_whether_it_stops(mark: str, switch: Request) -> None:
    for wanted in (False, True):
        bench = Bench()
        bench.enable()
        there, move = straight(HERE, THERE, rapid_law, 0)
        back, again = straight(THERE, HERE, rapid_law, 1)
        bench.send([there._replace(**{mark: True}), back, END], {0: move, 1: again})  # type: ignore[arg-type]
        bench.ask(switch, 1.0)
        bench.ask(Request.START)
        bench.tick(50)
        bench.ask(switch, float(wanted))
        bench.until(Mode.HOLD if wanted else Mode.READY)
        if wanted:
            bench.tick(30)
            assert bench.snapshot.joints == pytest.approx(THERE, abs=1e-9)
            bench.ask(Request.RESUME)
            bench.until(Mode.READY)
        assert bench.snapshot.joints == pytest.approx(HERE, abs=1e-9)
        bench.close()


def test_what_binds_is_told_by_the_piece() -> None:
    bench = Bench()
    bench.enable()
    there, move = straight(HERE, THERE, rapid_law)
    bench.send([there._replace(binds=((0.0, 0), (0.1, 11), (0.2, 1)))], {0: move})
    bench.ask(Request.START)
    seen = []
    for _ in range(140):
        bench.tick()
        seen.append(bench.snapshot.limited_by)
    assert [seen[10], seen[75], seen[130]] == [0, 11, 1]
    bench.close()


def test_stop_drops_the_queue_at_standstill_on_the_path() -> None:
    bench = running_move()
    bench.tick(100)
    bench.ask(Request.STOP)
    bench.until(Mode.READY)
    follow = bench.cycle.follow
    assert not follow.pending and 0.0 < follow.joints[0] < 100.0
    share = np.array(follow.joints) / np.array(THERE)
    assert np.ptp(share) < 1e-12
    bench.close()


def test_a_program_stop_holds_exactly_at_its_place_until_resume() -> None:
    bench = Bench()
    bench.enable()
    there, move = straight(HERE, THERE, rapid_law, 0)
    back, again = straight(THERE, HERE, rapid_law, 1)
    bench.send([there, dwell(0.0, 7, stop=True), back, dwell(0.0, end=True)], {0: move, 1: again})
    bench.tick()
    bench.ask(Request.START)
    bench.until(Mode.HOLD)
    bench.tick(50)
    assert bench.cycle.follow.joints == pytest.approx(THERE, abs=1e-9)
    bench.ask(Request.RESUME)
    bench.until(Mode.READY)
    assert bench.cycle.follow.joints == pytest.approx(HERE, abs=1e-9)
    assert max(excess(bench.machine, commands(bench.rows()))) <= 1.0 + 1e-6
    bench.close()


def test_a_dwell_lasts_its_time_in_ticks_and_ignores_overrides() -> None:
    bench = Bench()
    bench.enable()
    bench.ask(Request.OVERRIDE, 0.1)
    bench.send([dwell(0.5), dwell(0.0, end=True)], {})
    bench.tick()
    bench.ask(Request.START)
    bench.until(Mode.RUNNING)
    start = bench.cycle.tick
    bench.until(Mode.READY)
    assert bench.cycle.tick - start == pytest.approx(0.5 / bench.machine.period_s, abs=1.0)
    bench.close()


def test_a_message_appends_replaces_from_the_commit_point_and_never_before_it() -> None:
    bench = running_move()
    bench.tick(100)
    follow = bench.cycle.follow
    first = follow.queue_end_s
    lead = follow.commit_s - follow.tau
    assert lead >= 0.02 - 1e-12
    bench.send([dwell(1.0)], {}, at_s=follow.commit_s - 0.01)
    bench.tick()
    assert bench.snapshot.rejected == bench.sequence and follow.queue_end_s == first
    bench.send([dwell(1.0)], {}, at_s=first + 0.5)
    bench.tick()
    assert bench.snapshot.rejected == bench.sequence
    bench.send([dwell(1.0)], {})
    bench.tick()
    assert bench.snapshot.accepted == bench.sequence and follow.queue_end_s == first + 1.0
    bench.close()


def test_a_replacement_cuts_the_piece_it_falls_into_and_runs_on_smoothly() -> None:
    bench = running_move()
    whole, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
    bench.tick(120)
    at = bench.cycle.follow.commit_s + 0.05
    s, v, _ = whole.law.at(at)
    # The rest of the way to 120 mm at the speed it has, then down to rest.
    stop = s_curve(400.0, v, 1900.0, 48000.0)
    even = (120.0 - s) / v
    ramp = zip(stop.knots_s[4:], stop.coefficients[4:], strict=False)
    down = [(k - stop.knots_s[4], row) for k, row in ramp]
    base = stop.coefficients[4][0]
    knots = (0.0, *(even + k for k, _ in down), even + stop.duration_s - stop.knots_s[4])
    rows = ((s, v, 0.0, 0.0, 0.0, 0.0), *((120.0 + row[0] - base, *row[1:]) for _, row in down))
    law = type(whole.law)(knots, rows)
    bench.send([whole._replace(law=law, duration_s=law.duration_s, end=True)], {}, at_s=at)
    bench.until(Mode.READY)
    assert bench.snapshot.accepted == bench.sequence
    assert bench.snapshot.s == pytest.approx(law.at(1e9)[0], abs=1e-9)
    assert max(excess(bench.machine, commands(bench.rows()))) <= 1.0 + 1e-6
    assert move.end > 120.0
    bench.close()


def test_a_queue_that_begins_elsewhere_or_names_an_unknown_motion_is_refused() -> None:
    bench = Bench(start=(1.0, 0.0, 0.0, 0.0, 0.0))
    bench.enable()
    piece, move = straight(HERE, THERE, rapid_law)
    bench.send([piece], {0: move})
    bench.tick()
    assert bench.snapshot.rejected == 1 and bench.snapshot.refusal is QueueRefusal.ELSEWHERE
    bench.send([piece._replace(motion_id=77)], {})
    bench.tick()
    assert bench.snapshot.rejected == 2 and not bench.cycle.follow.pending
    assert bench.snapshot.refusal is QueueRefusal.UNKNOWN_MOTION
    for pauses in ([dwell(0.2)], [dwell(0.0, stop=True), dwell(0.2)]):
        bench.send([*pauses, piece], {0: move})
        bench.tick()
        assert bench.snapshot.rejected == bench.sequence, "a pause before it leads nowhere"
    there, move = straight((1.0, 0.0, 0.0, 0.0, 0.0), THERE, rapid_law)
    bench.send([dwell(0.2), there], {there.motion_id: move})
    bench.tick()
    assert bench.snapshot.accepted == bench.sequence and bench.cycle.follow.pending
    bench.close()


def test_at_most_one_message_is_taken_in_a_tick() -> None:
    bench = Bench()
    bench.enable()
    for n in range(3):
        bench.send([dwell(1.0)], {}, at_s=float(n))
    taken = []
    for _ in range(3):
        bench.loop.tick()
        taken.append(bench.snapshot.accepted)
    assert taken == [1, 2, 3]
    bench.close()


def test_old_messages_after_a_stop_do_not_start_anything() -> None:
    bench = running_move()
    bench.tick(50)
    bench.ask(Request.STOP)
    bench.until(Mode.READY)
    end = bench.cycle.follow.queue_end_s
    late = PieceMessage(bench.sequence + 1, end, {}, (dwell(1.0),), (), 0)
    bench.outbox.send(late)
    bench.tick()
    assert bench.snapshot.rejected == late.sequence and not bench.cycle.follow.pending
    bench.close()
