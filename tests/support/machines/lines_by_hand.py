"""A control at which lines are typed, one after the other, without a machine that moves.

What the service keeps between two lines is its own: the modal state, what is set for good, the tool.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from support.oracles import reference_interpreter as oracle

from controller.ipc.handoff import Snapshot, blank
from controller.machine import setup_data
from controller.machine.changes import laid
from controller.machine.model import TOOL_AT_POWER_ON, Joints, Machine
from controller.plan.report import explained
from controller.program import blocks, modal
from controller.program.carried import InForce
from controller.program.modal import State
from controller.program.position import homed
from controller.program.program import Setting
from controller.service import jobs, status
from controller.service.active_codes import active_codes
from controller.service.modal_state import ModalState
from controller.state.modes import ALL_AXES, Mode


@dataclass
class ByHand:
    """What the service does with such lines."""

    file: Machine
    fitted: dict[str, Any] = field(default_factory=dict)
    moves: list[oracle.Move] = field(default_factory=list)
    tool: int = TOOL_AT_POWER_ON
    axes: Joints = ()

    def __post_init__(self) -> None:
        self.axes = homed(self.file)
        self.modal = ModalState(self.file)
        self.rev_min, self.coolant = 0.0, 0

    @property
    def machine(self) -> Machine:
        return setup_data.applied(self.file, self.fitted)

    @property
    def now(self) -> Snapshot:
        return blank()._replace(
            mode=Mode.READY,
            homed=ALL_AXES,
            at_rest=True,
            joints=self.axes,
            spindle_rev_min=self.rev_min,
            spindle_override=1.0,
            coolant=self.coolant,
        )

    def type(self, text: str) -> None:
        """Raises ProgramError, and has then done nothing."""
        machine, made = self.machine, list[oracle.Move]()
        job, seen, here = jobs.mdi(text, machine), InForce(), self.axes
        begin = modal.begun(machine, self.modal.begin_of(job, self.now, machine, self.tool))
        before = machine.shown(here)
        read = list(blocks.stream(job.program.text, machine, "MDI", start=here, begin=begin, in_force=seen))
        for step in explained.steps(iter(read), machine, "MDI", here):
            if step.kind in ("rapid", *explained.LINES, "arc", "curve"):
                values = tuple(0.0 if q is None else q for q in step.axes.values())
                if step.kind != "curve":  # of which the reference makes arcs
                    made.append(
                        oracle.Move(oracle.kind_of(step), values, oracle._a_minute(step, before, values))
                    )
                before = values
                here = tuple(q / axis.shown_per_unit for q, axis in zip(values, machine.axes, strict=True))
        changes = [change for block in read if isinstance(block, Setting) for change in block.changes]
        self.fitted, self.axes = laid(self.fitted, machine, changes), here
        self.moves += made
        assert seen.last is not None
        job.news = replace(job.news, left=seen.last)
        self.modal.end(job, "completed", self.machine)
        left = seen.last.modal
        self.rev_min, self.coolant, self.tool = left.spindle_rev_min, left.coolant, left.tool

    @property
    def state(self) -> State:
        """In force."""
        return self.modal.at(self.now, self.machine, self.tool)

    @property
    def codes(self) -> tuple[str, ...]:
        return active_codes(self.state)

    @property
    def work(self) -> dict[str, float]:
        """What the axes read, mm and degrees."""
        told = status.machine_values(self.machine, self.now, None, self.state, self.tool)["joints"]
        return {name: row["work"] for name, row in told.items()}
