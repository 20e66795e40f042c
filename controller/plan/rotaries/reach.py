"""The limit of what the rotaries reach: where a tool axis comes to it, they would have to turn at once.

Rotaries that are not square to each other, as of a nutating head, tilt the tool so far and no further.
At that limit both branches are one and the rates of both rotaries are without end; beside it the one
branch leads back from it and the other one over it, so that a cut which touches it would have to jump.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from controller.machine.kinematics import Kinematics
from controller.motion.motions import SurfaceCut

Array = npt.NDArray[np.float64]

LIMIT = 5e-3  # sine that goes like the root of the tilt that is left: 1e-3 degrees and a bit
ZOOMS, ZOOM_POINTS, CLOSER = 6, 41, 0.1


def at_limit(cut: SurfaceCut, u: Array, kinematics: Kinematics) -> float | None:
    """The u where the axis of a cut comes nearest to the limit, if it is that near; ``u`` (N,): samples."""
    if not kinematics.is_bounded:
        return None
    off = _off(cut, u, kinematics)
    padded = np.concatenate(([np.inf], off, [np.inf]))
    dips = np.flatnonzero((off <= padded[:-2]) & (off <= padded[2:]))
    found = [_lowest(cut, float(u[i]), kinematics) for i in dips[np.argsort(off[dips])][:4]]
    least, where = min(found, default=(np.inf, 0.0))
    return where if least < LIMIT else None


def _lowest(cut: SurfaceCut, u: float, kinematics: Kinematics) -> tuple[float, float]:
    """(value, u) of the dip about ``u``."""
    half, best = 1.0 / 64.0, np.inf
    for _ in range(ZOOMS):
        near = np.clip(np.linspace(u - half, u + half, ZOOM_POINTS), 0.0, 1.0)
        off = _off(cut, near, kinematics)
        i = int(np.argmin(off))
        best, u, half = float(off[i]), float(near[i]), CLOSER * half
    return best, u


def _off(cut: SurfaceCut, u: Array, kinematics: Kinematics) -> Array:
    x, y, z = cut.part.turn(cut.surface.axis(u, np))
    return np.asarray(np.broadcast_to(kinematics.off_limit((x, y, z)), u.shape))
