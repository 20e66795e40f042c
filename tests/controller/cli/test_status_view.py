"""What ``directrix status`` shows, from statuses as the REST interface tells them."""

from __future__ import annotations

from io import StringIO
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from controller.cli import status_view

JOINT = {"machine": 12.3456, "work": 4.0, "to_go": 0.5, "actual": 12.3449, "error": 0.0007, "homed": True}
RUNNING: dict[str, Any] = {
    "mode": "RUNNING",
    "joints": {name: {**JOINT, "limit": False} for name in "XYZAC"},
    "feed_mm_min": {"programmed": 1000.0, "actual": 593.2},
    "limited_by": "Y velocity",
    "override": 0.8,
    "rapid_override": 1.0,
    "job": {
        "name": "example2_ready.ngc",
        "line": 10,
        "block": 2,
        "blocks": 7,
        "fraction": 0.4,
        "elapsed_s": 61.0,
        "left_s": 30.5,
        "duration_s": 122.0,
        "state": "running",
    },
    "fault": None,
    "warning": None,
    "control": "page",
}


def shown(status: dict[str, Any], alarms: list[dict[str, Any]] | None = None, width: int = 80) -> str:
    console = Console(width=width, file=StringIO(), highlight=False)
    console.print(status_view.view(status, alarms or []))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_mode_positions_feed_limit_progress_and_time_left_are_shown() -> None:
    told = shown(RUNNING)
    for wanted in ("RUNNING", "12.346", "0.001", "F 1000, actual 593 mm/min, limited by Y velocity"):
        assert wanted in told
    assert "override 80 %, rapid 100 %" in told
    assert "example2_ready.ngc: line 10, running" in told
    assert "40 %" in told and "1:01 done, 0:31 left" in told and "control: page" in told


def test_the_next_step_the_tip_and_the_codes_are_those_of_the_page() -> None:
    state = {
        "next": {"sentence": "Home all axes."},
        "tip": {"X": 1.0, "Y": -2.5, "Z": 30.0},
        "codes": ["G1", "G55", "T2"],
    }
    told = shown({**RUNNING, **state})
    for wanted in ("Home all axes.", "tip in the part:  X 1.000  Y -2.500  Z 30.000", "G1 G55 T2"):
        assert wanted in told


def test_load_and_share_of_adaptive_feed_are_shown_where_it_counts() -> None:
    led = {"spindle": {"rev_min": 8000.0, "load": 61.6}, "adaptive": {"on": True, "share": 0.71}}
    assert "load 62 %, adaptive feed 71 %" in shown({**RUNNING, **led, "adaptive_feed": True}, width=160)
    assert "adaptive feed" in shown({**RUNNING, "adaptive_feed": True})
    led["adaptive"] = {"on": False, "share": 0.71}
    assert "adaptive feed" not in shown({**RUNNING, **led})


def test_it_fits_a_terminal_of_eighty_columns() -> None:
    assert max(len(line) for line in shown(RUNNING).splitlines()) <= 80


def test_a_fault_is_told_with_its_sentence_and_alarms_stay_until_acknowledged() -> None:
    fault = {"name": "DOOR_OPEN", "sentence": "The door is open. Close the door and resume."}
    told = shown({**RUNNING, "fault": fault}, [{"id": 3, "sentence": "The coolant does not flow."}])
    assert "The door is open. Close the door and resume." in told
    assert "alarm 3: The coolant does not flow." in told


def test_what_is_not_homed_or_at_its_limit_is_marked() -> None:
    joints = {"X": {**JOINT, "homed": False}, "Y": {**JOINT, "limit": True}}
    told = shown({"mode": "OFF", "not_homed": True, "joints": joints})
    assert told.count("not homed") == 2 and "at its limit" in told and "no program loaded" in told


def test_what_is_under_way_and_what_failed_is_told() -> None:
    assert "home is under way" in shown({"mode": "HOMING", "sequence": {"name": "home", "state": "running"}})
    failed = {"name": "enable", "state": "failed", "sentence": "The door is open."}
    assert "enable: The door is open." in shown({"mode": "OFF", "sequence": failed})
    assert "enable" not in shown({"mode": "OFF", "sequence": {**failed, "state": "done"}})


def test_a_tick_that_is_gone_or_stands_is_told() -> None:
    gone = {"name": "CONTROLLER_GONE", "sentence": "The tick's process is gone."}
    told = shown({**RUNNING, "mode": "FAULT", "tick_alive": False, "fault": gone})
    assert " FAULT " in told and "no tick" in told and "The tick's process is gone." in told
    stands = {"name": "TICK_STANDS", "sentence": "It has stood still for 1.2 s."}
    told = shown({**RUNNING, "mode": "FAULT", "tick_alive": True, "fault": stands})
    assert " FAULT " in told and "stood still for 1.2 s" in told
    assert "no tick" not in shown({**RUNNING, "tick_alive": True})


def test_inputs_outputs_and_what_drives_reported_are_shown() -> None:
    drives = [{"axis": "C", "error": {"sentence": "8611h: following error"}}, {"axis": "X", "error": None}]
    drives.append({"axis": "Z", "error": None, "malformed": 3, "missed_setpoints": 2, "overdue_setpoints": 0})
    told = shown({**RUNNING, "inputs": {"estop": True, "door": False}, "outputs": {}, "drives": drives})
    assert "inputs:  estop 1  door 0" in told and "outputs" not in told
    assert "drive of C: 8611h: following error" in told and "drive of X" not in told
    assert "drive of Z: 3 frames of a wrong length" in told
    assert "drive of Z: 2 setpoints missed" in told and "too long" not in told


def test_what_is_not_known_of_inputs_outputs_and_levels_is_a_dash() -> None:
    """As before the first tick, and after the last one of a tick that is gone."""
    told = shown({**RUNNING, "inputs": {"estop": None, "door": True}, "outputs": {"lamp": None}})
    assert "inputs:  estop -  door 1" in told and "outputs:  lamp -" in told
    told = shown({**RUNNING, "analogue_outputs": {"air_bar": None, "valve": 2.5}})
    assert "air_bar -  valve 2.5" in told


def test_a_line_for_scripts_says_mode_place_and_time_left() -> None:
    assert status_view.line(RUNNING) == "RUNNING line 10 40 % left 0:31"
    assert status_view.line({"mode": "FAULT", "fault": {"name": "EMCY"}}) == "FAULT EMCY"


@pytest.mark.parametrize(
    ("seconds", "told"), [(0, "0:00"), (0.2, "0:01"), (59.5, "1:00"), (3600, "1:00:00"), (None, "-")]
)
def test_a_time_left_is_rounded_up(seconds: float | None, told: str) -> None:
    assert status_view.clock(seconds) == told


ANYTHING = st.none() | st.booleans() | st.floats(-1e6, 1e6) | st.text(max_size=5)
JOB = st.dictionaries(st.sampled_from(sorted(RUNNING["job"])), st.none() | st.floats(0, 1e5))


@given(st.dictionaries(st.sampled_from(sorted(JOINT)), ANYTHING), st.none() | JOB, ANYTHING)
def test_the_view_never_fails_whatever_is_missing(joint: dict[str, Any], job: Any, word: Any) -> None:
    shown({"mode": "READY", "joints": {"X": joint}, "job": job, "warning": word, "limited_by": word})
