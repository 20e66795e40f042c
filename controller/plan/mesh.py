"""Where on a path the motion law is sought: nodes x = 0, 1 .. n and the smooth map s(x).

The density of nodes per mm is the sum of an even part, a cluster at each rest, and a
bell at each place where the speed must come down, so that a ramp always has tens of
nodes however long the block. A cluster of strength c and reach a has the density

    c / (s^(2/3) + s^(4/3) / a^(2/3))        nodes up to s:  3 c b atan(s^(1/3) / b),  b = a^(1/3)

that is, s ~ x^3 at the rest itself and nothing worth counting beyond its reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

RAMP_NODES = 24  # nodes on a ramp from rest
REACH = 4.0  # reach of a cluster, in ramps
BELL_NODES = 20  # nodes of one bell about a slow place


@dataclass(frozen=True, slots=True)
class Bell:
    """A place where nodes gather: position and half width, in the unit of s."""

    at: float
    width: float


@dataclass(frozen=True, slots=True)
class Places:
    """s(x) at places of a mesh, with its first three derivatives."""

    s: Array
    s_x: Array
    s_xx: Array
    s_xxx: Array

    def moved(self, s: float) -> Places:
        return Places(self.s + s, self.s_x, self.s_xx, self.s_xxx)


@dataclass(frozen=True, slots=True)
class Mesh:
    """A path's nodes x = 0 .. n, and its joints x = 0, 1/2, 3/2 .. n - 1/2, n between their intervals."""

    nodes: Places
    joints: Places

    def moved(self, s: float) -> Mesh:
        """The same mesh, ``s`` farther along."""
        return Mesh(self.nodes.moved(s), self.joints.moved(s))


@dataclass(frozen=True, slots=True)
class _Cluster:
    """Nodes about a rest, as a function of the distance from it."""

    strength: float
    reach: float

    def count(self, s: Array) -> Array:
        b = np.cbrt(self.reach)
        return np.asarray(3.0 * self.strength * b * np.arctan(np.cbrt(s) / b))

    def density(self, s: Array) -> tuple[Array, Array, Array]:
        """Nodes per unit and its first two derivatives; s > 0."""
        k, root = self.reach ** (-2 / 3), np.cbrt(s)
        g = root**2 + k * root**4
        slope = (2 / 3) / root + (4 / 3) * k * root
        bend = (-2 / 9) / root**4 + (4 / 9) * k / root**2
        c = self.strength
        return c / g, -c * slope / g**2, c * (2.0 * slope**2 / g**3 - bend / g**2)


@dataclass(frozen=True, slots=True)
class _Density:
    """Nodes per unit of s, with the integral X(s) and two derivatives in closed form."""

    length: float
    even: float
    start: _Cluster | None
    end: _Cluster | None
    bells: tuple[tuple[float, float, float], ...]  # position, width, height

    def count(self, s: Array) -> Array:
        x = self.even * s
        if self.start:
            x = x + self.start.count(s)
        if self.end:
            x = x + self.end.count(np.array([self.length])) - self.end.count(self.length - s)
        for at, width, height in self.bells:
            x = x + height * width * (np.arctan((s - at) / width) + np.arctan(at / width))
        return np.asarray(x)

    def value(self, s: Array) -> tuple[Array, Array, Array]:
        """Density and its first two derivatives, away from rests at s = 0 and s = length."""
        rho, slope, bend = np.full_like(s, self.even), np.zeros_like(s), np.zeros_like(s)
        for cluster, distance, sign in ((self.start, s, 1.0), (self.end, self.length - s, -1.0)):
            if cluster:
                more = cluster.density(distance)
                rho, slope, bend = rho + more[0], slope + sign * more[1], bend + more[2]
        for at, width, height in self.bells:
            y = (s - at) / width
            f = 1.0 / (1.0 + y * y)
            rho = rho + height * f
            slope = slope - height * 2.0 * y * f * f / width
            bend = bend + height * (6.0 * y * y - 2.0) * f**3 / width**2
        return rho, slope, bend

    def scaled(self, factor: float) -> _Density:
        def more(cluster: _Cluster | None) -> _Cluster | None:
            return _Cluster(cluster.strength * factor, cluster.reach) if cluster else None

        bells = tuple((at, width, height * factor) for at, width, height in self.bells)
        return _Density(self.length, self.even * factor, more(self.start), more(self.end), bells)

    def place(self, x: Array) -> Array:
        """The inverse of ``count``, by bisection on all nodes at once."""
        low, high = np.zeros_like(x), np.full_like(x, self.length)
        for _ in range(64):
            middle = 0.5 * (low + high)
            below = self.count(middle) < x
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return 0.5 * (low + high)


def make(
    length: float, spacing: float, start_ramp: float | None, end_ramp: float | None, bells: Sequence[Bell]
) -> Mesh:
    """The mesh of a path of ``length``; a ramp of None means that this end does not rest."""

    def cluster(ramp: float | None) -> _Cluster | None:
        if ramp is None:
            return None
        near = min(ramp, length / 2.0)
        return _Cluster(RAMP_NODES / (3.0 * np.cbrt(near)), REACH * near)

    # A bell of height H and width w holds about pi H w nodes.
    heights = tuple((bell.at, bell.width, BELL_NODES / (np.pi * bell.width)) for bell in bells)
    rough = _Density(length, 1.0 / spacing, cluster(start_ramp), cluster(end_ramp), heights)
    whole = float(rough.count(np.array([length]))[0])
    n = max(16, int(np.ceil(whole)))
    density = rough.scaled(n / whole)
    nodes = np.arange(n + 1, dtype=float)
    joints = np.concatenate([[0.0], nodes[:-1] + 0.5, [float(n)]])
    return Mesh(_derive(density, density.place(nodes)), _derive(density, density.place(joints)))


def _derive(density: _Density, s: Array) -> Places:
    s[0], s[-1] = 0.0, density.length
    safe = s.copy()  # at a rest the density has no bound; its limit is put in below
    for at, cluster in ((0, density.start), (-1, density.end)):
        safe[at] = 0.5 * density.length if cluster else s[at]
    rho, slope, bend = density.value(safe)
    s_x, s_xx = 1.0 / rho, -slope / rho**3
    s_xxx = (3.0 * slope * slope - rho * bend) / rho**5
    for at, cluster in ((0, density.start), (-1, density.end)):
        if cluster:  # s = (x / 3c)^3 there
            s_x[at], s_xx[at], s_xxx[at] = 0.0, 0.0, 6.0 / (3.0 * cluster.strength) ** 3
    return Places(s, s_x, s_xx, s_xxx)
