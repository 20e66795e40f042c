"""What is said of verdicts on surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from controller.messages import DEFAULT, LANGUAGES, Key, Message, chain, facts, message
from controller.plan.report.verdict import Verdict

MAX_SURFACES = 1000  # surfaces that are told one by one


def worst(verdicts: Iterable[Verdict]) -> Verdict | None:
    """The surface that is furthest beyond its tolerance, or, all within, that comes nearest to it."""
    return max(verdicts, key=lambda one: (one.exceeds_mm, one.largest_mm / one.tolerance_mm), default=None)


def exceeds(one: Verdict) -> Message:
    """By how much a surface exceeds its tolerance, where, and what would do; without a full stop."""
    motion = f"form.motion.{one.by}"
    sentence = message(
        "form.exceeds",
        line=one.line,
        tolerance=f"{one.tolerance_mm:.4g}",
        exceeds=f"{one.exceeds_mm:.4f}",
        off=f"{one.largest_mm:.4f}",
        way=Key("form.overcut" if one.overcut_mm >= one.undercut_mm else "form.undercut"),
        u=f"{one.u:.4f}",
        height=f"{one.height_mm:.3f}",
        motion=Key(motion if motion in LANGUAGES[DEFAULT].texts else "form.motion.other"),
        by_line=one.by_line,
    )
    radius = f"{one.radius_mm:.3g}"
    remedies = [message(f"form.do.{key}", radius=radius, by_line=one.by_line) for key in one.remedies]
    return (
        message("form.would_do", sentence=sentence, remedies=chain("or", remedies)) if remedies else sentence
    )


def summed(verdicts: Sequence[Verdict]) -> Message | None:
    """One sentence on all surfaces; None where none has a tolerance."""
    one = worst(verdicts)
    if one is None:
        return None
    if not one.within:
        return message("form.exceeding", text=exceeds(one))
    off, tolerance = f"{1e3 * one.largest_mm:.1f}", f"{1e3 * one.tolerance_mm:.4g}"
    return message("form.within", off=off, tolerance=tolerance, line=one.line)


def to_json(verdicts: Sequence[Verdict], most: int = MAX_SURFACES) -> dict[str, Any] | None:
    """The verdicts for JSON, ``most`` surfaces one by one; None where none has a tolerance."""
    one = worst(verdicts)
    if one is None:
        return None
    return {
        "within": one.within,
        "tolerance_mm": one.tolerance_mm,  # of the surface that is worst
        "largest_mm": one.largest_mm,
        "exceeds_mm": one.exceeds_mm,
        **facts(summed(verdicts)),
        "surfaces": [other.to_dict() for other in verdicts[:most]],
        "left_out": max(0, len(verdicts) - most),
    }
