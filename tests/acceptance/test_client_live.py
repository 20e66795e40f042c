"""A machine in production by the command line alone: serve and panel as processes, and the client verbs.

Nothing here asserts wall-clock times; every wait is for something that the machine says.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from support.live.shop import Shop, driven, opened
from typer.testing import CliRunner

from controller.__main__ import app

pytestmark = pytest.mark.soak
PROGRAM = "G21 G90 G54\nT1 M6\nS1000 M3\nG43.4\nG0 X-20 Y0 Z60 A0 C0\nG1 X20 F300\nG1 X-20\nG49\nM5\nM30\n"


class Machine:
    """A command line beside a shop."""

    def __init__(self, shop: Shop) -> None:
        self._shop = shop

    def run(self, *words: str) -> tuple[int, Any]:
        """Exit code and what was answered."""
        ran = CliRunner().invoke(app, [*words, "--url", self._shop.url, "--json"])
        assert ran.stdout.count("\n") == 1, ran.stdout + ran.stderr
        return ran.exit_code, json.loads(ran.stdout)

    def do(self, *words: str) -> Any:
        code, told = self.run(*words)
        assert code == 0, (words, told)
        return told

    def wait(self, words: str, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """A status after one that ``holds``; ``words`` for whoever waits in vain."""
        self._shop.until(holds, words)
        told: dict[str, Any] = self.do("status")
        return told


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    with opened(tmp_path, machine=driven()) as shop:
        yield Machine(shop)


def mode(name: str) -> Callable[[dict[str, Any]], bool]:
    return lambda now: now["mode"] == name


def is_up(now: dict[str, Any]) -> bool:
    """Drives commissioned, and nothing under way."""
    busy = (now.get("sequence") or {}).get("state") == "running"
    return now["mode"] == "OFF" and bool(now.get("joints")) and not busy


def test_a_program_is_brought_checked_started_held_and_finished_by_the_command_line_alone(
    machine: Machine, tmp_path: Path
) -> None:
    file = tmp_path / "part.ngc"
    file.write_text(PROGRAM)
    up = machine.wait("up", is_up)
    assert up["fault"] is None and len(up["not_homed"]) == 5, "it comes up off and not homed"
    code, told = machine.run("start")
    assert code == 1 and told["error"], "nothing is loaded, nothing is enabled"

    assert machine.do("upload", str(file))["check"]["state"] == "passed"
    machine.do("home")
    machine.do("enable")
    assert machine.wait("ready", mode("READY"))["not_homed"] == []
    machine.do("override", "50")
    machine.do("start", "part.ngc")
    cutting = machine.wait("cutting", lambda now: now["mode"] == "RUNNING" and now["override"] == 0.5)
    assert cutting["job"]["name"] == "part.ngc" and cutting["job"]["left_s"] > 0.0

    machine.do("hold")
    held = machine.wait("held", lambda now: now["mode"] == "HOLD" and now["at_rest"])
    code, told = machine.run("home")
    assert code == 1 and told["mode"] == "HOLD" and told["request"] == "HOME"
    assert machine.run("status")[1]["joints"]["X"]["machine"] == held["joints"]["X"]["machine"]

    machine.do("override", "200")
    machine.do("resume")
    machine.wait("at its end", mode("READY"))
    (run,) = machine.do("runs")["runs"]
    assert run["program"] == "part.ngc" and run["result"] == "completed"
    machine.do("disable")
    assert machine.wait("off", mode("OFF"))["fault"] is None


def test_an_emergency_stop_becomes_an_alarm_that_somebody_acknowledges(machine: Machine) -> None:
    machine.wait("up", is_up)
    machine.do("home")
    machine.do("enable")
    machine.do("estop")
    stopped = machine.wait("stopped", mode("FAULT"))
    assert stopped["fault"]["name"] == "EMERGENCY_STOP" and stopped["fault"]["key"]
    (alarm,) = machine.do("alarms")["alarms"]
    assert alarm["name"] == "EMERGENCY_STOP" and alarm["acknowledged_s"] is None
    machine.do("alarms", "--acknowledge", str(alarm["id"]))
    machine.do("reset")
    assert machine.wait("reset", mode("OFF"))["fault"] is None


def test_a_step_moves_an_axis_by_its_distance_and_a_held_key_stops_at_its_end(machine: Machine) -> None:
    machine.wait("up", is_up)
    machine.do("home")
    machine.do("enable")
    before = machine.wait("ready", mode("READY"))["joints"]["X"]["machine"]
    machine.do("jog", "X", "-5")
    moved = machine.wait("at rest", mode("READY"))["joints"]["X"]["machine"]
    assert moved == pytest.approx(before - 5.0, abs=1e-3)
    machine.do("jog", "X", "--speed", "0.1", "--seconds", "0.5")
    assert machine.wait("at rest", mode("READY"))["joints"]["X"]["machine"] > moved
