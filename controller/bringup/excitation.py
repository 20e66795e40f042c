"""What an axis is moved by to see how it answers: programs of strokes about the place where it stands.

They are part programs as any other, planned within the limits of the machine file: no second way leads to a
drive. With a limited jerk J a stroke d of the duration T that reaches neither the largest acceleration A nor
the speed V is four ramps of T/4, so d = J T^3 / 32, and strokes there and back are nearly a sine of the
frequency 1 / 2T (its third harmonic is 1/81 of it). A chirp is a row of them that get shorter. Nothing more
is asked of it: the response is taken from the setpoints as they were sent (``response``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from controller.machine.model import Axis

SHARES = (0.1, 0.3, 1.0)  # of the largest speed, one after another
LOWEST_HZ = 1.0
HIGHEST_TICKS = 4.0  # of a period of the fastest strokes
STROKES = 60  # pairs of a chirp
SINE_HZ, SINE_PERIODS = 2.0, 4
REST_S = 0.4  # after each part, so that what is left of it can die away
STEADY_S = 0.2  # of a ramp at its speed
MOST_SHARE = 0.2  # of the travel that a ramp may take
LEAST_STROKE_SHARE = 0.05  # of that room, which must be there
KINDS = ("step", "ramp", "sine", "chirp")


@dataclass(frozen=True, slots=True)
class Shown:
    """The limits of an axis as a program says them: mm or degrees, and seconds."""

    name: str
    velocity: float
    acceleration: float
    jerk: float
    travel: tuple[float, float]
    unit: str

    @classmethod
    def of(cls, axis: Axis) -> Shown:
        per = abs(axis.shown_per_unit)
        ends = sorted((axis.travel_min * axis.shown_per_unit, axis.travel_max * axis.shown_per_unit))
        limits = axis.limits
        return cls(
            axis.name,
            limits.velocity * per,
            limits.acceleration * per,
            limits.jerk * per,
            (ends[0], ends[1]),
            "deg" if axis.is_rotary else "mm",
        )

    def stroke(self, duration_s: float, speed: float) -> float:
        """The longest way from rest to rest in so long, at a speed at most."""
        by_jerk = self.jerk * duration_s**3 / 32.0
        by_acceleration = self.acceleration * duration_s**2 / 4.0
        return min(by_jerk, by_acceleration, speed * duration_s / 2.0)

    def ramp(self, speed: float) -> float:
        """The way that reaches a speed, keeps it for ``STEADY_S``, and comes to rest."""
        return speed * (speed / self.acceleration + self.acceleration / self.jerk + STEADY_S)

    @property
    def words(self) -> str:
        """The unit as texts have it."""
        return "mm" if self.unit == "mm" else "degrees"

    @property
    def step(self) -> float:
        """The shortest way on which the largest acceleration is reached."""
        return 2.0 * self.acceleration**3 / self.jerk**2


@dataclass(frozen=True, slots=True)
class Part:
    """Lines of a program, first and last, and what they are: one of ``KINDS``."""

    kind: str
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class Excitation:
    """A program with its parts; ``share`` of the largest speed."""

    text: str
    parts: tuple[Part, ...]
    share: float
    highest_hz: float  # of the strokes


def room(axis: Shown, at: float) -> float:
    """The signed way from where the axis stands on which it is moved: to the side where there is more.

    0 where there is too little on either side.
    """
    wanted = min(max(axis.ramp(axis.velocity), axis.step), MOST_SHARE * (axis.travel[1] - axis.travel[0]))
    up, down = axis.travel[1] - at, at - axis.travel[0]
    found = min(wanted, max(up, down))
    if found < LEAST_STROKE_SHARE * wanted:
        return 0.0
    return found if up >= down else -found


def excitation(axis: Shown, way: float, share: float, period_s: float, feedback_every: int = 1) -> Excitation:
    """Steps, ramps, a sine and a chirp of an axis on a ``way`` (signed), at a share of its largest speed."""
    speed, most, sign = share * axis.velocity, abs(way), math.copysign(1.0, way)
    lines = ["G21 G91 G61 G94 G40"]
    parts = []

    def part(kind: str, strokes: Iterator[tuple[float, bool]]) -> None:
        first = len(lines) + 1
        for length, rests in strokes:
            for one in (length, -length):
                lines.append(f"G1 {axis.name}{sign * one:.6f} F{60.0 * speed:.3f}")
                if rests:
                    lines.append(f"G4 P{REST_S:g}")
        if not lines[-1].startswith("G4"):
            lines.append(f"G4 P{REST_S:g}")
        parts.append(Part(kind, first, len(lines)))

    part("step", iter([(min(axis.step, most), True)]))
    part("ramp", iter([(min(axis.ramp(speed), most), True)]))
    sine = min(axis.stroke(0.5 / SINE_HZ, speed), most)
    part("sine", ((sine, False) for _ in range(SINE_PERIODS)))
    highest = 1.0 / (HIGHEST_TICKS * period_s * feedback_every)
    part("chirp", ((min(one, most), False) for one in _chirp(axis, speed, highest)))
    return Excitation("\n".join((*lines, "M30", "")), tuple(parts), share, highest)


def _chirp(axis: Shown, speed: float, highest_hz: float) -> Iterator[float]:
    for n in range(STROKES):
        frequency = LOWEST_HZ * (highest_hz / LOWEST_HZ) ** (n / (STROKES - 1))
        yield axis.stroke(0.5 / frequency, speed)
