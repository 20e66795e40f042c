"""From settings to devices: axes, a spindle that turns for ever, inputs and outputs; and a whole rig."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.drives.lone_drive import START, Lone
from support.drives.stepped_drives import nodes

from drives.bench.simulated import IoNode, Parameters, SimulatedDrive, build, rig
from drives.bench.simulated.homing import HOME, METHODS, NEGATIVE, POSITIVE
from drives.profile import GENERIC, Override
from drives.settings import BusSettings, IoSettings, SpindleSettings

BUSES = [BusSettings("left", "virtual", "", 1_000_000), BusSettings("right", "virtual", "", 500_000)]
SPINDLE = SpindleSettings("spindle", "right", 10, "", counts_per_rev=4096.0)
IO = IoSettings("io", "right", 11, "")


def spindle(mode: int, position: int = 0) -> Lone:
    """An enabled spindle on a bus of its own, SYNC every 2 ms."""
    made = Lone(Parameters(position_counts=position, most_acceleration=200.0 * 4096.0))
    made.nmt(START)
    made.write(0x60C2, 1, 2, 1)
    made.enable(mode)
    return made


@pytest.mark.parametrize("mode", [3, 9])
def test_a_spindle_takes_its_time_to_reach_speed(mode: int) -> None:
    lone = spindle(mode)
    lone.write(0x60FF, 0, 4096 * 100, 4)
    lone.run(0.25)
    assert lone.read(0x606C, signed=True) == pytest.approx(4096 * 50, rel=0.1)
    lone.run(0.35)
    assert lone.read(0x606C, signed=True) == pytest.approx(4096 * 100, rel=0.001)
    lone.write(0x60FF, 0, 0, 4)
    lone.run(0.6)
    assert lone.read(0x606C, signed=True) == 0


@pytest.mark.parametrize(("speed", "start"), [(4096 * 100, 2**31 - 50_000), (-4096 * 100, -(2**31) + 50_000)])
def test_a_spindle_turns_on_when_its_counter_is_full(speed: int, start: int) -> None:
    lone = spindle(9, start)
    lone.write(0x60FF, 0, speed, 4)
    lone.run(1.0)
    assert lone.read(0x606C, signed=True) == pytest.approx(speed, rel=0.001)
    assert lone.read(0x6064, signed=True) * speed < 0, "it began again at the other end"
    assert lone.status & 0x6F == 0x27 and lone.emergencies() == []


def test_a_torque_offset_acts_like_an_acceleration() -> None:
    """60B2h: x = r + a / w^2, with the drive's own a per thousandth of its torque."""
    lone = Lone(Parameters(torque_counts_s2=5000.0))
    lone.nmt(START)
    lone.write(0x60C2, 1, 2, 1)
    lone.write(0x60B2, 0, 300, 2)
    lone.enable(9)
    lone.run(0.3)
    assert lone.read(0x6064, signed=True) == round(300 * 5000.0 / (2.0 * 3.141592653589793 * 60.0) ** 2)


def test_a_refused_value_in_a_process_data_object_changes_nothing() -> None:
    lone = Lone()
    lone.map(0x1401, 0x1601, [0x6060_0008, 0x60FF_0020], 255, 0x305)
    lone.nmt(START)
    lone.put(0x305, b"\x63\x2a\0\0\0")
    assert lone.read(0x6060) == 0 and lone.read(0x60FF) == 42


def test_each_kind_of_node_becomes_its_device() -> None:
    nature = Parameters()
    axis = build.device(nodes("X")[0], nature)
    assert isinstance(axis, SimulatedDrive) and axis.node_id == 1
    turning = build.device(SPINDLE, nature)
    assert isinstance(turning, SimulatedDrive) and turning.parameters.most_acceleration > 4096.0
    assert isinstance(build.device(IO, nature), IoNode)


def test_a_rig_has_every_node_on_its_bus() -> None:
    made = rig(nodes("XY", bus="left"), BUSES, spindle=SPINDLE, io=[IO])
    heard: dict[str, set[int]] = {"left": set(), "right": set()}
    for name, bus in made.buses.items():
        bus.connect(lambda frame, _at_s, name=name: heard[name].add(int.from_bytes(frame[:4], "little")))
    made.advance(0.05)
    assert heard == {"left": {0x701, 0x702}, "right": {0x70A, 0x70B}}
    assert list(made.drives) == ["X", "Y"] and made.spindle is not None and made.io["io"].node_id == 11


@pytest.mark.parametrize("polarity", [0, 0x80])
@pytest.mark.parametrize("method", sorted(set(METHODS) - {33, 34}))
def test_an_axis_was_left_beside_the_switch_that_its_search_comes_to_first(
    method: int, polarity: int
) -> None:
    axis = replace(nodes()[0], homing_method=method, homing_position_counts=7_000_000)
    told = replace(axis, counts_min=-60_000_000, counts_max=60_000_000, homing_fast_counts_s=4_000_000)
    made = build.drive(
        replace(told, overrides=(Override(0x607E, 0, "mirrored", default=polarity),)), Parameters()
    )
    ground, rests = made.axis.sensors.ground(), made.axis.servo.position
    way = METHODS[method].mirrored() if polarity else METHODS[method]
    assert not any(ground.pressed(switch, rests) for switch in (NEGATIVE, POSITIVE, HOME))
    ahead = [k for k in range(1, 200) if ground.pressed(way.switch, rests + way.first * k * 100_000.0)]
    assert 10 <= ahead[0] <= 41, "a second of the search, less the cam"
    ends = [ground.windows[NEGATIVE][1], ground.windows[POSITIVE][0]]
    assert ends[1] - ends[0] > (120_000_000 if way.switch == HOME else 50_000_000), "the travel is free"


def test_a_drive_searches_no_faster_than_its_axis_moves() -> None:
    """The sheet's 4 000 000 counts/s are too much for an encoder of 4096 counts and a rotary of 1:50."""
    axis = replace(nodes()[0], velocity_counts_s=51_200.0, homing_fast_counts_s=0, homing_slow_counts_s=0)
    made = build.drive(axis, Parameters())
    assert [made.dictionary.get(0x6099, sub) for sub in (1, 2)] == [10_240, 1_024]
    made.dictionary.reset(0x6000, 0x9FFF)
    assert made.dictionary.get(0x6099, 1) == 10_240, "after power-on, too"
    usual = build.drive(replace(axis, velocity_counts_s=4e7), Parameters())
    assert [usual.dictionary.get(0x6099, sub) for sub in (1, 2)] == [4_000_000, 400_000]


def test_units_that_no_object_says_are_the_family_s_and_the_machine_file_s_before_them() -> None:
    """Of an iPOS 65536ths of a count per loop: told so, a search at another speed never met its switch."""
    family = replace(GENERIC, velocity_unit_counts_s=1 / 65.536, acceleration_unit_counts_s2=15.25)
    axis = replace(nodes()[0], profile=family)
    own = replace(axis, velocity_unit_counts_s=0.5)
    for node, sizes in ((axis, (1 / 65.536, 15.25)), (own, (0.5, 0.5))):
        units = build.drive(node, Parameters()).axis.units
        assert (1.0 / units.velocity, 1.0 / units.acceleration) == pytest.approx(sizes)
        assert not units.plain and units.position == 1.0
