"""A plan that stands for a while in mid-cut: the cut goes on, and the operator is told in time."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from support.live.live_machines import until
from support.live.replayed_runs import again, assert_same_setpoints, records
from support.live.served_machine import Serving, calm, calm_machine, serving

from controller import messages

BEGIN, TO_AND_FRO = "G21 G90 G54 G43.4\nG0 X0 Y0 Z60. A0 C0\n", "G1 X60. F3000\nG1 X-60. A4.\n"
SHORT, LONG = (f"{BEGIN}{TO_AND_FRO * times}M30\n" for times in (4, 8))
NAME = "PLAN_SILENT"


def cutting(service: Serving, text: str) -> None:
    service.load(text)
    service.done("start")
    service.until(lambda now: now["mode"] == "RUNNING" and now["job"]["elapsed_s"] > 3.0)


def notices(now: dict[str, Any]) -> list[dict[str, Any]]:
    return [notice for notice in now["notices"] if notice["name"] == NAME]


@pytest.mark.slow
@pytest.mark.live
def test_a_plan_that_stands_for_a_second_costs_the_cut_nothing(tmp_path: Path) -> None:
    with serving(tmp_path, *calm(tmp_path)) as service:
        service.ready()
        cutting(service, SHORT)
        plan, seen = service.pid("plan"), []
        os.kill(plan, signal.SIGSTOP)
        end_s = time.monotonic() + 1.0
        while time.monotonic() < end_s:
            seen.append(service.status())
            time.sleep(0.02)
        os.kill(plan, signal.SIGCONT)
        assert {now["mode"] for now in seen} == {"RUNNING"} and not any(map(notices, seen))
        assert seen[-1]["job"]["elapsed_s"] > seen[0]["job"]["elapsed_s"] + 0.5, "the cut went on"
        assert service.ended()["job"]["state"] == "completed"
        assert service.ask("alarms")["alarms"] == []
        until(lambda: records(service.state))
        (record,) = records(service.state)
    done = again(record, SHORT, calm_machine())
    assert done.run.result == "completed"
    assert_same_setpoints(done)


@pytest.mark.slow
@pytest.mark.live
def test_a_plan_that_does_not_come_back_is_told_before_the_queue_ends_and_then_named(tmp_path: Path) -> None:
    with serving(tmp_path, *calm(tmp_path)) as service:
        service.ready()
        cutting(service, LONG)
        assert not notices(service.status())
        plan = service.pid("plan")
        os.kill(plan, signal.SIGSTOP)
        try:
            now = service.until(notices)
            assert (
                now["mode"] == "RUNNING"
                and not now["at_rest"]
                and " s unless" in messages.text(notices(now)[0])
            )
            now = service.until(lambda now: now["mode"] == "FAULT" and now["at_rest"])
            assert now["fault"]["name"] == "PLANNER_GONE" and now["not_homed"] == []
        finally:
            os.kill(plan, signal.SIGCONT)
