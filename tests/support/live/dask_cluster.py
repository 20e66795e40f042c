"""A Dask scheduler with workers that nobody but the test starts again, by Dask's own commands."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

HANGS_S = 60.0  # no wait is meant to come near


def until(is_so: Callable[[], object]) -> None:
    ends_s = time.monotonic() + HANGS_S
    while not is_so():
        assert time.monotonic() < ends_s, "it hangs"
        time.sleep(0.05)


class Cluster:
    """Processes that write what they say nowhere. ``address`` is the scheduler's."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        where = folder / "scheduler.json"
        own = ("--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(where))
        self.scheduler = self._begin("scheduler", *own)
        self.workers: list[subprocess.Popen[bytes]] = []
        until(lambda: where.exists() and where.stat().st_size)
        self.address: str = json.loads(where.read_text())["address"]

    def begin_worker(self) -> None:
        """One more, and waits until it has joined."""
        from distributed import Client

        self.workers.append(self._begin("worker", self.address, "--nthreads", "1", "--no-nanny"))
        alive = [one for one in self.workers if one.poll() is None]
        with Client(self.address, timeout=HANGS_S, set_as_default=False) as client:
            until(lambda: len(client.nthreads()) == len(alive))

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _begin(self, *words: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *words, "--no-dashboard"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            cwd=self._folder,
        )


@contextlib.contextmanager
def opened(folder: Path, workers: int) -> Iterator[Cluster]:
    cluster = Cluster(folder)
    try:
        for _ in range(workers):
            cluster.begin_worker()
        yield cluster
    finally:
        cluster.close()
