"""The record of a run in production, made again by ``directrix simulate --events``, and compared."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller import config, fitting
from controller.handoff import COLUMN
from controller.machine import Kind, Machine
from controller.session import events
from controller.session.checked import Task, Walk
from controller.session.events import Recorded
from controller.verify.console import Refused

if TYPE_CHECKING:
    from controller.session.replay import Difference
    from controller.session.stepped import Run, SteppedMachine

RUN = "run.json"  # beside the events of a run that was ended in order
CAUSES = (
    "Another version of this program, another computer's mathematics or a changed record make that; "
    "use what the run was recorded with."
)


class RecordedRun:
    """``machine`` is fitted as it was then; ``recorded`` says how it began."""

    def __init__(self, file: Path, recorded: Recorded, built: Machine) -> None:
        """Raises Refused where its setpoints cannot be read, and ConfigError for a period that is none."""
        from controller.session import replay

        period_s = recorded.begin.period_s
        self._built = built if period_s is None else config.with_period(built, period_s)
        self.recorded, self._file = recorded, file
        self.machine = fitting.applied(self._built, recorded.begin.fitted)
        try:
            self._wanted = replay.setpoints(file.parent)
        except (OSError, ValueError, KeyError) as error:
            raise Refused(
                f"{file.parent}: its setpoints cannot be read ({error}); give the record as it was written."
            ) from error

    def stand(self, bench: SteppedMachine) -> None:
        """Where the run began."""
        bench.stand_at(self.recorded.begin.start.joints, self.recorded.begin.start.plan_time_s)

    def run(self, bench: SteppedMachine, walk: Walk, task: Task, progress: Callable[[float], None]) -> Run:
        """As far as it was recorded."""
        from controller.session import replay

        part = replay.Part(task, lambda values: fitting.applied(self._built, dict(values)))
        return replay.again(bench, walk, part, self.recorded, self._wanted, progress)

    def judge(self, run: Run) -> dict[str, Any]:
        """How much of it came again. Raises Refused where it came out otherwise."""
        from controller.session import replay

        if self._wanted is None:
            return {"recorded_ticks": 0}
        found = replay.difference(self.recorded, self._wanted, run.rows)
        if found is not None:
            name = self.machine.axes[found.axis].name
            raise Refused(f"{self._file}: {self._otherwise(found, name, run)}", tick=found.tick, axis=name)
        if run.result != "completed" and self._ended_as() == "completed":
            raise Refused(
                f"{self._file}: the recorded run came to the program's end after {len(self._wanted)} ticks; "
                f"made again it did not ({run.result}). {CAUSES}"
            )
        return {"recorded_ticks": len(self._wanted)}

    def _otherwise(self, found: Difference, name: str, run: Run) -> str:
        sent = run.rows[run.rows[:, COLUMN["sync_sent"]] != 0.0]
        line, axis = int(sent[found.tick, COLUMN["line"]]), self.machine.axes[found.axis]
        apart = abs((found.again - found.recorded) / axis.counts_per_unit * axis.shown_per_unit)
        unit = "mm" if axis.kind is Kind.LINEAR else "degrees"
        return (
            f"made again the run differs from the recorded one in tick {found.tick} (line {line}): {name} "
            f"was told {found.recorded} counts, and {found.again} now, {apart:.6f} {unit} apart. {CAUSES}"
        )

    def _ended_as(self) -> str:
        try:
            return str(json.loads((self._file.parent / RUN).read_text(encoding="utf-8"))["result"])
        except (OSError, ValueError, KeyError, TypeError):
            return ""  # nobody lived to write it


def read(file: Path, machine: Machine, program: bytes) -> RecordedRun | None:
    """The record of a run, None where an operator wrote the file. Raises EventError, and Refused where
    it is of another program or machine.
    """
    found = events.recorded(file)
    if found is None:
        return None
    for what, wanted, given in (
        ("program", found.begin.program_sha256, program),
        ("machine file", found.begin.machine_sha256, machine.text.encode()),
    ):
        if wanted != hashlib.sha256(given).hexdigest():
            raise Refused(f"{file}: is the record of a run with another {what}; give the one that was run.")
    return RecordedRun(file, found, machine)
