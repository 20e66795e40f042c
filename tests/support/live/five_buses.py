"""The shipped machine with a bus and a simulated drive for each axis, as in a shop, and when its SYNCs left.

Five hubs, tick, plan, service and panel are processes as in production (``serve --simulate``, ``panel``).
SYNC is stamped by the kernel when the tick hands it to a bus, and told by the bus as it leaves the wire.
"""

from __future__ import annotations

import contextlib
import os
import socket
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from support.live import shop
from support.live.shop import ROOT, Shop
from support.suite.cyclictest import Absence

from controller.store import service_store
from controller.store.set_up_store import SPINDLE
from drives import pdo
from drives.ports import hub_protocol
from drives.ports.hub_protocol import FILTER, FILTERED, TIMED, TIMES_FRAME

MACHINE, PERIOD_S = "trunnion_five_buses", 0.5e-3
PART, TOOL = "example2_ready.ngc", 4
TEXT = (ROOT / "config" / "programs" / PART).read_bytes()
ONLY_SYNC = TIMES_FRAME + pdo.FRAME.pack(FILTER, 8, FILTERED.pack(pdo.SYNC, 0x7FF))
LOOK_S = 0.05
OUTSIDE = 0.25  # of the period

Rows = npt.NDArray[np.float64]


@contextlib.contextmanager
def opened(folder: Path) -> Iterator[Shop]:
    """Homed and enabled, with Example 2's tool in the spindle and its program stored; ``folder`` is empty."""
    (folder / "state").mkdir()
    service_store.put(folder / "state", SPINDLE, TOOL)
    with shop.opened(folder, PERIOD_S, machine=MACHINE) as running:
        running.ready()
        running.upload(PART, TEXT)
        yield running


def begin(running: Shop) -> None:
    """Example 2, from its start, with the spindle switched on by hand."""
    running.do("POST", "/job", json={"program": PART})
    running.do("POST", "/cycle/start")
    running.until(lambda now: bool(now["spindle_change"]), "asked for the spindle")
    running.do("POST", "/cycle/resume")


def tick_cores(pids: list[int]) -> set[int]:
    """Cores on which the tick among these processes may run."""
    name = "directrix-tick"
    tick = next(pid for pid in pids if Path(f"/proc/{pid}/comm").read_text().strip() == name)
    return os.sched_getaffinity(tick)


def hub_paths(pids: list[int]) -> list[str]:
    """Of the virtual buses among these processes."""
    words = [Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0") for pid in pids]
    jobs = (one[one.index("bus") + 2] for one in words if "controller.runtime" in one and "bus" in one)
    return sorted(str(Path(job).with_suffix(".hub")) for job in jobs)


class Stamps:
    """Listens for SYNC on every bus from now until ``close``; nothing is lost that the hub could deliver."""

    def __init__(self, paths: list[str]) -> None:
        """Raises OSError where there is no hub."""
        self._joined = {hub_protocol.connect(path, ONLY_SYNC): bytearray() for path in paths}
        for joined in self._joined:
            joined.setblocking(False)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while not self._over.wait(LOOK_S):
            for joined, heard in self._joined.items():
                _drain(joined, heard)

    def close(self) -> list[Rows]:
        """Times (CLOCK_MONOTONIC, s) of each bus's SYNCs, in the order of the paths."""
        self._over.set()
        self._thread.join()
        kind = np.dtype([("at_s", "<f8"), ("frame", "V16")])
        found = []
        for joined, heard in self._joined.items():
            _drain(joined, heard)
            joined.close()
            found.append(np.frombuffer(bytes(heard), kind)["at_s"].copy())
        return found


def _drain(joined: socket.socket, heard: bytearray) -> None:
    with contextlib.suppress(BlockingIOError):
        while packet := joined.recv(hub_protocol.MAX_FRAMES * TIMED.size):
            if len(packet) % TIMED.size == 0:  # a frame without time came before the hub had heard of us
                heard += packet


def periods(times_s: Rows, period_s: float = PERIOD_S) -> tuple[Rows, Rows]:
    """How far each interval is off (in periods), and for how many SYNCs it stands: a skipped one is two."""
    gaps = np.diff(times_s) / period_s
    return np.abs(gaps - 1.0), np.maximum(np.rint(gaps), 1.0)


def outside(times_s: Rows, period_s: float = PERIOD_S) -> float:
    """Share of the SYNCs that came outside of 1 +- 1/4 periods after the one before."""
    off, count = periods(times_s, period_s)
    return float(np.sum(count[off > OUTSIDE]) / np.sum(count))


def away(times_s: Rows, absences: Sequence[Absence]) -> npt.NDArray[np.bool_]:
    """Of each interval between SYNCs: whether an absence reaches into it."""
    found = np.zeros(len(times_s) - 1, dtype=bool)
    for one in absences:
        first, last = np.searchsorted(times_s, (one.begin_s, one.end_s))
        found[max(0, first - 1) : last] = True
    return found


def judged(times_s: Rows, absences: Sequence[Absence]) -> list[float]:
    """Numbers of SYNCs of a bus: within 1 +- 1/4 T, outside for the computer's sake, outside for ours."""
    off, count = periods(times_s)
    outside, excused = off > OUTSIDE, away(times_s, absences)
    return [float(np.sum(count[one])) for one in (~outside, outside & excused, outside & ~excused)]
