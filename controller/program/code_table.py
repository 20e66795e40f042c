"""Every code of the language in one table: what the reader knows, the README shows and the refusals quote.

A row says what a code is, who defines it and what comes of it here: done, noted (it needs no action on this
control; ``check`` tells what it would have done) or refused, with what to write instead. ``dialect`` is given
where RS-274/NGC and Fanuc-like controls mean different things by one name.
"""

from __future__ import annotations

from types import MappingProxyType

from controller.messages import Key
from controller.program.code_rows import AXES, Code, done, noted, refused

# What needs no action: source, dialect where it is of one alone; name, letters, and why, as ``told`` of the
# catalogue has it.
_NOTED = """
Fanuc fanuc: G5 P ahead, G5.1 @QRP ahead, G8 P ahead, G9 exact, G11 own_line, G13.1 never, G62 corners
Fanuc fanuc: M41 speed, M42 speed, M43 speed
Fanuc: G23 travel, G25 watched, G50 never, M10 closes, M11 opens
Fanuc rs274: G15 never, G67 never
Hurco fanuc: G5.3 P path
Haas: G103 P whole, G187 PE path
Haas fanuc: G269 untilts, M12 closes, M13 opens, M31 no_output, M32 no_output, M33 no_output, M84 no_output
Haas fanuc: M89 no_output, M138 PE turns, M139 turns
Brother fanuc: M298 L ahead
Fanuc fanuc: G54.4 P never
Mazak fanuc: G10.9 X positions
LinuxCNC: M51 P kept
"""

# What is refused; the catalogue has what to write instead.
_REFUSED = """
LinuxCNC rs274: G7 G8 G70 G71 G71.1 G71.2 G72 G72.1 G72.2 G76 G44 G87
LinuxCNC fanuc: G5.2
Fanuc fanuc: G53.3 G7 G12.1 G43.3 G45 G46 G47 G48 G63 G107
LinuxCNC: G17.1 G18.1 G19.1 G88 G96
Fanuc: G22 G26 G27 G29
Fanuc rs274: G16 G65 G66
Haas fanuc: G150 G253 G268 M83 M88
"""

_TOOL = "LPZR"  # of G10: a tool's length and radius
_OFFSET = AXES + "LPR"
_FORMS = MappingProxyType(
    {
        ("G10", "rs274"): {  # what it takes beside each L
            **dict.fromkeys(("L1", "L10", "L11", "L121"), _TOOL),
            **dict.fromkeys(("L2", "L20", "L120"), _OFFSET),
            "L0": "L",
        },
        ("G10", "fanuc"): {
            **dict.fromkeys(("L10", "L11", "L12", "L13"), "LPR"),
            **dict.fromkeys(("L2", "L20", "L120"), _OFFSET),
            "L21": AXES + "LP",
            "L50": "L",
            "L121": _TOOL,
        },
        ("G68", ""): {"G17": "XYR", "G18": "ZXR", "G19": "YZR"},
    }
)

# What is done, by groups: name, source, dialect where it is of one alone, letters, and what it is.
_DONE = """
motion
    G0 NIST @IJK: rapid; I J K under G43.5
    G1 NIST @IJK: line at feed; I J K under G43.5
    G73 NIST @RLKQ: drilling, chip breaking by Q
    G74 NIST @RLKPQ: tapping, left-hand; rigid where the spindle tells its angle
    G80 NIST: ends a canned cycle and the motion mode
    G82 NIST @RLKP: drilling, dwell P
    G83 NIST @RLKQ: drilling by Q with full retraction
    G84 NIST @RLKPQ: tapping, right-hand; rigid where the spindle tells its angle
    G85 NIST @RLK: boring, out at feed
    G86 NIST @RLKP: boring, spindle stopped, out at rapid
    G89 NIST @RLKP: boring, dwell P, out at feed
    G2 NIST rs274 @IJKRP: arc or helix, clockwise
    G3 NIST rs274 @IJKRP: arc or helix, counter-clockwise
    G2 NIST fanuc @IJKRPrc: arc or helix, clockwise
    G3 NIST fanuc @IJKRPrc: arc or helix, counter-clockwise
    G81 NIST rs274 @RLK: drilling
    G81 Fanuc fanuc @RLKP: drilling; P waits nowhere
    G76 Fanuc fanuc @RLKQPIJ: fine boring: out with the spindle at its angle, the tip Q off the wall
    G87 Fanuc fanuc @RLKQPIJ: back boring: down likewise, up at feed from R to Z
    G51 paper XYZIJKHRD: cone: ruled surface about +Z
    G52 paper XYZ: ruled surface between two cubic Beziers; without F a shift (below)
    G5 LinuxCNC rs274 XYIJPQ: cubic curve in X and Y
    G5.1 LinuxCNC rs274 XYIJ: quadratic curve in X and Y
    G5.2 LinuxCNC rs274 XYPL: NURBS in X and Y (below)
    G5.3 LinuxCNC rs274: ends a NURBS
    G33 LinuxCNC XYZK: along a thread of pitch K, one way
    G33.1 LinuxCNC XYZKI: rigid tapping at pitch K, there and back
    G38.2 LinuxCNC @: probes towards the end of the line; without a touch the program ends
    G38.3 LinuxCNC @: the same; without a touch it goes on (#5070 is 0)
    G38.4 LinuxCNC @: leads the probe off until it is free; else the program ends
    G38.5 LinuxCNC @: the same; else it goes on
    G12 Haas fanuc XYZIKQDL: circular pocket, clockwise (below)
    G13 Haas fanuc XYZIKQDL: circular pocket, counter-clockwise
    G31 Fanuc fanuc @PR: skip: as G38.3; P1 to P4, R0 and R1 choose nothing
    G6.2 Fanuc PQ: ruled surface between two NURBS curves
one-line
    G28 NIST @UVW: rapid to the reference point, by way of the axis words, or U V W as distances
    G53 NIST: this line's G0 or G1 in machine positions
    G92 NIST @: shifts all work offsets so that the position reads as said, for good
    G92.2 NIST: suspends the shift of G92
    G92.3 NIST: takes the shift of G92 up again
    G10 NIST rs274 @LPR: sets work offsets (L2, L20) and tools (L1, L10, L11), for good; L0 does nothing
    G10 NIST fanuc @LPR: sets work offsets (L2, L20), vectors of G54.2 (L21) and tools (L10 to L13), for good
    G30 NIST rs274 @: rapid to the second reference point, likewise
    G30 Fanuc fanuc @UVWP: rapid to the second reference point (P2), likewise
    G92.1 NIST rs274: cancels the shift of G92
    G60 Fanuc fanuc: this line as G0, whatever is modal
    G92.1 Fanuc fanuc alone: cancels the shift of G92
    G4 NIST rs274 P: dwell of P seconds
    G4 Fanuc fanuc PXU: dwell of P, X, U seconds; ms without a point
    G28.1 LinuxCNC rs274: the position becomes the reference point, for good
    G28.1 LinuxCNC fanuc alone: the position becomes the reference point, for good
    G30.1 LinuxCNC rs274: the position becomes the second reference point, for good
    G30.1 LinuxCNC fanuc alone: the position becomes the second reference point, for good
plane
    G17 NIST: plane XY
    G18 NIST: plane ZX
    G19 NIST: plane YZ
unit
    G20 NIST: inches
    G21 NIST: millimetres
    G70 Fanuc fanuc: inches, as G20
    G71 Fanuc fanuc: millimetres, as G21
side
    G40 paper: ends G41 and G42; cutter on the right of surfaces
    G41 paper: cutter on the left: of lines and arcs in the plane with D, of surfaces
    G42 paper: cutter on the right: of lines and arcs in the plane with D, of surfaces
    G41.1 LinuxCNC DL: cutter with the diameter D on the left of lines and arcs in the plane
    G42.1 LinuxCNC DL: cutter with the diameter D on the right of lines and arcs in the plane
length
    G43 NIST H: adds the tool's length to Z
    G49 NIST rs274: no tool length, no tool-centre control
    G49 Fanuc fanuc H: no tool length, no tool-centre control; H0 only
    G43.1 LinuxCNC XYZ: adds the length Z to Z, X to X, Y to Y
    G43.2 LinuxCNC alone H: adds the length of one more tool
    G44 Fanuc fanuc H: takes the tool's length off Z
    G43.4 Fanuc H: tool-centre control, rotary words
    G43.5 Fanuc H: tool-centre control, tool vectors I J K
    G234 Haas fanuc H: tool-centre control, as G43.4
offset
    G54 NIST rs274: work offset 1
    G54 Fanuc fanuc P: work offset 1; with P as G54.1
    G55 NIST: work offset 2
    G56 NIST: work offset 3
    G57 NIST: work offset 4
    G58 NIST: work offset 5
    G59 NIST: work offset 6
    G59.1 NIST: work offset 7
    G59.2 NIST: work offset 8
    G59.3 NIST: work offset 9
    G54.1 Fanuc P: work offset P1 to P48 beyond the nine
    G154 Haas fanuc P: work offset, as G54.1
dynamic offset
    G254 Haas: the origin of the work offset follows the part that the table has turned (below)
    G255 Haas: it does not
    G54.2 Fanuc fanuc P: adds the vector P1 to P8, which turns with the table (below); P0 ends it
mirror
    G51.1 Fanuc fanuc XYZ: mirrors positions at these of the axes (below)
    G50.1 Fanuc fanuc XYZ: does not, of these axes, or of all
polar
    G16 Fanuc fanuc: the plane's first word is a radius, the second an angle (below)
    G15 Fanuc fanuc: they are positions
path
    G61 NIST: exact path
    G61.1 NIST: exact path, stop at corners
    G64 NIST PQ: blends within P mm and Q degrees
distance
    G90 NIST: positions
    G91 NIST: distances
centre
    G90.1 LinuxCNC: I J K of arcs are positions
    G91.1 LinuxCNC: distances
feed
    G93 NIST: inverse time
    G94 NIST: feed a minute
    G95 NIST: feed a turn
speed
    G97 LinuxCNC: S is turns a minute
return
    G98 NIST: cycles end at the height they began from
    G99 NIST: cycles end at R
rotation
    G68.2 Fanuc XYZIJKPQR: tilted plane, defined as P says (above)
    G68.3 Fanuc XYZR: tilted plane across the tool as it stands
    G68.4 Fanuc XYZIJKPQR: tilted plane seen from the active one
    G69 Fanuc: ends G68 and the tilted plane
    G68 Fanuc XYZR: turns the coordinates by R in the plane
one-line
    G53.1 Fanuc alone P: turns the tool along the tilted plane's Z, X Y Z stand
    G53.6 Fanuc fanuc alone PH: the same, the tip stands on the part
    G53.3 LinuxCNC rs274 alone XYZP: the same, and to X Y Z of the plane meanwhile
    G53.6 LinuxCNC rs274 alone P: the same, the tip stands on the part
stop
    M0 NIST: stop
    M1 NIST: optional stop
    M2 NIST: end
    M30 NIST: end
    M60 NIST: stop, as M0: there is no pallet to change
spindle
    M3 NIST: spindle, clockwise
    M4 NIST: counter-clockwise
    M5 NIST: off
    M19 LinuxCNC RQP: brings the spindle to its angle, within Q seconds
rigid
    M29 Fanuc fanuc S: rigid tapping: so is every tap where the spindle tells its angle
tool change
    M6 NIST: puts T into the spindle
    M61 LinuxCNC Q: says that tool Q is in the spindle
state
    M70 LinuxCNC: keeps the modal state
    M71 LinuxCNC: forgets the kept state
    M72 LinuxCNC: gives the kept state back
    M73 LinuxCNC: keeps the state until the sub ends
call
    M98 Fanuc rs274 PL: calls sub P, L times
    M99 Fanuc rs274: ends a sub
    M98 Fanuc fanuc PL: calls sub P, or the file (NAME), L times
    M99 Fanuc fanuc P: ends a sub; with P it goes on at that N
    M198 Fanuc fanuc PL: calls sub P of a file, L times
    M97 Haas fanuc PL: calls the lines from N on, up to M99, L times
    G65 Fanuc fanuc PL: calls macro P, L times, with the other words as its parameters (above)
    G66 Fanuc fanuc PL: the same behind each line that moves
    G67 Fanuc fanuc: ends G66
output
    M62 LinuxCNC P: output P on, with the motion that comes next
    M63 LinuxCNC P: output P off, with the motion that comes next
    M64 LinuxCNC P: output P on, at rest
    M65 LinuxCNC P: output P off, at rest
    M66 LinuxCNC PLQ: waits at most Q seconds for input P: L1 rise, L2 fall, L3 on, L4 off
    M67 LinuxCNC EQ: analogue output E to Q, with the motion that comes next
    M68 LinuxCNC EQ: analogue output E to Q, at rest
overrides
    M48 LinuxCNC: the operator's override of feeds counts
    M49 LinuxCNC: it does not: feeds are as F says
    M50 LinuxCNC P: it counts (P1) or not (P0)
    M52 LinuxCNC P: the load of the spindle leads the feed (P1) or not (P0)
    M53 LinuxCNC P: the input feed_stop stops motion (P1) or not (P0)
coolant
    M7 NIST: mist
    M8 NIST: flood
    M9 NIST: both off
"""

ROWS: tuple[Code, ...] = (
    *done(_DONE, _FORMS),
    *(
        Code(f"G{109 + k}", "offset", "", "Haas", f"work offset, as G154 P{k}", dialect="fanuc")
        for k in range(1, 21)
    ),
    *noted(_NOTED),
    *refused(_REFUSED),
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
