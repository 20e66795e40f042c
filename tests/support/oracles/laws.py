"""A motion law at any place of its pieces, by the polynomials as they are written down."""

from __future__ import annotations

import numpy as np

from controller.geometry.arrays import Array


def at_share(times: Array, pieces: Array, share: float) -> tuple[Array, Array, Array, Array]:
    """s, v, a and jerk at a share of every piece."""
    t = share * np.diff(times)
    c = pieces.T
    s = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
    v = c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5])))
    a = 2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5]))
    return s, v, a, 6 * c[3] + t * (24 * c[4] + t * 60 * c[5])
