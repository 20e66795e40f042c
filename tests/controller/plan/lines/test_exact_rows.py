"""Short exact lines in rows (G61): what a user would see of it if it were wrong.

The tool off its line, another feed or line number, a rest where there was none (or none where one must be), a
joint over its limits, a longer way to the end than with lines of their own, a refusal that says another line.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from support.machines import traced_programs
from support.machines.planned_laws import chains, laws_of, sampled
from support.machines.stepped_runs import SHIPPED, cut, largest, shipped
from support.parts import cam_lines, cam_programs

from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import ToolLine, ToolSpline
from controller.plan.feed import ticked
from controller.plan.feed.course import FeedCourse
from controller.plan.lines import exact_rows
from controller.plan.path import path
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Segment
from controller.program import blocks
from controller.program.program import ProgramError
from controller.runtime.events import Event
from controller.state.modes import Request

OVER = 1.0005  # of a limit
HOW = ("great_circle", "joints")
NAMES = [
    name if name in ("trunnion", "head_head") else pytest.param(name, marks=pytest.mark.slow)
    for name in SHIPPED
]


def random_lines(seed: int, vectors: bool) -> str:
    """Short lines over a wave with decimals of their own; some long, of no length, or only turning."""
    rng = np.random.default_rng(seed)
    step = float(rng.choice([0.01, 0.02, 0.05, 0.1]))
    made = cam_programs.bowl(1, 60.0 * step, step_mm=step, tilt=float(rng.uniform(0.15, 0.4)))
    made = made.noisy(float(rng.choice([0.0, 1e-4, 5e-4])), seed)
    source, _ = cam_programs.text(made, 2000.0, vectors, "G61", decimals=int(rng.choice([3, 4, 5])))
    rows = source.splitlines()
    for k in sorted(rng.choice(np.arange(12, len(rows) - 2), 3, replace=False).tolist(), reverse=True):
        rows.insert(k, str(rng.choice([rows[k - 1], "F1500", "X3.2"])))
    return "\n".join(rows) + "\n"


def alone(monkeypatch: pytest.MonkeyPatch, source: str, machine: Machine) -> list[ContinuousPath]:
    """The same program with every line a motion of its own."""
    with monkeypatch.context() as patched:
        patched.setattr(exact_rows, "MIN_LINES", 10**9)
        return chains(source, machine)


def lines_of(found: list[ContinuousPath], kinematics: Kinematics) -> list[tuple[int, float, Array]]:
    """(program line, tip's feed in its middle, joints at shares of it) of every feed line, in order."""
    told = []
    shares = np.array([0.0, 0.3, 0.5, 0.8, 1.0])
    for segment in (one for chain in found for one in chain.segments if one.feed_mm_s is not None):
        motion = segment.motion
        starts = [*motion.lines_s, motion.end] if isinstance(motion, ToolSpline) else [0.0, motion.end]
        numbers = list(motion.lines) if isinstance(motion, ToolSpline) else [segment.place.line]
        for number, low, high in zip(numbers, starts[:-1], starts[1:], strict=True):
            s = low + (high - low) * shares
            middle = np.array([0.5 * (low + high)])
            feed = float(segment.feed_at(middle)[0] * segment.tip_rate(middle)[0])
            told.append((number, feed, joints_along(segment, s, kinematics)))
    return told


def rests(found: list[ContinuousPath]) -> list[int]:
    """The lines behind which the machine rests."""
    ended = [chain.segments[-1] for chain in found if not chain.runs_on]
    return [one.motion.lines[-1] if isinstance(one.motion, ToolSpline) else one.place.line for one in ended]


def rows_of(found: list[ContinuousPath]) -> list[Segment]:
    return [one for chain in found for one in chain.segments if isinstance(one.motion, ToolSpline)]


@pytest.mark.parametrize(
    ("name", "vectors", "tool_lines"),
    [*((name, True, "great_circle") for name in SHIPPED), *(("trunnion", False, how) for how in HOW)],
)
@pytest.mark.parametrize("seed", range(1))
def test_a_row_goes_where_its_lines_go(
    seed: int, name: str, vectors: bool, tool_lines: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = shipped(name, tool_lines=tool_lines)
    kinematics, source = kinematics_of(machine), random_lines(seed, vectors)
    found, single = chains(source, machine), alone(monkeypatch, source, machine)
    assert rows_of(found) and not rows_of(single)
    told, wanted = lines_of(found, kinematics), lines_of(single, kinematics)
    assert [row[0] for row in told] == [row[0] for row in wanted]
    assert np.allclose([row[1] for row in told], [row[1] for row in wanted], rtol=1e-9)
    assert max(np.abs(a[2] - b[2]).max() for a, b in zip(told, wanted, strict=True)) < 1e-7  # mm or rad
    more = set(rests(found)) - set(rests(single))
    assert not set(rests(single)) - set(rests(found))
    assert not more & {n for one in rows_of(found) for n in one.motion.lines[:-1]}, "only at a row's end"


def dense(seed: int, step_mm: float, decimals: int, vectors: bool = True, feed: float = 2000.0) -> str:
    made = cam_programs.bowl(1, 80.0 * step_mm, step_mm=step_mm, tilt=0.2 + 0.05 * seed)
    return cam_programs.text(made, feed, vectors, "G61", decimals=decimals)[0]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("step_mm", "decimals"), [(0.01, 4), (0.02, 4), (0.05, 4), (0.1, 4), (0.02, 5)])
def test_no_joint_is_over_a_limit_in_any_tick(name: str, step_mm: float, decimals: int) -> None:
    """By differences of setpoints, at 100 % and slower, wherever the ticks fall."""
    machine, looked = shipped(name), 0
    for chain in chains(dense(1, step_mm, decimals), machine):
        if not rows_of([chain]):
            continue
        for override in (1.0, 0.37):
            laws = laws_of(chain.segments, machine, override)
            assert max(largest(sampled(chain.segments, laws, machine)[0], machine)) <= OVER
        looked += sum(len(one.motion.lines) for one in rows_of([chain]))
    assert looked >= 20


@pytest.mark.parametrize(("period_s", "down_mm"), [(0.0005, 5), (0.002, 2), (0.002, 10), (0.005, 5)])
def test_a_plunge_of_so_many_ticks_before_a_row_is_looked_at_and_done(
    down_mm: int, period_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The widest stride of its grid is just what is gone in a tick at the feed, up to rounding."""
    machine, looks, inner = shipped(period_s=period_s), itertools.count(), ticked.Ticked._use

    def used(self: ticked.Ticked, stride: int, scales: tuple[Array, Array, Array]) -> Array:
        assert next(looks) < 2000, "it never ends"
        return inner(self, stride, scales)

    monkeypatch.setattr(ticked.Ticked, "_use", used)
    for feed in (100, 150, 200, 250, 300, 400, 500, 600):
        looks = itertools.count()
        above = f"Z{down_mm + 0.1887:.4f}"
        source = dense(1, 0.1, 4).replace("Z0.1887", above, 1).replace(" F2000", "")
        source = source.replace("G1 ", f"G1 Z0.1887 F{feed}\nG1 ", 1)
        plunge = next(one for one in chains(source, machine) if one.segments[0].place.line == 7)
        assert rows_of([plunge]) and laws_of(plunge.segments, machine)


@pytest.mark.parametrize(("step_mm", "decimals"), [(0.02, 4), (0.05, 4), (0.1, 4), (0.02, 5)])
def test_a_row_takes_no_longer_than_its_lines_within_the_same_limits(
    step_mm: float, decimals: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A law of lines that are looked at one by one is above a limit here and there: it is slowed to it."""
    machine, source = shipped(), dense(2, step_mm, decimals)
    took = [
        _takes_s(found, machine) for found in (chains(source, machine), alone(monkeypatch, source, machine))
    ]
    assert took[0] <= 1.05 * took[1]


def _takes_s(found: list[ContinuousPath], machine: Machine) -> float:
    whole = 0.0
    for chain in found:
        laws = laws_of(chain.segments, machine)
        _, _, jerk = largest(sampled(chain.segments, laws, machine)[0], machine)
        whole += sum(law.duration_s for law in laws) * max(jerk, 1.0)
    return whole


def test_a_run_of_rows_keeps_the_limits_through_a_hold_and_another_feed() -> None:
    machine = shipped()
    source = "".join(cam_lines.program(cam_lines.places(500, 0.02), False, "G21 G90 G54 G61 T2 M6"))
    plain = cut(source, machine)
    assert plain.run.result == "completed"
    for tick in range(760, 1200, 260):
        done = cut(source, machine, [Event(tick, Request.HOLD), Event(tick + 200, Request.RESUME)])
        assert done.run.result == "completed"
        rates = np.abs(np.diff(done.joints, axis=0)).max(axis=1)
        assert rates[tick + 100 : tick + 190].max() == 0.0, "it stands"
        velocity, acceleration, jerk = largest(done.joints, machine)
        assert velocity <= OVER and acceleration <= 1.002 and jerk <= 1.016
    slow = cut(source, machine, [Event(700, Request.OVERRIDE, 0.05), Event(900, Request.OVERRIDE, 1.0)])
    assert slow.run.result == "completed" and max(largest(slow.joints, machine)) <= 1.016


def test_a_line_that_is_refused_is_told_as_ever_and_what_is_before_it_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rows = "".join(f"X{0.02 * k:.4f} A{119.0 + 0.02 * k:.4f}\n" for k in range(1, 100))
    text = "G55 G61 G43.4 G0 X0 Y0 Z0 A119 C0\nG1 F600\n" + rows
    told = []
    for least in (exact_rows.MIN_LINES, 10**9):
        monkeypatch.setattr(exact_rows, "MIN_LINES", least)
        machine, given = traced_programs.mill(), []
        kinematics = kinematics_of(machine)
        made = blocks.stream(text.encode(), machine, "part.ngc")
        with pytest.raises(ProgramError) as error:
            for item in path.stream(made, "part.ngc", machine, kinematics, traced_programs.HOME):
                given.append(item)
        last = [item for item in given if isinstance(item, ContinuousPath)][-1].segments[-1]
        told.append((error.value.line, error.value.sentence, rests([ContinuousPath((last,))])))
    assert told[0] == told[1]


def test_few_or_long_lines_are_no_rows() -> None:
    few = "".join(f"X{0.02 * k:.4f} A{10 + 0.02 * k:.4f}\n" for k in range(1, exact_rows.MIN_LINES))
    long = "".join(f"X{0.5 * k:.4f} A{10 + 0.02 * k:.4f}\n" for k in range(1, 100))
    for rows in (few, long):
        traced = traced_programs.trace("G55 G61 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 F600\n" + rows)
        motions = [type(one.motion) for one in traced_programs.segments(traced) if one.feed_mm_s is not None]
        assert motions and set(motions) == {ToolLine}


@pytest.mark.parametrize("count", [20, 100])
def test_a_row_and_a_line_that_is_none_meet_at_rest(count: int) -> None:
    """No law would know of the corners inside of the row; as ``count`` many are looked at, or wait."""
    rows = [f"X{0.02 * k:.4f} A{10 + 0.002 * k:.4f}" for k in range(1, count)]
    long = f"X{0.02 * count + 1.0:.4f} A{30 + 0.002 * count:.4f}"
    more = [f"X{0.02 * k + 1.0:.4f} A{30 + 0.002 * k:.4f}" for k in range(count + 1, 2 * count)]
    text = "G55 G61 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 F600\n" + "\n".join([*rows, long, *more]) + "\n"
    found = [item for item in traced_programs.trace(text).items if isinstance(item, ContinuousPath)][1:]
    kinds = [one.is_exact_row for chain in found for one in chain.segments]
    assert True in kinds and False in kinds
    for before, after in itertools.pairwise(found):
        if before.segments[-1].is_exact_row is not after.segments[0].is_exact_row:
            assert not before.runs_on


def test_a_row_behind_another_goes_on_without_a_rest() -> None:
    """As many lines as are looked at together, and more."""
    count = 3 * exact_rows.FIRST
    rows = "".join(f"X{0.02 * k:.4f} A{10 + 0.002 * k:.4f}\n" for k in range(1, count))
    traced = traced_programs.trace("G55 G61 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 F600\n" + rows)
    found = [item for item in traced.items if isinstance(item, ContinuousPath)][1:]
    assert [chain.runs_on for chain in found] == [True] * (len(found) - 1) + [False] and len(found) > 1
    numbers = [n for chain in found for one in rows_of([chain]) for n in one.motion.lines]
    assert numbers == list(range(3, 2 + count))


def test_the_allowed_speed_is_that_of_differences_of_samples() -> None:
    """A grid's answer beside that of samples taken at just that speed, wherever they begin."""
    machine = shipped()
    row = max(chains(dense(1, 0.02, 4), machine), key=lambda chain: len(rows_of([chain])))
    course = FeedCourse(row.segments, machine, kinematics_of(machine))
    seen = ticked.Ticked(course, 0.0, course.length)
    rng = np.random.default_rng(1)
    for k in rng.integers(20, len(seen.allowed) - 20, 60).tolist():
        v = float(min(seen.allowed[k - 2 : k + 3].min(), seen.feed[k]))
        middle = 0.5 * (seen.edges[k] + seen.edges[k + 1])
        for share in (1.0, 0.8, 0.6, 0.4):
            use = seen.uses(middle + share * v * machine.period_s * (np.arange(4) - 1.5))
            assert use.max() <= 1.0
