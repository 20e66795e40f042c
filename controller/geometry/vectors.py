"""Vectors, rotations, poses and frames.

Every function here takes plain floats (with ``m=math``) in the tick, arrays of
samples (with ``m=numpy``) in the plan, and truncated Taylor series (with
``m=controller.geometry.series``) where exact derivatives are wanted: the formula stands once.
A vector is a tuple of three components, each a float or an array of shape (N,).
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any, Final, NamedTuple

# A float, an array of samples, or a series. Python has no type for "whatever has
# + - * /", so the formulas that serve all three say so with this name.
Number = Any
Vector = tuple[Number, Number, Number]

X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
ZERO: Vector = (0.0, 0.0, 0.0)

ROUNDING: Final = 1e-9  # mm, rad or s: two computations of one thing come out nearer than this


def add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vector, factor: Number) -> Vector:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vector, b: Vector) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def norm(a: Vector, m: ModuleType = math) -> Number:
    return m.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def unit(a: Vector, m: ModuleType = math) -> Vector:
    return scale(a, 1.0 / norm(a, m))


def angle_between(a: Vector, b: Vector, m: ModuleType = math) -> Number:
    """Angle between two vectors in radians, exact also for tiny angles."""
    return m.atan2(norm(cross(a, b), m), dot(a, b))


def rotate(direction: Vector, angle_rad: Number, v: Vector, m: ModuleType = math) -> Vector:
    """``v`` turned by the right hand about the unit vector ``direction`` (Rodrigues)."""
    c, s = m.cos(angle_rad), m.sin(angle_rad)
    along = dot(direction, v) * (1.0 - c)
    w = cross(direction, v)
    return (
        v[0] * c + w[0] * s + direction[0] * along,
        v[1] * c + w[1] * s + direction[1] * along,
        v[2] * c + w[2] * s + direction[2] * along,
    )


class Pose(NamedTuple):
    """Tool tip (mm) and tool axis (unit vector from tip to spindle) in one frame."""

    tip: Vector
    axis: Vector


class Frame(NamedTuple):
    """A right-handed frame: its origin and its unit axes, seen from the parent frame."""

    origin: Vector = ZERO
    x: Vector = X
    y: Vector = Y
    z: Vector = Z

    def turn(self, v: Vector) -> Vector:
        """A direction of this frame in the parent frame; written out in components for the tick."""
        (ax, ay, az), (bx, by, bz), (cx, cy, cz), (x, y, z) = self.x, self.y, self.z, v
        return ax * x + bx * y + cx * z, ay * x + by * y + cy * z, az * x + bz * y + cz * z

    def to_parent(self, p: Vector) -> Vector:
        """A point of this frame in the parent frame."""
        return add(self.origin, self.turn(p))

    def turn_back(self, v: Vector) -> Vector:
        """A direction of the parent frame in this frame."""
        return (dot(self.x, v), dot(self.y, v), dot(self.z, v))

    def from_parent(self, p: Vector) -> Vector:
        """A point of the parent frame in this frame."""
        return self.turn_back(subtract(p, self.origin))
