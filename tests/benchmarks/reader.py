"""The reader alone beside LinuxCNC's rs274: processor time on four kinds of file, and memory on a long one.

Each file is read by both in one run, in turns, the least of three times each: our reader to blocks, in this
process; rs274 (on the path, or DIRECTRIX_RS274) to canonical calls, written to nowhere. The ratio is our
time over rs274's. A long file is read from the disk in a process of its own,
which tells the most memory that it ever had beyond that of a one-line program.
"""

from __future__ import annotations

import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

LINES = 60_000
RUNS = 3
READ = "--read"


def _number(rng: random.Random) -> str:
    return f"{rng.uniform(-99.0, 99.0):.3f}"


def _mixed(rng: random.Random, k: int) -> str:
    x, y = _number(rng), _number(rng)
    return rng.choice(
        (
            f"N{k} G0 X{x} Y{y}",
            f"G2 X{x} Y{y} R{rng.randrange(300, 900)}",
            "M8",
            "(comment)",
            f"G1 X{x} F300",
            f"N{k} G1 Z{x}",
            f"G3 X{x} Y{y} R900.",
        )
    )


def _line(letters: str, rng: random.Random, feed: bool) -> str:
    words = " ".join(f"{letter}{_number(rng)}" for letter in letters)
    return f"{words} F{rng.randrange(100, 900)}" if feed else words


KINDS: dict[str, tuple[str, Callable[[random.Random, int], str]]] = {
    "G1 X Y Z F": ("G21 G90 F500", lambda rng, _: f"G1 {_line('XYZ', rng, True)}"),
    "X Y Z": ("G21 G90 G1 F500", lambda rng, _: _line("XYZ", rng, False)),
    "G1 X Y Z A C F": ("G21 G90 F500", lambda rng, _: f"G1 {_line('XYZAC', rng, True)}"),
    "mixed": ("G21 G90 G1 F500", _mixed),
}


def program(kind: str, lines: int) -> bytes:
    """A program of one kind."""
    head, line = KINDS[kind]
    rng = random.Random(1)
    return "\n".join([head, *(line(rng, k) for k in range(lines)), "M2", ""]).encode()


def ours_s(data: bytes) -> float:
    """Processor seconds of our reader."""
    from support.machines.shipped_kinds import machine

    from controller.program import blocks

    made = machine("fig4a")
    begun = time.process_time()
    for _ in blocks.stream(data, made, "p.ngc"):
        pass
    return time.process_time() - begun


def theirs_s(file: Path) -> float | None:
    """Processor seconds of rs274; None where it is not installed."""
    from support.oracles import reference_interpreter

    if (found := reference_interpreter.program()) is None:
        return None
    (file.parent / "p.var").write_text("5161 0.0\n5220 1\n")
    (file.parent / "p.tbl").write_text("T1 P1 D0.25 Z0.5 ;\n")
    quiet = subprocess.DEVNULL
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [found, "-v", "p.var", "-t", "p.tbl", "-g", file.name]
    apart = {**os.environ, "HOME": str(file.parent)}  # where it keeps its tool table
    subprocess.run(command, cwd=file.parent, env=apart, stdout=quiet, stderr=quiet, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def of_kind(kind: str, lines: int, folder: Path) -> tuple[float, float | None]:
    """Microseconds a line of our reader and of rs274, where there is one."""
    data = program(kind, lines)
    file = folder / "p.ngc"
    file.write_bytes(data)
    mine, other = [], []
    for _ in range(RUNS):
        mine.append(ours_s(data))
        if (seconds := theirs_s(file)) is not None:
            other.append(seconds)
    return 1e6 * min(mine) / lines, 1e6 * min(other) / lines if other else None


def memory_mb(megabytes: float, folder: Path) -> float:
    """The most memory of a process that reads a long file, beyond that of one that reads a line."""
    one, many = folder / "one.ngc", folder / "long.ngc"
    one.write_bytes(program("mixed", 1))
    part = program("mixed", 20_000).removesuffix(b"M2\n")
    with many.open("wb") as file:
        for _ in range(max(1, round(megabytes * 1e6 / len(part)))):
            file.write(part)
    peaks = [int(_apart(file)) for file in (one, many)]
    return (peaks[1] - peaks[0]) / 1e6


def _apart(file: Path) -> str:
    command = [sys.executable, __file__, READ, str(file)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def read(file: Path) -> int:
    """Read a file as ``explain`` has it; the most memory of its own that this process ever had, bytes."""
    from support.machines.shipped_kinds import machine

    from controller.program import blocks, linked

    most, text = 0, linked.linked(linked.mapped(file), linked.beside(file))
    for count, _ in enumerate(blocks.stream(text, machine("fig4a"), file.name)):
        if count % 100_000 == 0:
            most = max(most, _own_bytes())
    return max(most, _own_bytes())


def _own_bytes() -> int:
    """Resident memory that is not a mapped file's: pages of those are the system's, which takes them back."""
    rows = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(row.split()[1]) * 1024 for row in rows if row.startswith("RssAnon"))


def report(short: bool) -> Report:
    lines, megabytes = (2000, 1.0) if short else (LINES, 20.0)
    with tempfile.TemporaryDirectory() as name:
        us = {kind: of_kind(kind, lines, Path(name)) for kind in KINDS}
        memory = memory_mb(megabytes, Path(name))
    found = [Figure(f"a line, {kind}", mine, "us", other, "rs274") for kind, (mine, other) in us.items()]
    found.append(Figure("memory of a long file", memory, "MB", megabytes, "the file"))
    note = "" if all(other for _, other in us.values()) else "rs274 is not installed: see DIRECTRIX_RS274."
    parts = figures.shares({kind: mine for kind, (mine, _) in us.items()})
    return Report(tuple(found), parts, "a line of each kind", note)


if __name__ == "__main__":
    if sys.argv[1:2] == [READ]:
        print(read(Path(sys.argv[2])))
    else:
        figures.main(report)
