"""What must hold of the recorder's rows and of a run's record, whatever clock they were made on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from support.machines.interrupted_runs import distance, segments
from support.machines.stepped_runs import shares
from support.oracles import latched_setpoints
from support.oracles.trace_limits import BOUNDS, KINDS
from typer.testing import CliRunner

from controller.__main__ import app
from controller.ipc.handoff import COLUMN, of_axes
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints, Machine
from controller.plan.restart.program_position import ENTRY_ID
from controller.state.modes import Mode
from controller.verify.console import EndedAsAsked

SAME_MM = 1e-6
EVERY = 23  # of the rows whose place on the path is computed
ROUNDED = 0.5 + 1e-4  # counts

Wrong = tuple[int, str]  # tick, and what does not hold there


def limits(machine: Machine, rows: np.ndarray) -> list[Wrong]:
    """Velocity, acceleration and jerk of what the drives latched; ``rows`` without a fault."""
    found, axes = list[Wrong](), len(machine.axes)
    parts = zip(latched_setpoints.parts(rows), latched_setpoints.parts(rows, "tick"), strict=True)
    for joints, where in parts:
        if len(joints) <= latched_setpoints.REST:
            continue
        for kind, share in enumerate(shares(joints[:, :axes], machine)):
            over = np.argwhere(share > BOUNDS[kind])
            if len(over):
                k, axis = over[0]
                tick, line = (int(where[k + kind + 1, COLUMN[name]]) for name in ("tick", "line"))
                name, most = machine.axes[axis].name, float(share[:, axis].max())
                found.append((tick, f"{name} takes {most:.4f} of its {KINDS[kind]} (line {line})"))
    return found


def counts(machine: Machine, rows: np.ndarray) -> list[Wrong]:
    """What is sent is what is commanded, to the count."""
    axes = len(machine.axes)
    per_unit = np.array([axis.counts_per_unit for axis in machine.axes])
    off = np.abs(rows[:, of_axes("setpoint", axes)] - rows[:, of_axes("joint_command", axes)] * per_unit)
    bad = np.flatnonzero((off > ROUNDED).any(axis=1) & (rows[:, COLUMN["mode"]] == Mode.RUNNING))
    if not len(bad):
        return []
    tick = int(rows[bad[0], COLUMN["tick"]])
    return [(tick, f"a setpoint is {off[bad[0]].max():.2f} counts from its joint")]


def path(text: str, machine: Machine, rows: np.ndarray, start: Joints, in_spindle: int) -> list[Wrong]:
    """On the program's own motions, wherever they run; ``start``: where it began, and with which tool."""
    ids = rows[:, COLUMN["motion_id"]]
    mine = rows[(ids >= 0) & (ids < ENTRY_ID) & (rows[:, COLUMN["mode"]] == Mode.RUNNING)][::EVERY]
    if not len(mine):
        return []
    off_mm = distance(mine, segments(text, machine, start, in_spindle), kinematics_of(machine))
    return [] if off_mm < SAME_MM else [(0, f"the joints are {off_mm:.7f} off the program's motions")]


def again(record: Path) -> list[Wrong]:
    """``directrix replay`` of it."""
    done = CliRunner().invoke(app, ["replay", str(record), "--json"])
    if done.exit_code in (0, EndedAsAsked.exit_code):
        return []
    told = json.loads(done.stdout) if done.stdout.startswith("{") else {"error": repr(done.exception)}
    return [(int(told.get("tick", 0)), f"replay: {told['error']}")]
