"""Everything that gouges, from the files on: refused with place and depth before anything moves, or told.

Each case is a machine file, a tool table and a program, as ``directrix check`` reads them and
as the service's own check does for a program that was uploaded.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller.__main__ import app
from controller.cli import check_worker
from controller.machine import machine_file, setup_data
from controller.messages import text

SHIPPED = machine_file.SHIPPED
VERBATIM = machine_file.shipped_program("example2").read_text()
HEAD = "G21 G90 G54 G61\nT1 M6\nS9000 M3\n"
TABLE = "\n[table]\ncentre_mm = [0.0, 96.0, 120.0]\nradius_mm = 150.0\nthickness_mm = 30.0\n"


def ruled(upper: list[tuple[float, float, float]], lower: list[tuple[float, float, float]]) -> str:
    rows = [f"X{x:.4f} Y{y:.4f} Z{z:.4f}" for x, y, z in (*upper, *lower)]
    return "\n".join([f"G52 {rows[0]} F1000.", *rows[1:], ""])


def wall(points: list[tuple[float, float]], height: float = 10.0) -> str:
    return ruled([(x, y, height) for x, y in points], [(x, y, 0.0) for x, y in points])


def leaning() -> str:
    """A wall close to the table's face that leans by 66 degrees: the tool lies almost flat."""
    along = (0.0, 10.0, 20.0, 30.0)
    return ruled([(x, 9.0, 6.0) for x in along], [(x, 0.0, 2.0) for x in along])


@dataclass(frozen=True)
class Case:
    name: str
    program: str
    line: int  # at which it is refused
    sentence: str  # that tells it, as a pattern
    depth_mm: tuple[float, float]
    tool: str = "radius_mm = 3.0"
    table: str = ""


CASES = (
    Case(
        "a concave surface and a cutter that does not fit into it",
        HEAD + "G42\n" + wall([(0.0, 0.0), (10.0, 14.0), (10.0, 14.0), (20.0, 0.0)]),
        6, r"does not fit into the hollow of radius", (0.03, 0.04),
    ),
    Case(
        "a holder that hits the table",
        HEAD + "G42\n" + leaning(), 6, r"the holder of T1 is .* deep in the machine's table", (0.1, 40.0),
        "radius_mm = 0.5\nholder = [{ from_mm = 15.0, length_mm = 25.0, radius_mm = 25.0 }]", TABLE,
    ),
    Case(
        "a rear gouge: the cutter's far side is in the other leg of a hairpin 5 mm wide",
        HEAD + "G41\n" + wall([(0.0, 0.0), (40.0, -14.0), (40.0, 19.0), (0.0, 5.0)]),
        6, r"comes back to its own surface", (0.5, 3.1),
    ),
    Case(
        "the corner of 45 degrees of Example 2 as printed, on Eq. 5's side",
        VERBATIM, 2, r"of line (2|10) cuts .* too deep", (0.1, 3.1),
    ),
    Case(
        "the concave upper edge of Example 2's second surface, on the left",
        "g41\n" + VERBATIM,
        11, r"does not fit into the hollow of radius 1\.6\d+ mm .*v = 0\.000", (0.38, 0.4),
    ),
    Case(
        "a holder beside a wall that is higher than the cutter is long",
        HEAD + "G42\n" + wall([(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0)]),
        6, r"the holder of T1 is 4\.000 mm deep", (4.0, 4.0),
        "radius_mm = 3.0\nholder = [{ from_mm = 6.0, length_mm = 30.0, radius_mm = 8.0 }]",
    ),
)  # fmt: skip


def files(folder: Path, case: Case) -> tuple[Path, Path]:
    """Machine file and program."""
    tool = f'[[tool]]\nnumber = 1\nname = "T1"\nlength_mm = 0.0\nflute_mm = 15.0\n{case.tool}\n'
    (folder / "tools.toml").write_text(tool)
    machine = (SHIPPED / "trunnion.toml").read_text() + case.table
    (folder / "machine.toml").write_text(machine)
    # A comment first: no line of a program is where its author counts from.
    (folder / "part.ngc").write_text("(a part)\n" + case.program + "M30\n%\n")
    return folder / "machine.toml", folder / "part.ngc"


def check(folder: Path, case: Case, *words: str) -> tuple[int, dict]:
    machine, program = files(folder, case)
    common = ["--machine", str(machine), "--store", str(folder / "checks"), "--json"]
    result = CliRunner().invoke(app, ["check", str(program), *common, *words])
    return result.exit_code, json.loads(result.stdout)


def depths(sentence: str) -> list[float]:
    return [float(number) for number in re.findall(r"(\d+\.\d+) mm (?:too deep|deep)", sentence)]


def matches(case: Case, sentence: str) -> bool:
    low, high = case.depth_mm
    return bool(re.search(case.sentence, sentence)) and any(
        low - 5e-4 <= depth <= high + 5e-4 for depth in depths(sentence)
    )


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_it_is_refused_with_place_and_depth_and_nothing_is_stored(case: Case, tmp_path: Path) -> None:
    code, told = check(tmp_path, case)
    assert code == 1 and not told["ok"]
    assert matches(case, told["error"]), told["error"]
    assert f":{case.line}:" in told["error"] and re.search(r"X -?\d+\.\d{3} Y", told["error"])
    assert not list(tmp_path.glob("checks/*.json"))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_the_services_own_check_refuses_it_too(case: Case, tmp_path: Path) -> None:
    machine, program = files(tmp_path, case)
    setup_data.note(tmp_path, machine_file.load(machine))
    job = {"name": "part.ngc", "program": str(program), "lines": 30, "state": str(tmp_path)}
    state, result = check_worker.check(job, lambda _: None)
    assert state == "refused" and result["line"] == case.line and matches(case, text(result))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_it_is_cut_and_reported_where_gouges_are_only_warned_of(case: Case, tmp_path: Path) -> None:
    code, told = check(tmp_path, case, "--gouge", "warn")
    assert code == 0 and told["ok"] and told["stored"]
    notes = [note["note"] for note in told["notes"] if note["note"].startswith("Gouge: ")]
    assert any(matches(case, note) for note in notes), notes
