"""What a check costs follows what happens along the path, not how long it lasts: computations are counted."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.machines.stepped_runs import shipped
from support.machines.traced_programs import mill, trace
from support.oracles.laws import at_share

from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.feed import binding, profile
from controller.plan.feed.course import FeedCourse
from controller.plan.report import duration, moments, planned
from controller.plan.report.duration import bounded
from controller.plan.report.survey import BlockUse, Survey, survey
from controller.plan.segment import ContinuousPath
from controller.program.program import ProgramError

FEEDS = (10_000.0, 1000.0, 100.0, 10.0, 1.0, 0.1, 0.01)  # mm/min
LINE = "G1 X0.1 F{}\n"
ARC = "G0 X0 Y0\nG2 X10 Y0 I5 J0 F{}\n"
CONE = "G42\nG51 X0. Y15. Z0. I0. J0. K0. H10. R10. D0.4 F{}\n"


@contextmanager
def counted() -> Iterator[dict[str, int]]:
    """Windows planned, laws sought, and places at which derivatives are asked for."""
    found = {"plans": 0, "searches": 0, "places": 0}
    patch = pytest.MonkeyPatch()

    def watch(owner: Any, name: str, key: str, much: Any) -> None:
        inner = getattr(owner, name)

        def outer(*args: Any, **more: Any) -> Any:
            found[key] += much(*args)
            return inner(*args, **more)

        patch.setattr(owner, name, outer)

    watch(profile, "plan", "plans", lambda *_: 1)
    watch(profile, "_searched", "searches", lambda *_: 1)
    watch(FeedCourse, "derivatives", "places", lambda course, s, *_: len(s))
    try:
        yield found
    finally:
        patch.undo()


def looked_at(text: str, built: Machine) -> tuple[Survey, list[BlockUse], dict[str, int]]:
    home, blocks = tuple(axis.homing.position for axis in built.axes), list[BlockUse]()
    with counted() as cost:
        found = survey(trace(text, built, home).items, built, kinematics_of(built), blocks.append)
    return found, blocks, cost


@pytest.mark.parametrize(
    ("text", "most"),
    [
        (LINE, {"plans": 8, "searches": 2, "places": 3000}),
        (ARC, {"plans": 12, "searches": 4, "places": 12_000}),
        pytest.param(CONE, {"plans": 40, "searches": 8, "places": 60_000}, marks=pytest.mark.slow),
    ],
    ids=["line", "arc", "cone"],
)
def test_a_slow_feed_costs_no_more_than_a_fast_one(text: str, most: dict[str, int]) -> None:
    lasting = []
    for feed in FEEDS:
        found, _, cost = looked_at(text.format(feed), shipped())
        lasting.append(found.duration_s)
        print(feed, found.duration_s, cost)
        assert all(cost[name] <= n for name, n in most.items()), (feed, cost)
    assert lasting[-1] > 400.0 * lasting[1]


def arc_course(words: str, built: Machine) -> FeedCourse:
    """An arc that begins at X0 Y0."""
    items = trace(f"G0 X0 Y0\n{words}\n", built).items
    last = [item for item in items if isinstance(item, ContinuousPath)][-1].segments[-1]
    assert last.name == "arc"
    return FeedCourse([last], built, kinematics_of(built))


@pytest.mark.parametrize("feed", [20.0, 6.0])
def test_windows_that_are_rolled_on_end_where_planned_ones_do(
    feed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the tick, and the same shares of limits, feeds and reasons."""
    built = mill()
    text = f"G1 X20 Y9 F{feed}\nG2 X24 Y9 I2 J0\nG1 Z190 F3000\n"
    rolled, blocks, cost = looked_at(text, built)
    monkeypatch.setattr(planned, "FEWEST", 10**9)
    whole, others, more = looked_at(text, built)
    assert cost["plans"] < 0.5 * more["plans"]
    assert rolled.ticks == whole.ticks
    for one, other in zip(blocks, others, strict=True):
        assert one.own.time_s == pytest.approx(other.own.time_s, abs=1e-6)
        assert one.own.length_mm == pytest.approx(other.own.length_mm, abs=1e-6)
        assert one.own.binds[0].what == other.own.binds[0].what
        for axis, row in one.own.max_ratio.items():
            for kind, share in row.items():
                assert share == pytest.approx(other.own.max_ratio[axis][kind], abs=moments.CHANGE)


def test_a_dwell_of_a_day_costs_nothing() -> None:
    found, _, cost = looked_at("G4 P86400\n", mill())
    assert found.duration_s >= 86400.0
    assert cost == {"plans": 0, "searches": 0, "places": 0}


def test_a_law_at_the_feed_keeps_every_limit_and_is_no_slower_than_the_one_that_is_sought() -> None:
    built = shipped()
    for words in ("G2 X10 Y0 I5 J0 F60", "G3 X20 Y0 I10 J0 F90"):
        course = arc_course(words, built)
        quick = profile.plan(course)
        sought = profile._searched(course, profile.REST, course.length)
        assert quick is not None and sought is not None
        assert len(quick.pieces) <= 7, "the closed form"
        assert quick.joins and quick.end_s == pytest.approx(course.length, abs=1e-9)
        assert quick.duration_s <= sought.duration_s + 2e-3
        for share in np.linspace(0.0, 1.0, 21):
            s, v, a, j = at_share(quick.times, quick.pieces, float(share))
            d = course.derivatives(np.clip(s, 0.0, course.length))
            for asked, which in ((d.velocity(v), 0), (d.acceleration(v, a), 1), (d.jerk(v, a, j), 2)):
                limits = [
                    (x.limits.velocity, x.limits.acceleration, x.limits.jerk)[which] for x in built.axes
                ]
                assert (np.abs(asked) / limits).max() <= 1.0


def test_moments_cover_every_span_once_and_lie_close_where_shares_change() -> None:
    built = mill()
    course = arc_course("G2 X10 Y0 I5 J0 F1200", built)
    plan = profile.plan(course)
    assert plan is not None
    spans = binding.spans(plan.laws(course))
    limits = np.array([[a.limits.velocity, a.limits.acceleration, a.limits.jerk] for a in built.axes])
    looks = [one for row in moments.rows(course, spans, limits) for one in row]
    assert sum(one.span.to_s - one.span.from_s for one in looks) == pytest.approx(plan.duration_s)
    ends = [one.span.from_s for one in looks] + [looks[-1].span.to_s]
    assert (np.diff(ends) >= 0.0).all()
    motion = moments.of(course, looks)
    assert motion.dt.sum() == pytest.approx(plan.duration_s)
    share = binding.used(motion, course.derivatives(motion.s)) / limits
    wide = motion.dt * moments.PER_WINDOW > binding.SHOWN_S * 1.001
    jumps = np.abs(np.diff(share, axis=0)).max(axis=(1, 2))
    assert (jumps[wide[1:] & wide[:-1]] <= moments.CHANGE).all()


# --- a program that is too long


def items_of(text: str, built: Machine) -> list[Any]:
    return list(bounded(trace(text, built).items, built, "part.ngc"))


def test_a_program_that_takes_too_long_is_refused_with_its_time_and_where_it_passes_the_bound() -> None:
    built = replace(mill(), longest_program_h=1.0)
    assert items_of("G4 P3599\n", built)
    with pytest.raises(ProgramError) as refused:
        items_of("G1 X10 F600\nG1 X20 F0.1\nG4 P3600\nG1 X10 F600\n", built)
    assert (refused.value.line, refused.value.file) == (2, "part.ngc")
    for word in ("2.667 h", "1 h", "longest_program_h", "[machine]", "F", "up to 10000"):
        assert word in refused.value.sentence, refused.value.sentence


def test_what_can_never_be_allowed_is_not_advised() -> None:
    with pytest.raises(ProgramError) as refused:
        items_of("G1 X150 F0.0002\n", mill())
    assert "raise longest_program_h" not in refused.value.sentence


def test_on_the_way_nothing_is_read_beyond_the_bound() -> None:
    built, read = replace(mill(), longest_program_h=1.0), list[int]()

    def watched() -> Iterator[Any]:
        for item in trace("G4 P3000\nG4 P3000\nG4 P3000\nG4 P3000\n", built).items:
            read.append(1)
            yield item

    with pytest.raises(ProgramError, match="up to here"):
        list(bounded(watched(), built, "part.ngc", whole=False))
    assert len(read) == 2


def test_the_least_time_is_just_below_the_planned_one() -> None:
    for text in ("G1 X20 F60\nG4 P2\nG0 X-200\n", "G1 X0 Y0 F1000\nG2 X10 Y0 I5 J0 F50\nG1 A20 F600\n"):
        built = mill()
        least = sum(s for item in trace(text, built).items for _, s in duration._parts(item, built))
        found, _, _ = looked_at(text, built)
        assert 0.8 * found.duration_s < least <= found.duration_s


def test_the_longest_program_is_a_key_of_the_machine_file() -> None:
    text = machine_file.load("fig4b").text
    assert machine_file.read(text, "m.toml").longest_program_h == 168.0
    longer = text.replace("[machine]\n", "[machine]\nlongest_program_h = 500.0\n")
    assert machine_file.read(longer, "m.toml").longest_program_h == 500.0
    for bad in ("0.0", "20000.0", '"long"'):
        with pytest.raises(machine_file.ConfigError, match="longest_program_h"):
            machine_file.read(
                text.replace("[machine]\n", f"[machine]\nlongest_program_h = {bad}\n"), "m.toml"
            )


def test_straight_motions_that_rest_are_planned_many_at_once() -> None:
    """Exact chords, as CAM systems write them: neither a window nor a search for each."""
    chords = "".join(f"G1 X{0.2 * k:.3f} Y{0.02 * (k % 2):.3f} F3000\n" for k in range(400))
    found, blocks, cost = looked_at(f"{chords}G0 Z5\n", mill())
    assert len(blocks) == 401 and found.duration_s > 10.0
    assert cost["plans"] <= 4 and cost["searches"] == 0
