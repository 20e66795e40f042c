"""``directrix faults``: the table of a machine."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from controller.__main__ import app
from controller.machine import arrangement, machine_file
from controller.state.fault_table import words
from controller.state.modes import FAULTS, Fault
from drives.arranged import Arranged

ASK = CliRunner()


def test_every_fault_is_listed_with_class_trust_remedy_and_promise() -> None:
    told = json.loads(ASK.invoke(app, ["faults", "trunnion", "--json"]).stdout)
    assert [row["fault"] for row in told["faults"]] == [fault.name for fault in Fault if fault]
    by_name = {row["fault"]: row for row in told["faults"]}
    assert by_name["DOOR_OPEN"]["class"] == "hold on the path"
    assert by_name["BUS_OFF"]["stands_within_s"] == pytest.approx(0.2 + 2 * 0.002 + 0.12)
    assert by_name["NODE_RESET"]["recovery"] == "commission"
    for row in told["faults"]:
        assert row["position_trusted"] is FAULTS[Fault[row["fault"]]].position_trusted


def test_the_table_shows_each_fault_once() -> None:
    shown = ASK.invoke(app, ["faults"]).stdout
    assert "Faults of trunnion" in shown
    for fault in (Fault.FOLLOWING_ERROR, Fault.CONTROLLER_GONE):
        assert shown.count(fault.name[:9]) >= 1


def test_every_line_fits_a_narrow_terminal_and_nothing_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("controller.cli.faults.show", Console(width=80, highlight=False))
    for language in ("en", "de"):
        ran = ASK.invoke(app, ["faults", "--language", language])
        assert max(map(len, ran.stdout.splitlines())) <= 80
        told = " ".join(ran.stdout.split())
        for fault in Fault:
            if fault is not Fault.NONE:
                for text in words(fault, language):
                    assert text in told


def test_promises_are_of_the_drives_as_read_once_they_were(tmp_path: Path) -> None:
    made = machine_file.load("trunnion")
    read = [Arranged(axis.name, i, stop_s=0.1, notes=()) for i, axis in enumerate(made.axes, 1)]
    read[1] = Arranged("Y", 2, stop_s=10.0, objects=(("6085h:00", 4_000_000),), notes=("Y brakes softly.",))
    arrangement.save(tmp_path / "arranged", made, read)
    told = json.loads(ASK.invoke(app, ["faults", "--state", str(tmp_path), "--json"]).stdout)
    by_name = {row["fault"]: row for row in told["faults"]}
    assert by_name["EMERGENCY_STOP"]["stands_within_s"] == pytest.approx(10.004)
    assert told["drives"]["axes"][1]["objects"] == [["6085h:00", 4_000_000]]
    shown = ASK.invoke(app, ["faults", "--state", str(tmp_path)]).stdout
    assert "Y 10000 ms" in shown and "Y brakes softly." in shown and told["drives"]["read"][:4] in shown


@pytest.mark.parametrize(
    ("language", "text"), [("en", "not been commissioned yet"), ("de", "nicht wie gelesen")]
)
def test_promises_of_the_machine_file_alone_say_so(language: str, text: str) -> None:
    shown = " ".join(ASK.invoke(app, ["faults", "--language", language]).stdout.split())
    assert text in shown
    assert json.loads(ASK.invoke(app, ["faults", "--json"]).stdout)["drives"] is None


def test_the_texts_are_told_in_german_too() -> None:
    told = json.loads(ASK.invoke(app, ["faults", "--language", "de", "--json"]).stdout)
    row = next(row for row in told["faults"] if row["fault"] == "DOOR_OPEN")
    assert row["text"] == "Die Tür ist offen." and row["cause"] and row["remedy"]
    assert row["class"] == "Halt auf der Bahn" and row["recovery"] == "resume"


def test_it_speaks_the_language_of_the_environment_as_every_verb_does() -> None:
    """One that there is not is English."""
    german, other = (
        ASK.invoke(app, ["faults", "none"], env={"DIRECTRIX_LANGUAGE": one}) for one in ("de", "fr")
    )
    assert german.exit_code == other.exit_code == 1 and german.stderr != other.stderr
    assert "Faults of trunnion" in ASK.invoke(app, ["faults", "--language", "fr"]).stdout
