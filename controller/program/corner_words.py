""",R and ,C of Fanuc's: a corner in the plane rounded by an arc, or cut off by a line (B-64484EN, optional
chamfering and corner R).

They stand beside a G1, G2 or G3 and are done between its end and what follows it, again one of these in the
same plane: the arc touches both, the chamfer begins and ends so far from the corner. As both ways are made
shorter, the lines of such corners are carried out together, up to the first without one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from controller.geometry.vectors import ROUNDING
from controller.machine.model import Machine
from controller.program.contour import circles, ways
from controller.program.contour.ways import Way
from controller.program.line import Line
from controller.program.motion_words import PLANES, to_place
from controller.program.position import Place3
from controller.program.program import Block, JointArc, JointLine, Modal, Place, ProgramError, Targets
from controller.program.words import Word

ROUND, CUT = "r", "c"  # letters of the words ,R and ,C
LETTERS = ROUND + CUT
MAX_LINES = 10_000  # one corner behind the other
STRAIGHT = 1e-9  # sine of the angle between two ways that have no corner

Motion = JointLine | JointArc


class Move(NamedTuple):
    """A line of the program that moves in the plane, and the corner at its end, if it has one."""

    line: Line
    block: Motion
    begin: Place3  # in the program's coordinates
    end: Place3
    corner: Word | None
    size_mm: float = 0.0


def corner_of(words: dict[str, Word]) -> Word | None:
    """The word of a corner, if there is one."""
    return words.get(ROUND) or words.get(CUT)


def moved(made: Sequence[Block]) -> Motion | None:
    """The one motion of a line that a corner may be of; None where it has none, or another one."""
    motions = [block for block in made if isinstance(block, JointLine | JointArc)]
    if len(motions) != 1 or motions[0] is not made[-1]:
        return None
    block = motions[0]
    odd = block.machine_frame or block.thread or block.probe
    return None if odd or block.feed_mm_s is None or block.time_s is not None else block


def joined(moves: Sequence[Move], machine: Machine) -> list[Motion]:
    """The blocks of moves whose corners are done; all but the last have one. Raises ProgramError."""
    found = [_way(move, machine) for move in moves]
    made: list[Motion] = []
    for move, after, way, following in zip(moves, moves[1:], found, found[1:], strict=False):
        _check(move, after)
        corner = _rounded(move, way, following) if _is_round(move) else _cut(move, way, following)
        way.end, following.start = corner.start, corner.end
        if _backwards(way) or _backwards(following):
            raise _refusal(move, "corner.no_room")
        made += [_block(move, way, machine), _joint(move, corner, machine)]
    return [*made, _block(moves[-1], found[-1], machine)]


def _is_round(move: Move) -> bool:
    return move.corner is not None and move.corner.letter == ROUND


def _check(move: Move, after: Move) -> None:
    """Refuses a corner of no size, or of ways that do not lie in one plane of one frame."""
    if move.size_mm < 0.0:
        raise _refusal(move, "corner.size")
    a, b = move.block.modal, after.block.modal
    one, two = ((m.plane, m.part, m.offset, m.length_mm, m.tilted) for m in (a, b))
    if one != two:
        raise _refusal(move, "corner.changes")


# ---- ways in the plane; their ends are cut back


class _Plain:
    """A way of the plane as it is left: its circle or line stays, its ends move."""

    def __init__(self, way: Way) -> None:
        self.way, self.start, self.end = way, way.start, way.end


def _way(move: Move, machine: Machine) -> _Plain:
    """Of a move; refused where it leaves the plane, or where nobody knows where it is."""
    first, second, normal = PLANES[move.block.modal.plane]
    places = [(place[first], place[second]) for place in (move.begin, move.end)]
    (x, y), (u, v) = places
    if x is None or y is None or u is None or v is None:
        raise _refusal(move, "corner.unknown")
    still = move.begin[normal] == move.end[normal]
    turns = any(move.block.targets[i] is not None for i in machine.rotary())
    if turns or not still:
        raise _refusal(move, "corner.leaves")
    start, end = complex(x, y), complex(u, v)
    if isinstance(move.block, JointLine):
        return _Plain(ways.line(start, end, 0.0))
    sense = -1.0 if move.block.clockwise else 1.0
    chord = end - start
    try:
        centre, sweep, _ = circles.meant(
            *(move.block.centre_mm, move.block.radius_mm, (chord.real, chord.imag), sense),
            *(move.block.turns, machine.arc_tolerance_mm),
        )
    except circles.NoCircleError:
        raise _refusal(move, "corner.unknown") from None
    return _Plain(ways.arc(start, end, start + complex(*centre), sense * sweep, 0.0))


def _refusal(move: Move, key: str) -> ProgramError:
    word = move.corner or move.line.words[0]
    return move.line.refusal(word, key, corner=word.text)


def _backwards(one: _Plain) -> bool:
    """Whether nothing is left of a way between two corners."""
    whole = ways.line(one.way.start, one.way.end, 0.0) if one.way.centre is None else one.way
    a, b = whole.ahead(one.start), whole.ahead(one.end)
    if one.end == one.way.end:
        b = whole.length
    return b - a < -ROUNDING or a < -ROUNDING or b > whole.length + ROUNDING


class _Corner(NamedTuple):
    start: complex
    end: complex
    centre: complex | None  # None: a line
    sense: float = 0.0


def _rounded(move: Move, before: _Plain, after: _Plain) -> _Corner:
    """The arc that touches both, nearest to the corner."""
    one, two, r = before.way, after.way, move.size_mm
    across = (one.out.conjugate() * two.into).imag
    if abs(across) < STRAIGHT:
        raise _refusal(move, "corner.straight")
    sense = math.copysign(1.0, across)
    beside = [_beside(way, sense * r) for way in (one, two)]
    centres = [] if None in beside else [*ways.meetings(beside[0], beside[1])]  # type: ignore[arg-type]
    best: _Corner | None = None
    for centre in centres:
        start, end = _touch(one, centre), _touch(two, centre)
        behind, ahead = one.length - one.ahead(start), two.ahead(end)
        sound = -ROUNDING <= behind <= one.length + ROUNDING and -ROUNDING <= ahead <= two.length + ROUNDING
        if sound and (best is None or abs(start - one.end) < abs(best.start - one.end)):
            best = _Corner(start, end, centre, sense)
    if best is None:
        raise _refusal(move, "corner.no_room")
    return best


def _beside(way: Way, off: float) -> Way | None:
    """The line or circle so far left of a way; None where an arc has none."""
    if way.centre is None:
        return ways.line(way.start, way.end, off)
    inside = off * math.copysign(1.0, way.sweep) >= abs(way.start - way.centre)
    return None if inside else ways.arc(way.start, way.end, way.centre, way.sweep, off)


def _touch(way: Way, centre: complex) -> complex:
    """Where a circle about ``centre`` touches a way."""
    if way.centre is None:
        return way.start + way.into * ((centre - way.start) * way.into.conjugate()).real
    return way.centre + abs(way.start - way.centre) * ways.unit(centre - way.centre)


def _cut(move: Move, before: _Plain, after: _Plain) -> _Corner:
    """The line from so far before the corner to so far behind it."""
    corner, far = before.way.end, move.size_mm
    start = _at(before.way, corner, far, before.way.length)
    end = _at(after.way, corner, far, 0.0)
    if start is None or end is None:
        raise _refusal(move, "corner.no_room")
    return _Corner(start, end, None)


def _at(way: Way, corner: complex, far: float, place: float) -> complex | None:
    """The point of a way so far from its corner, which is at ``place`` along it."""
    circle = ways.arc(corner + far, corner + far, corner, 2.0 * math.pi, 0.0)
    found = [p for p in ways.meetings(way, circle) if -ROUNDING <= way.ahead(p) <= way.length + ROUNDING]
    return min(found, key=lambda p: abs(way.ahead(p) - place), default=None)


# ---- blocks again


def _targets(move: Move, point: complex, machine: Machine) -> Targets:
    return to_place(machine, (point.real, point.imag), PLANES[move.block.modal.plane])


def _block(move: Move, one: _Plain, machine: Machine) -> Motion:
    """A move from and to what its corners leave of it."""
    targets = _targets(move, one.end, machine)
    if isinstance(move.block, JointLine):
        return replace(move.block, targets=targets, relative=False)
    assert one.way.centre is not None
    to_centre = one.way.centre - one.start
    centre = (to_centre.real, to_centre.imag)
    return replace(move.block, targets=targets, relative=False, centre_mm=centre, radius_mm=None)


def _joint(move: Move, corner: _Corner, machine: Machine) -> Motion:
    assert move.corner is not None
    place: Place = move.line.place(move.corner.column)
    modal: Modal = move.block.modal
    targets, feed = _targets(move, corner.end, machine), move.block.feed_mm_s
    if corner.centre is None or feed is None:
        return JointLine(place, modal, targets, False, False, feed, feed)
    to_centre = corner.centre - corner.start
    plane, centre = PLANES[modal.plane], (to_centre.real, to_centre.imag)
    return JointArc(place, modal, plane, corner.sense < 0.0, targets, False, centre, None, 1, feed)
