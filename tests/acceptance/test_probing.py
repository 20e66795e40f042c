"""Probing from text to result on the stepped clock: what is touched, where, and what is refused."""

from __future__ import annotations

import math
import random
import re

import numpy as np
import pytest
from support.machines import probing_machine
from support.suite.seed import SEED

from controller.geometry.vectors import add, norm, scale, subtract, unit
from controller.ipc.handoff import COLUMN, of_axes
from controller.machine.kinematics import kinematics_of
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import NotPossible
from controller.program.program import ProgramError
from controller.runtime import checked, replay
from controller.state.modes import Fault, Mode, Request

BALL = 3.0
CENTRE, RADIUS = (10.0, -5.0, 30.0), 15.0
SPHERE = f"""
[[solid]]
kind = "sphere"
centre_mm = {list(CENTRE)}
radius_mm = {RADIUS}
"""
PLANE = """
[[solid]]
kind = "plane"
point_mm = [0.0, 0.0, 5.0]
normal = [0, 0, 1]
"""
HEAD = "G21 G90 G54\nT99 M6\n"
FEEDS = (10.0, 60.0, 200.0, 1000.0)
TOUCHES = len(FEEDS)


def told(probed: probing_machine.Probed) -> list[list[float]]:
    """The numbers of its messages."""
    return [list(map(float, re.findall(r"-?\d+\.\d+", one))) for one in probed.said if one.startswith("Says")]


def turned(name: str, some: random.Random) -> tuple[str, tuple[float, float]]:
    """Rotary words in reach, and the pair (rad, carried)."""
    made = probing_machine.machine(name)
    words, pair = "", []
    for i in made.rotary():
        axis = made.axes[i]
        low, high = sorted((axis.travel_min, axis.travel_max))
        q = some.uniform(max(low, -0.5), min(high, 0.5))
        words += f" {axis.name}{q * axis.shown_per_unit:.9f}"
        pair.append(q)
    return words, (pair[0], pair[1])


def touches(name: str, some: random.Random, count: int) -> tuple[str, list[tuple[float, float, float]]]:
    """A program that touches a sphere in random directions and rotary positions, and its axes there."""
    kinematics = kinematics_of(probing_machine.machine(name))
    lines, axes = [HEAD + "G43.4 H99"], []
    for k in range(count):
        feed = FEEDS[k % len(FEEDS)]
        words, pair = turned(name, some)
        axis = kinematics.tool_axis(pair)
        d = unit((some.gauss(0, 1), some.gauss(0, 1), abs(some.gauss(0, 1)) + 0.1))
        gap = 0.1 if feed < 20.0 else 4.0

        def tip(off: float, axis=axis, d=d) -> str:
            at = subtract(add(CENTRE, scale(d, RADIUS + BALL + off)), scale(axis, BALL))
            return " ".join(f"{letter}{value:.9f}" for letter, value in zip("XYZ", at, strict=True))

        lines += [
            f"G0 X{CENTRE[0]} Y{CENTRE[1]} Z{CENTRE[2] + 50.0}",
            f"G0{words}",
            f"G0 {tip(20.0)}",
            f"G0 {tip(gap)}",
            f"G38.2 {tip(-2.0)} F{feed}",
            "(DEBUG, #5061 #5062 #5063)",
            f"G1 {tip(20.0)} F3000",
        ]
        axes.append(axis)
    return "\n".join([*lines, "M30\n"]), axes


@pytest.mark.parametrize(
    "name",
    [
        "trunnion",
        "oblique45",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("table_head", "head_head")),
    ],
)
def test_a_touch_is_told_within_a_micrometre_in_any_direction_and_rotary_position(name: str) -> None:
    some = random.Random(f"{SEED} {name}")
    made = probing_machine.machine(name, **{"period_s = 0.002": "period_s = 0.004"})
    text, axes = touches(name, some, TOUCHES)
    done = probing_machine.run(text, probing_machine.up(SPHERE, made))
    assert done.error == ""
    assert done.run.result == "completed", done.run.fault_text
    off = [
        norm(subtract(add(tuple(at), scale(axis, BALL)), CENTRE)) - RADIUS - BALL
        for at, axis in zip(told(done), axes, strict=True)
    ]
    assert len(off) == TOUCHES
    assert max(map(abs, off)) < 0.001, off


@pytest.mark.parametrize(("feed", "latched"), [(10.0, False), (60.0, True), (200.0, False), (1000.0, True)])
def test_the_stop_behind_a_touch_is_bounded_and_the_input_alone_tells_within_half_a_period(
    feed: float, latched: bool
) -> None:
    made = probing_machine.machine(latched=latched)
    stepped = probing_machine.up(PLANE, made)
    text = f"{HEAD}G43 H99\nG0 X1 Y2\nG0 Z5.2\nG38.2 Z2 F{feed}\n(DEBUG, #5063 #5070)\nG0 Z30\nM30\n"
    done = probing_machine.run(text, stepped)
    assert done.run.result == "completed", (done.error, done.run.fault_text)
    ((at, success),) = told(done)
    assert success == 1.0
    v = feed / 60.0
    assert abs(at - 5.0) < (1e-3 if latched else 0.5 * made.period_s * v * 1.05 + 2e-6)
    lowest = done.run.rows[:, of_axes("joint_command", 5)][:, 2].min() - 120.0 - 60.0
    j, a = made.axes[2].limits.jerk, made.axes[2].limits.acceleration
    stop = 0.5 * v * (2 * math.sqrt(v / j) if v * j <= a * a else v / a + a / j)
    assert 5.0 - lowest < 0.013 * v + 1.3 * stop + v * 0.004


def test_scatter_and_pre_travel_are_what_a_touch_is_off_by() -> None:
    part = "[probe]\npretravel_mm = 0.004\naxial_mm = 0.002\nscatter_mm = 0.001\nseed = 7\n" + PLANE
    once = "G0 Z5.2\nG38.2 Z2 F200\n(DEBUG, #5063)\nG38.4 Z8 F200\n"
    done = probing_machine.run(f"{HEAD}G43 H99\nG0 X1 Y2\n{once * 12}G0 Z30\nM30\n", probing_machine.up(part))
    assert done.run.result == "completed", (done.error, done.run.fault_text)
    off = np.array([at for (at,) in told(done)]) - 5.0
    assert abs(off.mean() + 0.002) < 0.001
    assert 0.0003 < off.std() < 0.002


def moved(done: probing_machine.Probed, line: int) -> float:
    """How far the axes went in a line of the program, mm."""
    rows = done.run.rows[done.run.rows[:, COLUMN["line"]] == line]
    joints = rows[:, of_axes("joint_command", 5)]
    return 0.0 if not len(rows) else float(np.ptp(joints, axis=0).max())


def test_a_probe_that_hangs_moves_nothing() -> None:
    stepped = probing_machine.up(PLANE)
    assert stepped.touch is not None
    stepped.touch.hang(True, stepped.rig.now_s)
    before = stepped.joints
    done = probing_machine.run(f"{HEAD}G43 H99\nG38.2 Z2 F200\nM30\n", stepped)
    assert done.run.result == "held"
    assert done.run.fault is Fault.PROBE_OPEN
    assert stepped.joints == before


def test_nothing_is_positioned_with_a_probe_that_hangs() -> None:
    stepped = probing_machine.up(PLANE)
    assert stepped.touch is not None
    stepped.touch.hang(True, stepped.rig.now_s)
    before = stepped.joints
    done = probing_machine.run(f"{HEAD}G43 H99\nG0 X20\nM30\n", stepped)
    assert done.run.fault is Fault.PROBE_HIT
    assert stepped.joints == before


def test_a_probe_that_stays_closed_behind_its_touch_is_not_led_away_for_long() -> None:
    stepped = probing_machine.up(PLANE)
    touch = stepped.touch
    assert touch is not None
    show = touch.show
    touch.show = lambda closed, now_s: show(True, now_s) if closed else None  # type: ignore[method-assign]
    done = probing_machine.run(f"{HEAD}G43 H99\nG0 Z5.2\nG38.2 Z2 F200\nG1 Z30 F200\nM30\n", stepped)
    assert done.run.fault is Fault.PROBE_STUCK
    assert moved(done, 6) < made_release() + 0.3


def made_release() -> float:
    probe = probing_machine.machine().probe
    assert probe is not None
    return probe.release_mm


def test_a_probe_that_hits_in_a_rapid_stops_it() -> None:
    done = probing_machine.run(f"{HEAD}G43 H99\nG0 Z-20\nM30\n", probing_machine.up(PLANE))
    assert done.run.fault is Fault.PROBE_HIT
    assert done.stepped.joints[2] > 120.0 + 60.0 - 20.0


def test_without_a_touch_g38_2_ends_the_program_and_g38_3_goes_on() -> None:
    far = PLANE.replace("5.0", "-50.0")
    done = probing_machine.run(
        f"{HEAD}G43 H99\nG0 Z10\nG38.3 Z9 F500\n(DEBUG, #5063 #5070)\nM30\n", probing_machine.up(far)
    )
    assert told(done)[0] == [9.0, 0.0]
    assert done.run.result == "completed"
    done = probing_machine.run(
        f"{HEAD}G43 H99\nG0 Z10\nG38.2 Z9 F500\nG0 X99\nM30\n", probing_machine.up(far)
    )
    assert "5:" in done.error and "has not touched" in done.error
    assert done.stepped.joints[0] != 99.0 + 8.0


def test_what_stands_behind_a_touch_is_read_with_what_came_of_it() -> None:
    text = (
        HEAD
        + "G43 H99\nG0 Z7\nG38.2 Z2 F200\n"
        + "G10 L2 P2 X8 Y96 Z[#5063+121]\nG0 Z30\nG55 G0 Z3\n(DEBUG, #5423)\nM30\n"
    )
    made = probing_machine.machine()
    done = probing_machine.run(text, probing_machine.up(PLANE, made))
    assert done.run.result == "completed", (done.error, done.run.fault_text)
    assert done.stepped.joints[2] == pytest.approx(120.0 + 5.0 + 1.0 + 3.0 + 60.0, abs=0.001)


def test_too_fast_for_the_probe_is_refused_with_what_it_bears() -> None:
    done = probing_machine.run(f"{HEAD}G43 H99\nG0 Z10\nG38.2 Z2 F9000\nM30\n", probing_machine.up(PLANE))
    found = re.search(r"write F(\d+) or less", done.error)
    assert found is not None, done.error
    most = found.group(1)
    done = probing_machine.run(
        f"{HEAD}G43 H99\nG0 Z10\nG38.2 Z2 F{most}\nG0 Z30\nM30\n", probing_machine.up(PLANE)
    )
    assert done.run.result == "completed", (done.error, done.run.fault_text)
    probe = done.stepped.machine.probe
    assert probe is not None
    lowest = done.run.rows[:, of_axes("actual", 5)][:, 2].min() - 180.0
    assert 5.0 - lowest < probe.overtravel_mm


def test_behind_a_touch_nothing_is_started_anew_but_at_its_line() -> None:
    made = probing_machine.machine()
    text = f"{HEAD}G43 H99\nG0 Z7\nG38.2 Z2 F200\nG1 X9 F500\nM30\n"
    asked = checked.task(text.encode(), "probe.ngc", made)
    assert checked.rest_of(asked, {}, Spot(5, 0.0)).what == "pause"
    with pytest.raises(ProgramError, match="probes on line 5 before"):
        checked.rest_of(asked, {}, Spot(6, 0.0))
    with pytest.raises(ProgramError, match="probes on line 5 before"):
        checked.rest_of(asked, {}, Spot(5, 0.5))


def test_a_probing_move_that_is_held_goes_on_and_is_not_left_for_a_retract() -> None:
    stepped = probing_machine.up(PLANE)
    asked = checked.task(f"{HEAD}G43 H99\nG0 Z7\nG38.2 Z2 F60\nM30\n".encode(), "probe.ngc", stepped.machine)
    stepped.begin(checked.path_of(asked))
    stepped.go(20_000, lambda: 6.0 < stepped.joints[2] - 180.0 < 6.5)
    stepped.request(Request.HOLD)
    stepped.go(500)
    now = stepped.board.read()
    assert now is not None and now.mode is Mode.HOLD and now.probing == 2
    with pytest.raises(NotPossible):
        stepped.planner.retract(now, 5.0)
    stepped.request(Request.RESUME)
    stepped.go(20_000, lambda: stepped.cycle.modes.mode is Mode.READY)
    (touch,) = stepped.planner.touches
    assert touch.came.touched
    assert touch.came.at[2] == pytest.approx(185.0, abs=0.001)


def test_a_record_is_made_again_up_to_where_it_probes() -> None:
    stepped = probing_machine.up(PLANE)
    asked = checked.task(f"{HEAD}G43 H99\nG0 Z7\nG38.2 Z2 F60\nM30\n".encode(), "probe.ngc", stepped.machine)
    with pytest.raises(ProgramError, match="does not hold what it touched"):
        list(replay._unprobed(checked.path_of(asked).items))


def test_g31_of_fanuc_skips() -> None:
    made = probing_machine.machine(**{'name = "trunnion"': 'name = "trunnion"\ndialect = "fanuc"'})
    text = f"{HEAD}G43 H99\nG0 Z7.\nG31 Z2. F200.\nG0 Z[#5063+20.]\nM30\n"
    done = probing_machine.run(text, probing_machine.up(PLANE, made))
    assert done.run.result == "completed", (done.error, done.run.fault_text)
    assert done.stepped.joints[2] == pytest.approx(5.0 + 20.0 + 180.0, abs=0.001)
