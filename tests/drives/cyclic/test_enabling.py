"""Which drive is enabled or disabled when: group by group up, in reverse down."""

from dataclasses import replace

import pytest
from support.drives.group_bench import GroupBench, nodes

from drives.bench.simulated import Parameters
from drives.cia402 import State, Wanted
from drives.cyclic.drive import Drive
from drives.cyclic.enabling import MAX_WAIT_S, Enabling
from drives.settings import NodeSettings

GROUPS = {"X": 1, "Y": 1, "Z": 2, "A": 0, "C": 0}  # rotaries first, the gravity axis last


def bench_of_groups(**nature):
    drives = [replace(node, enable_group=GROUPS[node.name], brake=node.name == "Z") for node in nodes()]
    return GroupBench(drives, parameters=Parameters(**nature))


def order(bench, done):
    """The tick in which each drive was first seen to be done, by name."""
    seen = {}
    for tick in range(400):
        for drive in bench.group.drives:
            if done(drive):
                seen.setdefault(drive.settings.name, tick)
        if len(seen) == len(bench.group.drives):
            return seen
        bench.tick()
    raise AssertionError(seen)


def test_groups_are_enabled_one_after_the_other():
    bench = bench_of_groups(enable_delay_s=0.05)
    bench.tick(5)
    bench.group.want(Wanted.ENABLED)
    seen = order(bench, lambda drive: drive.following)
    assert seen["A"] == seen["C"] < seen["X"] == seen["Y"] < seen["Z"]
    assert seen["Z"] - seen["X"] >= 25  # a brake's release after the others'
    assert bench.group.following()


def test_groups_are_disabled_in_reverse_each_when_the_brake_of_the_one_before_holds():
    bench = bench_of_groups(brake_close_s=0.1, gravity=1e6)
    bench.enable()
    bench.group.want(Wanted.OFF)
    seen = order(bench, lambda drive: drive.state is not State.OPERATION_ENABLED)
    assert seen["Z"] >= 50
    assert seen["Z"] < seen["X"] == seen["Y"] < seen["A"] == seen["C"]
    bench.tick(100)
    assert bench.group.positions == pytest.approx(bench.setpoints, abs=2)


@pytest.mark.parametrize("wanted", [Wanted.QUICK_STOP, Wanted.RESET])
def test_quick_stop_and_reset_go_to_all_at_once(wanted):
    bench = bench_of_groups()
    bench.enable()
    bench.group.want(wanted)
    assert {drive.wanted for drive in bench.group.drives} == {wanted}


def test_a_quick_stop_in_between_ends_the_waiting():
    bench = bench_of_groups(enable_delay_s=0.1)
    bench.tick(5)
    bench.group.want(Wanted.ENABLED)
    bench.tick(20)
    bench.group.want(Wanted.QUICK_STOP)
    bench.tick(200)
    assert {drive.wanted for drive in bench.group.drives} == {Wanted.QUICK_STOP}
    assert not any(drive.state is State.OPERATION_ENABLED for drive in bench.group.drives)


def test_a_drive_that_does_not_switch_off_keeps_the_others_on_for_a_while_only():
    drives = [Drive(NodeSettings(name, "can0", i, "", enable_group=i)) for i, name in enumerate("XY", 1)]
    enabling = Enabling(drives)
    for drive in drives:
        drive.want(Wanted.ENABLED)
        drive.receive(0x180 + drive.settings.node, memoryview(b"\x37\x12\0\0\0\0"), 0.0)
    enabling.want(Wanted.OFF)
    assert [drive.wanted for drive in drives] == [Wanted.ENABLED, Wanted.OFF]
    enabling.progress(10.0)
    enabling.progress(10.0 + MAX_WAIT_S)
    assert drives[0].wanted is Wanted.ENABLED
    enabling.progress(10.1 + MAX_WAIT_S)
    assert drives[0].wanted is Wanted.OFF
    assert not enabling.waits


def test_without_groups_all_are_told_in_the_same_tick():
    drives = [Drive(NodeSettings(name, "can0", i, "")) for i, name in enumerate("XY", 1)]
    enabling = Enabling(drives)
    enabling.want(Wanted.ENABLED)
    assert not enabling.waits
    assert [drive.wanted for drive in drives] == [Wanted.ENABLED] * 2


def in_order(names):
    drives = [Drive(NodeSettings(name, "can0", i, "", enable_group=i)) for i, name in enumerate(names, 1)]
    return Enabling(drives), drives


def tell(drive, statusword):
    drive.receive(0x180 + drive.settings.node, memoryview(statusword.to_bytes(2, "little") + bytes(4)), 0.0)


@pytest.mark.parametrize(
    ("homes", "statusword", "done"),
    [
        (False, 0x1237, True),  # it follows
        (False, 0x0237, False),  # in operation, and not yet following
        (True, 0x0237, True),  # in homing mode there is nothing to follow
        (True, 0x0233, False),  # switched on only
    ],
)
def test_a_drive_is_enabled_when_it_follows_or_in_homing_when_it_is_in_operation(homes, statusword, done):
    enabling, drives = in_order("XY")
    assert enabling.waits is False
    if homes:
        drives[0].leave_cyclic()
    enabling.want(Wanted.ENABLED)
    tell(drives[0], statusword)
    enabling.progress(0.0)
    assert drives[1].wanted is (Wanted.ENABLED if done else Wanted.OFF)
    assert enabling.waits is not done


def test_each_group_may_take_its_time_to_switch_off_from_its_own_turn_on():
    enabling, drives = in_order("XYZ")
    for drive in drives:
        drive.want(Wanted.ENABLED)
        tell(drive, 0x1237)
    enabling.want(Wanted.OFF)
    wanted = []
    for at_s in (0.0, MAX_WAIT_S, MAX_WAIT_S + 0.1, 2 * MAX_WAIT_S, 2 * MAX_WAIT_S + 0.2):
        enabling.progress(at_s)
        wanted.append([drive.wanted for drive in drives].count(Wanted.OFF))
    assert wanted == [1, 1, 2, 2, 3]
