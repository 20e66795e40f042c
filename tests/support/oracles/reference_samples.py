"""The programs that come with LinuxCNC, read by us and by its stand-alone interpreter."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

from support.oracles import reference_interpreter
from support.oracles.reference_interpreter import Reading, machine

from controller.machine.model import Machine
from controller.program import linked
from controller.program.program import ProgramError

ROOTS = (Path("/usr/share/linuxcnc"), Path("/usr/share/doc/linuxcnc"))
_TOOLS = range(1, 21)
_TURNS_B = re.compile(r"^[^(;]*[bB] *-?[0-9\[#]", re.MULTILINE)


def samples() -> list[Path]:
    """All that are installed, each once."""
    found = {path.resolve(): path for root in ROOTS for path in sorted(root.rglob("*.ngc"), reverse=True)}
    return sorted(path for path in found.values() if path.is_file())


def difference(path: Path, folder: Path) -> str:
    """What differs, or "": a move, how many there are, or what only one of them refuses."""
    data = path.read_bytes()
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = data.decode("cp1252")
    on = _machine(text)
    for beside in path.parent.glob("*.ngc"):
        shutil.copy(beside, folder / beside.name)
    reference = reference_interpreter.reference(text, folder, on)
    try:
        own = reference_interpreter.ours(linked.linked(text.encode(), linked.beside(path)).decode(), on)
    except ProgramError as error:
        own = Reading([], str(error))
    return _first(own, reference)


def _machine(text: str) -> Machine:
    """Twenty tools; B and C where the program turns B."""
    on = machine(kind="fig4b" if _TURNS_B.search(text) else "fig4a")
    tools = tuple(replace(on.tools[0], number=n, name=f"T{n}", length_mm=5.0 + n) for n in _TOOLS)
    return replace(on, tools=tools)


def _first(own: Reading, reference: Reading) -> str:
    both = f"\n  ours: {own.refused or 'whole'}\n  theirs: {reference.refused or 'whole'}"
    for k, (ours, theirs) in enumerate(zip(own.moves, reference.moves, strict=False)):
        if not ours.near(theirs):
            return f"move {k + 1}: {ours} and {theirs}{both}"
    if len(own.moves) != len(reference.moves) or bool(own.refused) != bool(reference.refused):
        return f"{len(own.moves)} and {len(reference.moves)} moves{both}"
    return ""
