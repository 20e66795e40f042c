"""The net of ``tests/data/net``: remade whole, or what is named of it.

    PYTHONPATH=.:tests python -m support.net.make tests/data/net [--only NAME ...] [--look]

Whatever has become another is made of the code as it is, and reported: how many runs, from which second on;
lines of answers. ``--look`` writes nothing, and ends with 1 where something is another. A NAME is where the
names of runs ("017", "runs") or of entries ("answers", "answers/check-example1", "declared/help") begin.

    ... --show 017 [--against CHECKOUT]    a run: its files, and the second from which it differs; beside
                                           another checkout that has the net (git worktree add), the tick and
                                           the axis, too
    ... --draw 200                         the inputs of so many runs anew, from the seed
    ... --state                            the state folder anew, by a service in real time
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from support.net import drawn, runs, sheets, state_folder
from support.net.drawn import Drawn

ATTEMPTS = 12
ONE_REFUSED_IN = 17  # runs that stay though they are refused


def draw(folder: Path, count: int) -> None:
    """The inputs of so many runs, most of them such as run."""
    found = list[Drawn]()
    for number in range(count):
        for attempt in range(ATTEMPTS):
            one = drawn.sound(number, attempt, lambda one: runs.carried_out(one)[0].ticks)
            if one is None:
                continue
            stays = number % ONE_REFUSED_IN == 0 and attempt >= ATTEMPTS // 2
            if stays or runs.carried_out(one)[0].ticks > 0:
                found.append(one)
                print(one.name, flush=True)
                break
    folder.mkdir(parents=True, exist_ok=True)
    runs.write_inputs(folder, found)


def remake_runs(folder: Path, wanted: list[str], look: bool) -> int:
    """How many are others."""
    given = runs.inputs(folder)
    before = runs.known(folder) if (folder / runs.RUNS).exists() else {}
    names = [name for name in given if not wanted or any(name.startswith(one) for one in wanted)]
    now = dict(before)
    differing = 0
    try:
        for name in names:
            now[name], _ = runs.carried_out(given[name])
            told = runs.difference(name, before[name], now[name]) if name in before else f"run {name}: is new"
            if told:
                print(told, flush=True)
                differing += 1
    finally:  # what was made by then stays made
        if not look:
            runs.write(folder, {name: came for name, came in now.items() if name in given})
    print(f"{differing} of {len(names)} runs differ")
    return differing


def remake_sheets(folder: Path, wanted: list[str], look: bool) -> int:
    """How many entries are others."""
    made = sheets.entries(folder)
    differing = 0
    for name in sheets.chosen(folder, wanted):
        try:
            now = made[name]()
        except Exception as error:  # whatever the code has become: the others are looked at, too
            now = f"raised = {type(error).__name__}: {error}\n"
        if told := sheets.difference(folder, name, now):
            print(told, flush=True)
            differing += 1
            if not look:
                sheets.write(folder, name, now)
    return differing


def show(folder: Path, run: str, against: Path | None) -> None:
    """What a run is of and what comes of it, in files; where it differs from the net, and from other code."""
    drawn_runs = runs.inputs(folder)
    names = [one for one in drawn_runs if one.startswith(run)]
    if len(names) != 1:
        sys.exit(f"{run}: {len(names)} runs begin so; choose one of {', '.join(names or drawn_runs)}")
    one = drawn_runs[names[0]]
    came, counts = runs.carried_out(one)
    out = Path(tempfile.mkdtemp(prefix=f"net-{one.name.split()[0]}-"))
    (out / "machine.toml").write_text(one.machine)
    (out / "program.ngc").write_text(one.program)
    (out / "events.json").write_text(json.dumps(one.events))
    np.save(out / "setpoints.npy", counts)
    print(f"{one.name}: {came.result}, {came.ticks} ticks; machine, program and setpoints are in {out}")
    print(runs.difference(one.name, runs.known(folder)[one.name], came) or "as the net has it")
    if against is not None:
        print(_beside(folder.resolve(), one, counts, against.resolve(), out))


def _beside(folder: Path, one: Drawn, counts: np.ndarray, checkout: Path, out: Path) -> str:
    """The first setpoint that differs from what the code of another checkout makes of the same run."""
    code = "import sys, numpy, pathlib; from support.net import runs; "
    code += "drawn = runs.inputs(pathlib.Path(sys.argv[1]))[sys.argv[2]]; "
    code += "numpy.save(sys.argv[3], runs.carried_out(drawn)[1])"
    other = out / "setpoints_there.npy"
    words = [sys.executable, "-c", code, str(folder), one.name, str(other)]
    path = {"PYTHONPATH": f"{checkout}:{checkout / 'tests'}"}
    subprocess.run(words, cwd=checkout, env={**os.environ, **path}, check=True)
    there = np.load(other)
    most = min(len(there), len(counts))
    apart = np.argwhere(there[:most] != counts[:most])
    if len(apart):
        tick, axis = apart[0]
        told = f"{len(np.unique(apart[:, 0]))} of {most} ticks differ, the first is {tick}, axis {axis}: "
        return told + f"{there[tick, axis]} counts there, {counts[tick, axis]} here"
    return f"the same setpoints in {most} ticks; {len(counts)} here, {len(there)} there"


def main() -> None:
    as_written = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=as_written)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--look", action="store_true")
    parser.add_argument("--show")
    parser.add_argument("--against", type=Path)
    parser.add_argument("--draw", type=int)
    parser.add_argument("--state", action="store_true")
    asked = parser.parse_args()
    folder: Path = asked.folder
    if asked.show:
        show(folder, asked.show, asked.against)
        return
    began = time.process_time()
    if asked.draw:
        draw(folder, asked.draw)
    if asked.state:
        state_folder.make(folder)
    of_runs = [one for one in asked.only if one[:1].isdigit() or one == "runs"]
    differing = 0
    others = [one for one in asked.only if one not in of_runs]
    if of_runs or not others:
        differing += remake_runs(folder, [one for one in of_runs if one != "runs"], asked.look)
    if others or not of_runs:
        differing += remake_sheets(folder, others, asked.look)
    took_s = time.process_time() - began
    print(f"{differing} differ{'' if asked.look else ' and are remade'}, {took_s:.0f} s of CPU")
    sys.exit(1 if asked.look and differing else 0)


if __name__ == "__main__":
    main()
