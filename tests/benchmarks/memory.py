"""What a simulated machine that stands costs: memory and processor time of each of its processes.

A machine as in a shop (``serve --simulate`` and ``panel``) stands with its drives on and one page's worth of
listening. Memory is what a process has for itself and its share of what it has with others (PSS), and what
it has locked; beside it an interpreter with numpy. Its late ticks are not only counted, so it has a pump.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.live.pumps import pump_of  # noqa: E402
from support.live.shop import opened  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.ipc.control_socket import Client, control_path  # noqa: E402

TICKS_PER_S = 100.0  # of the kernel's accounting
PERIOD_S = 2e-3


def tree(pid: int) -> list[int]:
    """A process and all below it."""
    children = " ".join(file.read_text() for file in Path(f"/proc/{pid}/task").glob("*/children")).split()
    return [pid, *(one for child in children for one in tree(int(child)))]


def name(pid: int) -> str:
    return Path(f"/proc/{pid}/comm").read_text().strip()


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def megabytes(pid: int, file: str, key: str) -> float:
    rows = Path(f"/proc/{pid}/{file}").read_text().splitlines()
    return next((int(row.split()[1]) / 1024.0 for row in rows if row.startswith(key)), 0.0)


def bare_mb() -> float:
    """PSS of an interpreter that has imported numpy."""
    words = (sys.executable, "-c", "import numpy, sys; print(1, flush=True); sys.stdin.read()")
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdin=pipe, stdout=pipe) as process:
        assert process.stdout is not None
        process.stdout.readline()
        found = megabytes(process.pid, "smaps_rollup", "Pss:")
        process.communicate()
    return found


def report(short: bool) -> Report:
    bare = bare_mb()
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder), PERIOD_S, late="stop") as shop:
        shop.ready()
        pids = dict(Client(control_path(shop.runtime)).ask("facts")["pids"])
        tick = int(pids["tick"])
        every = [pid for one in shop.processes.values() for pid in tree(one.pid)]
        before, began_s = {pid: cpu_s(pid) for pid in every}, time.monotonic()
        time.sleep(1.0 if short else 20.0)
        lasted_s = time.monotonic() - began_s
        used = {pid: cpu_s(pid) - before[pid] for pid in every}
        memory = {pid: megabytes(pid, "smaps_rollup", "Pss:") for pid in every}
        locked = [megabytes(pid, "status", "VmLck:") for pid in (tick, pump_of(tick))]
        names = {pid: called(pid, every) for pid in every}
    found = [Figure(f"memory, {names[pid]}", memory[pid], "MB", bare, "python, numpy") for pid in every]
    found += [
        Figure(f"processor, {names[pid]}", 100.0 * used[pid] / lasted_s, "% of a core") for pid in every
    ]
    found += [
        Figure("memory, all", sum(memory.values()), "MB", bare, "python, numpy"),
        Figure("processor, all", 100.0 * sum(used.values()) / lasted_s, "% of a core"),
        Figure("locked by the tick and its pump", sum(locked), "MB", at_most=60.0),
        Figure("of that by the pump", locked[1], "MB"),
    ]
    parts = figures.shares({names[pid]: memory[pid] for pid in every})
    return Report(tuple(found), parts, "the memory")


def called(pid: int, every: list[int]) -> str:
    """Its name, with a number where there are several."""
    same = [one for one in every if name(one) == name(pid)]
    return name(pid) if len(same) == 1 else f"{name(pid)} {same.index(pid) + 1}"


if __name__ == "__main__":
    figures.main(report)
