"""What was recorded, as named columns with units: read from every form that Directrix writes, and Parquet.

    simulate --trace t.npz          "trace": setpoints, positions and the tool on the part, from cycle start
    a folder of a fault, its .npz   "recording": the recorder's rows, the last seconds before it and the stop
    a folder of a run               "run": setpoints, positions, following errors, feed and load of every tick
                                    that sent a SYNC

A column of an axis has its name after a dot (``actual.X``). Names, units and meanings of a recorder's
columns are those of ``state.live_state``. In Parquet they stand with each column (``unit``, ``meaning``),
and ``kind``, ``period_s`` and the machine (a trace: its JSON, else its file's text) with the whole under
``directrix.``, so that whoever opens the file needs nothing else; numbers are the same to the last bit.
Meanings are texts of the catalogue (``column.``), in a file they are words of one language.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller import npz
from controller.machine import machine_file
from controller.machine.model import Kind
from controller.messages import DEFAULT, Key, Message, TextError, message, plain, text
from controller.runtime import events
from controller.state.live_state import FIELDS, Field
from controller.state.record_files import TRACE
from controller.state.setpoints import (
    ACTUAL,
    MISSING,
    PROCESS,
    SETPOINTS,
    Counts,
    Spoilt,
    counts_per_unit,
    process_values,
)
from controller.verify import trace as traces

Array = NDArray[Any]

PARQUET = ".parquet"
PREFIX = "directrix."  # of what stands with the whole file


class Column(NamedTuple):
    """Values (N,) of one quantity."""

    values: Array
    unit: str
    meaning: Message | str  # words where it is read from a file that has them

    def meaning_text(self, language: str) -> str:
        """The meaning of its values, in words of a language."""
        return text(plain(self.meaning), language)


class Record(NamedTuple):
    """What was recorded, a row a tick."""

    kind: str  # 'trace', 'recording', 'run'
    columns: Mapping[str, Column]
    period_s: float
    machine: str
    spoilt: tuple[Spoilt, ...] = ()  # of a run: ticks that cannot be read, in which its values are NaN

    @property
    def rows(self) -> int:
        return min((len(column.values) for column in self.columns.values()), default=0)


class NoRecord(TextError):
    """What a file is not, or cannot be read without."""

    def __init__(self, key: str, **values: object) -> None:
        super().__init__(message(f"records.{key}", **values))


def read(path: Path) -> Record:
    """Any of them. Raises NoRecord, and OSError."""
    if path.is_dir():
        return _of_folder(path)
    try:
        if path.suffix == PARQUET:
            return _of_parquet(path)
        values = npz.read(path)
    except NoRecord:
        raise
    except FileNotFoundError:
        raise
    except Exception as error:  # what np.load and pyarrow raise is not theirs to tell an operator
        raise NoRecord("unreadable", path=path, why=error) from error
    if "columns" in values:
        return _of_recording(path, values)
    if "joint_setpoint" in values:
        return of_trace(traces.load(path))
    raise NoRecord("neither", path=path, names=", ".join(sorted(values)))


def _of_folder(folder: Path) -> Record:
    if (folder / TRACE).is_file():
        return read(folder / TRACE)
    rows, spoilt = SETPOINTS.read_around(folder)
    if rows is None or not (folder / events.MACHINE).is_file():
        raise NoRecord("no_folder", folder=folder, trace=TRACE, run=SETPOINTS.whole, machine=events.MACHINE)
    (actual, of_actual), (process, of_process) = (
        table.read_around(folder, len(rows)) for table in (ACTUAL, PROCESS)
    )
    if all(one.first == 0 and one.end == len(rows) for one in spoilt) and spoilt:
        raise NoRecord("unreadable", path=folder, why=spoilt[0].why)
    machine = (folder / events.MACHINE).read_text(encoding="utf-8")
    begun = events.recorded(folder / events.FILE)
    period_s = begun.begin.period_s if begun is not None else None
    setpoints = _floats(rows)
    columns = _named(SETPOINTS.columns, setpoints, machine)
    built = machine_file.read(machine, events.MACHINE)
    if actual is not None and len(actual) == len(rows):
        per_unit = counts_per_unit(built)
        columns |= _named(ACTUAL.columns, _floats(actual) / per_unit, machine)
        errors = (setpoints - _floats(actual)) / per_unit
        for i, axis in enumerate(built.axes):
            unit = columns[f"actual.{axis.name}"].unit
            meaning = _part("following_error", axis.name)
            columns[f"following_error.{axis.name}"] = Column(errors[:, i], unit, meaning)
    if process is not None and len(process) == len(rows):
        columns |= _named(PROCESS.columns, process_values(process), machine)
    return Record("run", columns, period_s or built.period_s, machine, (*spoilt, *of_actual, *of_process))


def _floats(counts: Counts) -> Array:
    """NaN where a segment is spoilt."""
    return np.where(counts == MISSING, np.nan, counts)


def _of_recording(path: Path, values: Mapping[str, Array]) -> Record:
    try:
        names, rows = tuple(map(str, values["columns"])), values["rows"]
        machine, period_s = str(values["machine"]), float(values["period_s"])
    except KeyError as error:
        raise NoRecord("lacks", path=path, name=error.args[0]) from error
    return Record("recording", _named(names, rows, machine), period_s, machine)


def _named(names: tuple[str, ...], rows: Array, machine: str) -> dict[str, Column]:
    """The recorder's columns by name and axis; those of axes that the machine has not are left out."""
    axes = machine_file.read(machine, events.MACHINE).axes
    place, found = {name: i for i, name in enumerate(names)}, dict[str, Column]()
    for field in (field for field in FIELDS if field.value.column):
        for i, name in enumerate(field.columns):
            if name not in place or (field.is_of_axes and i >= len(axes)):
                continue
            values, value = rows[:, place[name]], field.value
            if field.is_of_axes:
                unit = ("mm" if axes[i].kind is Kind.LINEAR else "rad") if "rad" in value.unit else value.unit
                named = f"{value.column}.{axes[i].name}"
                found[named] = Column(_typed(values, field), unit, _part(value.column, axes[i].name))
            else:
                found[name] = Column(_typed(values, field), value.unit, message(f"column.{name}"))
    return found


def _typed(values: Array, field: Field) -> Array:
    """As declared: a recorder has floats alone. What is missing somewhere (NaN) stays as it is."""
    if field.type is float or not np.isfinite(values).all():
        return np.asarray(values, dtype=np.float64)
    return values != 0.0 if field.type is bool else values.astype(np.int64)


def _part(name: str, part: str) -> Message:
    """The meaning of what is of one axis, or of one part of a vector."""
    return message("column.part", meaning=Key(f"column.{name}"), part=part)


OF_TRACE = {  # and their units; positions of axes have their own
    "time_s": "s",
    "joint_command": "",
    "joint_setpoint": "counts",
    "joint_actual": "",
    "tool_tip": "mm",
    "tool_axis": "",
    "contact": "mm",
    "u": "",
    "feed_mm_s": "mm/s",
    "line": "",
    "cutting": "",
}
SHORT = {"joint_setpoint": "setpoint", "joint_actual": "actual"}  # as the recorder calls them


def of_trace(trace: traces.Trace) -> Record:
    """The columns of a trace; positions of rotary axes are degrees."""
    return Record("trace", dict(_columns_of(trace)), trace.period_s, trace.machine)


def _columns_of(trace: traces.Trace) -> Iterator[tuple[str, Column]]:
    rotary = {axis["name"]: axis["kind"] != Kind.LINEAR.value for axis in json.loads(trace.machine)["axes"]}
    for name, unit in OF_TRACE.items():
        values = getattr(trace, name)
        if values.ndim == 1:
            yield name, Column(values, unit, message(f"column.trace.{name}"))
            continue
        of_axes = name.startswith("joint_")
        for i, part in enumerate(trace.axes if of_axes else "XYZ"):
            own = unit or (("deg" if rotary[part] else "mm") if of_axes else "")
            yield f"{SHORT.get(name, name)}.{part}", Column(values[:, i], own, _part(f"trace.{name}", part))


# ---- Parquet ------------------------------------------------------------------------


def needed() -> Any:
    """pyarrow. Raises NoRecord without it: to be asked before an hour of work, not after it."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise NoRecord("no_pyarrow") from None
    return pyarrow


def write(record: Record, path: Path, language: str = DEFAULT) -> None:
    """Into a Parquet file, whole or not at all; ``language``: of the meanings.

    Raises NoRecord without pyarrow, and OSError.
    """
    arrow = needed()
    fields = []
    for name, one in record.columns.items():
        told = {"unit": one.unit, "meaning": one.meaning_text(language)}
        fields.append(arrow.field(name, arrow.from_numpy_dtype(one.values.dtype), True, told))
    facts = {"kind": record.kind, "period_s": repr(record.period_s), "machine": record.machine}
    schema = arrow.schema(fields, {f"{PREFIX}{name}": fact for name, fact in facts.items()})
    arrays = [arrow.array(one.values) for one in record.columns.values()]
    new = path.with_name(f"{path.name}.new")
    try:
        arrow.parquet.write_table(arrow.Table.from_arrays(arrays, schema=schema), new, compression="zstd")
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


def _of_parquet(path: Path) -> Record:
    table = needed().parquet.read_table(path)
    facts = {key.decode(): fact.decode() for key, fact in (table.schema.metadata or {}).items()}
    try:
        kind, period_s, machine = (facts[f"{PREFIX}{name}"] for name in ("kind", "period_s", "machine"))
    except KeyError as error:
        raise NoRecord("lacks", path=path, name=error.args[0]) from error
    columns = {}
    for field in table.schema:
        told = {key.decode(): fact.decode() for key, fact in (field.metadata or {}).items()}
        values = table.column(field.name).to_numpy()
        columns[field.name] = Column(values, told.get("unit", ""), told.get("meaning", ""))
    return Record(kind, columns, float(period_s), machine)


# ---- two of them --------------------------------------------------------------------


class Apart(NamedTuple):
    """How far one column is apart; ``first``: the first row where it is more than is allowed, -1 = none."""

    name: str
    unit: str
    largest: float
    row: int  # of the largest
    first: int


class Comparison(NamedTuple):
    """Of the columns that both have, over the rows that both have."""

    rows: int
    lengths: tuple[int, int]
    columns: tuple[Apart, ...]
    only: tuple[tuple[str, ...], tuple[str, ...]]  # columns of one alone

    @property
    def first(self) -> Apart | None:
        """The column that is apart first."""
        apart = [one for one in self.columns if one.first >= 0]
        return min(apart, key=lambda one: one.first, default=None)

    @property
    def is_same(self) -> bool:
        return self.first is None and self.lengths[0] == self.lengths[1]


PER = {("deg", "rad"): np.pi / 180.0, ("rad", "deg"): 180.0 / np.pi}
# Of the computer and not of the motion, or counted from elsewhere.
NOT_HELD = ("tick", "time_s", "lateness_s", "request", "accepted", "bus_share")


def compare(a: Record, b: Record, tolerance: float = 0.0) -> Comparison:
    """Row by row from the first of both, but for what is spoilt of one. Raises NoRecord where none of one
    stands beside one of the other.
    """
    if a.period_s != b.period_s:
        raise NoRecord("periods", a=1e3 * a.period_s, b=1e3 * b.period_s)
    common = [name for name in a.columns if name in b.columns and name not in NOT_HELD]
    if not common:
        raise NoRecord("nothing_common")
    rows = min(a.rows, b.rows)
    is_spoilt = np.zeros(rows, dtype=bool)
    for one in (*a.spoilt, *b.spoilt):
        is_spoilt[one.first : one.end] = True
    found = tuple(_apart(n, a.columns[n], b.columns[n], is_spoilt, tolerance) for n in common)
    only = (
        tuple(name for name in a.columns if name not in b.columns),
        tuple(name for name in b.columns if name not in a.columns),
    )
    return Comparison(rows, (a.rows, b.rows), found, only)


def _apart(name: str, a: Column, b: Column, is_spoilt: Array, tolerance: float) -> Apart:
    rows = len(is_spoilt)
    x, y = a.values[:rows].astype(np.float64), b.values[:rows].astype(np.float64)
    if a.unit != b.unit:
        if (b.unit, a.unit) not in PER:
            raise NoRecord("units", name=name, a=a.unit or "1", b=b.unit or "1")
        y = y * PER[b.unit, a.unit]
    both = (np.isnan(x) & np.isnan(y)) | is_spoilt
    off = np.where(both, 0.0, np.abs(x - y))
    off = np.where(np.isnan(off), np.inf, off)
    if not rows:
        return Apart(name, a.unit, 0.0, 0, -1)
    worst = int(off.argmax())
    beyond = np.flatnonzero(off > tolerance)
    return Apart(name, a.unit, float(off[worst]), worst, int(beyond[0]) if len(beyond) else -1)
