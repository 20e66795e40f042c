"""Stops worked out ahead: they leave the plan at once, keep every limit, end at rest, and are quick."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.machines import traced_programs
from support.machines.spindle_machine import mill
from support.machines.stepped_runs import SHIPPED, cut, program, shipped
from support.oracles import jerk_limited_stop
from support.parts.random_surfaces import compound, text

from controller.ipc.handoff import StopTable
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Kind, Limits, Machine
from controller.plan.feed import profile
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits
from controller.plan.feed.profile import Profile
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, straight
from controller.plan.stops import check
from controller.plan.stops.table import stops
from controller.plan.stops.way import Way
from controller.program.program import Place, ProgramError

VELOCITY, ACCELERATION, JERK = 1.0003, 1.001, 1.015  # times the machine's limits, at most
QUICK = 1.3  # times the shortest stop


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan with its stops."""

    course: FeedCourse
    plan: Profile
    table: StopTable

    @property
    def machine(self) -> Machine:
        return self.course.machine

    def start(self, i: int) -> float:
        return self.table.start_s + i * self.table.step_s

    def jerks(self, i: int) -> list[float]:
        return list(self.table.jerks[self.table.first[i] : self.table.first[i + 1]])


def planned(source: str, machine: Machine, only: str = "") -> Iterator[Planned]:
    """The plans of a program; those with a segment named ``only``."""
    kinematics = kinematics_of(machine)
    home = tuple(axis.homing.position for axis in machine.axes)
    for item in traced_programs.trace(source, machine, home).items:  # type: ignore[arg-type]
        if isinstance(item, ContinuousPath):
            for run in profile.split_at_stops(item.segments, machine, kinematics, 1.0):
                if not only or any(segment.name == only for segment in run):
                    course = FeedCourse(run, machine, kinematics)
                    plan = profile.plan(course)
                    assert plan is not None
                    table = stops(course, plan, 0.0, plan.duration_s, step(machine))
                    yield Planned(course, plan, table)


def step(machine: Machine) -> float:
    return max(2, round(0.004 / machine.period_s)) * machine.period_s


def slow(machine: Machine) -> Machine:
    """LinuxCNC's shipped limits: 20 mm/s, 300 mm/s2; 30 deg/s, 300 deg/s2; jerk 30 times that."""
    linear, turning = Limits(20.0, 300.0, 9000.0), Limits(*(math.radians(x) for x in (30.0, 300.0, 9000.0)))
    axes = (replace(a, limits=linear if a.kind is Kind.LINEAR else turning) for a in machine.axes)
    return replace(machine, axes=tuple(axes))


def motion(case: Planned, i: int, per_step: int = 4) -> np.ndarray:
    """Rows of s, v, a, j of stop ``i``: ``per_step`` + 1 places in each step, both its ends included."""
    s, v, a, _ = (float(x[0]) for x in case.plan.along(np.array([case.start(i)])))
    h, rows = case.table.jerk_step_s, []
    for j in case.jerks(i):
        for x in np.linspace(0.0, h, per_step + 1):
            rows.append((s + x * (v + x * (a / 2 + x * j / 6)), v + x * (a + x * j / 2), a + x * j, j))
        s, v, a = rows[-1][:3]
    return np.array(rows)


def shares(case: Planned, rows: np.ndarray) -> tuple[float, float, float]:
    """Largest share of the machine's limits of velocity, acceleration, jerk, by exact derivatives."""
    s, v, a, j = rows.T
    limits = JointLimits.of(case.machine)
    # The side of a junction on which a row lies: its step's later places decide.
    d = case.course.derivatives(np.clip(s, 0.0, case.course.length))
    return (
        float((np.abs(d.velocity(v)) / limits.velocity).max()),
        float((np.abs(d.acceleration(v, a)) / limits.acceleration).max()),
        float((np.abs(d.jerk(v, a, j)) / limits.jerk).max()),
    )


def assert_good(case: Planned, label: object, some: int = 1) -> list[int]:
    """Every ``some``-th stop keeps all limits, never goes back or past the plan's rest, and ends at rest."""
    given = [i for i in range(0, len(case.table), some) if case.jerks(i)]
    for i in given:
        rows = motion(case, i)
        found = shares(case, rows)
        assert found[0] <= VELOCITY and found[1] <= ACCELERATION and found[2] <= JERK, (label, i, found)
        assert rows[:, 1].min() >= -1e-9 and rows[-1, 0] <= case.plan.end_s + 1e-8, (label, i)
        assert abs(rows[-1, 1]) <= 1e-9 and abs(rows[-1, 2]) <= 1e-7, (label, i, rows[-1])
    return given


def gaps(case: Planned) -> list[tuple[int, int]]:
    """(first, number) of the runs of starts without a stop from which the plan does not soon rest anyway."""
    found = []
    for empty, group in itertools.groupby(range(len(case.table)), key=lambda i: not case.jerks(i)):
        if empty:
            where = list(group)
            before = [i for i in range(where[0]) if case.jerks(i)]
            usual = len(case.jerks(before[-1])) * case.table.jerk_step_s if before else 0.0
            late = [i for i in where if case.plan.duration_s - case.start(i) > QUICK * usual]
            if late:
                found.append((late[0], len(late)))
    return found


# --- what must hold for every stop


@pytest.mark.parametrize(("feed", "most"), [("1000.", 0), ("3000.", 0)])
def test_every_stop_on_example_2_keeps_the_limits_and_ends_at_rest_on_the_path(feed: str, most: int) -> None:
    for case in planned(program("example2_ready.ngc", feed), shipped(), "cut"):
        given = assert_good(case, feed, 7)
        assert len(given) > 0.7 * len(case.table) / 7
        assert sum(n for _, n in gaps(case)) <= most, gaps(case)


def test_stops_leave_the_plan_with_their_first_step() -> None:
    for case in planned(program("example2_ready.ngc", "1000."), shipped(), "cut"):
        h = case.table.jerk_step_s
        for i in range(len(case.table) - 1):
            if case.jerks(i):
                t = case.start(i) + h
                _, v, a = case.plan.at(t)
                if a >= 0.0:  # elsewhere the plan itself may brake at a limit
                    assert motion(case, i, 1)[1, 1] < v, i


def test_a_stop_from_the_feed_of_a_straight_line_takes_the_time_of_the_closed_form() -> None:
    machine = shipped()
    cases = planned("G21 G90 G54 G94\nS12000 M3\nG1 X90. F6000.\nM30\n", machine)
    case = max(cases, key=lambda one: one.plan.duration_s)
    limits = machine.axes[0].limits
    closed = 100.0 / limits.acceleration + limits.acceleration / limits.jerk
    at_feed = [
        i
        for i in range(len(case.table))
        if abs(case.plan.at(case.start(i)).v - 100.0) < 1e-9 and case.jerks(i)
    ]
    assert len(at_feed) > 100
    for i in at_feed:
        took = len(case.jerks(i)) * case.table.jerk_step_s
        assert closed - 1e-9 <= took <= closed + 2 * machine.period_s, i


def test_at_rest_there_is_a_stop_of_one_step_without_jerk() -> None:
    case = next(planned(program("example2_ready.ngc", "1000."), shipped(), "plunge"))
    assert case.jerks(0) == [0.0]
    if math.isclose(case.start(len(case.table) - 1), case.plan.duration_s, abs_tol=1e-9):
        assert case.jerks(len(case.table) - 1) == [0.0]


def test_a_table_in_parts_is_the_whole_tables_rows() -> None:
    """What stop begins at a time does not depend on which others are sought with it."""
    whole = next(planned(program("example2_ready.ngc", "1000."), shipped(), "cut"))
    part = stops(whole.course, whole.plan, 0.4, 0.5, 0.004)
    assert part.start_s == 0.4 and len(part) == 26
    for i in range(len(part)):
        own = list(part.jerks[part.first[i] : part.first[i + 1]])
        other = whole.jerks(100 + i)
        assert len(own) == len(other) and np.allclose(own, other, rtol=1e-3, atol=20.0), i


def test_stops_across_a_junction_of_segments_keep_the_limits_in_ticks() -> None:
    """Sampled as the tick samples: the plan up to the start, the stop, then standstill."""
    machine = shipped()
    for case in planned(program("example2_ready.ngc", "100."), machine, "lead in"):
        inner = case.course.starts[1:-1]
        for at in inner:
            near = range(len(case.table) - 1)
            crossing = [
                i
                for i in near
                if case.jerks(i) and case.plan.at(case.start(i)).s < at < motion(case, i)[-1, 0]
            ]
            for i in crossing[:: max(1, len(crossing) // 5)]:
                assert_ticks(case, i)


def assert_ticks(case: Planned, i: int) -> None:
    T, machine = case.machine.period_s, case.machine
    before = [case.plan.at(case.start(i) - k * T).s for k in range(6, 0, -1) if case.start(i) >= k * T]
    per = round(case.table.jerk_step_s / T)
    rows = motion(case, i, per)
    places = np.concatenate([before, rows[:1, 0], rows[:, 0].reshape(-1, per + 1)[:, 1:].ravel()])
    q = np.array([joints(case, s) for s in [*places, *([rows[-1, 0]] * 4)]])
    limits = JointLimits.of(machine)
    pairs = ((limits.velocity, 1.0005), (limits.acceleration, 1.002), (limits.jerk, 1.02))
    for order, (limit, most) in enumerate(pairs, start=1):
        assert (np.abs(np.diff(q, order, axis=0)) / T**order / limit).max() <= most, (i, order)


def joints(case: Planned, s: float) -> np.ndarray:
    k = int(case.course.index(np.array([s]))[0])
    local = np.array([s - case.course.starts[k]])
    return np.asarray(joints_along(case.course.segments[k], local, case.course.kinematics))[0]


def unseen(seed: int, feed: float) -> Iterator[Planned]:
    rng = random.Random(seed)
    machine = shipped(rng.choice(SHIPPED))
    yield from planned(text(compound(seed, rng.choice((1, 2))), feed), machine, "cut")


def test_stops_on_an_unseen_surface_keep_the_limits() -> None:
    for case in unseen(703, 1500.0):
        assert_good(case, 703, 11)
        assert not [one for one in gaps(case) if one[1] > 1], gaps(case)


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.0005, 0.001, 0.005])
def test_stops_keep_the_limits_at_other_periods(period_s: float) -> None:
    for case in planned(program("example2_ready.ngc", "3000."), shipped(period_s=period_s), "cut"):
        assert_good(case, period_s, 9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(700, 706))
def test_stops_on_many_unseen_surfaces_keep_the_limits(seed: int) -> None:
    feed = 10.0 ** random.Random(seed + 1).uniform(2.5, 4.0)
    try:
        for case in unseen(seed, feed):
            given = assert_good(case, seed, 5)
            print(f"\n{seed} at {feed:.0f} mm/min: {len(given) * 5} of {len(case.table)}, gaps {gaps(case)}")
    except ProgramError:
        pytest.skip("refused")


# --- against another method


def ratio(case: Planned, i: int) -> float | None:
    """How much longer a stop takes than the shortest by linear programs; None where that tells nothing."""
    s, v, a = case.plan.at(case.start(i))
    k = int(case.course.index(np.array([s]))[0])
    segment, base = case.course.segments[k], float(case.course.starts[k])
    end = segment.motion.end
    limits = jerk_limited_stop.limits_of(case.machine.axes)
    way = jerk_limited_stop.way(
        lambda x: np.asarray(joints_along(segment, np.clip(x, 0.0, end), case.course.kinematics)),
        s - base,
        min(end, s - base + max(0.5, 0.6 * v)),
    )
    best = jerk_limited_stop.shortest(way, limits, s - base, v, a)
    rest = motion(case, i)[-1, 0] if case.jerks(i) else case.plan.end_s
    if best is None or rest > base + end + 1e-9:
        return None
    took = len(case.jerks(i)) * case.table.jerk_step_s or case.plan.duration_s - case.start(i)
    return took / best


def judge(cases: Iterator[Planned], label: str, count: int, seed: int = 1) -> list[float]:
    rng, found = random.Random(seed), []
    for case in cases:
        for i in sorted(rng.sample(range(1, len(case.table) - 1), count)):
            if (one := ratio(case, i)) is not None:
                found.append(one)
                assert one <= QUICK, (label, i, one, case.plan.at(case.start(i)))
    print(f"\n{label}: median {np.median(found):.3f}, worst {max(found):.3f} of {len(found)}")
    return found


def test_stops_are_hardly_longer_than_the_shortest_there_are() -> None:
    assert judge(planned(program("example2_ready.ngc", "1000."), shipped(), "cut"), "Example 2", 1)


@pytest.mark.slow
@pytest.mark.parametrize(("feed", "machine"), [("1000.", "slow"), ("3000.", "slow"), ("3000.", "shipped")])
def test_stops_anywhere_on_example_2_are_hardly_longer_than_the_shortest(feed: str, machine: str) -> None:
    built = slow(shipped()) if machine == "slow" else shipped()
    judge(planned(program("example2_ready.ngc", feed), built, "cut"), f"{machine} {feed}", 3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(700, 702))
def test_stops_on_unseen_surfaces_are_hardly_longer_than_the_shortest(seed: int) -> None:
    feed = 10.0 ** random.Random(seed + 1).uniform(2.5, 3.7)
    try:
        judge(unseen(seed, feed), f"seed {seed} at {feed:.0f}", 3)
    except ProgramError:
        pytest.skip("refused")


# --- slow and heavy machines: limits over four decades, and a tool that turns by half a turn

HEAVY = (Limits(100.0, 500.0, 3000.0), Limits(0.4, 0.5, 1.5), Limits(0.8, 0.5, 1.5))


def machine_of(linear: Limits, tilt: Limits, turn: Limits) -> Machine:
    """The shipped trunnion with other limits for X Y Z, for A and for C."""
    built = shipped()
    turning = {"A": tilt, "C": turn}
    axes = (replace(a, limits=linear if a.kind is Kind.LINEAR else turning[a.name]) for a in built.axes)
    return replace(built, axes=tuple(axes))


def drawn(rng: random.Random) -> Machine:
    """Accelerations over four decades, jerks of two to a hundred times as much a second."""

    def limits(velocity: float, acceleration: float) -> Limits:
        return Limits(velocity, acceleration, acceleration * 10.0 ** rng.uniform(0.3, 2.0))

    linear = limits(100.0, 10.0 ** rng.uniform(1.3, 4.0))
    tilt = limits(rng.uniform(0.3, 3.0), 10.0 ** rng.uniform(-1.5, 2.5))
    turn = limits(rng.uniform(0.3, 6.0), 10.0 ** rng.uniform(-1.5, 2.5))
    return machine_of(linear, tilt, turn)


def turning_surface(lean_mm: float, feed: float) -> str:
    """A lower edge of 98 mm round half a turn, the rulings leaning outwards all the way."""
    side, top = (30.0 + lean_mm, lean_mm), (15.0 + lean_mm / 3.0, 32.0 + 1.2 * lean_mm)
    upper = [(-side[0], side[1]), (-top[0], top[1]), top, side]
    lower = [(-30.0, 0.0), (-20.0, 43.0), (20.0, 43.0), (30.0, 0.0)]
    points = [f"X{x:.3f} Y{y:.3f} Z10." for x, y in upper] + [f"X{x} Y{y} Z0." for x, y in lower]
    body = "\n".join(points)
    return f"G21 G90 G54\nT1 M6\nS1000 M3\nG52 F{feed:.0f}. {body}\nM5\nM30\n"


def test_a_plan_that_still_gains_a_little_where_a_stop_is_sought_has_stops() -> None:
    """Its highest speed lies between two samples of the braking that is tried."""
    cases = list(planned(turning_surface(6.0, 4000.0), machine_of(*HEAVY), "cut"))
    assert cases
    for case in cases:
        for first_s in np.linspace(0.0, 0.6 * case.plan.duration_s, 3):
            part = round(first_s / 0.002) * 0.002
            table = stops(case.course, case.plan, part, part + 1.0, 0.004)
            assert table.first[-1] > 0
        assert_good(case, "heavy", 29)


@pytest.mark.parametrize("seed", [0, 15, *(pytest.param(n, marks=pytest.mark.slow) for n in range(2, 15))])
def test_stops_of_machines_over_four_decades_keep_their_limits(seed: int) -> None:
    rng = random.Random(seed)
    built, feed = drawn(rng), 10.0 ** rng.uniform(2.7, 4.0)
    for case in planned(turning_surface(rng.uniform(2.0, 14.0), feed), built, "cut"):
        assert len(case.table) > 0
        assert_good(case, (seed, [axis.limits for axis in built.axes]), 23)


@pytest.mark.slow
def test_a_heavy_machine_cuts_a_surface_along_which_the_tool_turns_by_half_a_turn() -> None:
    done = cut(turning_surface(6.0, 4000.0), machine_of(*HEAVY))
    assert done.run.result == "completed"


def test_a_start_at_the_very_end_of_the_plan_is_at_rest_though_its_speed_is_rounded_below_zero() -> None:
    """The plan's process ended over it: the time for braking from a speed of -3e-14 was no number."""
    machine = mill()
    kinematics, below = kinematics_of(machine), 0
    for length in range(1, 60):
        way = straight("way", Place(1, 1), (0.0,) * 5, (float(length), 0.0, 0.0, 0.0, 0.0), None, kinematics)
        assert way is not None
        course = FeedCourse([way], machine, kinematics)
        plan = profile.plan(course)
        assert plan is not None
        below += plan.at(plan.duration_s).v < 0.0
        table = stops(course, plan, 0.0, plan.duration_s, plan.duration_s / 64.0)
        assert len(table) == 65 and list(table.jerks[table.first[64] : table.first[65]]) == [0.0]
    assert below > 20


# --- the same by other ways


def tables(source: str, machine: Machine) -> list[StopTable]:
    return [case.table for case in planned(source, machine)]


@pytest.mark.parametrize("heavy", [False, True], ids=["shipped", "slow"])
def test_on_straight_ways_the_stops_are_those_that_a_search_step_by_step_finds(
    monkeypatch: pytest.MonkeyPatch, heavy: bool
) -> None:
    machine = slow(shipped()) if heavy else shipped()
    source = "G0 X30. Y-20. Z-5.\nG1 X80. Y31. F4000.\nG1 C90.\nG0 X0. Y0. A20.\n"
    found = tables(source, machine)
    monkeypatch.setattr(Way, "straight", None)
    assert found == tables(source, machine)


@pytest.mark.parametrize("seed", [1])
def test_a_bound_on_whole_steps_lets_pass_what_a_look_at_their_places_does(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    machine = slow(shipped()) if seed == 2 else shipped()
    source = text(compound(seed), 1000.0 + 4000.0 * seed)
    found = tables(source, machine)

    def nothing(way: object, motion: object, jerks: np.ndarray, h: float) -> np.ndarray:
        return np.zeros(jerks.shape, dtype=bool)

    monkeypatch.setattr(check, "_surely_within", nothing)
    assert found == tables(source, machine)


@pytest.mark.parametrize("by_its_turn", [True, False])
def test_a_turn_beside_which_x_y_and_z_hardly_move(by_its_turn: bool) -> None:
    """Its s is in degrees: in so few millimetres half a turn had no places. Stops are found of either."""
    machine = shipped(period_s=0.01)
    start, end = (-52.95, 61.16, 260.0, 0.0951, 0.0), (-52.950001, 61.159999, 260.0, 0.0951, 3.0767)
    segment = straight("position", Place(1, 1), start, end, None, kinematics_of(machine))
    assert segment is not None and segment.motion.end == pytest.approx(math.degrees(3.0767))
    if not by_its_turn:
        segment = replace(segment, motion=replace(segment.motion, end=math.hypot(1e-6, 1e-6)))  # type: ignore[type-var]
    course = FeedCourse([segment], machine, kinematics_of(machine))
    plan = profile.plan(course)
    assert plan is not None
    table = stops(course, plan, 0.0, plan.duration_s, step(machine))
    assert np.count_nonzero(np.diff(table.first)) > (20 if by_its_turn else 0)
