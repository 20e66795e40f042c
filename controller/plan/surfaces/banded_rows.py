"""Equations of which each has unknowns next to each other: sums of squares, and the least largest residual.

Row i has the coefficients ``values[i]`` at the unknowns from ``first[i]`` on. What is made of them is solved
block by block, in products so small that the library for them takes one thread: several would wait for each
other on a busy computer a hundred times as long, and round otherwise on another number of cores.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags

Index = npt.NDArray[np.intp]

SLAB = 64  # rows of one product of matrices
STEPS = 40  # of the interior point, at most
GAP = 1e-3  # of the largest residual, within which it is the least
CENTRED = 0.15  # share of the complementarity that a step aims at
TO_EDGE = 0.95  # share of the way to the edge of what is allowed that a step goes


@dataclass(frozen=True, slots=True, eq=False)
class Banded:
    """A symmetric matrix of blocks (M, b, 2 b): each on the diagonal, and the one to its right."""

    blocks: Array
    count: int  # of unknowns; the last block may have more

    def __add__(self, other: Banded) -> Banded:
        return Banded(self.blocks + other.blocks, self.count)

    def scaled(self, by: float, more: float = 0.0) -> Banded:
        """``by`` times this, and ``more`` on the diagonal."""
        blocks, wide = by * self.blocks, self.blocks.shape[1]
        blocks[:, np.arange(wide), np.arange(wide)] += more
        return Banded(blocks, self.count)

    def times(self, x: Array) -> Array:
        """(count,)"""
        wide = self.blocks.shape[1]
        parts = self._filled(x)
        found = np.einsum("mij,mj->mi", self.blocks[:, :, :wide], parts)
        found[:-1] += np.einsum("mij,mj->mi", self.blocks[:-1, :, wide:], parts[1:])
        found[1:] += np.einsum("mij,mi->mj", self.blocks[:-1, :, wide:], parts[:-1])
        return np.asarray(found.ravel()[: self.count])

    def solve(self, right: Array) -> Array:
        """x (count, k) with this matrix times x = ``right``. Raises LinAlgError where there is none."""
        wide = self.blocks.shape[1]
        parts = self._filled(right)
        own, beside = self.blocks[:, :, :wide].copy(), self.blocks[:, :, wide:]
        _pad(own, self.count)
        eliminated: list[Array] = []
        for k in range(len(own) - 1):
            solved = np.linalg.solve(own[k], beside[k])
            own[k + 1] -= beside[k].T @ solved
            parts[k + 1] -= solved.T @ parts[k]
            eliminated.append(solved)
        parts[-1] = np.linalg.solve(own[-1], parts[-1])
        for k in range(len(own) - 2, -1, -1):
            parts[k] = np.linalg.solve(own[k], parts[k]) - eliminated[k] @ parts[k + 1]
        return np.asarray(parts.reshape(-1, *right.shape[1:])[: self.count])

    def _filled(self, x: Array) -> Array:
        """x in parts of a block each, the last one filled up with zeros."""
        made = np.zeros((self.blocks.shape[0] * self.blocks.shape[1], *x.shape[1:]))
        made[: self.count] = x
        return made.reshape(*self.blocks.shape[:2], *x.shape[1:])


def _pad(own: Array, count: int) -> None:
    """Ones on the diagonal behind the last unknown."""
    more = np.arange(count - (len(own) - 1) * own.shape[1], own.shape[1])
    own[-1, more, more] = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """N rows over ``count`` unknowns."""

    values: Array  # (N, width)
    first: Index  # (N,)
    count: int
    order: Index  # of the rows in the slabs; N where a slab has none
    slabs: Array  # (K, SLAB, width)
    starts: Index  # (K,)

    @staticmethod
    def of(values: Array, first: Index, count: int) -> Rows:
        n, ordered = len(values), np.argsort(first, kind="stable")
        begins = np.flatnonzero(np.concatenate(([True], first[ordered][1:] != first[ordered][:-1])))
        sizes = np.concatenate((begins[1:], [n])) - begins
        in_group = np.arange(n) - np.repeat(begins, sizes)
        needed = -(-sizes // SLAB)
        slab = np.repeat(np.cumsum(needed) - needed, sizes) + in_group // SLAB
        order = np.full((int(needed.sum()), SLAB), n)
        order[slab, in_group % SLAB] = ordered
        slabs = np.vstack((values, np.zeros((1, values.shape[1]))))[order]
        return Rows(values, first, count, order, slabs, np.repeat(first[ordered[begins]], needed))

    def scaled(self, by: float) -> Rows:
        return Rows(by * self.values, self.first, self.count, self.order, by * self.slabs, self.starts)

    def times(self, x: Array) -> Array:
        """(N,)"""
        places = self.first[:, None] + np.arange(self.values.shape[1])
        return np.asarray((self.values * x[places]).sum(axis=1))

    def transposed(self, y: Array) -> Array:
        """Sums of the rows times ``y`` (N,): (count,)."""
        sums = np.einsum("ksw,ks->kw", self.slabs, self._of_slabs(y))
        places = self.starts[:, None] + np.arange(self.values.shape[1])
        return np.asarray(np.bincount(places.ravel(), sums.ravel(), self.count), dtype=float)

    def squares(self, weights: Array) -> Banded:
        """Sum of the products of each row with itself, weighted (N,)."""
        wide = self.values.shape[1]
        weighted = self.slabs * self._of_slabs(weights)[..., None]
        products = np.matmul(weighted.transpose(0, 2, 1), self.slabs)
        high = -(-self.count // wide)
        unknown = self.starts[:, None] + np.arange(wide)
        block, row = np.divmod(unknown, wide)
        column = unknown[:, None, :] - wide * block[:, :, None]
        places = ((block * wide + row) * 2 * wide)[:, :, None] + column
        above = column >= 0
        sums: Array = np.bincount(places[above], products[above], high * wide * 2 * wide).astype(float)
        return Banded(sums.reshape(high, wide, 2 * wide), self.count)

    def _of_slabs(self, y: Array) -> Array:
        return np.asarray(np.append(y, 0.0)[self.order])


def least_squares(rows: Rows, y: Array, both: Flags, price: Banded, pull: Array) -> Array:
    """The x that makes sum (y + rows x)^2 + x price x + 2 pull x least; raises LinAlgError where none does.

    Rows that are not of ``both`` signs count where y is negative.
    """
    weights = np.asarray(both | (y < 0.0), dtype=float)
    return (rows.squares(weights) + price).solve(-rows.transposed(weights * y) - pull)


def least_largest(rows: Rows, y: Array, both: Flags, price: Banded, pull: Array) -> Array:
    """The x that makes t + (x price x) / 2 + pull x least, where t is the largest of |y + rows x|.

    Of rows that are not of ``both`` signs only -(y + rows x) counts. A primal-dual interior point method:
    t - (y + rows x) and t + (y + rows x) stay positive, and so do their multipliers, whose products with
    them go to zero together.
    """
    signs = np.asarray(both, dtype=float)
    count = len(y) + float(signs.sum())
    x: Array = np.zeros(rows.count)
    t = 1.1 * float(np.abs(np.where(both, y, np.minimum(y, 0.0))).max()) + 1e-12
    above, below = np.where(both, t - y, 1.0), t + y
    up, down = signs / count, np.full(len(y), 1.0 / count)
    for _ in range(STEPS):
        gap = float(up @ above + down @ below)
        fixed = price.times(x) + pull
        rest = fixed + rows.transposed(up - down)
        if gap <= GAP * t and float(np.abs(rest).max()) <= GAP:
            break
        aim = CENTRED * gap / count
        by_up, by_down, aim_up, aim_down = up / above, down / below, signs * aim / above, aim / below
        side = rows.transposed(by_down - by_up)
        right = -fixed - rows.transposed(aim_up - aim_down)
        try:
            solved = (rows.squares(by_up + by_down) + price).solve(np.stack([right, side], axis=1))
        except np.linalg.LinAlgError:  # next to the least the weights of some rows are all that counts
            break
        need = float((aim_up + aim_down).sum()) - 1.0
        dt = float((need - side @ solved[:, 0]) / ((by_up + by_down).sum() - side @ solved[:, 1]))
        dx = solved[:, 0] - dt * solved[:, 1]
        moved = rows.times(dx)
        d_above, d_below = signs * (dt - moved), dt + moved
        d_up, d_down = aim_up - up - by_up * d_above, aim_down - down - by_down * d_below
        primal = _share(above, d_above, below, d_below)
        dual = _share(np.where(both, up, 1.0), d_up, down, d_down)
        x, t = x + primal * dx, float(t + primal * dt)
        above, below = above + primal * d_above, below + primal * d_below
        up, down = up + dual * d_up, down + dual * d_down
    return x


def _share(a: Array, da: Array, b: Array, db: Array) -> float:
    """Of a step, so that all values stay positive."""
    most = max(float((-da / a).max()), float((-db / b).max()))
    return min(1.0, TO_EDGE / most) if most > 0.0 else 1.0
