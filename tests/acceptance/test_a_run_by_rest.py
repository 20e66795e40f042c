"""``directrix serve --simulate`` and ``directrix panel``: Example 2 by REST alone, and run again."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.live.shop import Shop, opened
from typer.testing import CliRunner

from controller.__main__ import app
from controller.machine import machine_file
from controller.state.setpoints import SETPOINTS, Segment

NAME = "example2_ready.ngc"
TEXT = machine_file.shipped_program(NAME).read_bytes()
PART = b"G21 G90 G54\nG0 X40.\nG1 X-40. Y10. F400\nG1 X30. Y-10. F400\nG0 X0 Y0\nM30\n"
ACTIVE = ("RUNNING", "HOLD", "STOPPING")

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]


def test_a_program_is_brought_checked_run_held_and_finished_by_rest_and_simulate_does_it_again(
    tmp_path: Path,
) -> None:
    with opened(tmp_path) as shop:
        shop.up()
        check = shop.upload(NAME, TEXT)
        assert shop.refused("POST", "/cycle/start", 409)["mode"] == "OFF", "nothing starts by an upload"
        shop.ready()
        shop.put_in(4)
        shop.do("POST", "/job", json={"program": NAME})
        assert shop.status()["job"]["duration_s"] == pytest.approx(check["duration_s"])
        shop.do("POST", "/cycle/start")
        shop.until(lambda now: now["mode"] == "HOLD" and now["spindle_change"], "the stop for the spindle")
        shop.do("POST", "/cycle/resume")
        hold_on_the_way(shop)
        shop.do("PUT", "/overrides/feed", json={"share": 2.0})
        shop.do("POST", "/cycle/resume")
        last = shop.until(lambda now: now["mode"] not in ACTIVE, "the end")
        assert (last["mode"], last["fault"]) == ("READY", None)
        run = shop.run_record()
        assert (run["program"], run["result"]) == (NAME, "completed")
        files = {
            name: shop.http.get(f"/runs/{run['id']}/files/{name}").raise_for_status().content
            for name in ("events.jsonl", "setpoints.npz")
        }
    assert words(files["events.jsonl"]) == ["resume", "hold", "override", "resume"]
    (tmp_path / "setpoints.npz").write_bytes(files["setpoints.npz"])
    live = SETPOINTS.piece(Segment(0, tmp_path / "setpoints.npz"), run["facts"]["record"]).rows
    (tmp_path / "events.jsonl").write_bytes(files["events.jsonl"])
    again = simulated(tmp_path, tmp_path / "machine.toml")
    assert_same_setpoints(live, again)


def test_a_run_that_was_stopped_is_offered_and_gone_on_with_and_the_panels_death_stops_nothing(
    tmp_path: Path,
) -> None:
    with opened(tmp_path) as shop:
        shop.ready()
        shop.upload("part.ngc", PART)
        assert shop.do("GET", "/restart")["offered"] is False, "nothing was run yet"
        shop.do("POST", "/job", json={"program": "part.ngc"})
        shop.do("POST", "/cycle/start")
        cutting = shop.until(lambda now: now["mode"] == "RUNNING" and now["job"]["line"] == 3, "line 3")
        shop.kill("panel")
        later = shop.until(
            lambda now: now["tick"]["number"] > cutting["tick"]["number"] + 50, "the new panel"
        )
        assert (later["mode"], later["job"]["name"]) == ("RUNNING", "part.ngc")
        assert shop.refused("POST", "/cycle/resume", 409)["code"] == "control", (
            "the token went with the panel"
        )
        shop.do("POST", "/cycle/stop")  # which needs none
        shop.until(lambda now: now["mode"] == "READY", "the stop")
        assert shop.run_record()["result"] == "stopped"
        job = shop.status()["job"]
        assert job["state"] == "stopped" and 0.0 < job["fraction"] < 1.0 and job["left_s"] > 0.0
        shop.take_control()
        offer = shop.do("GET", "/restart")
        assert offer["done"] == pytest.approx(job["fraction"], abs=0.01) and offer["line"] == job["line"]
        assert 0.0 < offer["fraction"] < 1.0 and offer["left_s"] == pytest.approx(job["left_s"], rel=0.05)
        assert (offer["offered"], offer["program"], offer["exact"]) == (True, "part.ngc", True), offer
        assert offer["line"] in (3, 4)
        again = shop.do("POST", "/job", json={"program": "part.ngc", "restart": True})["result"]
        assert f"Line {offer['line']}," in again["restart"][0]["sentence"], "the state at the place is shown"
        shop.do("PUT", "/overrides/feed", json={"share": 2.0})
        shop.do("POST", "/cycle/start")
        shop.until(lambda now: now["mode"] == "RUNNING", "the rest")
        last = shop.until(lambda now: now["mode"] not in ACTIVE, "the end")
        assert (last["mode"], last["fault"]) == ("READY", None)
        shop.run_record(1)
        assert [run["result"] for run in shop.do("GET", "/runs")["runs"]] == ["completed", "stopped"]
        assert shop.do("GET", "/restart")["offered"] is False, "nothing is left of it"


def hold_on_the_way(shop: Shop) -> None:
    """Held in the cut; what the status and the store say meanwhile."""
    shop.until(lambda now: now["mode"] == "RUNNING" and (now["job"]["fraction"] or 0.0) > 0.1, "the cut")
    shop.do("POST", "/cycle/hold")
    held = shop.until(lambda now: now["mode"] == "HOLD" and now["at_rest"], "the hold")
    job = held["job"]
    assert job["name"] == NAME and 0.0 < job["left_s"] < job["duration_s"]
    assert shop.refused("DELETE", f"/programs/{NAME}", 409)["code"] == "running"
    assert shop.refused("POST", "/machine/home", 409, json={})["mode"] == "HOLD"


def words(events: bytes) -> list[str]:
    """The operator's requests, in their order."""
    found = [json.loads(line)["request"] for line in events.splitlines()]
    return [word for word in found if word not in ("begin", "stand", "plan", "pieces")]


def simulated(folder: Path, machine: Path) -> np.ndarray:
    """The setpoints (N, 5) of ``simulate --events`` in a folder with the run's events."""
    program, trace, checks = folder / NAME, folder / "again.npz", folder / "state" / "checks"
    program.write_bytes(TEXT)
    asked = ["simulate", str(program), "--machine", str(machine), "--store", str(checks), "--json"]
    ran = CliRunner().invoke(app, [*asked, "--events", str(folder / "events.jsonl"), "--trace", str(trace)])
    assert ran.exit_code == 0, ran.output
    assert json.loads(ran.stdout)["result"] == "completed"
    found: np.ndarray = np.load(trace)["joint_setpoint"]
    return found


def assert_same_setpoints(live: np.ndarray, again: np.ndarray) -> None:
    """To the last count; the ends differ only in how long it was looked at a machine that stands."""
    length = min(len(live), len(again))
    np.testing.assert_array_equal(again[:length], live[:length])
    rest = np.concatenate([live[length:], again[length:]])
    assert (rest == live[length - 1]).all(), "what is longer stands"
