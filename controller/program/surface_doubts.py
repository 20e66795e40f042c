"""What makes doubtful that a G51 or G52 means what it says: told by ``check``, or refused.

In these blocks a word without a decimal point counts 0.01 mm (the paper's unit), with one the active
unit. Whoever writes X15 for 15 mm gets 0.15 mm.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

from controller.geometry.vectors import Frame, Vector, norm, subtract
from controller.messages import Said, said
from controller.program.modal import BLU_PER_MM
from controller.program.words import Word

MICROSCOPIC_MM = 0.1  # a contact that is no longer
UPSIDE_DOWN = -0.5  # cosine of the ruling's angle to the table's normal


def of_words(code: str, words: Iterable[Word], contact_mm: float) -> Said | None:
    """A doubt about the units of lengths (``contact_mm``: of the contact), or None."""
    counted = [word for word in words if word.value != 0.0]
    plain = next((word for word in counted if not word.point), None)
    if plain is None:
        return None
    pointed = next((word for word in counted if word.point), None)
    means = {"code": code, "word": plain.text, "mm": abs(plain.value) / BLU_PER_MM}
    if pointed is not None:
        return said("doubt.mixed", pointed=pointed.text, **means)
    return said("doubt.microscopic", contact=contact_mm, **means) if contact_mm < MICROSCOPIC_MM else None


def contact_mm(points: Sequence[Vector]) -> float:
    """About the length of a curve, by its control points."""
    return float(sum(norm(subtract(b, a)) for a, b in itertools.pairwise(points)))


def is_upside_down(upper: Sequence[Vector], lower: Sequence[Vector], part: Frame) -> bool:
    """Whether the tool would point up out of the table all along: the two curves are exchanged."""
    rulings = [subtract(a, b) for a, b in zip(upper, lower, strict=True)]
    return all(part.turn(ruling)[2] < UPSIDE_DOWN * norm(ruling) for ruling in rulings)
