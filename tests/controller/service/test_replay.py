"""The record of a live run, run again on the stepped clock: the same setpoints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from serving import serving

from controller import config
from controller.handoff import COLUMN
from controller.session import checked, events
from controller.session.stepped import SteppedMachine

PART = "G21 G90 G54\nG0 X40.\nG1 X-40. Y10. F3000\nG1 X30. Y-10. A8.\nG0 X0 Y0\nM30\n"


@pytest.mark.soak
def test_the_record_of_a_run_with_hold_and_overrides_gives_the_same_setpoints(tmp_path: Path) -> None:
    with serving(tmp_path) as service:
        service.ready()
        service.load(PART)
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
        service.until(lambda _: service.ask("runs")["runs"])
        (run,) = service.ask("runs")["runs"]
    folder = tmp_path / "state" / "runs" / run["id"]
    live = np.load(folder / "setpoints.npz")["rows"]
    bench = SteppedMachine(config.load("trunnion"))
    bench.come_up()
    task = checked.task(PART.encode(), "part.ngc", bench.machine)
    kept, _ = checked.find(task, tmp_path / "state" / "checks")
    assert kept is not None
    file = folder / "events.jsonl"
    made = bench.run(checked.walk_of(task, kept, False), events.read(file), turns=events.turns(file))
    first = COLUMN["setpoint_0"]
    again = made.rows[:, first : first + 5]
    assert made.result == "completed"
    length = min(len(live), len(again))
    assert abs(len(live) - len(again)) <= 25  # looking whether it stands
    np.testing.assert_array_equal(again[:length], live[:length, 1:])
