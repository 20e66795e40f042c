"""Programs and lines of other controls: what they are, and what to post or write instead.

Asked where something has been refused, so that a program that reads well is never taken for another's; but a
title of Siemens', which would be a comment here, tells enough: tools have their lengths without G43 there.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import islice
from types import MappingProxyType

from controller.messages import message
from controller.program.decoding import Text
from controller.program.program import Block, ProgramError

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


def program(lines: Iterable[str], name: str) -> ProgramError | None:
    """What to tell of a program where a line of it is another control's, or two may be; else None."""
    other: ProgramError | None = None
    perhaps: ProgramError | None = None
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


def _program_error(name: str, number: int, raw: str, control: str, at: int) -> ProgramError:
    why = message("foreign.program", line=_shown(raw), control=control)
    return ProgramError(name, number, at + 1, why, control.split()[0])


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
