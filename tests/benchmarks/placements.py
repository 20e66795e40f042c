"""What a placed cut costs the tick beside the paper's: the joints of one tick, placements in turn.

Pose and inverse kinematics are all that differs between placements; the rest of a tick (drives,
bus, checks) is the same for all, so the ratio of whole ticks is below the one printed here. Time
of the thread's own CPU, the least of all rounds.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.machines.shipped_kinds import machine as make_machine  # noqa: E402
from support.parts.paper_surfaces import example_2  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.geometry import arc_length  # noqa: E402
from controller.machine.kinematics import Kinematics, kinematics_of  # noqa: E402
from controller.motion.motions import SurfaceCut  # noqa: E402
from controller.plan.surfaces.placing import CHOSEN_FROM, Cutter, place  # noqa: E402

PLACES = 1000


def cuts() -> dict[str, SurfaceCut]:
    """Example 2's second surface, placed in each way."""
    surface, frame = example_2()[1], make_machine().offsets[0]
    arc, cutter = arc_length.of(surface.lower), Cutter(3.0, 0.0, 0.0)
    return {s.name.lower(): SurfaceCut(place(surface, cutter, s), arc, 3.0, 0.0, frame) for s in CHOSEN_FROM}


def cost_us(cut: SurfaceCut, kinematics: Kinematics) -> float:
    """Of one tick's joints."""
    places = [(i + 0.5) * cut.end / PLACES for i in range(PLACES)]
    near = (0.3, 1.0)
    start = time.thread_time()
    for s in places:
        joints = cut.joints(s, near, kinematics)
        assert joints is not None
    return (time.thread_time() - start) / PLACES * 1e6


def report(short: bool) -> Report:
    made, kinematics = cuts(), kinematics_of(make_machine())
    least = dict.fromkeys(made, float("inf"))
    for _ in range(2 if short else 60):
        for name, cut in made.items():
            least[name] = min(least[name], cost_us(cut, kinematics))
    found = [Figure(f"joints, {name}", us, "us", least["single"], "single") for name, us in least.items()]
    return Report(tuple(found))


if __name__ == "__main__":
    figures.main(report)
