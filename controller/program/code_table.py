"""Every code of the language in one table: what the reader knows, the README shows and the refusals quote.

A row says what a code is, who defines it and what comes of it here: done, noted (it needs no action on this
control; ``check`` tells what it would have done) or refused, with what to write instead. ``dialect`` is given
where RS-274/NGC and Fanuc-like controls mean different things by one name.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from controller.messages import Key
from controller.program.code_rows import (
    AXES,
    BROTHER,
    FANUC,
    HAAS,
    HURCO,
    LINUXCNC,
    MAZAK,
    NIST,
    PAPER,
    Code,
    alone,
    done,
    noted,
    only,
    refused,
)

# The rows of the table of codes for what is only noted, and what is refused with what to write instead.

NOT_DONE: tuple[Code, ...] = (
    *noted(
        FANUC,
        ("G5", "P", "ahead"),
        ("G5.1", AXES + "QRP", "ahead"),
        ("G8", "P", "ahead"),
        ("G9", "", "exact"),
        ("G11", "", "own_line"),
        ("G13.1", "", "never"),
        ("G62", "", "corners"),
        ("M41", "", "speed"),
        ("M42", "", "speed"),
        ("M43", "", "speed"),
        dialect="fanuc",
    ),
    *noted(
        FANUC,
        ("G23", "", "travel"),
        ("G25", "", "watched"),
        ("G50", "", "never"),
        ("M10", "", "closes"),
        ("M11", "", "opens"),
    ),
    *noted(FANUC, ("G15", "", "never"), ("G67", "", "never"), dialect="rs274"),
    *noted(HURCO, ("G5.3", "P", "path"), dialect="fanuc"),
    *noted(
        HAAS,
        ("G103", "P", "whole"),
        ("G187", "PE", "path"),
    ),
    *noted(
        HAAS,
        ("G269", "", "untilts"),
        ("M12", "", "closes"),
        ("M13", "", "opens"),
        ("M31", "", "no_output"),
        ("M32", "", "no_output"),
        ("M33", "", "no_output"),
        ("M84", "", "no_output"),
        ("M89", "", "no_output"),
        ("M138", "PE", "turns"),
        ("M139", "", "turns"),
        dialect="fanuc",
    ),
    *noted(BROTHER, ("M298", "L", "ahead"), dialect="fanuc"),
    *only("P0", ("G54.4", "P", FANUC, "never")),
    *only("X0", ("G10.9", "X", MAZAK, "positions")),
    *(replace(row, group="overrides") for row in noted(LINUXCNC, ("M51", "P", "kept"))),
    # --- what is refused, and what to write instead
    *refused(LINUXCNC, "G7 G8 G70 G71 G71.1 G71.2 G72 G72.1 G72.2 G76 G44 G87", dialect="rs274"),
    *refused(LINUXCNC, "G5.2", dialect="fanuc"),
    *refused(FANUC, "G53.3 G7 G12.1 G43.3 G45 G46 G47 G48 G63 G107", dialect="fanuc"),
    *refused(LINUXCNC, "G17.1 G18.1 G19.1 G88 G96"),
    *refused(FANUC, "G22 G26 G27 G29"),
    *refused(FANUC, "G16 G65 G66", dialect="rs274"),
    *refused(HAAS, "G150 G253 G268 M83 M88", dialect="fanuc"),
)


_CYCLE = AXES + "RLK"
_TOOL = "LPZR"  # of G10: a tool's length and radius
_OFFSET = AXES + "LPR"
_SET_BY_L = {  # what G10 takes beside each L
    "rs274": {
        **dict.fromkeys(("L1", "L10", "L11", "L121"), _TOOL),
        **dict.fromkeys(("L2", "L20", "L120"), _OFFSET),
        "L0": "L",
    },
    "fanuc": {
        **dict.fromkeys(("L10", "L11", "L12", "L13"), "LPR"),
        **dict.fromkeys(("L2", "L20", "L120"), _OFFSET),
        "L21": AXES + "LP",
        "L50": "L",
        "L121": _TOOL,
    },
}
_TURNED_IN = (("G17", "XYR"), ("G18", "ZXR"), ("G19", "YZR"))  # of G68

ROWS: tuple[Code, ...] = (
    *done(
        "motion",
        NIST,
        ("G0", AXES + "IJK", "rapid; I J K under G43.5"),
        ("G1", AXES + "IJK", "line at feed; I J K under G43.5"),
        ("G73", _CYCLE + "Q", "drilling, chip breaking by Q"),
        ("G74", _CYCLE + "PQ", "tapping, left-hand; rigid where the spindle tells its angle"),
        ("G80", "", "ends a canned cycle and the motion mode"),
        ("G82", _CYCLE + "P", "drilling, dwell P"),
        ("G83", _CYCLE + "Q", "drilling by Q with full retraction"),
        ("G84", _CYCLE + "PQ", "tapping, right-hand; rigid where the spindle tells its angle"),
        ("G85", _CYCLE, "boring, out at feed"),
        ("G86", _CYCLE + "P", "boring, spindle stopped, out at rapid"),
        ("G89", _CYCLE + "P", "boring, dwell P, out at feed"),
    ),
    *(
        row
        for dialect, corners in (("rs274", ""), ("fanuc", "rc"))  # ,R and ,C
        for row in done(
            "motion",
            NIST,
            ("G2", AXES + "IJKRP" + corners, "arc or helix, clockwise"),
            ("G3", AXES + "IJKRP" + corners, "arc or helix, counter-clockwise"),
            dialect=dialect,
        )
    ),
    *done("motion", NIST, ("G81", _CYCLE, "drilling"), dialect="rs274"),
    *done("motion", FANUC, ("G81", _CYCLE + "P", "drilling; P waits nowhere"), dialect="fanuc"),
    *done(
        "motion",
        FANUC,
        ("G76", _CYCLE + "QPIJ", "fine boring: out with the spindle at its angle, the tip Q off the wall"),
        ("G87", _CYCLE + "QPIJ", "back boring: down likewise, up at feed from R to Z"),
        dialect="fanuc",
    ),
    *done(
        "motion",
        PAPER,
        ("G51", "XYZIJKHRD", "cone: ruled surface about +Z"),
        ("G52", "XYZ", "ruled surface between two cubic Beziers; without F a shift (below)"),
    ),
    *done(
        "motion",
        LINUXCNC,
        ("G5", "XYIJPQ", "cubic curve in X and Y"),
        ("G5.1", "XYIJ", "quadratic curve in X and Y"),
        ("G5.2", "XYPL", "NURBS in X and Y (below)"),
        ("G5.3", "", "ends a NURBS"),
        dialect="rs274",
    ),
    *done(
        "motion",
        LINUXCNC,
        ("G33", "XYZK", "along a thread of pitch K, one way"),
        ("G33.1", "XYZKI", "rigid tapping at pitch K, there and back"),
        ("G38.2", AXES, "probes towards the end of the line; without a touch the program ends"),
        ("G38.3", AXES, "the same; without a touch it goes on (#5070 is 0)"),
        ("G38.4", AXES, "leads the probe off until it is free; else the program ends"),
        ("G38.5", AXES, "the same; else it goes on"),
    ),
    *done(
        "motion",
        HAAS,
        ("G12", "XYZIKQDL", "circular pocket, clockwise (below)"),
        ("G13", "XYZIKQDL", "circular pocket, counter-clockwise"),
        dialect="fanuc",
    ),
    *done(
        "motion",
        FANUC,
        ("G31", AXES + "PR", "skip: as G38.3; P1 to P4, R0 and R1 choose nothing"),
        dialect="fanuc",
    ),
    *done("motion", FANUC, ("G6.2", "PQ", "ruled surface between two NURBS curves")),
    *done(
        "one-line",
        NIST,
        (
            "G28",
            AXES + "UVW",
            "rapid to the reference point, by way of the axis words, or U V W as distances",
        ),
        ("G53", "", "this line's G0 or G1 in machine positions"),
        ("G92", AXES, "shifts all work offsets so that the position reads as said, for good"),
        ("G92.2", "", "suspends the shift of G92"),
        ("G92.3", "", "takes the shift of G92 up again"),
    ),
    *(
        replace(row, forms=tuple(_SET_BY_L[dialect].items()))
        for dialect, meaning in (
            ("rs274", "sets work offsets (L2, L20) and tools (L1, L10, L11), for good; L0 does nothing"),
            ("fanuc", "sets work offsets (L2, L20), vectors of G54.2 (L21) and tools (L10 to L13), for good"),
        )
        for row in done("one-line", NIST, ("G10", _OFFSET, meaning), dialect=dialect)
    ),
    *done("one-line", NIST, ("G30", AXES, "rapid to the second reference point, likewise"), dialect="rs274"),
    *done(
        "one-line",
        FANUC,
        ("G30", AXES + "UVWP", "rapid to the second reference point (P2), likewise"),
        dialect="fanuc",
    ),
    *done("one-line", NIST, ("G92.1", "", "cancels the shift of G92"), dialect="rs274"),
    *done("one-line", FANUC, ("G60", "", "this line as G0, whatever is modal"), dialect="fanuc"),
    *alone(done("one-line", FANUC, ("G92.1", "", "cancels the shift of G92"), dialect="fanuc")),
    *done("one-line", NIST, ("G4", "P", "dwell of P seconds"), dialect="rs274"),
    *done("one-line", FANUC, ("G4", "PXU", "dwell of P, X, U seconds; ms without a point"), dialect="fanuc"),
    *(
        replace(row, dialect=dialect, alone=dialect == "fanuc")  # there they go, with words of axes
        for row in done(
            "one-line",
            LINUXCNC,
            ("G28.1", "", "the position becomes the reference point, for good"),
            ("G30.1", "", "the position becomes the second reference point, for good"),
        )
        for dialect in ("rs274", "fanuc")
    ),
    *done("plane", NIST, ("G17", "", "plane XY"), ("G18", "", "plane ZX"), ("G19", "", "plane YZ")),
    *done("unit", NIST, ("G20", "", "inches"), ("G21", "", "millimetres")),
    *done("unit", FANUC, ("G70", "", "inches, as G20"), ("G71", "", "millimetres, as G21"), dialect="fanuc"),
    *done(
        "side",
        PAPER,
        ("G40", "", "ends G41 and G42; cutter on the right of surfaces"),
        ("G41", "", "cutter on the left: of lines and arcs in the plane with D, of surfaces"),
        ("G42", "", "cutter on the right: of lines and arcs in the plane with D, of surfaces"),
    ),
    *done(
        "side",
        LINUXCNC,
        ("G41.1", "DL", "cutter with the diameter D on the left of lines and arcs in the plane"),
        ("G42.1", "DL", "cutter with the diameter D on the right of lines and arcs in the plane"),
    ),
    *done(
        "length",
        NIST,
        ("G43", "H", "adds the tool's length to Z"),
    ),
    *done("length", NIST, ("G49", "", "no tool length, no tool-centre control"), dialect="rs274"),
    *done("length", FANUC, ("G49", "H", "no tool length, no tool-centre control; H0 only"), dialect="fanuc"),
    *done("length", LINUXCNC, ("G43.1", "XYZ", "adds the length Z to Z, X to X, Y to Y")),
    *alone(done("length", LINUXCNC, ("G43.2", "H", "adds the length of one more tool"))),
    *done("length", FANUC, ("G44", "H", "takes the tool's length off Z"), dialect="fanuc"),
    *done(
        "length",
        FANUC,
        ("G43.4", "H", "tool-centre control, rotary words"),
        ("G43.5", "H", "tool-centre control, tool vectors I J K"),
    ),
    *done("length", HAAS, ("G234", "H", "tool-centre control, as G43.4"), dialect="fanuc"),
    *done("offset", NIST, ("G54", "", "work offset 1"), dialect="rs274"),
    *done("offset", FANUC, ("G54", "P", "work offset 1; with P as G54.1"), dialect="fanuc"),
    *done("offset", NIST, *((f"G{54 + i}", "", f"work offset {i + 1}") for i in range(1, 6))),
    *done("offset", NIST, *((f"G59.{i}", "", f"work offset {6 + i}") for i in (1, 2, 3))),
    *done("offset", FANUC, ("G54.1", "P", "work offset P1 to P48 beyond the nine")),
    *done("offset", HAAS, ("G154", "P", "work offset, as G54.1"), dialect="fanuc"),
    *done(
        "offset",
        HAAS,
        *((f"G{110 + i}", "", f"work offset, as G154 P{i + 1}") for i in range(20)),
        dialect="fanuc",
    ),
    *done(
        "dynamic offset",
        HAAS,
        ("G254", "", "the origin of the work offset follows the part that the table has turned (below)"),
        ("G255", "", "it does not"),
    ),
    *done(
        "dynamic offset",
        FANUC,
        ("G54.2", "P", "adds the vector P1 to P8, which turns with the table (below); P0 ends it"),
        dialect="fanuc",
    ),
    *done(
        "mirror",
        FANUC,
        ("G51.1", "XYZ", "mirrors positions at these of the axes (below)"),
        ("G50.1", "XYZ", "does not, of these axes, or of all"),
        dialect="fanuc",
    ),
    *done(
        "polar",
        FANUC,
        ("G16", "", "the plane's first word is a radius, the second an angle (below)"),
        ("G15", "", "they are positions"),
        dialect="fanuc",
    ),
    *done("path", NIST, ("G61", "", "exact path"), ("G61.1", "", "exact path, stop at corners")),
    *done("path", NIST, ("G64", "PQ", "blends within P mm and Q degrees")),
    *done("distance", NIST, ("G90", "", "positions"), ("G91", "", "distances")),
    *done("centre", LINUXCNC, ("G90.1", "", "I J K of arcs are positions"), ("G91.1", "", "distances")),
    *done(
        "feed", NIST, ("G93", "", "inverse time"), ("G94", "", "feed a minute"), ("G95", "", "feed a turn")
    ),
    *done("speed", LINUXCNC, ("G97", "", "S is turns a minute")),
    *done(
        "return",
        NIST,
        ("G98", "", "cycles end at the height they began from"),
        ("G99", "", "cycles end at R"),
    ),
    *done(
        "rotation",
        FANUC,
        ("G68.2", "XYZIJKPQR", "tilted plane, defined as P says (above)"),
        ("G68.3", "XYZR", "tilted plane across the tool as it stands"),
        ("G68.4", "XYZIJKPQR", "tilted plane seen from the active one"),
        ("G69", "", "ends G68 and the tilted plane"),
    ),
    *(
        replace(row, forms=_TURNED_IN)
        for row in done("rotation", FANUC, ("G68", "XYZR", "turns the coordinates by R in the plane"))
    ),
    *alone(
        [
            *done(
                "one-line", FANUC, ("G53.1", "P", "turns the tool along the tilted plane's Z, X Y Z stand")
            ),
            *done(
                "one-line", FANUC, ("G53.6", "PH", "the same, the tip stands on the part"), dialect="fanuc"
            ),
            *done(
                "one-line",
                LINUXCNC,
                ("G53.3", "XYZP", "the same, and to X Y Z of the plane meanwhile"),
                ("G53.6", "P", "the same, the tip stands on the part"),
                dialect="rs274",
            ),
        ]
    ),
    *done(
        "stop",
        NIST,
        ("M0", "", "stop"),
        ("M1", "", "optional stop"),
        ("M2", "", "end"),
        ("M30", "", "end"),
        ("M60", "", "stop, as M0: there is no pallet to change"),
    ),
    *done(
        "spindle", NIST, ("M3", "", "spindle, clockwise"), ("M4", "", "counter-clockwise"), ("M5", "", "off")
    ),
    *done("spindle", LINUXCNC, ("M19", "RQP", "brings the spindle to its angle, within Q seconds")),
    *done(
        "rigid",
        FANUC,
        ("M29", "S", "rigid tapping: so is every tap where the spindle tells its angle"),
        dialect="fanuc",
    ),
    *done("tool change", NIST, ("M6", "", "puts T into the spindle")),
    *done("tool change", LINUXCNC, ("M61", "Q", "says that tool Q is in the spindle")),
    *done(
        "state",
        LINUXCNC,
        ("M70", "", "keeps the modal state"),
        ("M71", "", "forgets the kept state"),
        ("M72", "", "gives the kept state back"),
        ("M73", "", "keeps the state until the sub ends"),
    ),
    *done("call", FANUC, ("M98", "PL", "calls sub P, L times"), ("M99", "", "ends a sub"), dialect="rs274"),
    *done(
        "call",
        FANUC,
        ("M98", "PL", "calls sub P, or the file (NAME), L times"),
        ("M99", "P", "ends a sub; with P it goes on at that N"),
        ("M198", "PL", "calls sub P of a file, L times"),
        dialect="fanuc",
    ),
    *done("call", HAAS, ("M97", "PL", "calls the lines from N on, up to M99, L times"), dialect="fanuc"),
    *done(
        "call",
        FANUC,
        ("G65", "PL", "calls macro P, L times, with the other words as its parameters (above)"),
        ("G66", "PL", "the same behind each line that moves"),
        ("G67", "", "ends G66"),
        dialect="fanuc",
    ),
    *done(
        "output",
        LINUXCNC,
        ("M62", "P", "output P on, with the motion that comes next"),
        ("M63", "P", "output P off, with the motion that comes next"),
        ("M64", "P", "output P on, at rest"),
        ("M65", "P", "output P off, at rest"),
        ("M66", "PLQ", "waits at most Q seconds for input P: L1 rise, L2 fall, L3 on, L4 off"),
        ("M67", "EQ", "analogue output E to Q, with the motion that comes next"),
        ("M68", "EQ", "analogue output E to Q, at rest"),
    ),
    *done(
        "overrides",
        LINUXCNC,
        ("M48", "", "the operator's override of feeds counts"),
        ("M49", "", "it does not: feeds are as F says"),
        ("M50", "P", "it counts (P1) or not (P0)"),
        ("M52", "P", "the load of the spindle leads the feed (P1) or not (P0)"),
        ("M53", "P", "the input feed_stop stops motion (P1) or not (P0)"),
    ),
    *done("coolant", NIST, ("M7", "", "mist"), ("M8", "", "flood"), ("M9", "", "both off")),
    *NOT_DONE,
)


def of(dialect: str) -> dict[str, Code]:
    """The rows of a dialect by name."""
    return {row.name: row for row in ROWS if row.dialect in ("", dialect)}


def takers_of(letter: str, dialect: str) -> str:
    """The codes of a dialect that take a letter, for sentences."""
    sides = {"D": ("G41", "G42")}.get(letter, ("G40", "G41", "G42") if letter in "PQR" else ())
    axes = AXES if letter in "XYZABC" else letter
    rows = BY_DIALECT[dialect].values()
    found = [row.name for row in rows if row.name in sides or letter in row.letters or axes in row.letters]
    return " ".join(found) or Key("code.none")


BY_DIALECT = MappingProxyType({dialect: MappingProxyType(of(dialect)) for dialect in ("rs274", "fanuc")})
HOLD_AXES = MappingProxyType(
    {d: frozenset(name for name, row in rows.items() if row.holds_axes) for d, rows in BY_DIALECT.items()}
)
