"""Programs read, planned and audited as a whole by the plan's process, or found as they were kept."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller import memory
from controller.ipc.handoff import Snapshot
from controller.machine.model import OFFSETS
from controller.plan import waits
from controller.plan.foresight import foreseen
from controller.plan.planner import orders_of
from controller.plan.report.passing import passed_s, place_of
from controller.plan.report.stored import Stored
from controller.plan.restart.restart import Rest
from controller.plan.timetable import Timetable
from controller.program.carried import InForce
from controller.program.program import Block, is_by_offset
from controller.runtime import checked, entry_state, starts
from controller.runtime.checked import Task
from controller.runtime.plan_end import PlanEnd
from controller.runtime.plan_messages import Program
from controller.runtime.starts import Start

PROGRESS_S = 0.1
MAX_NOTES = 100  # every status has them; all of them stand with the check
SOON = 200  # blocks of a program in which its first motion is looked for
# What is reported of a program that nobody has looked at as a whole.
UNCHECKED: dict[str, Any] = {
    **dict.fromkeys(("duration_s", "blocks", "verdict", "timetable")),
    **{"restart": [], "notes": [], "marks": (), "events": (), "passed_s": 0.0, "offset": None},
}


class ProgramChecks:
    """Of one machine, whose newest snapshot is where a typed line and a rest begin."""

    def __init__(
        self,
        end: PlanEnd,
        folder: Path,
        look: Callable[[], None],
        hear: Callable[[Block], None],
        progress: Callable[[float | None], None],
    ) -> None:
        """``folder``: of stored checks; ``look`` is called on the way, and may raise what gives it up;
        ``hear`` with each block that is read; ``progress`` with the share that is checked, None at the end.
        """
        self._end, self._folder, self._look, self._hear, self._progress = end, folder, look, hear, progress
        self._text = b""  # of the program that was checked or armed last
        self._reported_s = 0.0

    def check(self, program: Program) -> dict[str, Any]:
        """What there is to be reported of it. Raises ProgramError."""
        if program.unchecked:
            return dict(UNCHECKED)
        kept = self.stored(program)
        rest = self.rest(program, kept) if program.spot is not None else None
        here = place_of(rest.what, rest.order, rest.spot.fraction, rest.spot.s) if rest else None
        return {
            **figures_of(kept),
            "passed_s": passed_s(kept.marks, here) if here else 0.0,
            "offset": self._offset(program),
            "timetable": self._timetable_from_here(program, kept),
            "restart": entry_state.messages(rest) if rest else [],
            "notes": [note.facts for note in kept.notes[:MAX_NOTES]],
            "verdict": checked.verdict_of(kept, most=0),  # the job is reported many times a second
        }

    def _offset(self, program: Program) -> str | None:
        """The work offset of its first motion by it; None where it has none, or that is far inside."""
        begins = itertools.islice(self.task(program).read(), SOON)
        return next((OFFSETS[block.modal.offset] for block in begins if is_by_offset(block)), None)

    def _timetable_from_here(self, program: Program, kept: Stored) -> Timetable | None:
        """Of a run from where the machine stands, with the way to the program or to its place.

        None where the check is that of such a run, and where nobody knows where the machine stands.
        """
        now = self._end.snapshot()
        start = start_of(program, now)
        task = replace(self.task(program), look=lambda _: self._look())
        homed = now.homed == program.machine.every_axis and not now.untrusted
        as_checked = program.spot is None and program.in_spindle == program.machine.in_spindle
        if not homed or (as_checked and checked.standing(task, start.joints) is task):
            return None
        begun = replace(start, in_spindle=program.in_spindle)
        walk = starts.path_from(task, kept, begun, program.cut_with)
        rev_min = program.begin.modal.spindle_rev_min if program.begin is not None else 0.0
        items = waits.laid(walk.items, program.machine, rev_min)
        return foreseen(items, program.machine, task.kinematics, orders_of(now))

    def task(self, program: Program) -> Task:
        """What was remembered of another program is forgotten."""
        if not program.typed and program.text != self._text:
            self._text = program.text
            memory.forget()
        machine = program.machine
        if program.typed and machine.changer is not None:  # which knows its tool before the line says any
            machine = replace(machine, in_spindle=program.in_spindle)
        task = replace(
            checked.task(program.text, program.name, machine), begin=program.begin, typed=program.typed
        )
        if program.typed:  # from where the tool stands: a line may ask for that
            task = replace(task, start=start_of(program, self._end.snapshot()).joints)
        return replace(task, look=self._read)

    def _read(self, block: Block) -> None:
        self._look()
        self._hear(block)

    def stored(self, program: Program) -> Stored:
        """Its check. Raises ProgramError."""
        task = self.task(program)
        kept, _ = checked.find(task, self._folder)
        if kept is not None:
            return kept
        lines = max(1, program.text.count(b"\n"))
        tell, progress = (lambda _: self._look()), (lambda line: self._checked(line / lines))
        try:
            return checked.check(task, self._folder, tell, progress)[1]
        finally:
            self._progress(None)

    def _checked(self, share: float) -> None:
        now_s = time.monotonic()
        if now_s - self._reported_s >= PROGRESS_S:
            self._reported_s = now_s
            self._progress(min(share, 1.0))

    def rest(self, program: Program, kept: Stored, in_force: InForce | None = None) -> Rest:
        """What is left of a program from its spot on; ``in_force`` notes the modal state of each line.

        Raises ProgramError.
        """
        task = self.task(program)
        task = task if in_force is None else replace(task, in_force=in_force)
        return starts.rest(task, kept.choices, start_of(program, self._end.snapshot()))


def figures_of(kept: Stored) -> dict[str, Any]:
    """What a check says of length and time."""
    return {name: getattr(kept, name) for name in ("marks", "events", "duration_s", "blocks")}


def start_of(program: Program, now: Snapshot) -> Start:
    """From where the machine stands."""
    return Start(
        now.joints,
        now.queue_end_s,
        program.spot,
        program.start,
        program.dry_run_mm,
        program.in_spindle,
        program.typed,
        program.unchecked,
        program.begin,
    )
