"""What checking costs: a surface by its placement, chords by their corners, a folder on one worker to many.

A surface's cost is processor time of the library in this process, its parts are those of a check. A folder is
checked by the command on one process and on two. A line of chords with corners, or of adaptive clearing, is
held beside one of a smooth row, in the same run. What more workers do than there are cores is measured with
processes that wait as long as each program took, instead of working: all of ``controller/workers.py`` runs
(questions, answers, their order), only the cores are lent. It stands beside the formula there.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.parts import plane_chords, surface_trains  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.cli import check_folder  # noqa: E402
from controller.machine import machine_file  # noqa: E402
from controller.runtime import checked  # noqa: E402
from controller.workers import Workers  # noqa: E402

ROOT = Path(__file__).parents[2]
PLACEMENTS = ("P1", "P2", "P3", "P4 R0.05")
WANTED_MS = 60.0  # of P1
SMOOTH = 0.5, 1.5  # degrees of corners between chords
CHORDS = (  # corners in degrees, and what the path is
    ("smooth", SMOOTH, "G64 P0.001"),
    ("10 deg, G64 P", (10.0, 10.0), "G64 P0.001"),
    ("5 to 15 deg, G64 P", (5.0, 15.0), "G64 P0.001"),
    ("5 to 15 deg, wider P", (5.0, 15.0), "G64 P0.01"),
    ("5 to 15 deg, exact", (5.0, 15.0), ""),
)
MAX_TIMES_SMOOTH = 2.0
SIMULATED = 8
TURNS = 3  # of one and two workers, of which the calmest count
START_S = 1.0  # in which a worker has begun


def text(surfaces: int, placement: str, turned: float = 0.0) -> str:
    return surface_trains.program(surfaces, turned).replace("P1", placement)


class Timed:
    """Seconds of a check by its parts: what stands around a function is not counted twice."""

    PARTS = (("chosen_for", "branches, placements"), ("_audited", "gouges, form"))

    def __init__(self) -> None:
        self.parts_s: dict[str, float] = {name: 0.0 for _, name in self.PARTS}

    def check(self, program: str, store: Path) -> float:
        """Its processor seconds."""
        machine = machine_file.load("trunnion")
        began_s = time.process_time()
        before = {name: getattr(checked, name) for name, _ in self.PARTS}
        for name, part in self.PARTS:
            setattr(checked, name, partial(self._timed, before[name], part))
        try:
            checked.check(checked.task(program.encode(), "row.ngc", machine), store)
        finally:
            for name, function in before.items():
                setattr(checked, name, function)
        return time.process_time() - began_s

    def _timed(self, function: Callable[..., Any], part: str, *arguments: Any) -> Any:
        began_s = time.process_time()
        try:
            return function(*arguments)
        finally:
            self.parts_s[part] += time.process_time() - began_s


def line_us(source: str, store: Path) -> float:
    """Processor time of a line in a check."""
    machine = machine_file.load("trunnion")
    began_s = time.process_time()
    checked.check(checked.task(source.encode(), "chords.ngc", machine), store)
    return 1e6 * (time.process_time() - began_s) / source.count("\n")


def folder_s(folder: Path, workers: int) -> float:
    """Seconds of the command, into a store of its own."""
    with tempfile.TemporaryDirectory() as store:
        began_s = time.perf_counter()
        words = ("check", str(folder), "--store", store, "--workers", str(workers), "--json")
        subprocess.run(
            (sys.executable, "-m", "controller", *words), cwd=ROOT, stdout=subprocess.DEVNULL, check=True
        )
        return time.perf_counter() - began_s


def simulated_s(took_s: Sequence[float], workers: int) -> float:
    """What so many processes take that wait for these times; they have started before."""
    with Workers(workers) as pool:
        list(pool.each(time.sleep, [START_S] * workers, START_S))
        began_s = time.perf_counter()
        list(pool.each(time.sleep, took_s, START_S))
        return time.perf_counter() - began_s


def modelled_s(took_s: Sequence[float], workers: int) -> float:
    """The formula of ``controller/workers.py`` with q = 0 and S = 0."""
    return -(-len(took_s) // workers) * sum(took_s) / len(took_s)


def report(short: bool) -> Report:
    timed, found = Timed(), []
    with tempfile.TemporaryDirectory() as name:
        folder, count = Path(name), 2 if short else 20
        of_p1_ms = 0.0
        for placement in PLACEMENTS[:2] if short else PLACEMENTS:
            cost_ms = 1e3 * timed.check(text(count, placement), folder / "store") / count
            of_p1_ms = of_p1_ms or cost_ms
            wanted_ms = WANTED_MS if placement == "P1" else None
            found.append(
                Figure(f"a surface, {placement}", cost_ms, "ms of CPU", of_p1_ms, "P1", at_most=wanted_ms)
            )
        whole_s = sum(one.value for one in found) * 1e-3 * count
        many = 300 if short else 6000
        sources = {what: plane_chords.program(many, corners, path) for what, corners, path in CHORDS}
        sources["adaptive clearing"] = plane_chords.adaptive(many)
        chords = [(what, line_us(source, folder / "chords")) for what, source in sources.items()]
        programs = folder / "programs"
        programs.mkdir()
        for k in range(4 if short else 40):
            (programs / f"part{k}.ngc").write_text(text(4, PLACEMENTS[k % 2], 0.1 * k))
        turns = [(folder_s(programs, 1), folder_s(programs, 2)) for _ in range(1 if short else TURNS)]
        one_s, two_s = map(min, zip(*turns, strict=True))
        took_s = [_alone_s(job) for job in check_folder.jobs(programs, machine_file.load("trunnion"))]
    smooth_us = chords[0][1]
    for what, one_us in chords:
        wanted = None if what == "smooth" else MAX_TIMES_SMOOTH
        beside = (smooth_us, "smooth")
        found.append(Figure(f"a chord, {what}", one_us, "us of CPU", *beside, at_most_times=wanted))
    found.append(Figure("a folder on two workers", two_s, "s", one_s, "one worker", at_most_times=0.6))
    for workers in (2, SIMULATED):
        found.append(
            Figure(
                f"a folder on {workers} simulated workers",
                simulated_s(took_s, workers),
                "s",
                modelled_s(took_s, workers),
                "the formula",
            )
        )
    rest = {"path, laws": whole_s - sum(timed.parts_s.values())}
    return Report(tuple(found), figures.shares({**timed.parts_s, **rest}), "a check")


def _alone_s(job: check_folder.Job) -> float:
    began_s = time.process_time()
    row = check_folder.examined(machine_file.load("trunnion"), job)
    assert row.state == "passed", row
    return time.process_time() - began_s


if __name__ == "__main__":
    figures.main(report)
