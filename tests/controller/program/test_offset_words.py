"""G10, G28, G30, G52 to G54.1, G68 and G92: where words lead, by the documentation of LinuxCNC and Fanuc."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.traced_programs import mill, segments, trace
from support.oracles import reference_interpreter

from controller.machine.model import Machine
from controller.plan.report import explained
from controller.plan.report.explained import Step
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import ProgramError, Remark

CONE = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D90. F100.\n"


def steps(text: str, on: Machine) -> list[Step]:
    return list(explained.steps(blocks.stream(text.encode(), on, "p.ngc"), on, "p.ngc", homed(on)))


def axes(text: str, dialect: str = "rs274") -> tuple[float | None, ...]:
    """X Y Z A C where a program ends."""
    on = reference_interpreter.machine(dialect, without_point="unit")
    return tuple(steps(text, on)[-1].axes[name] for name in "XYZAC")


def xyz(text: str, dialect: str = "rs274") -> tuple[float | None, ...]:
    return axes(text, dialect)[:3]


def refused(text: str, dialect: str = "rs274") -> str:
    with pytest.raises(ProgramError) as error:
        axes(text, dialect)
    return error.value.sentence


@pytest.mark.parametrize(
    ("text", "ends"),
    [
        ("G10 L2 P1 X10 Y5\nG0 X1 Y1", (11.0, 6.0, 0.0)),
        ("G10 L2 P3 X10\nG10 L2 P3 Y5\nG56 G0 X1 Y1", (11.0, 6.0, 0.0)),  # axes without a word stay
        ("G10 L2 P0 X10\nG0 X1", (11.0, 0.0, 0.0)),
        ("G91 G10 L2 P1 X10\nG10 L2 P1 X10\nG90 G0 X0", (10.0, 0.0, 0.0)),  # no distances
        ("G20 G10 L2 P1 X1\nG21 G0 X1", (26.4, 0.0, 0.0)),
        ("G10 L2 P1 X10 R90\nG0 X1 Y2", (8.0, 1.0, 0.0)),
        ("G10 L2 P1 R90\nG91 G0 X1", (0.0, 1.0, 0.0)),
        ("G0 X3 Y4\nG10 L20 P1 X1 Y1\nG0 X0 Y0", (2.0, 3.0, 0.0)),
        ("G0 X3 Y4\nG10 L20 P2 X1\nG55 G0 X0 Y0", (2.0, 0.0, 0.0)),
        ("G10 L2 P9 X7\nG59.3 G0 X1", (8.0, 0.0, 0.0)),
        ("G10 L1 P1 Z20\nG10 L0\nG43 G0 Z1", (0.0, 0.0, 21.0)),  # what is set counts as it is
        ("G0 X3\nG92 X1\nG0 X5", (7.0, 0.0, 0.0)),
        ("G0 X3\nG92 X1\nG55 G0 X5", (7.0, 0.0, 0.0)),  # shifts every work offset
        ("G0 X3\nG92 X1\nG92.2\nG0 X5", (5.0, 0.0, 0.0)),
        ("G0 X3\nG92 X1\nG92.2\nG92.3\nG0 X5", (7.0, 0.0, 0.0)),
        ("G0 X3\nG92 X1\nG92.1\nG92.3\nG0 X5", (5.0, 0.0, 0.0)),
        ("G43 H1\nG0 Z5\nG92 Z0\nG0 Z1", (0.0, 0.0, 16.0)),
        ("G52 X10\nG0 X1 Y1", (11.0, 1.0, 0.0)),
        ("G52 X10\nG92 X0\nG52 X2\nG0 X1", (3.0, 0.0, 0.0)),  # one shift with G92
        ("G10 L1 P1 Z20\nG43 G0 Z1", (0.0, 0.0, 21.0)),
        ("G0 Z30\nG10 L10 P1 Z5\nG43 G0 Z1", (0.0, 0.0, 26.0)),
        ("G10 L2 P9 Z4\nG0 Z30\nG10 L11 P1 Z5\nG43 G0 Z1", (0.0, 0.0, 22.0)),
        ("G43.1 Z7\nG0 Z1", (0.0, 0.0, 8.0)),
        ("G43.1 Z7 X2\nG43.1 Y3\nG0 X1 Y1 Z1", (3.0, 4.0, 8.0)),
        ("G43.1 X2\nG10 L2 P1 R90\nG0 X1 Y0", (2.0, 1.0, 0.0)),
        ("G43.1 X2 Z7\nG49\nG0 X1 Z1", (1.0, 0.0, 1.0)),
        ("G43 H1\nG43.2 H2\nG0 Z1", (0.0, 0.0, 36.4)),
        ("M61 Q2\nG43 G0 Z1", (0.0, 0.0, 26.4)),
        ("G0 X5 Y5\nG68 X5 Y5 R90\nG0 X6 Y5", (5.0, 6.0, 0.0)),
        ("G0 X5 Y5\nG68 R90\nG0 X6 Y5", (5.0, 6.0, 0.0)),  # about where the tool stands
        ("G68 X0 Y0 R90\nG0 X6 Y5\nG69\nG0 X6", (6.0, 6.0, 0.0)),
        ("G18 G68 X0 Z0 R90\nG0 X6", (0.0, 0.0, -6.0)),
    ],
)
def test_where_words_lead_under_rs274(text: str, ends: tuple[float, ...]) -> None:
    assert xyz(text) == pytest.approx(ends)


@pytest.mark.parametrize(
    ("text", "ends"),
    [
        ("G91 G10 L2 P1 X10.\nG10 L2 P1 X10.\nG90 G0 X0", (20.0, 0.0, 0.0)),
        ("G10 L20 P3 X10.\nG54.1 P3 G0 X1.", (11.0, 0.0, 0.0)),
        ("G10 L10 P1 R20.\nG43 H1 G0 Z1.", (0.0, 0.0, 21.0)),
        ("G10 L11 P1 R-.2\nG43 H1 G0 Z1.", (0.0, 0.0, 10.8)),
        ("G52 X10.\nG0 X1.\nG92 X0.\nG52 X0\nG0 X1.", (2.0, 0.0, 0.0)),  # two shifts
        ("G0 X5.\nG52 X0 Y0 Z0\nX1. Y1.\nX2. Y1.", (2.0, 1.0, 0.0)),  # swallows no line
        ("G44 H1 G0 Z1.", (0.0, 0.0, -9.0)),
    ],
)
def test_where_words_lead_under_fanuc(text: str, ends: tuple[float, ...]) -> None:
    assert xyz(text, "fanuc") == pytest.approx(ends)


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
@pytest.mark.parametrize(
    ("text", "ends"),
    [
        ("G0 X3. Y4.\nG10 L120 P1 X1. Y1.\nG0 X0 Y0", (2.0, 3.0, 0.0)),
        ("G10 L2 P2 X5.\nG0 X3. Y4.\nG10 L120 P2 Y1.\nG55 G0 X0 Y0", (5.0, 3.0, 0.0)),
        ("G10 L120 P2 R30.\nG10 L2 P2 X5.\nG10 L2 P1 R60.\nG10 L120 P2 R30.\nG55 G0 X1. Y0", (5.0, 1.0, 0.0)),
        ("G10 L2 P1 R60.\nG10 L120 P1 R30.\nG0 X1. Y0", (0.0, 1.0, 0.0)),  # from the active one
        ("G10 L2 P1 X10. Y5. R90.\nG0 X0 Y0\nG10 L120 P3 X0\nG56 G0 X1. Y0", (10.0, 6.0, 0.0)),  # unset
        ("G10 L2 P1 X10. Y5.\nG10 L120 P3 R90.\nG56 G0 X1. Y0", (10.0, 6.0, 0.0)),
        ("G10 L121 P1 Z20. R2.\nG43 H1 G0 X#5410 Z1.", (4.0, 0.0, 21.0)),
    ],
)
def test_what_probing_cycles_set_is_set_in_both_dialects(
    dialect: str, text: str, ends: tuple[float, ...]
) -> None:
    unset = replace(reference_interpreter.machine(dialect, without_point="unit"), unset=("G56",))
    last = steps(text, unset)[-1]
    assert tuple(last.axes[name] for name in "XYZ") == pytest.approx(ends)


def test_a_sister_comes_with_its_own_size_and_h_means_what_is_in_the_spindle() -> None:
    """T1 is 10 mm long, T2 25.4: never is the length of a tool in force that is not in the spindle."""
    on = replace(reference_interpreter.machine(), sisters=((1, 2),))
    for text, tool, z in (
        ("T1 M6\nG43 G0 Z1", 2, 26.4),
        ("T1 M6\nG43 H1 G0 Z1", 2, 26.4),
        ("G43 H1 G0 Z1", 1, 11.0),  # T1 is in the spindle still
        ("T2 M6\nG43 H2 G0 Z1", 2, 26.4),
        ("M61 Q1\nG43 H1 G0 Z1", 1, 11.0),
    ):
        read = blocks.read(text.encode(), on, "p.ngc")
        assert (read.blocks[-1].modal.tool, steps(text, on)[-1].axes["Z"]) == (tool, pytest.approx(z)), text
    told = [one.sentence for one in blocks.read(b"T1 M6\n", on, "p.ngc").blocks if isinstance(one, Remark)]
    assert told == ["T1 is worn: its sister T2 comes in its place."]


def test_rotaries_are_shifted_as_well() -> None:
    assert axes("G0 A30\nG92 A10\nG0 A15 C5")[3:] == pytest.approx((35.0, 5.0))
    assert axes("G10 L2 P1 A7\nG1 F100 A1")[3:] == pytest.approx((8.0, 0.0))
    assert axes("G10 L2 P1 A7\nG91 G0 A1\nG53 G90 G0 C2")[3:] == pytest.approx((1.0, 2.0))


def reference_points() -> Machine:
    """G28 at (100, 50, 200), G30 at Z 150; homed at zero."""
    made = reference_interpreter.machine()
    x, y, z, *rotary = made.axes
    linear = (replace(x, reference=100.0), replace(y, reference=50.0), replace(z, reference=200.0))
    z = replace(linear[2], second_reference=150.0)
    return replace(made, axes=(linear[0], linear[1], z, *rotary))


@pytest.mark.parametrize(
    ("text", "ways"),
    [
        ("G28", [(100.0, 50.0, 200.0)]),
        ("G28 Z9", [(0.0, 0.0, 9.0), (0.0, 0.0, 200.0)]),
        ("G91 G28 Z0", [(0.0, 0.0, 200.0)]),
        ("G91 G28 Z3 X1", [(1.0, 0.0, 3.0), (100.0, 0.0, 200.0)]),
        ("G30 Z9", [(0.0, 0.0, 9.0), (0.0, 0.0, 150.0)]),
        ("G30", [(100.0, 50.0, 150.0)]),
        ("G0 X5\nG28.1\nG0 X7\nG28 X8", [(5.0, 0.0, 0.0), (7.0, 0.0, 0.0), (8.0, 0.0, 0.0), (5.0, 0.0, 0.0)]),
        ("G92 Z-50\nG28 Z9", [(0.0, 0.0, 59.0), (0.0, 0.0, 200.0)]),
        ("G28 W0", [(0.0, 0.0, 200.0)]),
        ("G28 U1 W2", [(1.0, 0.0, 2.0), (100.0, 0.0, 200.0)]),
    ],
)
def test_the_ways_to_the_reference_points(text: str, ways: list[tuple[float, ...]]) -> None:
    dialect = "fanuc" if set("UW") & set(text) else "rs274"
    on = replace(reference_points(), dialect=dialect, without_point="unit")
    here: tuple[float | None, ...] = (0.0, 0.0, 0.0)
    found = []
    for step in steps(text, on):
        place = tuple(step.axes[name] for name in "XYZ")
        if step.kind == "rapid" and place != here:
            found.append(place)
        here = place
    assert found == [pytest.approx(way) for way in ways]


def test_the_path_goes_where_the_reader_says() -> None:
    """The joints that are planned, against the positions that explain tells: offset, shift, turn, cycle."""
    text = (
        "G10 L2 P2 X5 Y3 Z100 R30\nG55 G0 X1 Y2 Z60\nG92 X0 A5\nG68 X1 Y1 R20\nG0 X4\n"
        "G81 X5 Y6 Z48 R52 F100\nX7\nG80\nG69\nG91 G28 Z0\n"
    )
    on = mill(unset=())
    read = blocks.read(text.encode(), on, "p.ngc", start=(0.0, 0.0, 200.0, 0.0, 0.0))
    told = [s for s in explained.steps(read.blocks, on, "p.ngc", (0.0, 0.0, 200.0, 0.0, 0.0))]
    planned = [on.shown(segment.end) for segment in segments(trace(text, on))]
    said = [tuple(step.axes.values()) for step in told if step.kind in ("rapid", *explained.LINES)]
    moving = [
        b for a, b in zip([None, *said], said, strict=False) if a is None or b != pytest.approx(a, abs=1e-9)
    ]
    assert len(planned) == len(moving)
    for is_so, wanted in zip(planned, moving, strict=True):
        assert is_so == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("G10 X1", "sets nothing here"),
        ("G10 L3 P1 X1", "L3 sets nothing here"),
        ("G10 L2 P10 X1", "P10 sets nothing here"),
        ("G10 L20 P1 R5 X1", "R5 is not taken by G10 L20"),
        ("G10 L0 P1", "takes P1: G10 L0 takes L"),
        ("G10 L0 X1", "takes X1: G10 L0 takes L"),
        ("G10 L1 P1 X3 A5", "takes X3: G10 L1 takes L P Z R"),
        ("G1 X1 F5\nG4 X2", "X2 is no time of G4 here: it takes P"),
        ("G10 L1 P9 Z5", "P9 names no tool"),
        ("G10 L1 P1 R0", "R0 leaves no tool"),
        ("G92", "G92 says no position"),
        ("G68 X1", "G68 does not say by how much"),
        ("G0 G28 Z1", "G0 and G28 on one line both take the axis words"),
        ("G1 X1 G92.1 F5\nG10 L2 P1 G1 X2", "G1 and G10 on one line"),
        (CONE + "G92 X0", "has to know where the axes stand"),
        (CONE + "G28.1", "has to know where the axes stand"),
        ("G43.1 H1", "H1"),
        ("G43.2", "G43.2 takes H"),
        ("G28 U1", "U1"),
        ("G44 H1", "length taken off Z"),
        ("M61", "M61 does not say which tool"),
        ("G54.1 P49", "G54.1 takes P1 to P48"),
        ("G54.1 P4", "G54.1 P4 is not set"),
    ],
)
def test_what_is_refused_says_what_to_do(text: str, sentence: str) -> None:
    assert sentence in refused(text)


def test_behind_a_surface_words_make_the_position_known_again() -> None:
    assert xyz(CONE + "G0 X1 Y2 Z3 A0 C0\nG92 X0\nG0 X1")[0] == pytest.approx(2.0)


def test_g10_changes_the_tool_that_cuts_surfaces() -> None:
    cut = segments(trace(f"G10 L1 P1 R2\n{CONE}", mill(unset=())))
    motions = [s.motion for s in cut if s.cutting]
    assert [getattr(motion, "offset_mm", None) for motion in motions] == [2.0]
