"""A touch, latched by the drive itself and told by an event-driven TPDO."""

import math

import pytest
from support.drives.group_bench import GroupBench, nodes

from drives.cyclic import touch_probe
from drives.cyclic.touch_probe import TouchProbe

STEP = 37  # counts per period
WALL = 5000.0


def approach(bench, most=300):
    """The axis runs towards the wall until its probe touches."""
    probe = bench.group.drives[0].probe
    for _ in range(most):
        if probe.touched:
            return probe
        bench.setpoints[0] += STEP
        bench.tick()
    raise AssertionError("no touch")


def armed_bench():
    """Armed anew for one touch; commissioning arms it for every one."""
    bench = GroupBench(nodes("XY", probe_tpdo=3))
    bench.devices[0].axis.sensors.probes.walls[0] = WALL
    bench.enable()
    for function in (0, touch_probe.function()):
        bench.write(1, touch_probe.FUNCTION, 0, function, 2)
    bench.until(lambda: bench.group.drives[0].probe.armed)
    return bench


def test_the_position_is_that_of_the_touch_itself_though_it_is_told_later():
    bench = armed_bench()
    probe = approach(bench)
    assert probe.position == pytest.approx(WALL, abs=1)
    assert bench.group.positions[0] > WALL + 1  # the axis has moved on
    assert bench.setpoints[0] - WALL > 3 * STEP
    assert probe.at_s == bench.now_s


def test_one_arming_stores_one_touch():
    bench = armed_bench()
    probe = approach(bench)
    for _ in range(200):  # back, and on again
        bench.setpoints[0] -= STEP
        bench.tick()
    bench.devices[0].axis.sensors.probes.walls[0] = WALL - 1000
    for _ in range(200):
        bench.setpoints[0] += STEP
        bench.tick()
    assert probe.position == pytest.approx(WALL, abs=1)
    bench.write(1, touch_probe.FUNCTION, 0, 0, 2)
    bench.until(lambda: not probe.armed)
    assert not probe.touched


def test_a_bus_without_a_touch_carries_no_frame_for_it():
    bench = armed_bench()
    told = []
    bench.rig.buses["can"].watch(0x381, lambda frame, at_s: told.append(at_s))
    bench.tick(100)
    assert told == []


def test_a_drive_without_probe_has_none():
    assert GroupBench(nodes("X")).group.drives[0].probe is None


def test_a_latch_of_wrong_length_is_counted_and_not_used():
    probe = TouchProbe(1, 2)
    (handler,) = probe.handlers.values()
    for count in (1, 2):
        handler(memoryview(b"\x03\x00\x10"), 1.0)
        assert probe.malformed == count
    assert (probe.armed, probe.touched, probe.position, probe.at_s) == (False, False, 0, -math.inf)


def test_what_was_stored_before_arming_can_be_forgotten():
    probe = TouchProbe(1, 2)
    (handler,) = probe.handlers.values()
    handler(memoryview(b"\x03\x00\x10\x00\x00\x00"), 1.0)
    assert (probe.armed, probe.touched, probe.position) == (True, True, 16)
    probe.forget()
    assert not probe.touched
    handler(memoryview(b"\x01\x00\x10\x00\x00\x00"), 2.0)
    assert probe.armed and not probe.touched


@pytest.mark.parametrize(
    ("arguments", "word"),
    [({}, 0x11), ({"index_pulse": True}, 0x15), ({"continuous": True}, 0x13)],
)
def test_the_arming_word_is_that_of_the_profile(arguments, word):
    assert touch_probe.function(**arguments) == word
