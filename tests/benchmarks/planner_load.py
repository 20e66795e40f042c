"""The planner alone on a long program: first message, processor time against machine time, memory.

    python tests/benchmarks/planner_load.py [lines] [--vectors] [--machine NAME]

Writes a program of short five-axis lines to a temporary folder and feeds a planner in a process
of its own with it. The tick is only pretended: it takes every message, and its clock jumps to
where the next one is wanted. Prints the seconds from the start to the first message,
processor seconds of all planning with its stops, machine seconds planned, mean feed, and the peak of memory.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

CHECKED = "--planner"  # how the process of the planner is called


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
        from controller.ipc.handoff import encode

        self.bytes += sum(len(packet) for packet in encode(message))
        self.first_s = self.first_s or time.perf_counter()
        end_s = message.replace_from_s + sum(piece.duration_s for piece in message.pieces)
        self.now = self.now._replace(accepted=message.sequence, queue_end_s=end_s)
        return True

    def go_on(self, seconds: float) -> None:
        plan_s = min(self.now.plan_time_s + seconds, self.now.queue_end_s)
        commit_s = min(plan_s + 0.02, self.now.queue_end_s)
        self.now = self.now._replace(plan_time_s=plan_s, commit_s=commit_s)


def planner(file: str, machine_name: str) -> None:
    from controller.machine import machine_file
    from controller.plan.planner import Planner
    from controller.runtime import checked

    began_s = time.perf_counter()
    machine = machine_file.load(machine_name)
    asked = checked.task(Path(file).read_bytes(), file, machine)
    tick = PretendedTick()
    plan = Planner(machine, asked.kinematics, tick.take)
    used_s = time.process_time()
    plan.load(checked.path_of(asked).items, 0.0)
    while not plan.finished:
        while plan.work(tick.now):
            pass
        tick.go_on(0.5)
    used_s = time.process_time() - used_s
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    machine_s = tick.now.queue_end_s
    print(f"first message after {tick.first_s - began_s:.2f} s")
    print(f"planned {machine_s:.2f} s of motion in {used_s:.2f} s: {machine_s / used_s:.1f} times faster")
    print(f"peak memory {peak_mb:.0f} MB, messages of {tick.bytes / 1e6:.1f} MB in all")
    if plan.error is not None:
        print(plan.error)


def main() -> None:
    if sys.argv[1:2] == [CHECKED]:
        planner(*sys.argv[2:])
        return
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("lines", nargs="?", type=int, default=200_000)
    ask.add_argument("--vectors", action="store_true", help="G43.5 with I J K instead of G43.4 with A C")
    ask.add_argument("--machine", default="trunnion")
    given = ask.parse_args()
    from support.parts import cam_lines

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cam.ngc"
        with file.open("w") as out:
            out.writelines(cam_lines.program(cam_lines.places(given.lines), given.vectors))
        subprocess.run([sys.executable, __file__, CHECKED, str(file), given.machine], check=True)


if __name__ == "__main__":
    main()
