"""How an axis answers: figures and a Bode diagram out of the ticks of a run.

The frequency response is that of the position which the drive reports to the setpoint that it was sent, by
cross spectra of the velocities (the differences from tick to tick): H = S_uy / S_uu, summed over bands of
neighbouring frequencies (Bendat and Piersol, Random Data, chapter 6). A run begins and ends at rest, so the
whole of it is one period of its transform, and no window is needed. Within a band the phase turns by the
delay of the answer: that is taken out before the sum, and put back behind it.

What of Y is not H U is noise, where H goes straight through its value in the middle of a band. Of K bins its
power is what is left of S_yy by K - 2, or what rounding to counts leaves in the N differences of positions
while the axis moves, where that is more: N count^2 / 12 |1 - exp(-jwT)|^2. The root of that power by S_uu is
the deviation of H, of which five are counted. But what is rounded moves with the setpoints and may be in step
with them, and a resonance bends H within a band: by as much as what is left differs from what rounding
leaves, more than by chance (two deviations of a power of so many bins), all K bins may add up (no cross
spectrum is more than sqrt(S_uu S_nn)). A band in which both together are more than 5 % of H is left out: the
diagram of a coarse encoder ends where its counts begin to be what is seen.

What is late by the bus alone is no matter of the drive: ``latency`` ticks are counted (``live_state``).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.bringup.excitation import LOWEST_HZ, Excitation, Part
from controller.geometry.arrays import Array

BANDS_PER_OCTAVE = 8
MIN_BINS = 4  # of the transform in a band
DEVIATIONS = 5.0  # that an answer may be off
CHANCE_DEVIATIONS = 2.0  # deviations by which two powers may differ
MAX_UNCERTAINTY = 0.05  # of an answer's size
STEADY_SHARE = 0.02  # of the speed by which that of a ramp may differ from tick to tick
HALF_POWER = math.sqrt(0.5)  # -3 dB


@dataclass(frozen=True, eq=False)
class AxisTicks:
    """One axis, tick by tick, in mm or degrees: as sent, as reported ``latency`` ticks later, the line."""

    period_s: float
    setpoint: Array  # (N,)
    actual: Array  # (N,)
    line: NDArray[np.int64]  # (N,) of the setpoint

    @classmethod
    def of(
        cls, setpoint: Array, actual: Array, line: NDArray[np.int64], latency: int, period_s: float
    ) -> AxisTicks:
        """Of rows as they were recorded; the last ``latency`` setpoints have no answer yet."""
        end = len(setpoint) - latency
        return cls(period_s, setpoint[:end], actual[latency:], line[:end])

    @property
    def error(self) -> Array:
        """Commanded less actual (N,)."""
        return self.setpoint - self.actual

    @property
    def speed(self) -> Array:
        """Of the setpoints (N,), mm/s or degrees/s."""
        return np.diff(self.setpoint, prepend=self.setpoint[:1]) / self.period_s

    def of_part(self, part: Part) -> AxisTicks:
        """The ticks from the first line of a part to the first behind it."""
        begin = int(np.argmax(self.line >= part.first)) if (self.line >= part.first).any() else len(self.line)
        behind = np.flatnonzero(self.line[begin:] > part.last)
        end = begin + int(behind[0]) if len(behind) else len(self.line)
        rows = slice(begin, end)
        return AxisTicks(self.period_s, self.setpoint[rows], self.actual[rows], self.line[rows])


class Bode(NamedTuple):
    """Frequency response (M,): of position to setpoint, the bus not counted."""

    frequency_hz: Array
    magnitude: Array
    phase_deg: Array  # unwrapped
    uncertainty: Array  # share of the answer by which it may be off

    def at(self, frequency_hz: float) -> float:
        """Magnitude, straight between its places."""
        return float(np.interp(frequency_hz, self.frequency_hz, self.magnitude))


@dataclass(frozen=True, slots=True)
class Figures:
    """What was measured at one share of the speed; mm or degrees, and seconds."""

    share: float
    speed: float  # largest
    error: float  # largest following error
    rest_error: float  # largest at rest, settled
    lag_s: float  # following error by speed
    overshoot: float  # past the end of a step
    settling_s: float  # after the setpoint has stopped; of steps and ramps the longest
    acceleration: float  # asked at most
    reached: float  # acceleration that the motor has given of it
    bandwidth_hz: float  # -3 dB; 0: beyond what was seen
    peak_db: float
    peak_hz: float
    seen_hz: float  # highest frequency of the Bode diagram


def bode(ticks: AxisTicks, highest_hz: float, count: float) -> Bode:
    """Frequency response of an axis over all of its ticks; a drive's ``count`` in mm or degrees."""
    u, y = (np.diff(one, prepend=one[:1]) for one in (ticks.setpoint, ticks.actual))
    n, moves = 1 << math.ceil(math.log2(len(u))), np.count_nonzero((u != 0.0) | (y != 0.0))
    frequency = np.asarray(np.fft.rfftfreq(n, ticks.period_s), dtype=np.float64)
    U, Y = np.fft.rfft(u, n), np.fft.rfft(y, n)
    lag_s = _lag(ticks)
    turned = Y * np.exp(2j * np.pi * frequency * lag_s)
    rows = []
    for low, high in _bands(frequency):
        here = slice(low, high)
        power = np.abs(U[here]) ** 2
        suu, syy = float(power.sum()), float((np.abs(Y[here]) ** 2).sum())
        cross = U[here].conj() * turned[here]
        suy = complex(cross.sum())
        middle = float((frequency[here] * power).sum() / suu) if suy else 0.0
        aside = frequency[here] - middle
        bent = float(abs((aside * cross).sum()) ** 2 / (aside**2 * power).sum()) if suy else 0.0
        if not 0.5 * LOWEST_HZ <= middle <= highest_hz:
            continue
        step = abs(1.0 - cmath.exp(-2j * math.pi * middle * ticks.period_s))
        rounding = moves / 12.0 * (count * step) ** 2
        left = max(0.0, (syy - abs(suy) ** 2 / suu - bent) / (high - low - 2))
        noise, bins = max(rounding, left), high - low
        chance = CHANCE_DEVIATIONS * noise / math.sqrt(bins * len(u) / n)
        in_step = bins * max(0.0, abs(left - rounding) - chance)
        off = math.sqrt(DEVIATIONS**2 * noise + in_step)
        uncertainty = off * math.sqrt(suu) / abs(suy)
        if uncertainty <= MAX_UNCERTAINTY:
            rows.append((middle, abs(suy) / suu, cmath.phase(suy), uncertainty, middle * lag_s))
    table = np.array(rows).reshape(-1, 5).T
    phase_deg = np.degrees(np.unwrap(table[2])) - 360.0 * table[4]
    return Bode(table[0], table[1], phase_deg, table[3])


def _lag(ticks: AxisTicks) -> float:
    """By how much the answer is late, s: error by speed, least squares over what moves."""
    speed = ticks.speed
    power = float(speed @ speed)
    return float(ticks.error @ speed) / power if power > 0.0 else 0.0


def _bands(frequency: Array) -> list[tuple[int, int]]:
    """First and end of bins of the bands, an eighth of an octave or ``MIN_BINS`` wide."""
    bands, low = [], 1
    while low < len(frequency):
        high = max(low + MIN_BINS, math.ceil(low * 2.0 ** (1.0 / BANDS_PER_OCTAVE)))
        bands.append((low, high))
        low = high
    return bands[:-1]


def figures(ticks: AxisTicks, made: Excitation, found: Bode, within: float) -> Figures:
    """``within``: following error at which motion has arrived (``in_position`` of the machine file)."""
    parts = [(part.kind, ticks.of_part(part)) for part in made.parts]
    to_rest = [one for kind, one in parts if kind in ("step", "ramp")]
    steps = [one for kind, one in parts if kind == "step"]
    asked, reached = _accelerations(ticks)
    peak = int(np.argmax(found.magnitude)) if len(found.magnitude) else -1
    return Figures(
        share=made.share,
        speed=float(np.abs(ticks.speed).max()),
        error=float(np.abs(ticks.error).max()),
        rest_error=round(max((_rest_error(one) for one in to_rest), default=0.0), 9),
        lag_s=_steady_lag([one for kind, one in parts if kind == "ramp"]),
        overshoot=max((_overshoot(one) for one in steps), default=0.0),
        settling_s=max((_settling(one, within) for one in to_rest), default=0.0),
        acceleration=asked,
        reached=reached,
        bandwidth_hz=_bandwidth(found),
        peak_db=20.0 * math.log10(max(1e-12, float(found.magnitude[peak]))) if peak >= 0 else 0.0,
        peak_hz=float(found.frequency_hz[peak]) if peak >= 0 else 0.0,
        seen_hz=float(found.frequency_hz[-1]) if peak >= 0 else 0.0,
    )


def _steady_lag(ramps: Sequence[AxisTicks]) -> float:
    """Error by speed where the speed stands, s."""
    lags = []
    for one in ramps:
        speed = one.speed
        fastest = float(np.abs(speed).max(initial=0.0))
        settled = _standing_for(np.abs(np.abs(speed) - fastest) <= STEADY_SHARE * fastest)
        if fastest > 0.0 and settled.any():
            lags.append(float(np.median(one.error[settled] / speed[settled])))
    return float(np.mean(lags)) if lags else 0.0


def _standing_for(steady: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The second half of each segment that is steady: by then the answer is, too."""
    found = np.zeros_like(steady)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], steady, [False])).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        found[(begin + end) // 2 : end] = True
    return found


def _ends(ticks: AxisTicks) -> list[tuple[int, int]]:
    """For each way to rest: the tick in which the setpoint stops, and the last before it moves again."""
    still = ticks.speed == 0.0
    edges = np.flatnonzero(np.diff(np.concatenate(([False], still, [False])).astype(int)))
    found = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(begin, end) for begin, end in found if begin > 0 and end - begin > 2]


def _rest_error(ticks: AxisTicks) -> float:
    """In the second half of the standstill."""
    error = np.abs(ticks.error)
    return max((float(error[(begin + end) // 2 : end].max()) for begin, end in _ends(ticks)), default=0.0)


def _overshoot(ticks: AxisTicks) -> float:
    """How far the axis goes past the place where the setpoint stops."""
    found = 0.0
    for begin, end in _ends(ticks):
        towards = math.copysign(1.0, float(ticks.speed[begin - 1]))
        found = max(found, float((-towards * ticks.error[begin:end]).max()))
    return found


def _settling(ticks: AxisTicks, within: float) -> float:
    """From the last setpoint that differs until the error stays within."""
    longest = 0.0
    for begin, end in _ends(ticks):
        outside = np.flatnonzero(np.abs(ticks.error[begin:end]) > within)
        longest = max(longest, (int(outside[-1]) + 1) * ticks.period_s if len(outside) else 0.0)
    return longest


SMOOTHED_TICKS = 5


def _accelerations(ticks: AxisTicks) -> tuple[float, float]:
    """Largest of the setpoints, and of the positions, both over ``SMOOTHED_TICKS``."""
    found = []
    for one in (ticks.setpoint, ticks.actual):
        k = SMOOTHED_TICKS
        if len(one) <= 2 * k:
            return 0.0, 0.0
        bent = one[2 * k :] - 2.0 * one[k:-k] + one[: -2 * k]
        found.append(float(np.abs(bent).max()) / (k * ticks.period_s) ** 2)
    return found[0], found[1]


def _bandwidth(found: Bode) -> float:
    below = np.flatnonzero(found.magnitude < HALF_POWER)
    if not len(below) or below[0] == 0:
        return 0.0
    i = int(below[0])
    f, m = found.frequency_hz[i - 1 : i + 1], found.magnitude[i - 1 : i + 1]
    return float(np.interp(HALF_POWER, m[::-1], f[::-1]))
