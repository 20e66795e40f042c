"""One row a tool and a list of holes: as the program's words have them, whatever offset, plane or stroke."""

from __future__ import annotations

import itertools
import json
import math

import pytest
from support.machines.shipped_kinds import machine

from controller.machine.model import Machine
from controller.plan.report import tool_use
from controller.plan.report.survey import Survey
from controller.runtime import checked


def looked_at(text: str, built: Machine | None = None) -> Survey:
    asked = checked.task(text.encode(), "part.ngc", built or machine())
    return checked.looked_at(asked)[0]


TOOLS = """G21 G90 G54 G64 P0.01
M6 T1 G43 H1
S1000 M3
G0 X0 Y0 Z50
G1 Z-1 F200
X30 F600
S2000 M3
G2 X40 Y10 J10
G0 Z50
G10 L2 P2 X5 Y6 Z20
G55
G1 Z-3.5 F300
G0 Z50
T2 M6 G43 H2
S800 M4
G0 X1 Y2
G98 G83 X3 Y4 Z-12 R2 Q5 F100
G80
M30
"""


def test_each_tool_has_its_times_lengths_ranges_and_lowest_z_as_programmed() -> None:
    found = looked_at(TOOLS)
    mill, drill = found.tools
    assert (mill.tool, drill.tool) == (1, 2)
    assert mill.spindle_rev_min == (1000.0, 2000.0) and drill.spindle_rev_min == (800.0, 800.0)
    assert mill.feed_mm_min == pytest.approx((200.0, 600.0))
    assert drill.feed_mm_min == pytest.approx((100.0, 100.0))
    assert mill.deepest_mm == pytest.approx(-3.5, abs=1e-6), "Z of G55, not of the machine"
    assert drill.deepest_mm == pytest.approx(-12.0, abs=1e-6)
    work = {one.what: one for one in found.work}
    assert mill.cut_mm == pytest.approx(work["mill"].length_mm)
    assert drill.cut_mm == pytest.approx(work["drill"].length_mm)
    assert mill.cut_s + drill.cut_s == pytest.approx(work["mill"].time_s + work["drill"].time_s)
    assert mill.rapid_s + drill.rapid_s == pytest.approx(work["rapid"].time_s)


HOLES = """G21 G90 G54 S500 M3 F300
G0 X0 Y0 Z50
G99 G81 X10 Y20 Z-4 R2
X11
G83 X12 Z-9 R3 Q2
G80
G55
G91 G82 X1 Z-6 R-45 L3 P0.01
G90 G80
G85 X40 Y5 Z-3 R1
G80
G18 G0 Y-20
G81 X7 Z8 Y-30 R-25
G80
M30
"""


def test_each_hole_has_its_place_heights_cycle_tool_and_line() -> None:
    found = looked_at(HOLES)
    told = [(one.line, one.cycle, one.offset, one.plane, one.tool) for one in found.holes]
    assert told == [
        (3, "G81", "G54", "G17", 1),
        (4, "G81", "G54", "G17", 1),
        (5, "G83", "G54", "G17", 1),
        *[(8, "G82", "G55", "G17", 1)] * 3,
        (10, "G85", "G55", "G17", 1),
        (13, "G81", "G55", "G18", 1),
    ]
    holes = [(*(one.place[i] for i in one.axes), one.end) for one in found.holes]
    assert holes[:3] == [
        pytest.approx((10.0, 20.0, 2.0, -4.0)),
        pytest.approx((11.0, 20.0, 2.0, -4.0)),
        pytest.approx((12.0, 20.0, 3.0, -9.0)),
    ]
    step = [b[0] - a[0] for a, b in itertools.pairwise(holes[3:6])]
    assert step == pytest.approx([1.0, 1.0]) and all(b - e == pytest.approx(6.0) for _, _, b, e in holes[3:6])
    assert holes[6] == pytest.approx((40.0, 5.0, 1.0, -3.0))
    assert holes[7] == pytest.approx((8.0, 7.0, -25.0, -30.0)), "Z and X are the plane's, Y is its axis"
    assert found.hole_count == 8
    first = json.loads(json.dumps(found.to_dict()))["holes"][0]
    assert [first[name] for name in ("x", "y", "z", "from", "to")] == pytest.approx(
        [10.0, 20.0, 2.0, 2.0, -4.0]
    )


def test_holes_of_a_tilted_plane_are_in_its_coordinates() -> None:
    text = "S500 M3 F300 G43 H1\nG0 X0 Y0 Z100\nG68.2 X10 Y0 Z0 I0 J20 K0\nG53.1\nG0 X0 Y0 Z20\n"
    found = looked_at(text + "G81 X3 Y4 Z-5 R2\nG80\nG69\nM30\n")
    (hole,) = found.holes
    assert (*hole.place, hole.end) == pytest.approx((3.0, 4.0, 2.0, -5.0), abs=1e-6)
    assert found.tools[0].deepest_mm == pytest.approx(-5.0, abs=1e-6)


def test_a_program_without_end_lists_so_many_holes_and_counts_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tool_use, "MAX_HOLES", 4)
    found = looked_at("S500 M3 F600\nG0 Z50\nG91 G81 X1 Z-2 R-45 L6\nG80\nM30\n")
    assert (len(found.holes), found.hole_count) == (4, 6)


def test_rapids_are_work_of_their_own_and_turns_alone_have_no_millimetres() -> None:
    found = looked_at("G0 X30 Z100\nG0 C90\nM30\n")
    (rapid,) = found.work
    assert rapid.what == "rapid" and rapid.time_s > 0.2
    assert 0.0 < rapid.length_mm < 30.0 + 1000.0 and math.isfinite(rapid.length_mm)
    alone = looked_at("G0 C90\nM30\n").work
    assert [(one.what, one.length_mm) for one in alone] == [("rapid", 0.0)] and alone[0].time_s > 0.1
    (tool,) = looked_at("G0 X30\nM30\n").tools
    assert (tool.cut_s, tool.spindle_rev_min, tool.deepest_mm) == (0.0, None, None) and tool.rapid_s > 0.1
