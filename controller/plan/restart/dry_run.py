"""A dry run: the whole program some way off the part along the tool axis, spindle and coolant off.

A tool that is thought longer by d than it is stands d further off along its own axis, on
every machine and at every tilt: the spindle is at tip + length x axis. So the offset is put
on the lengths, and everything else (approach, travel, limits) is judged as it will be run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from controller.machine.model import Machine
from controller.messages import Said, said
from controller.program.program import Block, JointLine, TipLine


def refusal(offset_mm: float) -> Said | None:
    """Why an offset is refused; None where it is not."""
    return None if 0.0 <= offset_mm < 1e4 else said("restart.dry_run", offset=offset_mm)


def machine_for(machine: Machine, offset_mm: float) -> Machine:
    """The machine whose tools are longer by the offset (mm)."""
    tools = tuple(replace(tool, length_mm=tool.length_mm + offset_mm) for tool in machine.tools)
    return replace(machine, tools=tools)


def blocks_for(blocks: Iterable[Block], offset_mm: float) -> Iterator[Block]:
    """The same blocks with the offset on the tool's length, spindle and coolant off."""
    for block in blocks:
        modal = block.modal
        cutter = modal.cutter and replace(modal.cutter, length_mm=modal.cutter.length_mm + offset_mm)
        dry = replace(
            modal, length_mm=modal.length_mm + offset_mm, cutter=cutter, spindle_rev_min=0.0, coolant=0
        )
        if isinstance(block, JointLine | TipLine):
            block = replace(block, probe=None)  # there is nothing to be touched
        yield replace(block, modal=dry)
