"""Tables of what an axis misses, between their points and at their ends."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from support.machines.shipped_kinds import machine

from controller.machine import compensation, machine_file
from controller.machine.model import Pitch
from controller.machine.toml_table import ConfigError

TRUNNION = (machine_file.SHIPPED / "trunnion.toml").read_text()
TOOL = '[[tool]]\nnumber = 1\nname = "one"\nradius_mm = 3.0\nlength_mm = 0.0\nflute_mm = 15.0\n'
LIMITS = machine().axes[0].limits


def read(x: str = "", a: str = "", more: str = ""):
    text = TRUNNION.replace('file = "tools.toml"\n', "")
    for name, lines in (("X", x), ("A", a)):
        head, _, rest = text.partition(f'name = "{name}"\n')
        text = f'{head}name = "{name}"\n{lines}\n{rest}'
    return machine_file.read(f"{text}\n{more}\n{TOOL}", "own.toml", machine_file.SHIPPED)


@pytest.mark.parametrize("seed", range(5))
def test_a_grid_goes_through_its_points_and_overshoots_nowhere(seed):
    rng = random.Random(seed)
    at = sorted(rng.uniform(-300, 300) for _ in range(20))
    values = [rng.uniform(-0.02, 0.02) for _ in at]
    cubic = compensation._Cubic(at, values)
    assert [cubic(q) for q in at] == pytest.approx(values, abs=1e-15)
    found = compensation.grid(at, values)
    for i in range(len(at) - 1):
        low, high = sorted(values[i : i + 2])
        for k in range(11):
            assert low - 1e-12 <= cubic(at[i] + k / 10 * (at[i + 1] - at[i])) <= high + 1e-12
    assert found.at(-1e9) == values[0] and found.at(1e9) == values[-1]


def test_between_evenly_measured_points_the_grid_is_the_cubic_to_a_nanometre():
    at = [25.0 * k for k in range(-12, 13)]
    values = [0.01 * math.sin(q / 60.0) for q in at]
    cubic, found = compensation._Cubic(at, values), compensation.grid(at, values)
    assert max(abs(found.at(q / 7.0) - cubic(q / 7.0)) for q in range(-2100, 2100)) < 1e-6


def test_a_deviation_is_nothing_where_the_axis_is_homed():
    made = read(x="pitch = { at_mm = [-300, 300], up_mm = [0.010, 0.070], backlash_mm = 0.004 }\n")
    found = compensation.deviation(made.axes[0])
    assert found.at(0.0, 0) == pytest.approx(0.0, abs=1e-15)
    assert found.at(100.0, 0) == pytest.approx(0.010)
    assert [found.at(100.0, sense) for sense in (1, -1)] == pytest.approx([0.008, 0.012])


def test_backlash_alone_is_lost_evenly_about_the_middle():
    axis = read(x="pitch = { backlash_mm = 0.01 }\n").axes[0]
    assert axis.pitch == Pitch((-300.0, 300.0), (-0.005, -0.005), (0.005, 0.005))


def test_a_table_of_the_iso_sense_is_turned_round_with_its_senses():
    up, down = "up_deg = [0.001, 0.002, 0.003]", "down_deg = [0.004, 0.005, 0.006]"
    lines = f"pitch = {{ at_deg = [-90, 0, 90], {up}, {down} }}\n"
    carried = read(a=lines).axes[3]
    text = TRUNNION.replace('file = "tools.toml"\n', "").replace('sense = "carried"', 'sense = "iso"', 1)
    head, _, rest = text.partition('name = "A"\n')
    iso = machine_file.read(
        f'{head}name = "A"\n{lines}{rest}\n{TOOL}', "own.toml", machine_file.SHIPPED
    ).axes[3]
    rad = math.radians
    assert carried.pitch.up == pytest.approx((rad(0.001), rad(0.002), rad(0.003)))
    assert iso.pitch.at == pytest.approx((rad(-90), 0.0, rad(90)))
    assert iso.pitch.up == pytest.approx((rad(-0.006), rad(-0.005), rad(-0.004)))
    assert iso.pitch.down == pytest.approx((rad(-0.003), rad(-0.002), rad(-0.001)))


def test_what_a_table_needs_is_taken_off_the_limits_of_the_plan():
    plain = read().axes[0].limits
    made = read(x="pitch = { backlash_mm = 0.01 }\n").axes[0].limits
    assert made.jerk == pytest.approx((1 - compensation.REVERSAL_SHARE) * plain.jerk)
    assert made.acceleration == pytest.approx((1 - compensation.REVERSAL_SHARE) * plain.acceleration)


@pytest.mark.parametrize("backlash", [1e-4, 1e-3, 0.01, 0.1, -0.01])
def test_a_reversal_keeps_to_its_share_of_velocity_acceleration_and_jerk(backlash):
    pitch = Pitch((0.0, 1.0), (-backlash / 2,) * 2, (backlash / 2,) * 2)
    T = 0.002
    ramp = [backlash * s for s in (0.0, 0.0, 0.0, *compensation.ramp(pitch, LIMITS, T), 1.0, 1.0, 1.0)]
    values, T_n = ramp, 1.0
    for limit in (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk):
        values, T_n = [b - a for a, b in pairwise(values)], T_n * T
        assert max(map(abs, values)) / T_n <= 1.001 * compensation.REVERSAL_SHARE * limit


WRONG = [
    ("pitch = { at_mm = [0, 0], up_mm = [0, 0] }", "at_mm", "does not rise"),
    ("pitch = { at_mm = [0], up_mm = [0] }", "at_mm", "is no such list"),
    ("pitch = { at_mm = [0, 1], up_mm = [0] }", "up_mm", "is no such list"),
    ("pitch = { at_mm = [0, 1], up_mm = [0, 2.0] }", "up_mm", "is no such list"),
    (
        "pitch = { at_mm = [0, 1], up_mm = [0, 0], down_mm = [0, 0], backlash_mm = 0.1 }",
        "backlash_mm",
        "says",
    ),
    ("pitch = { at_mm = [0, 0.1, 0.2], up_mm = [0, 0.05, 0] }", "up_mm", "is so steep"),
    ("pitch = { at_mm = [0, 1], upp_mm = [0, 0] }", "upp_mm", "is not known"),
]


@pytest.mark.parametrize(("line", "key", "what"), WRONG)
def test_a_table_that_cannot_be_is_refused_with_its_line(line, key, what):
    with pytest.raises(ConfigError) as refused:
        read(x=line)
    told = str(refused.value)
    assert told.startswith("own.toml:") and key in told and what in told


def test_straightness_names_two_axes_and_the_second_is_a_slide():
    row = '[[straightness]]\nalong = "Y"\nmoves = "X"\nat_mm = [-300, 300]\noff_mm = [-0.01, 0.01]\n'
    (found,) = compensation.crossings(read(more=row))
    assert (found.along, found.moves) == (1, 0) and found.off.at(150.0) == pytest.approx(0.005)
    with pytest.raises(ConfigError, match="moves"):
        read(more=row.replace('moves = "X"', 'moves = "A"'))


def test_what_straightness_needs_is_taken_off_the_limits_and_a_steep_one_refused_at_its_row():
    row = '[[straightness]]\nalong = "Y"\nmoves = "X"\nat_mm = [-300, 300]\noff_mm = [-30e-2, 30e-2]\n'
    plain, made = read().axes, read(more=row).axes
    assert made[0].limits.acceleration == pytest.approx(0.999 * plain[0].limits.acceleration)
    assert made[1].limits == plain[1].limits
    bend = row.replace("[-300, 300]", "[0, 20, 40]").replace("[-30e-2, 30e-2]", "[0, 0.9, 0]")
    with pytest.raises(ConfigError, match=r"off_mm.*is so steep that it would take .* of the limits of X"):
        read(more=row + bend)


def test_a_drive_lets_the_joint_reach_its_travel_with_the_table_on():
    made = read(x="pitch = { at_mm = [-300, 300], up_mm = [0.03, -0.03], backlash_mm = 0.01 }\n")
    plain, wide = (machine_file.node_settings(one)[0] for one in (read(), made))
    assert wide.counts_max - plain.counts_max == pytest.approx(0.035 * 200_000, abs=1)
