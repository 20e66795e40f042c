"""Processes of the service killed under it, and an operator who does not wait for the planner."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from living import gone
from serving import Serving, serving

pytestmark = pytest.mark.soak

LINES = 400
PERIOD_S = 0.002
# Short rows of a CAM system, that plan and check have their work with.
LARGE = (
    "G21 G90 G54 G43.4 G0 X0 Y0 Z50. A0 C0\nF2000\n"
    + "".join(
        f"G1 X{0.2 * n:.3f} Y{5.0 * math.sin(n / 40):.3f} A{2.0 * math.sin(n / 60):.3f}\n"
        for n in range(LINES)
    )
    + "M30\n"
)
LONG = "G21 G90 G54\n" + "G1 X100. F3000\nG1 X-100.\n" * 20 + "M30\n"


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Serving]:
    with serving(tmp_path) as running:
        running.ready()
        yield running


def started(service: Serving, text: str) -> None:
    service.load(text)
    service.done("start")
    service.until(lambda now: now["mode"] == "RUNNING" and now["feed_mm_min"]["actual"] > 100.0)


def test_a_hold_is_taken_at_once_while_a_large_program_is_planned(service: Serving) -> None:
    started(service, LARGE)
    before = service.status()["tick"]["number"]
    service.ask("hold")
    service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
    service.ask("stop")
    service.ended()
    service.until(lambda _: service.ask("runs")["runs"])
    run = service.ask("runs")["runs"][0]
    events = (service.state / "runs" / run["id"] / "events.jsonl").read_text().splitlines()
    (taken,) = [event["tick"] for event in map(json.loads, events) if event["request"] == "hold"]
    assert run["first_tick"] + taken - before <= 2 + 0.050 / PERIOD_S


def test_a_stop_gives_up_a_check_that_takes_long(service: Serving) -> None:
    path = service.state / "large.ngc"
    path.write_text(LARGE)
    service.ask("load", path=str(path))
    if service.status()["sequence"]["state"] == "running":
        service.ask("stop")
        service.until(lambda now: now["sequence"]["state"] != "running")
    assert service.status()["mode"] == "READY"
    started(service, LONG)


def test_a_killed_planner_stops_the_tool_on_the_path_and_costs_no_homing(service: Serving) -> None:
    started(service, LONG)
    service.kill("plan")
    now = service.until(lambda now: now["fault"] and now["fault"]["recording"] and now["at_rest"])
    assert (now["mode"], now["fault"]["name"]) == ("FAULT", "PLANNER_GONE")
    assert now["not_homed"] == [] and now["fault"]["position_trusted"]
    service.until(lambda now: now["plan_alive"])
    service.done("reset")
    service.done("enable")
    service.done("start")
    assert service.until(lambda now: now["mode"] == "RUNNING")
    service.ask("stop")
    assert service.ended()["job"]["state"] == "stopped"


def test_a_killed_tick_is_an_alarm_with_a_recording_and_a_reset_starts_another(service: Serving) -> None:
    started(service, LONG)
    old = service.pid("tick")
    service.kill("tick")
    now = service.until(lambda now: not now["tick_alive"] and now["fault"])
    assert now["fault"]["name"] == "CONTROLLER_GONE" and Path(now["fault"]["recording"]).is_dir()
    assert service.refused("start").code == "gone"
    service.done("reset")
    now = service.status()
    assert (now["mode"], now["fault"], len(now["not_homed"])) == ("OFF", None, 5)
    assert service.pid("tick") != old
    service.ready()
    service.done("start")
    assert service.until(lambda now: now["mode"] == "RUNNING")


def test_the_service_asked_to_end_in_a_cut_takes_all_its_processes_with_it(tmp_path: Path) -> None:
    with serving(tmp_path) as service:
        service.ready()
        started(service, LONG)
        pids = [service.pid("tick"), service.pid("plan")]
        assert service.end() == 0
        assert gone(pids)
        assert not (service.runtime / "control.sock").exists()
    (run,) = [json.loads(path.read_text()) for path in (tmp_path / "state" / "runs").glob("*/run.json")]
    assert run["result"] == "interrupted"


def test_a_killed_service_leaves_no_process_behind_and_is_followed_by_another(tmp_path: Path) -> None:
    with serving(tmp_path) as service:
        service.ready()
        started(service, LONG)
        pids = [service.pid("tick"), service.pid("plan")]
        service.process.send_signal(signal.SIGKILL)
        service.process.wait()
        while not gone(pids):
            pass
    with serving(tmp_path) as service:
        service.up()
        now = service.status()
        assert (now["mode"], now["job"], len(now["not_homed"])) == ("OFF", None, 5)
