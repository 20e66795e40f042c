"""The line that tells what the machine does now."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from support.machines.shipped_kinds import machine

from controller.cli.demo import live_line
from controller.ipc.handoff import blank
from controller.machine.model import Spindle
from controller.runtime.plan_messages import POWER_ON, MotionFacts
from controller.service import status
from controller.state.modes import Binding, Mode, axis_binding

MACHINE = machine(spindle=Spindle(24000.0, "drive"))
CUT = MotionFacts((0.0,) * 5, 1000.0 / 60.0, "cut", end_s=50.0)


def told(way: MotionFacts | None = CUT, **changes: Any) -> str:
    """Of the status that the service makes of such a snapshot."""
    now = blank()._replace(**{"mode": Mode.RUNNING, "override": 1.0, "motion_id": 1, **changes})
    return live_line({**status.machine_values(MACHINE, now, way, POWER_ON), "job": {"line": 8}})


def test_it_tells_programmed_and_actual_feed_and_the_limit() -> None:
    said = told(feed_mm_s=14.5, limited_by=axis_binding(4, 1))
    assert said == "line 8: F 1000, actual 870 mm/min, limited by C acceleration"


def test_the_override_counts_and_the_feed_itself_is_no_limit() -> None:
    said = told(override=0.5, feed_mm_s=500.0 / 60.0, limited_by=int(Binding.FEED))
    assert said == "line 8: F 500, actual 500 mm/min"


def test_a_rapid_has_no_feed() -> None:
    assert told(replace(CUT, feed_mm_s=None), feed_mm_s=40.0) == "line 8: rapid, actual 2400 mm/min"


def test_it_tells_what_motion_waits_for() -> None:
    waiting = {"waiting": True, "spindle_rev_min": 6000.0, "spindle_actual_rev_min": 1234.5}
    assert told(**waiting) == "line 8: waiting for the spindle: S 6000, actual 1234 1/min"
    assert told(spindle_at_speed=True, **waiting) == "line 8: waiting for coolant and clamps"


def test_what_does_not_run_is_named_by_its_mode() -> None:
    assert told(mode=Mode.HOLD) == "hold"
    assert told(None) == "running"
