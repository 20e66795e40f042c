"""Jogging on the stepped machine: in every frame, with servos and a bus, and nobody there to stop it."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from support.machines.interrupted_runs import Items, source, up
from support.machines.stepped_runs import largest

from controller.geometry.vectors import Frame, dot, scale, subtract
from controller.ipc.handoff import COLUMN, DEAD_MAN_S, Jog, send_jog
from controller.plan.path import path
from controller.runtime.stepped import SteppedMachine
from controller.service.jogging import Stance
from controller.state.modes import ALL_AXES, Fault, Mode

REFRESH_S = 0.05
SERVO_S = 0.15  # a servo comes up with its setpoint
HIGH = (30.0, 20.0, 90.0, 0.1, -0.4)
NO_OFFSET = Frame()


def here(stepped: SteppedMachine, part: Frame = NO_OFFSET) -> Stance:
    return Stance(stepped.machine, stepped.kinematics, stepped.joints, part, ALL_AXES)


def order(stepped: SteppedMachine, frame: str, axis: str, share: float) -> Jog:
    return here(stepped, stepped.machine.offsets[0]).continuous(frame, axis, share)


def straight(stepped: SteppedMachine, target: tuple[float, ...], mm_s: float) -> Jog:
    """The line of the joints that ends there."""
    way = tuple([b - a for a, b in zip(stepped.joints, target, strict=True)])
    return Jog(way, mm_s / math.hypot(*way[:3]), 1.0)


def held_down(stepped: SteppedMachine, jog: Jog, seconds: float) -> np.ndarray:
    """Rows of the time in which a key is down."""
    period_s = stepped.machine.period_s
    rows = []
    for _ in range(round(seconds / REFRESH_S)):
        send_jog(stepped._operator, jog)
        rows.append(stepped.go(round(REFRESH_S / period_s)))
    return np.concatenate(rows)


def gone(stepped: SteppedMachine, seconds: float) -> np.ndarray:
    """Rows of the time after whoever held the key is dead; the last refresh is one interval old."""
    return stepped.go(round(seconds / stepped.machine.period_s))


def columns(rows: np.ndarray, name: str) -> np.ndarray:
    first = COLUMN[f"{name}_0"]
    return rows[:, first : first + 5]


def stop_s(stepped: SteppedMachine, jog: Jog) -> float:
    """The stop of the slowest axis of the line, by its limits."""
    rows = [(a.limits, abs(d)) for a, d in zip(stepped.machine.axes, jog.direction, strict=True) if d]
    acceleration = min(limits.acceleration / d for limits, d in rows)
    jerk = min(limits.jerk / d for limits, d in rows)
    return jog.speed / acceleration + acceleration / jerk


@pytest.mark.parametrize(("frame", "axis"), [("joint", "X"), ("joint", "C"), ("part", "Y"), ("tool", "Z")])
def test_after_the_last_refresh_the_motors_stand_within_the_dead_man_and_a_stop(
    frame: str, axis: str
) -> None:
    stepped = up()
    jog = order(stepped, frame, axis, random.choice((-1.0, 1.0)) * 0.5)
    moving = held_down(stepped, jog, 0.5)
    after = gone(stepped, DEAD_MAN_S + stop_s(stepped, jog) + 2.0 * SERVO_S)
    period_s = stepped.machine.period_s
    still = after[round((DEAD_MAN_S - REFRESH_S + stop_s(stepped, jog)) / period_s) :]
    assert np.ptp(columns(still, "joint_command"), axis=0).max() == 0.0
    motors = columns(still[round(SERVO_S / period_s) :], "actual")
    counts = np.ptp(motors, axis=0) * [abs(a.counts_per_unit) for a in stepped.machine.axes]
    assert counts.max() <= 20.0
    assert np.ptp(columns(moving, "actual"), axis=0).max() > 0.05  # it did move
    assert stepped.cycle.modes.mode is Mode.READY and stepped.cycle.modes.fault is Fault.NONE
    excess = largest(
        np.concatenate([columns(moving, "joint_command"), columns(after, "joint_command")]), stepped.machine
    )
    assert excess[0] <= 1.0005 and excess[1] <= 1.002 and excess[2] <= 1.02


def test_with_the_rotaries_anywhere_the_tool_leaves_the_part_along_its_axis() -> None:
    stepped, seed = up(), random.randrange(2**32)
    rng = random.Random(seed)
    for axis, way in (("A", rng.uniform(5.0, 25.0)), ("C", rng.uniform(-90.0, 90.0))):
        send_jog(stepped._operator, here(stepped).step("joint", axis, way))
        stepped.go(5)
        stepped.go(20_000, lambda: stepped.cycle.modes.mode is Mode.READY)
    before = stepped.kinematics.forward(stepped.joints, 50.0)
    send_jog(stepped._operator, here(stepped).step("tool", "Z", -10.0))
    stepped.go(5)
    rows = stepped.go(20_000, lambda: stepped.cycle.modes.mode is Mode.READY)
    for row in columns(rows, "joint_command")[::20]:
        tip = subtract(stepped.kinematics.forward(tuple([float(q) for q in row]), 50.0).tip, before.tip)
        along = dot(tip, before.axis)
        assert subtract(tip, scale(before.axis, along)) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9), seed
        assert -10.0 - 1e-9 <= along <= 1e-9
    end = subtract(stepped.kinematics.forward(stepped.joints, 50.0).tip, before.tip)
    assert end == pytest.approx(scale(before.axis, -10.0), abs=1e-9)


def test_a_key_held_at_the_end_of_the_travel_is_no_fault_for_motor_or_drive() -> None:
    stepped = up()
    for share in (1.0, -1.0):
        axis = stepped.machine.axes[1]
        for _ in range(20):
            held_down(stepped, order(stepped, "joint", "Y", share), 0.5)
            if stepped.cycle.follow.at_rest:
                break
        end = axis.travel_max if share > 0.0 else axis.travel_min
        assert stepped.joints[1] == pytest.approx(end, abs=1e-9)
        gone(stepped, 0.5)
        assert stepped.cycle.modes.mode is Mode.READY and stepped.cycle.modes.fault is Fault.NONE


def test_a_program_starts_from_where_a_jog_has_left_the_machine() -> None:
    stepped = up()
    send_jog(stepped._operator, straight(stepped, HIGH, 20.0))
    stepped.go(5)
    stepped.go(50_000, lambda: stepped.cycle.modes.mode is Mode.READY)
    assert stepped.joints == pytest.approx(HIGH)
    built = source("G21 G90 G54\nG53 G0 X-20. Y10.\nG1 Z40. F3000.\nM30\n", stepped.machine)
    tracer = path.PathBuilder(built.name, built.machine, built.kinematics, stepped.joints, {})
    run = stepped.run(Items(tracer.items(built.blocks)))
    assert run.result == "completed", run.fault_text
    assert columns(run.rows, "joint_command")[0] == pytest.approx(HIGH, abs=1e-3)
    assert max(largest(columns(run.rows, "joint_command"), stepped.machine)) <= 1.02
