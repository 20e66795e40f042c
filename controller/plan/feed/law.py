"""Motion laws as polynomials: the closed form between rests, and laws through planned nodes.

Rows of coefficients are c0 .. c5 of s(t) = sum c_k t^k, t from the start of the piece.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from controller.geometry.arrays import Array
from controller.ipc.handoff import Law, Quintic


def straight(length: float, velocity: float, acceleration: float, jerk: float) -> Law:
    """The fastest law over ``length`` from rest to rest with constant limits: up to seven phases.

          ______________
         /              \\          v
    ____/                \\____
    +j  0  -j     0     -j  0  +j   jerk
    """
    # Ramp to v: either the acceleration limit is met (a trapezoid of a) or not (a triangle).
    v = velocity
    if v * jerk < acceleration**2:
        ramp = math.sqrt(v / jerk) * 2.0
    else:
        ramp = v / acceleration + acceleration / jerk
    if v * ramp > length:
        v = _peak_speed(length, acceleration, jerk)
    t_j = math.sqrt(v / jerk) if v * jerk < acceleration**2 else acceleration / jerk
    t_a = max(0.0, v / (jerk * t_j) - t_j)
    t_v = max(0.0, length / v - (2.0 * t_j + t_a))
    phases = [(t_j, jerk), (t_a, 0.0), (t_j, -jerk), (t_v, 0.0), (t_j, -jerk), (t_a, 0.0), (t_j, jerk)]
    return _phases(length, phases)


def _peak_speed(length: float, a: float, j: float) -> float:
    """Speed reached when there is no room for an even part: v (2 t_j + t_a) = length."""
    v = math.cbrt((length * math.sqrt(j) / 2.0) ** 2)
    if v * j <= a * a:
        return v
    b = a * a / j
    return 0.5 * (math.sqrt(b * b + 4.0 * a * length) - b)


def _phases(length: float, phases: Sequence[tuple[float, float]]) -> Law:
    knots = [0.0]
    coefficients: list[Quintic] = []
    s = v = a = 0.0
    for t, j in phases:
        if t <= 0.0:
            continue
        coefficients.append((s, v, a / 2.0, j / 6.0, 0.0, 0.0))
        knots.append(knots[-1] + t)
        s, v, a = s + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j
    # Rounding of a few 1e-16: the last place must be the end itself.
    segment = length / s
    scaled = [
        (a * segment, b * segment, c * segment, d * segment, 0.0, 0.0) for a, b, c, d, _, _ in coefficients
    ]
    return Law(tuple(knots), tuple(scaled))


def through(s: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Times (2n + 1,) and coefficients (2n, 6) of the C2 law through s, v, a at n + 1 nodes.

    Between two nodes the jerk is j1 for half of the time and j2 for the other half; that
    and the duration 2h are just what s, v and a at the far node determine:

        ds = (v0 + v1) h - (a1 - a0) h^2 / 3
        j1 = (v1 - v0 - 2 a0 h - (a1 - a0) h / 2) / h^2,   j2 = (a1 - a0) / h - j1

    A polynomial through the same values would overshoot where the jerk changes sign.
    """
    ds, mean, da = np.diff(s), v[1:] + v[:-1], np.diff(a)
    h = 2.0 * ds / (mean + np.sqrt(np.maximum(mean * mean - 4.0 / 3.0 * da * ds, 0.0)))
    v0, a0 = v[:-1], a[:-1]
    j1 = (np.diff(v) - 2.0 * a0 * h - 0.5 * da * h) / h**2
    j2 = da / h - j1
    # An even piece is even to the last bit, not to rounding.
    even = (v0 == v[1:]) & (a0 == 0.0) & (a[1:] == 0.0)
    j1[even], j2[even] = 0.0, 0.0
    s1, v1, a1 = s[:-1] + h * (v0 + h * (a0 / 2 + h * j1 / 6)), v0 + h * (a0 + h * j1 / 2), a0 + h * j1
    none = np.zeros_like(h)
    first = np.stack([s[:-1], v0, 0.5 * a0, j1 / 6, none, none], axis=1)
    second = np.stack([s1, v1, 0.5 * a1, j2 / 6, none, none], axis=1)
    pieces = np.stack([first, second], axis=1).reshape(-1, 6)
    return np.concatenate([[0.0], np.cumsum(np.repeat(h, 2))]), pieces


def value(row: Any, t: Any) -> Any:
    """s of one piece at one time of it, or of many, (6, n), at (n,)."""
    return row[0] + t * (row[1] + t * (row[2] + t * (row[3] + t * (row[4] + t * row[5]))))


def time_of(row: Sequence[float], s: float, longest: float) -> float:
    """The time within a piece at which it passes ``s``; s grows, so bisection cannot fail."""
    low, high = 0.0, longest
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if value(row, middle) < s else (low, middle)
    return high


def shifted(row: Sequence[float], t: float, s: float) -> Quintic:
    """The same cubic with its clock ``t`` later and ``s`` taken off."""
    c0, c1, c2, c3, _, _ = row
    start = c0 + t * (c1 + t * (c2 + t * c3)) - s
    return (start, c1 + t * (2.0 * c2 + t * 3.0 * c3), c2 + 3.0 * t * c3, c3, 0.0, 0.0)


def joined(knots: Sequence[float], rows: Sequence[Quintic]) -> Law:
    """A law with neighbouring pieces of the same even speed made one."""
    kept_knots = [knots[0]]
    kept: list[Quintic] = []
    for i, row in enumerate(rows):
        last = kept[-1] if kept else None
        if last and row[1] == last[1] and not any(row[2:]) and not any(last[2:]):
            kept_knots[-1] = knots[i + 1]
            continue
        kept.append(row)
        kept_knots.append(knots[i + 1])
    return Law(tuple(kept_knots), tuple(kept))


def sampled(law: Law, per_piece: int = 8, even_step_s: float = 0.02) -> tuple[Array, Array, Array]:
    """Times, s and ds/dt at samples of a law: some per piece, and more on long pieces."""
    times = []
    for t0, t1 in itertools.pairwise(law.knots_s):
        n = max(per_piece, int((t1 - t0) / even_step_s))
        times.append(t0 + (t1 - t0) * np.arange(n) / n)
    t = np.concatenate([*times, [law.duration_s]])
    s, v, _, _ = along(law, t)
    return t, s, v


def along(law: Law, times: Array) -> tuple[Array, Array, Array, Array]:
    """s, ds/dt and the two further derivatives of a law of cubics at many times at once."""
    return along_each([law], [times])


def along_each(laws: Sequence[Law], times: Sequence[Array]) -> tuple[Array, Array, Array, Array]:
    """The same of many laws, each at its own ``times``, one after the other."""
    knots = np.array([t for law in laws for t in law.knots_s])
    index, first = [], 0
    for k, (law, of) in enumerate(zip(laws, times, strict=True)):
        last = first + len(law.coefficients) - 1
        inner = knots[first + k + 1 : last + k + 1]
        index.append(first + inner.searchsorted(of, side="right"))
        first = last + 1
    at = np.concatenate(index)
    begins = np.array([t for law in laws for t in law.knots_s[:-1]])
    row = np.array([c for law in laws for c in law.coefficients])[at].T
    x = np.concatenate(times) - begins[at]
    s = row[0] + x * (row[1] + x * (row[2] + x * row[3]))
    v = row[1] + x * (2 * row[2] + x * 3 * row[3])
    return s, v, 2 * row[2] + x * 6 * row[3], 6 * row[3]


def split(times: Array, pieces: Array, starts: Array, zeros: Array) -> list[Law]:
    """A law over several segments, (n + 1,) and (n, 6), as one law per segment with its own s.

    ``starts`` are the places where segments begin, and the end of the last, ``zeros`` those at which
    they have s = 0. Laws are given from the segment on in which the first piece begins.
    """
    laws, knots, rows, base, i = list[Law](), [0.0], list[Quintic](), 0.0, 0
    last, begin, zero = len(starts) - 2, starts.tolist(), zeros.tolist()
    k = int(np.clip(np.searchsorted(starts, pieces[0][0], side="right") - 1, 0, last))
    ends = value(pieces.T, np.diff(times))
    while i < len(pieces):
        # As they are as far as they lie in the segment, then the one that goes on into the next.
        upto = len(pieces) if k == last else i + int(np.searchsorted(ends[i:], begin[k + 1], side="right"))
        whole = pieces[i:upto] * (1.0, 1.0, 1.0, 1.0, 0.0, 0.0)
        whole[:, 0] -= zero[k]
        rows += map(tuple, whole.tolist())
        knots += (times[i + 1 : upto + 1] - base).tolist()
        i = upto + 1
        if upto < len(pieces):
            row, (t0, t1) = pieces[upto].tolist(), times[upto : upto + 2].tolist()
            while k < last and value(row, t1 - t0) > begin[k + 1]:
                cut = time_of(row, begin[k + 1], t1 - t0)
                if cut > 0.0:
                    rows.append(shifted(row, 0.0, zero[k]))
                    knots.append(t0 + cut - base)
                laws.append(joined(knots, rows))
                row, t0 = shifted(row, cut, 0.0), t0 + cut
                k, base, knots, rows = k + 1, t0, [0.0], []
            rows.append(shifted(row, 0.0, zero[k]))
            knots.append(t1 - base)
    laws.append(joined(knots, rows))
    return laws
