"""The servo and motor of a simulated drive: a second-order lag, solved exactly per period.

Between two SYNCs the drive interpolates its demand linearly from one setpoint to the
next (60C2h), and position x follows demand r as

    x'' = w^2 (r - x) + 2 d w (f r' - x')        w natural frequency, d damping,
                                                 f share of velocity feed-forward

For a linear demand r = r0 + v t the solution is  x = r - lag v + (decaying part),
lag = 2 d (1 - f) / w, and the decaying part is one constant 2 x 2 matrix per period.
A velocity v' that the controller sends (60B1h) leads: x = r - lag v + 2 d v' / w,
and so does a torque (60B2h) that would accelerate by a': x = r - lag v + a' / w^2.

Why 60 Hz and d = 1/sqrt(2): position loops of machine-tool servos reach some 40 to
80 Hz. Equal lags on all axes only delay a path, they bend it from the second order
on: to x(t) = r(t - lag) + (2 d^2 - 1)/w^2 r'' + ..., a term that vanishes at
d = 1/sqrt(2) (the maximally flat response) and would be 7 um per 1000 mm/s^2 at
d = 1. What is left, sqrt(2)/3 r'''/w^3, is below 1 um at 50000 mm/s^3.

The same law is a cascade, a speed that the position asks for and an acceleration that the
speed asks for, and a motor gives only so much of either (``limit``):

    v* = w/2d (r - x) + f r'        within the speed limit
    x'' = 2 d w (v* - x')           within the torque

A period in which the law stays within both is the closed form, to the last bit. One in which
it does not is integrated in the short steps of a drive's controller, where v* keeps to what
can still be braked, as a position controller that knows its own limits does.
"""

from __future__ import annotations

import math

NATURAL_FREQUENCY_HZ = 60.0
DAMPING = math.sqrt(0.5)
STEP_S = 125e-6  # of the position controller; 8 kHz is usual
BRAKING_SHARE = 0.8  # of the torque that a saturated controller plans its braking with


class Servo:
    """Position and velocity (counts, counts/s) of one motor; ``step`` moves it by one period."""

    __slots__ = (
        "_a11",
        "_a12",
        "_a21",
        "_a22",
        "_bend_s2",
        "_calm",
        "_fastest",
        "_jammed",
        "_lag_s",
        "_lead_s",
        "_near",
        "_per_s",
        "_reach",
        "_share",
        "_strongest",
        "end",
        "lead",
        "limited",
        "position",
        "start",
        "velocity",
    )

    def __init__(self, position: float = 0.0) -> None:
        self.position = position
        self.velocity = 0.0
        self.start = position  # demand now ...
        self.end = position  # ... and at the end of the period that runs
        self.lead = 0.0  # counts by which offsets of velocity and torque lead
        self.limited = False  # in the last period the law asked for more than the motor gives
        self._strongest = self._fastest = math.inf
        self._share = 1.0  # of the torque that is there
        self._jammed = False
        self._bend_s2 = self._lead_s = 1.0
        self._a12 = self._a22 = 0.0
        self._reckon()

    def tune(self, period_s: float, frequency_hz: float, damping: float, feed_forward: float) -> None:
        """Precompute a period. Raises ValueError for a damping outside of 0 < d < 1."""
        if not 0.0 < damping < 1.0:
            raise ValueError(f"damping is {damping}; allowed is 0 < damping < 1")
        w = 2.0 * math.pi * frequency_hz
        decay, swing = damping * w, w * math.sqrt(1.0 - damping * damping)
        gain = math.exp(-decay * period_s)
        cos, sin = math.cos(swing * period_s), math.sin(swing * period_s)
        self._a11 = gain * (cos + decay / swing * sin)
        self._a12 = gain * sin / swing
        self._a21 = -gain * w * w / swing * sin
        self._a22 = gain * (cos - decay / swing * sin)
        self._lead_s = 2.0 * damping / w
        self._bend_s2 = 1.0 / (w * w)
        self._lag_s = self._lead_s * (1.0 - feed_forward)
        self._per_s = 1.0 / period_s
        self._reckon()

    def limit(self, strongest: float, fastest: float) -> None:
        """What the motor gives at most: counts/s^2 either way, counts/s. Infinite = no limit."""
        self._strongest, self._fastest = strongest, fastest
        self._reckon()

    def weaken(self, share: float) -> None:
        """So much of the torque is there, 0 < share <= 1."""
        self._share = share
        self._reckon()

    def jam(self, jammed: bool) -> None:
        """Stuck: it stops hard where it is, and no torque moves it."""
        self._jammed = jammed
        if jammed:
            self.velocity = 0.0
        self._reckon()

    def _reckon(self) -> None:
        """How far the law may lean, in counts, before it asks for more torque than there is."""
        self._reach = -1.0 if self._jammed else self.strongest * self._bend_s2
        # Counts/s that the law takes out where the demand stands, within what there is; they only decay.
        held_s = self._lead_s + abs(self._a12) + self._lead_s * abs(self._a22)
        self._calm = min(self._reach / held_s, self._fastest) if self._reach > 0.0 else -1.0
        self._near = BRAKING_SHARE * self.strongest * self._lead_s**2  # where the law can still be braked

    @property
    def state(self) -> tuple[float, ...]:
        """What the next period depends on, of this law: other motors remember more."""
        return (self.position, self.velocity, self.start, self.end, self.lead, self.limited, self._calm)

    @property
    def strongest(self) -> float:
        """Acceleration that the motor can give now, counts/s^2."""
        return self._strongest * self._share

    def step(self, next_end: float) -> None:
        """Follow the running period's demand to its end; the next one leads to ``next_end``."""
        start, end = self.start, self.end
        if start == end == self.position and -self._calm <= self.velocity <= self._calm and not self.lead:
            # An axis at rest: as below, to the last bit, with nothing to do but for its own velocity.
            self.position = end + self._a12 * self.velocity
            self.velocity *= self._a22
            self.limited = False
            self.end = next_end
            return
        speed = (end - start) * self._per_s
        behind = self._lag_s * speed - self.lead
        offset = self.position - start + behind
        slip = self.velocity - speed
        velocity = speed + self._a21 * offset + self._a22 * slip
        left = self._a11 * offset + self._a12 * slip
        reach, fastest, lead_s = self._reach, self._fastest, self._lead_s
        if (
            -reach <= offset + lead_s * slip <= reach
            and -reach <= left + lead_s * (velocity - speed) <= reach
            and -fastest <= velocity <= fastest
            and not (self.limited and abs(offset) > self._near)
        ):
            self.position = end - behind + self._a11 * offset + self._a12 * slip
            self.velocity = velocity
            self.limited = False
        else:
            self.limited = True
            self._saturate(start, speed)
        self.start = end
        self.end = next_end

    def _saturate(self, start: float, speed: float) -> None:
        """A period of a motor at its limits: the demand goes from ``start`` at ``speed``."""
        if self._jammed:
            self.velocity = 0.0
            return
        parts = max(1, round(1.0 / (self._per_s * STEP_S)))
        h = 1.0 / (self._per_s * parts)
        for part in range(parts):
            self._push(start + speed * h * (part + 0.5), speed, h)

    def _push(self, demand: float, speed: float, h: float) -> None:
        self.velocity += self._given(demand, speed) * h
        self.position += self.velocity * h

    def _given(self, demand: float, speed: float) -> float:
        """The acceleration of the cascade within its limits, counts/s^2."""
        strongest, fastest = self.strongest, self._fastest
        error = demand - self.position - self._lag_s * speed + self.lead
        closing = error / self._lead_s
        if self.limited and abs(error) > self._near:
            most = 2.0 * BRAKING_SHARE * strongest
            closing = math.copysign(math.sqrt(most * (abs(error) - 0.5 * self._near)), error)
        wanted = max(-fastest, min(fastest, speed + closing))
        asked = (wanted - self.velocity) * self._lead_s / self._bend_s2
        return max(-strongest, min(strongest, asked))

    @property
    def shaft(self) -> float:
        """Where the motor truly is, in the present counting."""
        return self.position

    def take_up(self) -> None:
        """The demand moves as the motor does: what a stop begins from when setpoints have failed."""
        self.start = self.position + self._lag_s * self.velocity - self.lead
        self.end = self.start + self.velocity / self._per_s

    def anchor(self) -> None:
        """Let go of a demand that has run away further than the torque answers to (velocity modes)."""
        step = self.end - self.start
        most = abs(step) * (1.0 + self._lag_s * self._per_s) + max(0.0, self._reach)
        ahead = self.end - self.position
        if abs(ahead) > most:
            back = math.copysign(most, ahead) - ahead
            self.start += back
            self.end += back

    @property
    def acceleration(self) -> float:
        """What the law asks of the motor now, counts/s^2."""
        speed = (self.end - self.start) * self._per_s
        behind = self.position - self.start + self._lag_s * speed - self.lead
        return -(behind + self._lead_s * (self.velocity - speed)) / self._bend_s2

    def offset(self, counts_s: float, counts_s2: float) -> None:
        """Velocity offset (60B1h) and the acceleration that a torque offset (60B2h) stands for."""
        self.lead = counts_s * self._lead_s + counts_s2 * self._bend_s2

    @property
    def jammed(self) -> bool:
        return self._jammed

    def rest(self) -> None:
        """Stand still where the motor is: power off, brake on."""
        self.velocity = self.lead = 0.0
        self.start = self.end = self.position

    def shift(self, counts: float) -> None:
        """Move the origin of the counting, not the motor (homing)."""
        self.position += counts
        self.start += counts
        self.end += counts

    def drop(self, acceleration: float, taken_s: float) -> None:
        """Fall freely for a while; the demand goes along."""
        self.position += self.velocity * taken_s + 0.5 * acceleration * taken_s * taken_s
        self.velocity += acceleration * taken_s
        self.start = self.end = self.position
