"""SYNC at 0.5 ms on five virtual buses with our own simulated drives, and ``cyclictest`` beside it.

A machine as in a shop: ``serve --simulate`` with a bus and a drive for each axis, and ``panel``. On the
tick's core, at the same time and with the tick's period, ``cyclictest`` is woken above it (priority 99): what
keeps it waiting (the kernel, the host of a virtual computer) keeps the tick waiting, and nothing else does.
Idle: drives on, nothing moves. Loaded: the machine cuts Example 2, its own plan at work; on every core a
planner checks Example 2 again and again; and 20 listeners and 100 requests a second ask the panel.

SYNC is stamped by the kernel when the tick hands it to a bus. An interval outside of 1 +- 1/4 periods counts
for as many SYNCs as it should have had, for ``cyclictest`` as for the tick. The figures are those of the
worst bus.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from memory import tree  # noqa: E402
from panel import PER_S, play  # noqa: E402
from support.live import five_buses  # noqa: E402
from support.live.five_buses import PERIOD_S, Rows, Stamps  # noqa: E402
from support.live.shop import HANGS_S, ROOT, Shop  # noqa: E402
from support.suite import cyclictest, figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.runtime import cores  # noqa: E402

BESIDE = "cyclictest"
MOST = 1.3  # times cyclictest's share
SETTLE_S = 1.0  # after a change of the load
AS_OTHERS = 0  # niceness: beside planners on every core a nicer one would ask nothing
IN_THE_CUT = 0.15  # of the program: behind the approach
STATES = ("idle", "loaded")
ROUNDS, TURN_S = 6, 20.0
CHECKS = """
import sys, tempfile
from pathlib import Path
from controller.machine import machine_file
from controller.runtime import checked
machine, text = machine_file.load(sys.argv[1]), Path(sys.argv[2]).read_bytes()
while True:
    with tempfile.TemporaryDirectory() as store:
        checked.check(checked.task(text, "part.ngc", machine), Path(store))
"""


class Turn(NamedTuple):
    """What came of one."""

    stamps_s: list[Rows]  # by bus
    wakes_s: Rows  # of cyclictest
    faults: int


def tick_core() -> int:
    """Where a tick of real-time priority goes."""
    permitted = os.sched_getaffinity(0)
    return next(iter(cores.choice(permitted, cores.isolated(), True)), min(permitted))


@contextlib.contextmanager
def planning() -> Iterator[None]:
    """On every core somebody who plans Example 2."""
    part = ROOT / "config/programs" / five_buses.PART
    words = [sys.executable, "-c", CHECKS, five_buses.MACHINE, str(part)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    busy = [subprocess.Popen(words, env=environment) for _ in os.sched_getaffinity(0)]
    try:
        time.sleep(SETTLE_S)
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


@contextlib.contextmanager
def looked_at(shop: Shop, answers_per_s: list[float]) -> Iterator[None]:
    """Listeners and requests at the panel (``panel``); how many of them were answered."""
    context = multiprocessing.get_context("spawn")
    on, off, told = context.Event(), context.Event(), context.Queue()
    child = context.Process(target=play, args=(shop.url, AS_OTHERS, on, off, told), daemon=True)
    child.start()
    on.set()
    try:
        yield
        off.set()
        _, answers, lasted_s = told.get(timeout=HANGS_S)
        answers_per_s.append(answers / lasted_s)
    finally:
        child.terminate()
        child.join()


def watched(shop: Shop, seconds: float) -> Turn:
    stamps = Stamps(five_buses.hub_paths(tree(shop.processes["serve"].pid)))
    latencies_s = cyclictest.turn(seconds, PERIOD_S, cyclictest.FROM_THE_KERNEL, tick_core())
    found = stamps.close()
    return Turn(
        found,
        cyclictest.wakes_s(latencies_s, PERIOD_S),
        int(bool(shop.until(lambda _: True, "an answer")["fault"])),
    )


def machine_turns(seconds: float, in_the_cut: float, answers_per_s: list[float]) -> dict[str, Turn]:
    """``in_the_cut``: share of the program from which it is measured."""
    with tempfile.TemporaryDirectory() as folder, five_buses.opened(Path(folder)) as shop:
        time.sleep(SETTLE_S)
        found = {"idle": watched(shop, seconds)}
        with looked_at(shop, answers_per_s), planning():
            five_buses.begin(shop)
            shop.until(lambda now: (now["job"]["fraction"] or 0.0) > in_the_cut or now["fault"], "the cut")
            found["loaded"] = watched(shop, seconds)
    return found


def beside(state: str, turns: list[Turn]) -> list[Figure]:
    """The worst bus of all turns beside all of cyclictest's."""
    buses = list(zip(*(turn.stamps_s for turn in turns), strict=True))
    shares = [[five_buses.outside(stamps) for stamps in one] for one in buses]
    worst = int(np.argmax([np.mean(one) for one in shares]))
    other = float(np.mean([five_buses.outside(turn.wakes_s) for turn in turns]))
    mine = np.concatenate([five_buses.periods(one)[0] for one in buses[worst]]) * PERIOD_S
    skipped = sum(float(np.sum(five_buses.periods(one)[1] - 1.0)) for one in buses[worst])
    woken = np.concatenate([five_buses.periods(turn.wakes_s)[0] for turn in turns]) * PERIOD_S
    share = 100.0 * float(np.mean(shares[worst]))
    return [
        Figure(f"{state}: outside 1 +- 1/4", share, "%", 100.0 * other, BESIDE, at_most_times=MOST),
        *figures.percentiles(f"{state}: interval off", mine, woken, "us", 1e6, BESIDE),
        Figure(f"{state}: skipped ticks", skipped, ""),
    ]


def report(short: bool) -> Report:
    cyclictest.needed()
    rounds, seconds, in_the_cut = (1, 1.0, 0.0) if short else (ROUNDS, TURN_S, IN_THE_CUT)
    turns: dict[str, list[Turn]] = {state: [] for state in STATES}
    answers_per_s: list[float] = []
    for _ in range(rounds):
        for state, turn in machine_turns(seconds, in_the_cut, answers_per_s).items():
            turns[state].append(turn)
    found = [figure for state in STATES for figure in beside(state, turns[state])]
    faults = sum(turn.faults for state in STATES for turn in turns[state])
    found.append(Figure("faults", float(faults), "", at_most=0.0))
    found.append(Figure("loaded: answers of the panel", float(np.mean(answers_per_s)), "1/s", PER_S, "asked"))
    off = np.concatenate([five_buses.periods(one)[0] for turn in turns["loaded"] for one in turn.stamps_s])
    return Report(tuple(found), figures.by_lateness(off), "the intervals of five buses, loaded")


if __name__ == "__main__":
    figures.main(report)
