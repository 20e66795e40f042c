"""Exact lines much shorter than what a jump takes around it: no slower than with a rest at each corner.

As lines of their own: what is different of rows of them is in ``lines/test_exact_rows``.
"""

from __future__ import annotations

import numpy as np
import pytest
from support.machines.planned_laws import chains, laws_of, sampled
from support.machines.stepped_runs import SHIPPED, largest, shipped
from support.parts import cam_lines, cam_programs

from controller.geometry.arrays import Array
from controller.machine.kinematics import kinematics_of
from controller.motion.motions import ToolLine, ToolSpline
from controller.plan.feed import profile
from controller.plan.feed.course import FeedCourse, Index
from controller.plan.lines import exact_rows
from controller.plan.look_ahead import WINDOW_S, Orders, TrackPlace, Windows
from controller.plan.surfaces import rates
from controller.plan.track import Track

WAYS = ((0.02, 4), (0.02, 3), (0.1, 4))  # step in mm, and digits
FEW = [("trunnion", 0.02, 4), ("head_head", 0.02, 3), ("trunnion", 0.1, 4)]
OTHERS = [(name, *way) for name in SHIPPED if name not in ("trunnion", "head_head") for way in WAYS]
CASES = [*FEW, *(pytest.param(*case, marks=pytest.mark.slow) for case in OTHERS)]
AT_LEAST = 20  # lines that are looked at


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exact_rows, "MIN_LINES", 10**9)


@pytest.mark.parametrize(("name", "step_mm", "decimals"), CASES)
def test_running_through_short_lines_is_quicker_than_a_rest_at_each_of_their_corners(
    name: str, step_mm: float, decimals: int, alone: None
) -> None:
    machine = shipped(name)
    made = cam_programs.bowl(1, 25.0 * step_mm, step_mm=step_mm)
    source, _ = cam_programs.text(made, 2000.0, True, "G61", decimals=decimals)
    looked = 0
    for chain in chains(source, machine):
        lines = [s for s in chain.segments if isinstance(s.motion, ToolLine)]
        if not lines:
            continue
        laws = laws_of(lines, machine)
        velocity, acceleration, jerk = largest(sampled(lines, laws, machine)[0], machine)
        assert velocity <= 1.0005 and acceleration <= 1.0005 and jerk <= 1.0005
        alone = [profile.plan(FeedCourse([line], machine, kinematics_of(machine))) for line in lines]
        at_rests = sum(law.duration_s for law in alone if law is not None)
        assert sum(law.duration_s for law in laws) <= 1.02 * at_rests
        looked += len(lines)
    assert looked >= AT_LEAST


def exact_lines(count: int) -> str:
    return "".join(cam_lines.program(cam_lines.places(count, 0.02), False, "G21 G90 G54 G61"))


@pytest.mark.parametrize(("name", "vectors"), [("trunnion", False), *((name, True) for name in SHIPPED)])
def test_derivatives_of_lines_together_are_those_of_each(name: str, vectors: bool, alone: None) -> None:
    machine = shipped(name, tool_lines="great_circle" if vectors else "joints")
    kinematics = kinematics_of(machine)
    source, _ = cam_programs.text(cam_programs.bowl(1, 2.0), 2000.0, vectors, "G61")
    found = [s for chain in chains(source, machine) for s in chain.segments]
    lines = [s for s in found if isinstance(s.motion, ToolLine) and rates.kind(s, kinematics) is not None]
    assert len(lines) >= 10
    of = np.repeat(np.arange(len(lines)), 5)
    s = np.concatenate([np.linspace(0.0, line.motion.end, 5) for line in lines])
    both = rates.together(lines, s, of, kinematics)
    for k, line in enumerate(lines):
        alone = rates.derivatives(line, s[of == k], kinematics)
        for one, other in ((both.first, alone.first), (both.second, alone.second), (both.third, alone.third)):
            assert np.array_equal(one[of == k], other)


def test_a_window_of_short_lines_is_as_long_as_any_other() -> None:
    """Not as long as the lines would take at a feed that they never come near."""
    machine = shipped()
    kinematics = kinematics_of(machine)
    track = Track(chains(exact_lines(1500), machine), machine, kinematics)
    windows, place, longest = Windows(machine, kinematics), TrackPlace(0, 0.0), 0.0
    units = []
    while (sent := windows.from_rest(track, place, 0.0, Orders())) is not None and len(units) < 6:
        place, longest = sent.after, max(longest, sent.end_s)
        rows = (one.motion for one in sent.segments.values() if isinstance(one.motion, ToolSpline))
        units.append(sum(len(row.lines) for row in rows))
    assert longest < 2.0 * WINDOW_S
    assert max(units) > 100


def places_asked(count: int, monkeypatch: pytest.MonkeyPatch) -> int:
    """At so many places derivatives are taken to plan so many exact lines."""
    machine, asked, derivatives = shipped(), 0, FeedCourse.derivatives

    def counted(self: FeedCourse, s: Array, index: Index | None = None) -> rates.Derivatives:
        nonlocal asked
        asked += len(s)
        return derivatives(self, s, index)

    track = Track(chains(exact_lines(count), machine), machine, kinematics_of(machine))
    windows, place = Windows(machine, kinematics_of(machine)), TrackPlace(0, 0.0)
    with monkeypatch.context() as patched:
        patched.setattr(FeedCourse, "derivatives", counted)
        while (sent := windows.from_rest(track, place, 0.0, Orders())) is not None:
            place = sent.after
            track.forget(place.unit)
    return asked


def test_what_an_exact_line_costs_does_not_grow_with_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    few, many = (places_asked(count, monkeypatch) for count in (400, 1600))
    assert many < 6.0 * few  # and not sixteen times as many
    assert many < 120 * 1600
