"""The record of a run in production, made again by ``directrix replay``, or ``simulate --events``."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from controller import own_files
from controller.machine import machine_file, setup_data
from controller.machine.machine_file import written
from controller.machine.model import Kind, Machine
from controller.machine.spindle import unasked
from controller.program import linked
from controller.runtime import events
from controller.runtime.checked import Task, Walk
from controller.runtime.comparison import Comparison, Difference, off_path
from controller.runtime.events import Recorded
from controller.state import record_files
from controller.state.setpoints import ACTUAL, MISSING, SETPOINTS, Counts, Spoilt, counts_per_unit
from controller.verify.console import Refused, in_words, say

if TYPE_CHECKING:
    from controller.runtime.stepped import Run, SteppedMachine
    from controller.verify.trace import Trace


class RecordedRun:
    """``machine`` is fitted as it was then, ``text`` was run; ``recorded`` says how it began."""

    def __init__(self, file: Path, recorded: Recorded, built: Machine, text: bytes) -> None:
        """Raises Refused where its setpoints cannot be read at all, and ConfigError for a period that is
        none.
        """
        period_s = recorded.begin.period_s
        if not recorded.begin.start.asks_spindle:
            built = replace(built, spindle=unasked(built.spindle))
        self._built = built if period_s is None else machine_file.with_period(built, period_s)
        self.recorded, self._file, self.text = recorded, file, text
        self.name = str(record_files.known(file.parent).get("name") or events.PROGRAM)
        self.machine = setup_data.applied(self._built, recorded.begin.fitted)
        self._unknown: tuple[Spoilt, ...] = ()  # positions
        self._wanted = Comparison(file.parent, recorded) if SETPOINTS.segments(file.parent) else None
        if self._wanted is not None and not self._wanted.ticks:
            self._wanted.finish()
            self._refuse_unreadable()

    @property
    def duration_s(self) -> float:
        """Of what was recorded."""
        return 0.0 if self._wanted is None else self._wanted.ticks * self.machine.period_s

    def stand(self, bench: SteppedMachine) -> None:
        """Where the run began."""
        bench.stand_at(self.recorded.begin.start.joints, self.recorded.begin.start.plan_time_s)

    def run(
        self,
        bench: SteppedMachine,
        walk: Walk,
        task: Task,
        progress: Callable[[float], None],
        keep: bool = True,
    ) -> Run:
        """As far as it was recorded; ``keep``: every row of it, and not the last one alone."""
        from controller.runtime import replay

        part = replay.Part(task, lambda values: setup_data.applied(self._built, dict(values)))
        return replay.again(bench, walk, part, self.recorded, self._wanted, progress, keep)

    def repeat(
        self, task: Task, progress: Callable[[float], None], keep: bool = True
    ) -> tuple[SteppedMachine, Run]:
        """The run on a machine of its own; ``progress`` gets the share that is done, ``keep`` as ``run``."""
        from controller.runtime import starts
        from controller.runtime.stepped import SteppedMachine

        walk = starts.path_from(task, None, self.recorded.begin.start)
        bench = SteppedMachine(self.machine)
        bench.come_up()
        self.stand(bench)
        of_all = lambda s: progress(s / max(self.duration_s, s, 1e-9))  # noqa: E731
        return bench, self.run(bench, walk, task, of_all, keep)

    def positions(self) -> Counts | None:
        """That the drives reported, (N, MAX_AXES) counts; None where an earlier version kept none.

        Of a spoilt segment there are none (``MISSING``), which ``judge`` says from then on. Raises Refused
        where there are none at all.
        """
        found, self._unknown = ACTUAL.read_around(self._file.parent)
        if self._unknown and found is not None and np.all(found == MISSING):
            self._refuse(self._unknown[0])
        return found

    def trace(self, task: Task, bench: SteppedMachine, run: Run, positions: Counts | None) -> Trace:
        """Of the repetition, with ``positions`` of the drives in place of those of the simulated ones."""
        from controller.runtime import replay
        from controller.verify import trace as traces

        rows, machine = run.rows, self.machine
        if positions is not None:
            rows = replay.as_driven(rows, positions, counts_per_unit(machine))
        segments, first = bench.planner.segments, run.first_tick
        return traces.from_rows(rows, machine, task.kinematics, segments, first_tick=first)

    def judge(self, run: Run) -> dict[str, Any]:
        """How much of it came again. Raises Refused where it came out otherwise."""
        wanted = self._wanted
        if wanted is None:
            found = {"recorded_ticks": 0, "compared_ticks": 0, "lacks_turns": False, "off_path": False}
            return {**found, "partial": False, "spoilt": []}
        wanted.finish()
        is_loose = bool(self.recorded.lost)
        if wanted.difference is not None:
            raise self._otherwise(wanted.difference)
        self._refuse_unreadable()
        if run.result != "completed" and self._ended_as() == "completed" and not is_loose:
            raise Refused(
                say(
                    "cli.replay.not_to_end",
                    file=self._file,
                    count=wanted.ticks,
                    result=run.result,
                    causes=say("cli.replay.causes"),
                )
            )
        ticks = min(wanted.ticks, off_path(self.recorded))
        if run.lacks_from is not None:
            ticks = min(ticks, run.lacks_from)
        if wanted.made < ticks and not is_loose:
            raise Refused(
                say(
                    "cli.replay.shorter",
                    file=self._file,
                    made=wanted.made,
                    wanted=ticks,
                    causes=say("cli.replay.causes"),
                )
            )
        return {
            "recorded_ticks": wanted.ticks,
            "compared_ticks": wanted.compared,
            "lacks_turns": run.lacks_from is not None and not is_loose,
            "off_path": off_path(self.recorded) < wanted.ticks,
            "partial": is_loose or bool(wanted.spoilt or self._unknown),
            "spoilt": [
                *(spoilt_json(one, self.machine.period_s, "cli.replay.spoilt") for one in wanted.spoilt),
                *(spoilt_json(one, self.machine.period_s, "cli.replay.positions") for one in self._unknown),
                *self._spoilt_lines(wanted),
            ],
        }

    def _refuse_unreadable(self) -> None:
        """Raises Refused where some of the record is spoilt, and nothing of it could be compared."""
        if self._wanted is not None and self._wanted.spoilt and not self._wanted.compared:
            self._refuse(self._wanted.spoilt[0])

    def _refuse(self, spoilt: Spoilt) -> NoReturn:
        raise Refused(say("cli.replay.unreadable", parent=self._file.parent, why=spoilt.why))

    def _spoilt_lines(self, wanted: Comparison) -> Iterator[dict[str, Any]]:
        """Lines of the events; after the first that is lost the run may be another one from some tick on."""
        ends = min(wanted.made, wanted.ticks) if wanted.lost_from is None else wanted.lost_from
        lost = self.recorded.lost
        for line in self.recorded.spoilt:
            is_first, key = bool(lost) and line is lost[0], "mended" if line.is_mended else "lost"
            from_tick = ends if is_first and ends < wanted.ticks else None
            first = max(0, line.tick) if from_tick is None else from_tick
            end = first if from_tick is None else wanted.ticks
            found = Spoilt(f"{self._file.name}:{line.number}", first, end, line.why)
            key = key if from_tick is None else "lost_from"
            yield spoilt_json(found, self.machine.period_s, f"cli.replay.line_{key}")

    def _otherwise(self, found: Difference) -> Refused:
        """Where, when and by how much."""
        axis = self.machine.axes[found.axis]
        apart = abs((found.again - found.recorded) / axis.counts_per_unit * axis.shown_per_unit)
        unit, at_s = (
            "mm" if axis.kind is Kind.LINEAR else say("unit.degrees"),
            found.tick * self.machine.period_s,
        )
        return Refused(
            say(
                "cli.replay.differs",
                file=self._file,
                tick=found.tick,
                line=found.line,
                at_s=at_s,
                name=axis.name,
                recorded=found.recorded,
                again=found.again,
                apart=apart,
                unit=unit,
                causes=say("cli.replay.causes"),
            ),
            tick=found.tick,
            time_s=at_s,
            line=found.line,
            axis=axis.name,
            difference=apart,
            unit=unit,
        )

    def _ended_as(self) -> str:
        """ "" where nobody lived to write it."""
        return str(record_files.known(self._file.parent).get("result", ""))


def spoilt_json(found: Spoilt, period_s: float, key: str) -> dict[str, Any]:
    """What cannot be read of a record, and when: ``at_s`` and ``until_s`` from the start of the run; ``key``:
    of a text that says so.
    """
    why = in_words(found.why)
    at_s, until_s = found.first * period_s, found.end * period_s
    return {
        "file": found.file,
        "first_tick": found.first,
        "end_tick": found.end,
        "at_s": at_s,
        "until_s": until_s,
        "sentence": say(key, file=found.file, why=why, at_s=at_s, until_s=until_s),
    }


def read(file: Path, machine: Machine, program: bytes) -> RecordedRun | None:
    """The record of a run, None where an operator wrote the file. Raises EventError, and Refused where
    it is of another program or machine.
    """
    found = events.recorded(file, record_files.known(file.parent).get(record_files.COUNT))
    if found is None:
        return None
    for what, wanted, given in (
        ("cli.replay.program", found.begin.program_sha256, (program,)),
        # A machine file is the same with what lies beside it and without, as older versions recorded it.
        (
            "cli.replay.machine",
            found.begin.machine_sha256,
            (machine.text.encode(), written(machine.text).encode()),
        ),
    ):
        if wanted not in [hashlib.sha256(text).hexdigest() for text in given]:
            raise Refused(say("cli.replay.other", file=file, what=say(what)))
    return RecordedRun(file, found, machine, program)


def whole(folder: Path, machine: str | None, program: Path | None) -> RecordedRun:
    """A record with what was run in it; ``machine`` and ``program`` name files to be taken in their place.

    Raises EventError, ConfigError, OSError, and Refused where something of it is missing or of another run.
    """
    file = folder / events.FILE
    if not file.is_file():
        raise Refused(say("cli.replay.no_events", folder=folder, file=events.FILE))
    if machine is not None:
        built = machine_file.load(machine)
    else:
        try:
            own = _part(folder, events.MACHINE, "--machine").decode()
        except UnicodeDecodeError as error:
            raise Refused(say("cli.replay.unreadable", parent=folder / events.MACHINE, why=error)) from error
        built = machine_file.read(own, events.MACHINE, folder)
    text = _part(folder, events.PROGRAM, "--program") if program is None else _linked(program, built)
    found = read(file, built, text)
    if found is None or not found.duration_s:
        raise Refused(say("cli.replay.nothing", folder=folder))
    return found


def _part(folder: Path, name: str, option: str) -> bytes:
    """Raises Refused, and OSError."""
    if not (folder / name).is_file():
        raise Refused(say("cli.replay.no_part", folder=folder, name=name, option=option))
    return own_files.read_bytes(folder / name, shared=True)


def _linked(program: Path, machine: Machine) -> bytes:
    """With the subs of other files, as the service runs it."""
    return linked.linked(program.read_bytes(), linked.beside(program), machine)
