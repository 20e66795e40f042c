"""The record of a live run, run again on the stepped clock: the same setpoints."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from support.live.live_machines import gone, until
from support.live.replayed_runs import again, assert_same_setpoints, facts, records
from support.live.served_machine import Serving, calm, calm_machine, serving

from controller.runtime import events
from controller.runtime.events import EventError

MACHINE = calm_machine()
LONG = "G21 G90 G54 G43.4\nG0 X0 Y0 Z60. A0 C0\n" + "G1 X60. F3000\nG1 X-60. A4.\n" * 20 + "M30\n"
PART = "G21 G90 G54\nG0 X40.\nG1 X-40. Y10. F3000\nG1 X30. Y-10. A8.\nG0 X0 Y0\nM30\n"


def disturbed(service: Serving) -> None:
    """A run with overrides and a hold."""
    service.done("start")
    service.until(lambda now: now["mode"] == "RUNNING" and now["feed_mm_min"]["actual"] > 2000.0)
    for share in (0.4, 1.6):
        service.ask("override", share=share)
        tick = service.status()["tick"]["number"]
        service.until(lambda now, tick=tick: now["tick"]["number"] > tick + 200)  # type: ignore[misc]
    service.ask("hold")
    service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
    service.ask("override", share=1.0)
    service.ask("resume")
    assert service.ended()["job"]["state"] == "completed"


@pytest.mark.slow
@pytest.mark.live
def test_the_record_of_a_run_with_hold_and_overrides_gives_the_same_setpoints(tmp_path: Path) -> None:
    """Of one from the homed position, of one from elsewhere with other offsets, and of a rest."""
    with serving(tmp_path, *calm(tmp_path)) as service:
        service.ready()
        service.load(PART)
        disturbed(service)
        service.done("mdi", text="G0 X-7.3 Y11 A3.")
        service.ended()
        service.ask("set_offset", name="G54", values=[1.0, 90.0, 110.0])
        service.load(PART)
        disturbed(service)
        service.done("load", path=str(service.state / "part.ngc"), name="part.ngc", line=3, fraction=0.4)
        service.done("start")
        assert service.ended()["job"]["state"] == "completed"
        service.until(lambda _: len(records(service.state)) == 4)
    runs = [folder for folder in records(service.state) if facts(folder)["name"] == "part.ngc"]
    assert len(runs) == 3
    for folder in runs:
        done = again(folder, PART, MACHINE)
        assert done.run.result == "completed"
        assert_same_setpoints(done)


@pytest.mark.slow
@pytest.mark.live
def test_the_records_of_runs_with_a_way_aside_and_of_a_killed_plan_and_service(tmp_path: Path) -> None:
    """Whatever was set before, led aside or killed: what is whole of the record comes again."""
    with serving(tmp_path, *calm(tmp_path)) as service:
        service.ready()
        service.ask("rapid_override", share=0.5)
        service.ask("override", share=0.37)
        service.load(LONG)
        service.done("start")
        service.until(lambda now: now["mode"] == "RUNNING" and now["feed_mm_min"]["actual"] > 1000.0)
        service.ask("hold")
        service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
        service.done("retract", mm=8.0)
        off = service.status()["joints"]["X"]["machine"]
        service.ask("jog_step", frame="joint", axis="X", distance=5.0)
        service.until(lambda now: abs(now["joints"]["X"]["machine"] - off - 5.0) < 1e-6)
        service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
        service.done("return")
        service.ask("resume")
        service.until(lambda now: now["mode"] == "RUNNING" and now["feed_mm_min"]["actual"] > 1000.0)
        service.kill("plan")
        assert service.until(lambda now: now["mode"] == "FAULT" and now["at_rest"])["not_homed"] == []
        service.until(lambda now: now["plan_alive"] and len(records(service.state)) == 1)
        service.done("reset")
        service.done("enable")
        service.load(LONG)
        service.done("start")
        service.until(lambda now: now["mode"] == "RUNNING" and now["job"]["elapsed_s"] > 2.0)
        pids = [service.pid("tick"), service.pid("plan")]
        service.process.send_signal(signal.SIGKILL)
        service.process.wait()
        until(lambda: gone(pids))
    aside, killed = sorted((tmp_path / "state" / "runs").iterdir())
    assert not (killed / "run.json").exists()
    for folder, ended in ((aside, "fault"), (killed, "lost")):
        done = again(folder, LONG, MACHINE)
        assert done.run.result == ended and len(done.live) > 100
        assert_same_setpoints(done, ended_itself=False)


def test_a_record_with_a_way_aside_says_that_it_cannot_be_run_again(tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    file.write_text('{"tick": 7, "request": "aside"}\n')
    with pytest.raises(EventError, match="led off the path by hand"):
        events.read(file)


@pytest.mark.parametrize("value", ["null", "{}", '{"joints": [0, 1]}', "[1]", '"x"'])
def test_a_beginning_that_is_none_is_refused_in_a_sentence(tmp_path: Path, value: str) -> None:
    file = tmp_path / "events.jsonl"
    file.write_text(f'{{"tick": -1, "request": "begin", "value": {value}}}\n')
    with pytest.raises(EventError, match=r"events.jsonl:1: this is no beginning .*\.$"):
        events.recorded(file)
