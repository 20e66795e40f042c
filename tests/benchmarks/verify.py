"""What verifying costs: 10^5 points of Example 2's first surface against 10^4 poses of its cut.

Processor seconds and the largest resident memory; what two workers take of a row of surfaces beside one.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.oracles.swept_cylinder import nominal, places, sweep  # noqa: E402
from support.parts import surface_trains  # noqa: E402
from support.parts.paper_surfaces import example_2  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.machine.tool_profile import cutter  # noqa: E402
from controller.verify.envelope import deviation  # noqa: E402

ROOT = Path(__file__).parents[2]
OVERCUT_MM = 0.18267  # of Example 2's first surface by a cutter of 3 mm, from ten million poses


def report(short: bool) -> Report:
    began_s = time.process_time()
    one = nominal(example_2()[0])
    poses, body = sweep(one, 0.055 if short else 0.0055), cutter(one.tool)
    swept_s = time.process_time()
    _, _, points, normals = places(one, 100 if short else 1000, 100)
    placed_s = time.process_time()
    t = deviation(points, normals, poses, body).t
    ended_s = time.process_time()
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    found = (
        Figure("a point", 1e6 * (ended_s - placed_s) / len(points), "us"),
        Figure("largest overcut", -float(t.min()), "mm", OVERCUT_MM, "brute force"),
        Figure("memory", memory_mb, "MB"),
        *on_two_workers(short),
    )
    parts = {"poses": swept_s - began_s, "points": placed_s - swept_s, "deviation": ended_s - placed_s}
    return Report(found, figures.shares(parts), f"{len(points)} points against {len(poses)} poses")


def on_two_workers(short: bool) -> list[Figure]:
    """``directrix verify`` of a row of surfaces on one process and on two."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "row.ngc"
        file.write_text(surface_trains.program(2 if short else 24))
        took_s = []
        for workers in ("1", "2"):
            began_s = time.perf_counter()
            command = (
                sys.executable,
                "-m",
                "controller",
                "verify",
                str(file),
                "--workers",
                workers,
                "--json",
            )
            subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=True)
            took_s.append(time.perf_counter() - began_s)
    return [Figure("a row of surfaces on two workers", took_s[1], "s", took_s[0], "one worker")]


if __name__ == "__main__":
    figures.main(report)
