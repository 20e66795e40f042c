"""The short way of common lines: the same blocks as by the general way, and the same refusals."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.shipped_kinds import machine
from support.suite import seed

from controller.machine.model import Machine
from controller.program import blocks, words
from controller.program.line import COMMON, Line, Other, Rows
from controller.program.modal import State
from controller.program.plain import CommonLines, Functions
from controller.program.program import Block, ProgramError

BEFORE = re.split(
    r"\|",
    "g43.4|g43.5|g49|g93|g94 f100|g95 s100 m3|g94 f50|g20|g21|g91|g90|g17|g18|g19|g90.1|g91.1|g41|g41 d1|"
    "g42.1 d0.5|g40|g64 p0.01|g61|g81 z-1 r1|g80|g92 x1|g92.1|g68 r30|g69|g55|g54|g10 l2 p1 a10|"
    "g10 l2 p1 a0|m70|m72|g2|g0|t1 m6|m3 s100 g1 x1|#1=3|g68.2 x1 y0 z0 i10 j20 k0||%|n10|n10 (c)",
)
NUMBERS = ("1", "-2.5", "+3.", ".25", "0", "-0.0", "1e3", "1 2", "", "2000000000", "#1", "[1+1]", "-0.0001")
FUNCTIONS = re.split(r"\|", "m3|M4|m05|M7|M08|M9|S500|s500 m3|s1e3|m3 m8|n5 M8|m6|M30|s-1")
ENDS = re.split(r"\|", "||| (two words)|(n)| ; rest (| (a;b)| (msg, a)| (| m8| s300| p2| ")
IN_FORCE = ("G90", "g91 ", "G17 ", "g18", "G21 g90", "g20", "G90G90", "g17 G90 ", "g19", "G90 G91 ")


def common(rng: random.Random) -> str:
    """A line of G0 to G3 as posts write it, sometimes in another order."""
    code = rng.choice(("", "", "G0", "g1", "G01", "G2", "g03", "G4", "G 1"))
    ends = rng.sample("XYZACB", rng.choice((0, 1, 2, 2, 3, 4)))
    if code[-1:] in ("2", "3") or rng.random() < 0.1:
        ends += rng.choice((["R"], ["I", "J"], ["I"], ["J", "K"], ["I", "K"], ["I", "R"], ["I", "J", "K"]))
    ends += ["F"] if rng.random() < 0.3 else []
    if rng.random() < 0.8:
        ends.sort(key="XYZABCIJKRF".index)
    beside = rng.choice(IN_FORCE) if rng.random() < 0.2 else ""  # and often not in force
    gap, number = rng.choice(("", " ", "  ")), rng.choice((5, 5, 6, 6, 13))
    words = gap.join(rng.choice((letter, letter.lower())) + rng.choice(NUMBERS[:number]) for letter in ends)
    return f"{rng.choice(('', '', 'N10 ', 'n5', '/', ' '))}{beside}{code}{gap}{words}{rng.choice(ENDS)}"


def soup(rng: random.Random) -> bytes:
    """Lines such as CAM systems write, and some that they should not."""
    rows = []
    for _ in range(rng.randrange(2, 14)):
        kind = rng.random()
        rows.append(rng.choice(BEFORE if kind < 0.2 else FUNCTIONS) if kind < 0.35 else common(rng))
    return "\n".join([rng.choice(("#1=2 g1 x0 f100", "g1 x0 f100", "(c)")), *rows]).encode()


def sound(rng: random.Random) -> bytes:
    """Lines of which few are refused, so that many are read."""
    rows = ["g21 g90 g94 f100 s200"]
    for _ in range(rng.randrange(5, 30)):
        x, y, r = (f"{rng.uniform(-9, 9):.3f}" for _ in range(3))
        turned = rng.choice(("", f" A{y}", f" A{x} C{y}"))
        rows.append(
            rng.choice(
                (
                    f"G0 X{x} Y{y}",
                    f"N7 G1 X{x} F{rng.choice((100, 200, 300))}",
                    f"Y{y}{turned}",
                    f"G2 X{x} Y{y} R{rng.choice((20, -20.5))} (arc)",
                    f"G3 I{x} J{y} F250",
                    f"Z{r} ; on",
                    f"{rng.choice(IN_FORCE)}G1 X{x} Y{y}",
                    f"g90 {rng.choice(('g17', 'g18'))}g2 X{x} Z{y} R20.",
                    rng.choice(FUNCTIONS[:9]),
                    rng.choice(("g20", "g21", "g91", "g90", "g93 g1 x1 f2", "g94 f100", "m8", "m9", "")),
                )
            )
        )
    return "\n".join(rows).encode()


def outcome(data: bytes, on: Machine | None = None) -> list[Block | str]:
    made: list[Block | str] = []
    try:
        made.extend(blocks.stream(data, on or machine("fig4a"), "p"))
    except ProgramError as error:
        made.append(str(error))
    return made


def long_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CommonLines, "take", lambda self, rows, run: words._first(rows, run))
    monkeypatch.setattr(CommonLines, "read", lambda self, line: None)
    monkeypatch.setattr(Functions, "read", lambda self, line, state: None)
    monkeypatch.setattr(Functions, "done", lambda self, parts, state, found, number: None)
    monkeypatch.setattr(words, "COMMON", re.compile("(?!)"))


@pytest.mark.parametrize("make", [soup, sound])
@pytest.mark.parametrize("count", [200, pytest.param(3000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
def test_common_lines_read_exactly_as_by_the_general_way(
    make: Callable[[random.Random], bytes], count: int, dialect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    print(f"seed {seed.SEED}")
    rng = random.Random(seed.SEED)
    programs = [make(rng) for _ in range(count)]
    on = [
        replace(machine("fig4a"), dialect=dialect, without_point=rng.choice(("unit", ""))) for _ in programs
    ]
    quick = [outcome(data, one) for data, one in zip(programs, on, strict=True)]
    long_way(monkeypatch)
    for data, one, found in zip(programs, on, quick, strict=True):
        assert found == outcome(data, one), data.decode()


def taken(text: bytes, monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Of each line of words whether it goes a short way."""
    found: list[bool] = []
    take, read, known = CommonLines.take, CommonLines.read, Functions.read

    def shortest(self: CommonLines, rows: Rows, run: list[Block]) -> Other | None:
        other = take(self, rows, run)
        found.extend([True] * len(run))
        return other

    def counted(self: CommonLines, line: Line) -> Block | None:
        made = read(self, line)
        found.append(made is not None)
        return made

    def learnt(self: Functions, line: Line, state: State) -> tuple[list[Block], State] | None:
        made = known(self, line, state)
        found[-1] |= made is not None
        return made

    monkeypatch.setattr(CommonLines, "take", shortest)
    monkeypatch.setattr(CommonLines, "read", counted)
    monkeypatch.setattr(Functions, "read", learnt)
    list(blocks.stream(text, machine("fig4a"), "p"))
    return found


def test_lines_of_cam_systems_go_the_short_way(monkeypatch: pytest.MonkeyPatch) -> None:
    text = b"g43.4\ng1 x0 f100\nX1. Y2. Z3. A1. C2.\nN5 G01 X1.5\nx2f300\nG1F20X1Y2\ng93\nx1 f2.5\n"
    assert taken(text, monkeypatch) == [False, *[True] * 5, False, True]


def test_codes_in_force_keep_no_line_off_it(monkeypatch: pytest.MonkeyPatch) -> None:
    text = (
        b"g1 x0 f100\nG90 G1 X1.\ng17 G21 G90 g2 x2 r5\nG91 G1 X1.\nG91 G0 X1.\nG90 G90 G0 X1.\ng18 g1 X2.\n"
    )
    short = [True, True, True, False, True, False, False]
    with pytest.raises(ProgramError):
        taken(text, monkeypatch)
    assert taken(text.replace(b"G90 G90", b"g90"), monkeypatch) == short


def test_rapids_arcs_functions_and_comments_do_so_too(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = ["G0 X1 Y2 (to it)", "G2 X2 Y2 R5 F100", "N7 G3 X1 I1 J0 ; back", "M8", "M9", "G0 Z1", "", "(c)"]
    again = ["M8", "M9", "G1 X2 F100", "M8", "M9", "G0 Z1", "M8", "M9"]
    found = taken("\n".join([*lines, *again, *again]).encode(), monkeypatch)
    assert found[:3] == [True] * 3 and found[-8:] == [True] * 8, "functions from the second time on"


def test_a_very_long_number_is_looked_at_once() -> None:
    assert COMMON.fullmatch("X" + "1" * 100_000 + "!") is None
    assert COMMON.fullmatch("X1" * 50_000 + "!") is None


def test_blocks_before_a_refused_line_come_out_of_the_stream(tmp_path: Path) -> None:
    made = outcome(b"g1 x1 f60\nx2\nx3 x4\n")
    assert len(made) == 3 and "p:3:4" in str(made[-1])


def test_no_group_repeats_possessively() -> None:
    """Debian 12's Python 3.11.2 matches such groups wrongly (gh-106052); the newer one here may not."""
    root = Path(__file__).parents[3]
    for path in (*root.glob("controller/**/*.py"), *root.glob("drives/**/*.py")):
        assert not re.search(r"\)[?*+]\+", path.read_text()), path
