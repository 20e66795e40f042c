"""The process that evaluates a measurement for the panel: a job on standard input, one line of JSON out.

    {"measurement": "rotaries", "values": {...}, "table": CSV, "file": its name, "recording": path or null,
     "program": path or null, "name": its name, "files": {name: path}, "state": folder, "parent": process id}
    -> {"found": {"told": {...}, "machine_file": text or null, "picture": PNG as base64 or null}}
    -> {"refused": {"key": "...", "values": {...}}}

Values are as ``calibration.measurements.complete`` gives them. The machine is the one of the service, as it
is fitted; what is written into is the text of its own file.
"""

from __future__ import annotations

import base64
import io
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from controller.calibration.refusal import Refusal
from controller.cli import measurements
from controller.cli.measurements import Inputs
from controller.machine import machine_file, setup_data
from controller.machine.toml_table import ConfigError
from controller.messages import of_error
from controller.program import linked
from controller.program.program import ProgramError
from controller.runtime import children
from controller.store import set_up_store


def main() -> None:
    job = json.loads(sys.stdin.read())
    children.end_with(int(job["parent"]))
    try:
        answer: dict[str, Any] = {"found": evaluated(job)}
    except Refusal as error:
        answer = {"refused": error.said}
    except ProgramError as error:
        answer = {"refused": error.placed}
    except (ConfigError, OSError) as error:
        answer = {"refused": of_error(error)}
    print(json.dumps(answer))


def evaluated(job: Mapping[str, Any]) -> dict[str, Any]:
    """Raises Refusal, ProgramError, ConfigError, OSError."""
    state, name = Path(job["state"]), str(job["measurement"])
    text, machine = b"", set_up_store.machine(state)
    if job["program"]:
        files = {file: Path(at) for file, at in job["files"].items()}
        text = bytes(linked.linked(Path(job["program"]).read_bytes(), linked.among(files), machine))
    recording = Path(job["recording"]) if job["recording"] else None
    given = (job["values"], job["table"], job["file"], recording, text, job["name"])
    found = measurements.EVALUATE[name](Inputs(machine, *given))
    edited = found.edit(machine_file.alone(setup_data.noted(state))) if found.edit is not None else None
    return {"told": found.told, "machine_file": edited, "picture": _picture(found)}


def _picture(found: measurements.Result) -> str | None:
    """PNG as base64; None where nothing is drawn, or nothing is there to draw with."""
    if found.draw is None:
        return None
    made = io.BytesIO()
    try:
        found.draw(made)
    except ImportError:
        return None
    return base64.b64encode(made.getvalue()).decode()


if __name__ == "__main__":
    main()
