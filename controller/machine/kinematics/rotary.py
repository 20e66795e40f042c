"""One rotary: the line it turns about, and what it carries turned by it, in components for the tick."""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

from controller.geometry.vectors import Number, Vector


class Line(NamedTuple):
    """The line a rotary turns about, machine frame at zero."""

    direction: Vector
    point: Vector


def spun(direction: Vector, angle: Number, v: Vector, m: ModuleType) -> Vector:
    """Rodrigues as in ``geometry.rotate``, written out in components for the tick."""
    x, y, z = v
    dx, dy, dz = direction
    c, s = m.cos(angle), m.sin(angle)
    along = (dx * x + dy * y + dz * z) * (1.0 - c)
    return (
        x * c + (dy * z - dz * y) * s + dx * along,
        y * c + (dz * x - dx * z) * s + dy * along,
        z * c + (dx * y - dy * x) * s + dz * along,
    )


def turned(line: Line, angle: Number, v: Vector, m: ModuleType) -> Vector:
    (px, py, pz), (x, y, z) = line.point, v
    x, y, z = spun(line.direction, angle, (x - px, y - py, z - pz), m)
    return x + px, y + py, z + pz
