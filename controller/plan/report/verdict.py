"""What a surface comes out as against its form tolerance, as values: within it, or how far off and where.

Everything that the program does beside the surface is in it, leads, pivots and other cuts included,
and all of the surface, its ends included.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from controller.geometry.vectors import Vector

ROUNDING_MM = 1e-6  # a surface that is off by its very tolerance is within it


@dataclass(frozen=True, slots=True)
class Verdict:
    """Of one surface. What is to stay on it (Q) counts as no deviation."""

    line: int
    tool: int
    tolerance_mm: float
    overcut_mm: float  # the deepest
    undercut_mm: float  # the most that is left standing
    u: float  # where it is off most
    v: float
    height_mm: float  # of that place above the lower edge, along its ruling
    place: Vector  # part frame, mm
    by: str  # the motion that cuts there: 'cut', 'lead in', ...
    by_line: int
    remedies: tuple[str, ...] = ()  # what would do, keys of ``form.do.``; the best first
    radius_mm: float = 0.0  # of a cutter that would do as it is placed now, about; 0 = none is known

    @property
    def largest_mm(self) -> float:
        """How far it is off, to either side."""
        return max(self.overcut_mm, self.undercut_mm)

    @property
    def exceeds_mm(self) -> float:
        """By how much it is beyond its tolerance; 0 within."""
        return max(0.0, self.largest_mm - self.tolerance_mm)

    @property
    def within(self) -> bool:
        return self.exceeds_mm <= ROUNDING_MM

    def to_dict(self) -> dict[str, Any]:
        return {**asdict(self), "within": self.within, "exceeds_mm": self.exceeds_mm}

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Verdict:
        """Raises ValueError, KeyError or TypeError for anything but what ``to_dict`` makes."""
        x, y, z = values["place"]
        figures = {
            name: float(values[name])
            for name in ("tolerance_mm", "overcut_mm", "undercut_mm", "u", "v", "height_mm", "radius_mm")
        }
        return Verdict(
            line=int(values["line"]),
            tool=int(values["tool"]),
            place=(float(x), float(y), float(z)),
            by=str(values["by"]),
            by_line=int(values["by_line"]),
            remedies=tuple(map(str, values["remedies"])),
            **figures,
        )
