"""How far between two samples the tool is off, at periods from 0.25 to 10 ms: Eq. 7 at 20 mm/s.

Ours (arc length, the tick's own joints, every drive linear between its setpoints) beside the paper's
first-order step on the same machine and between the same drives; and beside its 22 chords off line.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.machine import machine_file  # noqa: E402
from controller.verify import paper  # noqa: E402

PERIODS_S = (0.25e-3, 0.5e-3, 1e-3, 2e-3, 5e-3, 10e-3)


def report(short: bool) -> Report:
    machine, found = machine_file.load("trunnion"), []
    for period_s in PERIODS_S[-2:] if short else PERIODS_S:
        ours, theirs = paper.at_period(machine, period_s)
        at, step = f"{1e3 * period_s:g} ms", "first-order step"
        found += [
            Figure(
                f"{at}: off C1", 1e3 * ours.between.contour_mm, "um", 1e3 * theirs.between.contour_mm, step
            ),
            Figure(f"{at}: axis", ours.between.axis_deg, "deg", theirs.between.axis_deg, step),
            Figure(f"{at}: drift at the end", abs(ours.drift_mm), "mm", abs(theirs.drift_mm), step),
        ]
    chords = paper.compare(machine).methods[0].between
    last = found[-2]
    found.append(Figure("10 ms: axis", last.value, "deg", chords.axis_deg, "22 chords"))
    return Report(tuple(found))


if __name__ == "__main__":
    figures.main(report)
