"""Following the plan: taking pieces, holding anywhere on the path, overrides, stops."""

from __future__ import annotations

import random

import numpy as np
import pytest
from ticking import Bench, commands, cut_start, excess, part_tip, rapid_law, ruled_cut, s_curve, straight

from controller.handoff import COLUMN, PieceMessage, dwell
from controller.kinematics import Kinematics
from controller.machine import Joints
from controller.motions import SurfaceCut
from controller.state import Fault, Mode, Request

HERE: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)
# Velocity and acceleration bind; jerk is aimed at, and gives way where a hold meets the
# plan's own stop.
MOST_JERK = 1.35
THERE: Joints = (100.0, 60.0, -80.0, 1.0, 2.0)


def running_move(**options: object) -> Bench:
    """A bench in the middle of nothing yet: one rapid move near all limits, started."""
    bench = Bench(**options)  # type: ignore[arg-type]
    bench.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
    bench.send([piece, dwell(0.0, end=True)], {0: move})
    bench.tick()
    bench.ask(Request.START)
    bench.tick()
    return bench


def running_cut(number: int) -> tuple[Bench, SurfaceCut, int]:
    bench = Bench()
    piece, cut = ruled_cut(bench.machine, number)
    bench.close()
    bench = Bench(start=cut_start(bench.machine, cut))
    bench.enable()
    bench.send([piece, dwell(0.0, end=True)], {piece.motion_id: cut})
    bench.tick()
    bench.ask(Request.START)
    bench.tick()
    return bench, cut, int(piece.duration_s / bench.machine.period_s)


def distance_to_path(bench: Bench, cut: SurfaceCut, rows: np.ndarray) -> float:
    """Largest distance (mm) between commanded tips and the cut's own tip at the recorded s."""
    kinematics = Kinematics(bench.machine)
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


@pytest.mark.parametrize("kind", ("rapid", "first surface", "second surface"))
def test_hold_and_resume_anywhere_keep_every_limit_and_the_path(kind: str) -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for _ in range(6):
        cut = None
        if kind == "rapid":
            bench, ticks = running_move(), 470
        else:
            bench, cut, ticks = running_cut(0 if kind.startswith("first") else 1)
        at = rng.randrange(ticks)
        bench.tick(at)
        bench.ask(Request.HOLD)
        bench.tick(2)
        where = f"seed {seed}, held at tick {at}"
        assert bench.cycle.follow.rate < 1.0, where
        bench.until_rest()
        bench.tick(3)
        bench.ask(Request.RESUME)
        bench.until(Mode.READY)
        rows = bench.rows()
        velocity, acceleration, jerk = excess(bench.machine, commands(rows))
        assert velocity <= 1.0 + 1e-6 and acceleration <= 1.0 + 1e-6 and jerk <= MOST_JERK, where
        assert bench.snapshot.fault is Fault.NONE, where
        if cut is not None:
            assert distance_to_path(bench, cut, rows) < 1e-6, where
        bench.close()


@pytest.mark.slow
@pytest.mark.parametrize("kind", range(3))
def test_hold_at_every_29th_tick_keeps_every_limit(kind: int) -> None:
    for at in range(1, 470 if kind == 2 else 1700, 29):
        bench = running_move() if kind == 2 else running_cut(kind)[0]
        bench.tick(at)
        bench.ask(Request.HOLD)
        bench.until_rest()
        velocity, acceleration, jerk = excess(bench.machine, commands(bench.rows()))
        assert velocity <= 1.0 + 1e-6 and acceleration <= 1.0 + 1e-6 and jerk <= MOST_JERK, at
        bench.close()


def test_hold_during_the_ramp_of_a_resume_and_back_keeps_every_limit() -> None:
    bench = running_move()
    bench.tick(150)
    for request, ticks in (
        (Request.HOLD, 20),
        (Request.RESUME, 15),
        (Request.HOLD, 7),
        (Request.RESUME, 40),
        (Request.HOLD, 90),
        (Request.RESUME, 1),
    ):
        bench.ask(request)
        bench.tick(ticks)
    bench.until(Mode.READY)
    velocity, acceleration, jerk = excess(bench.machine, commands(bench.rows()))
    assert velocity <= 1.0 + 1e-6 and acceleration <= 1.0 + 1e-6 and jerk <= 1.1
    bench.close()


def test_an_override_slows_at_once_and_only_what_it_is_meant_for() -> None:
    bench = running_move()
    bench.tick(100)
    bench.ask(Request.RAPID_OVERRIDE, 0.25)
    bench.tick(100)
    assert bench.cycle.follow.rate == 1.0  # the piece is a feed move
    bench.ask(Request.OVERRIDE, 0.25)
    bench.tick(150)
    assert bench.cycle.follow.rate == 0.25
    bench.ask(Request.OVERRIDE, 2.0)
    bench.until(Mode.READY)
    assert bench.cycle.follow.rate <= 1.0
    assert max(excess(bench.machine, commands(bench.rows()))) <= MOST_JERK
    bench.close()


def test_a_piece_planned_at_half_feed_runs_at_full_rate_at_half_override() -> None:
    bench = Bench()
    bench.enable()
    piece, move = straight(HERE, THERE, rapid_law)
    bench.ask(Request.OVERRIDE, 0.5)
    bench.send([piece._replace(override=0.5)], {0: move})
    bench.tick()
    bench.ask(Request.START)
    bench.tick(5)
    assert bench.cycle.follow.rate == 1.0
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
    assert bench.snapshot.rejected == 1
    bench.send([piece._replace(motion_id=77)], {})
    bench.tick()
    assert bench.snapshot.rejected == 2 and not bench.cycle.follow.pending
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
    late = PieceMessage(bench.sequence + 1, end + 1.0, {}, (dwell(1.0),))
    bench.outbox.send(late)
    bench.tick()
    assert bench.snapshot.rejected == late.sequence and not bench.cycle.follow.pending
    bench.close()
