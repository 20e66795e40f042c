"""``directrix simulate`` on machines that home by switches: each method leads to a run from where it ends."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.machine import machine_file
from drives.bench.simulated.homing import KNOWN

# Five at a time, one for each axis of a machine, in an order that mixes limits, cams and index pulses.
METHODS = sorted(KNOWN, key=lambda method: (method * 7 % 11, method))
AT = {"X": 250.0, "Y": -250.0, "Z": 300.0, "A": 0.0, "C": 90.0}  # positions at the homed point


def homed_by(methods: tuple[int, ...], name: str, folder: Path) -> Path:
    """A shipped machine with these methods for its axes, one after the other."""
    first, *axes = (machine_file.SHIPPED / f"{name}.toml").read_text().split("[[axis]]\n")
    made = []
    for i, axis in enumerate(axes):
        method = methods[i % len(methods)]
        letter = axis.split('"')[1]
        line = next(row for row in axis.splitlines() if row.startswith("homing"))
        unit = "mm" if letter in "XYZ" else "deg"
        made.append(
            axis.replace(line, f"homing = {{ method = {method}, group = 1, position_{unit} = {AT[letter]} }}")
        )
    file = folder / "machine.toml"
    file.write_text("[[axis]]\n".join([first, *made]))
    return file


@pytest.mark.parametrize("methods", [tuple(METHODS[i : i + 5]) for i in range(0, len(METHODS), 5)], ids=str)
def test_a_machine_that_homes_by_any_method_runs_from_where_it_ends(
    methods: tuple[int, ...], tmp_path: Path
) -> None:
    program = tmp_path / "part.ngc"
    program.write_text("G53 G0 X10 Y10\nM30\n")
    file = homed_by(methods, "machining_centre", tmp_path)
    done = CliRunner().invoke(
        command_line.app, ["simulate", str(program), "--machine", str(file), "--period-ms", "10", "--json"]
    )
    told = json.loads(done.stdout)
    assert (done.exit_code, told["ok"], told["result"]) == (0, True, "completed"), told
    assert told["duration_s"] > 0.5, "240 mm at 200 mm/s, from the position that homing gives the axis"
