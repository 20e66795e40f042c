"""``directrix export`` and ``directrix compare``: recordings for others' tools, and one beside another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.cli.recorded_runs import spoilt_json
from controller.runtime import records
from controller.runtime.records import Apart, Record
from controller.verify import console
from controller.verify.console import Refused, answered, refusals, show, spoken


def export(
    recording: Path, out: Annotated[Path, typer.Argument(metavar="OUT")], as_json: bool = False
) -> None:
    """Write a recording as Parquet, with units and meanings of its columns: for pandas, Polars, DuckDB ...

    Needs the extra recordings.
    """
    with refusals(as_json):
        if out.suffix != records.PARQUET:
            raise Refused(_say("suffix", file=out))
        found = records.read(recording)
        records.write(found, out, spoken.get())
        spoilt = [spoilt_json(one, found.period_s, "records.spoilt") for one in found.spoilt]
        facts = {"kind": found.kind, "rows": found.rows, "columns": _facts(found)}
        facts |= {"partial": bool(spoilt), "spoilt": spoilt}
        if not answered(as_json, file=str(out), period_s=found.period_s, **facts):
            words = _say("written", file=out, rows=found.rows, columns=len(found.columns))
            show.print(" ".join([words, *(one["sentence"] for one in spoilt)]))


def compare(
    a: Path,
    b: Path,
    tolerance: Annotated[float, typer.Option("--tolerance", min=0.0)] = 0.0,
    as_json: bool = False,
) -> None:
    """Hold two recordings beside each other, row by row from the start of both.

    Exit code 0: the same, within --tolerance. 1: the first row and column that are apart, or another length.
    """
    with refusals(as_json):
        first, second = records.read(a), records.read(b)
        found = records.compare(first, second, tolerance)
        facts: dict[str, Any] = {
            "rows": found.rows,
            "lengths": found.lengths,
            "columns": [one._asdict() for one in found.columns],
            "only": found.only,
            "spoilt": [
                spoilt_json(one, of.period_s, "records.not_compared")
                for of in (first, second)
                for one in of.spoilt
            ],
        }
        if not as_json:
            show.print(_table(found.columns, first, second))
            for one in facts["spoilt"]:
                show.print(one["sentence"])
        if not found.is_same:
            raise Refused(_apart(found, first), **facts)
        if not answered(as_json, **facts):
            show.print(_say("same", rows=found.rows, columns=len(found.columns)))


def _say(key: str, **values: object) -> str:
    return console.say(f"records.{key}", **values)


def _facts(found: Record) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "unit": one.unit,
            "meaning": one.meaning_text(spoken.get()),
            "type": str(one.values.dtype),
        }
        for name, one in found.columns.items()
    ]


def _apart(found: records.Comparison, first: Record) -> str:
    """Where they are first apart."""
    one = found.first
    if one is None:
        return _say("lengths", rows=found.rows, a=found.lengths[0], b=found.lengths[1])
    line = first.columns["line"].values[one.first] if "line" in first.columns else None
    at = _say("in_line", line=int(line)) if line is not None else ""
    time_s = one.first * first.period_s
    return _say("apart", row=one.first, time=time_s, at=at, name=one.name, largest=one.largest, unit=one.unit)


def _table(columns: tuple[Apart, ...], first: Record, second: Record) -> Table:
    table = Table(title=f"{first.kind}, {first.rows}; {second.kind}, {second.rows}", title_justify="left")
    table.add_column(_say("column"))
    for head in ("largest", "at", "first"):
        table.add_column(_say(head), justify="right")
    for one in columns:
        largest = f"{one.largest:.6g} {one.unit}".strip() if one.largest else "0"
        where = f"{one.row}" if one.largest else ""
        table.add_row(one.name, largest, where, f"{one.first}" if one.first >= 0 else "")
    return table
