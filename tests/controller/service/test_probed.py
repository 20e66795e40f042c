"""What probing cycles have found: which messages tell it, and that it is there after a restart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import done

from controller.machine import machine_file
from controller.plan.planner import Touch
from controller.program.program import Probed as Came
from controller.runtime.plan_messages import Announcement, News
from controller.service import probed
from controller.service.command_handlers import CommandHandlers
from controller.service.probed import KEPT, Probed, result_of
from controller.service.service import Service
from controller.store.service_store import ServiceStore, document_of

BORE = {"cycle": "bore", "values": {"x_mm": -0.25, "diameter_mm": 20.0}}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("bore x_mm=-0.250000 diameter_mm=20.000000", BORE),
        ("mine way=1.5", {"cycle": "mine", "values": {"way": 1.5}}),
        ("bore", None),
        ("turn the part over", None),
        ("bore x_mm=######", None),  # of what has no value
        ("bore x_mm=1.0 and more", None),
        ("bore x_mm=1", None),
        ("Bore x_mm=1.0", None),
    ],
)
def test_a_message_of_a_name_and_values_is_a_result(text: str, told: dict[str, Any] | None) -> None:
    assert result_of(text) == told


def test_results_are_there_after_a_restart_and_no_more_than_are_kept(tmp_path: Path) -> None:
    kept = Probed(ServiceStore(tmp_path))
    for k in range(KEPT + 3):
        kept.add(f"{k}.ngc", [BORE])
    kept.save()
    for told in (kept.to_json(), Probed(ServiceStore(tmp_path)).to_json()):
        assert [row["program"] for row in told] == [f"{k}.ngc" for k in range(KEPT + 2, 2, -1)]
        assert told[0].items() >= BORE.items() and told[0]["at_s"] >= told[-1]["at_s"]


def test_what_a_run_finds_is_in_the_table_and_in_its_record(desk: CommandHandlers, service: Service) -> None:
    program = service.state / "part.ngc"
    program.write_text("G21 G90 G54\nG1 X10. F3000\nM30\n")
    done(desk, "load", path=str(program))
    done(desk, "start")
    job, record = service.run.job, service.run.recorder.record
    assert job is not None and record is not None
    for _ in range(2):  # and what was told before is not told again
        job.hear(
            News(messages=(Announcement("bore x_mm=-0.25 diameter_mm=20.0", 0), Announcement("go on", 0)))
        )
        service.run.lay(
            job, job.announced.say(service.processes.now()._replace(motion_id=1)), service.processes.now()
        )
        service.run.lay(job, [], service.processes.now())
    found = [{key: row[key] for key in ("program", "cycle", "values")} for row in service.probed.to_json()]
    assert found == [{"program": "part.ngc", **BORE}] * 2
    assert record.end("completed")["found"] == [BORE, BORE]


def test_the_last_touches_are_there_after_a_restart_and_of_another_machine_all_are_begun_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(probed, "KEPT_TOUCHES", 3)
    kept, machine = Probed(ServiceStore(tmp_path)), machine_file.load("trunnion")
    touch = Touch(5, Came(True, (0.0,) * 5, (0.0,) * 5), (0.0, 0.0, -1.0), 2, 5.0)
    for line in range(5):
        kept.touch([touch._replace(line=line)], machine)
    kept.save_touches()
    head, *lines = document_of(tmp_path, "touches")
    assert head.startswith("line,") and [line.split(",")[0] for line in lines] == ["2", "3", "4"]
    again = Probed(ServiceStore(tmp_path))
    again.touch([touch], machine)
    again.save_touches()
    assert document_of(tmp_path, "touches")[1:3] == lines[1:]
    three = replace(machine, axes=machine.axes[:3])
    again.touch([Touch(7, Came(True, (0.0,) * 3, (0.0,) * 3), (0.0, 0.0, -1.0), 2, 5.0)], three)
    again.save_touches()
    assert len(document_of(tmp_path, "touches")) == 2
