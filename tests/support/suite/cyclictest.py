"""``cyclictest`` (Debian: rt-tests): how late a thread in C wakes up, on this computer and in this run."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

SAMPLE = re.compile(rb"^\s*\d+:\s*\d+:\s*(-?\d+)\s*$", re.M)
SPIKE = re.compile(rb"^T:\s*(\d+) Spike:\s*(\d+): TS:\s*(\d+)\s*$", re.M)
CYCLES = re.compile(rb"^T:\s*\d+ .*\bC:\s*(\d+)", re.M)
FROM_THE_KERNEL = 99  # priority above which only the kernel is
MOST_SPIKES = 2_000_000
POLL_S = 0.01
WARM_UP = 50  # wake-ups of each turn that do not count

Rows = npt.NDArray[np.float64]


def needed() -> None:
    """Raises SystemExit where there is none."""
    if shutil.which("cyclictest") is None:
        raise SystemExit("cyclictest is missing: apt-get install rt-tests")


def turn(seconds: float, period_s: float, priority: int, core: int | None = None) -> Rows:
    """Latencies (s) of one turn, sample by sample, on any core or on one."""
    # -v prints every sample; -q would keep it silent
    command = ["cyclictest", "-m", "-N", "-v", "-t1", f"-i{round(period_s * 1e6)}"]
    command += [f"-l{round(seconds / period_s)}", f"-p{priority}"]
    command += [] if core is None else [f"-a{core}"]
    found = subprocess.run(command, capture_output=True, check=False)
    samples = np.array([int(value) for value in SAMPLE.findall(found.stdout)], dtype=float) * 1e-9
    if len(samples) <= WARM_UP:
        raise SystemExit(f"cyclictest gave no samples: {found.stderr.decode(errors='replace')[:300]}")
    return samples[WARM_UP:]


def wakes_s(latencies_s: Rows, period_s: float) -> Rows:
    """When its thread woke (s): whole periods that it overslept are gone for it."""
    overslept = np.floor(latencies_s / period_s)
    before = np.concatenate([[0.0], np.cumsum(overslept[:-1])])
    found: Rows = (np.arange(len(latencies_s)) + before) * period_s + latencies_s
    return found


class Absence(NamedTuple):
    """A core did nothing for anybody (CLOCK_MONOTONIC, s): its thread of the highest priority waited."""

    core: int
    begin_s: float
    end_s: float


class Watch:
    """Beside whatever runs: a thread on each core, above all others, notes when it was woken late itself.

    Nothing of ours can be the reason: it was the kernel, or the host that keeps a virtual computer waiting.
    """

    def __init__(self, period_s: float, late_s: float) -> None:
        """``late_s``: what counts, beyond the thread's own time to be woken."""
        self._command = ["cyclictest", "-m", "-q", "-S", f"-i{round(period_s * 1e6)}", "-d0"]
        self._command += [f"-p{FROM_THE_KERNEL}", f"--spike={round(late_s * 1e6)}"]
        self._command += [f"--spike-nodes={MOST_SPIKES}"]
        self.absences: tuple[Absence, ...] = ()  # at the end, by time
        self.woken = 0  # times, each of the threads

    def __enter__(self) -> Watch:
        """Returns when its threads are there. Raises SystemExit where it is not permitted."""
        pipe = subprocess.PIPE
        self._process = process = subprocess.Popen(self._command, stdout=pipe, stderr=subprocess.DEVNULL)
        while len(list(Path(f"/proc/{process.pid}/task").glob("*"))) <= len(os.sched_getaffinity(0)):
            if process.poll() is not None:
                raise SystemExit("cyclictest gets no real-time priority here")
            time.sleep(POLL_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.send_signal(signal.SIGINT)
        told, _ = self._process.communicate()
        rows = ((int(core), 1e-6 * int(late), 1e-6 * int(at)) for core, late, at in SPIKE.findall(told))
        self.absences = tuple(sorted((Absence(c, at - late, at) for c, late, at in rows), key=_end))
        self.woken = max((int(count) for count in CYCLES.findall(told)), default=0)

    def longest_s(self, begin_s: float, end_s: float) -> float:
        """Of the absences of any core that reach into that time; 0 = all were there."""
        met = (one for one in self.absences if one.end_s > begin_s and one.begin_s < end_s)
        return max((one.end_s - one.begin_s for one in met), default=0.0)


def _end(one: Absence) -> float:
    return one.end_s
