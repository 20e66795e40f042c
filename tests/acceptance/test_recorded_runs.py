"""Runs that were recorded by an earlier version come again to the same setpoints, bit for bit.

What changes a setpoint, meant or not, is found here: whoever means it records them anew
(``support.live.recordings``) and says so. They are compared on the computer that runs the tests; should
its mathematics round otherwise than the one on which they were made, the first difference says where.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.live.recordings import LIVE, STEPPED
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.runtime import events

RUNS = Path(__file__).resolve().parents[1] / "data" / "runs"
NAMES = sorted(folder.name for folder in RUNS.iterdir())
MAX_BYTES, MAX_OF_ONE = 1_000_000, 100_000
CUT_OFF = ("emergency_stop", "lost_drive")  # from their stop on the axes are where the drives are


@pytest.mark.parametrize("name", NAMES)
def test_a_run_that_was_recorded_before_comes_again_bit_for_bit(name: str) -> None:
    done = CliRunner().invoke(command_line.app, ["replay", str(RUNS / name), "--json"])
    told = json.loads(done.stdout)
    asked = told["result"] in ("held_as_asked", "stopped_as_asked")
    assert done.exit_code == (4 if asked else 0), told
    whole = told["compared_ticks"] == told["recorded_ticks"]
    assert told["compared_ticks"] > 300 and (whole or name in CUT_OFF)


def test_all_that_an_operator_does_and_befalls_a_run_is_in_one_of_them() -> None:
    assert {*LIVE, *STEPPED} == set(NAMES)
    found = {name: events.recorded(RUNS / name / events.FILE) for name in NAMES}
    kinds = {line.kind for one in found.values() if one is not None for line in one.lines}
    assert kinds >= {
        *("plan", "pieces", "hold", "resume", "stop", "override", "rapid_override", "single_block"),
        *("optional_stop", "retract", "return", "jog", "jog_stop", "fault", "off_path", "plan_lost"),
        *("estop", "wait"),
    }
    assert any(one is not None and one.begin.start.spot is not None for one in found.values()), "a restart"


def test_they_stay_small() -> None:
    sizes = {name: sum(file.stat().st_size for file in (RUNS / name).iterdir()) for name in NAMES}
    assert sum(sizes.values()) < MAX_BYTES and max(sizes.values()) < MAX_OF_ONE, sizes
