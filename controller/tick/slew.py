r"""How the path clock changes its rate: the one place where a hold or an override becomes motion.

The plan gives joints q(tau) over plan time; the clock runs tau' = r <= 1. Then

    q'  = q_tau r
    q'' = q_tau r' + q_tautau r^2
    q'''= q_tau r'' + 3 q_tautau r r' + q_tautautau r^3

A constant rate is always safe, since the plan holds at r = 1 and everything shrinks
with r. A changing rate has two questions to answer, and they are answered apart:

* *Where does this go?* (``_slope_cap``, ``_approach``) The path ahead is sampled on a coarse
  grid, a few points per tick and only while the rate changes. From its derivatives come
  the largest r'' and r' that leave every joint room, now and until the end of the slew.
* *Is this very step right?* (``_fit``) The joints of two candidate steps are computed exactly;
  between them every joint is linear to second order, so the limits on the first, second
  and third difference of the commanded joints become intervals of one number. Velocity
  and acceleration bind; jerk gives way where both cannot be had.

```
 rate 1 ------.                          r' grows with r''max, is capped by the room that
               \                         the joints' accelerations leave, and falls so that
                \______ target           it reaches zero exactly at the target
```
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from controller.machine import Joints, Limits
from controller.motions import Rotaries

Derivatives = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
Evaluate = Callable[[float, Rotaries], Joints | None]

GRID_S = 0.006  # finer than any acceleration ramp of a machine worth the name
AHEAD_POINTS = 24  # the path sampled ahead: 144 ms, as long as a stop from full speed takes
SAMPLES_PER_TICK = 5
ACCELERATION_SHARE = 0.999  # of the limit, in the exact check of a step
ROOM_SHARE = 0.98  # of the acceleration, in the look ahead: the grid rounds peaks off
JERK_SHARE = 0.68  # of the jerk, for q_tau r'' ...
CROSS_SHARE = 0.28  # ... and for 3 q_tautau r r', where it adds to the levelling out
LEVEL_SHARE = 0.95  # of the jerk, for the last levelling out to rest
LEAST_STEP = 1e-5  # of the rate, in the first tick of a slew, where the plan leaves no room for more
FEWEST_TICKS = 5  # to the steepest slope: where the rate halves in a tick, derivatives say nothing
LEAST_SHARE = 0.1  # of the jerk is taken for the levelling out even where the plan uses all of it
STILL = 1e-12  # mm or rad: no motion


class Slew:
    """Chooses the rate of the path clock, tick by tick, on its way to a target."""

    def __init__(
        self, limits: Sequence[Limits], period_s: float, rotary: tuple[int, int], evaluate: Evaluate
    ) -> None:
        self._period_s = period_s
        self._evaluate = evaluate
        self._rotary = rotary
        self._most_bend = (FEWEST_TICKS * period_s) ** -2
        self._grid_s = max(GRID_S, 2.0 * period_s)
        # Largest differences of the commanded joints between ticks: first, second, third.
        self._first = tuple(x.velocity * period_s for x in limits)
        self._second = tuple(x.acceleration * period_s**2 * ACCELERATION_SHARE for x in limits)
        self._third = tuple(x.jerk * period_s**3 for x in limits)
        self._room = tuple(x.acceleration * ROOM_SHARE for x in limits)
        self._jerk = tuple(x.jerk for x in limits)
        self._cell = 0  # grid index of the first sample
        self._samples: list[Joints] = []
        # First, second and third derivative by tau at sample 1, 2, ...
        self._slopes: list[Derivatives] = []
        self.slope = 0.0  # r' of the last step, per second

    def forget(self) -> None:
        """The path ahead has changed, or the slew is over."""
        self._samples.clear()
        self._slopes.clear()

    def step(
        self, tau: float, rate: float, target: float, history: tuple[Joints, Joints, Joints]
    ) -> tuple[float, Joints | None]:
        """(rate, joints) of the next tick; joints None where the branch is lost."""
        jump = self._jump(tau, target, history)
        if jump is not None:
            self.slope = 0.0
            return target, jump
        self._look_ahead(tau, self._rotaries(history[0]))
        new, joints = self._choose(tau, rate, target, history)
        self.slope = (new - rate) / self._period_s
        return new, joints

    def _rotaries(self, q: Joints) -> Rotaries:
        return q[self._rotary[0]], q[self._rotary[1]]

    # -- straight to the target, where the joints allow it (at rest, or nearly)

    def _jump(self, tau: float, target: float, history: tuple[Joints, Joints, Joints]) -> Joints | None:
        """The next joints if the target rate can be had from this very tick on."""
        q0, q1, _ = history
        if target == 0.0:
            return q0 if self._within((q0, q0, q0), history) else None
        for i, a, b in zip(range(5), q0, q1, strict=True):
            if abs(a - b) > self._third[i]:
                return None  # moving: a jump of the rate would be one of speed
        ahead: list[Joints] = []
        near = self._rotaries(q0)
        for k in (1, 2, 3):
            q = self._evaluate(tau + k * target * self._period_s, near)
            if q is None:
                return None
            ahead.append(q)
            near = self._rotaries(q)
        return ahead[0] if self._within((ahead[0], ahead[1], ahead[2]), history) else None

    def _within(self, ahead: tuple[Joints, Joints, Joints], history: tuple[Joints, Joints, Joints]) -> bool:
        row = (history[2], history[1], history[0], *ahead)
        for i in range(5):
            second, third = self._second[i], self._third[i] * 1.01
            for k in range(2, 5):
                a, b, c, d = row[k - 2][i], row[k - 1][i], row[k][i], row[k + 1][i]
                if abs(d - 2.0 * c + b) > second or abs(d - 3.0 * c + 3.0 * b - a) > third:
                    return False
        return True

    # -- the path ahead

    def _look_ahead(self, tau: float, near: Rotaries) -> None:
        """Extends the samples by a few points and drops those that lie behind."""
        cell = int(tau / self._grid_s) - 1  # the derivatives begin at or just behind the clock
        if self._samples and cell > self._cell:
            behind = min(cell - self._cell, len(self._samples))
            del self._samples[:behind], self._slopes[: min(behind, len(self._slopes))]
        self._cell = cell
        for _ in range(SAMPLES_PER_TICK):
            if len(self._samples) > AHEAD_POINTS:
                return
            at = self._rotaries(self._samples[-1]) if self._samples else near
            q = self._evaluate((cell + len(self._samples)) * self._grid_s, at)
            if q is None:
                return
            self._samples.append(q)
            if len(self._samples) >= 3:
                self._slopes.append(self._derivatives())

    def _derivatives(self) -> Derivatives:
        """By central differences, at the last sample but one."""
        samples = self._samples
        o = samples[-4] if len(samples) > 3 else None
        a, b, c = samples[-3:]
        first, second, third = 0.5 / self._grid_s, self._grid_s**-2, self._grid_s**-3
        rate = tuple((z - x) * first for x, z in zip(a, c, strict=True))
        bend = tuple((z - 2.0 * y + x) * second for x, y, z in zip(a, b, c, strict=True))
        if o is None:
            return rate, bend, (0.0,) * 5
        kink = tuple((z - 3.0 * (y - x) - w) * third for w, x, y, z in zip(o, a, b, c, strict=True))
        return rate, bend, kink

    def _bends(self, target: float, sign: float) -> tuple[float, float]:
        """Largest r'' (1/s^2) that the joints' jerks allow anywhere ahead: to build r' up, to level out.

        Levelling out ends at the target, where the plan's own jerk counts target^3.
        """
        build = level = self._most_bend
        cube = sign * target**3
        for rates, _, kinks in self._slopes:
            for jerk, rate, kink in zip(self._jerk, rates, kinks, strict=True):
                speed = abs(rate)
                if speed > STILL:
                    free = JERK_SHARE * jerk
                    build = min(build, free / speed)
                    own = -kink * cube if rate > 0.0 else kink * cube
                    if own > 0.0:
                        free = max(free - own, LEAST_SHARE * jerk)
                    level = min(level, free / speed)
        return build, level

    def _slope_cap(self, tau: float, rate: float, sign: float, bend: float) -> float:
        """Largest abs(r') (1/s) that leaves every joint room, now and ahead.

        Room for acceleration; and for jerk, of which 3 q_tautau r r' takes its share where the
        plan slows a joint down (there it has the sign of the levelling out) and where the
        plan's own jerk has the same sign. A point further ahead counts less: until it is
        reached, r' can fall by r'' t.
        """
        cap = math.inf
        square = rate * rate
        ahead_s = (self._cell + 1) * self._grid_s - tau
        cube = square * rate
        for rates, bends, kinks in self._slopes:
            spare = bend * ahead_s if ahead_s > 0.0 else 0.0
            for room, jerk, q_tau, q_tautau, kink in zip(
                self._room, self._jerk, rates, bends, kinks, strict=True
            ):
                speed = abs(q_tau)
                if speed > STILL:
                    pull = q_tautau * square
                    left = room - (pull if q_tau * sign > 0.0 else -pull)
                    cap = min(cap, max(left, 0.0) / speed + spare)
                    own = kink * cube * (sign if q_tautau > 0.0 else -sign)
                    if q_tau * q_tautau < 0.0 or own > 0.0:
                        free = min(CROSS_SHARE * jerk, max(jerk - own, LEAST_SHARE * jerk))
                        cap = min(cap, free / (3.0 * abs(q_tautau) * max(rate, LEAST_SHARE) + STILL) + spare)
            ahead_s += self._grid_s
        return cap

    # -- the step

    def _approach(self, tau: float, rate: float, target: float, sign: float) -> tuple[float, float]:
        """(wanted change of the rate in this tick toward the target, change of that change)."""
        T = self._period_s
        build, level = self._bends(target, sign)
        left = abs(target - rate)
        if level * T * T >= left:
            return left, left
        step, down = build * T * T, level * T * T
        # d, d - down, d - 2 down ... sum up to d (d + down) / (2 down): what it takes to level out.
        level = 0.5 * (math.sqrt(down * down + 8.0 * down * left) - down)
        cap = max(self._slope_cap(tau, rate, sign, build) * T, 2.0 * step)
        return min(self.slope * sign * T + step, level, cap, left), step

    def _choose(
        self, tau: float, rate: float, target: float, history: tuple[Joints, Joints, Joints]
    ) -> tuple[float, Joints | None]:
        sign = 1.0 if target > rate else -1.0
        wanted, step = self._approach(tau, rate, target, sign)
        if abs(wanted) >= abs(target - rate) * (1.0 - 1e-9):
            wanted = abs(target - rate)
        span = max(abs(wanted), step)
        other = min(max(rate + sign * span, 0.0), 1.0)
        span = abs(other - rate)
        near = self._rotaries(history[0])
        steady = self._evaluate(tau + rate * self._period_s, near)
        moved = self._evaluate(tau + other * self._period_s, near)
        if steady is None or moved is None or span == 0.0:
            return other, moved
        share = wanted / span
        if target == 0.0:
            least = LEAST_STEP / span if rate == 1.0 else 0.0
            share = min(share, max(self._levelling(steady, moved, history), least))
        share = self._fit(share, sign * self.slope * self._period_s / span, steady, moved, history)
        if share == 1.0:
            return other, moved
        new = min(max(rate + share * (other - rate), 0.0), 1.0)
        return new, self._evaluate(tau + new * self._period_s, near)

    def _levelling(self, steady: Joints, moved: Joints, history: tuple[Joints, Joints, Joints]) -> float:
        """Largest share of the way to ``moved`` from which the joints can still level out to rest.

        Near a standstill of the plan the derivatives change faster than the grid sees. The
        joint that needs its jerk most is looked at itself: slowing by s per tick it needs
        s + (s - j) + (s - 2j) ... = s (s + j) / (2 j) of speed, j being the jerk's third difference.
        """
        q0, q1, _ = history
        i = max(range(5), key=lambda k: abs(q0[k] - q1[k]) / self._third[k])
        gain, speed, j = moved[i] - steady[i], q0[i] - q1[i], LEVEL_SHARE * self._third[i]
        most = 0.5 * (math.sqrt(j * j + 8.0 * j * abs(speed)) - j)
        if speed < 0.0:
            gain = -gain
        if gain > -STILL:
            return math.inf  # this joint is not slowed down by the clock
        slowing = (speed - (steady[i] - q0[i])) * (1.0 if speed > 0.0 else -1.0)
        return (most - slowing) / -gain

    def _fit(
        self,
        wanted: float,
        last: float,
        steady: Joints,
        moved: Joints,
        history: tuple[Joints, Joints, Joints],
    ) -> float:
        """The share of the way from ``steady`` to ``moved`` nearest ``wanted`` that the limits allow.

        For the sake of jerk alone the slope never grows beyond the ``last`` one: where the plan
        bends, more slope asks for more jerk, and that would run away.
        """
        low, high = -math.inf, math.inf  # velocity and acceleration
        soft_low, soft_high = -math.inf, math.inf  # jerk
        for i in range(5):
            gain = moved[i] - steady[i]
            if abs(gain) <= STILL:
                continue
            q0, q1, q2 = history[0][i], history[1][i], history[2][i]
            first = steady[i] - q0
            second = first - (q0 - q1)
            third = second - (q0 - 2.0 * q1 + q2)
            for value, bound in ((first, self._first[i]), (second, self._second[i])):
                a, b = (-bound - value) / gain, (bound - value) / gain
                low, high = max(low, min(a, b)), min(high, max(a, b))
            a, b = (-self._third[i] - third) / gain, (self._third[i] - third) / gain
            soft_low, soft_high = max(soft_low, min(a, b)), min(soft_high, max(a, b))
        if soft_low <= soft_high:
            wanted = min(max(wanted, soft_low), soft_high, max(wanted, last))
        if low <= high:
            return min(max(wanted, low), high)
        return min(max(0.0, high), low)  # a constant rate, as near as rounding lets it
