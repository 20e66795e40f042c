"""Setpoints with what the axes miss taken off: the axis stands where its joint is."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from itertools import pairwise

import pytest
from support.machines.shipped_kinds import machine

from controller.machine import compensation
from controller.machine.model import Pitch, Straightness
from controller.tick.check import TOLERANCE
from controller.tick.deviations import AxisDeviation
from controller.tick.joints import Encoder

T = 0.002
AT = tuple(25.0 * k for k in range(-12, 13))
BACKLASH = 0.02


def pitch_of(k: int, lost: float = BACKLASH, unit: float = 1.0) -> Pitch:
    """A screw, ``k`` its own: mean deviation a wave of 10 um."""
    mean = [0.010 * unit * math.sin(q / 70.0 + k) for q in AT]
    at = tuple(q * (unit if unit == 1.0 else math.radians(1.0)) for q in AT)
    return Pitch(at, tuple(m - 0.5 * lost * unit for m in mean), tuple(m + 0.5 * lost * unit for m in mean))


def built(**changes):
    made = machine("fig4a")
    axes = [
        replace(axis, pitch=pitch_of(i, unit=math.radians(0.01) if axis.is_rotary else 1.0))
        for i, axis in enumerate(made.axes)
    ]
    crossed = changes.get("straightness", ())
    return replace(made, axes=compensation.reserved(axes, crossed), **changes)


class Screw:
    """An axis as it is: pitch by the position of its motor, and a nut that is dragged after it."""

    def __init__(self, pitch: Pitch, home: float) -> None:
        self._mean = compensation.grid(
            pitch.at, [0.5 * (u + d) for u, d in zip(pitch.up, pitch.down, strict=True)]
        )
        self._half = 0.5 * abs(pitch.up[0] - pitch.down[0])
        self._zero = self._mean.at(home)
        self._nut: float | None = None

    def at(self, motor: float) -> float:
        nut = motor if self._nut is None else self._nut
        self._nut = min(max(nut, motor - self._half), motor + self._half)
        return self._nut + self._mean.at(motor) - self._zero


def way(rng: random.Random, axis, ticks: int) -> list[float]:
    """A way of a joint that keeps to its limits: sines that begin at rest, with reversals."""
    limits, out = axis.limits, []
    amplitude = 0.4 * min(axis.travel_max, 290.0)
    w = min(
        limits.velocity / amplitude,
        (limits.acceleration / amplitude) ** 0.5,
        (limits.jerk / amplitude) ** (1 / 3),
    )
    phase, share = rng.uniform(0, 1), rng.uniform(0.3, 0.99)
    for k in range(ticks):
        out.append(amplitude * (math.cos(share * w * k * T + phase) - math.cos(phase)))
    return out


@pytest.mark.parametrize("seed", range(3))
def test_the_axis_is_where_its_joint_is_once_the_nut_lies_against_the_screw(seed):
    rng = random.Random(seed)
    made = built()
    encoder = Encoder(made)
    screws = [Screw(axis.pitch, axis.homing.position) for axis in made.axes]
    ways = [way(rng, axis, 4000) for axis in made.axes]
    ramp = [len(compensation.ramp(axis.pitch, axis.limits, T)) for axis in made.axes]
    since, worst, seen = [0] * 5, [0.0] * 5, 0
    last = before = [row[0] for row in ways]
    for k in range(4000):
        joints = tuple(row[k] for row in ways)
        assert encoder.encode(joints)
        motors = [c / a.counts_per_unit for c, a in zip(encoder.setpoints, made.axes, strict=True)]
        for i, screw in enumerate(screws):
            real = screw.at(motors[i])
            turned = k > 1 and (joints[i] - last[i]) * (last[i] - before[i]) < 0.0
            since[i] = 0 if turned else since[i] + 1
            if k > 200 and since[i] > ramp[i] + 60:
                worst[i], seen = max(worst[i], abs(real - joints[i])), seen + 1
        before, last = last, list(joints)
    assert seen > 5000
    for i, axis in enumerate(made.axes):
        rest = math.radians(1e-6) if axis.is_rotary else 1e-5
        assert worst[i] < 0.6 / abs(axis.counts_per_unit) + rest, (axis.name, worst[i])


def test_setpoints_keep_the_limits_of_the_machine_file_through_every_reversal():
    plain, made, rng = machine("fig4a"), built(), random.Random(7)
    encoder = Encoder(made)
    ways = [way(rng, axis, 6000) for axis in made.axes]
    sent = []
    for k in range(6000):
        encoder.encode(tuple(row[k] for row in ways))
        sent.append(encoder.setpoints)
    for i, axis in enumerate(plain.axes):
        values = [row[i] / axis.counts_per_unit for row in sent][3:]
        count = 1.0 / abs(axis.counts_per_unit)
        for order, limit in enumerate((axis.limits.velocity, axis.limits.acceleration, axis.limits.jerk), 1):
            values = [(b - a) / T for a, b in pairwise(values)]
            rounding = 2.0 ** (order - 1) * count / T**order
            assert max(map(abs, values)) <= 1.001 * limit + rounding, (axis.name, order)


@pytest.mark.parametrize("seed", range(6))
def test_steep_tables_keep_the_limits_at_full_speed_also_where_a_period_is_shorter_than_a_cell(seed):
    """Its own of X and one by Y, as steep as is allowed: past each point in turn, speeding up or braking."""
    rng, at = random.Random(seed), tuple(300.0 * k / 30 - 150.0 for k in range(31))
    plain, period_s = machine("fig4a"), rng.choice((0.0005, 0.001, 0.002))
    x, y = plain.axes[:2]

    def steep(share):
        """Points beside the mean by as much as takes that share."""
        off = [rng.uniform(-1.0, 1.0) for _ in at]
        for _ in range(60):
            found = share(tuple(off))
            off = [0.5 * (1.0 + 0.07 / found) * value for value in off]
        return tuple(off)

    own = steep(lambda off: compensation.own_share(Pitch(at, off, off), x.limits))
    other = steep(lambda off: compensation.share(x, plain.axes, [Straightness("Y", "X", at, off)]))
    rows = (Straightness("Y", "X", at, other),)
    axes = compensation.reserved([replace(x, pitch=Pitch(at, own, own)), *plain.axes[1:]], rows)
    made = replace(plain, axes=axes, straightness=rows, period_s=period_s)
    most, worst = [axis.limits for axis in made.axes[:2]], [0.0, 0.0]
    for begin in range(-140, 140, 16):
        for way, less in ((-1.0, 0.0), (1.0, 0.02)):
            encoder, sent = Encoder(made), []
            for k in range(round(0.02 / period_s)):
                t = k * period_s
                X, Y = (
                    begin + t * (one.velocity + one.acceleration * (way * t / 2.0 - less)) for one in most
                )
                sent.append(encoder.counts((X, Y, 0.0, 0.0, 0.0))[0] / x.counts_per_unit)
            steps = [(b - a) / period_s for a, b in pairwise(sent)]
            bends = [(b - a) / period_s for a, b in pairwise(steps)]
            worst = [max(worst[0], *map(abs, steps)), max(worst[1], *map(abs, bends))]
    assert 0.85 * x.limits.acceleration < worst[1] <= TOLERANCE * x.limits.acceleration
    assert 0.85 * x.limits.velocity < worst[0] <= x.limits.velocity
    assert y.limits == made.axes[1].limits


def test_what_comes_back_is_the_joint_to_a_count():
    made, rng = built(), random.Random(3)
    encoder = Encoder(made)
    ways = [way(rng, axis, 1500) for axis in made.axes]
    for k in range(1500):
        joints = tuple(row[k] for row in ways)
        encoder.encode(joints)
        encoder.decode(encoder.setpoints)
        for q, actual, axis in zip(joints, encoder.actual, made.axes, strict=True):
            assert abs(q - actual) < 1.5 / abs(axis.counts_per_unit)


def test_a_homed_axis_says_its_homing_position_with_a_table_and_without():
    made = built()
    encoder = Encoder(made)
    counts = [round(a.homing.position * a.counts_per_unit) for a in made.axes]
    encoder.decode(counts)
    assert encoder.actual == pytest.approx([a.homing.position for a in made.axes], abs=1e-9)
    encoder.encode(tuple(encoder.actual))
    assert all(abs(a - b) <= 1 for a, b in zip(encoder.setpoints, counts, strict=True))


def test_an_axis_that_creeps_back_by_less_than_its_counts_does_not_turn():
    made = built()
    encoder = Encoder(made)
    for k in range(500):
        encoder.encode((0.001 * k, 0.0, 0.0, 0.0, 0.0))
    before = encoder.setpoints
    for k in range(200):
        encoder.encode((0.499 - 1e-9 * k, 0.0, 0.0, 0.0, 0.0))
    assert abs(encoder.setpoints[0] - before[0]) <= 1


def test_straightness_and_a_thermal_shift_move_the_other_axes_too():
    made = replace(
        machine("fig4a"),
        straightness=(Straightness("Y", "X", (-100.0, 100.0), (-0.02, 0.02)),),
        thermal_shift_mm=(0.0, 0.0, 0.005),
    )
    encoder, counts = Encoder(made), made.axes[0].counts_per_unit
    encoder.encode((1.0, 50.0, 2.0, 0.0, 0.0))
    assert [c / counts for c in encoder.setpoints[:3]] == pytest.approx([0.99, 50.0, 1.995])
    encoder.decode(encoder.setpoints)
    assert encoder.actual[:3] == pytest.approx([1.0, 50.0, 2.0])


@pytest.mark.parametrize(
    "only",
    [
        {"straightness": (Straightness("Y", "X", (-100.0, 100.0), (-0.02, 0.02)),)},
        {"thermal_shift_mm": (0.0, 0.0, 0.005)},
    ],
)
def test_one_kind_of_what_axes_miss_is_enough(only):
    assert Encoder(replace(machine("fig4a"), **only))._deviations is not None
    assert Encoder(built())._deviations is not None


def test_a_machine_without_tables_sends_what_it_sent_before():
    assert Encoder(machine("fig4a"))._deviations is None


# ---- which way an axis goes, tick by tick: the table tells the sense itself


def sense_of(*places: float) -> tuple[list[float], AxisDeviation]:
    """What is taken off in each tick, places in ``still`` of the axis; at the last one it stays."""
    axis = Encoder(built())._deviations._axes[0]
    axis._at = lambda _q, sense: sense
    stay = [places[-1]] * (3 * len(axis._ramp) + 9)
    told = [q * axis._still for q in (*places, *stay)]
    return [q - axis.step(q) for q in told], axis


@pytest.mark.parametrize("side", (1.0, -1.0))
def test_an_axis_turns_where_it_has_gone_by_its_counts_and_not_before(side):
    def ends(*places):
        return round(sense_of(*(side * q for q in places))[0][-1], 9)

    assert ends(0.0) == ends(0.0, 0.9) == ends(0.0, -0.9) == 0.0, "half way between both"
    assert ends(0.0, 1.01) == side and ends(0.0, -1.01) == -side
    assert ends(0.0, 4.0, 8.0) == ends(0.0, 4.0, 8.0, 7.1) == side
    assert ends(0.0, 4.0, 8.0, 6.9) == -side, "from its farthest place, not from where it turned last"
    assert ends(0.0, 4.0, 8.0, 6.9, 5.0, 5.9) == -side and ends(0.0, 4.0, 8.0, 6.9, 5.0, 6.1) == side
    assert ends(50.0) == ends(50.0, 50.9) == 0.0 and ends(50.0, 51.01) == side, "wherever it has begun"


@pytest.mark.parametrize("side", (1.0, -1.0))
def test_a_reversal_goes_along_its_ramp_a_step_a_tick(side):
    off, axis = sense_of(0.0, 5.0 * side)
    begun = next(k for k, one in enumerate(off) if abs(one) > 1e-9)
    wanted = [side * share for share in axis._ramp if share > 0.0]
    assert off[begun : begun + len(wanted)] == pytest.approx(wanted, abs=1e-9)
    assert begun == 2 + sum(share <= 0.0 for share in axis._ramp)
    assert off[-1] == pytest.approx(side, abs=1e-9)


def test_what_drives_say_is_read_where_the_axis_was_told_to_be():
    axis = Encoder(built())._deviations._axes[0]
    seen: list[float] = []
    axis.now, axis._at = 0.25, lambda q, sense: seen.append(q) or 0.5
    assert axis.real(10.0) == 10.5 and seen == [10.25]
