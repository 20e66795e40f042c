"""A motor without current runs on against friction, less far with a brake; its encoder goes on counting."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import Lone
from support.drives.stepped_drives import Bench

from drives.bench.simulated import Parameters, build
from drives.settings import NodeSettings

SPEED = 10_000_000
COAST, BRAKE = 5e7, 2e8


def moving(**nature: object) -> Lone:
    lone = Lone(Parameters(coast_counts_s2=COAST, brake_counts_s2=BRAKE, **nature))  # type: ignore[arg-type]
    lone.enable(3)
    lone.write(0x60FF, 0, SPEED, 4)
    lone.run(0.3)
    assert lone.drive.motor_counts_s == pytest.approx(SPEED, rel=1e-3)
    return lone


def way(deceleration: float) -> float:
    return SPEED**2 / 2 / deceleration


@pytest.mark.parametrize(("brake", "deceleration"), [(False, COAST), (True, COAST + BRAKE)])
@pytest.mark.parametrize("cause", ["sto", "voltage", "supply"])
def test_it_comes_to_rest_by_friction_or_by_the_brake_and_friction(
    cause: str, brake: bool, deceleration: float
) -> None:
    lone = moving(brake=brake, absolute_encoder=True)
    before = lone.drive.motor_counts
    if cause == "sto":
        lone.drive.torque_off(True, lone.bus.now_s)
    elif cause == "voltage":
        lone.put(0x605, bytes.fromhex("2B40600000000000"), wait_s=0.0)
    else:
        lone.drive.power_cycle(lone.bus.now_s)
    lone.wait(0.5 * SPEED / deceleration)
    assert lone.drive.motor_counts_s == pytest.approx(0.5 * SPEED, rel=0.06)
    lone.wait(0.6 * SPEED / deceleration)
    assert lone.drive.motor_counts_s == 0.0
    assert lone.drive.motor_counts - before == pytest.approx(way(deceleration), abs=SPEED * 0.0011)
    assert lone.read(0x6064, signed=True) == round(lone.drive.motor_counts), "the encoder goes on counting"


def test_a_supply_that_is_gone_makes_the_drive_deaf_and_silent_until_it_boots() -> None:
    lone = moving(brake=False)
    lone.write(0x1017, 0, 5, 2)
    lone.drive.power_off(lone.bus.now_s)
    before = len(lone.heard)
    lone.wait(0.05)
    assert lone.sdo(b"\x40\x00\x10") == [] and len(lone.heard) == before
    lone.drive.power_on(lone.bus.now_s)
    lone.wait(0.05)
    assert lone.heard[before:] == [(0x705, b"\0")]


def test_an_incremental_encoder_loses_its_count_with_the_supply_and_the_motor_does_not_jump() -> None:
    lone = moving(brake=False)
    drive = lone.drive
    true = drive.motor_counts - drive.origin_counts
    drive.power_off(lone.bus.now_s)
    lone.wait(0.1)
    drive.power_on(lone.bus.now_s)
    assert abs(drive.motor_counts) < 1.0
    lone.wait(0.3)
    assert lone.read(0x6064, signed=True) == pytest.approx(way(COAST) * 0.25, rel=0.05), "it coasted on"
    assert drive.motor_counts - drive.origin_counts - true == pytest.approx(way(COAST), rel=0.03)


def test_power_that_comes_back_again_at_once_changes_nothing() -> None:
    lone = Lone()
    lone.drive.power_on(lone.bus.now_s)
    assert lone.heard == [(0x705, b"\0")]


def test_a_jammed_motor_does_not_coast() -> None:
    lone = moving(brake=False)
    lone.drive.jam(True, lone.bus.now_s)
    at = lone.drive.motor_counts
    lone.drive.torque_off(True, lone.bus.now_s)
    lone.wait(0.2)
    assert lone.drive.motor_counts == at


def test_the_feedback_shows_a_coasting_axis() -> None:
    bench = Bench(parameters=Parameters(brake=False, coast_counts_s2=COAST))
    bench.enable()
    for k in range(100):
        bench.tick(targets=[SPEED // 500 * k])
    bench.drive.torque_off(True, bench.rig.now_s)
    seen = []
    for _ in range(200):
        bench.tick(0x00)
        seen.append(bench.actual["X"])
    assert seen[-1] - seen[2] > 0.8 * way(COAST) and seen[-1] == seen[-2]


def test_an_axis_with_a_brake_has_one_and_its_friction_comes_from_its_acceleration() -> None:
    node = NodeSettings("X", "can", 1, "", acceleration_counts_s2=4e8)
    bare = build.drive(node, Parameters()).parameters
    assert (bare.brake, bare.coast_counts_s2, bare.brake_counts_s2) == (False, 1e8, 4e8)
    assert build.drive(NodeSettings("Z", "can", 1, "", brake=True), Parameters()).parameters.brake
