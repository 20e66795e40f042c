"""G10, G50.1, G51.1, G52, G68, G69 and G92: what they make of the origins and of the tool table.

Under rs274 G10 reads as LinuxCNC has it, and G52 and G92 write the same shift. Under fanuc G10 L2 takes
distances under G91, L20 means the offsets of G54.1, L10 to L13 take values, and G52 is a shift of its own.
L120 is of both, for probing cycles: as L20 of rs274, and R turns the offset by so many degrees from the
active one. One that nobody has set begins as the active one. L121 is L1 of rs274.

G51.1 mirrors positions at a place of each axis (B-64484EN, programmable mirror): a word X under G51.1 X10.
means 20 - X. It stands inside of G68, so the coordinates are mirrored, then turned, then shifted; arcs go
round the other way and G41 is G42, seen from the machine. G50.1 with words ends it for these axes, without
any for all. Tool-centre control, tilted planes and surfaces have no mirrored meaning.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

from controller.geometry.vectors import ZERO, Frame, Vector, X, Y, Z, add
from controller.machine.model import FIXTURES, MAX_WEAR_MM, OFFSETS, Machine, Offset, Shift, Tool
from controller.messages import Key
from controller.program.codes import SURFACES, ParsedLine
from controller.program.modal import State, tool_list
from controller.program.origins import NONE, Mirror, Origins, about, fixture_index, turned_about_z, within
from controller.program.position import Coordinate, Position
from controller.program.program import Tip
from controller.program.words import Word

NORMALS = MappingProxyType({"G17": Z, "G18": Y, "G19": X})
_FANUC_TOOL = MappingProxyType({10: "length_mm", 11: "wear_length_mm", 12: "radius_mm", 13: "wear_radius_mm"})


class Here(NamedTuple):
    """What a line finds: its words, the state before it, where the axes stand."""

    ask: ParsedLine
    state: State
    position: Position
    machine: Machine

    def known(self, word: Word, values: Sequence[Coordinate], what: str) -> tuple[float, ...]:
        """``values``, refused where one of them is not known."""
        if any(value is None for value in values):
            raise self.ask.refusal(word, "position.unknown", what=what)
        return tuple(value for value in values if value is not None)

    def own_frame(self, motion: str) -> str:
        """The code by which X Y Z, or a ``motion``, are of the part in a way of their own; "": none is."""
        modal = self.state.modal
        if modal.tip is not Tip.OFF:
            return modal.tip.code
        tilted = modal.tilted or self.state.origins.waiting is not None
        return "G68.2" if tilted else motion if motion in SURFACES else ""

    def word_of(self, *codes: str) -> Word:
        """The word of one of these codes, or the first of the line."""
        named = (word for code, word in self.ask.codes.values() if code in codes)
        return next(named, self.ask.line.words[0])

    def length_mm(self, letter: str) -> float | None:
        word = self.ask.words.get(letter)
        return None if word is None else word.value * self.state.mm_per_unit

    def rotary_rad(self) -> tuple[Coordinate, Coordinate]:
        """The words of the two rotaries (carried sense)."""
        given = ((self.ask.words.get(axis.name), axis) for axis in self.machine.axes)
        found = [None if word is None else word.value / axis.shown_per_unit for word, axis in given]
        return self.machine.pair(found, None)

    def lengths_mm(self) -> tuple[Coordinate, Coordinate, Coordinate]:
        return self.length_mm("X"), self.length_mm("Y"), self.length_mm("Z")


def applied(here: Here, code: str) -> State:
    """The state after G10, G92 to G92.3."""
    if code == "G10":
        return _g10(here)
    origins = here.state.origins
    if code == "G92":
        origins = _shifted_to(here)
    elif code == "G92.1":
        origins = replace(origins, shift=NONE, suspended=False)
    else:
        origins = replace(origins, suspended=code == "G92.2")
    return here.state.with_origins(origins, here.machine)


def _shifted_to(here: Here) -> Origins:
    """G92: the shift with which the position reads as the words say."""
    ask, state = here.ask, here.state
    word = ask.codes["one-line"][1]
    xyz, rotary = here.lengths_mm(), here.rotary_rad()
    if all(value is None for value in (*xyz, *rotary)):
        raise ask.refusal(word, "offset.g92_empty")
    if state.origins.turn is not None:
        raise ask.refusal(word, "offset.g92_turned")
    origins = replace(
        state.origins, shift=NONE if state.origins.suspended else state.origins.shift, suspended=False
    )
    plain = state.with_origins(origins, here.machine)
    now = _positions(here, here.position.in_frame(plain.modal), xyz, word)
    shift = origins.shift
    x, y, z = (s + (n - w if w is not None else 0.0) for s, n, w in zip(shift.xyz, now, xyz, strict=True))
    stand = _positions(here, here.position.rotaries, rotary, word)
    before = zip(shift.turned_rad, stand, rotary, plain.modal.turned_rad, strict=True)
    a, b = (s if w is None else s + n - t - w for s, n, w, t in before)
    return replace(origins, shift=Shift((x, y, z), (a, b)))


def _positions(
    here: Here, now: Sequence[Coordinate], words: Sequence[Coordinate], word: Word
) -> tuple[float, ...]:
    """Positions; those of axes without a word are not needed."""
    needed = [0.0 if w is None else n for n, w in zip(now, words, strict=True)]
    return here.known(word, needed, here.ask.code("one-line"))


# ---- G10 -------------------------------------------------------------------------


def _g10(here: Here) -> State:
    word = here.ask.codes["one-line"][1]
    kind, number = here.ask.words.get("L"), here.ask.words.get("P")
    fanuc = here.machine.dialect == "fanuc"
    if kind is not None and len(here.ask.words) == 1 and here.ask.whole(kind) == 0 and not fanuc:
        return here.state  # it reads the tool table anew: here what is set counts at once
    if kind is None or number is None:
        raise _not_set(here, word)
    what, n = here.ask.whole(kind), here.ask.whole(number)
    if what == 120 and 1 <= n <= 9:
        return _set_from_active(here, n - 1)
    if what == 2 or (what == 20 and not fanuc):
        return _set_offset(here, _index(here, n), what == 20)
    if what == 21 and fanuc and 1 <= n <= len(FIXTURES):
        return _set_offset(here, fixture_index(n), False)
    if what == 20 and 1 <= n <= 48:
        return _set_offset(here, OFFSETS.index(f"G54.1 P{n}"), False)
    if what == 121 or what in (_FANUC_TOOL if fanuc else (1, 10, 11)):
        return _set_tool(here, what, n)
    raise _not_set(here, kind)


def _not_set(here: Here, word: Word) -> Exception:
    key = "offset.sets_nothing_fanuc" if here.machine.dialect == "fanuc" else "offset.sets_nothing"
    return here.ask.refusal(word, key)


def _index(here: Here, number: int) -> int:
    """The work offset of P: 0 is the active one."""
    fanuc = here.machine.dialect == "fanuc"
    if number == 0 and not fanuc:
        return here.state.origins.index
    if not 1 <= number <= (6 if fanuc else 9):
        raise _not_set(here, here.ask.words["P"])
    return number - 1


def _set_offset(here: Here, index: int, to_here: bool) -> State:
    """L2: its values; L20 (``to_here``): such that the position reads as the words say."""
    origins = here.state.origins
    before = origins.offset(index, here.machine)
    r = here.ask.words.get("R")
    if r is not None and to_here:
        raise here.ask.refusal(r, "offset.r_of_l20")
    if to_here:
        _check_untilted(here, "G10 L20")
    xyz, rotary = here.lengths_mm(), here.rotary_rad()
    offset = _offset_here(here, index, xyz, rotary) if to_here else _offset_after(here, before, xyz, rotary)
    if r is not None:
        offset = replace(offset, frame=turned_about_z(offset.frame, r.value))
    return here.state.with_origins(origins.with_offset(index, offset), here.machine)


def _set_from_active(here: Here, index: int) -> State:
    """L120."""
    _check_untilted(here, "G10 L120")
    origins = here.state.origins
    active = origins.offset(origins.index, here.machine)
    if not origins.is_set(index, here.machine):
        origins = origins.with_offset(index, active)
        here = here._replace(state=here.state.with_origins(origins, here.machine))
    offset = _offset_here(here, index, here.lengths_mm(), here.rotary_rad())
    if (r := here.ask.words.get("R")) is not None:
        turned = within(active.frame, about(ZERO, Z, math.radians(r.value)))
        offset = replace(offset, frame=turned._replace(origin=offset.frame.origin))
    return here.state.with_origins(origins.with_offset(index, offset), here.machine)


def _check_untilted(here: Here, code: str) -> None:
    if here.state.origins.plane is not None:
        raise here.ask.refusal(here.ask.codes["one-line"][1], "offset.tilted", code=code)


def _offset_after(
    here: Here, before: Offset, xyz: Sequence[Coordinate], rotary: Sequence[Coordinate]
) -> Offset:
    distances = here.machine.dialect == "fanuc" and not here.state.absolute
    x, y, z = _laid(before.frame.origin, xyz, distances)
    a, b = _laid(before.turned_rad, rotary, distances)
    return Offset(before.frame._replace(origin=(x, y, z)), (a, b))


def _offset_here(here: Here, index: int, xyz: Sequence[Coordinate], rotary: Sequence[Coordinate]) -> Offset:
    """Moved along its own axes by what the position under it reads too much."""
    word = here.ask.codes["one-line"][1]
    under = replace(here.state.origins, index=index, turn=None)
    plain = here.state.with_origins(under, here.machine)
    now = _positions(here, here.position.in_frame(plain.modal), xyz, word)
    stand = _positions(here, here.position.rotaries, rotary, word)
    before = under.offset(index, here.machine)
    x, y, z = (0.0 if w is None else n - w for n, w in zip(now, xyz, strict=True))
    turned = zip(before.turned_rad, stand, rotary, plain.modal.turned_rad, strict=True)
    a, b = (old if w is None else old + n - t - w for old, n, w, t in turned)
    way, following = before.frame.turn((x, y, z)), under.following
    way = way if following is None else following.set_down(way)
    return Offset(before.frame._replace(origin=add(before.frame.origin, way)), (a, b))


def _set_tool(here: Here, what: int, number: int) -> State:
    tool, fanuc = here.state.table_tool(number, here.machine), here.machine.dialect == "fanuc"
    if tool is None:
        word = here.ask.words["P"]
        raise here.ask.refusal(word, "tool.unknown_here", tools=tool_list(here.machine))
    changed = (_fanuc_tool if what in _FANUC_TOOL and fanuc else _tool)(here, what, tool)
    here.ask.refuse_where(
        here.ask.words.get("R", here.ask.words["P"]),
        (changed.radius_mm <= 0.0, "tool.no_radius"),
        (not is_sound(changed), "tool.no_wear"),
        least=-MAX_WEAR_MM,
        most=MAX_WEAR_MM,
    )
    return here.state.with_table_tool(changed, here.machine)


def is_sound(tool: Tool) -> bool:
    """As the tool table has it."""
    least = min(MAX_WEAR_MM, 0.5 * tool.radius_mm)
    worn = -least <= tool.wear_radius_mm <= MAX_WEAR_MM and abs(tool.wear_length_mm) <= MAX_WEAR_MM
    return tool.radius_mm > 0.0 and worn


def _tool(here: Here, what: int, tool: Tool) -> Tool:
    """L1, L121: length Z and radius R; L10, L11: the length with which Z reads as said, now or in G59.3.

    What is measured anew is worn no more.
    """
    z, r = here.length_mm("Z"), here.length_mm("R")
    if z is not None and what in (10, 11):
        _check_untilted(here, f"G10 L{what}")
        modal = here.state.modal
        if what == 11:
            index = OFFSETS.index("G59.3")
            modal = here.state.with_origins(Origins(index, here.state.origins.written), here.machine).modal
        (height,) = here.known(here.ask.words["Z"], here.position.in_frame(modal)[2:], "G10")
        z = height + modal.length_mm - z
    if z is not None:
        tool = replace(tool, length_mm=z, wear_length_mm=0.0)
    return tool if r is None else with_radius(replace(tool, wear_radius_mm=0.0), r)


def with_radius(tool: Tool, radius_mm: float) -> Tool:
    """With another radius; a corner is never more than that."""
    return replace(tool, radius_mm=radius_mm, corner_mm=min(tool.corner_mm, radius_mm))


def _fanuc_tool(here: Here, what: int, tool: Tool) -> Tool:
    """L10 length, L11 wear of it, L12 radius, L13 wear of it: R is the value, under G91 what is added."""
    r = here.length_mm("R")
    if r is None:
        raise _not_set(here, here.ask.words["L"])
    name = _FANUC_TOOL[what]
    value = r + (getattr(tool, name) if not here.state.absolute else 0.0)
    if name == "radius_mm":
        return with_radius(tool, value)
    changed: dict[str, Any] = {name: value}
    return replace(tool, **changed)


# ---- G52, G68 ----------------------------------------------------------------------


def local_shift(here: Here) -> State:
    """G52 as a shift of coordinates."""
    origins = here.state.origins
    apart = here.machine.dialect == "fanuc"
    before = origins.local if apart else (NONE if origins.suspended else origins.shift)
    relative = apart and not here.state.absolute
    xyz = _laid(before.xyz, here.lengths_mm(), relative)
    turned = _laid(before.turned_rad, here.rotary_rad(), relative)
    shift = Shift((xyz[0], xyz[1], xyz[2]), (turned[0], turned[1]))
    changed = replace(origins, local=shift) if apart else replace(origins, shift=shift, suspended=False)
    return here.state.with_origins(changed, here.machine)


def _laid(before: Sequence[float], words: Sequence[Coordinate], relative: bool) -> list[float]:
    return [q if w is None else w + (q if relative else 0.0) for q, w in zip(before, words, strict=True)]


def rotation(here: Here) -> State:
    """G68: turned by R about the axis words of the plane, or about the position; G69 ends it and G68.2."""
    code, word = here.ask.codes["rotation"]
    origins = here.state.origins
    if code == "G69":
        cycle = here.state.cycle if origins.plane is None else None  # its heights were those of the plane
        return here.state._replace(begun=None, cycle=cycle).with_origins(origins.outside(), here.machine)
    r = here.ask.words.get("R")
    if r is None:
        raise here.ask.refusal(word, "plane.g68_no_angle")
    unturned = here.state.with_origins(replace(origins, turn=None, mirror=None), here.machine)
    normal = NORMALS[here.state.modal.plane]
    centre = _centre(here, unturned, normal, word)
    turn: Frame | None = about(centre, normal, math.radians(r.value))
    return here.state.with_origins(replace(origins, turn=turn), here.machine)


def _centre(here: Here, unturned: State, normal: Vector, word: Word) -> Vector:
    """The words of the plane's axes; one without a word is where the tool stands."""
    now = here.position.in_frame(unturned.modal)
    found = list(ZERO)
    for i, said in enumerate(here.lengths_mm()):
        if normal[i] == 1.0:
            continue
        (found[i],) = here.known(word, (now[i] if said is None else said,), Key("position.g68"))
    return found[0], found[1], found[2]


def mirrored(here: Here) -> State:
    """The state after G51.1 or G50.1. Raises ProgramError."""
    code, word = here.ask.codes["mirror"]
    said, mirror = here.lengths_mm(), here.state.origins.mirror or (None, None, None)
    if code == "G51.1":
        if all(value is None for value in said):
            raise here.ask.refusal(word, "mirror.nowhere")
        made = [old if value is None else value for old, value in zip(mirror, said, strict=True)]
    else:
        ends = all(value is None for value in said)
        made = [None if ends or value is not None else old for old, value in zip(mirror, said, strict=True)]
    found: Mirror | None = (made[0], made[1], made[2])
    if made == [None, None, None]:
        found = None
    return here.state.with_origins(replace(here.state.origins, mirror=found), here.machine)


def check_mirrored(here: Here, motion: str) -> None:
    """Refuses what has no mirrored meaning. Raises ProgramError."""
    once, other = here.ask.code("one-line"), here.own_frame(motion)
    if not other and (once == "G92" or here.ask.code("motion") == "G52"):
        other = once or "G52"
    elif not other and once == "G10" and here.ask.words["L"].value in (20.0, 120.0):
        by_values = here.machine.dialect == "fanuc" and here.ask.words["L"].value == 20.0  # of G54.1
        other = "" if by_values else "G10 L20"
    if other:
        raise here.ask.refusal(here.word_of(other, "G51.1"), "mirror.beside", other=other)
