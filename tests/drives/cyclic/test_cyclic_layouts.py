"""The cyclic part on simulated drives that are commissioned in every way a profile allows."""

import itertools
from dataclasses import replace

import pytest
from support.drives.group_bench import GroupBench, T, nodes
from support.drives.makers_sheets import SHEETS, sheet_of

from controller.machine import drive_profiles
from drives import pdo
from drives.bench.simulated import Parameters
from drives.cia402 import Wanted
from drives.cyclic.drive_fault import DriveFault
from drives.profile import GENERIC, CyclicMode, Supervision

WAYS = [
    ({}, {}, "as shipped"),
    ({"rpdo": 3, "tpdo": 3}, {}, "other PDOs, as EPOS4 has them"),
    ({"rpdo": 2, "tpdo": 4}, {}, "two numbers that differ"),
    ({"mode": CyclicMode.IP}, {}, "interpolated position"),
    ({"mode": CyclicMode.IP, "rpdo": 4}, {}, "interpolated position by RPDO 4"),
    ({}, {"feed_forward": True}, "velocity feed-forward"),
    ({"rpdo": 3, "command_rpdo": 1}, {"feed_forward": True}, "feed-forward, controlword by RPDO 1"),
    ({}, {"feedback_every": 4}, "feedback every fourth SYNC"),
    ({"supervision": Supervision.GUARDING}, {}, "node guarding"),
    ({"quick_stop_code": 6}, {}, "quick stop that stays"),
    ({}, {"brake": True}, "gravity axes"),
]


@pytest.mark.parametrize(("profile", "settings", "reason"), WAYS, ids=[way[2] for way in WAYS])
def test_five_drives_enable_follow_stop_and_come_back(profile, settings, reason):
    bench = GroupBench(nodes(profile=replace(GENERIC, **profile), **settings))
    bench.tick(10)
    before = list(bench.group.positions)
    bench.enable()
    assert bench.group.positions == before, f"{reason}: no count moves while drives are enabled"
    for i in range(250):
        step = min(i, 250 - i, 50)
        bench.setpoints = [s + step for s in bench.setpoints]
        bench.tick()
    bench.tick(150)
    assert bench.fault == (DriveFault.NONE, -1), reason
    assert bench.group.positions == bench.setpoints, reason
    assert sum(drive.lost for drive in bench.group.drives) == 0, reason
    bench.group.want(Wanted.QUICK_STOP)
    bench.tick(50)
    assert bench.fault == (DriveFault.NONE, -1), reason
    bench.group.want(Wanted.RESET)
    bench.tick(60)
    bench.group.want(Wanted.OFF)
    bench.tick(60)
    bench.enable()
    assert bench.fault == (DriveFault.NONE, -1), reason


@pytest.mark.parametrize("brake", [False, True])
@pytest.mark.parametrize("name", SHEETS)
def test_drives_of_every_family_follow_by_their_maker_s_data_sheet(name, brake):
    profile = drive_profiles.load(name)
    settings = {"period_s": 0.01, "homing_method": profile.homing_methods[-1], "brake": brake}
    bench = GroupBench(
        nodes("XY", profile=profile, eds=sheet_of(name), following_error_counts=5000, **settings)
    )
    bench.enable()
    for i in range(100):
        step = min(i, 100 - i)
        bench.setpoints = [s + step for s in bench.setpoints]
        bench.tick()
    bench.tick(50)
    assert bench.group.positions == bench.setpoints
    for wanted in (Wanted.QUICK_STOP, Wanted.RESET, Wanted.OFF):
        bench.group.want(wanted)
        bench.tick(30)
    bench.enable()
    bench.tick(20)
    assert bench.fault == (DriveFault.NONE, -1)


def test_feed_forward_takes_the_servo_lag_away_and_leaves_that_of_the_bus():
    lags = {}
    for ahead in (False, True):
        bench = GroupBench(nodes("X", feed_forward=ahead))
        bench.enable()
        for i in range(300):
            bench.setpoints = [bench.setpoints[0] + min(i // 2, 100)]
            bench.tick()
        lags[ahead] = bench.setpoints[0] - bench.group.positions[0]
    # Sent with tick k, latched by SYNC k + 1, reached and reported at SYNC k + 2, read in tick k + 3.
    assert lags[True] == pytest.approx(3 * 100, abs=3), lags
    assert lags[False] > lags[True] + 150, lags


def test_with_feed_forward_a_lost_controlword_comes_again_at_once():
    bench = GroupBench(nodes("XY", feed_forward=True))
    bench.enable()
    left = 1

    def tamper(_at_s, can_id, _frame):
        nonlocal left
        if can_id == 0x301 and left:
            left -= 1
            return ()
        return (0.0,)

    bench.rig.buses["can"].tamper = tamper
    bench.group.want(Wanted.QUICK_STOP)
    bench.tick(5)
    assert left == 0
    assert bench.devices[0].axis.statusword & 0x6F != 0x27


def test_feedback_every_fourth_sync_is_lost_eight_syncs_after_it_was_last_heard():
    bench = GroupBench(nodes("XY", feedback_every=4))
    bench.enable()
    bench.tick(20)
    lost = []
    heard_s = bench.group.drives[1].position_at_s
    bench.rig.buses["can"].tamper = lambda _at, can_id, _frame: () if can_id == 0x182 else (0.0,)
    for _ in range(14):
        bench.tick()
        lost.append(bench.fault[0] is DriveFault.FEEDBACK_LOST)
        if lost[-1]:
            break
    assert round((bench.now_s - heard_s) / T) == 8
    assert bench.fault == (DriveFault.FEEDBACK_LOST, 1)
    assert bench.group.drives[1].lost == 2


def test_one_lost_feedback_of_every_fourth_is_counted_only():
    bench = GroupBench(nodes("XY", feedback_every=4))
    bench.enable()
    bench.tick(20)
    left = 1

    def tamper(_at_s, can_id, _frame):
        nonlocal left
        if can_id == 0x182 and left:
            left -= 1
            return ()
        return (0.0,)

    bench.rig.buses["can"].tamper = tamper
    bench.tick(40)
    assert bench.fault == (DriveFault.NONE, -1)
    assert [drive.lost for drive in bench.group.drives] == [0, 1]


def test_a_guarded_drive_is_asked_and_answers_once_a_heartbeat():
    bench = GroupBench(nodes(profile=replace(GENERIC, supervision=Supervision.GUARDING)))
    frames = []
    bus = bench.rig.buses["can"]
    for node in range(1, 6):
        bus.watch(pdo.REMOTE_FLAG | 0x700 + node, lambda frame, at_s: frames.append((at_s, "asked")))
        bus.watch(0x700 + node, lambda frame, at_s: frames.append((at_s, "answered")))
    bench.tick(500)
    asked = [at_s for at_s, what in frames if what == "asked"]
    assert len(asked) == pytest.approx(5 * 500 * T / bench.master.heartbeat_s, abs=2)
    assert len(frames) - len(asked) == pytest.approx(len(asked), abs=1)
    assert min(b - a for a, b in itertools.pairwise(asked)) > 0.5 * T  # never two in one tick


def test_a_guarded_drive_that_does_not_answer_is_a_lost_one():
    bench = GroupBench(nodes(profile=replace(GENERIC, supervision=Supervision.GUARDING)))
    bench.enable()
    bench.tick(100)
    bench.rig.buses["can"].tamper = lambda _at, can_id, _frame: () if can_id == 0x703 else (0.0,)
    ticks = bench.until(lambda: bench.fault[0] is not DriveFault.NONE)
    assert bench.fault == (DriveFault.HEARTBEAT_LOST, 2)
    assert ticks * T <= bench.master.consumer_s + bench.master.heartbeat_s


def test_a_guarded_drive_stops_by_itself_when_the_controller_falls_silent():
    bench = GroupBench(nodes("X", profile=replace(GENERIC, supervision=Supervision.GUARDING)))
    bench.enable()
    bench.tick(100)
    bench.rig.advance(bench.now_s + 0.5)
    assert bench.devices[0].axis.statusword & 0x6F != 0x27


def test_two_buses_each_with_its_own_sync_carry_one_group():
    bench = GroupBench([*nodes("XYZ"), *(replace(n, node=n.node + 3) for n in nodes("AC", bus="other"))])
    syncs = {name: [] for name in bench.rig.buses}
    for name, bus in bench.rig.buses.items():
        bus.watch(pdo.SYNC, lambda _frame, at_s, name=name: syncs[name].append(at_s))
    bench.enable()
    for _ in range(100):
        bench.setpoints = [s + 20 for s in bench.setpoints]
        bench.tick()
    bench.tick(100)
    assert bench.group.positions == bench.setpoints
    assert bench.fault == (DriveFault.NONE, -1)
    assert len(syncs["can"]) == len(syncs["other"]) > 200


def test_a_gravity_axis_does_not_move_on_its_way_through_quick_stop_and_off():
    """The current is there until the brake holds: 605Ah stays in quick stop, then the orderly way."""
    nature = Parameters(brake_close_s=0.1, gravity=1e6)
    bench = GroupBench(nodes("Z", brake=True), parameters=nature)
    bench.enable()
    bench.tick(50)
    where = bench.group.positions[0]
    for wanted in (Wanted.QUICK_STOP, Wanted.RESET, Wanted.OFF):
        bench.group.want(wanted)
        bench.tick(100)
    bench.tick(100)
    assert bench.group.positions[0] == pytest.approx(where, abs=2)
    assert bench.devices[0].axis.brake.holds
    bench.enable()
