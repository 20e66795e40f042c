"""How fast a boundary between two motions may be passed at which the joints' rates jump.

What is told of many boundaries at once: arrays are (N,) or (N, axes).
"""

from __future__ import annotations

import numpy as np

from controller.geometry.arrays import Array

MARGIN = 0.998  # of each limit, for what differences on nodes do not see

# A jump of the joints' rates is spread over one tick. It may use this share of each
# limit, the motion law around it the rest.
JUMP_SHARE = 0.8

# Of the share of jerk that a junction may use, what the jump of rates may: the rest is
# for the jump of acceleration that comes with it.
RATE_SHARE = 0.7

CHANGES = 3.0  # times j T^2: so fast, a speed changes by an eighteenth of itself in the tick of a jump
STOP_SHARE = 0.03  # a junction that must be passed slower than this share of what it could be is a stop

# A jump of acceleration, sampled, is spread over three ticks by the quadratic B-spline,
# whose largest value is 3/4 per period.
SPREAD = 0.75


def passed(rate: Array, curve: Array, acceleration: Array, jerk: Array, period_s: float) -> Array:
    """Speed at which jumps of q' and q'' (N, axes), both absolute, may be passed.

    A jump of q' is a step of velocity: in samples dq'v/T of acceleration and dq'v/T^2 of
    jerk. A jump of q'' is a step of acceleration: 3/4 dq''v^2/T of jerk.
    """
    step = np.minimum(acceleration * period_s, jerk * period_s * period_s) * JUMP_SHARE
    rate = rate / step
    curve = SPREAD * curve / (JUMP_SHARE * jerk * period_s)
    both = 2.0 / (rate + np.sqrt(rate * rate + 4.0 * curve) + 1e-30)  # rate v + curve v^2 = 1
    return np.asarray(np.minimum(both.min(axis=-1), (RATE_SHARE / (rate + 1e-30)).min(axis=-1)))


def least(rates: Array, jerk: Array, period_s: float) -> Array:
    """What a boundary is passed at, or it is a stop, by the absolute ``rates`` on one side of it.

    A jump of rates is spread over a tick, in which the speed changes by j T^2 / 6: where that is much
    beside the speed, no bound on the speed at the boundary itself keeps the jerk of that tick.
    """
    return np.asarray(CHANGES * (jerk / (rates + 1e-30)).min(axis=-1) * period_s**2)


def reached(rates: Array, length: Array, acceleration: Array, jerk: Array) -> Array:
    """What a start from rest reaches over ``length`` at the absolute ``rates`` of the joints."""
    most = (acceleration / (rates + 1e-30)).min(axis=-1)
    still = (jerk / (rates + 1e-30)).min(axis=-1)
    return np.asarray(np.minimum(np.sqrt(2.0 * most * length), np.cbrt(4.5 * still * length * length)))
