"""The process that reads a program which is being written: a job on standard input, one line of JSON out.

    {"text": ..., "name": name, "files": {name: path}, "state": folder, "parent": process id}
    -> {"refusals": [{"line": 2, "column": 4, "key": "...", "values": {...}}]}

It reads only, with the machine as it is fitted: what a check finds on the path comes once it is kept.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from controller.program import linked, refusals
from controller.program.position import homed
from controller.program.program import ProgramError
from controller.runtime import children
from controller.store import set_up_store


def main() -> None:
    job = json.loads(sys.stdin.read())
    children.end_with(int(job["parent"]))
    print(json.dumps({"refusals": read(job)}))


def read(job: Mapping[str, Any]) -> list[dict[str, Any]]:
    """All that the reader refuses; of a called file with its place, at the line that calls it.

    Raises ConfigError and OSError.
    """
    files = {file: Path(at) for file, at in job["files"].items()}
    machine, name = set_up_store.machine(Path(job["state"])), str(job["name"])
    text = linked.linked(str(job["text"]).encode(), linked.among(files), machine)
    found = refusals.of(text, machine, name, homed(machine))
    return [_row(one, name) for one in found[: refusals.MAX_REPORTED]]


def _row(error: ProgramError, name: str) -> dict[str, Any]:
    if error.file == name:
        return {"line": error.line, "column": error.column, **error.said}
    return {"line": error.line_in(name) or 1, "column": 1, **error.placed}


if __name__ == "__main__":
    main()
