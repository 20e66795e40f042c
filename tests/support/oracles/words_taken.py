"""What each code takes of a line beside each modal motion, by LinuxCNC's interpreter and the builders' words.

Written from runs of ``rs274`` (LinuxCNC 2.9) and from the builders' manuals, never from the table that is
judged by it. A case is a code with the words that it needs and one letter more, behind a modal motion.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from support.oracles import reference_interpreter

LETTERS = "XYZACUVWIJKDEHLPQR"  # beside F S T, which every line may have, and B, which the machine has not
REFUSED, STANDS, MOVES = "refused", "stands", "moves"
OF_REFERENCE = "G21 G90 G94 G17 G40 G49 G54 G98 G97 G80 G91.1 G92.1 F100 S100 M3 T1"
BEGIN = OF_REFERENCE + " G69"  # which the reference does not know
RESET = {  # what a case of these leaves
    "G10": "G10 L2 P1 X0. Y0. Z0. A0. C0. R0.",
    "G52": "G52 X0. Y0. Z0. A0. C0.",
    "G92": "G92.1",
    "G51.1": "G50.1",
    "G16": "G15",
}
PLACE = "G0 X1. Y2. Z3. A0."


@dataclass(frozen=True, slots=True)
class Row:
    """A code: what it needs, the letters that it takes, and which modal motions take words beside it."""

    code: str
    needs: str
    own: str
    beside: str  # 0: G0 and G1, r: G0 alone, 2: G2 and G3, 8: cycles
    moves: bool
    before: str = ""  # a line without which it is refused

    @property
    def base(self) -> str:
        return f"{self.code} {self.needs}".strip()


@dataclass(frozen=True, slots=True)
class Case:
    """One line behind its set-up, and what comes of it."""

    row: Row
    motion: str
    letter: str
    expected: str

    @property
    def line(self) -> str:
        return f"{self.row.base} {self.letter}{'2.' if self.letter else ''}".strip()

    @property
    def before(self) -> list[str]:
        """The lines behind ``BEGIN`` that lead to it."""
        lines = (RESET.get(self.row.code), PLACE, self.row.before, MOTIONS[self.motion])
        return [line for line in lines if line]


# The modal motions, and the line that makes them so.
MOTIONS = {
    "G80": "G80",
    "G0": "G0 X1. Y2.",
    "G1": "G1 X1. Y2.",
    "G2": "G2 X1. Y2. I1.",
    "G3": "G3 X1. Y2. I1.",
    "G81": "G81 X1. Y2. Z1. R2.",
    "G82": "G82 X1. Y2. Z1. R2. P1.",
    "G83": "G83 X1. Y2. Z1. R2. Q1.",
}


_GOES_ON = {"0": ("G0", "G1"), "r": ("G0",), "2": ("G2", "G3"), "8": ("G81", "G82", "G83")}
_ARCS = {"G18": "IK", "G19": "JK"}  # with one of which a full circle is said; in the plane of the line


def _rows(text: str) -> dict[str, Row]:
    """By code and needs; of code, needs | letters | marks of modal motions, m if it moves | a line before."""
    made = {}
    for line in text.strip().splitlines():
        code, own, marks, before = (part.strip() for part in (line + "|").split("|")[:4])
        name, _, needs = code.partition(" ")
        made[code] = Row(name, needs, own, marks.replace("m", ""), "m" in marks, before)
    return made


def cases(row: Row, motion: str, cycle_letters: str = "XYZ") -> Iterator[Case]:
    """A code beside a modal motion: alone, and with each letter that it does not need."""
    needed = {word[0] for word in row.needs.split()}
    with_motion = {"0": "XYZAC", "r": "XYZAC", "2": _ARCS.get(row.code, "IJ"), "8": cycle_letters}
    for letter in ("", *LETTERS):
        if letter in needed:
            continue
        goes_on = any(motion in _GOES_ON[mark] and letter in with_motion[mark] for mark in row.beside)
        if letter == "" or letter in row.own:
            yield Case(row, motion, letter, MOVES if row.moves else STANDS)
        else:
            yield Case(row, motion, letter, MOVES if goes_on else REFUSED)


# Under rs274, from runs of its interpreter (2.9.0~pre1 of Debian 12): test_words_taken runs them again.
RS274 = _rows("""
G0 | XYZAC | m
G1 | XYZAC | m
G2 X3. Y2. I1. | ZACJP | m
G3 X3. Y2. I1. | ZACJP | m
G4 P1. |  | 028
G5 X3. Y2. I1. J1. P1. Q1. |  | m
G5.1 X3. Y2. I1. J1. |  | m
G10 L1 P1 Z1. | XYACIJQR |
G10 L2 P1 | XYZACQR |
G10 L10 P1 Z1. | XYACIJQR |
G10 L11 P1 Z1. | XYACIJQR |
G10 L20 P1 X1. | YZACQ |
G17 |  | 028
G18 |  | 028
G19 |  | 028
G20 |  | 028
G21 |  | 028
G28 | XYZAC | m
G28.1 |  | 028
G30 | XYZAC | m
G30.1 |  | 028
G33 Z1. K1. | XYACE | m
G33.1 Z1. K1. | XYACIE | m
G38.2 Z1. | XYAC | m | M5
G38.3 Z1. | XYAC | m | M5
G38.4 Z1. | XYAC | m | M5
G38.5 Z1. | XYAC | m | M5
G40 |  | 028
G41 | DL | 02
G41.1 D6. | R |
G42 | DL | 02
G42.1 D6. | R |
G43 | H | 028
G43.1 Z1. | XYAC |
G43.2 H1 |  | 2
G49 |  | 028
G52 Z1. | XYAC |
G53 G0 Z1. | XYAC | m
G54 |  | 028
G55 |  | 028
G56 |  | 028
G57 |  | 028
G58 |  | 028
G59 |  | 028
G59.1 |  | 028
G59.2 |  | 028
G59.3 |  | 028
G61 |  | 028
G61.1 |  | 028
G64 | PQ | 028
G73 X1. Z1. R2. Q1. | YL | m
G74 X1. Z1. R2. | YP | m | M4
G80 |  |
G81 X1. Z1. R2. | YL | m
G82 X1. Z1. R2. P1. | YL | m
G83 X1. Z1. R2. Q1. | YL | m
G84 X1. Z1. R2. | YLP | m
G85 X1. Z1. R2. | YL | m
G86 X1. Z1. R2. P1. | YL | m
G89 X1. Z1. R2. P1. | YL | m
G90 |  | 028
G90.1 |  | 08
G91 |  | 02
G91.1 |  | 028
G92 Z3. | XYAC |
G92.1 |  | 028
G92.2 |  | 028
G92.3 |  | 028
G93 |  | r
G94 |  | r
G95 |  | r
G97 |  | 028
G98 |  | 028
G99 |  | 028
M0 |  | 028
M1 |  | 028
M3 |  | 028
M4 |  | 028
M5 |  | 028
M6 |  | 028
M7 |  | 028
M8 |  | 028
M9 |  | 028
M19 R0 | PQ | 0
M48 |  | 028
M49 |  | 028
M50 | P | 028
M51 | P | 028
M52 P0 |  | 08
M53 | P | 028
M60 |  | 028
M61 Q1 |  | 028
M62 P0 |  | 08
M63 P0 |  | 08
M64 P0 |  | 08
M65 P0 |  | 08
M66 P0 L3 Q1. |  | 08
M67 E0 Q1. |  | 028
M68 E0 Q1. |  | 028
M70 |  | 028
M71 |  | 028
M72 |  | 028 | M70
M73 |  | 028
""")

# Under fanuc, from the builders' words: Fanuc B-64484EN (30i) for what a block of each G code has and which
# stand in a block of their own (G05, G05.1, G08, G13.1, G23, G25, G53.1, G54.4, G68.2), Haas'
# manual of mills for G103, G154, G187, G234, G254, G255 and G269 (G254 and G255 are modal, of group 23). D is
# taken of every line, as F S T are, and so is H: both stay for the next code that takes them.
FANUC = _rows("""
G0 | XYZAC | m
G1 | XYZAC | m
G2 X3. Y2. I1. | ZACJ | m
G3 X3. Y2. I1. | ZACJ | m
G4 P1. | |
G4 X1. | |
G4 U1. | |
G5 P10000 | |
G5.1 Q1 | XYZACR |
G5.3 P50 | |
G8 P1 | |
G9 | | 028
G10 L2 P1 | XYZAC |
G10 L20 P1 | XYZAC |
G10 L21 P1 | XYZAC |
G10 L10 P1 R1. | |
G10 L11 P1 R0. | |
G10 L12 P1 R1. | |
G10 L13 P1 R0. | |
G10.9 X0 | |
G11 | |
G13.1 | |
G12 I10. D1 | XYZKQL | m
G13 I10. D1 | XYZKQL | m
G15 | | 028
G16 | | 028
G17 | | 028
G18 | | 028
G19 | | 028
G20 | | 028
G21 | | 028
G23 | |
G25 | |
G28 | XYZACUVW | m
G28.1 | |
G30 | XYZACUVWP | m
G30.1 | |
G31 Z1. | XYACPR | m | M5
G40 | | 028
G41 D1 | | 02
G42 D1 | | 02
G43 | H | 028
G44 | H | 028
G49 | | 028
G43.4 H1 | | 0
G43.5 H1 | | 0
G234 H1 | | 0
G50 | |
G50.1 X0. | YZ |
G51.1 X0. | YZ |
G52 Z1. | XYAC |
G60 X1. | YZAC | m
G53 G0 Z1. | XYAC | m
G53.1 | P | m | G68.2 X0. Y0. Z0. I0. J0. K0.
G53.6 | PH | m | G68.2 X0. Y0. Z0. I0. J0. K0.
G54 | P | 028
G55 | | 028
G56 | | 028
G57 | | 028
G58 | | 028
G59 | | 028
G54.1 P1 | | 028
G154 P1 | | 028
G110 | | 028
G111 | | 028
G112 | | 028
G113 | | 028
G114 | | 028
G115 | | 028
G116 | | 028
G117 | | 028
G118 | | 028
G119 | | 028
G120 | | 028
G121 | | 028
G122 | | 028
G123 | | 028
G124 | | 028
G125 | | 028
G126 | | 028
G127 | | 028
G128 | | 028
G129 | | 028
G54.2 P0 | | 028
G54.4 P0 | |
G61 | | 028
G62 | | 028
G64 | | 028
G67 | | 028
G68 X0. Y0. R0. | |
G68.2 X0. Y0. Z0. I0. J0. K0. | |
G68.3 | R |
G69 | | 028
G70 | | 028
G71 | | 028
G73 X1. Z1. R2. Q1. | YACKL | m
G74 X1. Z1. R2. | YACKLPQ | m | M4
G76 X1. Z1. R2. Q0.1 | YACKLPIJ | m
G80 | | 028
G81 X1. Z1. R2. | YACKLP | m
G82 X1. Z1. R2. P1. | YACKL | m
G83 X1. Z1. R2. Q1. | YACKL | m
G84 X1. Z1. R2. | YACKLPQ | m
G85 X1. Z1. R2. | YACKL | m
G86 X1. Z1. R2. | YACKL | m
G87 X1. Z3. R1. Q0.1 | YACKLPIJ | m
G89 X1. Z1. R2. P1. | YACKL | m
G90 | | 028
G91 | | 028
G92 Z3. | XYAC |
G92.1 | |
G93 | | r
G94 | | 028
G95 | | r
G97 | | 028
G98 | | 028
G99 | | 028
G103 P1 | |
G187 P3 E0.01 | |
G254 | | 028
G255 | | 028
G269 | |
M10 | | 028
M11 | | 028
M12 | | 028
M13 | | 028
M29 S100 | | 028
M31 | | 028
M32 | | 028
M33 | | 028
M41 | | 028
M42 | | 028
M43 | | 028
M84 | | 028
M89 | | 028
M138 P500 E300 | | 028
M139 | | 028
M298 L3 | | 028
""")


_MOTION = re.compile(r"N\s*(\d+)\s*(?:STRAIGHT_(?:TRAVERSE|FEED|PROBE)|ARC_FEED|RIGID_TAP|NURBS_\w*FEED)\(")
TOOLS = "T1 P1 D0.125 Z0.4 ;\nT2 P2 D0.5 Z1 ;\n"
_OTHER = 99_999  # number of the lines that lead to a case


def reference(lines: Sequence[tuple[Sequence[str], str]], folder: Path) -> list[str]:
    """What comes of each line behind its others, all in one run of LinuxCNC's interpreter."""
    rows = []
    for number, (before, line) in enumerate(lines, start=1):
        rows += [*(f"N{_OTHER} {one}" for one in before), f"N{number} {line}"]
    text = "\n".join([*rows, "M2", ""])
    told = reference_interpreter.run(text, folder, "-n", "0", tools=TOOLS)  # on, behind what it refuses
    wrong = {int(number) for number in re.findall(r"^N(\d+) ", told.stderr, re.MULTILINE)}
    moved = {int(found.group(1)) for found in _MOTION.finditer(told.stdout)}
    assert _OTHER not in wrong, told.stderr[:300]
    return [REFUSED if n in wrong else MOVES if n in moved else STANDS for n in range(1, len(lines) + 1)]
