"""The codes and words that are in force, one of each group, as an operator reads them beside the figures."""

from __future__ import annotations

from collections.abc import Iterator

from controller.machine.model import OFFSETS
from controller.program.modal import State
from controller.program.program import Side, Tip

COOLANT_CODES = ("M9", "M7", "M8", "M7 M8")
SPINDLE_CODES = {0: "M5", 1: "M3", -1: "M4"}
TIPS = {Tip.ROTARIES: "G43.4", Tip.VECTORS: "G43.5"}


def active_codes(state: State) -> tuple[str, ...]:
    """Motion, plane, unit, distance, feed mode, side, length, offset, path, cycles' return, what changes the
    meaning of positions while it is on, turned and tilted planes, spindle, coolant, overrides; then the words
    T, H, D, F (as written: unit a minute, or a turn), S.

    A length that is no tool's own, by G43.1 or a sum of G43.2, is G43.1 with it, and there is no H.
    """
    modal, turned = state.modal, state.origins.turn is not None
    return (
        state.motion or "G80",
        modal.plane,
        "G21" if state.mm_per_unit == 1.0 else "G20",
        "G90" if state.absolute else "G91",
        "G93" if state.inverse else "G95" if state.per_turn else "G94",
        _side(state),
        _length(state),
        OFFSETS[modal.offset],
        _path(state),
        "G99" if state.to_clearance else "G98",
        *_while_on(state),
        "G68.2" if modal.tilted else "G68" if turned else "G69",
        SPINDLE_CODES[(modal.spindle_rev_min > 0.0) - (modal.spindle_rev_min < 0.0)],
        COOLANT_CODES[modal.coolant],
        "M48" if modal.overrides.feed else "M49",
        f"T{modal.tool}",
        *([] if _is_by_words(state) else [f"H{state.length_tool}"]),
        f"D{state.radius_tool}",
        _feed(state),
        f"S{state.speed_rev_min:.12g}",
    )


def _is_by_words(state: State) -> bool:
    """Whether the length in force is no tool's own."""
    return state.modal.tip is Tip.OFF and bool(state.modal.length_mm) and not state.length_tool


def _length(state: State) -> str:
    if _is_by_words(state):
        return f"G43.1 Z{state.modal.length_mm / state.mm_per_unit:.6g}"
    return TIPS.get(state.modal.tip, "G43" if state.modal.length_mm else "G49")


def _while_on(state: State) -> Iterator[str]:
    """Of groups whose other code is shown by nothing: centres, radius and angle, mirrors, carried origins."""
    if state.centres_absolute:
        yield "G90.1"
    if state.polar is not None:
        yield "G16"
    if (mirror := state.origins.mirror) is not None:
        places = zip("XYZ", mirror, strict=True)
        words = [f"{name}{at / state.mm_per_unit:.6g}" for name, at in places if at is not None]
        yield " ".join(["G51.1", *words])
    if (following := state.origins.following) is not None:
        yield f"{following.code} P{following.number}" if following.number else following.code


def _side(state: State) -> str:
    """Of surfaces G40 and G42 are one side."""
    if state.modal.planar is not None:
        return state.modal.planar.code
    return "G41" if state.modal.side is Side.LEFT else state.side


def _path(state: State) -> str:
    modal = state.modal
    if modal.exact:
        return "G61"
    return f"G64 P{modal.blend_mm / state.mm_per_unit:g}" if modal.blend_mm else "G64"


def _feed(state: State) -> str:
    if state.per_turn:
        return f"F{state.turn_feed[0] / state.mm_per_unit:.6g}" if state.turn_feed is not None else "F0"
    feed = state.modal.feed_mm_s
    return "F0" if feed is None else f"F{feed * 60.0 / state.mm_per_unit:.6g}"
