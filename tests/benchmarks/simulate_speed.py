"""How much faster than the motion ``directrix simulate`` is: the whole command, on one core.

    python tests/benchmarks/simulate_speed.py [PROGRAM ...] [--runs N] [--tree DIR] [--json]

Processor seconds (user and system) from the start of the interpreter to its end, imports, planning,
commissioning and the written trace included, beside the seconds of motion in that trace; nothing of the
program is stored before. The best of the runs counts, which come in turn so that a busy computer is unfair
to none. With ``--tree`` the same is done with the code in another folder, run for run. The first run of each
tree makes its bytecode and does not count.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parents[2]
EXAMPLES = tuple(HERE / "config" / "programs" / f"{name}.ngc" for name in ("example1", "example2"))


class Figure(NamedTuple):
    """One program with one tree: processor seconds of the best run, and seconds of motion."""

    program: str
    tree: str
    cpu_s: float
    motion_s: float

    @property
    def times_faster(self) -> float:
        return self.motion_s / self.cpu_s


def measured(program: Path, tree: Path) -> Figure:
    """One run of the command."""
    with tempfile.TemporaryDirectory() as folder:
        command = (sys.executable, "-m", "controller", "simulate", str(program), "--gouge", "warn", "--json")
        kept = ("--trace", f"{folder}/t.npz", "--store", folder)
        with open(f"{folder}/report.json", "w+") as report:
            process = subprocess.Popen((*command, *kept), stdout=report, cwd=tree, env=_environment(folder))
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            report.seek(0)
            told = json.load(report)
    if process.returncode:
        raise SystemExit(f"{program}: {told}")
    return Figure(program.name, str(tree), used.ru_utime + used.ru_stime, told["duration_s"])


def _environment(folder: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "XDG_STATE_HOME": folder}


def best(programs: list[Path], trees: list[Path], runs: int) -> list[Figure]:
    pairs = [(program, tree) for program in programs for tree in trees]
    for program, tree in pairs[: len(trees)]:
        measured(program, tree)
    found: dict[tuple[Path, Path], Figure] = {}
    for _ in range(runs):
        for pair in pairs:
            figure = measured(*pair)
            found[pair] = min(found.get(pair, figure), figure, key=lambda one: one.cpu_s)
    return list(found.values())


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    arguments.add_argument("programs", nargs="*", type=Path, default=list(EXAMPLES))
    arguments.add_argument("--runs", type=int, default=3)
    arguments.add_argument("--tree", type=Path, help="Another checkout to compare with.")
    arguments.add_argument("--json", action="store_true")
    asked = arguments.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    programs = [program.resolve() for program in asked.programs]
    trees = [HERE, *([asked.tree.resolve()] if asked.tree else [])]
    figures = best(programs, trees, asked.runs)
    if asked.json:
        print(json.dumps([{**one._asdict(), "times_faster": one.times_faster} for one in figures], indent=1))
        return
    for one in figures:
        print(
            f"{one.program:24} {one.motion_s:8.3f} s of motion in {one.cpu_s:7.3f} s:"
            f" {one.times_faster:5.1f} times faster   {one.tree}"
        )


if __name__ == "__main__":
    main()
