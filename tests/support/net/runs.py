"""Runs on the stepped clock, of which the SHA-256 of each second of setpoints is known.

A line of ``RUNS`` is a run: its name, how it ended, its ticks, and for each second of its setpoints (counts
of all axes, as sent with SYNC) the first digits of the SHA-256.
"""

from __future__ import annotations

import hashlib
import json
import lzma
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from support.net.drawn import Drawn

from controller.ipc.handoff import COLUMN, of_axes
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.machine.spindle import unasked
from controller.machine.toml_table import ConfigError
from controller.plan.planner import Planner
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.runtime.events import Event
from controller.runtime.startup import SessionError
from controller.runtime.stepped import Run, SteppedMachine
from controller.state.modes import MAX_AXES, Request

INPUTS, RUNS = "runs.json.xz", "runs.txt"
MAX_TICKS = 4000  # then the operator stops it
DIGITS = 8
SEE = "PYTHONPATH=.:tests python -m support.net.make tests/data/net --show {name}"
MEANT = "If that is meant: PYTHONPATH=.:tests python -m support.net.make tests/data/net --only {name}"
ELSEWHERE = (
    "Where no code was changed, it is another computer's mathematics (libm, BLAS): it may round a setpoint "
    "to another count; --show with --against a checkout of before says whether that differs here, too."
)


class Came(NamedTuple):
    """What came of a run."""

    result: str  # "completed", "stopped", "held", "fault" with its name, or "refused:line:column:key"
    ticks: int
    seconds: tuple[str, ...]

    def line(self) -> str:
        return " ".join((self.result, str(self.ticks), *self.seconds))

    @classmethod
    def of(cls, line: str) -> Came:
        result, ticks, *seconds = line.split()
        return cls(result, int(ticks), tuple(seconds))


class _Bounded(SteppedMachine):
    """One whose operator stops a run that has taken so many ticks."""

    events: list[Event]

    def keep_rows(self, n: int, progress: object) -> None:
        super().keep_rows(n, progress)  # type: ignore[arg-type]
        if n == MAX_TICKS:
            self.events[:] = [*(e for e in self.events if e.tick < n), Event(n, Request.STOP)]


def carried_out(drawn: Drawn) -> tuple[Came, np.ndarray]:
    """What comes of a run, and its setpoints, (ticks, axes) counts."""
    nothing = np.zeros((0, MAX_AXES), dtype=np.int64)
    events = [Event(tick, Request[name], value) for tick, name, value in drawn.events]
    try:
        machine = machine_file.read(drawn.machine, "machine.toml")
        machine = replace(machine, spindle=unasked(machine.spindle))  # drawn before operators were asked
        task = checked.task(drawn.program.encode(), "part.ngc", machine)
        bench = _Bounded(machine)
        bench.come_up()
        task = replace(task, start=bench.joints)
        walk = checked.walk_of(task, None, False)
        bench.events = events
        run = bench.run(walk, events)
    except ProgramError as error:
        return Came(f"refused:{error.line}:{error.column}:{error.said['key']}", 0, ()), nothing
    except (ConfigError, SessionError) as error:
        return Came(f"refused:{type(error).__name__}", 0, ()), nothing
    sent = run.rows[run.rows[:, COLUMN["sync_sent"]] != 0.0]
    counts = np.ascontiguousarray(sent[:, of_axes("setpoint", MAX_AXES)].astype("<i8"))
    return Came(_result(run, bench.planner), len(counts), seconds(counts, machine)), counts


def _result(run: Run, planner: Planner) -> str:
    if run.result == "fault":
        return f"fault:{run.fault.name}"
    if (error := planner.error) is not None:
        return f"{run.result}:{error.line}:{error.column}:{error.said['key']}"
    return run.result


def seconds(counts: np.ndarray, machine: Machine) -> tuple[str, ...]:
    """The first digits of the SHA-256 of each second."""
    per = round(1.0 / machine.period_s)
    return tuple(
        hashlib.sha256(counts[k : k + per].tobytes()).hexdigest()[:DIGITS] for k in range(0, len(counts), per)
    )


# ---- the data


def inputs(folder: Path) -> dict[str, Drawn]:
    """All runs, by name."""
    rows = json.loads(lzma.decompress((folder / INPUTS).read_bytes()))
    return {
        name: Drawn(name, machine, text, tuple(map(tuple, events))) for name, machine, text, events in rows
    }


def write_inputs(folder: Path, drawn: Iterable[Drawn]) -> None:
    text = json.dumps(sorted(drawn), separators=(",", ":"))
    (folder / INPUTS).write_bytes(lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))


def known(folder: Path) -> dict[str, Came]:
    rows = (line.partition(": ") for line in (folder / RUNS).read_text().splitlines())
    return {name: Came.of(line) for name, _, line in rows}


def write(folder: Path, found: Mapping[str, Came]) -> None:
    (folder / RUNS).write_text("".join(f"{name}: {came.line()}\n" for name, came in sorted(found.items())))


def difference(name: str, before: Came, now: Came) -> str:
    """A sentence on where a run is another; "" where it is the same."""
    if before == now:
        return ""
    pairs = zip(before.seconds, now.seconds, strict=False)
    differs = [k for k, (then, since) in enumerate(pairs) if then != since]
    first = differs[0] if differs else min(len(before.seconds), len(now.seconds))
    told = f"run {name}: differs from second {first} on (0 is the first)"
    if not differs and before.seconds == now.seconds:
        told = f"run {name}: the same setpoints"
    ended = lambda came: f"{came.result} after {came.ticks} ticks"  # noqa: E731
    return f"{told}; it was {ended(before)}, it is {ended(now)}. See it: {SEE.format(name=name.split()[0])}"
