"""G40 to G42, G41.1 and G42.1: cutter compensation of lines and arcs (D), and on surfaces (P, Q, R).

Which of its two meanings a G41 has, a person can tell: with D it is for lines and arcs, with P, Q or R
for surfaces, and with none of them for whatever of the two comes first. ``compensation`` does
that of lines and arcs.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from controller.machine.model import MAX_WEAR_MM, Machine, Tool
from controller.program.codes import ParsedLine
from controller.program.modal import State
from controller.program.program import Modal, Planar, ProgramError, Side, Tip
from controller.program.words import Word

WRITTEN = ("G41.1", "G42.1")  # D is the diameter itself
# What must not change while the cutter runs beside a contour, and the groups of codes that change it.
_STAYS = MappingProxyType(
    {
        "plane": ("plane",),
        "tool": ("tool change",),
        "length_mm": ("length",),
        "tip": ("length",),
        "offset": ("offset",),
        "part": ("one-line", "rotation", "motion"),
        "turned_rad": ("one-line", "motion"),
    }
)
_NEVER = ("G28", "G30", "G53")


def active_offset(ask: ParsedLine, code: str, letters: str, state: State, machine: Machine) -> Planar | None:
    """The compensation after G40 to G42.1; ``letters``: those of D P Q R that no other code takes."""
    word, before = ask.codes["side"][1], state.modal.planar
    if code == "G40":
        return None
    number = ask.words.get("D") if "D" in letters or code in WRITTEN else None
    for_surfaces = [ask.words[letter] for letter in "PQR" if letter in letters and letter in ask.words]
    if before is not None and before.lines:
        if machine.dialect == "fanuc" and code == before.code and not for_surfaces:
            again = before if number is None else _beside(ask, code, number, state, machine)
            if again is not None and again.off_mm == before.off_mm:
                return before
        raise ask.refusal(word, "beside.is_on", code=before.code, line=before.place.line)
    if for_surfaces and number is not None:
        raise ask.refusal(number, "beside.two_meanings", other=for_surfaces[0].text, code=code)
    if for_surfaces:
        return None
    number = number or (state.offset_number if code not in WRITTEN else None)
    return _beside(ask, code, number, state, machine)


def _beside(ask: ParsedLine, code: str, number: Word | None, state: State, machine: Machine) -> Planar | None:
    """The compensation of a code with D, or without."""
    written = code in WRITTEN
    if number is None and written:
        raise ask.refusal(ask.codes["side"][1], "beside.no_diameter", code=code)
    if written and "L" in ask.words and ask.words["L"].value not in (0.0, 9.0):
        raise ask.refusal(ask.words["L"], "beside.edge")
    if written and number is not None:
        radius: float | None = number.value * state.mm_per_unit / 2.0
    else:
        radius = radius_of(ask, number, state, machine)
    if radius is None:
        return None
    place = ask.place(ask.codes["side"][1])
    off = radius if code.startswith("G41") else -radius
    return Planar(place, code, off, number is not None, machine.dialect == "fanuc")


def radius_of(ask: ParsedLine, number: Word | None, state: State, machine: Machine) -> float | None:
    """Of the tool that D names, or that is in the spindle (D0 too; of Fanuc's D0 nothing)."""
    if number is None:
        tool = state.modal.tool_in(machine)
        return None if tool is None else tool.radius_mm
    whole = ask.whole(number)
    if whole == 0 and machine.dialect == "fanuc":
        return 0.0
    found: Tool | None = state.named(whole, machine) if whole else state.modal.tool_in(machine)
    if found is None:
        known = " ".join(f"D{tool.number}" for tool in machine.tools) or "none"
        raise ask.refusal(number, "beside.no_tool", known=known)
    return found.radius_mm


def for_lines(ask: ParsedLine, motion: str, word: Word, state: State) -> State:
    """The state in which a G1 to G3 is read; it decides a G41 that does not say. Raises ProgramError."""
    planar = state.modal.planar
    if state.side == "G40" or (planar is not None and planar.lines and state.modal.tip is Tip.OFF):
        return state
    if planar is None:
        raise ask.refusal(word, "beside.for_surfaces", motion=motion, side=state.side)
    if state.modal.tip is not Tip.OFF:
        raise ask.refusal(word, "beside.tip_control", motion=motion, side=state.side)
    return state._replace(modal=replace(state.modal, planar=planar._replace(lines=True)))


def for_surfaces(ask: ParsedLine, motion: str, word: Word, state: State) -> State:
    """Likewise for a surface."""
    planar = state.modal.planar
    if planar is not None and planar.lines:
        raise ask.refusal(word, "beside.for_lines", motion=motion, code=planar.code, line=planar.place.line)
    return state if planar is None else state._replace(modal=replace(state.modal, planar=None))


def check(ask: ParsedLine, before: Modal, after: Modal) -> None:
    """Refuses what must not change between G41 and G40, nor on their lines."""
    planar = before.planar or after.planar
    if planar is None or not planar.lines or after.planar is None:
        return
    once = ask.code("one-line")
    if "tool change" in ask.codes or once in _NEVER:
        raise _changed(ask, "tool change" if "tool change" in ask.codes else "one-line", planar)
    for name, groups in _STAYS.items():
        if getattr(before, name) != getattr(after, name):
            group = next((group for group in groups if group in ask.codes), "")
            raise _changed(ask, group or next(iter(ask.codes), ""), planar)


def _changed(ask: ParsedLine, group: str, planar: Planar) -> ProgramError:
    word = ask.codes[group][1] if group else ask.line.words[0]
    return ask.refusal(word, "beside.changed", code=planar.code, line=planar.place.line)


# ---- on surfaces


def on_surfaces(ask: ParsedLine, code: str, letters: str, mm_per_unit: float, modal: Modal) -> Modal:
    """The state after G40, G41 or G42, as far as it is for surfaces; ``letters``: those of P, Q, R that no
    other code of the line takes.
    """
    words = {letter: ask.words[letter] for letter in letters if letter in ask.words}
    return replace(
        modal,
        side=Side.LEFT if code.startswith("G41") else Side.RIGHT,
        placement=_placement(ask, code, words),
        allowance_mm=_allowance_mm(ask, code, words, mm_per_unit),
        tolerance_mm=_tolerance_mm(ask, code, words, mm_per_unit),
    )


def _placement(ask: ParsedLine, code: str, words: dict[str, Word]) -> int:
    placement = ask.whole(words["P"]) if "P" in words else 0
    if "P" in words and placement not in (1, 2, 3, 4):
        raise ask.refusal(words["P"], "side.placement", code=code)
    return placement


def _allowance_mm(ask: ParsedLine, code: str, words: dict[str, Word], mm_per_unit: float) -> float:
    """Q: what stays on the surface, or, negative, a cutter's wear."""
    if (word := words.get("Q")) is None:
        return 0.0
    allowance = word.value * mm_per_unit
    if allowance < -MAX_WEAR_MM:
        raise ask.refusal(word, "side.allowance", off=-allowance, code=code, most=MAX_WEAR_MM)
    return allowance


def _tolerance_mm(ask: ParsedLine, code: str, words: dict[str, Word], mm_per_unit: float) -> float | None:
    word = words.get("R")
    if word is None:
        return None
    if word.value <= 0.0:
        raise ask.refusal(word, "side.tolerance", code=code)
    return word.value * mm_per_unit
