"""Commission a drive, home, move and stop it, and hold its motor against what was asked, in mm and s."""

from __future__ import annotations

import math
import re
from pathlib import Path

from support.drives.axis_in_units import PERIOD_S, Bench
from support.drives.random_drives import Drive

from drives.commission import CommissionError

SERVO_S = math.sqrt(2.0) / (2.0 * math.pi * 60.0)  # 2 d / w: what a servo without feed-forward is behind
LATENCY_S = 3 * PERIOD_S  # until a drive has heard of a quick stop, and acts
SETTLES_S = 0.02  # the servo behind its ramp, until a thousandth of the speed is left
NAMES = re.compile(r"object [0-9A-F]{4}h|6[0-9A-F]{3}h")


def judge(drive: Drive, folder: Path) -> str:
    """How it went. Raises AssertionError."""
    zone = tuple(end / drive.mechanics.per_increment for end in drive.switches)
    try:
        bench = Bench(drive.mechanics, drive.axis, drive.sheet, folder, (zone[0], zone[1]))
    except CommissionError as error:
        assert NAMES.search(str(error)), f"no object is named: {error}"
        assert not drive.sound, f"refused without a reason: {error}"
        return f"refused: {error}"
    assert drive.velocity_unit is not None, "nobody knows its unit, and it was not refused"
    _check_written(drive, bench)
    _homed(drive, bench)
    _moved(drive, bench)
    return _stopped(drive, bench)


def _number(text: str, key: str) -> float:
    found = re.search(rf"{key}\w* = ([\d.]+)", text)
    return float(found[1]) if found else 0.0


def _quick(drive: Drive) -> float:
    """The deceleration that the machine file asks for."""
    return _number(" ".join(drive.axis.extra), "quick_stop") or drive.axis.acceleration


def _check_written(drive: Drive, bench: Bench) -> None:
    """What was written, by what its unit physically is."""
    get, axis = bench.device.dictionary.get, drive.axis
    velocity = drive.velocity_unit
    acceleration = drive.acceleration_unit or velocity
    quick = _quick(drive)
    if drive.sound:
        for index, wanted in ((0x6085, quick), (0x6084, axis.acceleration)):
            assert get(index) * acceleration <= 1.26 * wanted, hex(index)
            assert get(index) >= math.floor(wanted / acceleration * 0.999), hex(index)
        for index in (0x60C5, 0x60C6):
            assert get(index) * acceleration >= max(quick, axis.acceleration), hex(index)
        assert get(0x607F) * velocity >= 0.9999 * axis.velocity
        assert get(0x607F) * velocity <= max(1.0501 * axis.velocity, axis.velocity + velocity)
    assert math.isclose(bench.found.velocity_units, abs(axis.counts) ** -1 / velocity, rel_tol=1e-6), "60B1h"


def _homed(drive: Drive, bench: Bench) -> None:
    axis = drive.axis
    fast, slow = _number(axis.homing, "fast"), _number(axis.homing, "slow")
    speeds = bench.home()
    if not fast:
        return
    way = (-1 if "method = 17" in axis.homing else 1) * (1 if axis.counts > 0 else -1)
    seeks = max(way * speed for speed in speeds)
    crosses = max(-way * speed for speed in speeds)
    assert abs(seeks - fast) < 0.06 * fast + 0.5 * drive.velocity_unit, f"seeks at {seeks}, told {fast}"
    assert abs(crosses - slow) < 0.08 * slow + 0.5 * drive.velocity_unit, f"crosses at {crosses}, told {slow}"
    edge = drive.switches[1 if way > 0 else 0] * bench.sign * (1 if axis.counts > 0 else -1)
    end = math.copysign(abs(edge), way)
    near = slow * slow / axis.acceleration + 0.01 * axis.velocity * 0.3 + slow * 0.03
    assert abs(bench.place - end) < near, f"homed at {bench.place}, the switch is at {end}"
    assert abs(bench.joint - (bench.place - end)) < 2.0 / abs(axis.counts) + slow * 0.01, bench.joint


def _moved(drive: Drive, bench: Bench) -> None:
    axis = drive.axis
    bench.enable()
    count = 1.0 / abs(axis.counts)
    noise = count + 2.0 * bench.mechanics.per_increment
    for speed in (0.6 * axis.velocity, -0.6 * axis.velocity):
        begun, asked = bench.place, bench.setpoint
        bench.run_up(speed, 0.1)
        rough = count / PERIOD_S
        assert abs(bench.speed - speed) < 2e-3 * abs(speed) + rough, f"{bench.speed} mm/s, told {speed}"
        _lags(drive, bench, speed)
        bench.stop_on_path(speed)
        way, told = bench.place - begun, bench.setpoint - asked
        assert abs(way - told) < 2.0 * noise, f"moved {way}, told {told}"
        assert abs(way) > 0.05 * abs(speed)


def _lags(drive: Drive, bench: Bench, speed: float) -> None:
    """Feed-forward takes the lag away: by sign and size."""
    count = 1.0 / abs(drive.axis.counts)
    if bench.node.feed_forward:
        rounding = (0.5 * (drive.velocity_unit or 0.0) + count / PERIOD_S) * SERVO_S
        assert abs(bench.lag) < 0.01 * abs(speed) * SERVO_S + rounding + count, f"lag {bench.lag} at {speed}"
    else:
        off = abs(bench.lag - speed * SERVO_S)
        assert off < 0.02 * abs(speed) * SERVO_S + 2.0 * count, f"lag {bench.lag} at {speed}"


def _stopped(drive: Drive, bench: Bench) -> str:
    speed = drive.axis.velocity
    promised_s = bench.found.stop_s
    assert promised_s <= bench.most_stop_s
    bench.run_up(speed, 0.1, 0.9)
    taken_s, way = bench.quick_stop(2.0 * promised_s + 1.0)
    if 0x6085 in drive.sheet.missing:
        return "right, by its maker's ramp"  # nobody has measured it
    assert taken_s <= promised_s + SETTLES_S + LATENCY_S, f"stood after {taken_s} s, promised {promised_s}"
    most = 0.5 * speed * promised_s + speed * (LATENCY_S + SERVO_S)
    assert way <= 1.01 * most, f"stood after {way}, promised {most}"
    acceleration = drive.acceleration_unit or drive.velocity_unit
    told = bench.device.dictionary.get(0x6085) * acceleration
    if bench.found.stop_counts_s2 and told < 1.26 * _quick(drive):  # a steeper one is not believed
        assert taken_s >= 0.78 * promised_s, f"stood after {taken_s} s, promised {promised_s}: too much"
        ramp = 0.5 * speed * speed / told + speed * 1.5 * PERIOD_S
        if drive.sound:
            assert abs(way - ramp) < 0.03 * ramp + 1.5 * speed * (PERIOD_S + SERVO_S), (
                f"{way}, by 6085h {ramp}"
            )
    before = bench.place
    for _ in range(50):
        bench.tick()
    assert abs(bench.place - before) < 1e-3 * speed, "it stands"
    return "right"
