"""``directrix verify``: the surface as cut against the nominal one, from the plan or from a trace."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer
from rich.table import Table

from controller import messages
from controller.cli import workers
from controller.machine import machine_file
from controller.machine.model import Machine, Tool
from controller.plan.report.verdict import Verdict
from controller.plan.segment import Note, Segment
from controller.program import blocks, linked
from controller.program.program import Block, Place
from controller.runtime import checked, events
from controller.state.record_files import TRACE
from controller.verify import passes, tables, trace, wording
from controller.verify.audit import Watched, findings_of
from controller.verify.console import Refused, bar, in_words, refusals, say, show, spoken, tell
from controller.verify.gouges import Findings, Gouge, gouges, in_table
from controller.verify.judge import SETTLED_MM, Judged, Worst, Zone, judge
from controller.verify.nominal import Nominal
from controller.verify.sweep import FIT_MM, Pass
from controller.workers import Spread, Workers, here

if TYPE_CHECKING:
    from controller.verify.bound import Bound


MAX_ROWS = 40  # of the table
MAX_SURFACES = 1000  # of a run, that are listed
BOUND_S = 5.0  # that the search for one surface takes, about


@dataclass(frozen=True, slots=True)
class Verification:
    """Everything that is reported of a program or of a trace."""

    of: str  # 'plan', 'actual', 'commanded'
    judged: list[Judged]
    gouges: list[Gouge]
    ends: list[Gouge]  # what twist costs beside the ends of cuts
    verdicts: list[Verdict]  # on the surfaces that have a form tolerance
    notes: list[Note]
    bounds: list[Bound] | None = (
        None  # of the surfaces that are placed off their rulings; None: not asked for
    )

    @property
    def exceeding(self) -> int:
        """How many surfaces exceed their tolerance."""
        return sum(not one.within for one in self.verdicts)

    @property
    def wrong(self) -> str:
        """The first gouge, or else the surface that exceeds its tolerance most."""
        if not self.gouges:
            told = messages.several(wording.summed(self.verdicts) or "", _others(self.exceeding - 1))
        else:
            first = self.gouges[0]
            told = first.with_advice("gouge.one", line=first.by_line, more=_others(len(self.gouges) - 1))
        return in_words(told)

    def to_dict(self, machine: Machine) -> dict[str, Any]:
        return {
            "of": self.of,
            "machine": machine.name,
            "accuracy_mm": {"settled": SETTLED_MM, "poses": FIT_MM},
            "table": machine.table is not None,
            "surfaces": [one.to_dict() for one in self.judged],
            "gouges": _gouges_json(self.gouges),
            "ends": _gouges_json(self.ends),
            "verdict": messages.with_sentences(wording.to_json(self.verdicts), spoken.get()),
            **({"bounds": [one.to_dict() for one in self.bounds]} if self.bounds is not None else {}),
            "notes": [note.to_json(spoken.get()) for note in self.notes],
        }


def _others(count: int) -> messages.Message | str:
    return messages.message("gouge.others", more=count) if count else ""


def _gouges_json(gouges: Sequence[Gouge]) -> list[dict[str, Any]]:
    return [{**one.to_dict(), "sentence": in_words(one.message)} for one in gouges]


def verify(
    file: Path,
    program: Path | None = None,
    machine: str = "trunnion",
    commanded: bool = False,
    gouge: Literal["refuse", "warn"] | None = None,
    plot: Path | None = None,
    with_bound: Annotated[bool, typer.Option("--bound")] = False,
    count: workers.Count = 0,
    cluster: workers.Cluster = "",
    as_json: bool = False,
) -> None:
    """Compute the surface as cut: overcut and undercut along the normal, gouges, collisions."""
    with refusals(as_json):
        recorded: trace.Trace | None = None
        spoilt: list[dict[str, Any]] = []
        if (file / events.FILE).is_file():
            task, recorded, spoilt = _run_again(file, as_json)
            made = task.machine
        else:
            made = machine_file.load(machine)
            file = file / TRACE if (file / TRACE).is_file() else file
            part = _part(file, program, commanded)
            text = linked.linked(part.read_bytes(), linked.beside(part), made)
            task = checked.task(text, str(part), made)
            recorded = None if part is file else _recorded(file, task)
        task = _lenient(task)
        refuses = (gouge or made.gouge) == "refuse"
        with Workers(count, cluster) as crew:
            with bar(say("cli.bar.verifying"), as_json) as progress:
                found = _found(task, recorded, commanded, progress, crew.each)
            if with_bound:
                with bar(say("cli.bar.searching"), as_json) as progress:
                    found = replace(found, bounds=_bounds(found.judged, progress, crew.each))
        if plot:
            from controller.verify import pictures

            name = Path(task.name).name
            pictures.deviations(found.judged, plot, f"{name}, {found.of}, on {made.name}")
        figures = {"program": task.name, **found.to_dict(made), "partial": bool(spoilt), "spoilt": spoilt}
        bad = refuses and bool(found.gouges or found.exceeding)
        if as_json and not bad:
            print(json.dumps({"ok": True, **figures}))
            return
        if not as_json:
            show_found(found)
            for one in spoilt:
                show.print(one["sentence"])
        if bad:
            raise Refused(f"{task.name}: {found.wrong}", **figures)


def of_run(folder: Path) -> dict[str, Any]:
    """A recorded run as its drives have cut it: verdict, how many gouges, and each surface in mm.

    Raises Refused, TextError, ConfigError, ProgramError, OSError.
    """
    task, recorded, spoilt = _run_again(folder, as_json=True)
    found = _found(_lenient(task), recorded, False, lambda _: None, here)
    surfaces = [
        {
            "line": one.nominal.line,
            "overcut_mm": -_mm(one.whole.overcut),
            "undercut_mm": _mm(one.whole.undercut),
        }
        for one in found.judged[:MAX_SURFACES]
    ]
    told = {"verdict": wording.to_json(found.verdicts), "gouges": len(found.gouges), "surfaces": surfaces}
    return {**told, "partial": bool(spoilt)}


def judged(task: checked.Task, as_json: bool) -> Verification:
    """A program as it is planned. Raises ProgramError."""
    with bar(say("cli.bar.verifying"), as_json) as progress:
        return _found(_lenient(task), None, False, progress, here)


def _lenient(task: checked.Task) -> checked.Task:
    """What gouges is to be seen here, not refused before it is."""
    return replace(task, machine=replace(task.machine, gouge="warn"))


def _mm(worst: Worst | None) -> float:
    return worst.mm if worst is not None else 0.0


def _run_again(folder: Path, as_json: bool) -> tuple[checked.Task, trace.Trace, list[dict[str, Any]]]:
    """What was run, and the trace of it: the record made again, with the positions that the drives reported;
    and what of the record is spoilt: there they are where they were told.

    Raises Refused where it comes out otherwise, or holds no positions.
    """
    from controller.cli import recorded_runs

    record = recorded_runs.whole(folder, None, None)
    positions = record.positions()
    if positions is None:
        raise Refused(say("cli.replay.no_positions", parent=folder))
    task = checked.task(record.text, record.name, record.machine)
    with bar(say("cli.bar.replaying"), as_json) as progress:
        bench, run = record.repeat(task, progress)
    spoilt = record.judge(run)["spoilt"]
    return task, record.trace(task, bench, run, positions), spoilt


def _part(file: Path, program: Path | None, commanded: bool) -> Path:
    """The program: ``file`` itself, unless that is a trace."""
    is_trace = file.suffix == ".npz"
    part = program if is_trace else file
    if part is None:
        raise Refused(say("cli.verify.no_program", file=file))
    if not is_trace and (program is not None or commanded):
        raise Refused(say("cli.verify.no_trace", file=file))
    for one in (file, part):
        if not one.is_file():
            raise Refused(say("cli.verify.folder" if one.is_dir() else "cli.verify.no_file", file=one))
    return part


def _recorded(file: Path, task: checked.Task) -> trace.Trace:
    try:
        if trace.is_recording(file):
            return trace.of_recording(file, task.machine, task.kinematics)
        return trace.load(file)
    except (ValueError, KeyError) as error:
        raise Refused(say("cli.verify.unreadable", file=file, why=error)) from error


def _found(
    task: checked.Task, recorded: trace.Trace | None, commanded: bool, progress: Any, spread: Spread
) -> Verification:
    checked.place_ahead(task, spread)
    walk = checked.path_of(task, checked.chosen_for(task, lambda share: progress(0.1 * share)))
    watched = Watched(walk.items)
    for _ in watched:
        pass
    fitted = passes.Fitted.of(_blocks(task), task.machine)
    surfaces = passes.nominals(watched.segments, fitted)
    ways = _ways(task, recorded, commanded, watched.segments, surfaces, fitted)
    judged = judge(surfaces, ways, lambda share: progress(0.1 + 0.7 * share), spread)
    last = lambda share: progress(0.8 + 0.2 * share)  # noqa: E731
    if recorded is None:
        seen = findings_of(watched.segments, fitted, task.machine, task.kinematics, last, spread)
    else:
        seen = _findings_of_trace(recorded, task, commanded, surfaces, ways, last, spread)
    left = [one.nominal.line for one in judged if recorded is not None and one.inside.uncut == 1.0]
    notes = [
        *walk.notes,
        *([] if surfaces else [Note(Place(1, 1), messages.message("note.no_surface"))]),
        *[Note(Place(line, 1), messages.message("note.not_cut")) for line in left],
    ]
    of = "plan" if recorded is None else "commanded" if commanded else "actual"
    verdicts = [one for one in seen.verdicts if one.line not in left]
    return Verification(of, judged, seen.gouges, seen.ends, verdicts, notes)


def _findings_of_trace(
    recorded: trace.Trace,
    task: checked.Task,
    commanded: bool,
    surfaces: Sequence[Nominal],
    ways: Mapping[Tool, list[Pass]],
    progress: Any,
    spread: Spread,
) -> Findings:
    """Gouges and verdicts of a recorded run; those of a plan are ``findings_of``."""
    errors_mm = 0.0 if commanded else _errors_mm(recorded, task, ways)
    seen = gouges(surfaces, ways, task.machine.max_overcut_mm, progress, errors_mm, spread)
    table = in_table(task.machine.table, [(tool, one) for tool, rows in ways.items() for one in rows])
    return replace(seen, gouges=sorted([*seen.gouges, *table], key=lambda one: one.by_line))


def _bounds(judged: Sequence[Judged], progress: Any, spread: Spread) -> list[Bound]:
    """What each surface could be cut to, by a search that shares nothing with the planner's."""
    from controller.verify.bound import bound  # what it takes of scipy takes 0.3 s to import

    found = []
    for k, one in enumerate(spread(bound, [one.nominal for one in judged], BOUND_S)):
        found.append(one)
        progress((k + 1) / len(judged))
    return [one for one in found if one is not None]


def _blocks(task: checked.Task) -> Iterator[Block]:
    return blocks.stream(task.text, task.machine, task.name, start=task.start)


def _ways(
    task: checked.Task,
    recorded: trace.Trace | None,
    commanded: bool,
    segments: Mapping[int, Segment],
    surfaces: Sequence[Nominal],
    fitted: passes.Fitted,
) -> Mapping[Tool, list[Pass]]:
    """Where each tool went: as planned, or as the drives did it."""
    if recorded is None:
        return passes.planned(segments, surfaces, fitted, task.kinematics)
    axes = tuple(axis.name for axis in task.machine.axes)
    if recorded.axes != axes:
        ours, theirs = " ".join(axes), " ".join(recorded.axes)
        raise Refused(say("cli.verify.other_axes", theirs=theirs, ours=ours))
    return passes.traced(recorded, task.machine, fitted, task.kinematics, not commanded)


def _errors_mm(recorded: trace.Trace, task: checked.Task, ways: Mapping[Tool, list[Pass]]) -> float:
    """How far the drives were off the path they were told, at the tip and at the top of the longest tool."""
    errors = trace.path_errors(recorded, task.machine, task.kinematics)
    top_mm = max((tool.length_mm + tool.flute_mm for tool in ways), default=0.0)
    tilted = np.radians(errors.axis_deg) * top_mm
    return float((errors.path_mm + tilted).max(initial=0.0))


# ---- for people --------------------------------------------------------------------


def show_found(found: Verification) -> None:
    """The table of the surfaces, gouges, bounds and verdicts."""
    for note in found.notes:
        tell.print(say("table.note", line=note.place.line, note=note.said))
    if found.judged:
        show.print(_table(found))
    for one in found.gouges:
        _show_gouge(one, "gouge.on_line")
    for one in found.ends:
        _show_gouge(one, "gouge.overcut_on_line")
    for bounded in found.bounds or ():
        show.print(say("cli.verify.bound", line=bounded.line, sentence=bounded.sentence))
    if found.bounds == []:
        show.print(say("table.no_bound"))
    if sentence := in_words(wording.summed(found.verdicts)):
        show.print(sentence)


def _show_gouge(one: Gouge, key: str) -> None:
    show.print(in_words(one.with_advice(key, line=one.by_line)))


def _table(found: Verification) -> Table:
    heads = ("line", "where", "overcut_um", "undercut", "mean", "percentile", "worst_at")
    of = messages.Key(f"table.of_{found.of}")
    table = tables.headed("table.judged", heads, left=("where", "worst_at"), of=of)
    for one in found.judged[:MAX_ROWS]:
        line = str(one.nominal.line)
        for where, zone in (("inside", one.inside), ("ends", one.ends), ("with_all", one.whole)):
            table.add_row(line, say(f"table.{where}"), *_figures(zone))
            line = ""
    if len(found.judged) > MAX_ROWS:
        table.caption = say("table.more_surfaces", more=len(found.judged) - MAX_ROWS)
    return table


def _figures(zone: Zone) -> tuple[str, ...]:
    worst = max((zone.overcut, zone.undercut), key=lambda one: abs(one.mm) if one else 0.0)
    return (
        _micro(-zone.overcut.mm if zone.overcut else 0.0),
        _micro(zone.undercut.mm if zone.undercut else 0.0),
        _micro(zone.mean_mm),
        _micro(zone.percentiles_mm["99"]),
        ", ".join(filter(None, (_at(worst), say("table.uncut", share=zone.uncut) if zone.uncut else ""))),
    )


def _at(worst: Worst | None) -> str:
    return f"u {worst.u:.3f} v {worst.v:.2f}" if worst else ""


def _micro(mm: float) -> str:
    return f"{1e3 * mm:.1f}"
