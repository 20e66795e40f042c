"""Ten minutes of Example 2 at 0.5 ms on five virtual buses: faults, skipped ticks, SYNCs outside 1 +- 1/4 T.

The machine of ``live`` cuts Example 2 again and again, its plan at work and a client asking its panel.
Beside it ``cyclictest`` keeps a thread on each core, above the tick and everything else (priority 99), which
is woken once a period and notes when that was more than T/4 late: there nothing of ours was in its way, so
the computer was not there (its kernel was busy, or the host of a virtual computer ran something else).

An interval is the computer's where such an absence of a core of the tick's reaches into it; a fault is the
computer's where in the second before it some core was away for longer than a drive bears without SYNC
(``drives.bench.simulated``: four periods). All others are ours. Rests between programs are measured, too.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from live import BESIDE  # noqa: E402
from memory import tree  # noqa: E402
from support.live import five_buses  # noqa: E402
from support.live.five_buses import OUTSIDE, PERIOD_S, Stamps  # noqa: E402
from support.live.shop import Shop, Values  # noqa: E402
from support.suite import cyclictest, figures  # noqa: E402
from support.suite.cyclictest import Watch  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.service.jobs import UNDER_WAY  # noqa: E402
from drives.bench.simulated.drive import QUIET_PERIODS  # noqa: E402

SECONDS, SHORT_S = 600.0, 3.0
BEFORE_S = 1.0  # a fault


class Fault(NamedTuple):
    """One that came up; ``at_s`` by CLOCK_MONOTONIC, when it was seen."""

    name: str
    at_s: float


def looked_at(shop: Shop, until_s: float, stop: bool) -> Values:
    """Asks as a page does until the program has ended, or that time has come."""

    def over(now: Values) -> bool:
        ended = now["fault"] or now["job"]["state"] not in UNDER_WAY
        return bool(ended or (stop and time.monotonic() > until_s))

    return shop.until(over, "the program's end")


def cut(shop: Shop, seconds: float) -> tuple[int, list[Fault]]:
    """Example 2 again and again: how often it was completed (the short form breaks off), and the faults."""
    until_s, done, faults = time.monotonic() + seconds, 0, list[Fault]()
    while time.monotonic() < until_s:
        five_buses.begin(shop)
        now = looked_at(shop, until_s, seconds < SECONDS)
        if now["fault"]:
            faults.append(Fault(now["fault"]["name"], time.monotonic()))
            shop.do("POST", "/machine/reset")
            shop.do("POST", "/machine/home", json={})
            shop.do("POST", "/machine/enable")
            shop.until(lambda now: now["mode"] == "READY", "READY")
        done += now["job"]["state"] == "completed"
    return done, faults


def report(short: bool) -> Report:
    cyclictest.needed()
    with tempfile.TemporaryDirectory() as folder, five_buses.opened(Path(folder)) as shop:
        processes = tree(shop.processes["serve"].pid)
        stamps, cores = Stamps(five_buses.hub_paths(processes)), five_buses.tick_cores(processes)
        skips, began_s = shop.status()["tick"]["skips"], time.monotonic()
        with Watch(PERIOD_S, OUTSIDE * PERIOD_S) as watch:
            done, faults = cut(shop, SHORT_S if short else SECONDS)
        ended_s, skips = time.monotonic(), shop.status()["tick"]["skips"] - skips
        found = [one[(one > began_s) & (one < ended_s)] for one in stamps.close()]
    absences = [one for one in watch.absences if one.core in cores]
    counts = max((five_buses.judged(one, absences) for one in found), key=lambda bus: bus[1] + bus[2])
    all_of = sum(counts)
    excused = [watch.longest_s(one.at_s - BEFORE_S, one.at_s) > QUIET_PERIODS * PERIOD_S for one in faults]
    late = 100.0 * len(absences) / max(1, watch.woken)
    rows = [
        Figure("faults where the computer was there", float(excused.count(False)), "", at_most=0.0),
        Figure("faults where it was not", float(excused.count(True)), ""),
        Figure("programs completed", float(done), ""),
        Figure("SYNCs, the worst bus", all_of, "", (ended_s - began_s) / PERIOD_S, "periods"),
        Figure("skipped ticks", float(skips), "", float(len(absences)), f"{BESIDE} late by T/4"),
        Figure(
            "outside 1 +- 1/4 T, the worst bus",
            100.0 * (counts[1] + counts[2]) / all_of,
            "%",
            late,
            f"{BESIDE} late by T/4",
        ),
        Figure("of these where the computer was there", 100.0 * counts[2] / all_of, "%"),
        Figure("longest absence", 1e3 * watch.longest_s(began_s, ended_s), "ms"),
    ]
    parts = figures.shares(
        dict(zip(("within", "outside, computer away", "outside, ours"), counts, strict=True))
    )
    names = " ".join(one.name for one in faults)
    return Report(tuple(rows), parts, f"SYNCs of {ended_s - began_s:.0f} s, the worst bus", names)


if __name__ == "__main__":
    figures.main(report)
