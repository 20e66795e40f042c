"""Programs and lines of other controls: what they are, and what to post or write instead.

Asked where something has been refused, so that a program that reads well is never taken for another's; but a
title of Siemens', which would be a comment here, tells enough: tools have their lengths without G43 there.

``USES`` has G and M codes that builders document and that this control does not have. A number says nothing
of a code's purpose, so nothing is advised by what a code looks like: what is in no row here is refused with
the codes of this control. The facts are those of the builders' documents, by way of lists that are public;
the manuals of Haas and Fanuc themselves were not at hand, so a row of theirs is no authority:

    Haas       lists of G and M codes of mills with its NGC control
    Fanuc      lists of G codes of machining centres (series 16 and 30i)
    Makino     Professional 5 M-code list, No. 0584D-0506
    LinuxCNC   G code reference 2.9 (M100 to M199), kinematics switched by M428 to M430 and M128 to M130
               (commit 135b0ce522)
    Heidenhain user's manuals of the TNC controls (M128, M129)
    Marlin     its G code pages, as programs of printers have them
    FluidNC    its notes on probing, 3.7.6: G38.6 to G38.9 are G38.2 to G38.5 by distances in mm
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import islice
from types import MappingProxyType
from typing import Any, NamedTuple

from controller.messages import Message, chain, message
from controller.program.code_rows import key_of
from controller.program.line import Line, Rows
from controller.program.program import Block, ProgramError
from controller.program.source_text import Text

MAX_LINES = 100_000  # that are looked at
SHOWN = 40  # characters of a line in a sentence


def _beginning(*forms: str) -> str:
    """Of a line, behind its number, which Heidenhain writes without an N."""
    return rf"^[ \t]*(?:N[0-9]+[ \t]*|[0-9]+[ \t]+)?(?P<it>{'|'.join(forms)})"


def _words(names: str) -> str:
    """Anywhere, but not in a name of ours such as #<supa>."""
    return rf"(?<![A-Z0-9<_#])(?:{'|'.join(names.split())})(?![A-Z0-9_>])"


_HEIDENHAIN = (
    _beginning(
        r"(?:BEGIN|END)[ \t]+PGM",
        r"BLK[ \t]+FORM",
        r"TOOL[ \t]+(?:CALL|DEF)",
        r"CYCL[ \t]+(?:CALL|DEF)",
        r"CALL[ \t]+(?:LBL|PGM)",
        r"LBL[ \t]+[0-9\"]",
        r"FN[ \t]*[0-9]+[ \t]*:",
        r"(?:PLANE|FUNCTION|APPR|DEP)[ \t]+[A-Z]",
        r"QS?[0-9]+[ \t]*=",
        r"(?:LN?|LP|LT|C|CC|CP|CR|CTP?)[ \t]+(?:I?[XYZABC]|I?P[AR]|R|DR|F)[+-]?[0-9.Q]",
        r"(?:RND[ \t]+R|CHF[ \t]+)[0-9]",
    ),
    _words("FMAX"),
)
_HEIDENHAIN_ISO = (_beginning(r"%[A-Z0-9_-]+[ \t]+G7[01]"), r"[0-9][ \t]*\*[ \t]*$")
_SIEMENS = (
    _beginning(r"%_N_", r";[ \t]*\$PATH", r"%(?:MPF|SPF)[ \t]*[0-9]"),
    _beginning(r"(?:MSG[ \t]*\(|(?:PROC|DEF[ \t]+(?:REAL|INT|BOOL|STRING))(?![A-Z_]))"),
    _words(
        "TRAORI TRAFOOF TRANSMIT TRACYL CUT3DC CUT2D ORIWKS ORIMKS ORIAXES ORIVECT ORIPATH ORISON COMPCAD "
        "COMPCURV COMPON COMPOF COMPSURF FFWON FFWOF UPATH SPATH FGROUP SUPA STOPRE CFTCP CFC CFIN ATRANS "
        "AROT AMIRROR TOFRAME TOROT MCALL GOTOF GOTOB EXTCALL EXTERN WORKPIECE NEWCONF WAITM DIAMOF DIAMON"
    ),
    r"(?<![A-Z0-9<_#])(?:CYCLE|POCKET|SLOT|HOLES|LONGHOLE)[0-9]*[ \t]*\(",
    r"(?<![A-Z0-9<_#])(?:CR|AR|RP|AP|TURN|ADIS|SPOS|LIMS|OFFN|CTOL|OTOL)[ \t]*=(?!=|[ \t]*V)",
    r"(?<![A-Z0-9<_#])[XYZABCIJKTD][ \t]*=[ \t]*(?:(?:IC|AC|DC|ACP|ACN)[ \t]*\(|\")",
    r"\$(?:P|A|M[ACN])[A-Z]*_",
)
# What others write, too, or a mistake may look like: two of these that differ are a sign.
_PERHAPS_SIEMENS = (
    _beginning(r"(?:TRANS|ROT|MIRROR|SCALE)(?![A-Z_])", r"RET[ \t]*$"),
    _words("G64[1-5] G500 G50[5-9] G5[1-9][0-9] G45[01] G29[01]"),
    r"(?<![A-Z0-9<_#])(?:R[0-9]+|[XYZABCIJKTD]|[ABC][2-6]|[MS][1-9]|[IJK]1)[ \t]*=(?!=|[ \t]*V)",
)
_SIEMENS_NAME = "Siemens (Sinumerik)"
_PERHAPS = "|".join(sign.replace("?P<it>", "?:") for sign in _PERHAPS_SIEMENS)
_CONTROLS = {
    name: "|".join(sign.replace("?P<it>", "?:") for sign in signs)
    for name, signs in (
        ("Heidenhain (conversational)", _HEIDENHAIN),
        ("Heidenhain (DIN/ISO)", _HEIDENHAIN_ISO),
        (_SIEMENS_NAME, _SIEMENS),
    )
}

# Okuma's programs of variables have X=XPOS, too, and are read but for their variables.
_OKUMA = _beginning(
    r"IF[ \t]*\[.*\][ \t]*N[A-Z]", r"GOTO[ \t]*N[A-Z]", r"CALL[ \t]+O", r"VC[0-9]+[ \t]*=", r"MODIN"
)

# Lines of controls whose other lines are read, and what to write instead.
_STATEMENTS = MappingProxyType(
    {
        _beginning(*forms): key
        for forms, key in (
            (
                (r"(?:IF|WHILE)[ \t]*\[", r"GOTO[ \t]*[N0-9\[#]", r"(?:DO|END)[ \t]*[0-9]"),
                "foreign.macro",
            ),
            (
                (r"(?:POPEN|DPRNT|BPRNT|PCLOS)",),
                "foreign.macro_print",
            ),
            ((r"\$[A-Z0-9_-]+\.?[A-Z]*[ \t]*%?[ \t]*$",), "foreign.okuma_head"),
            ((r"CALL[ \t]+O",), "foreign.okuma_call"),
            ((r"MOD(?:IN|OUT)",), "foreign.okuma_modal"),
            ((r"RTS(?![A-Z])",), "foreign.okuma_end"),
            (
                (r"V(?:C|S|ZOF|TOF|DIN|DOUT|LIM)[A-Z]*[ \t]*[\[0-9]",),
                "foreign.okuma_variable",
            ),
        )
    }
)
_TITLE = re.compile(rb"(?:%_N_\w+\s*)?;[ \t]*\$PATH", re.IGNORECASE)
_COMMENT = re.compile(r"\([^)]*\)?")


@cache
def _pattern(form: str) -> re.Pattern[str]:
    """Made where something was refused: that takes as long as many a program."""
    return re.compile(form, re.IGNORECASE)


# The seam for dialects of other controls: who reads a program that is known as one of ``_CONTROLS``.
#
# A front end gets numbers and texts of the lines from the top, the name of the file and ``refuse``. It gives
# lines in the codes of the machine's own dialect, each word with the column and the text that it has in the
# original, so that whatever refuses it later names what its writer sees. What it cannot read itself it hands
# to ``refuse`` and goes on. None ships.

Refuse = Callable[[ProgramError], None]  # notes it, or raises it
FrontEnd = Callable[[Rows, str, Refuse], Iterator[Line]]
FRONT_ENDS: dict[str, FrontEnd] = {}  # by the names of ``_CONTROLS``


def front_lines(text: Text, name: str, refused: list[ProgramError] | None) -> Iterator[Line] | None:
    """The lines of a text as the front end of its control reads it; None where there is none for it."""
    if not FRONT_ENDS or (other := program(text.lines(), name)) is None:
        return None
    front = FRONT_ENDS.get(other.control)
    if front is None:
        return None

    def refuse(error: ProgramError) -> None:
        if refused is None:
            raise error
        refused.append(error)

    return front(enumerate(text.lines(), start=1), name, refuse)


class OtherControl(ProgramError):
    """A program of another control."""

    control = ""  # of ``_CONTROLS``


def judged(
    read: Iterator[Sequence[Block]], text: Text, name: str, refused: list[ProgramError] | None
) -> Iterator[Sequence[Block]]:
    """The blocks of a text; where one is refused in a program of another control, that is the refusal."""
    other = None
    try:
        if _TITLE.match(text.body):
            other = program(text.lines(), name)
        if other is None:
            yield from read
    except ProgramError as error:
        other = program(text.lines(), name)
        if other is None:
            raise error from None
    if refused:
        other = other or program(text.lines(), name)
        if other is not None:
            refused.clear()
    if other is not None:
        raise other


def program(lines: Iterable[str], name: str) -> OtherControl | None:
    """What to tell of a program where a line of it is another control's, or two may be; else None."""
    other: OtherControl | None = None
    perhaps: OtherControl | None = None
    words = set[str]()
    for number, raw in enumerate(islice(lines, MAX_LINES), start=1):
        told = _without_comments(raw) if other is None else ""
        if told and (found := _control(told)) is not None:
            first = perhaps if found[0] == _SIEMENS_NAME else None  # of its program the first line that tells
            other = first or _program_error(name, number, raw, *found)
        elif told:
            for word in _pattern(_PERHAPS).finditer(told):
                perhaps = perhaps or _program_error(
                    name, number, raw, _SIEMENS_NAME, _column(told, word.start())
                )
                words.add("".join(word.group().split()).upper())
            other = perhaps if len(words) > 1 else None
        if _pattern(_OKUMA).search(raw):
            return None
    return other


def _program_error(name: str, number: int, raw: str, control: str, at: int) -> OtherControl:
    why = message("foreign.program", line=_shown(raw), control=control)
    error = OtherControl(name, number, at + 1, why, control.split()[0])
    error.control = control
    return error


def statement(raw: str, name: str, number: int) -> ProgramError | None:
    """What to tell of a line that a control has whose other lines are read here; else None."""
    for pattern, key in _STATEMENTS.items():
        if found := _pattern(pattern).search(raw):
            word = found["it"].rstrip(" \t[0123456789#").upper()
            return ProgramError(name, number, found.start("it") + 1, message(key, line=_shown(raw)), word)
    return None


def _without_comments(raw: str) -> str:
    """What of a line may be a sign, each character in its place; "" of one that block delete skips."""
    first = raw.lstrip()[:1]
    if first == "/" or (first == ";" and "$PATH" not in raw.upper()):
        return ""
    told = _COMMENT.sub(lambda found: "(".ljust(len(found.group())), raw)  # as arguments they are a sign
    return told if first == ";" else told.partition(";")[0]


def _control(told: str) -> tuple[str, int] | None:
    """Control and offset of the first sign in a line."""
    for control, signs in _CONTROLS.items():
        if found := _pattern(signs).search(told):
            return control, _column(told, found.start())
    return None


def _column(told: str, start: int) -> int:
    """Offset of a sign, behind the blanks that it may begin with."""
    return len(told) - len(told.lstrip()) if start == 0 else start


def _shown(raw: str) -> str:
    bare = " ".join(raw.split())
    return bare if len(bare) <= SHOWN else f"{bare[:SHOWN]} ..."


class Use(NamedTuple):
    """What a builder has a code for: keys of ``foreign_use`` and ``foreign_advice``."""

    builder: str
    purpose: str
    advice: str


# By builder: codes, what it has them for, and what to write instead.
_TABLE = """
Haas: M16 tool_change m6, M17 M18 pallet output, M21 M22 M23 M24 M25 M26 M27 M28 relay_answered wait
Haas: M34 M35 coolant_nozzle output, M36 part_ready m0, M39 turret m6, M46 jump_pallet if
Haas: M54 M55 M56 M59 M69 relay output, M74 tool_air output, M75 M78 M79 skip_checked probing
Haas: M80 M81 door output, M82 M86 clamp_tool m6, M90 M91 fixture wait, M95 sleep m0, M96 jump_input wait
Haas: M104 M105 probe_arm output, M109 asks m0, M130 M131 shows msg, M158 M159 mist output
Haas: M160 M161 M162 M163 coolant_pulses output, G35 G36 G37 G136 measures probing, G77 back_bore g87
Haas: G100 mirror_end g50_1, G101 mirror g51_1, G141 G143 vectors g43_4, G156 broach moves
Haas: G174 G184 oblique_tap g68_2_tap, G266 rapid_share rapid
Fanuc: G2.2 G3.2 involute moves, G2.3 G3.3 exponential moves, G2.4 G3.4 arc_3d moves, G5.4 servo leave
Fanuc: G7.1 cylinder rotary, G10.6 retract leave, G12.4 G13.4 grooves moves, G31.8 G31.9 skip_many probing
Fanuc: G37 measures probing, G38 G39 corner_vector side, G43.8 G43.9 cutting_point g43_4
Fanuc: G50.2 G51.2 polygon lathe, G72.1 G72.2 copies sub, G81.1 chopping moves, G84.2 G84.3 rigid_tap m29
Fanuc: G160 G161 infeed moves
Makino: M15 mirror g51_1, M21 M22 M23 mirror g51_1, M26 coolant_through output, M27 power_off leave
LinuxCNC: M100-199 own_file own
LinuxCNC: M428 M429 M430 kinematics g43_4_switch, M128 M129 M130 kinematics g43_4_switch
Brother: G100 change_and_moves m6_moves
FluidNC: G38.6 G38.7 G38.8 G38.9 probes_in_mm g38_2
Heidenhain: M128 M129 tip_control g43_4
Marlin: M104 M105 M106 M107 M109 M117 M140 M190 M220 M221 printer leave
"""


def _uses() -> Mapping[str, tuple[Use, ...]]:
    """By code, as many as have it; of rows of one builder the last one counts."""
    found: dict[str, dict[str, Use]] = {}
    for line in _TABLE.strip().splitlines():
        builder, _, rows = line.partition(": ")
        for row in rows.split(", "):
            *codes, purpose, advice = row.split()
            for code in codes:
                first, _, last = code[1:].partition("-")
                for name in [code] if not last else [f"M{n}" for n in range(int(first), int(last) + 1)]:
                    found.setdefault(name, {})[builder] = Use(builder, purpose, advice)
    return MappingProxyType({code: tuple(uses.values()) for code, uses in found.items()})


USES = _uses()


def known_uses(code: str) -> dict[str, Any] | None:
    """What builders have a code for, and what to write instead, as values of a sentence; None if none has."""
    if code not in USES:
        return None
    uses, advice = list[Message | str](), list[Message | str]()
    for use in USES[code]:
        purpose = key_of("foreign_use", use.purpose, "")
        uses.append(message("foreign_use", builder=use.builder, purpose=purpose))
        one = message(key_of("foreign_advice", use.advice, ""), code=code)
        if one not in advice:
            advice.append(one)
    return {"uses": chain("foreign_use.or", uses), "instead": chain("foreign_advice.or", advice)}
