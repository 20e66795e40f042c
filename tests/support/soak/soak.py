"""Scenario after scenario for hours: what came of them, and a folder for each that did not hold.

A folder is the record of the run, so that ``directrix replay FOLDER`` makes it again, with beside it

    soak.json       seed, number, tick, what is wrong, and all that was asked
    faults.txt      what was done to drives and buses
"""

from __future__ import annotations

import gc
import json
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from support.soak import live, scenarios, stepped
from support.soak.memory import Growth, anonymous_mb
from support.soak.scenarios import Scenario
from support.soak.stepped import Came

SETTLED_S = 60.0  # then memory is what it is
GROWN = 1.25  # times that, and something is kept that should not be


@dataclass
class Sum:
    """What came of all runs so far."""

    seed: int
    runs: int = 0
    ticks: int = 0
    results: Counter[str] = field(default_factory=Counter)
    kept: list[str] = field(default_factory=list)  # folders of what did not hold
    settled_mb: float = 0.0  # memory of the process after ``SETTLED_S``
    memory_mb: float = 0.0  # at the end
    processes: dict[str, Growth] = field(default_factory=dict)  # of a machine on the real clock

    @property
    def grown(self) -> dict[str, tuple[float, float]]:
        """Memory (MB) when it had settled and at the end, of each process that has grown."""
        own = {} if self.memory_mb <= GROWN * self.settled_mb else {"soak": (self.settled_mb, self.memory_mb)}
        others = {name: (g.first_mb, g.last_mb) for name, g in self.processes.items() if not g.is_flat}
        return (own if self.settled_mb else {}) | others

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
    began_s, found = time.monotonic(), Sum(seed)
    while time.monotonic() - began_s < seconds and found.runs != count:
        one = draw(seed, first + found.runs)
        with tempfile.TemporaryDirectory(prefix="directrix-soak-") as folder:
            came = run(one, Path(folder))
            found.runs += 1
            found.ticks += came.ticks
            found.results[came.result] += 1
            if came.wrong:
                found.kept.append(str(_keep(one, came, out)))
        gc.unfreeze()  # replay, as a command, has frozen what was there; it thinks that its process ends
        gc.collect()
        found.memory_mb = anonymous_mb() or 0.0
        if not found.settled_mb and time.monotonic() - began_s > SETTLED_S:
            found.settled_mb = found.memory_mb
        told(one, came, found)
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
        found.processes = on.memory.growth()
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
