"""Rows of short chords with a corner at each, rounded by G64 P: one law over all, within every limit."""

from __future__ import annotations

import numpy as np
import pytest
from support.machines.planned_laws import chains, laws_of, sampled
from support.machines.stepped_runs import largest, shipped
from support.parts import plane_chords

from controller.machine.kinematics import kinematics_of
from controller.plan.feed import bounds, profile, search
from controller.plan.feed.course import FeedCourse
from controller.plan.report.planned import windows_along
from controller.plan.segment import ContinuousPath
from controller.plan.track import Track

SHARP = 5.0, 15.0
LESS = 1e-4  # of the time: no law is slower by more for leaving out what cannot matter
OF_TIME = 5e-3  # ... or by more for being sought in parts
SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4, 5))]


def row(count: int, feed: float = 3000.0, seed: int = 1, path: str = "G64 P0.001") -> ContinuousPath:
    """The chain of all chords."""
    found = chains(plane_chords.program(count, SHARP, path, feed, seed), shipped())
    feeds = (chain for chain in found if chain.segments[0].feed_mm_s is not None)
    return max(feeds, key=lambda chain: sum(one.motion.end for one in chain.segments))


def duration_s(chain: ContinuousPath) -> float:
    return sum(law.duration_s for law in laws_of(chain.segments, shipped()))


@pytest.mark.parametrize("path", ["G64 P0.001", "G64 P0.01"])
@pytest.mark.parametrize("seed", SEEDS)
def test_setpoints_of_a_row_of_corners_keep_every_limit(seed: int, path: str) -> None:
    machine, chain = shipped(), row(150, seed=seed, path=path)
    laws = laws_of(chain.segments, machine)
    velocity, acceleration, jerk = largest(sampled(chain.segments, laws, machine)[0], machine)
    assert velocity <= 1.0005 and acceleration <= 1.002 and jerk <= 1.015


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_sought_again_in_a_part_is_as_fast_as_all_of_it(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    chain = row(150, seed=seed)
    found = duration_s(chain)
    monkeypatch.setattr(search, "FEW", 0.0)
    monkeypatch.setattr(search, "FAR", 2.0)
    assert found <= (1.0 + OF_TIME) * duration_s(chain)


def test_an_axis_that_stands_costs_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    chain = row(100)
    moving, seen = bounds._moving, []

    def noted(d):  # type: ignore[no-untyped-def]
        found = moving(d)
        seen.append(found[0])
        return found

    monkeypatch.setattr(bounds, "_moving", noted)
    found = duration_s(chain)
    assert seen and all(len(axes) < len(shipped().axes) for axes in seen)
    monkeypatch.setattr(bounds, "_moving", lambda d: (np.arange(d.first.shape[1]), d))
    assert found <= (1.0 + LESS) * duration_s(chain)


@pytest.mark.parametrize(
    ("count", "feed"),
    [(700, 500.0), *(pytest.param(1800, x, marks=pytest.mark.slow) for x in (900.0, 1200.0))],
)
def test_a_row_of_many_windows_rests_nowhere(count: int, feed: float) -> None:
    """A window that is not planned out of motion ends the one before at rest: the tool stands on the part."""
    machine, chain = shipped(), row(count, feed)
    track = Track([chain], machine, kinematics_of(machine))
    windows = list(windows_along(track, machine, kinematics_of(machine)))
    assert len(windows) >= 2
    assert [one.seam_s is None for one in windows] == [False] * (len(windows) - 1) + [True]


def test_windows_of_a_row_of_corners_are_as_fast_as_the_whole() -> None:
    machine, chain = shipped(), row(700, feed=500.0)
    track = Track([chain], machine, kinematics_of(machine))
    windows = list(windows_along(track, machine, kinematics_of(machine)))
    whole = profile.plan(FeedCourse(chain.segments, machine, kinematics_of(machine)))
    assert whole is not None
    assert windows[-1].end_s - windows[0].start_s <= 1.01 * whole.duration_s
