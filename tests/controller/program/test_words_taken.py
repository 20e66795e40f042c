"""Each word of a line is taken by exactly one code: the table beside what the controls that have it take."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import pytest
from support.machines import tapping
from support.oracles import reference_interpreter, words_taken
from support.oracles.words_taken import BEGIN, MOTIONS, MOVES, REFUSED, STANDS, Case, Row
from support.suite import seed

from controller.machine.model import AnalogueOut, Io, Machine, Orient, Sensor
from controller.program import blocks
from controller.program.code_rows import Fate
from controller.program.code_table import BY_DIALECT
from controller.program.program import JointArc, JointCurve, JointLine, ProgramError, TipLine

MOVING = (JointLine, JointArc, JointCurve, TipLine)
IO = Io(
    "can0",
    9,
    "",
    (("there", 0), ("feed_stop", 1)),
    (("air", 0),),
    digital_in=("there",),
    digital_out=("air",),
    analogue_out=(AnalogueOut("laser", 1, 0.0, 100.0, 0, 32767),),
    orient=Orient("orient", "oriented", 0.0, 5.0, "X+"),
)


@cache
def machine(dialect: str) -> Machine:
    """With all that codes of the table ask for."""
    on = reference_interpreter.machine(
        dialect, without_point="unit", io=IO, spindle=tapping.machine().spindle
    )
    return replace(
        on,
        setter=Sensor("there", 1.0, radius_mm=5.0),
        offsets=(on.offsets + on.offsets + on.offsets + on.offsets),
        unset=(),
    )


def outcomes(cases: Sequence[Case], dialect: str) -> list[str]:
    """What comes of the line of each case of one code.

    Behind a line that is to be refused, and names no motion or side, nothing is set up anew.
    """
    rows: list[str] = []
    at: dict[int, Case] = {}
    before: Case | None = None
    for case in cases:
        as_it_was = before is not None and _wanted(before, dialect) == REFUSED
        if not as_it_was or BY_DIALECT[dialect][case.row.code].group in ("motion", "side"):
            rows += [BEGIN, *case.before]
        rows.append(case.line)
        at[len(rows)], before = case, case
    wrong, moved = read(rows, dialect)
    assert wrong.keys() <= at.keys(), [key for line, key in wrong.items() if line not in at][:3]
    return [REFUSED if line in wrong else MOVES if line in moved else STANDS for line in at]


def read(rows: Sequence[str], dialect: str) -> tuple[dict[int, str], set[int]]:
    """By the number of a line: the key of why it is refused, and whether it moves."""
    refused: list[ProgramError] = []
    text = "\n".join(rows).encode()
    made = list(blocks.stream(text, machine(dialect), "p.ngc", refused=refused))
    moved = {block.place.line for block in made if isinstance(block, MOVING)}
    return {error.line: error.said["key"] for error in refused}, moved


@dataclass(frozen=True, slots=True)
class Reason:
    """Why cases come out otherwise than the reference has them: in the README of the programs, too."""

    codes: str  # or code_needs
    letters: str  # -: none
    motions: str
    outcome: str
    why: str

    def is_of(self, row: Row) -> bool:
        return not {row.code, row.base.replace(" ", "_")}.isdisjoint(self.codes.split())

    def meets(self, case: Case) -> bool:
        listed = (case.letter or "-") in self.letters and case.motion in self.motions.split()
        return listed and self.is_of(case.row)


_ALL, _CYCLES, _ARCS = " ".join(MOTIONS), "G81 G82 G83", "G2 G3"
_TWO = "the code and the modal motion both take P, Q or L: which of them has it is not clear"
_OTHERS = "LinuxCNC has it otherwise, by a remap that is in progress"
_BOTH = (
    Reason("G0 G1", "-", _ALL, STANDS, "without a word of an axis nothing moves"),
    Reason("G20 G70", "XYZAC", _CYCLES, REFUSED, "the cycle's depths were written in the other unit"),
    Reason("G40", "PQR", _ALL, STANDS, "they place the cutter on the paper's surfaces"),
    Reason("G41 G42", "IJ", _ARCS, REFUSED, "a lead-in that is a full circle leads nowhere"),
    Reason("M52 M62 M63 M64 M65 G54.1 G154 G54.2 M138", "XYZAC", "G82", REFUSED, _TWO),
    Reason("G54.1 G154 G54.2 M138", "IJ", _ARCS, REFUSED, _TWO),
    Reason("M66", "XYZAC", _CYCLES, REFUSED, _TWO),
    Reason("M61 M67 M68", "XYZAC", "G83", REFUSED, _TWO),
    Reason("G33 G33.1", "XYACE", _ALL, REFUSED, "along the axis of the spindle alone, by its first encoder"),
    Reason("G31 G38.2 G38.3 G38.4 G38.5", "AC", _ALL, REFUSED, "a probe is led straight"),
    Reason("G43.2", "IJ", _ARCS, REFUSED, "axis words are its own there, and its line has none for a motion"),
    Reason("G41.1 G42.1", "YZAC", "G0 G1", MOVES, "moves of none in the plane wait for the lead-in"),
    Reason("G41.1 G42.1", "R", _ALL, REFUSED, "the reference takes it, and does nothing with it"),
    Reason("G43.1", "AC", _ALL, REFUSED, "a tool has no length but along Z"),
    Reason("G43.5", "AC", "G0 G1", REFUSED, "the tool stands along I J K"),
    Reason("M19", "P", _ALL, REFUSED, "the drive of the spindle has one way round"),
    Reason("M50 M51 M53", "P", _ALL, REFUSED, "on and off are P1 and P0"),
)
REASONS = {
    "rs274": (
        *_BOTH,
        Reason("G41 G42", "PQR", _ALL, STANDS, "they place the cutter on the paper's surfaces"),
        Reason("G41 G42", "X", "G1", REFUSED, "the lead-in is shorter than the radius of T1, which is in"),
        Reason("G41 G42", "L", _ALL, REFUSED, "the reference takes it, and does nothing with it"),
        Reason("G4", "XYZ", "G82", REFUSED, _TWO),
        Reason("G4", "IJ", _ARCS, REFUSED, _TWO),
        Reason("G74 G84", "LQ", _ALL, MOVES, "repeats, and pecks of Fanuc's"),
        Reason("G10_L1_P1_Z1. G10_L10_P1_Z1. G10_L11_P1_Z1.", "XYACIJQ", _ALL, REFUSED, "tools are round"),
        Reason("G10_L2_P1 G10_L20_P1_X1.", "Q", _ALL, REFUSED, "the reference does nothing with it"),
        Reason("G67", "XYZACIJ", _ALL, REFUSED, "what another control has stands in a line of its own"),
        Reason("G53.6", "H", _ALL, REFUSED, _OTHERS),
        Reason("G68.2", "R", _ALL, STANDS, _OTHERS),
        Reason("G68.3", "XYZ", _ALL, STANDS, _OTHERS),
    ),
    "fanuc": (
        *_BOTH,
        Reason("G31", "R", _ALL, REFUSED, "R0 and R1 are signals"),
        Reason("G41 G42", "X", "G0 G1", REFUSED, "the lead-in is shorter than the radius of T1, which is in"),
        Reason("M298", "XYZAC", _CYCLES, REFUSED, _TWO),
        Reason("G91", "Z", _CYCLES, REFUSED, "a step up from R, where a hole goes down"),
        Reason("G12 G13", "KQL", _ALL, REFUSED, "K and Q go together, and L with G91"),
        Reason("G2 G3", "P", _ALL, MOVES, "turns of a helix, as LinuxCNC has them"),
        Reason("G86", "P", _ALL, MOVES, "a dwell at the bottom, as LinuxCNC has it"),
        Reason("G5.1", "P", _ALL, STANDS, "some posts write it"),
        Reason("G10_L2_P1 G10_L20_P1", "R", _ALL, STANDS, "the turn of the offset, as LinuxCNC has it"),
        Reason("G64", "PQ", _ALL, STANDS, "how far the path may be left, as LinuxCNC has it"),
    ),
}
NO_ROW = (  # the paper's own, calls, and what needs more lines than one
    *(
        "G51",
        "G52",
        "G6.2",
        "G5.2",
        "G5.3",
        "M2",
        "M30",
        "M97",
        "M98",
        "M198",
        "M99",
        "G65",
        "G66",
        "G53.3",
        "G68.4",
    ),
)


def _rows(dialect: str) -> list[Row]:
    """Of the dialect, and those that it has from the other one's controls."""
    own, other = (words_taken.RS274, words_taken.FANUC)[:: 1 if dialect == "rs274" else -1]
    without, known = {*NO_ROW, *(row.code for row in own.values())}, BY_DIALECT[dialect]
    more = (row for row in other.values() if row.code not in without and row.code in known)
    return [*own.values(), *(row for row in more if known[row.code].fate is not Fate.REFUSED)]


ROWS = {dialect: _rows(dialect) for dialect in BY_DIALECT}
CYCLE_LETTERS = {"rs274": "XYZ", "fanuc": "XYZAC"}  # of a cycle that is modal


def _reason(case: Case, dialect: str) -> Reason | None:
    found = [reason for reason in REASONS[dialect] if reason.meets(case) and reason.outcome != case.expected]
    return found[0] if found else None


def _wanted(case: Case, dialect: str) -> str:
    reason = _reason(case, dialect)
    return case.expected if reason is None else reason.outcome


def cases_of(row: Row, dialect: str, motion: str) -> list[Case]:
    """A code with each letter beside one modal motion; D stays with Fanuc's, whatever is beside it."""
    found = words_taken.cases(row, motion, CYCLE_LETTERS[dialect])
    return [case for case in found if dialect == "rs274" or case.letter not in "DH"]


FAST = (("rs274", "G1"), ("fanuc", "G82"))
WALKS = [
    pytest.param(dialect, motion, marks=() if (dialect, motion) in FAST else pytest.mark.slow)
    for dialect in ROWS
    for motion in MOTIONS
    if dialect == "rs274" or motion != "G80"  # behind which Fanuc's have the motion before
]


@pytest.mark.parametrize(("dialect", "motion"), WALKS)
def test_a_word_is_taken_where_the_controls_that_have_the_code_take_it_and_else_refused(
    dialect: str, motion: str
) -> None:
    wrong, count = [], 0
    for row in ROWS[dialect]:
        cases = cases_of(row, dialect, motion)
        count += len(cases)
        for case, found in zip(cases, outcomes(cases, dialect), strict=True):
            if found != (wanted := _wanted(case, dialect)):
                wrong.append((case.motion, case.line, found, "for", wanted))
    assert not wrong, wrong[:20]
    assert count > 1500


def test_every_code_that_does_something_is_walked() -> None:
    for dialect, rows in ROWS.items():
        walked = {row.code for row in rows}
        known = [row for row in BY_DIALECT[dialect].values() if row.fate is not Fate.REFUSED]
        assert [row.name for row in known if row.name not in walked and row.name not in NO_ROW] == []


def test_every_reason_is_one() -> None:
    for reason in {reason for reasons in REASONS.values() for reason in reasons}:
        cases = [
            (dialect, case)
            for dialect, rows in ROWS.items()
            for row in rows
            if reason.is_of(row) and reason in REASONS[dialect]
            for motion in reason.motions.split()
            for case in cases_of(row, dialect, motion)
        ]
        assert any(_reason(case, dialect) is reason for dialect, case in cases), reason


# ---- beside the interpreter itself

BESIDE = pytest.mark.skipif(
    reference_interpreter.program() is None, reason="rs274 (linuxcnc-uspace) is not installed"
)


@BESIDE
@pytest.mark.slow
def test_the_list_is_what_the_reference_interpreter_does(tmp_path: Path) -> None:
    for row in words_taken.RS274.values():  # each in a run of its own: tools stay as a case has set them
        cases = [case for motion in MOTIONS for case in words_taken.cases(row, motion)]
        lines = [([words_taken.OF_REFERENCE, *case.before], case.line) for case in cases]
        told = words_taken.reference(lines, tmp_path)
        wrong = [(c.before[-1], c.line, one) for c, one in zip(cases, told, strict=True) if one != c.expected]
        assert not wrong, wrong[:20]


MORE_MOTIONS = (
    *(
        "G84 X1. Y2. Z1. R2.",
        "G89 X1. Y2. Z1. R2. P1.",
        "G73 X1. Y2. Z1. R2. Q1.",
        "G33 Z1. K1.",
        "G38.3 Z1.",
    ),
    *("G5.1 X3. Y2. I1. J1.", "G91 G1 X1.", "G18 G0 X1.", "G20 G0 X0.1", "G55 G1 X1.", "G43 H1 G0 X1."),
)
NOT_HERE = {"M2", "M30", "M70", "M72", "M73"}  # they end it, or change what is before them
# Why a line that the interpreter takes is refused, by the key of its sentence ...
WHY_REFUSED = {
    "word.two_owners": "two codes take one word, and which of them has it is not clear",
    "word.no_owner_here": "a word that does nothing there, or that a tool of this machine has no room for",
    "word.two_take_axes": "a length on the line of a motion: where that goes is not clear",
    "word.not_a_count": "half an output is none",
    "word.negative": "nor is one below the first",
    "word.no_motion": "probing, threads and curves are for their line: the interpreter goes on with them",
    "word.exponent": "E beside M66 waits for an analogue input, of which there are none",
    "code.two_of_a_group": "the interpreter does both, in an order of its own",
    "code.not_done": "lathes",
    "feed.not_positive": "F0 is no feed, also where nothing moves",
    "override.adaptive": "the machine has no load of the spindle to lead the feed by",
    "override.on_or_off": "on and off are P1 and P0",
    "output.unknown": "the machine has no output of that number",
    "output.which_analogue": "likewise",
    "output.range": "the output cannot give that",
    "output.no_level": "no such way to wait",
    "output.no_time": "a wait has an end",
    "probe.turns": "a probe is led straight",
    "probe.inverse": "how far it goes is not known before",
    "probe.no_way": "rotaries alone lead no probe",
    "thread.beside_others": "a thread goes along the axis of the spindle",
    "thread.no_height": "likewise",
    "thread.nowhere": "the tool stands at its end",
    "thread.no_pitch": "K says it",
    "thread.no_speed": "the pitch is F over S",
    "thread.pitch": "no such pitch",
    "thread.faster": "I is no factor",
    "tool.no_length": "the interpreter takes the length 0 where none is written",
    "tool.unknown": "the machine has no such tool",
    "tool.unknown_here": "likewise",
    "tool.no_radius": "a cutter has one",
    "beside.changed": "the tool must not change under G41 and G42",
    "beside.edge": "L is an edge of a lathe's tool",
    "beside.short_lead_in": "the tool in the spindle is larger here",
    "beside.arc_first": "likewise",
    "beside.no_tool": "the machine has no such tool",
    "cycle.other_unit": "a depth that was written in mm is none in inches",
    "feed.none": "a curve needs one, too, once G95 has ended that of G94",
    "cycle.upside_down": "R and the bottom come from two units, or from two modes",
    "surface.not_ruled": "G52 with F is the paper's surface, whose points stand on lines after it",
    "spindle.angle": "the drive brings the spindle to one angle",
    "spindle.direction": "and by one way",
    "spindle.no_time": "a wait has an end",
    "spindle.too_fast": "the spindle does not turn so fast",
}
# ... and why one moves that it refuses.
WHY_MOVES = {
    r"G4[012](?![.0-9]).* [PQR]": "words for the paper's surfaces",
    r"G4[12]": "the lead-in is the first move in the plane; what comes before it is done as it stands",
    r"G53 ": "under G91 a position, too",
    r"G[78]4.* [LQ]": "repeats, and pecks as Fanuc has them",
    r"M[345]\b.* M7[0-3]|M7[0-3].* M[345]\b": "the state is kept whatever the spindle does",
    r"G33 ": "the spindle may be turned by hand: the axis waits for it",
}


def any_line(rng: random.Random) -> str:
    """Codes, with what they need or without, and words that they take or not."""
    words = [
        rng.choice(list(words_taken.RS274.values())) for _ in range(rng.choice((0, 1, 1, 1, 1, 1, 2, 2)))
    ]
    line = " ".join(row.base if rng.random() < 0.6 else row.code for row in words)
    letters = rng.sample("XYZACXYZACIJKDEHLPQRFSTUVW", rng.choice((0, 1, 1, 2, 2, 3, 4)) if words else 2)
    used = {word[0] for word in line.split()}
    more = [
        c + rng.choice(("0", "1", "2.", "-3.5", "0.5", "7")) for c in sorted(set(letters)) if c not in used
    ]
    rng.shuffle(more)
    return " ".join([line, *more]).strip()


@BESIDE
@pytest.mark.slow
@pytest.mark.parametrize("count", [3000])
def test_no_line_moves_that_the_reference_interpreter_refuses(count: int, tmp_path: Path) -> None:
    print(f"seed {seed.SEED}")
    rng = random.Random(seed.SEED)
    motions, lines = (*MOTIONS.values(), *MORE_MOTIONS), list[tuple[list[str], str]]()
    before = ["G40", "G21 G90 G80 G17 G91.1", words_taken.RESET["G10"], "G10 L1 P1 Z10 R3", "M5 G49 T1 M6"]
    while len(lines) < count:
        if (line := any_line(rng)) and not set(line.split()) & NOT_HERE:
            setup = [*before, words_taken.OF_REFERENCE, words_taken.PLACE, rng.choice(motions)]
            lines.append((setup, line))
    taken = 0
    for (setup, line), their in zip(lines, words_taken.reference(lines, tmp_path), strict=True):
        wrong, _ = read([*setup, line], "rs274")
        assert wrong.keys() <= {len(setup) + 1}, (setup, wrong)
        key = "".join(wrong.values())
        taken += their != REFUSED and not key
        if _agree(their, key, setup, line):
            continue
        (alone,) = words_taken.reference([(setup, line)], tmp_path)  # without what the lines before have left
        assert _agree(alone, key, setup, line), (setup[-1], line, alone, key)
    assert taken > count // 8


def _agree(their: str, key: str, setup: list[str], line: str) -> bool:
    """Whether we move nothing that is refused there, and refuse what is taken there for a reason."""
    if their != REFUSED:
        return not key or key in WHY_REFUSED
    if key or any(re.search(why, f"{setup[-1]} {line}") for why in WHY_MOVES):
        return True
    ends = [reference_interpreter.ours("\n".join(one), machine("rs274")) for one in (setup, [*setup, line])]
    return bool(ends[1].refused) or len(ends[0].moves) == len(ends[1].moves)
