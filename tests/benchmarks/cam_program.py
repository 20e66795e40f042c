"""A program of 200 000 short five-axis lines: reading, fitting, planning, memory, deviation.

    python tests/benchmarks/cam_program.py [lines] [--vectors] [--plan]

Writes the program to a temporary folder and prints what it costs to make its path, and with
``--plan`` to plan it: first message, planning against machine time, mean feed against the
lower bound (the feed, and velocity and acceleration of every joint, without jerk).
"""

from __future__ import annotations

import argparse
import itertools
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

import numpy as np  # noqa: E402
import toppra  # noqa: E402
from support.parts import cam_lines  # noqa: E402

from controller.machine import machine_file  # noqa: E402
from controller.machine.kinematics import Kinematics, kinematics_of  # noqa: E402
from controller.machine.model import Joints, Machine  # noqa: E402
from controller.motion.motions import ToolSpline  # noqa: E402
from controller.plan.feed import profile as profiles  # noqa: E402
from controller.plan.feed.course import Course  # noqa: E402
from controller.plan.path import path  # noqa: E402
from controller.plan.stretch import Chain, Pause, Stretch  # noqa: E402
from controller.program import blocks  # noqa: E402

HOME: Joints = (0.0, 0.0, 260.0, 0.0, 0.0)
DEVIATION_EVERY = 200  # of the motions is held against the lines
DENSE = 40  # places per millimetre there
GRID = 60  # per millimetre, of the lower bound


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def written(lines: int, vectors: bool, folder: str) -> Path:
    file = Path(folder) / "cam.ngc"
    with file.open("w") as out:
        out.writelines(cam_lines.program(cam_lines.places(lines), vectors))
    return file


def stream(file: Path, machine: Machine, kinematics: Kinematics) -> Iterator[Chain | Pause]:
    made = blocks.stream(file.read_bytes(), machine, file.name)
    return path.stream(made, file.name, machine, kinematics, HOME)


def read(file: Path, machine: Machine) -> float:
    """Seconds of processor time to read all blocks."""
    begin = time.process_time()
    for block in blocks.stream(file.read_bytes(), machine, file.name):
        del block
    return time.process_time() - begin


def bound_s(course: Course) -> float:
    """Shortest time from rest to rest by toppra: feed, velocity and acceleration limits, no jerk."""
    grid = np.linspace(0.0, course.length, 2 + int(GRID * course.length))
    limits = [axis.limits for axis in course.machine.axes]
    velocity, acceleration = (
        np.array([[-x, x] for x in found])
        for found in ([x.velocity for x in limits], [x.acceleration for x in limits])
    )
    constraints = [
        toppra.constraint.JointVelocityConstraint(velocity),
        toppra.constraint.JointAccelerationConstraint(acceleration),
        Feed(course),
    ]
    solver = toppra.algorithm.TOPPRA(constraints, Places(course), gridpoints=grid, solver_wrapper="seidel")
    _, speeds, _, _ = solver.compute_parameterization(0.0, 0.0, return_data=True)
    v = np.asarray(speeds)
    return float((2.0 * np.diff(grid) / (v[1:] + v[:-1])).sum())


class Places(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc, name-defined]
    """A course as toppra asks for it."""

    def __init__(self, course: Course) -> None:
        self.course = course

    dof = 5

    @property
    def path_interval(self) -> np.ndarray:
        return np.array([0.0, self.course.length])

    def __call__(self, s: np.ndarray, order: int = 0) -> np.ndarray:
        found = self.course.derivatives(np.atleast_1d(np.asarray(s, dtype=float)))
        return found.first if order < 2 else found.second


class Feed(toppra.constraint.LinearConstraint):  # type: ignore[misc, name-defined]
    """The tip moves at no more than F."""

    def __init__(self, course: Course) -> None:
        super().__init__()
        self.course, self.identical = course, False
        self.discretization_type = toppra.constraint.DiscretizationType.Collocation

    def compute_constraint_params(self, path: object, grid: np.ndarray) -> tuple[object, ...]:
        feed = self.course.feed(grid)
        return None, None, None, None, None, None, np.stack([0.0 * feed, feed**2], axis=1)


def deviation(stretch: Stretch, machine: Machine, kinematics: Kinematics, corners: np.ndarray) -> float:
    """Largest distance (mm) of a motion's tip from the program's lines around it."""
    motion = stretch.motion
    assert isinstance(motion, ToolSpline)
    s = np.linspace(0.0, motion.end, 2 + int(DENSE * motion.end))
    joints = path.joints_along(stretch, s, kinematics)
    tips = kinematics.forward(joints.T, motion.length_mm, np).tip
    tip = np.array(machine.offsets[0].from_parent(tips)).T
    first = max(0, motion.lines[0] - 6)
    return float(cam_lines.distance(tip, corners[first : motion.lines[-1]]).max())


def trace(file: Path, machine: Machine, kinematics: Kinematics, corners: np.ndarray) -> None:
    begin, wall = time.process_time(), time.perf_counter()
    first, motions, spans, worst, length, apart = 0.0, 0, 0, 0.0, 0.0, 0.0
    for item in stream(file, machine, kinematics):
        if not isinstance(item, Chain):
            continue
        first = first or time.perf_counter() - wall
        for stretch in item.stretches:
            if not isinstance(stretch.motion, ToolSpline):
                continue
            motions += 1
            spans += len(stretch.motion.knots) - 1
            length += stretch.motion.end
            if motions % DEVIATION_EVERY == 1:
                pause = time.process_time()
                worst = max(worst, deviation(stretch, machine, kinematics, corners))
                apart += time.process_time() - pause
    used, lines = time.process_time() - begin - apart, len(corners)
    print(f"path    {used:8.2f} s processor, {used / lines * 1e6:6.1f} us a line, first item {first:.2f} s")
    print(f"        {motions} motions, {spans} spans, {length:.0f} mm, {length / spans:.2f} mm a span")
    print(f"        largest distance from the lines {worst * 1e3:.2f} um; peak memory {peak_mb():.0f} MB")


def plan(file: Path, machine: Machine, kinematics: Kinematics, most: int) -> None:
    """Plan the chains one after the other, each from rest to rest of its stretches."""
    begin, machine_s, bound, length = time.process_time(), 0.0, 0.0, 0.0
    bounding = 0.0
    for item in itertools.islice(stream(file, machine, kinematics), most):
        if not isinstance(item, Chain) or not isinstance(item.stretches[0].motion, ToolSpline):
            continue
        course = Course(item.stretches, machine, kinematics)
        profile = profiles.plan(course)
        if profile is None:
            print(f"        no profile for a chain of {course.length:.1f} mm")
            continue
        machine_s += profile.duration_s
        length += course.length
        pause = time.process_time()
        bound += bound_s(course)
        bounding += time.process_time() - pause
    used = time.process_time() - begin - bounding
    if machine_s == 0.0:
        return
    print(f"plan    {used:8.2f} s for {machine_s:.2f} s of the machine: {machine_s / used:.1f} times faster")
    print(f"        mean feed {length / machine_s * 60:.0f} mm/min, {bound / machine_s:.4f} of the bound")


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("lines", nargs="?", type=int, default=200_000)
    ask.add_argument("--vectors", action="store_true", help="G43.5 with I J K instead of G43.4 with A C")
    ask.add_argument("--machine", default="trunnion")
    ask.add_argument("--plan", type=int, default=0, metavar="ITEMS", help="plan so many items of the path")
    given = ask.parse_args()
    machine = machine_file.load(given.machine)
    kinematics = kinematics_of(machine)
    with tempfile.TemporaryDirectory() as folder:
        file = written(given.lines, given.vectors, folder)
        corners = cam_lines.corners(cam_lines.places(given.lines))
        print(f"program {given.lines} lines, {file.stat().st_size / 1e6:.1f} MB; memory {peak_mb():.0f} MB")
        used = read(file, machine)
        print(f"read    {used:8.2f} s processor, {used / given.lines * 1e6:6.1f} us a line")
        trace(file, machine, kinematics, corners)
        if given.plan:
            plan(file, machine, kinematics, given.plan)


if __name__ == "__main__":
    main()
