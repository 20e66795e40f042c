"""Rows as the recorder makes them, for a cut without a tick: the motions at even speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from support.machines.shipped_kinds import machine

from controller.geometry import arc_length
from controller.geometry.curves import Line
from controller.ipc.handoff import COLUMN, ROW
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import JointMove, Motion, SurfaceCut
from controller.state.modes import Mode
from controller.verify import paper

SERVO_LAG_TICKS = 4.0


@dataclass(frozen=True)
class Segment:
    motion: Motion

    def block_u(self, u: np.ndarray) -> np.ndarray:
        return u


@dataclass(frozen=True)
class Run:
    """A run and everything a trace is made from; ids: 0 approach, 1 and up cuts, last retract."""

    rows: np.ndarray
    machine: Machine
    kinematics: Kinematics
    segments: dict[int, Segment]


@pytest.fixture(scope="session")
def ruled_run() -> Run:
    """Example 2 on the left with r = 1.5 mm at 1000 mm/min, drives lagging."""
    return make_run(paper.example_2(), -1.5, 1000.0 / 60.0)


def make_run(surfaces: tuple, offset_mm: float, feed_mm_s: float, kind: str = "fig4a") -> Run:
    built = machine(kind)
    kinematics = kinematics_of(built)
    cuts = [SurfaceCut(s, arc_length.of(s.lower), offset_mm, 40.0, built.offsets[0]) for s in surfaces]
    joints, near = [], (0.0, 0.0)
    for cut in cuts:
        count = round(cut.end / feed_mm_s / built.period_s)
        cut_joints = []
        for s in np.linspace(0.0, cut.end, count):
            q = cut.joints(float(s), near, kinematics)
            assert q is not None
            near = tuple(q[i] for i in built.rotary())
            cut_joints.append((float(s), q))
        joints.append(cut_joints)
    down = _vertical(joints[0][0][1], 20.0, 0.0, kinematics, built)
    up = _vertical(joints[-1][-1][1], 0.0, 20.0, kinematics, built)
    motions: list[Motion] = [down, *cuts, up]
    parts = [_sampled(down, kinematics), *joints, _sampled(up, kinematics)]
    segments = {i: Segment(motion) for i, motion in enumerate(motions)}
    return Run(_rows(parts, built, feed_mm_s), built, kinematics, segments)


def _vertical(q, start_mm: float, end_mm: float, kinematics: Kinematics, built: Machine) -> JointMove:
    x, y, z = (q[i] for i in built.linear())
    rotaries = tuple(q[i] for i in built.rotary())
    line = Line((x, y, z + start_mm), (x, y, z + end_mm))
    return JointMove(line, abs(end_mm - start_mm), rotaries, rotaries)


def _sampled(move: JointMove, kinematics: Kinematics) -> list:
    return [(float(s), move.joints(float(s), (0.0, 0.0), kinematics)) for s in move.end * _smooth(200)]


def _smooth(count: int) -> np.ndarray:
    """0 to 1, at rest at both ends."""
    x = np.linspace(0.0, 1.0, count)
    return x * x * (3.0 - 2.0 * x)


def _rows(parts: list, built: Machine, feed_mm_s: float) -> np.ndarray:
    still = [(0.0, parts[0][0][1])] * 5
    all_parts = [(-1, still), *enumerate(parts), (-1, [parts[-1][-1]] * 5)]
    rows = np.zeros((sum(len(p) for _, p in all_parts), len(ROW)))
    rows[:, COLUMN["tick"]] = np.arange(len(rows)) + 700
    rows[:, COLUMN["mode"]] = Mode.RUNNING.value
    rows[:3, COLUMN["mode"]] = Mode.READY.value
    first, row = COLUMN["joint_command_0"], 0
    for motion_id, part in all_parts:
        here = slice(row, row + len(part))
        is_cut = 0 < motion_id < len(parts) - 1
        rows[here, COLUMN["motion_id"]] = motion_id
        rows[here, COLUMN["cutting"]] = is_cut
        rows[here, COLUMN["line"]] = 10 + 8 * motion_id if is_cut else 0
        rows[here, COLUMN["feed_mm_s"]] = feed_mm_s if is_cut else 0.0
        rows[here, COLUMN["s"]] = [s for s, _ in part]
        rows[here, first : first + 5] = [q for _, q in part]
        row += len(part)
    counts = np.array([axis.counts_per_unit for axis in built.axes])
    command = rows[:, first : first + 5]
    rows[:, COLUMN["setpoint_0"] : COLUMN["setpoint_0"] + 5] = np.rint(command * counts)
    rows[:, COLUMN["actual_0"] : COLUMN["actual_0"] + 5] = _lagging(command)
    return rows


def _lagging(command: np.ndarray) -> np.ndarray:
    """A first-order lag, the same for all axes."""
    actual = command.copy()
    for i in range(1, len(command)):
        actual[i] = actual[i - 1] + (command[i] - actual[i - 1]) / (SERVO_LAG_TICKS + 1.0)
    return actual
