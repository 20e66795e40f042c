"""The process that judges a run for the panel as its drives have cut it: a job in, a line of JSON out.

{"record": folder of the run, "parent": process id}
-> {"verdict": {"within": true, ...} or null, "gouges": 0, "surfaces": [{"line": 10, "overcut_mm": ...}]}
-> {"refused": {"key": "...", "values": {...}}}
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path
from typing import Any

from controller.cli import verify
from controller.messages import message
from controller.runtime import children

NICE = 15  # after the checks, which somebody waits for


def main() -> None:
    job = json.loads(sys.stdin.read())
    children.end_with(int(job["parent"]))
    with contextlib.suppress(OSError):  # a sandbox may forbid it
        os.nice(NICE)
    print(json.dumps(judged(Path(job["record"]))))


def judged(record: Path) -> dict[str, Any]:
    """What the drives have cut, or that nobody knows."""
    try:
        return verify.of_run(record)
    except Exception:  # whatever it is, the command says it to who asks
        return {"refused": message("run_not_judged", record=record.name)}


if __name__ == "__main__":
    main()
