"""The seam for dialects of other controls, by a small front end for lines as Heidenhain's."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from support.oracles import reference_interpreter

from controller.messages import message
from controller.program import blocks, foreign, refusals
from controller.program.foreign import Refuse
from controller.program.line import Line, Rows, Word
from controller.program.program import Action, JointArc, JointLine, ProgramError

CONTROL = "Heidenhain (conversational)"
PLATE = """\
0  BEGIN PGM PLATE MM
1  TOOL CALL 1 Z S5000
2  L X+0 Y+5 R0 FMAX M3
3  L Z-2 F500
4  CC X+10 Y+5
5  C X+20 Y+5 DR-
6  L X+30.5
7  END PGM PLATE MM
"""
OURS = "T1 M6\nS5000\nG0 X0 Y5 M3\nG1 Z-2 F500\nG90.1\nG2 X20 Y5 I10 J5\nG1 X30.5\n"
_NUMBER = re.compile(r"[ \t]*[0-9]+[ \t]+")
_WORD = re.compile(r"(TOOL CALL|FMAX|L(?=[ \t])|CC|C(?=[ \t])|DR|R0|[XYZFMS])[ \t]*([+-]?[0-9.]*)")


def front_end(rows: Rows, name: str, refuse: Refuse) -> Iterator[Line]:
    """Lines L, CC, C and TOOL CALL; the rest is refused where it stands."""
    centre: dict[str, Word] = {}
    for number, raw in rows:
        head = _NUMBER.match(raw)
        at = head.end() if head else 0
        if not raw[at:].strip() or raw[at:].startswith(("BEGIN PGM", "END PGM")):
            continue
        found = {}
        while raw[at:].strip():
            word = _WORD.match(raw, at)
            if word is None:
                refuse(ProgramError(name, number, at + 1, message("text.stray", found=raw[at])))
                break
            found[word[1]] = (word[2], word.start() + 1, word[0])
            at = word.end() + len(raw[word.end() :]) - len(raw[word.end() :].lstrip())
        else:
            if "CC" in found:
                centre = {i: _of(found, x, i) for x, i in (("X", "I"), ("Y", "J"))}
            else:
                yield Line(name, number, tuple(_words(found, centre)))


def _of(found: dict[str, tuple[str, int, str]], letter: str, instead: str = "") -> Word:
    value, column, text = found[letter]
    return Word(instead or letter, float(value), True, column, text.strip())


def _words(found: dict[str, tuple[str, int, str]], centre: dict[str, Word]) -> Iterator[Word]:
    def code(of: str, letter: str, value: float) -> Word:
        return Word(letter, value, True, found[of][1], found[of][2].strip())

    if "TOOL CALL" in found:
        yield _of(found, "TOOL CALL", "T")
        yield code("TOOL CALL", "M", 6.0)
    if "L" in found:
        yield code("L", "G", 0.0 if "FMAX" in found else 1.0)
    if "C" in found:
        yield code("C", "G", 2.0 if found["DR"][0] == "-" else 3.0)
        yield code("C", "G", 90.1)
        yield from centre.values()
    yield from (_of(found, letter) for letter in "XYZFMS" if found.get(letter, ("",))[0])


@pytest.fixture
def heidenhain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(foreign.FRONT_ENDS, CONTROL, front_end)


MACHINE = reference_interpreter.machine("rs274", without_point="unit")


@pytest.mark.usefixtures("heidenhain")
def test_a_front_end_makes_the_blocks_of_the_same_program_in_our_words() -> None:
    made, ours = (blocks.read(text.encode(), MACHINE, "plate.h").blocks for text in (PLATE, OURS))
    kinds = JointLine | JointArc

    def ways(of: tuple[object, ...]) -> list[tuple[object, ...]]:
        return [(b.targets, b.feed_mm_s, getattr(b, "centre_mm", None)) for b in of if isinstance(b, kinds)]

    assert ways(made) == ways(ours) and len(ways(made)) == 4
    acts = [[block.act for block in of if isinstance(block, Action)] for of in (made, ours)]
    assert sorted(acts[0], key=str) == sorted(acts[1], key=str)
    assert [block.place.line for block in made if isinstance(block, kinds)] == [3, 4, 6, 7]


@pytest.mark.usefixtures("heidenhain")
def test_what_the_front_end_cannot_read_and_what_nobody_can_do_are_refused_in_the_original_line() -> None:
    text = PLATE.replace("FMAX M3", "FMAX M3\nL X+5 QQ3").replace("S5000\n", "S99999999\n")
    found = refusals.of(text.encode(), MACHINE, "plate.h")
    assert [(one.line, one.column) for one in found] == [(2, 18), (4, 7)], [one.sentence for one in found]
    assert "S99999999" in found[0].sentence
    with pytest.raises(ProgramError, match=r"plate\.h:2:18"):
        blocks.read(text.encode(), MACHINE, "plate.h")


@pytest.mark.usefixtures("heidenhain")
def test_programs_of_this_control_and_of_those_without_a_front_end_are_read_as_before() -> None:
    assert len(blocks.read(OURS.encode(), MACHINE, "p").blocks) == 6
    (siemens,) = refusals.of(b"N10 G0 SUPA Z0 D0\nM30\n", MACHINE, "p")
    assert siemens.about == "Siemens"
