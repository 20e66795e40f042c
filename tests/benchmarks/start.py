"""How long the command line takes to its first answer: processor time of whole processes, in turns.

Beside it stands an interpreter that does nothing. The parts are those of ``directrix status``, which is what
an operator types: the interpreter, typer, the command line itself, and the command with what it imports.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

ROOT = Path(__file__).parents[2]
NOTHING, TYPER, ITSELF = ("-c", "pass"), ("-c", "import typer"), ("-c", "import controller.__main__")
COMMANDS = {
    "--version": ("-m", "controller", "--version"),
    "status": ("-m", "controller", "status", "--json"),
    "check --help": ("-m", "controller", "check", "--help"),
    "check example1": ("-m", "controller", "check", str(ROOT / "config" / "programs" / "example1.ngc")),
}
WANTED_S = {"status": 0.3}


def cpu_s(words: tuple[str, ...], folder: str) -> float:
    """User and system time of one process; a command may well refuse, it only has to answer."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": folder, "XDG_RUNTIME_DIR": folder}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(
        [sys.executable, *words], stdout=quiet, stderr=quiet, env=environment, cwd=ROOT
    )
    _, _, used = os.wait4(process.pid, 0)
    process.returncode = 0
    return used.ru_utime + used.ru_stime


def report(short: bool) -> Report:
    words = {"an interpreter": NOTHING, "typer": TYPER, "the command line": ITSELF, **COMMANDS}
    least = dict.fromkeys(words, float("inf"))
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(2 if short else 10):  # the first turn makes the bytecode
            for name, command in words.items():
                least[name] = min(least[name], cpu_s(command, folder))
    nothing = least["an interpreter"]
    found = [
        Figure(name, least[name], "s of CPU", nothing, "an interpreter", at_most=WANTED_S.get(name))
        for name in COMMANDS
    ]
    steps = [0.0, nothing, least["typer"], least["the command line"], least["status"]]
    names = ("interpreter", "typer", "command line", "status")
    rising = [max(a, b) for a, b in zip(steps[1:], [0.0, *steps[1:-1]], strict=True)]
    amounts = {name: max(b - a, 0.0) for name, a, b in zip(names, [0.0, *rising], rising, strict=False)}
    return Report(tuple(found), figures.shares(amounts), "directrix status")


if __name__ == "__main__":
    figures.main(report)
