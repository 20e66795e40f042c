"""Program text to blocks. Cases are folders under tests/programs:

good/<case>/expected.txt lists the blocks one per line (see ``listing``);
refused/<case>/expected.txt has line:column, then phrases that the sentence contains.
"""

from __future__ import annotations

import math
import random
from dataclasses import fields, replace
from pathlib import Path

import pytest
from support.machines.shipped_kinds import machine

from controller import messages
from controller.machine import machine_file, setup_data
from controller.machine.model import Kind, Machine, Sense, Spindle
from controller.program import blocks
from controller.program.program import (
    Act,
    Action,
    Block,
    CutCone,
    CutRuled,
    Dwell,
    JointArc,
    JointLine,
    Modal,
    Program,
    ProgramError,
    Side,
)

PROGRAMS = Path(__file__).parents[2] / "programs"
GOOD = sorted(PROGRAMS.glob("good/*/program.ngc"))
REFUSED = sorted(PROGRAMS.glob("refused/*/program.ngc"))
CONE = "g51 x0 y1500 z0 i0 j0 k0 h1000 r1000 d360000 f100000"


def trunnion() -> Machine:
    """The default machine without a spindle: T1, radius 3 mm; axes X Y Z A C."""
    return machine("fig4a")


def read(text: str | bytes, on: Machine | None = None) -> Program:
    data = text.encode() if isinstance(text, str) else text
    return blocks.read(data, on or trunnion(), "part.ngc")


def refusal(text: str | bytes, on: Machine | None = None) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        read(text, on)
    return caught.value


RARE = (  # listed where they are there
    *("time_s", "stands", "thread", "probe", "hole", "changing", "outputs", "lifts"),
)


def shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return f"({' '.join(shown(part) for part in value)})"
    if isinstance(value, dict):
        return messages.text(value)
    return value.name if isinstance(value, (Act, Side)) else str(value)


def listing(program: Program) -> list[str]:
    """One line per block: place, kind, its values, then what of the modal state is not as at power-on."""
    power_on = Modal(1, 0, Side.RIGHT, 0.0, True, 0.0, 0.0, None, 0.0, 0)
    rows = []
    for block in program.blocks:
        own = [f for f in fields(block) if f.name not in ("place", "modal", "doubt")]
        own = [f for f in own if f.name not in RARE or getattr(block, f.name)]
        values = [f"{f.name}={shown(getattr(block, f.name))}" for f in own]
        modal = [(f.name, getattr(block.modal, f.name)) for f in fields(Modal)]
        changed = [f"{n}={shown(v)}" for n, v in modal if v != getattr(power_on, n)]
        place = f"{block.place.line}:{block.place.column}"
        rows.append(f"{place} {type(block).__name__} {' '.join(values)} | {' '.join(changed)}".rstrip())
    return rows


def only(program: Program) -> Block:
    (block,) = program.blocks
    return block


@pytest.mark.parametrize("path", GOOD, ids=lambda path: path.parent.name)
def test_a_good_program_reads_as_expected(path: Path) -> None:
    program = blocks.read(path.read_bytes(), trunnion(), "program.ngc")
    assert listing(program) == path.with_name("expected.txt").read_text().splitlines()


@pytest.mark.parametrize("path", REFUSED, ids=lambda path: path.parent.name)
def test_a_bad_program_is_refused_with_its_place_and_a_sentence(path: Path) -> None:
    place, *phrases = path.with_name("expected.txt").read_text().splitlines()
    error = refusal(path.read_bytes())
    assert str(error) == f"part.ngc:{place}: {error.sentence}"
    for phrase in phrases:
        assert phrase in error.sentence
    assert "\n" not in error.sentence


def test_the_papers_cone_has_the_papers_numbers() -> None:
    cone = only(read("n010 " + CONE))
    assert isinstance(cone, CutCone)
    assert (cone.start, cone.centre) == ((0.0, 15.0, 0.0), (0.0, 0.0, 0.0))
    assert (cone.height_mm, cone.upper_radius_mm, cone.sweep_rad) == (10.0, 10.0, 2.0 * math.pi)
    assert cone.feed_mm_s == pytest.approx(1000.0 / 60.0, rel=1e-15)


def test_the_second_g52_of_the_paper_uses_the_modal_feed() -> None:
    program = blocks.read((PROGRAMS / "good/paper_example_2/program.ngc").read_bytes(), trunnion(), "p")
    first, second = program.blocks
    assert isinstance(first, CutRuled) and isinstance(second, CutRuled)
    assert first.feed_mm_s == second.feed_mm_s == pytest.approx(100.0 / 60.0)
    assert first.upper[3] == second.upper[0] and first.lower[3] == second.lower[0]
    assert (second.place.line, second.place.column) == (9, 6)


@pytest.mark.parametrize(("blu", "point"), [(7, "0.07"), (-158, "-1.58"), (2810, "28.1"), (1, ".01")])
def test_blu_and_decimal_point_give_the_same_bits(blu: int, point: str) -> None:
    points = "\nx1 y2 z3" * 7
    counted = only(read(f"g52 x{blu} y0 z0 f100{points}"))
    written = only(read(f"g52 x{point} y0 z0 f1.{points}"))
    assert counted == written


def test_blu_holds_for_g51_and_g52_only() -> None:
    cone, line = read(CONE + "\ng1 x1500 f1200").blocks
    assert isinstance(cone, CutCone) and isinstance(line, JointLine)
    assert line.targets[0] == 1500.0
    assert line.feed_mm_s == 20.0


def test_inches_hold_for_words_with_a_point_and_blu_for_those_without() -> None:
    cone = only(read("g20 g51 x0 y1. z0 i0 j0 k0 h100 r0.5 d90000 f10."))
    assert isinstance(cone, CutCone)
    assert cone.start[1] == 25.4 and cone.height_mm == 1.0 and cone.upper_radius_mm == 12.7
    assert cone.feed_mm_s == pytest.approx(254.0 / 60.0)
    assert cone.sweep_rad == pytest.approx(math.pi / 2.0)


@pytest.mark.parametrize("words", ["c180", "x1 c180"])
def test_a_line_carries_its_feed_in_millimetres_and_in_degrees(words: str) -> None:
    line = only(read(f"g20 g1 {words} f360"))
    assert isinstance(line, JointLine)
    assert (line.feed_mm_s, line.feed_deg_s) == (pytest.approx(6.0 * 25.4), 6.0)
    assert line.targets[1:] == (None, None, None, pytest.approx(math.pi))


def test_iso_sense_turns_the_sign_of_table_rotaries() -> None:
    base = trunnion()
    flipped = replace(
        base, axes=tuple(replace(a, sense=Sense.ISO) if a.kind is Kind.TABLE else a for a in base.axes)
    )
    carried, iso = (only(read("g0 x3 a30", on)) for on in (base, flipped))
    assert isinstance(carried, JointLine) and isinstance(iso, JointLine)
    assert iso.targets[0] == carried.targets[0] == 3.0
    assert iso.targets[3] == -math.radians(30.0) == -carried.targets[3]  # type: ignore[operator]


def test_a_machine_position_is_absolute_also_under_g91() -> None:
    line = only(read("g91 g53 g0 z0"))
    assert isinstance(line, JointLine) and line.machine_frame and not line.relative


@pytest.mark.parametrize(
    ("plane", "centre", "axes", "numbers"),
    [
        ("g17", "i1 j2", (0, 1, 2), (1.0, 2.0)),
        ("g18", "i1 k2", (2, 0, 1), (2.0, 1.0)),  # Z then X, so that the normal is +Y
        ("g19", "j1 k2", (1, 2, 0), (1.0, 2.0)),
    ],
)
def test_a_plane_is_right_handed_about_its_normal(
    plane: str, centre: str, axes: tuple[int, int, int], numbers: tuple[float, float]
) -> None:
    arc = only(read(f"{plane} g3 {centre} f100"))
    assert isinstance(arc, JointArc)
    assert arc.plane == axes and arc.centre_mm == numbers and not arc.clockwise


def test_codes_of_one_line_run_in_the_order_of_the_standard() -> None:
    made = read("m30 g0 x1 g4 p0.5 m8 m3 s500 m6 t2").blocks
    assert [b.act if isinstance(b, Action) else type(b) for b in made] == [
        Act.TOOL,
        Act.SPINDLE,
        Act.COOLANT,
        Dwell,
        JointLine,
        Act.END,
    ]
    assert made[-2].modal.tool == 2 and made[-2].modal.spindle_rev_min == 500.0
    assert made[-1].modal.spindle_rev_min == 0.0 and made[-1].modal.coolant == 0


def test_a_tool_change_stops_the_spindle() -> None:
    assert read("s500 m4\nt2 m6").blocks[-1].modal.spindle_rev_min == 0.0


def test_nothing_cuts_with_the_spindle_off_where_there_is_one() -> None:
    milling = replace(trunnion(), spindle=Spindle(1000.0, "drive"))
    assert "spindle off" in refusal(CONE, milling).sentence
    assert "spindle off" in refusal("s500 m3\nm5\n" + CONE, milling).sentence
    assert "spindle off" in refusal("m3\n" + CONE, milling).sentence
    assert read("s500 m3\n" + CONE, milling).blocks[-1].modal.spindle_rev_min == 500.0
    assert "too fast" in refusal("s1001", milling).sentence


def test_a_tool_in_the_spindle_that_the_table_lacks_does_not_cut() -> None:
    assert "T1" in refusal(CONE, replace(trunnion(), tools=trunnion().tools[1:])).sentence


def test_g43_adds_the_length_of_the_tool_it_names() -> None:
    base = trunnion()
    tools = tuple(replace(tool, length_mm=10.0 * tool.number) for tool in base.tools)
    made = read("g43 g0 z1\ng43 h2 g0 z1\ng43 h0 g0 z1\ng43 g0 z1\ng49 g0 z1", replace(base, tools=tools))
    assert [block.modal.length_mm for block in made.blocks] == [10.0, 20.0, 0.0, 10.0, 0.0]


def test_block_delete_skips_lines_with_a_slash_only_when_it_is_on() -> None:
    text = b"g0 x1\n/ g0 x2\n/ not even readable\n"
    assert len(blocks.read(text, trunnion(), "p", block_delete=True).blocks) == 1
    assert refusal(text).line == 3


def test_g64_alone_gives_nothing_away() -> None:
    modal = only(read("g64 g0 x1")).modal
    assert not modal.exact and modal.blend_mm == 0.0 and modal.blend_deg == 0.0
    inches = only(read("g20 g64 p0.1 q2 g0 x1")).modal
    assert inches.blend_mm == pytest.approx(2.54) and inches.blend_deg == 2.0


def test_surfaces_meet_exactly_once_g61_is_written_and_until_g64() -> None:
    assert not only(read("g0 x1")).modal.exact_joints
    assert only(read("g61 g0 x1")).modal.exact_joints
    assert not only(read("g61\ng64 g0 x1")).modal.exact_joints


def test_line_ends_of_every_system_count_the_same() -> None:
    for end in ("\n", "\r\n", "\r"):
        assert refusal(f"g0 x1{end}{end}g0 q1{end}").line == 3


def test_text_after_the_end_is_not_looked_at() -> None:
    assert len(read("g0 x1\nm2\nthis is no program").blocks) == 2


def _soup(rng: random.Random) -> bytes:
    """Lines of likely and unlikely pieces."""
    pieces = [*"gxyzijkhrdfpqtsmnace", "g51 ", "g52 ", "g1", "g2", "f100", "x1.5", "#1=", "#1", "[", "]", "+"]
    pieces += [
        "sqrt[",
        "atan[",
        "/",
        "**",
        "%",
        "(",
        ")",
        ";",
        "\n",
        "\n",
        " ",
        "-",
        ".",
        "0",
        "9",
        "12",
        "\t",
    ]
    pieces += ["é", "\0", "\r", "m30", "m6", "1e9", "x0 y0 z0\n" * 7, CONE]
    return "".join(rng.choice(pieces) for _ in range(rng.randrange(1, 30))).encode()


def test_no_text_does_anything_but_read_or_be_refused() -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    on = trunnion()
    for turn in range(3000):
        data = _soup(rng) if turn % 3 else rng.randbytes(rng.randrange(40))
        try:
            blocks.read(data, on, "p")
        except ProgramError as error:
            assert error.line >= 1 and error.column >= 1 and error.sentence, data


def test_the_papers_program_with_any_one_line_lost_is_refused() -> None:
    text = (PROGRAMS / "good/paper_example_2/program.ngc").read_text().splitlines(keepends=True)
    for lost in range(len(text)):
        error = refusal("".join(text[:lost] + text[lost + 1 :]))
        assert "G52" in error.sentence


def test_an_offset_that_nobody_has_set_is_refused_and_one_that_is_set_to_zero_is_not() -> None:
    made = machine_file.load("trunnion")
    with pytest.raises(ProgramError) as refused:
        blocks.read(b"G21 G90\nG56 G0 X1.\n", made, "part.ngc")
    assert (refused.value.line, refused.value.column) == (2, 1)
    assert "G56 is not set" in refused.value.sentence and "use G54" in refused.value.sentence
    blocks.read(b"G21 G90\nG56 G0 X1.\n", setup_data.with_offset(made, "G56", [0.0, 0.0, 0.0]), "part.ngc")


def test_plain_lines_under_g95_have_the_feed_of_a_turn() -> None:
    text = b"G21 G90 S1000 M3\nG95 G1 X10 F0.1\nX20 F0.2\nX30\nG94 X40 F300\n"
    lines = [block for block in blocks.read(text, machine(), "p.ngc").blocks if isinstance(block, JointLine)]
    assert [60.0 * (line.feed_mm_s or 0.0) for line in lines] == pytest.approx([100.0, 200.0, 200.0, 300.0])
