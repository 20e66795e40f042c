"""What was set at a machine: shown with where it comes from, and read by programs on the desk."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

from controller.__main__ import app
from controller.cli import offsets
from controller.machine import machine_file, setup_data
from controller.machine.changes import turned_deg
from controller.machine.model import OFFSETS
from controller.store import service_store
from controller.store.set_up_store import FITTING

FITTED: dict[str, Any] = {
    "offsets": {"G55": {"origin_mm": [1.0, 2.0, 3.0], "turned_deg": [0, 0, 30], "rotary_deg": {"C": 15.0}}},
    "shift": {"G92": {"origin_mm": [0.5, 0, 0], "suspended": True}},
    "references": {"G30": {"X": 0.0, "Y": 0.0, "Z": 200.0, "A": 0.0, "C": 90.0}},
    "parameters": {"500": 7.0},
}


def told() -> dict[str, Any]:
    """As the panel answers."""
    text = machine_file.load("trunnion").text.replace(
        "[machine]\n", "[machine]\nkept_parameters = [500]\n", 1
    )
    made = setup_data.applied(machine_file.read(text, "m.toml"), FITTED)
    found = setup_data.to_json(made, FITTED)
    for name, row in found["offsets"].items():
        row["turned_deg"] = list(turned_deg(made.offset(OFFSETS.index(name)).frame))
    return found


def test_each_is_shown_with_where_it_comes_from() -> None:
    console = Console(width=160, record=True)
    console.print(offsets.table(told()))
    rows = [line.split("│") for line in console.export_text().splitlines() if "│" in line]
    shown = {row[1].strip(): [cell.strip() for cell in row[2:-1]] for row in rows}
    assert shown["G54"][3] == "machine file" and shown["G28"][3] == "machine file"
    assert shown["G55"] == ["1.000 2.000 3.000", "C15.000", "0.000 0.000 30.000", "set here"]
    assert shown["G92 (G92.2)"] == ["0.500 0.000 0.000", "", "", "set here"]
    assert shown["G30"][:2] == ["0.000 0.000 200.000", "C90.000"]
    assert shown["#500"][0] == "7"
    assert "G56" not in shown  # nobody has set it


@pytest.mark.parametrize("folder", [True, False])
def test_programs_on_the_desk_are_read_with_what_was_set_where_that_is_asked_for(
    tmp_path: Path, folder: bool
) -> None:
    program = tmp_path / "p.ngc"
    program.write_text("G21 G90 G55\nG0 X10 C0\nM30\n")
    where = tmp_path if folder else tmp_path / "fitting.json"
    if folder:
        service_store.put(tmp_path, FITTING, FITTED)
    else:
        where.write_text(json.dumps(FITTED))
    refused = CliRunner().invoke(app, ["explain", str(program), "--json"])
    assert refused.exit_code == 1 and "G55 is not set" in refused.output
    said = CliRunner().invoke(app, ["explain", str(program), "--fitted", str(where), "--json"])
    steps = [json.loads(line) for line in said.output.splitlines()]
    rapid = next(step for step in steps if step["kind"] == "rapid")
    assert rapid["axes"]["C"] == pytest.approx(15.0) and rapid["program"]["X"] == pytest.approx(10.0)


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    program = tmp_path / "p.ngc"
    program.write_text("G0 X1\n")
    (tmp_path / "bad.json").write_text("[1]")
    for name, why in (("bad.json", "is no JSON object"), ("none.json", "cannot be read")):
        said = CliRunner().invoke(app, ["explain", str(program), "--fitted", str(tmp_path / name)])
        assert said.exit_code == 1 and why in " ".join(said.output.split())
