"""``directrix check DIR``: every part program of a folder, in one table, one report and one exit code."""

from __future__ import annotations

import html
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, overload

from rich.table import Table
from rich.text import Text

from controller import messages
from controller.cli import internal_error
from controller.machine.model import Machine
from controller.messages import Message, message, reason
from controller.plan.report.stored import Stored
from controller.plan.report.survey import Survey
from controller.program import linked, refusals
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.verify import console, wording
from controller.verify.console import Refused, answered, bar, in_words, say, show, spoken, tell
from controller.workers import Spread

SUFFIXES = (".ngc", ".nc", ".tap", ".cnc", ".gcode")
STATES = ("passed", "refused", "failed", "subs")
PROGRAM_S = 0.5  # that one takes, about


@dataclass(frozen=True, slots=True)
class Job:
    """A program to be checked; without its text where the file could not be read, and why."""

    name: str
    text: bytes
    wrong: Message | str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """What came of one."""

    name: str
    state: str  # of STATES
    said: Any  # what is said of it; None: nothing
    line: int = 0
    column: int = 0
    survey: Survey | None = None
    kept: Stored | None = None
    key: str = ""

    def to_dict(self) -> dict[str, Any]:
        found: dict[str, Any] = {"program": self.name, "state": self.state, **messages.facts(self.said)}
        if self.said is not None:
            found["sentence"] = in_words(self.said)
        if self.line:
            found |= {"line": self.line, "column": self.column}
        if self.survey is not None and self.kept is not None:
            found |= {"duration_s": self.survey.duration_s, "blocks": self.survey.blocks}
            found |= {"cuts_mm": self.survey.cuts_mm, "overcut_mm": self.overcut_mm, "stored": self.key}
            found["notes"] = [one.to_json(spoken.get()) for one in self.kept.notes]
        return found

    @property
    def is_wrong(self) -> bool:
        return self.state in ("refused", "failed")

    @property
    def overcut_mm(self) -> float:
        """The deepest of all surfaces, as it is placed and by its own cut."""
        return max((one.mm for one in self.kept.overcuts), default=0.0) if self.kept is not None else 0.0


def files(folder: Path) -> list[Path]:
    """The part programs of a folder and of those in it, by name; not those that are hidden."""
    found = [
        Path(at, name)
        for at, inner, names in os.walk(folder)
        if not inner.sort()
        for name in names
        if name.lower().endswith(SUFFIXES) and not name.startswith(".")
    ]
    return sorted(
        one for one in found if not any(part.startswith(".") for part in one.relative_to(folder).parts)
    )


class _Jobs(Sequence[Job]):
    """Programs that are read when it is their turn."""

    def __init__(self, folder: Path, found: Sequence[Path], machine: Machine, block_delete: bool) -> None:
        self._folder, self._found = folder, found
        self._machine, self._block_delete = machine, block_delete

    def __len__(self) -> int:
        return len(self._found)

    @overload
    def __getitem__(self, k: int) -> Job: ...
    @overload
    def __getitem__(self, k: slice) -> Sequence[Job]: ...
    def __getitem__(self, k: int | slice) -> Job | Sequence[Job]:
        if isinstance(k, slice):
            return [self[i] for i in range(len(self))[k]]
        file = self._found[k]
        name = str(file.relative_to(self._folder))
        try:
            text = linked.linked(file.read_bytes(), linked.beside(file), self._machine)
        except OSError as error:
            return Job(name, b"", reason(error))
        return Job(name, linked.without_deleted(text) if self._block_delete else bytes(text))


def jobs(folder: Path, machine: Machine, block_delete: bool = False) -> Sequence[Job]:
    """The programs of a folder, to be checked."""
    return _Jobs(folder, files(folder), machine, block_delete)


def examined(machine: Machine, job: Job) -> Row:
    """One program checked as ``check`` does it; nothing is stored, and whatever is wrong is in the row."""
    if job.wrong:
        return Row(job.name, "failed", message("could_not_check", program=job.name, why=job.wrong))
    if linked.only_subs(job.text):
        return Row(job.name, "subs", message("folder.only_subs"))
    try:
        task = checked.task(job.text, job.name, machine)
        survey, kept = checked.looked_at(task)
    except ProgramError as error:
        return _refused(error, task)
    except Exception as error:  # the others are checked all the same
        why = internal_error.sentence(error)
        return Row(job.name, "failed", message("could_not_check", program=job.name, why=why))
    return Row(job.name, "passed", wording.summed(kept.verdicts), survey=survey, kept=kept, key=task.key)


def _refused(error: ProgramError, task: checked.Task) -> Row:
    more = len(refusals.of(task.text, task.machine, task.name, task.start)) - 1
    told = message("folder.more", sentence=error.placed, more=more) if more > 0 else error.placed
    return Row(task.name, "refused", told, error.line, error.column)


@dataclass(frozen=True, slots=True)
class FolderCheck:
    """A folder, and how it is to be checked."""

    folder: Path
    machine: Machine
    store: Path
    block_delete: bool
    report: Path | None


def run(asked: FolderCheck, spread: Spread, as_json: bool) -> None:
    """All of a folder. Raises Refused where a program is, or none is there."""
    found = jobs(asked.folder, asked.machine, asked.block_delete)
    if not found:
        raise Refused(_say("none", folder=asked.folder, suffixes=" ".join(SUFFIXES)))
    if asked.report is not None:
        asked.report.open("ab").close()  # what cannot be written is found out before, not after an hour
    rows, warning = _rows(asked, found, spread, as_json)
    if asked.report is not None:
        asked.report.write_text(page(rows, asked.folder, asked.machine), encoding="utf-8")
    facts = {**_counts(rows), "machine": asked.machine.name, "warning": warning}
    if as_json:
        facts["programs"] = [row.to_dict() for row in rows]
    else:
        show.print(_table(rows))
        for row in rows:
            if row.is_wrong:
                tell.print(in_words(row.said))
        if warning:
            tell.print(warning)
        if asked.report is not None:
            show.print(_say("written", file=asked.report))
    if any(row.is_wrong for row in rows):
        raise Refused(_summed(rows), **facts)
    if not answered(as_json, **facts):
        show.print(_summed(rows))


def _rows(asked: FolderCheck, found: Sequence[Job], spread: Spread, quiet: bool) -> tuple[list[Row], str]:
    """What came of each, and a warning where checks could not be stored, or ""."""
    rows, warning, wrong = list[Row](), "", 0
    with bar(say("cli.bar.checking"), quiet) as progress:
        for row in spread(partial(examined, asked.machine), found, PROGRAM_S):
            if row.kept is not None:
                unkept = checked.keep(row.kept, row.key, asked.store)
                warning = in_words(messages.plain(unkept)) if unkept else warning
            rows.append(row)
            wrong += row.is_wrong
            progress(len(rows) / len(found), f"{len(rows)}/{len(found)} ({wrong}) {row.name}")
    return rows, warning


def _counts(rows: Sequence[Row]) -> dict[str, Any]:
    return {state: sum(row.state == state for row in rows) for state in STATES}


def _summed(rows: Sequence[Row]) -> str:
    counts = _counts(rows)
    return _say("summed", count=len(rows) - counts["subs"], **counts)


def _say(key: str, **values: object) -> str:
    return console.say(f"folder.{key}", **values)


COLUMNS = ("program", "verdict", "time", "blocks", "surfaces", "overcut")
RIGHT = ("time", "blocks", "surfaces", "overcut")


def _cells(row: Row) -> tuple[str, ...]:
    """Of a row of the table and of the report."""
    if row.survey is None:
        return row.name, _say(row.state), *("",) * 4
    minutes, seconds = divmod(round(row.survey.duration_s), 60)
    cuts = len(row.survey.cuts_mm)
    overcut = f"{1e3 * row.overcut_mm:.1f} µm" if cuts else ""
    return row.name, _say(row.state), f"{minutes}:{seconds:02d}", str(row.survey.blocks), str(cuts), overcut


def _table(rows: Sequence[Row]) -> Table:
    table = Table()
    for column in COLUMNS:
        table.add_column(_say(column), justify="right" if column in RIGHT else "left", overflow="fold")
    for row in rows:
        table.add_row(*map(Text, _cells(row)))
    return table


# ---- the report -------------------------------------------------------------------

_OF_REPORT = (*COLUMNS, "said")
STYLE = """
body { font: 15px/1.4 system-ui, sans-serif; margin: 2rem; color: #1c2024; background: #fff }
table { border-collapse: collapse; width: 100% }
th, td { text-align: left; padding: .35rem .7rem; border-bottom: 1px solid #d8dde3; vertical-align: top }
.time, .blocks, .surfaces, .overcut { text-align: right; white-space: nowrap }
td { font-variant-numeric: tabular-nums }
.program { font-family: ui-monospace, monospace }
tr.refused .verdict, tr.failed .verdict { color: #a40000; font-weight: 600 }
tr.passed .verdict { color: #00692b }
thead th { position: sticky; top: 0; background: #fff }
@media (prefers-color-scheme: dark) {
  body, thead th { color: #e6e9ec; background: #15181b } th, td { border-color: #33393f }
  tr.refused .verdict, tr.failed .verdict { color: #ff8f8f } tr.passed .verdict { color: #6fdc9b }
}
"""


def page(rows: Sequence[Row], folder: Path, machine: Machine) -> str:
    """A page that needs nothing else; the same folder, machine and version give the same bytes."""
    title = html.escape(_say("title", folder=folder.name or folder, machine=machine.name))
    head = "".join(f'<th scope="col" class="{name}">{html.escape(_say(name))}</th>' for name in _OF_REPORT)
    return (
        f'<!doctype html>\n<html lang="{spoken.get()}"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width"><title>{title}</title>'
        f"<style>{STYLE}</style></head>\n"
        f"<body><h1>{title}</h1>\n<p>{html.escape(_summed(rows))}</p>\n<table><thead><tr>{head}</tr></thead><tbody>\n"
        f"{''.join(map(_html_row, rows))}</tbody></table></body></html>\n"
    )


def _html_row(row: Row) -> str:
    cells = zip(_OF_REPORT, (*_cells(row), in_words(row.said)), strict=True)
    inner = "".join(f'<td class="{name}">{html.escape(text)}</td>' for name, text in cells)
    notes = row.kept.notes if row.kept is not None else ()
    said = [f"{row.name}:{one.place.line}: {in_words(one.said)}" for one in notes]
    told = "".join(f"<li>{html.escape(one)}</li>" for one in said)
    more = f'<tr class="notes"><td></td><td colspan="6"><ul>{told}</ul></td></tr>\n' if told else ""
    return f'<tr class="{row.state}">{inner}</tr>\n{more}'
