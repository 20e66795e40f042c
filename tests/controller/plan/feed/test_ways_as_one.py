"""Ways that rest between them are searched for as one: each as fast as alone, and within every limit."""

from __future__ import annotations

import pytest
from support.machines.planned_laws import chains, sampled
from support.machines.stepped_runs import largest, shipped
from support.parts import plane_chords

from controller import memory
from controller.machine.kinematics import kinematics_of
from controller.plan import known
from controller.plan.feed import profile
from controller.plan.feed.course import FeedCourse

OF_TIME = 2e-4  # no way is slower by more for being sought with others
WAYS = 8
SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4))]


def ways(seed: int = 1, path: str = "") -> list[FeedCourse]:
    """Some of adaptive clearing that have to be searched for."""
    machine, found = shipped(), list[FeedCourse]()
    source = plane_chords.adaptive(600, seed).replace("G54", f"G54 {path}", 1)
    for chain in chains(source, machine):
        for run in profile.split_at_stops(chain.segments, machine, kinematics_of(machine)):
            found.append(FeedCourse(run, machine, kinematics_of(machine)))
    sought = [one for one in found if profile._closed(one, profile.REST, one.length) is None]
    return sought[:: max(1, len(sought) // WAYS)][:WAYS]


@pytest.mark.parametrize("path", ["", "G64 P0.01"])
@pytest.mark.parametrize("seed", SEEDS)
def test_each_way_is_as_fast_as_alone_and_keeps_every_limit(seed: int, path: str) -> None:
    courses, machine = ways(seed, path), shipped()
    assert len(courses) == WAYS
    for course, found in zip(courses, profile.plan_each(courses), strict=True):
        alone = profile.plan(course)
        assert found is not None and alone is not None and found.joins
        assert found.start_s == 0.0 and found.end_s == pytest.approx(course.length, abs=1e-9)
        assert found.at(0.0).v == 0.0 and abs(found.at(found.duration_s).v) <= 1e-9
        assert abs(found.duration_s - alone.duration_s) <= OF_TIME * alone.duration_s
        laws = [law for _, law in found.laws(course)]
        velocity, acceleration, jerk = largest(sampled(course.segments, laws, machine)[0], machine)
        assert velocity <= 1.0005 and acceleration <= 1.002 and jerk <= 1.015


def test_one_search_is_enough_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    courses, searched, sought = ways(), profile._searched, list[int]()

    def counted(course, *state):  # type: ignore[no-untyped-def]
        sought.append(len(course.rests) + 1)
        return searched(course, *state)

    monkeypatch.setattr(profile, "_searched", counted)
    profile.plan_each(courses)
    assert sought == [WAYS]


def test_where_one_search_finds_nothing_each_way_is_planned_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    courses, searched = ways(), profile._searched
    alone = [profile.plan(course) for course in courses]
    monkeypatch.setattr(
        profile, "_searched", lambda one, *state: None if one.rests else searched(one, *state)
    )
    for found, other in zip(profile.plan_each(courses), alone, strict=True):
        assert found is not None and other is not None
        assert (found.times == other.times).all() and (found.pieces == other.pieces).all()


def test_what_was_sought_as_one_is_known_of_each_way() -> None:
    memory.forget()
    courses = ways()
    found = known.laws(courses)
    for course, law in zip(courses, found, strict=True):
        assert known.law(course, profile.REST, None, None) is law
    assert all(a is b for a, b in zip(known.laws(courses), found, strict=True))
