"""Scenario after scenario for hours: what came of them, and a folder for each that did not hold.

A folder is the record of the run, so that ``directrix replay FOLDER`` makes it again, with beside it

    soak.json       seed, number, tick, what is wrong, and all that was asked
    faults.txt      what was done to drives and buses
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from support.soak import live, scenarios, stepped
from support.soak.memory import Growth, Memory, give_back
from support.soak.scenarios import Scenario
from support.soak.stepped import Came


@dataclass
class Sum:
    """What came of all runs so far."""

    seed: int
    runs: int = 0
    ticks: int = 0
    results: Counter[str] = field(default_factory=Counter)
    kept: list[str] = field(default_factory=list)  # folders of what did not hold
    processes: dict[str, Growth] = field(default_factory=dict)  # our own, and of a machine on the real clock

    @property
    def grown(self) -> dict[str, tuple[float, float]]:
        """Memory (MB) when it had settled and at the end, of each process that has grown."""
        return {name: (g.first_mb, g.last_mb) for name, g in self.processes.items() if not g.is_flat}

    def to_dict(self) -> dict[str, object]:
        processes = {name: growth._asdict() for name, growth in self.processes.items()}
        more = {"results": dict(self.results), "processes": processes, "is_flat": not self.grown}
        return {**asdict(self), **more}


Told = Callable[[Scenario, Came, Sum], None]
Draw = Callable[[int, int], Scenario]  # of seed and number


def soak(
    seed: int,
    seconds: float,
    out: Path,
    first: int = 0,
    count: int | None = None,
    told: Told = lambda *_: None,
    run: Callable[[Scenario, Path], Came] = stepped.run,
    draw: Draw = scenarios.drawn,
) -> Sum:
    """Runs until the seconds are over, or ``count`` are done; ``told`` gets each as it is done."""
    began_s, found, own = time.monotonic(), Sum(seed), Memory()
    while time.monotonic() - began_s < seconds and found.runs != count:
        one = draw(seed, first + found.runs)
        with tempfile.TemporaryDirectory(prefix="directrix-soak-") as folder:
            came = run(one, Path(folder))
            found.runs += 1
            found.ticks += came.ticks
            found.results[came.result] += 1
            if came.wrong:
                found.kept.append(str(_keep(one, came, out)))
        give_back()
        own.look({"soak": os.getpid()}, time.monotonic())
        told(one, came, found)
    found.processes = own.growth()
    return found


def on_real_clock(
    seed: int,
    seconds: float,
    out: Path,
    first: int = 0,
    count: int | None = None,
    told: Told = lambda *_: None,
) -> Sum:
    """Likewise, on one machine that runs in real time, as in a shop."""
    with (
        tempfile.TemporaryDirectory(prefix="directrix-soak-") as folder,
        live.opened(seed, Path(folder)) as on,
    ):
        found = soak(
            *(seed, seconds, out, first, count, told),
            lambda of, _: live.run(on, of),
            lambda seed, number: scenarios.live(seed, number, on.machine),
        )
        found.processes |= on.memory.growth()
    return found


def _keep(one: Scenario, came: Came, out: Path) -> Path:
    """The folder of what did not hold."""
    folder = out / f"{one.seed}-{one.number}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if came.record is not None and came.record.is_dir():
        shutil.copytree(came.record, folder, dirs_exist_ok=True)
    else:
        (folder / "program.ngc").write_text(one.program)
        (folder / "machine.toml").write_text(one.machine.text)
    (folder / "faults.txt").write_text(one.script)
    facts = {"seed": one.seed, "number": one.number, "scenario": one.title, "period_s": one.machine.period_s}
    facts |= {"result": came.result, "tick": came.tick, "wrong": came.wrong, "asked": came.told}
    (folder / "soak.json").write_text(json.dumps(facts, indent=1) + "\n")
    return folder
