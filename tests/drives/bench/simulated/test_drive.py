"""The simulated drive on a stepped bus: NMT, PDO, CiA 402, cyclic position, faults, homing."""

from __future__ import annotations

from itertools import pairwise

import pytest
from support.drives.stepped_drives import PERIOD_S, Bench

from drives import commission, pdo
from drives.bench.simulated import LostSync, Parameters, SimulatedDrive
from drives.bench.simulated.machine402 import Power
from drives.bench.virtual.virtual_bus import SteppedBus
from drives.profile import Profile
from drives.settings import MasterSettings

STEP = 400  # counts per tick at "full feed": 200000 counts/s


def running(bench: Bench, ticks: int = 100) -> int:
    """Enable and move at STEP per tick; the last target."""
    bench.enable()
    start = bench.actual["X"]
    for k in range(ticks):
        bench.tick(targets=[start + STEP * k] * len(bench.nodes))
    return start + STEP * (ticks - 1)


def test_a_drive_boots_once_and_is_then_pre_operational() -> None:
    bus = SteppedBus()
    drive = SimulatedDrive(5)
    bus.attach(drive)
    port, buffer = bus.port(), bytearray(16)
    bus.advance(1.0)
    assert port.receive_into(buffer)
    assert pdo.unpack(buffer) == (0x705, b"\x00")
    assert not port.receive_into(buffer)
    assert drive.nmt == pdo.NMT_PRE_OPERATIONAL


def test_a_setpoint_is_latched_by_sync_and_reached_one_period_later_plus_the_lag() -> None:
    """RPDO in period k, latched by SYNC k + 1, demand there at SYNC k + 2."""
    bench = Bench()
    bench.enable()
    demands = []
    for target in (0, 1000, 1000, 1000, 1000):
        bench.tick(targets=[target])
        bench.rig.advance(bench.rig.now_s + 0.0015)
        demands.append(round(bench.drive.axis.servo.start))
    assert demands == [0, 0, 0, 1000, 1000]


def test_all_drives_move_with_the_same_sync() -> None:
    bench = Bench("XYZAC")
    running(bench)
    assert len(set(bench.actual.values())) == 1


def test_the_statusword_says_follows_only_when_the_target_is_used() -> None:
    bench = Bench()
    bench.tick(0x06)
    bench.tick(0x06)
    assert not bench.statuswords["X"] & 0x1000
    bench.enable()
    assert bench.statuswords["X"] & 0x1000


def test_the_feedback_is_the_position_at_the_sync_and_comes_within_the_period() -> None:
    bench = Bench()
    last = running(bench, 200)
    bench.wait()
    lag_s = 2**0.5 / (2 * 3.141592653589793 * 60.0)
    demand_at_the_sync = last - 2 * STEP
    assert bench.actual["X"] == pytest.approx(demand_at_the_sync - lag_s * STEP / PERIOD_S, abs=2)


@pytest.mark.parametrize("kind", list(LostSync))
def test_one_lost_sync_at_full_feed_trips_no_kind_of_drive(kind: LostSync) -> None:
    bench = Bench(lost_sync=kind, following_error_counts=100_000)
    last = running(bench)
    bench.wait(1)  # neither SYNC nor setpoint
    for k in range(1, 100):
        bench.tick(targets=[last + STEP * k])
    assert bench.statuswords["X"] & 0x6F == 0x27
    assert bench.drive.lost_syncs == 1
    assert bench.emergencies == []


def test_after_a_lost_sync_a_holding_drive_stands_one_period_and_makes_no_double_step() -> None:
    bench = Bench()
    last = running(bench)
    demands = []
    bench.wait(1)
    for k in range(1, 8):
        bench.tick(targets=[last + STEP * k])
        bench.rig.advance(bench.rig.now_s + 0.0015)
        demands.append(bench.drive.axis.servo.start)
    steps = [b - a for a, b in pairwise(demands)]
    assert max(steps) <= STEP
    assert steps.count(0.0) <= 1


def test_an_extrapolating_drive_goes_on_and_waits_for_the_targets_to_catch_up() -> None:
    bench = Bench(lost_sync=LostSync.EXTRAPOLATE)
    last = running(bench)
    bench.rig.advance(bench.rig.now_s + 0.0015)
    before = bench.drive.axis.servo.end
    bench.wait(1)
    bench.tick(targets=[last + STEP])
    bench.rig.advance(bench.rig.now_s + 0.0015)
    assert bench.drive.axis.servo.start == before + STEP


def test_a_drive_that_faults_on_lost_sync_does_so_after_two_misses_and_says_why() -> None:
    bench = Bench(lost_sync=LostSync.FAULT)
    running(bench)
    bench.wait(2.4)
    assert bench.drive.axis.power is Power.ENABLED
    bench.wait(0.4)
    assert (1, 0x8700) in bench.emergencies
    bench.wait(100)
    assert bench.drive.axis.power is Power.FAULT


def test_a_second_sync_at_once_makes_no_step() -> None:
    bench = Bench()
    last = running(bench)
    bench.wait(0.1)
    bench.port.send(pdo.frame(pdo.SYNC))
    bench.rig.advance(bench.rig.now_s + 0.0015)
    demand = bench.drive.axis.servo.start
    bench.ticks -= 0.1  # type: ignore[assignment]
    bench.tick(targets=[last + STEP])
    bench.rig.advance(bench.rig.now_s + 0.0015)
    assert bench.drive.axis.servo.start - demand == STEP


def test_jitter_of_sync_does_not_change_the_motion() -> None:
    positions = []
    for jitter in (0.0, 0.2):
        bench = Bench()
        bench.enable()
        for k in range(50):
            bench.tick(targets=[STEP * k])
            if k % 7 == 3:  # this tick's SYNC is late, the next in time
                bench.wait(jitter)
                bench.ticks -= jitter  # type: ignore[assignment]
        positions.append(bench.drive.axis.servo.position)
    assert positions[0] == positions[1]


def test_a_following_error_beyond_the_window_is_fault_8611_and_the_drive_ramps_down() -> None:
    bench = Bench(following_error_counts=500)
    bench.enable()
    for k in range(30):
        bench.tick(targets=[4000 * k])
    assert (1, 0x8611) in bench.emergencies
    for _ in range(200):
        bench.tick(0x00)
    assert bench.statuswords["X"] & 0x4F == 0x08
    assert bench.statuswords["X"] & 0x2000


def test_a_fault_is_reset_by_a_rising_edge_and_only_when_its_cause_is_gone() -> None:
    bench = Bench()
    bench.enable()
    bench.drive.inject(0x2310, bench.rig.now_s, lasting=True)
    for word in [0x00] * 30 + [0x80] * 5:
        bench.tick(word)
    assert bench.statuswords["X"] & 0x4F == 0x08
    bench.drive.axis.causes.clear()
    for word in [0x80] * 5:
        bench.tick(word)
    assert bench.statuswords["X"] & 0x4F == 0x08, "no edge, no reset"
    for word in [0x00] * 3 + [0x80] * 3:
        bench.tick(word)
    assert bench.statuswords["X"] & 0x4F == 0x40
    assert bench.emergencies == [(1, 0x2310), (1, 0)]


def test_a_silent_master_makes_the_drives_stop_by_themselves() -> None:
    bench = Bench("XY")
    running(bench)
    bench.wait(200)
    assert {(1, 0x8130), (2, 0x8130)} <= set(bench.emergencies)
    for drive in bench.rig.drives.values():
        assert drive.axis.power is Power.DISABLED
        assert drive.axis.servo.velocity == 0.0
        assert drive.nmt == pdo.NMT_PRE_OPERATIONAL


def test_an_nmt_stop_in_motion_is_a_lost_connection() -> None:
    bench = Bench()
    running(bench)
    bench.port.send(pdo.frame(pdo.NMT, b"\x02\x01"))
    bench.wait(100)
    assert bench.drive.axis.power is Power.DISABLED
    assert bench.drive.nmt == pdo.NMT_STOPPED


def test_a_reset_node_forgets_what_was_written_and_boots_again() -> None:
    bench = Bench(following_error_counts=777)
    running(bench)
    bench.port.send(pdo.frame(pdo.NMT, b"\x81\x00"))
    bench.wait(50)
    assert bench.drive.nmt == pdo.NMT_PRE_OPERATIONAL
    assert bench.drive.dictionary.get(0x6065) == 0xFFFF_FFFF
    assert bench.drive.axis.power is Power.DISABLED
    commission.commission(bench.network, bench.nodes, MasterSettings())
    assert bench.drive.nmt == pdo.NMT_OPERATIONAL


def test_a_quick_stop_ramps_down_within_its_deceleration_and_switches_off() -> None:
    bench = Bench()
    running(bench)
    demands = []
    for _ in range(40):
        bench.tick(0x02)
        demands.append(bench.drive.axis.servo.start)
    assert bench.statuswords["X"] & 0x4F == 0x40
    assert demands[-1] - demands[0] < 5 * STEP


def test_a_target_outside_of_the_software_limits_is_held_there_and_says_so() -> None:
    bench = Bench(counts_min=-1000, counts_max=1000)
    bench.enable()
    for k in range(60):
        bench.tick(targets=[min(50 * k, 2000)])
    assert bench.actual["X"] == pytest.approx(1000, abs=1)
    assert bench.statuswords["X"] & 0x800
    for _ in range(30):
        bench.tick(targets=[900])
    assert not bench.statuswords["X"] & 0x800


def test_an_rpdo_of_the_wrong_length_is_an_emergency_and_not_used() -> None:
    bench = Bench()
    running(bench)
    bench.port.send(pdo.frame(0x201, bytes(4)))
    bench.tick()
    bench.tick()
    assert bench.emergencies == [(1, 0x8210)]


def test_mapping_is_refused_while_the_pdo_is_on_and_for_what_cannot_be_mapped() -> None:
    bench = Bench()
    drive = commission.Drive(bench.network, bench.nodes[0])
    why = "this test wants it"
    with pytest.raises(commission.CommissionError, match="0x06010000"):
        drive.write(commission.Setting(0x1600, 0, 0, why))
    drive.write(commission.Setting(0x1400, 1, 0x8000_0201, why))
    drive.write(commission.Setting(0x1600, 0, 0, why))
    with pytest.raises(commission.CommissionError, match="0x06040041"):
        drive.write(commission.Setting(0x1600, 1, 0x6065_0020, why))


def test_another_mapping_works_too() -> None:
    """Mode of operation in the second RPDO, effective at once (type 255)."""
    bench = Bench()
    drive = commission.Drive(bench.network, bench.nodes[0])
    for index, sub, value in (
        (0x1600 + 1, 0, 0),
        (0x1601, 1, 0x6060_0008),
        (0x1601, 0, 1),
        (0x1401, 1, 0x301),
    ):
        drive.write(commission.Setting(index, sub, value, "this test wants it"))
    bench.start_s = bench.rig.now_s - bench.ticks * PERIOD_S
    bench.port.send(pdo.frame(0x301, b"\x06"))
    bench.wait(5)
    assert bench.drive.axis.mode == 6


@pytest.mark.parametrize("method", [35, 37])
def test_homing_here_makes_the_present_position_the_homed_one(method: int) -> None:
    bench = Bench(
        parameters=Parameters(position_counts=12345), homing_method=method, homing_position_counts=-700
    )
    home(bench)
    assert bench.actual["X"] == -700


@pytest.mark.parametrize(("method", "side"), [(17, 0), (18, 1)])
def test_homing_on_a_limit_switch_finds_its_edge_within_a_period_of_slow_search(
    method: int, side: int
) -> None:
    switches = (-90_000.0, 70_000.0)
    bench = Bench(
        parameters=Parameters(switches=switches),
        homing_method=method,
        homing_position_counts=5000,
        profile=Profile(homing_methods=(17, 18)),
    )
    home(bench)
    axis = bench.drive.axis
    assert axis.servo.position - axis.servo.start == pytest.approx(0.0, abs=1.0)
    # The switch's edge is now at 5000, and the drive stands near it, off the switch.
    off = (axis.servo.position - 5000) * (1 if side == 0 else -1)
    assert 0 < off < 20_000


def home(bench: Bench) -> None:
    commission.set_mode(bench.network, bench.nodes[0], 6)
    bench.start_s = bench.rig.now_s - bench.ticks * PERIOD_S
    bench.enable()
    for k in range(1000):
        bench.tick(0x1F)
        if k > 4 and bench.statuswords["X"] & 0x3400 == 0x1400:
            break
    assert bench.statuswords["X"] & 0x3400 == 0x1400
    bench.tick()


def test_homing_ends_in_the_same_place_in_its_new_counting_when_csp_resumes() -> None:
    bench = Bench(homing_position_counts=4000)
    home(bench)
    commission.set_mode(bench.network, bench.nodes[0], 8)
    bench.start_s = bench.rig.now_s - bench.ticks * PERIOD_S
    for _ in range(20):
        bench.tick()
    assert bench.actual["X"] == 4000
    assert bench.statuswords["X"] & 0x1000


def test_the_same_run_twice_gives_the_same_positions() -> None:
    runs = []
    for _ in range(2):
        bench = Bench("XYZAC", stiffness={"Y": 0.95})
        running(bench)
        runs.append([drive.axis.servo.position for drive in bench.rig.drives.values()])
    assert runs[0] == runs[1]
    assert runs[0][0] != runs[0][1], "the softer axis lags more"
