"""A served machine with a spindle on a serial line: the inverter's process lives, dies and comes again."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.live.live_machines import gone
from support.live.served_machine import CALM_S, Serving, serving
from support.machines.spindle_machine import without_spindle

from controller.machine import machine_file

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

SPINDLE = """
[spindle]
max_rev_min = 12000
acceleration_rev_s2 = 400.0

[spindle.modbus]
port = "/dev/ttyUSB0"
profile = "delta_c2000"
"""


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Serving]:
    made = without_spindle((machine_file.SHIPPED / "trunnion.toml").read_text())
    assert "period_s = 0.002" in made
    file = tmp_path / "mill.toml"
    file.write_text(made.replace("period_s = 0.002", f"period_s = {CALM_S}") + SPINDLE)
    with serving(tmp_path, "--machine", str(file)) as running:
        running.ready()
        yield running


def inverter_of(service: Serving) -> int:
    """The process id, 0 where there is none."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if (
            b"controller.runtime" in words
            and b"inverter" in words
            and str(service.process.pid).encode() in words
        ):
            return int(folder.name)
    return 0


def test_it_turns_by_its_own_process_which_comes_again_and_ends_with_the_service(service: Serving) -> None:
    first = inverter_of(service)
    service.ask("spindle", rev_min=3000.0)
    turning = service.until(lambda now: now["spindle"]["at_speed"] and now["spindle"]["rev_min"] == 3000.0)
    assert abs(turning["spindle"]["actual_rev_min"] - 3000.0) < 150.0
    os.kill(first, signal.SIGKILL)
    service.until(lambda _: inverter_of(service) not in (0, first))
    service.ask("spindle", rev_min=0.0)
    service.until(lambda now: now["spindle"]["at_speed"] and now["spindle"]["actual_rev_min"] == 0.0)
    last = inverter_of(service)
    assert service.end() == 0 and gone([last])
