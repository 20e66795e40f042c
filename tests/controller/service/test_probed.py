"""What probing cycles have found: which messages tell it, and that it is there after a restart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import done

from controller.runtime.plan_messages import Announcement, News
from controller.service.command_handlers import CommandHandlers
from controller.service.probed import FILE, KEPT, Probed, found
from controller.service.service import Service
from controller.state import record_files

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
    assert found(text) == told


def test_results_are_there_after_a_restart_and_no_more_than_are_kept(tmp_path: Path) -> None:
    kept = Probed(tmp_path)
    for k in range(KEPT + 3):
        kept.add(f"{k}.ngc", [BORE])
    kept.save()
    for told in (kept.to_json(), Probed(tmp_path).to_json()):
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


@pytest.mark.parametrize("text", ["", "{}", "[1, null]", "no JSON"])
def test_what_is_not_sound_is_begun_anew(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    kept = Probed(tmp_path)
    kept.add("a.ngc", [BORE])
    assert [row["program"] for row in kept.to_json()] == ["a.ngc"]


def test_touches_of_a_version_before_are_taken_over_and_damaged_ones_are_an_alarm(tmp_path: Path) -> None:
    (tmp_path / record_files.OLDER_TOUCHES).write_text("line,X\n5,1.0\n")
    probed = Probed(tmp_path)
    assert record_files.touches(tmp_path) == ["line,X", "5,1.0"] and probed.touches_damaged is None
    probed.save_touches()
    assert not (tmp_path / record_files.OLDER_TOUCHES).exists()
    probed._touches.append("6,2.0")
    probed.save_touches()
    file = tmp_path / record_files.TOUCHES
    file.write_text(file.read_text().replace("6,2.0", "6,3.0"))
    probed = Probed(tmp_path)
    assert probed.touches_damaged is not None and probed._touches == ["5,1.0"]
