"""G40 to G42: the side of the cutter on surfaces, and P, Q and R beside them."""

from __future__ import annotations

from dataclasses import replace

from controller.machine.model import MAX_WEAR_MM
from controller.program.codes import Ask
from controller.program.program import Modal, Side
from controller.program.words import Word


def applied(ask: Ask, code: str, letters: str, mm_per_unit: float, modal: Modal) -> Modal:
    """The state after G40, G41 or G42; ``letters``: those of P, Q, R that no other code of the line takes."""
    words = {letter: ask.words[letter] for letter in letters if letter in ask.words}
    return replace(
        modal,
        side=Side.LEFT if code.startswith("G41") else Side.RIGHT,
        placement=_placement(ask, code, words),
        allowance_mm=_allowance_mm(ask, code, words, mm_per_unit),
        tolerance_mm=_tolerance_mm(ask, code, words, mm_per_unit),
    )


def _placement(ask: Ask, code: str, words: dict[str, Word]) -> int:
    placement = ask.whole(words["P"]) if "P" in words else 0
    if "P" in words and placement not in (1, 2, 3, 4):
        raise ask.refusal(words["P"], "side.placement", code=code)
    return placement


def _allowance_mm(ask: Ask, code: str, words: dict[str, Word], mm_per_unit: float) -> float:
    """Q: what stays on the surface, or, negative, a cutter's wear."""
    if (word := words.get("Q")) is None:
        return 0.0
    allowance = word.value * mm_per_unit
    if allowance < -MAX_WEAR_MM:
        raise ask.refusal(word, "side.allowance", off=-allowance, code=code, most=MAX_WEAR_MM)
    return allowance


def _tolerance_mm(ask: Ask, code: str, words: dict[str, Word], mm_per_unit: float) -> float | None:
    word = words.get("R")
    if word is None:
        return None
    if word.value <= 0.0:
        raise ask.refusal(word, "side.tolerance", code=code)
    return word.value * mm_per_unit
