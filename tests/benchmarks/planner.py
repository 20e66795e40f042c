"""The planner alone, on short lines as CAM systems write them and on a row of surfaces.

A program is written to a temporary folder and planned in a process of its own. The tick is only pretended:
it takes every message, and its clock jumps to where the next one is wanted. Told are lines or surfaces per
processor second, the motion planned beside the processor seconds that took, the seconds to the first message,
and the largest memory. The parts are those of all programs: reading alone and the path alone are measured in
passes of their own, the rest is laws, stops and messages. How far the path is from the program's lines is
held beside G64's P.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

APART = "--planner"  # how the process of the planner is called
P_MM = 0.01
LINES = {
    "lines of 0.1 mm, G64 P0.01": (0.1, f"G21 G90 G64 P{P_MM}"),
    "lines of 0.02 mm, G64 P0.01": (0.02, f"G21 G90 G64 P{P_MM}"),
    "lines of 0.02 mm, no path word": (0.02, "G21 G90"),
    "lines of 0.02 mm, G61": (0.02, "G21 G90 G61"),
}
LEAST_LINES_S = {
    "lines of 0.02 mm, G64 P0.01": 15_000.0,
    "lines of 0.02 mm, no path word": 5_000.0,
    "lines of 0.02 mm, G61": 5_000.0,
}
EVERY = 20  # of the motions is held against the lines
DENSE = 40  # places per millimetre there


class PretendedTick:
    """Takes messages, and stands at the plan time at which the planner has something to do."""

    def __init__(self) -> None:
        from controller.ipc.handoff import PieceMessage, Snapshot
        from controller.state.modes import Fault, Mode

        self.length_mm = 0.0
        self.bytes = 0
        self.first_s = 0.0
        self._message = PieceMessage
        fields = dict.fromkeys(Snapshot._fields, 0) | {
            "mode": Mode.RUNNING,
            "fault": Fault.NONE,
            "override": 1.0,
            "rapid_override": 1.0,
            "rate": 1.0,
        }
        self.now = Snapshot(**fields)  # type: ignore[arg-type]

    def take(self, message: object) -> bool:
        assert isinstance(message, self._message)
        if message.is_keepalive:
            return True
        from controller.ipc.piece_socket import encode

        self.bytes += sum(len(packet) for packet in encode(message))
        self.first_s = self.first_s or time.perf_counter()
        end_s = message.replace_from_s + sum(piece.duration_s for piece in message.pieces)
        self.now = self.now._replace(accepted=message.sequence, queue_end_s=end_s)
        return True

    def go_on(self, seconds: float) -> None:
        plan_s = min(self.now.plan_time_s + seconds, self.now.queue_end_s)
        commit_s = min(plan_s + 0.02, self.now.queue_end_s)
        self.now = self.now._replace(plan_time_s=plan_s, commit_s=commit_s)


def planned(file: str) -> dict[str, float]:
    """What it takes to plan a program, and in passes before it to read it and to lay its path."""
    from controller.machine import machine_file
    from controller.plan.planner import Planner
    from controller.program import blocks
    from controller.runtime import checked

    machine = machine_file.load("trunnion")
    asked = checked.task(Path(file).read_bytes(), file, machine)
    began_s = time.process_time()
    for _ in blocks.stream(asked.text, machine, file, start=asked.start):
        pass
    read_s = time.process_time()
    for _ in checked.path_of(asked).items:
        pass
    path_s = time.process_time()
    tick, first_s = PretendedTick(), time.perf_counter()
    plan = Planner(machine, asked.kinematics, tick.take)
    plan.load(checked.path_of(asked).items, 0.0)
    while not plan.finished:
        while plan.work(tick.now):
            pass
        tick.go_on(0.5)
    assert plan.error is None, plan.error
    cpu_s = time.process_time() - path_s
    return {
        "reading": read_s - began_s,
        "path": path_s - read_s - (read_s - began_s),
        "laws, stops, messages": cpu_s - (path_s - read_s),
        "cpu_s": cpu_s,
        "motion_s": tick.now.queue_end_s,
        "first_s": tick.first_s - first_s,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


def off_lines_mm(file: Path, count: int, step_mm: float) -> float:
    """Largest distance of the path's tips from the lines of a program with G64 P, by some of its motions."""
    import numpy as np
    from support.parts import cam_lines

    from controller.machine import machine_file
    from controller.motion.motions import ToolSpline
    from controller.plan.rotaries.branch import joints_along
    from controller.plan.segment import ContinuousPath
    from controller.runtime import checked

    machine = machine_file.load("trunnion")
    asked = checked.task(file.read_bytes(), file.name, machine)
    corners, off, number = cam_lines.corners(cam_lines.places(count, step_mm)), 0.0, 0
    chains = (item for item in checked.path_of(asked).items if isinstance(item, ContinuousPath))
    for segment in (segment for chain in chains for segment in chain.segments):
        motion = segment.motion
        if not isinstance(motion, ToolSpline):
            continue
        number += 1
        if number % EVERY == 1:
            s = np.linspace(0.0, motion.end, 2 + int(DENSE * motion.end))
            joints = joints_along(segment, s, asked.kinematics)
            tips = asked.kinematics.forward(joints.T, motion.length_mm, np).tip
            tip = np.array(machine.offsets[0].from_parent(tips)).T
            near = corners[max(0, motion.lines[0] - 6) : motion.lines[-1]]
            off = max(off, float(cam_lines.distance(tip, near).max()))
    return off


def apart(file: Path) -> dict[str, float]:
    """``planned`` in a process of its own."""
    command = (sys.executable, __file__, APART, str(file))
    found: dict[str, float] = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
    return found


def told(name: str, count: int, what: str, found: dict[str, float]) -> list[Figure]:
    return [
        Figure(
            f"{name}: planned", count / found["cpu_s"], f"{what}/s of CPU", at_least=LEAST_LINES_S.get(name)
        ),
        Figure(f"{name}: planning", found["cpu_s"], "s of CPU", found["motion_s"], "the motion"),
        Figure(f"{name}: first message", found["first_s"], "s"),
        Figure(f"{name}: memory", found["peak_mb"], "MB"),
    ]


def report(short: bool) -> Report:
    from support.parts import cam_lines, surface_trains

    count, surfaces = (150, 3) if short else (20_000, 100)
    amounts: dict[str, float] = {}
    told_all: list[Figure] = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "part.ngc"
        for name, (step_mm, head) in LINES.items():
            file.write_text("".join(cam_lines.program(cam_lines.places(count, step_mm), False, head)))
            found = apart(file)
            told_all += told(name, count, "lines", found)
            _add(amounts, found)
            if name == "lines of 0.1 mm, G64 P0.01":
                off_mm = off_lines_mm(file, count, step_mm)
                told_all.append(Figure(f"{name}: off the lines", 1e3 * off_mm, "um", 1e3 * P_MM, "G64's P"))
        file.write_text(surface_trains.program(surfaces))
        found = apart(file)
        told_all += told("surfaces, P1", surfaces, "surfaces", found)
        _add(amounts, found)
    return Report(tuple(told_all), figures.shares(amounts), "planning all of them")


def _add(amounts: dict[str, Any], found: dict[str, float]) -> None:
    for part in ("reading", "path", "laws, stops, messages"):
        amounts[part] = amounts.get(part, 0.0) + max(found[part], 0.0)


if __name__ == "__main__":
    if sys.argv[1:2] == [APART]:
        print(json.dumps(planned(sys.argv[2])))
    else:
        figures.main(report)
