"""``directrix replay``: a run of a machine in production, made again from its record and compared."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from controller.cli import recorded_runs
from controller.cli.recorded_runs import RecordedRun
from controller.ipc import control_socket
from controller.runtime import checked
from controller.state.record_files import RUNS
from controller.verify.console import (
    AS_ASKED,
    Refused,
    answered,
    bar,
    ended_as_requested,
    refusals,
    say,
    show,
    tell,
)


def replay(
    run: Annotated[str, typer.Argument(metavar="RUN")],
    state: Path | None = None,
    machine: str | None = None,
    program: Path | None = None,
    trace_file: Annotated[Path | None, typer.Option("--trace")] = None,
    as_json: bool = False,
) -> None:
    """Make a recorded run again on the stepped clock, and compare every setpoint bit for bit.

    In it come again: what was set before the start, overrides, holds, retract and return, jogs out of a hold,
    tool changes, a start behind a line, faults, a plan that was killed. No run, and so in no record, are
    homing and jogs between programs: a run begins where they have left the axes. Of a segment of the record
    that is damaged or gone the ticks come again without being compared; it is named.

    Exit code 0: the same setpoints. 1: others, with the first tick, time, axis and difference; or no
    record to be made again. 4: the same setpoints, of a run that was held or stopped before its end.
    """
    with refusals(as_json):
        folder = folder_of(run, state)
        record = recorded_runs.whole(folder, machine, program)
        if trace_file is not None:
            trace_file.open("ab").close()
        figures = {"run": folder.name, **_made_again(record, trace_file, as_json)}
        if figures["result"] in AS_ASKED:
            raise ended_as_requested(figures["result"], in_words(figures), **figures)
        if not answered(as_json, **figures):
            show.print(in_words(figures))


def folder_of(run: str, state: Path | None) -> Path:
    """Of a record. Raises Refused where there is none."""
    if (given := Path(run)).is_dir():
        return given
    where = state or control_socket.state_folder()
    name = _of_number(int(run), where) if run.isdecimal() else run
    if not (found := where / RUNS / name).is_dir():
        raise Refused(say("cli.replay.no_run", run=run, where=where))
    return found


def _of_number(number: int, state: Path) -> str:
    """Name of the record. Raises Refused."""
    import sqlite3

    from controller.store import history

    try:
        with history.reading(state) as past:
            found = past.run(number)
    except FileNotFoundError:
        raise Refused(say("cli.replay.no_store", number=number, state=state)) from None
    except (OSError, sqlite3.Error) as error:
        raise Refused(say("store_unread", file=state, why=error)) from error
    name = str(found.facts.get("record", "")) if found is not None else ""
    if not name:
        raise Refused(say("cli.replay.no_number", number=number, state=state))
    return name


def _made_again(record: RecordedRun, trace_file: Path | None, as_json: bool) -> dict[str, Any]:
    """What came of it. Raises Refused where it is another run."""
    from controller import memory

    memory.keep_freed()
    memory.collect_rarely()
    task = checked.task(record.text, record.name, record.machine)
    if not as_json:
        tell.print(say("cli.replay.title", name=record.name, machine=record.machine.name))
    with bar(say("cli.bar.replaying"), as_json) as progress:
        bench, run = record.repeat(task, progress, keep=trace_file is not None)
    positions = record.positions() if trace_file is not None else None
    figures = record.judge(run)
    if trace_file is not None:
        record.trace(task, bench, run, positions).save(trace_file)
    return {
        "program": record.name,
        "machine": record.machine.name,
        "period_s": record.machine.period_s,
        "result": run.result,
        "line": run.line,
        **figures,
        "trace": str(trace_file) if trace_file is not None else None,
    }


def in_words(figures: dict[str, Any]) -> str:
    """What came of it: how much came again, and why not all."""
    ticks, of = figures["compared_ticks"], figures["recorded_ticks"]
    said = say("cli.replay.same", ticks=ticks, of=of, time=ticks * figures["period_s"])
    for spoilt in figures["spoilt"]:
        said += f" {spoilt['sentence']}"
    if figures["lacks_turns"] or figures["off_path"]:
        said += say("cli.replay.lacks_turns" if figures["lacks_turns"] else "cli.replay.off_path")
    return f"{said} {say('cli.replay.trace', file=figures['trace'])}" if figures["trace"] else said
