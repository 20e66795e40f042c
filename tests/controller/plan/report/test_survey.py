"""The survey of ``check``: what it says of each block, and that it is what the machine then does."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine
from support.machines.stepped_runs import cut, shares, shipped
from support.machines.traced_programs import mill, trace

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Limits, Machine
from controller.plan.report import planned
from controller.plan.report.survey import MAX_SHARES, BlockUse, JointUse, Survey, survey
from controller.program.program import ProgramError
from controller.verify import tables

CONE = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D20. F600.\n"
MIXED = f"""G0 X0 Y0
G4 P0.0131
G1 X30 F1200
G1 X30 Y7
(a comment)
G2 X40 Y7 I5 J0 F900
{CONE}M0
G1 A10 F3000
M30
"""


ROUND = "G64 P0.01\nG1 X15 Y0 F1500\nG3 X15 Y0 I-15 J0\nG1 X0\n"
LONG = "G1 X200 Y90 F900\nG1 X0\n"  # more than one window
STOPS = "M0\nG0 X1\nM0\nM1\nM0\nG0 X0\nM0\nM30\n"


def looked_at(text: str, built: Machine | None = None) -> tuple[Survey, list[BlockUse]]:
    built, blocks = built or mill(), list[BlockUse]()
    found = survey(trace(text, built).items, built, kinematics_of(built), blocks.append)
    return found, blocks


CHORDS = """G0 X5 Y-5
G1 X0 Y0 F3000
X0.2 Y0.01
X0.38 Y0.07
X0.38 Z-0.5
Y0.25 F600
G0 Z5
G2 X10 Y0 I4.81 J-0.125
G1 X10.2 Y0.1 F1200
Y0.3
X90 F900
X90.1 Y0.6
C3
X90 Y0.6 C3.5
M0
G81 X20 Y0 Z-3 R2 F200
X21
G80
G1 X21.1 Y0.2
M30
"""


def test_a_row_of_rests_is_surveyed_as_motion_after_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many ways at once have the ticks, shares, times and holes that each has alone."""
    found, blocks = looked_at(CHORDS)
    monkeypatch.setattr(planned._Windows, "_ways", lambda *_: [])
    alone, one_by_one = looked_at(CHORDS)
    assert found.ticks == alone.ticks
    assert_near(found.to_dict(), alone.to_dict())
    assert_near([one.to_dict() for one in blocks], [one.to_dict() for one in one_by_one])


def assert_near(one: object, other: object) -> None:
    """The same, but for the rounding of sums."""
    if isinstance(one, dict) and isinstance(other, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_near(one[key], other[key])
    elif isinstance(one, list | tuple) and isinstance(other, list | tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_near(a, b)
    else:
        assert one == (pytest.approx(other, abs=2e-6) if isinstance(one, float) else other)


def block_of(blocks: list[BlockUse], line: int) -> BlockUse:
    (one,) = (block for block in blocks if block.line == line)
    return one


def test_every_block_has_its_line_kind_length_and_time() -> None:
    _, blocks = looked_at("G0 X10\nG1 X40 F1200\nG4 P0.05\nM30\n")
    assert [(b.line, b.what) for b in blocks] == [(1, "rapid"), (2, "line"), (3, "dwell"), (4, "end")]
    line, dwell = block_of(blocks, 2).own, block_of(blocks, 3).own
    assert line.length_mm == pytest.approx(30.0) and 1.5 < line.time_s < 1.7
    assert (dwell.length_mm, dwell.max_ratio) == (0.0, {}) and dwell.time_s == pytest.approx(0.05)


def test_a_cut_is_reported_at_the_contact_with_its_ways_apart() -> None:
    _, (cone,) = looked_at(CONE)
    assert (cone.what, cone.own.feed) == ("cone", pytest.approx(600.0))
    assert cone.own.length_mm == pytest.approx(15.0 * 20.0 / 57.29577951308232)
    assert cone.own.feed_max == pytest.approx(600.0, rel=1e-3)
    assert cone.own.feed_mean == pytest.approx(60.0 * cone.own.length_mm / cone.own.time_s)
    assert cone.approach and cone.departure
    assert cone.approach.feed_max > 600.0, "rapids are in it"


WORKING = f"""S100 M3 F600
G0 X0 Y0 Z50
G1 X30
G2 X40 Y10 J10
G99 G81 X41 Y12 Z40 R48
X45
G83 X50 Z42 R48 Q4
G84 X55 Z40 R48
G80
G1 C10
{CONE}"""


def test_a_survey_names_what_is_milled_drilled_tapped_and_cut_each_with_its_length_and_time() -> None:
    found, blocks = looked_at(WORKING)
    cone_mm = math.radians(20.0) * 15.0
    lengths = {"surface": cone_mm, "mill": 30.0 + 15.0 * math.pi, "drill": 16.0 + 6.254, "tap": 16.0}
    *cuts, rapid = found.work
    assert {one.what: one.length_mm for one in cuts} == pytest.approx(lengths, abs=1e-3)
    assert all(one.time_s >= one.length_mm / 10.0 - 1e-9 for one in cuts)
    assert rapid.what == "rapid" and rapid.length_mm > 100.0
    assert [(b.line, b.what) for b in blocks if b.line in (5, 6, 7, 8)] == [
        *((line, "drill") for line in (5, 6, 7)),
        (8, "tap"),
    ]
    last = tables.whole(found, "p.ngc", "mill")
    assert "drill 22.3 mm" in last and "tap 16.0 mm" in last and "mill 77.1 mm" in last
    assert f"rapid {rapid.length_mm:.1f} mm" in last
    assert "nothing is cut" in tables.whole(looked_at("G0 X10\n")[0], "p.ngc", "mill")


def test_the_times_of_all_parts_are_the_duration() -> None:
    found, blocks = looked_at(MIXED)
    parts = [part for b in blocks for part in (b.approach, b.own, b.departure) if part]
    assert sum(part.time_s for part in parts) == pytest.approx(found.duration_s, abs=1e-9)
    assert found.ticks == round(found.duration_s / 0.002)


def test_an_even_cruise_is_bound_by_the_feed_for_most_of_its_time() -> None:
    _, blocks = looked_at("G1 X60 F600\n")
    first = blocks[0].own.binds[0]
    assert (first.what, first.axis, first.kind) == ("feed", None, None) and first.share > 0.9
    assert sum(bound.share for bound in blocks[0].own.binds) <= 1.0 + 1e-9


def test_the_feed_of_a_row_of_lines_is_the_programmed_one() -> None:
    """At a corner that the spline cuts its length runs faster than the tip: what is told is the tip's."""
    text = "G21 G90 G54 G64 P0.05\nG0 X0 Y0 Z60 A0 C0\nG1 X30 F1500\nY30\nX60 Y5 A5\nG2 X80 Y5 I10\n"
    rows = [block for block in looked_at(text)[1] if block.what == "line"]
    assert [row.own.feed for row in rows] == [pytest.approx(1500.0, rel=1e-9)] * len(rows)
    assert rows and max(row.own.feed_max for row in rows) <= 1500.0 * 1.001


def test_a_slow_axis_is_named_with_kind_share_and_place() -> None:
    built = machine()
    slow = Limits(5.0, 100.0, 2000.0)
    built = replace(built, axes=tuple(replace(a, limits=slow) if a.name == "Y" else a for a in built.axes))
    found, blocks = looked_at("G1 X30 Y30 F3000\n", built)
    part = blocks[0].own
    most = part.binds[0]
    assert (most.what, most.axis, most.kind) == ("Y velocity", "Y", "velocity") and most.share > 0.8
    (where,) = (one for one in part.where if one.what == "Y velocity")
    assert 0.0 < where.from_s < where.to_s < part.time_s
    assert 0.0 < where.from_mm < where.to_mm < part.length_mm
    assert 0.97 < part.max_ratio["Y"]["velocity"] <= 1.0
    assert found.cut_binds[0].what == "Y velocity"


def test_no_limit_is_used_beyond_itself() -> None:
    found, blocks = looked_at(MIXED)
    for block in blocks:
        for part in (block.approach, block.own, block.departure):
            for row in part.max_ratio.values() if part else ():
                assert all(row[kind] <= most for kind, most in MAX_SHARES.items())
    assert not any(use.over for use in found.joints)


def test_shares_are_those_of_the_setpoints_where_a_law_is_above_its_limit_between_two_of_them() -> None:
    """Where the circle goes over into the line the law has 1.010 of Y's jerk, for less than a period."""
    built = shipped(period_s=0.005)
    done = cut(ROUND, built)
    home = tuple(axis.homing.position for axis in built.axes)
    found = survey(trace(ROUND, built, home).items, built, kinematics_of(built))
    asked = shares(done.joints, built)[2].max(axis=0)
    assert max(asked) > 0.9 and max(use.jerk_share for use in found.joints) <= 1.0
    for use, share in zip(found.joints, asked, strict=True):
        assert use.jerk_share >= share - 1e-3, use.name


def test_a_share_that_no_law_of_the_plan_may_take_is_named_in_every_answer() -> None:
    kept = JointUse("X", 0.0, 1.0, (0.0, 2.0), 1.0, 1.0, 1.013)
    over = replace(kept, name="Y", acceleration_share=1.01, jerk_share=1.02)
    assert (kept.over, over.over) == ((), ("acceleration", "jerk"))
    assert "over" not in kept.to_dict() and over.to_dict()["over"] == ("acceleration", "jerk")
    found = replace(looked_at(MIXED)[0], joints=(kept, over))
    cells = [[*column.cells] for column in tables.joints(found).columns][-3:]
    assert cells == [
        ["100.0 %", "100.0 %"],
        ["100.0 %", "101.0 % over the limit"],
        ["101.3 %", "102.0 % over the limit"],
    ]
    assert "101.5 % of jerk" in str(tables.joints(replace(found, joints=(kept,))).caption)
    sound = replace(found, joints=(replace(kept, jerk_share=1.0),))
    assert tables.joints(sound).caption is None


def test_what_binds_where_is_in_order_and_does_not_overlap() -> None:
    _, blocks = looked_at(MIXED)
    for block in blocks:
        where = block.own.where
        assert all(a.to_s <= b.from_s + 1e-12 for a, b in itertools.pairwise(where))
        assert all(one.from_s < one.to_s and one.from_mm <= one.to_mm + 1e-12 for one in where)


def test_the_report_is_json_with_a_bounded_number_of_places() -> None:
    found, blocks = looked_at(MIXED)
    rows = [json.loads(json.dumps(block.to_dict(), allow_nan=False)) for block in blocks]
    wanted = {"line", "last_line", "lines", "what", "length_mm", "time_s", "feed_mm_min", "feed_mean_mm_min"}
    assert wanted | {"feed_max_mm_min", "binds", "where", "max_ratio", "approach", "departure"} == set(
        rows[0]
    )
    json.dumps(found.to_dict(), allow_nan=False)


def test_the_program_after_the_first_refusal_is_refused() -> None:
    with pytest.raises(ProgramError, match=r"part\.ngc:2:"):
        looked_at("G0 X10\nG0 X9000\n")


@pytest.mark.parametrize(
    "text",
    [MIXED, "M30\n", "G4 P0.05\nG4 P0\n", LONG, STOPS],
    ids=["mixed", "end", "dwell", "long", "stops"],
)
def test_the_duration_is_what_a_run_takes_tick_for_tick(text: str) -> None:
    built = shipped(period_s=0.008)
    home = tuple(axis.homing.position for axis in built.axes)
    done = cut(text, built)
    found = survey(trace(text, built, home).items, built, kinematics_of(built))
    assert done.run.result == "completed"
    assert len(done.run.rows) == found.ticks
