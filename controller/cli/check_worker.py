"""The process that checks one program for the panel: a job on standard input, lines of JSON out.

    {"program": path, "name": name, "lines": 120, "state": folder, "parent": process id}
    -> {"progress": 0.25} ...
    -> {"state": "passed" | "refused" | "failed", "result": {...}}

A passed check with surfaces is told with ``"more": true``, and once more when their cut has been
looked at: then ``verified`` in its result has what ``controller.verify.maps`` gives.

The machine is the one that the service runs on: its file as the service noted it in the state
folder, with what is fitted laid over. What is found out is kept for the service of the same user, too.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from controller import memory
from controller.api import own_folder
from controller.cli import internal_error
from controller.machine import setup_data
from controller.machine.toml_table import ConfigError
from controller.messages import message, of_error
from controller.plan.report.picture import Picture
from controller.plan.segment import Segment
from controller.program import blocks, linked, refusals
from controller.program.program import Block, ProgramError
from controller.runtime import checked, children, refused_path
from controller.service import durations
from controller.store import set_up_store
from controller.verify.audit import Watched
from controller.verify.maps import maps

CHECKS = "checks"
PICTURES = "pictures"  # of paths, by the name of the check
# Behind the machine and its page, but somebody waits for it: beside two busy programs of others a nice of 15
# got 3 % of a core, and a check of six seconds took three minutes.
NICE = 5
MAX_CUTS = 1000  # surfaces, holes and notes that are listed one by one

Result = tuple[str, dict[str, Any]]
Seen = tuple[checked.Task, Mapping[int, Segment]]


def main() -> None:
    job = json.loads(sys.stdin.read())
    children.end_with(int(job["parent"]))
    memory.keep_freed()
    with contextlib.suppress(OSError):  # a sandbox may forbid it
        os.nice(NICE)
    seen: list[Seen] = []
    state, result = check(job, lambda share: _say({"progress": share}), seen.append)
    _say({"state": state, "result": result, "more": bool(seen)})
    for task, segments in seen:
        _say({"state": state, "result": {**result, "verified": verified(task, segments)}})


def _say(words: dict[str, Any]) -> None:
    print(json.dumps(words), flush=True)


def check(
    job: dict[str, Any], progress: Callable[[float], None], seen: Callable[[Seen], None] = lambda _: None
) -> Result:
    """State and result of a job; ``seen`` gets the path of one that passed, if it cuts a surface."""
    state, name = Path(job["state"]), str(job["name"])
    pictures = own_folder.of(state) / PICTURES
    try:
        files = {file: Path(at) for file, at in job.get("files", {}).items()}
        machine = set_up_store.machine(state)
        text = linked.linked(Path(job["program"]).read_bytes(), linked.among(files), machine)
        task = checked.task(text, name, machine)
        lines = max(1, int(job["lines"]))
        picture = Picture(task.machine, task.kinematics)
        watched = Watched(())
        found, kept = checked.looked_at(
            task,
            progress=lambda line: progress(min(1.0, line / lines)),
            watch=lambda items: watched.over(picture.watched(items)),
        )
        # The service goes by its own: where it is another user it looks at the program itself.
        warning = checked.keep(kept, task.key, state / CHECKS) if os.access(state, os.W_OK) else ""
    except ProgramError as error:
        place = {"file": error.file, "line": error.line, "column": error.column}
        if error.file != name:
            place["called_at"] = error.line_in(name)
        found_out = {**error.said, **place, **error.facts, **_others(error, task)}
        return "refused", {**found_out, **_drawn(task, found_out, pictures)}
    except (ConfigError, OSError) as error:
        return "failed", {**message("could_not_check", program=name, why=of_error(error))}
    except Exception as error:  # the operator gets a sentence, and we the rest
        return "failed", {**message("could_not_check", program=name, why=internal_error.sentence(error))}
    with contextlib.suppress(OSError):  # a program runs without its picture
        picture.shape().save(pictures / f"{task.key}.npz")
    if kept.overcuts:
        seen((task, watched.segments))
    figures = found.to_dict()
    figures["waits_s"] = durations.of_state(state).sum_s(kept.events)  # as its runs have shown it
    figures["takes_s"] = found.duration_s + figures["waits_s"]
    for listed in ("cuts_mm", "holes"):
        figures[listed] = figures[listed][:MAX_CUTS]
    notes = [note.facts for note in kept.notes[:MAX_CUTS]]
    figures["verdict"] = checked.verdict_of(kept)
    figures["fitted"] = setup_data.names(set_up_store.load(state))  # what counts instead of the machine file
    return "passed", {**figures, "notes": notes, "warning": warning, "stored": task.key}


def _others(first: ProgramError, task: checked.Task) -> dict[str, Any]:
    """All that is refused in the text, and a sentence that says so; of what the path refuses nothing."""
    found = refusals.of(task.text, task.machine, task.name, task.start)
    if not found or str(found[0]) != str(first):
        return {}
    facts = refusals.facts(found, refusals.lines_of(task.text, task.name), task.name)
    if len(found) == 1:
        return facts
    return {**message("program.of_several", sentence=first.said, summed=refusals.summed(found)), **facts}


def _drawn(task: checked.Task, refused: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Where the picture of what can be seen of a refused program is, and the guilty lines; or nothing."""
    shape = refused_path.shape_of(task)
    if shape is None:
        return {}
    with contextlib.suppress(OSError):
        shape.save(folder / f"{task.key}.npz")
        return {"pictured": task.key, "guilty_lines": refused_path.guilty_lines(refused, task.name)}
    return {}


def verified(task: checked.Task, segments: Mapping[int, Segment]) -> dict[str, Any]:
    """The surfaces as cut, for the page."""

    def read() -> Iterator[Block]:
        return blocks.stream(task.text, task.machine, task.name, start=task.start)

    return maps(segments, read, task.machine, task.kinematics)


if __name__ == "__main__":
    main()
