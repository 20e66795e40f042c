"""What LinuxCNC's stand-alone interpreter makes of whole programs with subs and messages, for comparisons."""

from __future__ import annotations

import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from support.oracles import reference_interpreter

RS274 = reference_interpreter.program()
KINDS = {"STRAIGHT_TRAVERSE": "rapid", "STRAIGHT_FEED": "feed"}
_ROW = re.compile(r"^\s*\d+ N\S*\s+(\w+)\((.*)\)$")

Row = tuple[str, tuple[float, ...]]  # kind; X Y Z A C


@dataclass(frozen=True, slots=True)
class Run:
    """What a program does: its moves, the messages it shows, and whether it was refused in the end."""

    moves: list[Row]
    messages: list[str]
    refused: str


def run(text: str, files: dict[str, str] | None = None, *options: str) -> Run:
    """The program as the reference carries it out (mm and degrees)."""
    assert RS274 is not None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "t.tbl").write_text("T1 P1 D6\nT2 P2 D6\nT3 P3 D6\n")
        (folder / "v.var").write_text("5161 0\n")
        for file, content in {"program.ngc": text, **(files or {})}.items():
            (folder / file).write_text(content)
        command = [RS274, "-t", "t.tbl", "-v", "v.var", *options, "-g", "program.ngc"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=10)
    rows = [found for line in done.stdout.splitlines() if (found := _ROW.match(line))]
    moves = [(KINDS[row[1]], _places(row[2])) for row in rows if row[1] in KINDS]
    said = [row[2].strip('"') for row in rows if row[1] == "MESSAGE"]
    return Run(moves, said, "" if done.returncode == 0 else done.stderr.strip())


def _places(values: str) -> tuple[float, ...]:
    x, y, z, a, _, c = (float(value) for value in values.split(","))
    return x, y, z, a, c
