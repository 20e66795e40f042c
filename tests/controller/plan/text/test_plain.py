"""The short way of plain G1 lines: the same blocks as by the general way, and the same refusals."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from support.machines.shipped_kinds import machine

from controller.plan.text import blocks
from controller.plan.text.line import PLAIN
from controller.plan.text.plain import PlainLines
from controller.plan.text.program import Block, ProgramError

BEFORE = (
    "g43.4",
    "g43.5",
    "g49",
    "g93",
    "g94 f100",
    "g20",
    "g21",
    "g91",
    "g90",
    "g41",
    "g41 d1",
    "g42.1 d0.5",
    "g40",
    "g64 p0.01",
    "",
)
NUMBERS = ("1", "-2.5", "+3.", ".25", "0", "1e3", "1 2", "", "2000000000", "#1", "[1+1]", "-0.0001")


def soup(rng: random.Random) -> bytes:
    """Lines such as CAM systems write, and some that they should not."""
    rows = []
    for _ in range(rng.randrange(2, 12)):
        if rng.random() < 0.2:
            rows.append(rng.choice(BEFORE))
            continue
        letters = rng.sample("XYZACIJKFBxyzacf", rng.randrange(1, 7))
        gap = rng.choice(("", " "))
        words = gap.join(letter + rng.choice(NUMBERS[: rng.choice((5, 5, 12))]) for letter in letters)
        rows.append(f"{rng.choice(('', '', 'N10 ', 'n5'))}{rng.choice(('', '', 'G1', 'g01 '))}{words}")
    return "\n".join(["#1=2 g1 x0 f100", *rows]).encode()


def outcome(data: bytes) -> list[Block | str]:
    made: list[Block | str] = []
    try:
        made.extend(blocks.stream(data, machine("fig4a", spindle=None), "p"))
    except ProgramError as error:
        made.append(str(error))
    return made


def test_plain_lines_read_exactly_as_by_the_general_way(monkeypatch: pytest.MonkeyPatch) -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    programs = [soup(rng) for _ in range(600)]
    quick = [outcome(data) for data in programs]
    monkeypatch.setattr(PlainLines, "read", lambda self, line, state: None)
    for data, found in zip(programs, quick, strict=True):
        assert found == outcome(data), data


def test_lines_of_cam_systems_go_the_short_way(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = []
    read = PlainLines.read

    def counted(self: PlainLines, line: object, state: object) -> object:
        found = read(self, line, state)  # type: ignore[arg-type]
        taken.append(found is not None)
        return found

    monkeypatch.setattr(PlainLines, "read", counted)
    text = b"g43.4\ng1 x0 f100\nX1. Y2. Z3. A1. C2.\nN5 G01 X1.5\nx2f300\nG1X1Y2F20\ng93\nx1 f2.5\n"
    list(blocks.stream(text, machine("fig4a", spindle=None), "p"))
    assert taken == [False, False, True, True, True, True, False, True]


def test_a_very_long_number_is_looked_at_once() -> None:
    assert PLAIN.fullmatch("X" + "1" * 100_000 + "!") is None
    assert PLAIN.fullmatch("X1" * 50_000 + "!") is None


def test_blocks_before_a_refused_line_come_out_of_the_stream(tmp_path: Path) -> None:
    made = outcome(b"g1 x1 f60\nx2\nx3 x4\n")
    assert len(made) == 3 and "p:3:4" in str(made[-1])
