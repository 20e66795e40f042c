"""What runs a part program, or only reads it: ``directrix check``, ``simulate``, ``demo`` and ``paper``."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, NoReturn

import typer

from controller import messages
from controller.cli import fitted as fittings
from controller.cli import machine_check, workers
from controller.machine import machine_file
from controller.machine.model import Joints, Machine
from controller.motion.motions import SurfaceCut
from controller.plan.report import stored
from controller.plan.report.picture import Picture, Shape
from controller.plan.report.survey import Survey
from controller.plan.segment import Note, Segment
from controller.program import linked
from controller.program import refusals as refusals_of_text
from controller.program.program import ProgramError, refused_on_the_way
from controller.runtime import checked, recording, records, starts
from controller.runtime import events as event_files
from controller.runtime.bus_load import overload
from controller.state import queue_refusals, setpoint_counts
from controller.state.live_state import Snapshot
from controller.state.modes import Fault
from controller.verify import tables, wording
from controller.verify.console import (
    AS_ASKED,
    Refused,
    answered,
    bar,
    ended_as_requested,
    in_words,
    refusals,
    say,
    show,
    spoken,
    tell,
)
from controller.verify.tables import Rows
from controller.workers import Spread, Workers

if TYPE_CHECKING:
    from controller.cli.fault_runs import FaultRun
    from controller.cli.recorded_runs import RecordedRun
    from controller.runtime.simulation import Bench
    from controller.runtime.stepped import Run, SteppedMachine
    from controller.verify.trace import Trace


PARTS = {"cone": "example1_ready", "ruled": "example2_ready"}


# --- what several commands need ------------------------------------------------


def _machine(
    file: str,
    gouge: str | None = None,
    period_ms: float | None = None,
    dialect: str | None = None,
    fitted: Path | None = None,
) -> Machine:
    machine = fittings.laid(machine_file.load(file), fitted)
    machine = replace(machine, dialect=dialect) if dialect else machine
    machine = replace(machine, gouge=gouge) if gouge else machine
    return machine if period_ms is None else machine_file.with_period(machine, period_ms / 1e3)


def _notes(notes: Sequence[Note], machine: Machine) -> dict[str, Any]:
    """What ``check`` and ``simulate`` say with --json of a program and of its machine."""
    told = [note.to_json(spoken.get()) for note in notes]
    return {"notes": told, "warnings": machine_check.warnings(machine)}


def _budget_or_refuse(machine: Machine) -> None:
    if why := overload(machine):
        raise Refused(in_words(why))


def _read(file: Path, machine: Machine) -> bytes:
    if not file.is_file():
        raise Refused(say("cli.program_is_folder" if file.is_dir() else "cli.no_program", program=file))
    return linked.linked(file.read_bytes(), linked.beside(file), machine)


def _writable(*files: Path | None) -> None:
    """Refuse, before anything runs, what could not be written after it. Raises OSError."""
    for file in files:
        if file is not None:
            new = not file.exists()
            file.open("ab").close()
            if new:
                file.unlink()


def _text(program: Path, machine: Machine, block_delete: bool) -> bytes:
    """What is run: the program with the subs of other files, and without lines that are to be left out."""
    text = _read(program, machine)
    return linked.without_deleted(text) if block_delete else text


def _task(program: Path, machine: Machine, block_delete: bool) -> checked.Task:
    return checked.task(_text(program, machine, block_delete), str(program), machine)


def _stored_check(task: checked.Task, store: Path | None, as_json: bool) -> stored.Stored | None:
    """The stored check of what is to be run, if there is a sound one."""
    kept, warning = checked.find(task, store or stored.folder())
    if warning and not as_json:
        tell.print(in_words(messages.plain(warning)))
    return kept


def _length_mm(segments: dict[int, Segment]) -> float:
    """Length of the first tool that cuts: its tip is what the path error is about."""
    lengths = (s.motion.length_mm for s in segments.values() if isinstance(s.motion, SurfaceCut))
    return next(lengths, 0.0)


# --- check ---------------------------------------------------------------------


def check(
    program: Annotated[Path | None, typer.Argument(metavar="[PROGRAM|DIR]")] = None,
    machine: str = "",
    gouge: Literal["refuse", "warn"] | None = None,
    block_delete: bool = False,
    dialect: Literal["rs274", "fanuc"] | None = None,
    fitted: Path | None = None,
    store: Path | None = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="FILE")] = None,
    plot: Path | None = None,
    count: workers.Count = 0,
    cluster: workers.Cluster = "",
    as_json: bool = False,
) -> None:
    """Read, plan and audit a program over its whole path, and store the check; nothing moves.

    The data sheets of the machine's drives are looked at first: what commissioning would refuse is refused.
    """
    from controller import memory

    memory.keep_freed()
    if program is None and not machine:
        raise typer.BadParameter(say("cli.check.name_one"))
    with refusals(as_json):
        made = _machine(machine or "trunnion", gouge, dialect=dialect, fitted=fitted)
        sheets = machine_check.sheets(made, as_json)
        if program is None:
            machine_check.alone(made, sheets, as_json)
            return
        if plot is not None and program.is_dir():
            raise Refused(say("cli.check.plot", plot=plot))
        _writable(plot)
        with Workers(count, cluster) as crew:
            if program.is_dir():
                from controller.cli import check_folder

                place = store or stored.folder()
                asked = check_folder.FolderCheck(program, made, place, block_delete, report)
                check_folder.run(asked, crew.each, as_json)
                return
            if report is not None:
                told = messages.message("folder.report_alone", program=program)
                raise Refused(in_words(told))
            task = _task(program, made, block_delete)
            picture = Picture(made, task.kinematics) if plot is not None else None
            try:
                done = _checked(task, store, as_json, crew.each, picture)
            except Refused as refusal:
                if plot is not None:
                    _draw_refused(task, refusal, plot)
                raise
        if plot is not None and picture is not None:
            _draw_check(program, task, done, picture.shape(), plot)
        if as_json:
            _print_check(program, task, done, sheets, fitted)
        else:
            _show_check(program, task, done, fitted)


class _Check(NamedTuple):
    """What came of a check: its figures, its blocks, as it is stored, and why it is not ("" = it is)."""

    survey: Survey
    rows: Rows
    kept: stored.Stored
    warning: messages.Message | str


def _draw_check(program: Path, task: checked.Task, done: _Check, shape: Shape, plot: Path) -> None:
    from controller.verify import pictures

    title = f"{program.name} on {task.machine.name}"
    named = pictures.marks((note.place.line for note in done.kept.notes), refused=False)
    pictures.check_picture(done.survey, done.rows.longest, shape, task.machine, named, title, plot)


def _draw_refused(task: checked.Task, refusal: Refused, plot: Path) -> None:
    """The path of what is refused, as far as it can be seen."""
    from controller.runtime import refused_path
    from controller.verify import pictures

    if (shape := refused_path.shape_of(task)) is not None:
        named = pictures.marks(refused_path.guilty_lines(refusal.facts, task.name), refused=True)
        pictures.refused_path(shape, task.machine, named, str(refusal).partition("\n")[0], plot)


def check_of(program: Path, task: checked.Task, as_json: bool) -> dict[str, Any]:
    """Checks a program, stores the check and shows its tables, and gives its figures. Raises Refused."""
    from controller.workers import here

    done = _checked(task, None, as_json, here)
    if not as_json:
        _show_check(program, task, done, None)
    return _facts(program, task, done)


def _facts(program: Path, task: checked.Task, done: _Check) -> dict[str, Any]:
    """What a check says with --json, but for its blocks."""
    kept = done.kept
    return {
        **{"ok": True, "program": str(program), **done.survey.to_dict()},
        "overcuts": [asdict(one) for one in kept.overcuts],
        "verdict": messages.with_sentences(checked.verdict_of(kept), spoken.get()),
        **_notes(kept.notes, task.machine),
        "stored": None if done.warning else task.key,
    }


def _print_check(
    program: Path, task: checked.Task, done: _Check, sheets: list[str], fitted: Path | None
) -> None:
    """One JSON object."""
    facts = {**_facts(program, task, done), "sheets": sheets, "fitted": fittings.names(fitted)}
    done.rows.write(facts, sys.stdout)


def _show_check(program: Path, task: checked.Task, done: _Check, fitted: Path | None) -> None:
    """Tables; what the data sheets say was shown before."""
    survey, kept = done.survey, done.kept
    if names := fittings.names(fitted):
        tell.print(fittings.sentence(names))
    _show_notes(kept.notes, task)
    if done.rows.longest:
        show.print(tables.blocks(done.rows))
    if survey.tools:
        show.print(tables.tools(survey))
    if survey.holes:
        show.print(tables.holes(survey))
    if survey.joints:
        show.print(tables.joints(survey))
    if done.warning:
        tell.print(in_words(messages.plain(done.warning)))
    show.print(tables.whole(survey, program.name, task.machine.name))
    if kept.overcuts:
        form = in_words(wording.summed(kept.verdicts))
        show.print(form or tables.overcut(kept.overcuts))


def _checked(
    task: checked.Task, store: Path | None, quiet: bool, spread: Spread, picture: Picture | None = None
) -> _Check:
    lines, rows = max(1, task.text.count(b"\n")), Rows()
    try:
        with bar(say("cli.bar.planning"), quiet) as progress:
            found, kept, warning = checked.check(
                task,
                store or stored.folder(),
                rows.take,
                lambda line: progress(line / lines),
                watch=picture.watched if picture is not None else iter,
                spread=spread,
            )
    except ProgramError as error:
        _refuse_all(error, task, quiet)
    return _Check(found, rows, kept, warning)


def _refuse_all(first: ProgramError, task: checked.Task, quiet: bool) -> NoReturn:
    """All refusals of a text in one answer, each with its line; of those of its path the first alone."""
    language = spoken.get()
    found = refusals_of_text.of(task.text, task.machine, task.name, task.start)
    if not found or str(found[0]) != str(first):
        found = [first]
    lines = refusals_of_text.lines_of(task.text, task.name)
    most = 1 if quiet else refusals_of_text.MAX_REPORTED
    told = [refusals_of_text.pointed(one, lines, language) for one in found[:most]]
    if len(found) > 1 and not quiet:
        told.append(messages.text(refusals_of_text.summed(found), language))
    sentence = messages.text(first.placed, language) if quiet else "\n".join(told)
    place = {"file": first.file, "line": first.line, "column": first.column}
    raise Refused(
        sentence, **place, **first.said, **refusals_of_text.facts(found, lines, task.name), **first.facts
    )


def _show_notes(notes: Sequence[Note], task: checked.Task) -> None:
    for sentence in machine_check.warnings(task.machine):
        tell.print(sentence)
    for note in notes:
        sentence = in_words(note.said)
        tell.print(f"{task.name}:{note.place.line}:{note.place.column}: {sentence}")


# --- simulate ------------------------------------------------------------------


def simulate(
    program: Path,
    machine: str = "trunnion",
    period_ms: float | None = None,
    gouge: Literal["refuse", "warn"] | None = None,
    block_delete: bool = False,
    dialect: Literal["rs274", "fanuc"] | None = None,
    fitted: Path | None = None,
    trace_file: Annotated[Path | None, typer.Option("--trace")] = None,
    events: Path | None = None,
    faults: Path | None = None,
    faults_from: Literal["program", "home"] = "program",
    plot: Path | None = None,
    part: Path | None = None,
    touches: Path | None = None,
    store: Path | None = None,
    unchecked: bool = False,
    as_json: bool = False,
) -> None:
    """Run a program on the stepped clock, with bus and simulated drives, as fast as it can."""
    from controller import memory

    memory.keep_freed()
    memory.collect_rarely()
    from controller.cli import fault_runs, recorded_runs
    from controller.runtime.contour_error import Demands
    from controller.runtime.stepped import SteppedMachine

    with refusals(as_json):
        made = _machine(machine, gouge, period_ms, dialect, fitted)
        script = fault_runs.read(faults, faults_from, made)
        _budget_or_refuse(made)
        record = recorded_runs.read(events, made, _text(program, made, block_delete)) if events else None
        requests = event_files.read(events) if events and record is None else ()
        task = _task(program, record.machine if record is not None else made, block_delete)
        outputs = _Outputs(trace_file, plot, touches)
        outputs.check()
        kept = None if unchecked else _stored_check(task, store, as_json)
        walk = _walk(task, kept, record, unchecked, as_json)
        touched = _touched(part, task.machine)
        bench = SteppedMachine(task.machine, recordings=recording.folder(), bench=touched)
        under = fault_runs.FaultRun(bench, script, faults_from)
        memory.collect_rarely()  # machine and path stay to the end
        demands = Demands(task.read(), bench.planner.segments, task.machine)
        watch = bench.watch_contour(demands, acts=record is None)  # what a record has of it comes again
        joints = _up(bench, under, record)
        walk = walk if record is not None else checked.walk_from(task, walk, joints, unchecked)
        before = bench.board.read()
        run, took_s = _run(bench, under, walk, task, requests, record, kept, as_json)
        figures = {
            **_figures(task, "refused" if bench.planner.error else run.result, run.fault, unchecked),
            **_run_figures(run, outputs.write(run, bench, task), task, bench.planner.segments, took_s),
            "contour_error": watch.to_dict(),
            "setpoints": (counts := _setpoint_counts(task.machine, before, bench.board.read())),
            **_notes(walk.notes, task.machine),
            **under.facts(),
        }
        for excess in () if as_json else watch.excesses:
            tell.print(in_words(excess.sentence(task.machine)))
        for axis, count in () if as_json else counts.items():
            for kind in ("missed", "overdue"):
                if count[kind]:
                    tell.print(say("setpoints." + kind, axis=axis, number=count[kind]))
        if script is not None and not as_json:
            fault_runs.show(figures["faults"])
        _end_run(run, bench.planner.error, record, under, figures, as_json)


def _setpoint_counts(
    machine: Machine, before: Snapshot | None, after: Snapshot | None
) -> dict[str, dict[str, Any]]:
    names = [axis.name for axis in machine.axes]
    return {} if before is None or after is None else setpoint_counts.between(names, before, after)


class _Outputs(NamedTuple):
    """The files that a run on the stepped clock is to leave."""

    trace: Path | None
    plot: Path | None
    touches: Path | None

    def check(self) -> None:
        """Before anything runs. Raises Refused, OSError."""
        _writable(*self)
        if self.trace and self.trace.suffix == records.PARQUET:
            records.needed()

    def write(self, run: Run, bench: SteppedMachine, task: checked.Task) -> Trace:
        """The trace, which the figures are taken from, too."""
        from controller.verify import trace as traces

        machine, planner = task.machine, bench.planner
        trace = traces.from_rows(
            run.rows, machine, task.kinematics, planner.segments, first_tick=run.first_tick
        )
        _write(trace, machine, planner.segments, self.trace, self.plot)
        if self.touches is not None:
            from controller.runtime import touch_table

            touch_table.write(self.touches, planner.touches, machine)
        return trace


def _walk(
    task: checked.Task, kept: stored.Stored | None, record: RecordedRun | None, unchecked: bool, as_json: bool
) -> checked.Walk:
    """The path of the program, or what is left of it where a recorded run began; its notes are shown."""
    try:
        with bar(say("cli.bar.planning"), as_json) as progress:
            walk = (
                starts.path_from(task, kept, record.recorded.begin.start)
                if record
                else checked.walk_of(task, kept, unchecked, progress)
            )
    except ProgramError as error:
        _refuse_all(error, task, as_json)
    if not as_json:
        _show_notes(walk.notes, task)
    return walk


def _up(bench: SteppedMachine, under: FaultRun, record: RecordedRun | None) -> Joints:
    """The drives homed and enabled, at a record's begin where there is one; the joints there."""
    under.come_up()
    if record is not None:
        record.stand(bench)
    return bench.joints


def _run(
    bench: SteppedMachine,
    under: FaultRun,
    walk: checked.Walk,
    task: checked.Task,
    requests: Sequence[event_files.Event],
    record: RecordedRun | None,
    kept: stored.Stored | None,
    as_json: bool,
) -> tuple[Run, float]:
    """What came of it, and how long it took (s): the program or the record run to its end."""
    under.begin()
    began_s = time.perf_counter()
    with bar(say("cli.bar.simulating"), as_json) as progress:
        passed = lambda s: progress(_share(s, kept))  # noqa: E731
        run = record.run(bench, walk, task, passed) if record else bench.run(walk, requests, passed)
    return run, time.perf_counter() - began_s


def _end_run(
    run: Run,
    refusal: ProgramError | None,
    record: RecordedRun | None,
    under: FaultRun,
    figures: dict[str, Any],
    as_json: bool,
) -> None:
    if record is not None:  # a fault that comes again is what was asked for
        figures = {**figures, **record.judge(run)}
        if run.result in AS_ASKED:
            raise ended_as_requested(run.result, **figures, line=run.line)
        _end("table.replayed", figures, as_json)
        return
    if run.fault is not Fault.NONE:  # also a hold that waits for somebody to close a door
        raise under.ended(run.fault_text, **figures)
    if refusal is not None:
        why = refused_on_the_way(refusal.placed)
        place = {"line": refusal.line, "column": refusal.column}
        raise Refused(in_words(why), **figures, **place)
    if run.result in AS_ASKED:
        raise ended_as_requested(run.result, **figures, line=run.line)
    if run.result != "completed":
        why = messages.several(
            messages.message("ended.stuck", line=run.line), queue_refusals.refusal_message(run.refusal)
        )
        raise Refused(in_words(why), **figures, line=run.line)
    _end("table.simulated", figures, as_json)


def _figures(task: checked.Task, result: str, fault: Fault, unchecked: bool) -> dict[str, Any]:
    """The first figures of a run, of whatever clock."""
    return {
        "program": task.name,
        "machine": task.machine.name,
        "period_s": task.machine.period_s,
        "result": result,
        "fault": fault.name if fault is not Fault.NONE else None,
        "checked": not unchecked,
    }


def _run_figures(
    run: Run, trace: Trace, task: checked.Task, segments: dict[int, Segment], took_s: float
) -> dict[str, Any]:
    """What came of a run on the stepped clock."""
    from controller.verify import trace as traces

    machine = task.machine
    return {
        **traces.summary(trace, machine, task.kinematics, _length_mm(segments)).to_dict(),
        "binds": [bound.to_dict() for bound in tables.bound_in(run.rows, machine)],
        "skips": run.skips,
        "assumed_resumes": run.assumed_resumes,
        "events_left": run.events_left,
        "wall_time_s": took_s,
        "times_real_time": len(trace.time_s) * machine.period_s / took_s,
    }


def _end(title: str, figures: dict[str, Any], as_json: bool) -> None:
    if not answered(as_json, **figures):
        show.print(tables.figures(title, figures))


def _touched(part: Path | None, machine: Machine) -> Bench | None:
    """What the probe of a simulated machine finds."""
    if part is None:
        return None
    from controller.runtime import simulation

    return simulation.bench(part, machine)


def _share(seconds: float, kept: stored.Stored | None) -> float:
    """Of a run: exact where the duration is known from the check."""
    return seconds / max(kept.duration_s, 1e-3) if kept else seconds / (seconds + 10.0)


def _write(
    trace: Any, machine: Machine, segments: dict[int, Segment], trace_file: Path | None, plot: Path | None
) -> None:
    if trace_file and trace_file.suffix == records.PARQUET:
        records.write(records.of_trace(trace), trace_file, spoken.get())
    elif trace_file:
        trace.save(trace_file)
    if plot:
        from controller.verify import pictures

        pictures.cut_picture(trace, machine, segments, plot)


# --- demo ----------------------------------------------------------------------


def demo(
    part: Literal["cone", "ruled"] = "cone",
    out: Path = Path("demo"),
    store: Path | None = None,
    unchecked: bool = False,
    period_ms: float = 5.0,
    panel: bool = False,
    port: Annotated[int, typer.Option("--port", min=1, max=65535)] = 8080,
    as_json: bool = False,
) -> None:
    """Cut one of the paper's parts in real time on the virtual bus, with simulated drives."""
    if panel:
        from controller.cli import demo_panel

        with refusals(as_json):
            demo_panel.run(out / "panel", port, period_ms, as_json)
        return
    with refusals(as_json):
        out.mkdir(parents=True, exist_ok=True)
        made = _machine("trunnion", period_ms=period_ms)
        # Simulated drives take no harm from late ticks; a machine stops for them.
        _demo(part, out, replace(made, late="count"), store, unchecked, as_json)


def _demo(part: str, out: Path, made: Machine, store: Path | None, unchecked: bool, as_json: bool) -> None:
    from controller.cli import demo as demos
    from controller.verify import trace as traces

    file = machine_file.shipped_program(PARTS[part])
    picture, trace_file = out / f"{part}.png", out / f"{part}.npz"
    _writable(picture, trace_file)
    if not as_json:
        tell.print(say("cli.demo.starting", name=file.name, machine=made.name))
    cut = demos.cut(made, file, store or stored.folder(), unchecked, as_json)
    task = checked.task(file.read_bytes(), file.name, made)
    kept = None if unchecked else _stored_check(task, store, as_json)
    segments = checked.segments(checked.walk_of(task, kept, unchecked))
    trace = traces.from_rows(cut.rows, made, task.kinematics, segments)
    _write(trace, made, segments, trace_file, picture)
    stamps = cut.sync_stamps_s.items()
    figures = {
        **_figures(task, cut.result, cut.fault, unchecked),
        "program": str(file),
        **traces.summary(trace, made, task.kinematics, _length_mm(segments)).to_dict(),
        "binds": [bound.to_dict() for bound in tables.bound_in(cut.rows, made)],
        "planned_s": kept.duration_s if kept else None,
        "skips": cut.skips,
        "sync": {name: asdict(traces.sync_intervals(s, made.period_s)) for name, s in stamps},
        "picture": str(picture),
        "trace": str(trace_file),
    }
    if cut.sentence:
        raise (
            ended_as_requested(cut.result, **figures)
            if cut.result in AS_ASKED
            else Refused(cut.sentence, **figures)
        )
    _end("table.live", figures, as_json)
    if not as_json:
        show.print(f"Picture: {picture}   Trace: {trace_file}")


# --- paper ---------------------------------------------------------------------


def paper(as_json: bool = False) -> None:
    """The paper's comparison, computed: off-line chords, its first-order step, and ours."""
    from controller.verify import paper as comparisons
    from controller.verify import tables

    with refusals(as_json):
        with bar(say("cli.bar.computing"), as_json) as progress:
            comparison = comparisons.compare(machine_file.load("trunnion"), progress)
        if not answered(as_json, **comparison.to_dict()):
            tables.paper(comparison, show.console)
