"""What G68.2 to G69 and G53.1 mean in each dialect, by hand: all zeros are where the axes of A and C meet."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from support.machines.traced_programs import mill, segments, trace
from support.oracles import reference_interpreter

from controller.geometry.vectors import subtract
from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.report import explained
from controller.plan.report.explained import Step
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import CutCone, CutRuled, ProgramError, Remark

S = math.sqrt(0.5)


def on(dialect: str = "fanuc", name: str = "") -> Machine:
    made = machine_file.load(name) if name else reference_interpreter.machine(dialect)
    return replace(made, dialect=dialect, without_point="unit")


def steps(text: str, machine: Machine) -> list[Step]:
    return list(explained.steps(blocks.stream(text.encode(), machine, "p"), machine, "p", homed(machine)))


def place(text: str, machine: Machine | None = None) -> list[float]:
    """Tip in the table frame where a program ends (no tool length)."""
    machine = machine or on()
    end = steps(text, machine)[-1]
    joints = [(end.axes[axis.name] or 0.0) / axis.shown_per_unit for axis in machine.axes]
    return [round(float(q), 9) + 0.0 for q in kinematics_of(machine).forward(joints, 0.0).tip]


def turned(text: str, machine: Machine | None = None) -> tuple[float, ...]:
    """A and C where a program ends, degrees."""
    end = steps(text, machine or on())[-1]
    return tuple(round(end.axes[name] or 0.0, 6) + 0.0 for name in "AC")


def refused(text: str, machine: Machine | None = None) -> ProgramError:
    with pytest.raises(ProgramError) as error:
        steps(text, machine or on())
    return error.value


# ---- where X Y Z lead ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plane", "tip"),
    [
        ("G68.2 X5 Y6 Z7", (6, 8, 10)),
        ("G68.2 I90", (-2, 1, 3)),
        ("G68.2 J90", (1, -3, 2)),
        ("G68.2 I90 J90", (3, 1, 2)),  # J about the X that I has turned
        ("G20\nG68.2 X1\nG21", (26.4, 2, 3)),
        ("G91\nG68.2 X5\nG90", (6, 2, 3)),  # the origin is a position all the same
        ("G68.2 P1 Q123 I90 J90", (2, -3, -1)),  # both about the axes of the part: X first
        ("G68.2 P1 Q213 I90 J90", (3, 1, 2)),
        ("G68.2 P1 Q321 I90 J90", (3, 1, 2)),
        ("G68.2 P1 I90 K90", (3, 1, 2)),
        ("G68.2 P2 Q1 X5 Y6 Z7\nG68.2 P2 Q2 X5 Y16 Z7\nG68.2 P2 Q3 X0 Y6 Z7", (3, 7, 10)),
        # Q0 moves the origin along the axes of the plane, then turns by R
        (
            "G68.2 P2 Q0 X10 R90\nG68.2 P2 Q1 X5\nG68.2 P2 Q2 X5 Y9\nG68.2 P2 Q3 X0",
            (4, 8, 3),
        ),
        ("G68.2 P3 Q1 X5 I0 J2 K0\nG68.2 P3 Q2 K7", (3, 1, 3)),
        ("G68.2 P4 X5", (6, 2, 3)),
        ("G68.2 P4 K90", (-2, 1, 3)),
        ("G68.2 J90\nG68.4 X10 I90", (8, -3, 1)),
        ("G68.2 X5\nG68.2 Y5", (1, 7, 3)),  # of the part again
        ("G68.2 X5\nG69", (1, 2, 3)),
        ("G68.2 J90\nG52 Z10", (1, -13, 2)),
        ("G68.2 J90\nG52 Z10\nG69", (1, 2, 3)),
        ("G52 Z10\nG68.2 J90", (1, -3, 12)),
        ("G52 Z10\nG68.2 J90\nG69", (1, 2, 13)),
        ("G68.2 J90\nG0 X0 Y0 Z0\nG92 Z5", (1, 2, 2)),
        ("G68.2 J90\nG68 X0 Y0 R90", (-2, -3, 1)),  # in the plane
        ("G68.2 J90\nG68 X0 Y0 R90\nG69", (1, 2, 3)),
        ("G68.2 J90\nG52 Z10\nG68.4", (1, -13, 2)),  # seen from the coordinates as they are
        ("G10 L2 P2 X100\nG68.2 J90\nG55", (101, -3, 2)),
        ("G10 L2 P1 R90\nG68.2 J90", (3, 1, 2)),
        ("G68.2 J90\nG43.4 H0", (1, -3, 2)),
    ],
)
def test_where_x1_y2_z3_is_under_fanuc(plane: str, tip: tuple[float, ...]) -> None:
    """The same with the tool as it stands and with the tool turned to the plane."""
    for turn in ("", "G53.1\n") if "G69" not in plane else ("",):
        assert place(f"{plane}\n{turn}G0 X1 Y2 Z3\n") == pytest.approx(tip, abs=1e-9)


@pytest.mark.parametrize(
    ("plane", "tip"),
    [
        ("G68.2 J90", (1, 2, 3)),  # counts from G53.1 on
        ("G68.2 J90\nG53.1", (1, -3, 2)),
        ("G68.2 X5 J90 R90\nG53.1", (8, 1, 2)),  # R about Z of the part, the origin stays
        ("G68.2 P0 Q131 I90\nG53.1", (1, -3, 2)),
        ("G68.2 P1 Q123 I90 J90\nG53.1", (3, 1, 2)),  # first, second and third turn, carried along
        ("G68.2 P1 Q321 I90 J90\nG53.1", (-2, 3, -1)),
        (
            "G68.2 P2 Q0 X10\nG68.2 P2 Q1 X5\nG68.2 P2 Q2 X5 Y9\nG68.2 P2 Q3 X0\nG53.1",
            (8, 1, 3),  # the points are directions alone
        ),
        ("G68.2 P3 Q0 X5 I5 J2 K0\nG68.2 P3 Q1 K7\nG53.1", (3, 1, 3)),  # I J K is a point on X
        ("G68.2 J90\nG53.1\nG68.4 X10 I90", (1, -3, 2)),
        ("G68.2 J90\nG53.1\nG68.4 X10 I90\nG53.1", (8, -3, 1)),
        ("G68.2 J90\nG53.1\nG69", (1, 2, 3)),
        ("G68.2 J90\nG69", (1, 2, 3)),
    ],
)
def test_where_x1_y2_z3_is_under_rs274(plane: str, tip: tuple[float, ...]) -> None:
    assert place(f"{plane}\nG0 A0 C0\nG0 X1 Y2 Z3\n", on("rs274")) == pytest.approx(tip, abs=1e-9)


def test_distances_arcs_and_their_planes_are_those_of_the_tilted_plane() -> None:
    begin = "G68.2 J90\nG53.1\nG0 X0 Y0 Z0\n"
    assert place(begin + "G91\nG0 X1 Y2 Z3\n") == pytest.approx((1, -3, 2), abs=1e-9)
    assert place(begin + "G2 X2 Y2 R2 F9\n") == pytest.approx((2, 0, 2), abs=1e-9)
    arc = steps(begin + "G18 G3 X4 I2 F9\n", on())[-1]
    assert arc.facts["centre"] == {"X": pytest.approx(2.0), "Z": pytest.approx(0.0)}
    middle = segments(trace(begin + "G18 G3 X4 Z0 I2 F9\n", on(), homed(on())))[-1].motion.curve.at(0.5)  # type: ignore[union-attr]
    there = segments(trace(begin + "G1 X2 Z2 F9\n", on(), homed(on())))[-1].end
    below = segments(trace(begin + "G1 X2 Z-2 F9\n", on(), homed(on())))[-1].end
    off = [max(map(abs, subtract(middle, end[:3]))) for end in (there, below)]
    assert min(off) < 1e-9 < max(off)


def test_g68_3_is_across_the_tool_with_its_x_level() -> None:
    begin = "G0 A-30 C-90\nG0 X40 Y50 Z60\n"
    tip = place(begin)
    end = steps(begin + "G68.3 R90\nG0 X0 Y0 Z0\n", on())[-1]
    assert place(begin + "G68.3 R90\nG0 X0 Y0 Z0\n") == pytest.approx(tip)  # no origin: where the tip is
    assert end.tilted is not None
    # A-30 leans the tool to -Y of the table, which C-90 carries to +X of the part: X, level, is +Y.
    c, s = math.cos(math.radians(30.0)), 0.5
    assert end.tilted.z == pytest.approx((s, 0.0, c))
    assert end.tilted.y == pytest.approx((0.0, -1.0, 0.0))
    assert steps(begin + "G68.3 X1 Y2 Z3\n", on("rs274"))[-1].tilted is None
    upright = steps("G68.3 X1 Y2 Z3\nG0 X0\n", on())[-1].tilted
    assert upright is not None and (upright.x, upright.origin) == ((1.0, 0.0, 0.0), (1.0, 2.0, 3.0))


# ---- G53.1 and its kin ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "ends"),
    [
        ("A0 C0", (-30.0, 0.0)),
        ("A20 C0", (30.0, 180.0)),  # A goes 10 and not 50 degrees: the primary is judged first
        ("A20 C0\nP1", (30.0, 180.0)),
        ("A20 C0\nP2", (-30.0, 0.0)),
        ("A-20 C350\nP2", (-30.0, 360.0)),  # C in the nearest turn
        ("A-20 C350\nP1", (30.0, 180.0 + 360.0 * 0)),
    ],
)
def test_p_of_g53_1_is_the_side_of_the_primary_under_fanuc(start: str, ends: tuple[float, float]) -> None:
    turn, _, p = start.partition("\n")
    assert turned(f"G0 {turn}\nG68.2 J30\nG53.1 {p}\n") == ends


@pytest.mark.parametrize(
    ("start", "ends"),
    [
        ("A20 C0", (30.0, 180.0)),
        ("A20 C0\nP1", (30.0, 180.0)),
        ("A20 C0\nP2", (-30.0, 0.0)),
        ("A-50 C0\nP1", (-30.0, 0.0)),  # the way is positive, not the angle
        ("A-30 C0\nP1", (-30.0, 0.0)),  # no way at all
        ("A-30 C0\nP2", (-30.0, 0.0)),
        ("A50 C0\nP2", (30.0, 180.0)),
    ],
)
def test_p_of_g53_1_is_the_way_of_the_primary_under_rs274(start: str, ends: tuple[float, float]) -> None:
    turn, _, p = start.partition("\n")
    assert turned(f"G0 {turn}\nG68.2 J30\nG53.1 {p}\n", on("rs274")) == ends


def test_g53_1_leaves_x_y_z_g53_6_the_tip_and_g53_3_goes_to_a_place() -> None:
    begin = "G0 X10 Y20 Z30\nG68.2 X1 J30\n"
    before = steps(begin, on("rs274"))[-1].axes
    for code, dialect in (("G53.1", "fanuc"), ("G53.1", "rs274"), ("G53.3", "rs274")):
        after = steps(begin + code, on(dialect))[-1].axes
        assert [after[x] for x in "XYZ"] == [before[x] for x in "XYZ"] and after["A"] == pytest.approx(-30.0)
    for dialect in ("fanuc", "rs274"):
        assert place(begin + "G53.6\n", on(dialect)) == pytest.approx((10, 20, 30), abs=1e-9)
    end = steps(begin + "G53.3 X1 Y2 Z3\n", on("rs274"))[-1]
    assert [end.program[x] for x in "XYZ"] == pytest.approx([1, 2, 3], abs=1e-9)
    assert end.kind == "rapid" and end.axes["A"] == pytest.approx(-30.0)


def test_the_tip_stands_all_the_way_of_g53_6() -> None:
    """As a rapid of one motion, on the great circle or from evenly turning rotaries."""
    for name in ("trunnion", "head_head", "table_head", "oblique45"):
        machine = on("fanuc", name)
        kinematics = kinematics_of(machine)
        made = segments(trace("G43.1 Z20\nG0 X0 Y0 Z60\nG68.2 I20 J40\nG53.6\n", machine, homed(machine)))
        turn = made[-1]
        assert turn.feed_mm_s is None
        tips = []
        for k in range(11):
            joints = turn.motion.joints(turn.motion.end * k / 10.0, (0.0, 0.0), kinematics)
            assert joints is not None
            tips.append(kinematics.forward(joints, 20.0).tip)
        assert max(max(map(abs, subtract(tip, tips[0]))) for tip in tips) < 1e-9


def test_h_of_g53_6_is_the_length_of_a_tool() -> None:
    one = steps("G0 Z50\nG68.2 J30\nG53.6 H1\nG0 X0 Y0 Z0\n", on())[-1]
    other = steps("G0 Z50\nG43 H1\nG68.2 J30\nG53.6\nG0 X0 Y0 Z0\n", on())[-1]
    assert one.axes == other.axes != steps("G0 Z50\nG68.2 J30\nG53.6\nG0 X0 Y0 Z0\n", on())[-1].axes


def test_the_length_goes_along_the_tool() -> None:
    plain, longer = (
        steps(f"G43.1 Z{length}\nG68.2 J90\nG53.1\nG0 X0 Y0 Z0\n", on("fanuc", "head_head"))[-1].axes
        for length in (0, 10)
    )
    assert [round((longer[x] or 0.0) - (plain[x] or 0.0), 9) for x in "XYZ"] == [0.0, -10.0, 0.0]


# ---- surfaces, rows, functions beside it -----------------------------------------------------


def test_surfaces_are_turned_with_the_plane() -> None:
    cone = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D90. F100.\n"
    for text in ("G68.2 X5. Y6. J30.\n", "G68.2 X5. Y6. J30.\nG53.1\n"):
        read = blocks.read((text + cone).encode(), on(), "p").blocks
        (block,) = (b for b in read if isinstance(b, CutCone | CutRuled))
        frame = block.modal.frame(on())
        assert frame.origin == (5.0, 6.0, 0.0) and frame.z == pytest.approx((0.0, -0.5, math.sqrt(0.75)))
    made = trace("S1000 M3\nG68.2 X5. Y6. J30.\n" + cone, mill(dialect="fanuc", without_point="unit"))
    (cut,) = (s for s in segments(made) if s.name == "cut")
    assert cut.motion.part.z == pytest.approx((0.0, -0.5, math.sqrt(0.75)))  # type: ignore[union-attr]


def test_a_cycle_goes_along_the_tool_or_is_refused() -> None:
    hole = "G81 X1 Y2 Z-3 R4 F100\n"
    error = refused("G68.2 J30\n" + hole)
    assert (
        "would go along Z of the tilted plane, 30 degrees off the tool" in error.sentence and error.line == 2
    )
    for turn in ("G53.1", "G0 A-30", "G0 A-29.995"):
        assert steps(f"G68.2 J30\n{turn}\nG0 Z9\n{hole}", on())[-1].program["Z"] == pytest.approx(
            9.0, abs=2e-2
        )
    assert "along Y" in refused(f"G68.2 J30\nG53.1\nG18 {hole}").sentence


def test_rows_under_g64_follow_the_plane_too() -> None:
    row = "G64 P0.01\nG1 X10 F600\nX20 Y1\nX30 Y3\nX40 Y6\n"
    machine = on()
    made = segments(trace("G68.2 I30 J40\nG53.1\nG0 X0 Y0 Z0\n" + row, machine, homed(machine)))
    tip = kinematics_of(machine).forward(made[-1].end, 0.0).tip
    assert tip == pytest.approx(place("G68.2 I30 J40\nG53.1\nG0 X40 Y6 Z0\n"), abs=1e-9)


def test_explain_and_parameters_tell_of_the_plane() -> None:
    end = steps("G68.2 X5 J90\nG53.1\nG0 X1 Y2 Z3\nG0 X[#5420 + #5422]\n", on())[-1]
    assert end.program["X"] == pytest.approx(4.0)
    told = end.to_dict()["tilted"]
    assert told["origin"] == (5.0, 0.0, 0.0) and told["z"] == pytest.approx((0.0, -1.0, 0.0))
    assert steps("G0 X1\n", on())[-1].to_dict()["tilted"] is None


# ---- refusals ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dialect", "text", "line", "sentence"),
    [
        ("fanuc", "G53.1", 1, "none is defined: write G68.2"),
        ("fanuc", "G68.4 J10", 1, "is seen from a tilted plane, and none is active"),
        ("rs274", "G68.2 J10\nG68.4 J10", 2, "write G68.2 and G53.1 before it"),
        ("rs274", "G68.2 J10\nG68.2 J20", 2, "no G53.1 has turned the tool to"),
        ("rs274", "G68.2 J10\nG53.1\nG68.2 J20", 3, "write G69 before it, or G68.4"),
        ("fanuc", "G68 X0 Y0 R5\nG68.2 J10", 2, "stands under G68"),
        ("rs274", "G68.2 P4 I5", 1, "P4 is no definition of G68.2"),
        ("fanuc", "G68.2 P5", 1, "P4 projected angles"),
        ("fanuc", "G68.2 I5 R5", 1, "R5 is not taken by G68.2 P0"),
        ("fanuc", "G68.2 I5 Q313", 1, "Q313 is not taken by G68.2 P0"),
        ("fanuc", "G68.2 P1 Q121 I5", 1, "has Q121: Q is the order of the axes"),
        ("rs274", "G68.2 Q123 I5", 1, "one of 121 131 212 232 313 323"),
        ("rs274", "G68.2 P1 Q313 I5", 1, "one of 123 132 213 231 312 321"),
        ("fanuc", "G68.2 P2 Q1 X1\nG0 X1", 2, "only Q1 of it stands before this line"),
        ("fanuc", "G68.2 P2 Q1 X1\nX1", 2, "G68.2 P2 from line 1 on is not whole"),
        ("fanuc", "G1 F9\nG68.2 P2 Q1 X1\nG1 X1", 3, "is not whole"),
        ("rs274", "G68.2 P2 Q1 X1\nM70\nG1 X1", 3, "is not whole"),
        ("rs274", "G68.2 P2 Q1 X1\nM71\n(nothing)\nG1 X1", 4, "is not whole"),
        ("fanuc", "G68.2 P2 Q1 X1\nG68.2 P3 Q2 K1", 2, "G68.2 P2 from line 1 on is not whole"),
        ("fanuc", "G68.2 P2 Q1 X1\nG68.2 P2 Q1 X2", 2, "Q1 stands here for the second time"),
        ("fanuc", "G68.2 P2 Q4 X1", 1, "has no line Q4"),
        ("fanuc", "G68.2 P2 Q1 I1", 1, "I1 is not taken by G68.2 P2 Q1"),
        ("rs274", "G68.2 P2 Q1\nG68.2 P2 Q2 X1\nG68.2 P2 Q3 Y1\nM30", 4, "only Q1 Q2 Q3"),
        ("fanuc", "G68.2 P2 Q1\nG68.2 P2 Q2 X9\nG68.2 P2 Q3 X5", 3, "three points on one line"),
        ("fanuc", "G68.2 P2 Q1\nG68.2 P2 Q2 X9\nG68.2 P2 Q3 X9", 3, "three points on one line"),
        ("fanuc", "G68.2 P2 Q1\nG68.2 P2 Q2\nG68.2 P2 Q3 X9", 3, "three points on one line"),
        ("fanuc", "G68.2 P3 Q1\nG68.2 P3 Q2 K1", 2, "a vector along X without length"),
        ("fanuc", "G68.2 P3 Q1 I1\nG68.2 P3 Q2", 2, "a vector along Z without length"),
        ("fanuc", "G68.2 P3 Q1 I1\nG68.2 P3 Q2 I.1 K1", 2, "84.29 degrees apart: they are 85 to 95"),
        ("rs274", "G68.2 P3 Q0 I1\nG68.2 P3 Q1 I.01 K1", 2, "89.43 degrees apart"),
        ("fanuc", "G68.2 P4 I90 J-90", 1, "has projected axes 0 degrees apart"),
        ("fanuc", "G68.3 X1", 1, "an origin without Y Z"),
        ("fanuc", "G68.2 J10\nG53.1 P3", 2, "P3 chooses nothing"),
        ("fanuc", "G68.2 J10\nG53.6 H77", 2, "names no tool"),
        ("fanuc", "G68.2 J10\nG0 X1 A5", 2, "A5 stands beside X Y Z in a tilted plane"),
        ("fanuc", "G68.2 J10\nG1 X1 F9\nX2 A5", 3, "A5 stands beside X Y Z"),
        ("fanuc", "G68.2 J10\nG28 X0 A0", 2, "A0 stands beside X Y Z"),
        ("fanuc", "G68.2 J10\nG0 G81 X1 Z2 R3 A5 F9", 2, "G0 and G81 are both motion codes"),
        ("rs274", "G68.2 J10\nG53.1\nG10 L20 P1 X0", 3, "G10 L20 takes where the tool stands"),
        ("fanuc", "G68.2 J10\nG53.3 X1", 2, "write G53.1, and G0 on the next line"),
        ("rs274", "G68.2 J10\nG91\nG53.3 X1", 3, "write G90 before it"),
        ("fanuc", "G68.2 J10 A5", 1, "no code on this line takes A5"),
        ("rs274", "G68.2 X1 G1 F9", 1, "both take the axis words"),
    ],
)
def test_what_is_refused_says_where_and_why(dialect: str, text: str, line: int, sentence: str) -> None:
    error = refused(text, on(dialect))
    assert sentence in error.sentence and error.line == line


def test_a_plane_out_of_reach_is_told_with_angles_and_travel() -> None:
    reach = refused("G68.2 J100.\nG53.1\n", on("fanuc", "oblique45"))
    assert "no position of B and C gives this tool axis, whatever their travel" in reach.sentence
    travel = refused("G68.2 I30. J130.\nG53.1\n", on("fanuc", "trunnion"))
    assert "A-130.0000 C-30.0000 or A130.0000 C150.0000, and the travel is A -120 to 120" in travel.sentence
    asked = refused("G0 A100.\nG68.2 J30.\nG53.1 P1\n", on("rs274", "trunnion"))
    assert "P1 leaves none of" in asked.sentence and "leave out P" in asked.sentence
    assert (reach.line, travel.line, asked.line) == (2, 2, 3)


def test_x_y_z_out_of_travel_behind_it_are_refused_as_any_move() -> None:
    with pytest.raises(ProgramError, match=r"Y .*outside|Y .*travel") as error:
        trace(
            "G68.2 J80.\nG53.1\nG0 X0. Y250. Z0.\n", on("fanuc", "trunnion"), homed(on("fanuc", "trunnion"))
        )
    assert error.value.line == 3


def test_vectors_that_miss_a_right_angle_are_corrected_and_told() -> None:
    text = "G68.2 P3 Q1 I1 J0 K0.05\nG68.2 P3 Q2 K1\nG0 X1\n"
    read = blocks.read(text.encode(), on(), "p").blocks
    (told,) = (block.sentence for block in read if isinstance(block, Remark))
    assert (
        told == "G68.2 P3 has X and Z of the plane 87.14 degrees apart: Z stays, X gives way to make it 90."
    )
    assert place(text) == pytest.approx((1, 0, 0), abs=1e-9)


def test_words_without_a_point_count_as_the_machine_file_says() -> None:
    thousandth = replace(on(), without_point="thousandth")
    assert place("G68.2 P1 Q123 X5000 K90000\nG0 X1. Y2. Z3.\n", thousandth) == pytest.approx((3, 1, 3))
    assert "I30 has no decimal point" in refused("G68.2 I30\n", replace(on(), without_point=None)).sentence


def test_a_plane_and_its_unfinished_lines_are_kept_and_given_back_with_nothing_else() -> None:
    """M70 keeps what LinuxCNC keeps; a plane is none of it."""
    assert place("M70\nG68.2 J90\nM72\nG0 X1 Y2 Z3\n") == pytest.approx((1, -3, 2), abs=1e-9)


def test_a_cycle_does_not_outlive_its_plane() -> None:
    text = "G68.2 J30\nG53.1\nG0 Z9\nG81 X1 Y2 Z-3 R4 F100\nG69\nX5\n"
    assert "G81 has no Z" in refused(text).sentence


WORDS = ("X", "Y", "Z", "I", "J", "K", "R", "Q", "P", "H", "A", "C", "F")
LINES = ("G68.2", "G68.3", "G68.4", "G69", "G53.1", "G53.3", "G53.6", "G68", "G52", "G92", "G81", "G1", "G2")
OTHERS = ("G0", "", "G17", "G18", "G43.4", "G49", "G91", "G90", "G10 L2", "G28", "G54", "G20", "M70", "M72")


@pytest.mark.parametrize("dialect", ["fanuc", "rs274"])
def test_lines_at_random_are_read_or_refused(dialect: str) -> None:
    rng, machine = random.Random(17), on(dialect, "trunnion")
    for number in range(250):
        rows = []
        for _ in range(rng.randint(2, 9)):
            code = rng.choice(LINES if rng.random() < 0.7 else OTHERS)
            said = rng.sample(WORDS, rng.randint(0, 6))
            values = (0, 1, 2, 3, 90, 123, 313, 0.001, 17.5, -45)
            rows.append(" ".join([code, *(f"{letter}{rng.choice(values)}" for letter in said)]))
        refusals: list[ProgramError] = []
        text = "\n".join(rows)
        read = blocks.stream(text.encode(), machine, "p", refused=refusals)
        try:
            list(explained.steps(read, machine, "p", homed(machine)))
        except ProgramError:
            continue
        assert all(error.sentence for error in refusals), (number, text)
