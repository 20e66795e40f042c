"""Program text to a traced path, for tests, and what every path must keep."""

from __future__ import annotations

import math

import numpy as np
from support.machines.shipped_kinds import machine

from controller.geometry.vectors import angle_between, norm, subtract
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Joints, Machine
from controller.motion.motions import SurfaceCut
from controller.plan.path import path
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Path, Segment, rotaries_of
from controller.program import blocks

HOME: Joints = (0.0, 0.0, 200.0, 0.0, 0.0)


def mill(kind: str = "fig4a", **changes: object) -> Machine:
    """A test machine with a spindle that nobody has to switch on."""
    return machine(kind, **changes)


def trace(text: str, built: Machine | None = None, start: Joints = HOME) -> Path:
    built = built or mill()
    return path.trace(blocks.read(text.encode(), built, "part.ngc"), built, kinematics_of(built), start)


def segments(traced: Path) -> list[Segment]:
    return [s for item in traced.items if isinstance(item, ContinuousPath) for s in item.segments]


def named(traced: Path, name: str) -> list[Segment]:
    return [s for s in segments(traced) if s.name == name]


def names(traced: Path) -> list[list[str]]:
    """Names of the segments of each chain."""
    return [[s.name for s in item.segments] for item in traced.items if isinstance(item, ContinuousPath)]


def sentences(traced: Path) -> str:
    return "\n".join(note.sentence for note in traced.notes)


def assert_whole(traced: Path, built: Machine, start: Joints = HOME) -> None:
    """Every segment begins where the last one ended, stays in travel and is what the tick will follow."""
    kinematics, here = kinematics_of(built), start
    for segment in segments(traced):
        assert np.allclose(segment.start, here, rtol=0.0, atol=2e-6), segment.name
        here = segment.end
        s = np.linspace(0.0, segment.motion.end, 61)
        joints = joints_along(segment, s, kinematics)
        assert np.allclose(joints[0], segment.start, rtol=0.0, atol=1e-9), segment.name
        assert np.allclose(joints[-1], segment.end, rtol=0.0, atol=1e-9), segment.name
        for i, axis in enumerate(built.axes):
            assert axis.travel_min - 1e-6 <= joints[:, i].min(), (segment.name, axis.name)
            assert joints[:, i].max() <= axis.travel_max + 1e-6, (segment.name, axis.name)
        _assert_followed(segment, s, joints, kinematics)
    assert traced.end == here


def _assert_followed(segment: Segment, s: np.ndarray, joints: np.ndarray, kinematics: Kinematics) -> None:
    """Step by step as the tick goes, near the last rotaries, the same joints come out."""
    near = rotaries_of(segment.start, kinematics)
    for at, expected in zip(s, joints, strict=True):
        found = segment.motion.joints(float(at), near, kinematics)
        assert found is not None
        assert np.allclose(found, expected, rtol=0.0, atol=1e-8), (segment.name, float(at))
        near = rotaries_of(found, kinematics)
        if isinstance(segment.motion, SurfaceCut):
            _assert_pose(segment.motion, float(at), found, kinematics)


def _assert_pose(cut: SurfaceCut, s: float, joints: Joints, kinematics: Kinematics) -> None:
    pose, wanted = kinematics.forward(joints, cut.length_mm), cut.pose(s)
    assert norm(subtract(pose.tip, cut.part.to_parent(wanted.tip))) < 1e-6
    assert angle_between(pose.axis, cut.part.turn(wanted.axis)) < math.radians(1e-6)


def differences(segment: Segment, at: float, into: float, built: Machine) -> np.ndarray:
    """q, q' and q'' (3, 5) at one end of a segment by one-sided differences of the fourth order."""
    h = into * 2e-3
    q = joints_along(segment, at + h * np.arange(6), kinematics_of(built))
    first = np.array([-137.0, 300.0, -300.0, 200.0, -75.0, 12.0]) / 60.0 / h
    second = np.array([45.0, -154.0, 214.0, -156.0, 61.0, -10.0]) / 12.0 / h**2
    return np.stack([q[0], first @ q, second @ q])


def assert_goes_on(before: Segment, after: Segment, built: Machine) -> None:
    """That one segment goes on with the place, the rate and the bend of the one before."""
    a, b = differences(before, before.motion.end, -1.0, built), differences(after, 0.0, 1.0, built)
    for order, within in enumerate((1e-9, 1e-6, 1e-4)):
        assert np.abs(a[order] - b[order]).max() <= within * max(1.0, np.abs(b[order]).max())
