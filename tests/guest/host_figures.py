"""What a computer says of the time that its guest does not get, for the guest to read: see absence.py.

    python host_figures.py FILE PID_FILE CORE

Twice a second FILE is made anew: that core's line of /proc/stat, and a line "waited", with the seconds
that the processes of the guest's session were ready to run while the computer ran something else (the
second figure of /proc/PID/schedstat; Linux, sched-stats), and CLOCK_MONOTONIC; both from any beginning.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path

EVERY_S = 0.5
PROC = Path("/proc")


class Waiting:
    """How long the processes of a session have waited for their turn, those that have ended included."""

    def __init__(self, proc: Path = PROC) -> None:
        self._proc = proc
        self._total_ns = 0
        self._last_ns: dict[str, int] = {}

    def look(self, session: str) -> float:
        """Seconds, up to now."""
        found_ns = dict(self._found(session))
        self._total_ns += sum(ns - self._last_ns.get(pid, 0) for pid, ns in found_ns.items())
        self._last_ns = found_ns
        return self._total_ns * 1e-9

    def _found(self, session: str) -> Iterator[tuple[str, int]]:
        for process in self._proc.glob("[0-9]*"):
            with contextlib.suppress(OSError, IndexError):  # it may end meanwhile
                if session_of(process) == session:
                    yield process.name, int((process / "schedstat").read_text().split()[1])


def session_of(process: Path) -> str:
    """Fourth after the name, which may hold anything (proc(5))."""
    return (process / "stat").read_text().rpartition(")")[2].split()[3]


def read(text: str) -> tuple[float, float]:
    """(seconds waited, CLOCK_MONOTONIC) of the file's text; zeros where it has none."""
    for line in text.splitlines():
        if line.startswith("waited "):
            _, waited_s, at_s = line.split()
            return float(waited_s), float(at_s)
    return 0.0, 0.0


def tell(file: Path, pid_file: Path, core: str) -> None:
    """For good."""
    waiting, made = Waiting(), file.with_suffix(".new")
    while True:
        waited_s = 0.0
        with contextlib.suppress(OSError):  # the guest is not up yet
            waited_s = waiting.look(session_of(PROC / pid_file.read_text().strip()))
        lines = (PROC / "stat").read_text().splitlines()
        cpu = next((line for line in lines if line.startswith(f"cpu{core} ")), lines[0])
        made.write_text(f"{cpu}\nwaited {waited_s:.3f} {time.monotonic():.3f}\n")
        made.rename(file)
        time.sleep(EVERY_S)


if __name__ == "__main__":
    tell(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
