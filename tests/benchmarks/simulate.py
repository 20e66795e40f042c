"""How much faster than the motion ``directrix simulate`` is: the whole command, on one core, and its parts.

Processor seconds (user and system) from the start of the interpreter to its end, imports, planning,
commissioning and the written trace included, beside the seconds of motion in that trace; nothing of the
program is stored before. The parts are of the same run and add up to it: ``start`` (interpreter, imports,
words of the command line), ``plan`` (machine file, program, bus budget, path and its audit), ``come up``
(commissioning and homing), ``ticks`` (stepped: planner, tick, bus, drives), ``trace`` (figures and files),
``end`` (of the process).

Wanted are eight times of every shipped program, on a computer that does nothing else.
The best of the runs counts, which come in turn so that a busy computer is unfair to none. With DIRECTRIX_TREE
the same is done with the code in another folder, run for run. The first run of each tree makes its
bytecode and does not count.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parents[2]
sys.path[:0] = [str(HERE / "tests")]

from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

NAMES = ("example1", "example2", "example1_ready", "example2_ready")
EXAMPLES = tuple(HERE / "config" / "programs" / f"{name}.ngc" for name in NAMES)
WANTED = 8.0  # times faster: a pump is simulated with every tick, and the contour error watched
UNPROMISED = {"example1.ngc"}  # 11 s of motion: a quarter of its time is what the command imports
RUNS = 5
WATCHED = HERE / "tests" / "support" / "suite" / "simulate_parts.py"


class Run(NamedTuple):
    """One program with one tree: processor seconds of the best run with its parts, and seconds of motion."""

    program: str
    tree: str
    cpu_s: float
    motion_s: float
    parts_s: dict[str, float]


def measured(program: Path, tree: Path) -> Run:
    """One run of the command in a process that is told apart into its parts."""
    with tempfile.TemporaryDirectory() as folder:
        marks = Path(folder, "marks.json")
        words = ("simulate", str(program), "--gouge", "warn", "--json")
        kept = ("--trace", f"{folder}/t.npz", "--store", folder)
        with open(f"{folder}/report.json", "w+") as report:
            process = subprocess.Popen(
                (sys.executable, str(WATCHED), str(marks), *words, *kept),
                stdout=report,
                cwd=tree,
                env=_environment(tree, folder),
            )
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            report.seek(0)
            told = json.load(report)
        if process.returncode:
            raise SystemExit(f"{program}: {told}")
        parts_s, cpu_s = json.loads(marks.read_text()), used.ru_utime + used.ru_stime
    return Run(
        program.name,
        str(tree),
        cpu_s,
        told["duration_s"],
        {**parts_s, "end": cpu_s - sum(parts_s.values())},
    )


def _environment(tree: Path, folder: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPATH": str(tree), "XDG_STATE_HOME": folder}


def best(programs: list[Path], trees: list[Path], runs: int) -> list[Run]:
    pairs = [(program, tree) for program in programs for tree in trees]
    for program, tree in pairs[: len(trees)]:
        measured(program, tree)
    found: dict[tuple[Path, Path], Run] = {}
    for _ in range(runs):
        for pair in pairs:
            run = measured(*pair)
            found[pair] = min(found.get(pair, run), run, key=lambda one: one.cpu_s)
    return list(found.values())


def report(short: bool) -> Report:
    """Of this tree; of another one, too, where DIRECTRIX_TREE names it."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    other = os.environ.get("DIRECTRIX_TREE")
    programs, trees = (
        list(EXAMPLES[: 1 if short else None]),
        [HERE, *([Path(other).resolve()] if other else [])],
    )
    found = best(programs, trees, 1 if short else RUNS)
    ours = [one for one in found if one.tree == str(HERE)]
    told = [
        Figure(
            f"{one.program}{'' if one in ours else ', ' + one.tree}",
            one.cpu_s,
            "s of CPU",
            one.motion_s,
            "the motion",
            at_most_times=None if one.program in UNPROMISED else 1.0 / WANTED,
        )
        for one in found
    ]
    parts = {part: sum(one.parts_s[part] for one in ours) for part in ours[0].parts_s}
    return Report(tuple(told), figures.shares(parts), "the command")


if __name__ == "__main__":
    figures.main(report)
