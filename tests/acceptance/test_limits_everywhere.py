"""No axis limit broken and no micrometre off the path, whatever the part, the machine and the operator.

Judged from the trace and the program text: differences of the joints over one period,
and tip and axis against surfaces and kinematics evaluated by the tests' own means.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from support.machines import random_operators
from support.machines.shipped_kinds import random_machine
from support.machines.stepped_runs import SHIPPED, Cut, cut, off_the_plan, program, shipped
from support.oracles import ruled_surfaces, time_bound, tool_paths
from support.oracles.trace_limits import assert_in_limits
from support.parts import random_nurbs
from support.parts.paper_surfaces import POINTS
from support.parts.random_surfaces import compound, text

from controller.ipc.handoff import COLUMN
from controller.machine.model import Homing, Machine
from controller.program.program import ProgramError
from controller.runtime.events import Event
from controller.state.modes import Request

Surface = ruled_surfaces.Ruled | ruled_surfaces.Frustum | tool_paths.RuledNurbs
TIP_MM, AXIS_DEG = 1e-6, 1e-6
GRID = 4001

EXAMPLES: dict[str, tuple[tuple[Surface, ...], float]] = {
    "example1_ready.ngc": (
        (ruled_surfaces.Frustum((0.0, 15.0, 0.0), (0.0, 0.0, 0.0), 10.0, 10.0, 360.0),),
        3.0,
    ),
    "example2_ready.ngc": (tuple(ruled_surfaces.Ruled(*pair) for pair in POINTS), -1.5),
}


def assert_on_surfaces(done: Cut, surfaces: Sequence[Surface], offset: float, whole: bool = True) -> None:
    """Every cutting tick on its block's surface, onwards only, and (``whole``) from one end to the other."""
    tips, axes = tool_paths.tool(done.joints, done.machine, 0.0)
    lines, cutting = done.trace.line, done.trace.cutting
    for line, surface in zip(dict.fromkeys(lines[cutting]), surfaces, strict=False):
        rows = np.flatnonzero(cutting & (lines == line))
        off, turned, u = _off(surface, offset, tips[rows], axes[rows])
        k, j = int(off.argmax()), int(turned.argmax())
        assert off[k] < TIP_MM, f"tip {off[k]:.2e} mm off the surface of line {line} at tick {rows[k]}"
        assert turned[j] < AXIS_DEG, f"axis {turned[j]:.2e} deg off at line {line}, tick {rows[j]}"
        assert (np.diff(u) > -1e-9).all(), f"backwards in line {line}"
        if whole:
            assert u[0] < 0.05 and u[-1] > 0.95, f"line {line} is cut from u = {u[0]} to {u[-1]}"
    if whole:
        assert len(set(lines[cutting])) == len(surfaces)


def _off(
    surface: Surface, offset: float, tips: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mm, degrees, u), the first guess of u by looking along the whole block, always onwards."""
    grid = np.linspace(0.0, 1.0, GRID)
    nodes = surface.tip(grid, offset)
    guess, at = np.empty(len(tips)), 0
    for n, p in enumerate(tips):
        ahead = nodes[max(at - 3, 0) : at + 400]
        at = max(at - 3, 0) + int(np.linalg.norm(ahead - p, axis=1).argmin())
        guess[n] = grid[at]
    return tool_paths.off_curve(tips, axes, lambda u: surface.tip(u, offset), surface.axis, guess)


def judge(
    source: str,
    machine: Machine,
    surfaces: Sequence[Surface],
    offset: float,
    events: Sequence[Event] = (),
    label: object = "",
) -> Cut:
    done = cut(source, machine, events=events)
    stopped = any(event.request is Request.STOP for event in events)
    assert done.run.result == "completed" or stopped, (label, done.run.result, done.run.fault_text)
    assert_in_limits(done, label, events)
    assert_on_surfaces(done, surfaces, offset, whole=done.run.result == "completed")
    moving = np.flatnonzero(done.column("mode") != 1.0)
    assert off_the_plan(done, moving) < TIP_MM, label
    return done


def on_example(name: str, feed: str, machine: Machine, seed: int, count: int) -> Cut:
    surfaces, offset = EXAMPLES[name]
    source = program(name, feed)
    label = f"{name} at {feed} mm/min, seed {seed}"
    plain = judge(source, machine, surfaces, offset, [], label)
    if not count:
        return plain
    events = random_operators.events(random.Random(seed), len(plain.rows), count)
    return judge(source, machine, surfaces, offset, events, label)


def on_surfaces(seed: int, machine: Machine, count: int) -> Cut | None:
    """A random compound surface with an operator of ``count`` doings; None where it is refused."""
    rng = random.Random(50_000 + seed)
    surfaces, feed = compound(seed, rng.choice((1, 2, 3))), 10.0 ** rng.uniform(2.0, 4.0)
    source = text(surfaces, feed)
    try:
        plain = cut(source, machine)
    except ProgramError as refusal:
        assert len(refusal.sentence) > 20
        return None
    events = random_operators.events(rng, len(plain.rows), count)
    label = f"seed {seed} on {machine.name} at {feed:.0f} mm/min"
    return judge(source, machine, [ruled_surfaces.Ruled(*pair) for pair in surfaces], 1.5, events, label)


def oblique(seed: int) -> Machine:
    """Two rotaries in any direction and place, with travel for anything and the shipped limits."""
    pattern, made = shipped(), random_machine(random.Random(seed))
    axes = []
    for axis, like in zip(made.axes, pattern.axes, strict=True):
        wide = 400.0 if axis.is_rotary else 1800.0
        own = {n: getattr(axis, n) for n in ("name", "kind", "direction", "point_mm")}
        homing = Homing(37, 0, 1500.0 if axis.name == "Z" else 0.0)
        coarse = like.counts_per_unit / 16.0
        axes.append(
            replace(like, **own, travel_min=-wide, travel_max=wide, counts_per_unit=coarse, homing=homing)
        )
    return replace(pattern, name=f"random {seed}", axes=tuple(axes), retract_mm=1500.0)


def on_nurbs(seed: int, machine: Machine, count: int) -> Cut | None:
    """A random ruled NURBS surface with an operator; None where it is refused."""
    rng = random.Random(60_000 + seed)
    upper, lower = random_nurbs.blade(seed, rng.choice((1, 3, 5, 24)))
    feed = 10.0 ** rng.uniform(2.0, 3.7)
    source = random_nurbs.text(upper, lower, feed)
    try:
        plain = cut(source, machine)
    except ProgramError as refusal:
        assert len(refusal.sentence) > 20
        return None
    events = random_operators.events(rng, len(plain.rows), count) if count else []
    surface = tool_paths.RuledNurbs(
        upper.points,
        lower.points,
        (upper.degree, lower.degree),
        (upper.knots, lower.knots),
        (upper.weights, lower.weights),
    )
    return judge(source, machine, [surface], 1.5, events, f"blade {seed} on {machine.name} at {feed:.0f}")


# --- tests of the judges themselves


def test_the_judge_names_axis_tick_and_what_happened() -> None:
    done = cut("G0 X30.\nM30\n", shipped())
    done.rows[50:, COLUMN["joint_command_0"]] += 0.5
    with pytest.raises(AssertionError, match=r"X's velocity at tick 50 \(running, line"):
        assert_in_limits(done, "a jump")


def test_the_forward_kinematics_by_hand_agree_with_the_controllers() -> None:
    from controller.machine.kinematics import kinematics_of

    rng = np.random.default_rng(3)
    for seed in range(20):
        machine = random_machine(random.Random(seed))
        joints = rng.uniform(-2.0, 2.0, (5, 5))
        tips, axes = tool_paths.tool(joints, machine, 30.0)
        for q, tip, axis in zip(joints, tips, axes, strict=True):
            pose = kinematics_of(machine).forward(tuple(map(float, q)), 30.0)
            frame = machine.offsets[0]
            np.testing.assert_allclose(tip, frame.from_parent(pose.tip), atol=1e-10)
            np.testing.assert_allclose(axis, frame.turn_back(pose.axis), atol=1e-12)


# --- parts, machines, operators


def test_an_operator_in_the_way_of_example_2_breaks_no_limit() -> None:
    on_example("example2_ready.ngc", "3000.", shipped(period_s=0.004), 1, 8)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(EXAMPLES))
@pytest.mark.parametrize(
    ("feed", "limits", "most"),
    [("100.", "own", 1.02), ("1000.", "own", 1.02), ("3000.", "own", 1.08), ("1000.", "linuxcnc", 1.05)],
)
def test_the_cut_time_is_near_the_bound_that_knows_no_jerk(
    name: str, feed: str, limits: str, most: float
) -> None:
    """Seconds with ``cutting`` in the trace against toppra's; the issue's own figures."""
    machine = time_bound.linuxcnc(shipped()) if limits == "linuxcnc" else shipped()
    done = on_example(name, feed, machine, 0, 0)
    took = int(done.trace.cutting.sum()) * machine.period_s
    bound = time_bound.seconds([s for s in done.segments.values() if s.cutting], machine)
    print(f"\n{name} {feed} {limits}: {took:.3f} s, bound {bound:.3f} s, ratio {took / bound:.4f}")
    assert took <= most * bound


@pytest.mark.slow
@pytest.mark.parametrize("name", list(EXAMPLES))
@pytest.mark.parametrize("feed", ["300.", "1000.", "3000."])
def test_the_papers_parts_with_an_operator(name: str, feed: str) -> None:
    on_example(name, feed, shipped(), 17, 12)


@pytest.mark.slow
@pytest.mark.parametrize("machine", SHIPPED)
def test_every_shipped_machine_with_an_operator(machine: str) -> None:
    on_example("example2_ready.ngc", "1000.", shipped(machine), len(machine), 10)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(EXAMPLES))
def test_the_limits_of_linuxcnc_with_an_operator(name: str) -> None:
    on_example(name, "1000.", time_bound.linuxcnc(shipped()), 5, 10)


def first_planned(run: Callable[[int], Cut | None], first: int) -> Cut:
    """The first of a hundred random parts that is not refused."""
    return next(done for seed in range(first, first + 100) if (done := run(seed)) is not None)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(12))
def test_unseen_surfaces_with_an_operator(number: int) -> None:
    def run(seed: int) -> Cut | None:
        machine = shipped(random.Random(seed).choice(SHIPPED))
        return on_surfaces(seed, time_bound.linuxcnc(machine) if seed % 3 == 0 else machine, 8)

    first_planned(run, 800 + 100 * number)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(6))
def test_unseen_nurbs_surfaces_with_an_operator(number: int) -> None:
    first_planned(lambda seed: on_nurbs(seed, shipped(random.Random(seed).choice(SHIPPED)), 6), 100 * number)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(8))
def test_random_oblique_machines_with_an_operator(number: int) -> None:
    first_planned(lambda seed: on_surfaces(900 + seed, oblique(seed), 6), 100 * number)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_stop_in_the_middle_of_anything_ends_on_the_path(seed: int) -> None:
    rng = random.Random(seed)
    source, machine = program("example2_ready.ngc", "3000."), shipped()
    ticks = len(cut(source, machine).rows)
    events = [e for e in random_operators.events(rng, ticks, 4) if e.tick < ticks]
    events = sorted([*events, Event(rng.randrange(20, ticks - 20), Request.STOP)], key=lambda e: e.tick)
    surfaces, offset = EXAMPLES["example2_ready.ngc"]
    judge(source, machine, surfaces, offset, events, f"stop, seed {seed}")


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.0005, 0.001, 0.005])
def test_the_limits_hold_at_other_periods_with_an_operator(period_s: float) -> None:
    """One bus carries five drives down to 2 ms; below, this one takes no time at all."""
    machine = shipped(period_s=period_s)
    buses = tuple(replace(bus, bit_rate=0) for bus in machine.buses)
    on_example("example2_ready.ngc", "3000.", replace(machine, buses=buses), 23, 8)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 0.5, 2.0])
def test_an_override_in_the_cut_is_reached_soon_and_exactly(share: float) -> None:
    """min(F x override, limits): at 300 mm/min Example 1 has no limit in the way of twice the feed."""
    source, machine = program("example1_ready.ngc", "300."), shipped()
    first = int(np.flatnonzero(cut(source, machine).trace.cutting)[0])
    at = first + 500
    events = [Event(at, Request.OVERRIDE, share), Event(at + 1000, Request.OVERRIDE, 1.0)]
    surfaces, offset = EXAMPLES["example1_ready.ngc"]
    done = judge(source, machine, surfaces, offset, events, f"override {share}")
    feed = done.column("feed_mm_s")
    np.testing.assert_allclose(feed[at + 150 : at + 950], 5.0 * share, rtol=1e-6)
    np.testing.assert_allclose(feed[at + 1150 : at + 1500], 5.0, rtol=1e-6)
    assert feed[first : first + 1500].max() <= 5.0 * max(share, 1.0) * (1.0 + 1e-9)
