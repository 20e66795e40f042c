"""The service as its clients meet it: one process tree for all of these, asked in order.

Slow because it is live: beside other work a tick may come too late for its drives, and these tests
would be about that.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.live.served_machine import Serving, calm, serving

from controller.state.setpoints import SETPOINTS
from controller.store import set_up_store

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

SHORT = "G21 G90 G54 G0 X20.\nG1 X10. F3000\nM30\n"
NOT_ASKED = ("begin", "stand", "plan", "pieces")  # by an operator
LONG = "G21 G90 G54\n" + "G1 X100. F3000\nG1 X-100.\n" * 20 + "M30\n"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("service")
    with serving(folder, *calm(folder)) as running:
        running.up()
        yield running


def test_after_power_on_nothing_is_enabled_homed_or_moving(service: Serving) -> None:
    now = service.status()
    assert (now["mode"], now["not_homed"], now["job"]) == ("OFF", ["X", "Y", "Z", "A", "C"], None)
    assert now["at_rest"] and all(drive["state"] != "OPERATION_ENABLED" for drive in now["drives"])


def test_a_refusal_names_mode_request_and_reason(service: Serving) -> None:
    for verb in ("hold", "resume", "start", "mdi"):
        error = service.refused(verb, **({"text": "G0 X1"} if verb == "mdi" else {}))
        assert (
            (error.code, error.mode) == ("refused", "OFF") and error.request and error.sentence.endswith(".")
        )


def test_no_start_before_all_axes_are_homed(service: Serving) -> None:
    service.done("enable")
    service.load(SHORT)
    error = service.refused("start")
    assert (error.mode, error.request) == (
        "READY",
        "START",
    ) and "X, Y, Z, A, C must be homed" in error.sentence
    service.done("home", axes=["Z"])
    assert "X, Y, A, C must be homed" in service.refused("mdi", text="G0 X1").sentence


def test_programs_run_one_after_another_and_leave_records(service: Serving) -> None:
    service.ready()
    service.load(SHORT)
    for _ in range(2):
        service.done("start")
        assert service.ended()["job"]["state"] == "completed"
    service.done("mdi", text="G0 X0")
    now = service.ended()
    assert now["joints"]["X"]["machine"] == pytest.approx(0.0 + 8.0, abs=1e-6)  # G54
    assert now["job"]["name"] == "part.ngc"
    service.until(lambda _: len(service.runs()) == 3, "three records")
    newest, *older = service.runs()
    assert newest.program == "MDI" and {run.program for run in older} == {"part.ngc"}
    assert all(run.result == "completed" and run.facts["ticks"] > 10 for run in (newest, *older))


def test_the_time_left_is_that_of_the_check_and_ends_at_nothing(service: Serving) -> None:
    service.load(SHORT)
    planned_s = service.status()["job"]["duration_s"]
    service.done("start")
    service.ended()
    service.until(lambda _: service.runs()[0].program == "part.ngc")
    run = service.runs()[0]
    assert planned_s > 0.1 and abs(run.facts["duration_s"] - planned_s) < 5.0


def test_hold_resume_override_and_stop(service: Serving) -> None:
    service.load(LONG, "long.ngc")
    service.done("start")
    service.until(lambda now: now["mode"] == "RUNNING" and now["feed_mm_min"]["actual"] > 1000.0)
    service.ask("hold")
    held = service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
    assert held["job"]["state"] == "held" and held["job"]["left_s"] > 1.0
    service.ask("override", share=0.5)
    assert service.until(lambda now: now["override"] == 0.5)
    service.ask("resume")
    service.until(lambda now: now["mode"] == "RUNNING" and not now["at_rest"])
    assert service.refused("load", path="/dev/null").code == "refused"
    assert service.refused("set_offset", name="G54", values=[0, 0, 0]).mode == "RUNNING"
    service.ask("stop")
    assert service.ended()["job"]["state"] == "stopped"
    service.ask("override", share=1.0)
    service.until(lambda _: service.runs()[0].program == "long.ngc")
    run = service.runs()[0]
    assert run.result == "stopped"
    folder = service.state / "runs" / run.facts["record"]
    events = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    operators = [event["request"] for event in events if event["request"] not in NOT_ASKED]
    assert operators == ["hold", "override", "resume", "stop"]
    rows = SETPOINTS.read(folder)
    assert rows is not None and len(rows) == run.facts["ticks"] and np.ptp(rows, axis=0).any()


def test_a_jog_goes_on_while_it_is_refreshed_and_ends_by_itself_when_it_is_not(service: Serving) -> None:
    before = service.status()["joints"]["X"]["machine"]

    def jogs(frame: str, axis: str, speed: float) -> bool:  # a look may come when the jog has ended already
        service.ask("jog", frame=frame, axis=axis, speed=speed)
        return bool(service.status()["mode"] == "JOG")

    for _ in range(10):
        service.until(lambda _: jogs("joint", "X", 0.1), "a jog")
    now = service.until(lambda now: now["mode"] == "READY" and now["at_rest"])
    assert now["joints"]["X"]["machine"] > before + 0.1
    service.until(lambda _: jogs("part", "Y", -0.1), "another")  # taken, or the stop would find nothing
    service.ask("jog_stop")
    now = service.until(lambda now: now["mode"] == "READY" and now["at_rest"])
    service.ask("jog_step", frame="tool", axis="Z", distance=-1.5)
    z = now["joints"]["Z"]["machine"] - 1.5
    service.until(lambda now: now["mode"] == "READY" and abs(now["joints"]["Z"]["machine"] - z) < 1e-6)
    for args in (
        {"axis": "Q", "speed": 1.0},
        {"axis": "X", "speed": 2.0},
        {"frame": "x", "axis": "X", "speed": 1},
    ):
        assert service.refused("jog", **args).code == "bad"


@pytest.mark.parametrize("verb", ["stop", "hold", "jog_stop"])
def test_a_held_key_does_not_take_back_the_stop_of_somebody_else(verb: str, service: Serving) -> None:
    """Whoever holds it asks again before the axis stands, and after."""

    def jogs(press: str) -> bool:
        service.ask("jog", frame="joint", axis="X", speed=0.1, press=press)
        return bool(service.status()["mode"] == "JOG")

    service.until(lambda _: jogs(f"{verb} 1"), "a jog")
    service.ask(verb)
    for _ in range(2):
        again = service.refused("jog", frame="joint", axis="X", speed=0.1, press=f"{verb} 1")
        assert "press it again" in again.sentence
        service.until(lambda now: now["mode"] == "READY" and now["at_rest"])
    service.until(lambda _: jogs(f"{verb} 2"), "the jog of another press")
    service.until(lambda now: now["mode"] == "READY" and now["at_rest"])


def test_a_program_that_is_refused_leaves_the_machine_as_it_was(service: Serving) -> None:
    path = service.state / "bad.ngc"
    path.write_text("G0 X1\nG999 X2\n")
    error = service.refused("load", path=str(path))
    assert error.code == "bad" and "bad.ngc:2" in error.sentence
    assert service.refused("load", path=str(path), sha256="0" * 64).code == "bad"
    assert service.refused("load", path="/nowhere").code == "bad"
    assert service.status()["mode"] == "READY"


def test_offsets_and_tools_change_at_rest_and_last(service: Serving) -> None:
    service.ask("set_offset", name="G55", values=[1.0, 2.0, 3.0])
    service.ask("set_tool", number=7, name="new", radius_mm=2.0, length_mm=40.0, flute_mm=20.0)
    facts = service.ask("facts")
    assert facts["offsets"]["G55"]["origin_mm"] == [1.0, 2.0, 3.0]
    assert [tool["radius_mm"] for tool in facts["tools"] if tool["number"] == 7] == [2.0]
    kept = set_up_store.load(service.state)
    assert kept["offsets"]["G55"] == [1.0, 2.0, 3.0] and kept["tools"]["7"]["length_mm"] == 40.0
    for verb, args in (
        ("set_offset", {"name": "G60", "values": [0, 0, 0]}),
        ("set_offset", {"name": "G54", "values": [0, "x", 0]}),
        ("set_tool", {"number": 7, "radius_mm": -1.0, "length_mm": 0.0, "flute_mm": 1.0}),
        ("set_tool", {"number": 1, "remove": True}),
    ):
        assert service.refused(verb, **args).code == "bad"
    service.ask("set_tool", number=7, remove=True)
    assert 7 not in [tool["number"] for tool in service.ask("facts")["tools"]]


def test_an_emergency_stop_is_an_alarm_with_a_recording_and_reset_leads_to_off(service: Serving) -> None:
    service.ask("estop")
    now = service.until(lambda now: now["fault"] and now["fault"]["recording"])
    assert (now["mode"], now["fault"]["name"]) == ("FAULT", "EMERGENCY_STOP")
    assert Path(now["fault"]["recording"]).is_dir() and now["fault"]["key"]
    alarm = service.ask("alarms")["alarms"][0]
    assert alarm["name"] == "EMERGENCY_STOP" and alarm["acknowledged_s"] is None
    assert service.ask("acknowledge", id=alarm["id"]) == {"acknowledged": 1}
    service.done("reset")
    now = service.status()
    assert (now["mode"], now["fault"]) == ("OFF", None)
    service.done("enable")


def test_a_killed_planner_is_followed_by_another_and_nothing_else_changes(service: Serving) -> None:
    old = service.pid("plan")
    service.kill("plan")
    service.until(lambda now: now["plan_alive"] and service.pid("plan") != old)
    assert service.status()["mode"] == "READY"
    service.load(SHORT)
    service.done("start")
    assert service.ended()["job"]["state"] == "completed"
