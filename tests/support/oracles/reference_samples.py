"""The programs that come with LinuxCNC, read by us and by its stand-alone interpreter."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

from support.oracles import reference_interpreter
from support.oracles.reference_interpreter import Reading, machine

from controller.machine.model import Machine
from controller.program import linked
from controller.program.program import ProgramError

ROOTS = (Path("/usr/share/linuxcnc"), Path("/usr/share/doc/linuxcnc"))
_TOOLS = range(1, 21)
_APART = (  # what leads elsewhere for a reason in the README of the programs, and is the same on two lines
    re.compile(r"^([^(;\n]*?m0?6\b[^(;\n]*?)(g43[^(;\n]*)", re.IGNORECASE | re.MULTILINE),
    re.compile(r"^([^(;\n]*?g2[01]\b[^(;\n]*?)(f[^(;\n]*)", re.IGNORECASE | re.MULTILINE),
)
_TURNS_B = re.compile(r"^[^(;]*[bB] *-?[0-9\[#]", re.MULTILINE)


def samples() -> list[Path]:
    """All that are installed, each once."""
    found = {path.resolve(): path for root in ROOTS for path in sorted(root.rglob("*.ngc"), reverse=True)}
    return sorted(path for path in found.values() if path.is_file())


def difference(path: Path, folder: Path) -> str:
    """What differs, or "": a move, how many there are, or what only one of them refuses.

    For the reference G43 stands behind the line of M6, and F behind that of G20 or G21.
    """
    data = path.read_bytes()
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = data.decode("cp1252")
    on = _machine("fig4b" if _TURNS_B.search(text) else "fig4a")
    for beside in path.parent.glob("*.ngc"):
        (folder / beside.name).symlink_to(beside)
    apart = text
    for beside_each_other in _APART:
        apart = beside_each_other.sub(r"\1\n\2", apart)
    reference = reference_interpreter.reference(apart, folder, on)
    try:
        own = reference_interpreter.ours(linked.linked(text.encode(), linked.beside(path)).decode(), on)
    except ProgramError as error:
        own = Reading([], str(error))
    return _first(own, reference)


@cache
def _machine(kind: str) -> Machine:
    """Twenty tools; B and C, where the program turns B, or A and C."""
    on = machine(kind=kind)
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
