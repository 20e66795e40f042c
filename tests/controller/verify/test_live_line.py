"""The line that tells what the machine does now."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from support.machines.shipped_kinds import machine

from controller.handoff import Snapshot
from controller.state import Binding, Fault, Mode, axis_binding
from controller.verify.live_line import LiveLine


def snapshot(**changes: Any) -> Snapshot:
    still = dict.fromkeys(Snapshot._fields, 0)
    plain = {"mode": Mode.RUNNING, "fault": Fault.NONE, "override": 1.0, "rapid_override": 1.0, "line": 8}
    return Snapshot(**(still | plain | changes))


def line() -> LiveLine:
    return LiveLine(
        machine(), {0: SimpleNamespace(feed_mm_s=None), 1: SimpleNamespace(feed_mm_s=1000.0 / 60.0)}
    )


def test_it_tells_programmed_and_actual_feed_and_the_limit() -> None:
    told = line()
    told.of(snapshot(tick=100, motion_id=1, s=10.0))
    now = snapshot(tick=150, motion_id=1, s=11.45, limited_by=axis_binding(4, 1))
    assert told.of(now) == "line 8: F 1000, actual 870 mm/min, limited by C acceleration"


def test_the_override_counts_and_the_feed_itself_is_no_limit() -> None:
    told = line()
    told.of(snapshot(tick=100, motion_id=1, override=0.5))
    now = snapshot(tick=200, motion_id=1, s=100.0 / 60.0, override=0.5, limited_by=int(Binding.FEED))
    assert told.of(now) == "line 8: F 500, actual 500 mm/min"


def test_a_rapid_has_no_feed_and_a_new_motion_no_speed_yet() -> None:
    told = line()
    told.of(snapshot(tick=100, motion_id=1, s=40.0))
    assert told.of(snapshot(tick=150, motion_id=0, s=1.0)) == "line 8: rapid, actual - mm/min"


def test_it_tells_what_motion_waits_for() -> None:
    waiting = {"waiting": True, "spindle_rev_min": 6000.0, "spindle_actual_rev_min": 1234.5}
    said = line().of(snapshot(motion_id=1, **waiting))
    assert said == "line 8: waiting for the spindle: S 6000, actual 1234 1/min"
    said = line().of(snapshot(motion_id=1, spindle_at_speed=True, **waiting))
    assert said == "line 8: waiting for coolant and clamps"


def test_what_does_not_run_is_named_by_its_mode() -> None:
    assert line().of(snapshot(mode=Mode.HOLD, motion_id=1)) == "hold"
    assert line().of(snapshot(motion_id=-1)) == "running"
