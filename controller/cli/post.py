"""``directrix post``: a program as a CAM system would have written it, and both in one table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from controller import atomic_file
from controller.cli import new_files
from controller.geometry.arrays import Array
from controller.machine import machine_file
from controller.machine.model import Tool
from controller.motion.motions import SurfaceCut
from controller.plan.report import survey
from controller.plan.segment import PathItem
from controller.post.chords import Form, poses
from controller.post.text import PostOptions, post
from controller.program import blocks, linked
from controller.program.program import CutBlock
from controller.runtime import checked
from controller.verify import passes, tables
from controller.verify.audit import Watched
from controller.verify.console import Refused, answered, bar, refusals, say, show
from controller.verify.judge import Zone, judge
from controller.verify.nominal import Nominal
from controller.verify.sweep import Pass

LONGER_MM = 0.2  # of the cutter's end, for the comparison
SAME_MM = 0.02  # a tip so near to the nearest is there, too
FEWEST_ROWS = 4  # of a pass: a cubic needs four
OURS = "rulings"


Ends = Mapping[int, tuple[Array, Array]]


@dataclass(frozen=True, slots=True)
class Row:
    """One way to say the same part."""

    form: str
    file: str
    lines: int
    size: int  # bytes
    duration_s: float
    overcut_mm: float
    undercut_mm: float

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def post_(
    program: Path,
    chord: float = 0.01,
    out: Path | None = None,
    overwrite: bool = False,
    exact: bool = False,
    machine: str = "trunnion",
    as_json: bool = False,
) -> None:
    """Write a program as five-axis G1 lines within a chord tolerance, and compare the two."""
    with refusals(as_json):
        if not 0.0 < chord < math.inf:
            raise Refused(say("cli.not_above_0", name="--chord", value=chord))
        if not program.is_file():
            raise Refused(say("cli.no_program", program=program))
        stem = out or program
        files = {form: stem.with_name(f"{stem.stem}_{form.value}.ngc") for form in Form}
        for file in files.values():
            new_files.target(file, overwrite, "--out")
        made = machine_file.load(machine)
        whole = linked.linked(program.read_bytes(), linked.beside(program), made)
        task = checked.task(whole, str(program), made)
        with bar(say("cli.bar.comparing"), as_json) as progress:
            rows, texts = _compared(task, files, chord, exact, progress)
        for file, text in texts.items():
            atomic_file.write(file, text)
        if not answered(as_json, chord_mm=chord, rows=[row.to_dict() for row in rows]):
            show.print(_table(program, chord, exact, rows))


@dataclass(frozen=True, slots=True)
class _Whole:
    """A program planned to its end."""

    watched: Watched
    items: list[PathItem]
    duration_s: float


def _planned(task: checked.Task) -> _Whole:
    walk = checked.path_of(task, checked.chosen_for(task))
    watched = Watched(walk.items)
    items: list[PathItem] = []

    def collected() -> Any:
        for item in watched:
            items.append(item)
            yield item

    found = survey.survey(collected(), task.machine, task.kinematics)
    return _Whole(watched, items, found.duration_s)


def _compared(
    task: checked.Task, files: Mapping[Form, Path], chord: float, exact: bool, progress: Any
) -> tuple[list[Row], dict[Path, str]]:
    ours = _planned(task)
    fitted = passes.Fitted.of(blocks.stream(task.text, task.machine, task.name), task.machine)
    surfaces = passes.nominals(ours.watched.segments, fitted)
    ends = _ends(ours, fitted, task)
    rows = [_row(OURS, task, ours, surfaces, ends)]
    progress(0.3)
    texts = {}
    for k, (form, file) in enumerate(files.items()):
        asked = PostOptions(task.machine, task.kinematics, form, chord, _offset(task), not exact)
        text = post(ours.items, zip(fitted.orders, fitted.tools, strict=True), asked)
        again = checked.task(text.encode(), str(file), task.machine)
        texts[file] = text
        rows.append(_row(form.value, again, _planned(again), surfaces, ends))
        progress(0.3 + 0.35 * (k + 1))
    return rows, texts


def _ends(whole: _Whole, fitted: passes.Fitted, task: checked.Task) -> Ends:
    """Where the tip is at the first and the last pose of each cut, table frame."""
    found = {}
    for number, one in whole.watched.segments.items():
        if isinstance(one.motion, SurfaceCut):
            length = fitted.at(one.place.order).length_mm
            tips = poses(np.array([one.start, one.end]), length, task.kinematics)[0]
            found[number] = (tips[0], tips[1])
    return found


def _offset(task: checked.Task) -> int:
    cuts = (b for b in blocks.stream(task.text, task.machine, task.name) if isinstance(b, CutBlock))
    return next((block.modal.offset for block in cuts), 0)


def _row(form: str, task: checked.Task, whole: _Whole, surfaces: list[Nominal], ends: Ends) -> Row:
    """What is read and planned by the controller's own reader and planner, against the same surfaces."""
    fitted = passes.Fitted.of(blocks.stream(task.text, task.machine, task.name), task.machine)
    ways = passes.planned(whole.watched.segments, surfaces, fitted, task.kinematics)
    zones = [_inside(one, *ends[one.motion], ways) for one in surfaces]
    over = max((-z.overcut.mm for z in zones if z.overcut), default=0.0)
    under = max((z.undercut.mm for z in zones if z.undercut), default=0.0)
    lines = len([line for line in task.text.splitlines() if line.strip() not in (b"", b"%")])
    return Row(form, task.name, lines, len(task.text), whole.duration_s, over, under)


def _inside(surface: Nominal, start: Array, end: Array, ways: Mapping[Tool, list[Pass]]) -> Zone:
    """A surface without its ends, under what is moved at feed from its first pose to its last.

    The cutter is taken a little longer than it is: lines lift its end by their tolerance, and the lip
    that this leaves at the lower edge is no matter of the surface.
    """
    cuts = {
        tool: [
            replace(one, name="cut", line=surface.line, tips=one.tips - LONGER_MM * one.axes)
            for one in _between(row, start, end)
        ]
        for tool, row in ways.items()
    }
    return judge([surface], cuts)[0].inside


def _between(row: Sequence[Pass], start: Array, end: Array) -> Iterator[Pass]:
    """The parts of feed passes from where the tip is first at ``start`` to where it is last at ``end``."""
    feeding = [one for one in row if one.feeding]
    if not feeding:
        return
    away = [np.linalg.norm(np.concatenate([one.tips for one in feeding]) - at, axis=1) for at in (start, end)]
    near = [np.flatnonzero(one <= one.min() + SAME_MM) for one in away]
    first, last = near[0][0], near[1][-1]
    count = 0
    for one in feeding:
        rows = slice(max(0, first - count), max(0, last + 1 - count))
        count += len(one.s)
        if len(one.s[rows]) >= FEWEST_ROWS:
            yield replace(one, s=one.s[rows], tips=one.tips[rows], axes=one.axes[rows])


def _table(program: Path, chord: float, exact: bool, rows: list[Row]) -> Table:
    how = "G61" if exact else f"G64 P{chord:g}"
    heads = ("written_as", "lines", "bytes", "time", "overcut_um", "undercut")
    table = tables.headed("table.posted", heads, ("written_as",), program=program.name, chord=chord, how=how)
    for row in rows:
        table.add_row(
            say(f"table.form.{row.form}"),
            str(row.lines),
            str(row.size),
            f"{row.duration_s:.2f} s",
            f"{1e3 * row.overcut_mm:.1f}",
            f"{1e3 * row.undercut_mm:.1f}",
        )
    return table
