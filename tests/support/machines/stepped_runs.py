"""Runs programs on the stepped machine and measures them, for the acceptance tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from controller.ipc.handoff import COLUMN, of_axes
from controller.machine import machine_file
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.machine.spindle import unasked
from controller.plan.path import path
from controller.plan.segment import Segment
from controller.program import blocks
from controller.runtime.events import Event
from controller.runtime.stepped import Run, SteppedMachine
from controller.verify import trace

SHIPPED = ("trunnion", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique45")
T2 = "G21 G90 G54 G61\nT2 M6\nS12000 M3\n{side}\n{cuts}\nM5\nM30\n"


def shipped(name: str = "trunnion", **changes: object) -> Machine:
    """A shipped machine that warns where the cutter gouges, and asks nobody to switch its spindle."""
    made = machine_file.load(name)
    return replace(made, **{"gouge": "warn", "spindle": unasked(made.spindle), **changes})  # type: ignore[arg-type]


def program(name: str, feed: str | None = None) -> str:
    """Text of a shipped program; ``feed`` takes the place of its F word's value.

    Example 2 as the paper places the cutter, with one of 3 mm: what twist costs is let pass by R.
    """
    text = machine_file.shipped_program(name).read_text()
    text = text.replace("T4 M6 (end mill 1 mm)", "T2 M6 (end mill 3 mm)").replace("G41 P4 R0.02", "G41 R1.")
    if feed is None:
        return text
    for old in ("f100000", "f10000", "F100."):
        text = text.replace(old, f"F{feed}")
    return text


def three_times_example_2(feed: str) -> str:
    """Cut after cut, so that the plan is still at work while the first one is cut."""
    text = program("example2_ready", feed)
    return text.replace("N40 ", "O1 REPEAT [3]\nN40 ").replace("N210 G40", "N210 G40\nO1 ENDREPEAT")


@dataclass(frozen=True, eq=False)
class Cut:
    """A finished run with everything to judge it."""

    stepped: SteppedMachine
    run: Run
    trace: trace.Trace
    rows: np.ndarray  # of the recorder, the same as the trace's

    @property
    def machine(self) -> Machine:
        return self.stepped.machine

    @property
    def kinematics(self) -> Kinematics:
        return self.stepped.kinematics

    @property
    def segments(self) -> dict[int, Segment]:
        return self.stepped.planner.segments

    @property
    def joints(self) -> np.ndarray:
        """The commanded joints (N, axes) in mm and rad."""
        return self.rows[:, of_axes("joint_command", len(self.machine.axes))]

    def column(self, name: str) -> np.ndarray:
        return self.rows[:, COLUMN[name]]


def cut(
    text: str,
    machine: Machine | None = None,
    events: Sequence[Event] = (),
    stepped: SteppedMachine | None = None,
    **how: object,
) -> Cut:
    """Come up, read, trace and run ``text``; ``how`` goes to the SteppedMachine."""
    if stepped is None:
        stepped = SteppedMachine(machine or shipped(), **how)  # type: ignore[arg-type]
        stepped.come_up()
    known = blocks.read(text.encode(), stepped.machine, "part.ngc")
    traced = path.trace(known, stepped.machine, stepped.kinematics, stepped.joints)
    run = stepped.run(traced, events)
    made = trace.from_rows(run.rows, stepped.machine, stepped.kinematics, stepped.planner.segments)
    return Cut(stepped, run, made, run.rows[len(run.rows) - len(made.time_s) :])


def shares(joints: np.ndarray, machine: Machine) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First, second and third differences of joints (N, axes) as shares of the limits, (N - k, 5)."""
    T, limits = machine.period_s, [axis.limits for axis in machine.axes]
    bounds = (
        [x.velocity * T for x in limits],
        [x.acceleration * T**2 for x in limits],
        [x.jerk * T**3 for x in limits],
    )
    first, second, third = (np.abs(np.diff(joints, k, axis=0)) / b for k, b in enumerate(bounds, 1))
    return first, second, third


def largest(joints: np.ndarray, machine: Machine) -> tuple[float, float, float]:
    """The largest share of velocity, acceleration and jerk of any axis."""
    first, second, third = (float(share.max()) for share in shares(joints, machine))
    return first, second, third


def off_the_plan(done: Cut, rows: np.ndarray | None = None) -> float:
    """Largest distance (mm) of the commanded tip from the segment its row names, table frame."""
    return off_the_path(done, rows)[0]


def off_the_path(done: Cut, rows: np.ndarray | None = None) -> tuple[float, float]:
    """Largest distance of the commanded tip (mm) and axis (degrees) from the segment its row names."""
    joints, ids, s = done.joints, done.column("motion_id"), done.column("s")
    asked = np.column_stack([joints, ids, s])[slice(None) if rows is None else rows]
    asked = asked[asked[:, -2] >= 0]
    asked = asked[np.r_[True, np.any(np.diff(asked, axis=0) != 0.0, axis=1)][: len(asked)]]  # at rest: once
    if not len(asked):
        return 0.0, 0.0
    wanted = []
    for *here, number, place in asked.tolist():
        near = done.kinematics.rotaries(here)
        found = done.segments[int(number)].motion.joints(place, near, done.kinematics)
        assert found is not None
        wanted.append(found)
    length = max((tool.length_mm for tool in done.machine.tools), default=0.0)
    (tip, axis), (other, its) = (
        trace.forward(np.asarray(one, dtype=float), length, done.kinematics)
        for one in (asked[:, : joints.shape[1]], wanted)
    )
    far, turned = np.linalg.norm(tip - other, axis=1), np.linalg.norm(axis - its, axis=1)
    return float(far.max()), float(np.degrees(turned.max()))
