"""Canned cycles G73, G74, G76 and G81 to G89 as the canonical moves they stand for (RS-274/NGC 3.5.16).

    ---- level   where the series began; G98 ends here
    ---- R       clearance; rapids go down to here, G99 ends here
    ---- Z       bottom

A series is all cycles between two other motions (or G80), of whichever code. From hole to hole a rapid goes
at the height where the last one was left. Each line drills once, or L times (K under fanuc). Its words stay
for the next line of the same cycle, but L. Z of G17 is the axis across the plane; under G18 and G19 Y and X
take its place. Under G91 X and Y are steps, R counts from the level and Z from R.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

from controller.geometry.vectors import ROUNDING, Vector, angle_between
from controller.messages import Key, chain, message
from controller.program import cycle_moves, motion_words, output_words
from controller.program.codes import CYCLES, ParsedLine
from controller.program.cycle_moves import Way
from controller.program.modal import Cycle, State, dwell_s
from controller.program.motion_words import PLANES
from controller.program.offset_words import Here
from controller.program.position import Coordinate
from controller.program.program import Block, Remark, Tip
from controller.program.words import Word

# Fine boring and back boring, G76 and G87 of Fanuc-like controls: the spindle stands, the tool goes aside.
#
#     G76   down at feed; stands, goes aside by Q, up at rapid, back to the middle, turns
#     G87   stands, goes aside, down at rapid to R below the part, back to the middle, turns; up at feed to Z;
#           stands, goes aside, up at rapid, back to the middle, turns
#
# Q is how far the tip is led off the wall. Which way that is, with the spindle at its angle, only the machine
# knows: ``shift`` of ``orient`` in [io]. I J say it in program coordinates instead, as some controls have it.
# Both are done in G17, where K can still be how often.

BORING = ("G76", "G87")
_WAYS: MappingProxyType[str, Vector] = MappingProxyType(
    {"X+": (1.0, 0.0, 0.0), "X-": (-1.0, 0.0, 0.0), "Y+": (0.0, 1.0, 0.0), "Y-": (0.0, -1.0, 0.0)}
)
_STRAIGHT = 1e-9  # of a unit vector: it lies in the plane


def bore_shift(here: Here, code: str, word: Word, before: Cycle | None) -> tuple[float, float] | None:
    """The way aside in the plane, mm; kept from the lines of the same code before. None for other cycles."""
    if code not in BORING:
        return None
    output_words.standing(here.ask, word, here.machine, code)
    if (plane := here.state.modal.plane) != "G17":
        raise here.ask.refusal(word, "boring.plane", code=code, plane=plane)
    if here.ask.has("IJ"):
        i, j = here.length_mm("I") or 0.0, here.length_mm("J") or 0.0
        return _checked(here, code, word, (i, j))
    if "Q" in here.ask.words:
        return _checked(here, code, here.ask.words["Q"], _by_q(here, code))
    if before is not None and before.code == code and before.shift is not None:
        return before.shift
    raise here.ask.refusal(word, "boring.no_shift", code=code)


def _checked(here: Here, code: str, word: Word, found: tuple[float, float]) -> tuple[float, float]:
    if found == (0.0, 0.0):
        raise here.ask.refusal(word, "boring.shift_of_nothing", code=code)
    return found


def _by_q(here: Here, code: str) -> tuple[float, float]:
    """Q along the machine's own way, in the plane of the program."""
    word, io, modal = here.ask.words["Q"], here.machine.io, here.state.modal
    far = here.length_mm("Q") or 0.0
    if far < 0.0:
        raise here.ask.refusal(word, "boring.negative")
    if io is None or io.orient is None or not io.orient.shift:
        raise here.ask.refusal(word, "boring.no_direction")
    x, y, z = modal.frame(here.machine).turn_back(_WAYS[io.orient.shift])
    if modal.tilted or abs(z) > _STRAIGHT:
        raise here.ask.refusal(word, "boring.off_the_plane", shift=io.orient.shift)
    return far * x, far * y


def check_heights(here: Here, word: Word, below: float, end: float, level: float) -> None:
    """Of G87: R is below Z, where the cut upwards ends, and Z below where the tool comes from."""
    if not below < end <= level:
        raise here.ask.refusal(word, "boring.heights", below=below, end=end, level=level)


def fine_bore(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    """G76."""
    way.cut(bottom)
    way.wait(cycle.seconds)
    _aside(way, cycle, way.end)


def back_bore(way: Way, cycle: Cycle, below: float, end: float) -> None:
    """G87."""
    _aside(way, cycle, below)
    way.cut(end)
    way.wait(cycle.seconds)
    _aside(way, cycle, way.end)


def _aside(way: Way, cycle: Cycle, height: float) -> None:
    """To another height with the tip off the wall."""
    assert cycle.shift is not None
    way.stand()
    way.aside(cycle.shift)
    way.rapid(None, None, height)
    way.aside((0.0, 0.0))
    way.turn()


BREAK_MM = 0.254  # what G73 draws back, and where G83 ends its rapid above the last depth, as LinuxCNC
TAPS = ("G74", "G84")
ALONG_DEG = 0.01  # by which the axis of a cycle may miss the tool: rotary words of two decimals
MAX_REPEATS = 1000  # of one line ...
MAX_PECKS = 10_000  # ... in all of them


def blocks(here: Here, code: str, word: Word) -> tuple[list[Block], State]:
    """The moves of one line of a cycle, and the state after them."""
    _check(here, code, word)
    cycle, now = _cycle(here, code, word)
    feed = here.state.feed(here.ask, code, word)
    hole = "tap" if code in TAPS else "drill"
    way = Way(here, here.ask.place(word), feed, motion_words.targets(here), hole)
    before = here.state.motion
    beneath = here.state.beneath if before in CYCLES else before
    state = here.state._replace(cycle=cycle, motion=code, beneath=beneath)
    rigid = code in TAPS and cycle_moves.is_rigid(here)
    if code in TAPS and not rigid:
        state = _note_floating(way, state, code)
    clearance, bottom = _heights(here, cycle)
    start = _start(way, now, clearance, cycle.level)
    way.end = clearance if here.state.to_clearance else max(cycle.level, clearance)
    relative = not here.state.absolute
    x, y = way.begin
    way.repeats = _repeats(here.ask, way)
    for _ in range(way.repeats):
        x, y = way.hole(x, y, relative)
        way.rapid(x, y, start)
        if start != clearance and code != "G87":
            way.rapid(None, None, clearance)
        (cycle_moves.tap if rigid else _DRILL[code])(way, cycle, clearance, bottom)
        way.rapid(None, None, way.end)
        start = way.end
    return way.made, state._replace(modal=replace(state.modal, outputs=way.modal.outputs))


def _start(way: Way, now: float, clearance: float, level: float) -> float:
    """The height of the rapid over the first hole, mm: where the axis is, and not below R.

    From R or below, G98 goes over to the hole at the level again, and G99 goes straight up to R first.
    """
    if now > clearance + ROUNDING:
        return now
    if not way.here.state.to_clearance and level >= clearance:
        return level
    if now < clearance - ROUNDING:
        way.rapid(None, None, clearance)
    return clearance


def _check(here: Here, code: str, word: Word) -> None:
    state, spindle = here.state, here.machine.spindle
    here.ask.refuse_where(
        word,
        (state.modal.tip is not Tip.OFF, "cycle.tip_control"),
        (state.inverse, "cycle.inverse"),
        (state.side != "G40", "cycle.beside"),
        (code == "G84" and state.turning != 1, "cycle.tap_right"),
        (code == "G74" and state.turning != -1, "cycle.tap_left"),
        (code in ("G76", "G86", "G87") and state.turning == 0, "cycle.standing"),
        (code in TAPS and spindle is not None and spindle.by == "hand", "cycle.tap_by_hand"),
        (code == "G87" and state.to_clearance, "cycle.g87_to_clearance"),
        code=code,
        side=state.side,
    )
    _check_along(here, code, word)


def _check_along(here: Here, code: str, word: Word) -> None:
    """In a tilted plane a cycle goes along the tool. Raises ProgramError."""
    modal, position = here.state.modal, here.position
    if not modal.tilted:
        return
    first, second = here.known(word, position.rotaries, code)
    normal = PLANES[modal.plane][2]
    along = modal.frame(here.machine)[1 + normal]
    off = math.degrees(angle_between(position.chain().tool_axis((first, second)), along))
    if off > ALONG_DEG:
        raise here.ask.refusal(
            word, "cycle.not_along_the_tool", code=code, axis="XYZ"[normal], off=off, most=ALONG_DEG
        )


def _cycle(here: Here, code: str, word: Word) -> tuple[Cycle, float]:
    """What the words say and what is kept, and where the axis across the plane is, mm."""
    before, state = here.state.cycle, here.state
    keeps = before is not None and (before.code == code or here.machine.dialect == "fanuc")
    normal = PLANES[state.modal.plane][2]
    bottom, clearance = here.length_mm("XYZ"[normal]), here.length_mm("R")
    if before is not None and keeps:
        _check_unit(here, code, word, before)
        bottom = before.bottom if bottom is None else bottom
        clearance = before.clearance if clearance is None else clearance
    if bottom is None or clearance is None:
        lacks = "XYZ"[normal] if bottom is None else "R"
        what = Key("cycle.bottom" if bottom is None else "cycle.clearance")
        raise here.ask.refusal(word, "cycle.no_height", code=code, lacks=lacks, what=what)
    (now,) = here.known(word, here.position.in_frame(state.modal)[normal : normal + 1], code)
    level = before.level if before is not None else now
    old = before if before is not None and keeps else None
    depth, seconds = _depth(here, code, word, old), _seconds(here, code, word, old)
    shift = bore_shift(here, code, word, old)
    return Cycle(code, bottom, clearance, level, depth, seconds, shift, state.mm_per_unit), now


def _check_unit(here: Here, code: str, word: Word, before: Cycle) -> None:
    """Lengths that an earlier line wrote in another unit are not gone on with. Raises ProgramError."""
    if before.mm_per_unit == here.state.mm_per_unit:
        return
    words = here.ask.words
    lacks = [letter for letter in ("XYZ"[PLANES[here.state.modal.plane][2]], "R") if letter not in words]
    if (before.depth, before.shift) != (None, None) and not words.keys() & set("QIJK"):
        lacks.append("Q")
    if lacks:
        raise here.ask.refusal(word, "cycle.other_unit", code=code, lacks=chain("and", lacks))


def _depth(here: Here, code: str, word: Word, before: Cycle | None) -> Coordinate:
    given = here.ask.words.get("Q")
    depth = here.length_mm("Q") if given is not None else before.depth if before is not None else None
    if code in TAPS:
        _check_pecks(here, given, depth)
    if code not in ("G73", "G83"):
        return depth
    if depth is None or depth <= 0.0:
        key = "cycle.no_q" if given is None else "cycle.bad_q"
        raise here.ask.refusal(given or word, key, code=code)
    return depth


def _check_pecks(here: Here, given: Word | None, depth: Coordinate) -> None:
    """Q of a tap. Raises ProgramError."""
    if given is not None and not cycle_moves.is_rigid(here):
        raise here.ask.refusal(given, "cycle.pecks_of_a_tap")
    if given is not None and depth is not None and depth <= 0.0:
        raise here.ask.refusal(given, "cycle.no_peck")


def _seconds(here: Here, code: str, word: Word, before: Cycle | None) -> Coordinate:
    given = here.ask.words.get("P")
    if given is not None:
        return dwell_s(here.ask, given, here.machine)
    kept = before.seconds if before is not None else None
    if kept is None and code in ("G82", "G86", "G89") and here.machine.dialect == "rs274":
        raise here.ask.refusal(word, "cycle.no_dwell", code=code)
    return kept


def _heights(here: Here, cycle: Cycle) -> tuple[float, float]:
    """Clearance and bottom in program coordinates; of G87, which cuts upwards, R and Z."""
    clearance, bottom = cycle.clearance, cycle.bottom
    if not here.state.absolute:
        clearance += cycle.level
        bottom += clearance
    word = here.ask.words.get("R") or here.ask.line.words[0]
    if cycle.code == "G87":
        check_heights(here, word, clearance, bottom, cycle.level)
    elif bottom > clearance:
        raise here.ask.refusal(word, "cycle.upside_down", code=cycle.code, clearance=clearance, bottom=bottom)
    return clearance, bottom


def _repeats(ask: ParsedLine, way: Way) -> int:
    word = ask.words.get("L") or ask.words.get("K")
    if word is None:
        return 1
    count = ask.whole(word)
    least = 0 if way.fanuc else 1  # K0 under fanuc: the words are kept and nothing is drilled
    if not least <= count <= MAX_REPEATS:
        raise ask.refusal(word, "cycle.repeats", least=least, most=MAX_REPEATS)
    return count


def _note_floating(way: Way, state: State, code: str) -> State:
    if code in state.noted:
        return state
    way.made.append(Remark(way.place, state.modal, message("note.floating", code=code)))
    return state._replace(noted=state.noted | {code})


def _drill(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    way.cut(bottom)
    way.wait(cycle.seconds if cycle.code == "G82" else None)


def _peck(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    """G73 draws back a little after each peck, G83 to the clearance and down again."""
    depth = cycle.depth or 0.0
    pecks = (clearance - bottom) / depth * way.repeats
    if pecks > MAX_PECKS:
        word = way.here.ask.line.words[0]
        raise way.here.ask.refusal(word, "cycle.too_many_pecks", code=cycle.code, pecks=pecks, most=MAX_PECKS)
    height = clearance - depth
    while height > bottom:
        way.cut(height)
        if cycle.code == "G83":
            way.rapid(None, None, clearance)
        way.rapid(None, None, min(height + BREAK_MM, clearance))
        height -= depth
    way.cut(bottom)


def _tap(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    way.cut(bottom)
    way.spindle(-1.0)
    way.wait(cycle.seconds)
    way.cut(clearance)
    way.spindle(1.0)


def _bore(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    """Out at feed: G85 to the clearance; G89, after a dwell, all the way under rs274."""
    way.cut(bottom)
    way.wait(cycle.seconds if cycle.code == "G89" else None)
    way.cut(way.end if cycle.code == "G89" and not way.fanuc else clearance)


def _bore_standing(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    """G86: out at rapid with the spindle stopped."""
    way.cut(bottom)
    way.wait(cycle.seconds)
    way.spindle(0.0)
    way.rapid(None, None, way.end)
    way.spindle(1.0)


_DRILL: MappingProxyType[str, Callable[[Way, Cycle, float, float], None]] = MappingProxyType(
    {
        **dict.fromkeys(("G81", "G82"), _drill),
        **dict.fromkeys(("G73", "G83"), _peck),
        **dict.fromkeys(TAPS, _tap),
        **dict.fromkeys(("G85", "G89"), _bore),
        "G86": _bore_standing,
        "G76": fine_bore,
        "G87": back_bore,
    }
)
