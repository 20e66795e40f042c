"""``directrix import --verify``: the program that was written, checked and verified in the same run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from controller.cli import programs, verify
from controller.machine.model import Machine
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.verify.console import Refused, in_words, say, show


def verdict(program: Path, machine: Machine, as_json: bool) -> tuple[dict[str, Any], str]:
    """The figures of check and verify, and why the program is not cut, "" where it is.

    A check that refuses the program does not end it: what would come of it is then to be seen. Raises Refused
    where no path can be made at all.
    """
    task = checked.task(program.read_bytes(), str(program), machine)
    refused = ""
    figures: dict[str, Any] = {}
    try:
        figures["check"] = programs.check_of(program, task, as_json)
    except Refused as error:
        refused = str(error)
        figures["check"] = {"ok": False, "error": refused, **error.facts}
    try:
        found = verify.judged(task, as_json)
    except ProgramError as error:
        raise Refused(refused or in_words(error.placed), **figures) from error
    figures["verify"] = found.to_dict(machine)
    wrong = found.wrong if found.gouges or found.exceeding else ""
    if not as_json:
        verify.show_found(found)
        if refused:
            show.print(say("cli.import.refused", why=refused))
    return figures, refused or (wrong if machine.gouge == "refuse" else "")
