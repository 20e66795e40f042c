"""What a benchmark tells: figures, each beside its reference from the same run, and parts that add up."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

SAME = 1e-9  # that the parts may miss the whole by


@dataclass(frozen=True)
class Figure:
    """``value`` in ``unit`` beside ``reference``, what that is in ``beside``; None: there was none here.

    What is promised of it, if anything: ``at_most`` or ``at_least`` in ``unit``, or ``at_most_times`` the
    reference. The promise is for a computer that does nothing else; a page gets these figures.
    """

    name: str
    value: float
    unit: str
    reference: float | None = None
    beside: str = ""
    at_most: float | None = None
    at_least: float | None = None
    at_most_times: float | None = None

    @property
    def ratio(self) -> float | None:
        """Of the value to its reference."""
        return None if not self.reference else self.value / self.reference


@dataclass(frozen=True)
class Report:
    """All of a benchmark. ``parts``: shares of ``whole``, by name; they add up to 1."""

    figures: tuple[Figure, ...]
    parts: Mapping[str, float] = field(default_factory=dict)
    whole: str = ""
    note: str = ""  # why something could not be measured here, or is not to be trusted

    def __post_init__(self) -> None:
        """Raises ValueError where a figure is no number or parts are left over."""
        for one in self.figures:
            if not math.isfinite(one.value):
                raise ValueError(f"{one.name} is {one.value}")
        if self.parts and abs(math.fsum(self.parts.values()) - 1.0) > SAME:
            raise ValueError(f"the parts of {self.whole} add up to {math.fsum(self.parts.values()):.6f}")

    def to_dict(self) -> dict[str, Any]:
        figures = [{**asdict(one), "ratio": one.ratio} for one in self.figures]
        return {"figures": figures, "parts": dict(self.parts), "whole": self.whole, "note": self.note}


def shares(amounts: Mapping[str, float]) -> dict[str, float]:
    """Each of all of them."""
    whole = math.fsum(amounts.values())
    return {name: amount / whole for name, amount in amounts.items()}


def by_lateness(off: Any) -> dict[str, float]:
    """Shares of intervals that are ``off`` (in periods, absolute) by so much."""
    return shares(
        {
            "within 1/16 of the period": float((off <= 1 / 16).sum()),
            "within 1/4": float(((off > 1 / 16) & (off <= 1 / 4)).sum()),
            "outside": float((off > 1 / 4).sum()),
        }
    )


def percentiles(name: str, ours: Any, theirs: Any, unit: str, scale: float, beside: str) -> list[Figure]:
    """Median, 99 % and 99.9 % of two samples."""
    import numpy as np

    points = (50.0, 99.0, 99.9)
    mine = np.percentile(ours, points) * scale
    other = np.percentile(theirs, points) * scale if theirs is not None else (None,) * 3
    return [
        Figure(f"{name} p{p:g}", float(a), unit, None if b is None else float(b), beside)
        for p, a, b in zip(points, mine, other, strict=True)
    ]


def _beside(one: Mapping[str, Any]) -> str:
    if one["ratio"] is None:
        return ""
    return f"{one['beside']} {one['reference']:.6g}, ratio {one['ratio']:.3g}"


def main(report: Callable[[bool], Report]) -> None:
    """A benchmark by itself: one JSON object of it, or lines for people."""
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.add_argument("--short", action="store_true", help="So little that it only shows that it works.")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    found = report(asked.short).to_dict()
    if asked.json:
        print(json.dumps(found))
        return
    for one in found["figures"]:
        print(f"{one['name']:<40}{one['value']:>12.6g} {one['unit']:<12}{_beside(one)}")
    for name, share in found["parts"].items():
        print(f"  {name:<38}{share:>12.1%} of {found['whole']}")
    if found["note"]:
        print(found["note"])
