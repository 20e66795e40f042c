"""The privileges of a real-time process: what it says it was given is what it has."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from drives import real_time

# In a process of its own: what it gets it keeps.
LOOK = """
import gc, json, os
from drives import real_time
granted = real_time.prepare()
files = [os.path.realpath(f"/proc/self/fd/{n}") for n in os.listdir("/proc/self/fd")]
print(json.dumps({
    "granted": granted, "files": files, "scheduler": os.sched_getscheduler(0), "collects": gc.isenabled(),
    "status": open("/proc/self/status").read(), "slack_ns": int(open("/proc/self/timerslack_ns").read()),
}))
"""


@pytest.fixture(scope="module")
def prepared() -> dict[str, Any]:
    done = subprocess.run([sys.executable, "-c", LOOK], capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def test_what_it_says_it_was_given_is_what_it_has(prepared: dict[str, Any]) -> None:
    granted = prepared["granted"]
    locked = re.search(r"VmLck:\s+(\d+)", prepared["status"])
    assert locked is not None
    assert granted["locked"] is (int(locked.group(1)) > 0)
    assert granted["fifo"] is (prepared["scheduler"] & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO)
    assert granted["slack"] is (prepared["slack_ns"] <= 1), "0: of a real-time process it is none"
    assert granted["awake"] is ("/dev/cpu_dma_latency" in prepared["files"])
    assert not prepared["collects"]


def test_the_wish_to_stay_awake_is_a_zero_in_a_file_that_stays_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel takes it back when the file is closed (Documentation/power/pm_qos_interface)."""
    device, opened = tmp_path / "device", os.open
    device.write_bytes(b"")
    kept: list[int] = []

    def open_it(path: str, flags: int) -> int:
        assert path == "/dev/cpu_dma_latency"
        kept.append(opened(device, flags))
        return kept[-1]

    monkeypatch.setattr(real_time.os, "open", open_it)
    assert real_time._permitted(real_time._stay_awake)
    assert device.read_bytes() == bytes(4)  # a 32-bit number of microseconds
    os.close(kept[0])  # raises where it was closed already


def test_a_device_that_is_not_ours_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: str, flags: int) -> int:
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(real_time.os, "open", refuse)
    assert not real_time._permitted(real_time._stay_awake)
