"""An operator who does not wait for the planner, and processes that end or are ended with the service.

What a kill costs of the cut is in tests/acceptance/test_killed_in_a_run.py.
"""

from __future__ import annotations

import json
import math
import statistics
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.live.live_machines import gone
from support.live.served_machine import CALM_S, Serving, calm, serving

from controller.ipc.control_socket import Client, CommandRefused, control_path

pytestmark = [pytest.mark.slow, pytest.mark.live]

HOLDS = 5


def rows(lines: int) -> str:
    """Short rows of a CAM system, that plan and check have their work with."""
    points = (
        f"G1 X{0.2 * n:.3f} Y{5.0 * math.sin(n / 40):.3f} A{2.0 * math.sin(n / 60):.3f}\n"
        for n in range(lines)
    )
    return "G21 G90 G54 G43.4 G0 X0 Y0 Z50. A0 C0\nF2000\n" + "".join(points) + "M30\n"


LARGE, TOO_LARGE = rows(100), rows(700)
LONG = "G21 G90 G54\n" + "G1 X100. F3000\nG1 X-100.\n" * 20 + "M30\n"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("kills")
    with serving(folder, *calm(folder)) as running:
        running.ready()
        yield running


def started(service: Serving, text: str) -> None:
    service.load(text)
    service.done("start")
    service.until(lambda now: now["mode"] == "RUNNING" and now["feed_mm_min"]["actual"] > 100.0)


@pytest.mark.parametrize("word", ["stop", "unload"])
def test_a_check_that_takes_long_is_given_up(word: str, service: Serving) -> None:
    """Asked by another client, while the one who loads still waits for his answer."""
    path, said = service.state / "large.ngc", []
    path.write_text(TOO_LARGE)

    def load() -> None:
        try:
            Client(control_path(service.runtime)).ask("load", path=str(path))
        except CommandRefused as error:
            said.append(error.sentence)

    loading = threading.Thread(target=load)
    loading.start()
    service.until(lambda now: now["sequence"]["name"] == "load" and now["sequence"]["state"] == "running")
    service.ask(word)
    now = service.until(lambda now: now["sequence"]["state"] != "running")
    loading.join()
    assert now["mode"] == "READY" and said == ["The check was given up."]
    came = now["sequence"]["name"], now["sequence"]["state"]
    assert came == (("load", "failed") if word == "stop" else ("unload", "done"))
    assert (now["job"] and now["job"]["state"]) == ("refused" if word == "stop" else None)
    if word == "unload":
        service.done("home")


def test_a_hold_is_taken_at_once_while_a_large_program_is_planned(service: Serving) -> None:
    """Within two SYNCs and 50 ms of the bus' time, as a rule; the computer may be busy elsewhere once."""
    started(service, LARGE)
    asked = []
    for _ in range(HOLDS):
        service.until(lambda now: now["mode"] == "RUNNING" and not now["at_rest"])
        asked.append(service.status()["tick"]["number"])
        service.ask("hold")
        service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
        service.ask("resume")
    service.until(lambda now: now["mode"] == "RUNNING")
    service.ask("stop")
    service.ended()
    service.until(lambda _: service.runs())
    run = service.runs()[0].facts
    lines = (service.state / "runs" / run["record"] / "events.jsonl").read_text().splitlines()
    events = [json.loads(line) for line in lines]
    taken = [run["first_tick"] + event["tick"] for event in events if event["request"] == "hold"]
    assert len(taken) == HOLDS
    late = [after - before for before, after in zip(asked, taken, strict=True)]
    assert statistics.median(late) <= 2 + 0.050 / CALM_S, late


def test_the_service_asked_to_end_in_a_cut_takes_all_its_processes_with_it(tmp_path: Path) -> None:
    with serving(tmp_path, *calm(tmp_path)) as service:
        service.ready()
        started(service, LONG)
        pids = [service.pid("tick"), service.pid("plan")]
        assert service.end() == 0
        assert gone(pids)
        assert not (service.runtime / "control.sock").exists()
    (run,) = [json.loads(path.read_text()) for path in (tmp_path / "state" / "runs").glob("*/run.json")]
    assert run["result"] == "interrupted"
