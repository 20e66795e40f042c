"""What a bus does that nobody has asked for, script by script: named as what it is, and nothing else is."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.machine import machine_file

PART = "G21 G90 G54 G64\nG0 X0 Y0\nG1 X40. Y60. F3000.\nG1 X-20. Y10.\nM30\n"
QUIET = "0000000000000000"  # an emergency message that takes one back


class Wire(NamedTuple):
    """``script`` is done; ``fault`` ends the run ("": it completes), ``warned`` is the only other word."""

    name: str
    script: str
    fault: str = ""
    warned: tuple[str, str | None] = ("", None)  # and its axis
    says: str = ""  # the sentence of the fault begins so
    without_lag: bool = False


WIRES = (
    Wire(
        "SYNC twice",
        "at 0.4 s: duplicate sync for 300 ms",
        "SYNC_DOUBLED",
        says="Axis X: The drives answer each SYNC",
    ),
    Wire(
        "every second SYNC close to the next",
        "\n".join(f"at sync {200 + 3 * n}: delay sync by 1900 us" for n in range(40)),  # each counts twice
        "SYNC_DOUBLED",
        says="Axis X: The drives answer each SYNC",
    ),
    Wire("a few SYNCs twice", "at 0.4 s: duplicate sync x 5"),
    Wire(
        "setpoints taken as they come",
        "at 0.2 s: write Y 1400:02 to 255",
        warned=("SETPOINTS_EARLY", "Y"),
        without_lag=True,
    ),
    Wire(
        "emergencies without end",
        f"at 0.4 s: foreign emcy Y data {QUIET} for 300 ms",
        warned=("NODE_CHATTERS", None),
    ),
    Wire(
        "a node that lets nobody speak",
        "at 0.4 s: babble emcy C for 40 ms",
        "BUS_FLOODED",
        says=r"Node 5, emergencies \(085h\), 7\d\d\d a second: One sender",
    ),
    Wire(
        "a sender that lets nobody speak",
        "at 0.4 s: babble 001 for 40 ms",
        "BUS_FLOODED",
        says=r"Frames 001h, of no node, 7\d\d\d a second: One sender",
    ),
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.ngc").write_text(PART)
    return tmp_path


def simulated(folder: Path, wire: Wire) -> tuple[int, dict[str, Any]]:
    """Exit code and facts of a run of the part under the script."""
    (folder / "faults.txt").write_text(wire.script)
    words = ["simulate", "part.ngc", "--faults", "faults.txt", "--json"]
    if wire.without_lag:  # the velocity goes beside the target
        text = (machine_file.SHIPPED / "trunnion.toml").read_text()
        made = re.sub(r"(?m)^(node = \d+)", r"\1\nfeed_forward = true", text)
        made = made.replace('file = "tools', f'file = "{machine_file.SHIPPED}/tools')
        (folder / "machine.toml").write_text(made)
        words += ["--machine", "machine.toml"]
    result = CliRunner().invoke(command_line.app, words)
    return result.exit_code, json.loads(result.stdout)


@pytest.mark.parametrize("wire", WIRES, ids=lambda wire: wire.name)
def test_what_the_wire_does_is_named_as_that(folder: Path, wire: Wire) -> None:
    code, told = simulated(folder, wire)
    assert code == (4 if wire.fault else 0), told
    raised = [(one["fault"], one["axis"]) for one in told["faults"]["raised"]]
    expected = [(wire.fault, None)] if wire.fault else [wire.warned] if wire.warned[0] else []
    assert [(fault, None if fault == wire.fault else axis) for fault, axis in raised] == expected
    if wire.says:
        assert re.match(wire.says, told["error"]), told["error"]
