"""What a change of the tool has held the spindle by lets go with it: M3 meets a spindle that is free."""

from __future__ import annotations

import pytest

from controller.machine import machine_file
from controller.program import blocks
from controller.program.program import Action, Await


@pytest.mark.parametrize(("before", "stays"), [("", False), ("M19\n", True)])
def test_the_spindle_is_free_after_a_change_but_for_an_m19_of_the_program(before: str, stays: bool) -> None:
    machine = machine_file.load("shop")
    assert machine.io is not None and machine.io.orient is not None
    bit = 1 << machine.io.switched.index(machine.io.orient.output)
    on, by_line = False, dict[int, list[bool]]()
    for block in blocks.read(f"{before}T2 M6\nG4 P1\nM3 S500\n".encode(), machine, "part.ngc").blocks:
        if isinstance(block, Action | Await):
            outputs = block.outputs if block.outputs is not None else block.modal.outputs
            on = (on or bool(outputs.on & bit)) and not outputs.off & bit
            by_line.setdefault(block.place.line, []).append(on)
    change, spindle = (2, 4) if before else (1, 3)
    assert True in by_line[change], "it is held in the change"
    assert by_line[change][-1] is stays
    assert by_line[spindle][-1] is False
