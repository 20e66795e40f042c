"""The net holds: small changes of the code, each planted in a copy of it, are found by its part."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
NET = ROOT / "tests" / "data" / "net"
HANGS_S = 300.0

pytestmark = pytest.mark.slow


class Planted(NamedTuple):
    """In ``file`` the first ``old`` becomes ``new``; ``where``: a run, or an entry, that must be another."""

    file: str
    old: str
    new: str
    where: str


COLUMNS = (
    '    line: int = _value("follow", "line of the program, 0 = none", column="line", signal="line")\n',
    '    cutting: bool = _value("status", "the motion cuts", column="cutting", signal="cutting")\n',
)
CHANGES = {
    "a share of the feed law": ("plan/junctions.py", "MARGIN = 0.998", "MARGIN = 0.997", "044"),
    "the rounding of joints": ("plan/surfaces/blending.py", "(0.0594,", "(0.06,", "010"),
    "the radius of leads": (
        "plan/surfaces/leads.py",
        "else machine.lead_mm",
        "else 0.99 * machine.lead_mm",
        "044",
    ),
    "the rounding to counts": ("tick/joints.py", '"round(a[', '"int(a[', "177"),
    "the rounding of an override": (
        "tick/mode.py",
        "self.override = value",
        "self.override = round(value, 2)",
        "093",
    ),
    "a key of the texts": (
        "messages/en.json",
        '"code.two_of_a_group":',
        '"code.two_of_group":',
        "declared/texts",
    ),
    "an argument of a verb": (
        "service/command_handlers.py",
        'number(args, "mm", 0.0',
        'number(args, "way_mm", 0.0',
        "declared/verbs",
    ),
    "a key of the machine file": (
        "machine/machine_file.py",
        '"link_mm"',
        '"links_mm"',
        "declared/keys",
    ),
    "an option of a command": ("cli/programs.py", '"--block-delete"', '"--skip"', "declared/help"),
    "the order of columns": (
        "state/live_state.py",
        "".join(COLUMNS),
        "".join(reversed(COLUMNS)),
        "declared/columns",
    ),
    "the column of a refusal": (
        "program/line.py",
        "ProgramError(self.name, self.number, word.column, why",
        "ProgramError(self.name, self.number, word.column + 1, why",
        "refused/programs",
    ),
    "the line of a machine file's refusal": (
        "machine/toml_table.py",
        "{self.file}:{line}",
        "{self.file}:{line + 1}",
        "refused/machine_files",
    ),
    "the name of the journal": (
        "service/older_files.py",
        '"journal.json": Document',
        '"interrupted.json": Document',
        "state/opened",
    ),
    "a number of an answer": (
        "plan/feed/binding.py",
        "AT_FEED = 0.995",
        "AT_FEED = 0.9999",
        "answers/check-example1_ready",
    ),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_planted_change_is_found(what: str, tmp_path: Path) -> None:
    planted = Planted(*CHANGES[what])
    for folder in ("drives", "config", "tests", "systemd"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    shutil.copytree(ROOT / "controller", tmp_path / "controller", ignore=shutil.ignore_patterns("*.pyc"))
    file = tmp_path / "controller" / planted.file
    text = file.read_text()
    assert planted.old in text, f"plant another change in {planted.file}: {planted.old!r} is not there"
    file.write_text(text.replace(planted.old, planted.new, 1))
    done = subprocess.run(
        [sys.executable, "-m", "support.net.make", str(NET), "--look", "--only", planted.where],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}:{tmp_path / 'tests'}"},
        capture_output=True,
        text=True,
        timeout=HANGS_S,
    )
    assert done.returncode == 1 and planted.where in done.stdout, done.stdout + done.stderr
