"""The command line's live machine, interrupted: it ends, with all of its processes."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.live.live_machines import HANGS_S, gone, processes, until

ROOT = Path(__file__).resolve().parents[3]


@contextlib.contextmanager
def demo(out: Path) -> Iterator[subprocess.Popen[str]]:
    """The command in a session of its own, with a folder for what a killed one cannot clear away."""
    command = [sys.executable, "-m", "controller", "demo", "--out", str(out)]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        running = subprocess.Popen(
            command,
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "TMPDIR": scratch},
        )
        try:
            yield running
        finally:
            running.kill()
            running.communicate()


def named(parent: int, name: str) -> dict[int, str]:
    children = processes(parent)
    return children if name in children.values() else {}


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize(
    ("stage", "wait_ticks"),
    [("virtual-bus", 0), ("directrix-tick", 0), ("directrix-plan", 0), ("directrix-plan", 2500)],
)
def test_ctrl_c_ends_the_demo_without_a_traceback_and_without_orphans(
    stage: str, wait_ticks: int, tmp_path: Path
) -> None:
    with demo(tmp_path) as running:
        children = until(lambda: named(running.pid, stage))
        if wait_ticks:  # on the bus: well into the cut
            time.sleep(wait_ticks * 0.002)
        children |= processes(running.pid)
        os.killpg(running.pid, signal.SIGINT)
        _, told = running.communicate(timeout=HANGS_S)
        assert running.returncode not in (0, None)
        assert "Traceback" not in told and "Error" not in told
        assert gone(list(children))
        assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_a_parent_that_is_killed(how: signal.Signals, tmp_path: Path) -> None:
    with demo(tmp_path) as running:
        children = until(lambda: named(running.pid, "directrix-plan"))
        assert len(children) == 3
        running.send_signal(how)
        running.wait(HANGS_S)
        until(lambda: gone(list(children)))
