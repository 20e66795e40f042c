"""Vectors of samples as tables: what a formula gives as components, some of them numbers, in one array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def columns(values: Sequence[Any], n: int) -> Array:
    """(n, k) of k values, each an array (n,) or a number. Raises ValueError for another shape."""
    table = np.empty((n, len(values)))
    for k, value in enumerate(values):
        table[:, k] = value
    return table


def rows(values: Sequence[Any], shape: tuple[int, ...]) -> Array:
    """(k, *shape) of k values, each an array of that shape or a number. Raises ValueError for another one."""
    table = np.empty((len(values), *shape))
    for k, value in enumerate(values):
        table[k] = value
    return table


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """(m,) the different ones, ascending, of an array of any shape without a nan.

    As ``np.unique`` has them, which imports masked arrays, and looks at ten options, in thrice the time.
    """
    ordered = np.sort(values, axis=None)
    new = np.ones(len(ordered), dtype=np.bool_)
    np.not_equal(ordered[1:], ordered[:-1], out=new[1:])
    return ordered[new]


def within(places: Array, at: float, reach: float) -> slice:
    """Of ascending places those no further than ``reach`` from ``at``, and maybe one more on either side."""
    first, last = np.searchsorted(places, (at - reach, at + reach))
    return slice(max(int(first) - 1, 0), int(last) + 1)


def cross(a: Array, b: Array) -> Array:
    """(N, 3) of two of them; as ``np.cross``, which on a few rows takes most of its time to look at them."""
    found = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return found
