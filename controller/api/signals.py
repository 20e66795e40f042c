"""What a scope shows: signals by name out of the tick's rows, triggers, thinning, and files.

A row is one tick as the recorder keeps it (``live_state.ROW``). Signals are in shown units (mm,
degrees, their configured sense); what is not in a row is made from it: errors, velocities,
accelerations and jerks as differences of neighbouring ticks.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array
from controller.ipc.handoff import of_axes, rows_of
from controller.machine.model import Machine
from controller.state.live_state import COLUMN, SIGNALS
from controller.state.setpoints import SETPOINTS, Counts, commanded

BEFORE = 3  # rows that the highest difference needs ahead of the first one that is wanted
MAX_DIGITS = 9

_OF_AXIS = (("command", ""), ("actual", ""), ("error", ""), ("setpoint", "counts"))
_CHANGES = (("velocity", "/s"), ("acceleration", "/s²"), ("jerk", "/s³"))


@dataclass(frozen=True, slots=True)
class Signals:
    """Rows of ticks, oldest first, shape (N, len(ROW)), of one machine."""

    rows: Array
    machine: Machine

    @property
    def ticks(self) -> NDArray[np.int64]:
        """Number of each tick, shape (N,)."""
        return self.rows[:, COLUMN["tick"]].astype(np.int64)

    def between(self, first: int | None, last: int | None) -> slice:
        """The rows of ticks from ``first`` to ``last``, both included; None: as far as there are any."""
        ticks = self.ticks
        begin = 0 if first is None else int(np.searchsorted(ticks, first))
        end = len(ticks) if last is None else int(np.searchsorted(ticks, last, side="right"))
        return slice(begin, max(begin, end))

    def values(self, name: str, where: slice = slice(None)) -> Array:
        """A signal, shape (n,); NaN where it is not known. Raises KeyError for no such signal."""
        wanted = _maker(name, self.machine)
        begin, end, _ = where.indices(len(self.rows))
        ahead = min(BEFORE, begin)
        return wanted(self.rows[begin - ahead : end])[ahead:]


def names(machine: Machine) -> dict[str, str]:
    """All signals of a machine with their units."""
    found = {}
    for axis in machine.axes:
        unit = "°" if axis.is_rotary else "mm"
        found.update({f"{axis.name}.{name}": fixed or unit for name, fixed in _OF_AXIS})
        found.update({f"{axis.name}.{name}": unit + per for name, per in _CHANGES})
    return {**found, **{name: unit for name, (unit, *_) in SIGNALS.items()}}


def _maker(name: str, machine: Machine) -> Callable[[Array], Array]:
    """How a signal is made of rows. Raises KeyError."""
    if name in SIGNALS:
        _, column, factor = SIGNALS[name]
        return lambda rows: rows[:, COLUMN[column]] * factor
    axis, _, what = name.partition(".")
    axes = [one.name for one in machine.axes]
    if axis not in axes or what not in [known for known, _ in (*_OF_AXIS, *_CHANGES)]:
        raise KeyError(name)
    i = axes.index(axis)
    return partial(_of_axis, i, what, machine.axes[i].shown_per_unit, machine.period_s)


def _of_axis(i: int, what: str, shown: float, period_s: float, rows: Array) -> Array:
    if what == "setpoint":
        return rows[:, COLUMN[f"setpoint_{i}"]].copy()
    command, actual = rows[:, COLUMN[f"joint_command_{i}"]] * shown, rows[:, COLUMN[f"actual_{i}"]] * shown
    if what == "command":
        return command
    if what == "actual":
        return actual
    if what == "error":
        return np.asarray(command - actual)
    order = 1 + [name for name, _ in _CHANGES].index(what)
    return _derivative(command, rows[:, COLUMN["tick"]], order, period_s)


def _derivative(values: Array, ticks: Array, order: int, period_s: float) -> Array:
    """The ``order``-th difference over the period; NaN for the first rows, and after a gap of ticks."""
    for _ in range(order):
        step = np.diff(ticks, prepend=np.nan)
        change = np.diff(values, prepend=np.nan)
        values = np.where(step == 1.0, change / period_s, np.nan)
    return values


# ---- triggers


def crossing(values: Array, level: float, edge: str, begin: int = 1) -> int | None:
    """The first index from ``begin`` at which the trigger fires; None: it does not.

    ``rising``: from below the level to it or beyond; ``falling``: the other way round;
    ``either``; ``change``: any other value than before. What is not known (NaN) never fires.
    """
    if len(values) < 2:
        return None
    old, new = values[:-1], values[1:]
    up, down = (old < level) & (new >= level), (old > level) & (new <= level)
    known = np.isfinite(old) & np.isfinite(new)
    found = {"rising": up, "falling": down, "either": up | down, "change": known & (old != new)}[edge]
    places = np.flatnonzero(found[max(0, begin - 1) :])
    return int(places[0]) + max(1, begin) if len(places) else None


# ---- to be drawn


@dataclass(frozen=True, slots=True)
class Thinned:
    """As many columns as can be drawn; each keeps the lowest and the highest of its ticks."""

    ticks: NDArray[np.int64]  # (M,) the first of each column
    per_column: int
    low: tuple[Array, ...]  # (M,) of each signal
    high: tuple[Array, ...]


def thinned(ticks: NDArray[np.int64], signals: Sequence[Array], most: int) -> Thinned:
    """At most ``most`` columns of equally many ticks: no spike is lost, however far one looks from."""
    n = len(ticks)
    per_column = max(1, -(-n // max(1, most)))
    starts = np.arange(0, n, per_column)
    if per_column == 1 or n == 0:
        same = tuple(np.asarray(values, dtype=float) for values in signals)
        return Thinned(ticks, 1, same, same)
    low = tuple(np.fmin.reduceat(values, starts) for values in signals)
    high = tuple(np.fmax.reduceat(values, starts) for values in signals)
    return Thinned(ticks[starts], per_column, low, high)


def plain(values: Array) -> list[float | None]:
    """For JSON: so many digits as a screen can show, null for what is not known."""
    return [float(f"{v:.{MAX_DIGITS}g}") if np.isfinite(v) else None for v in values]


# ---- files


def csv(found: Signals, wanted: Sequence[str], where: slice, rows: int = 2000) -> Iterator[bytes]:
    """Lines of ``tick,time_s,signals...`` with all digits; an empty field is not known."""
    units = names(found.machine)
    heads = (f"{name} [{units[name]}]" if units[name] else name for name in wanted)
    yield (",".join(("tick", "time_s", *heads)) + "\r\n").encode()
    ticks = found.ticks[where]
    columns = [found.values(name, where) for name in wanted]
    first = ticks[0] if len(ticks) else 0
    for begin in range(0, len(ticks), rows):
        here = slice(begin, begin + rows)
        lines = zip(ticks[here], *(column[here] for column in columns), strict=True)
        yield b"".join(_line(int(t), (t - first) * found.machine.period_s, v) for t, *v in lines)


def _line(tick: int, time_s: float, values: Sequence[float]) -> bytes:
    shown = ("" if np.isnan(value) else repr(float(value)) for value in values)
    return (",".join((str(tick), f"{time_s:.7g}", *shown)) + "\r\n").encode()


def npz(found: Signals, wanted: Sequence[str], where: slice) -> bytes:
    """A file of NumPy: ``tick``, ``period_s``, ``units`` and an array per signal."""
    file = io.BytesIO()
    units = names(found.machine)
    values = {name: found.values(name, where) for name in wanted}
    shown = np.array([units[name] for name in wanted])
    more: dict[str, Any] = {"tick": found.ticks[where], "period_s": found.machine.period_s, "units": shown}
    np.savez_compressed(file, **{**more, **values})
    return file.getvalue()


def rows_of_setpoints(counts: Counts, machine: Machine) -> Array:
    """Rows out of the setpoints of a run, (N, MAX_AXES) counts from its first tick on; all else is NaN."""
    rows = rows_of(SETPOINTS.columns, counts.astype(np.float64))
    rows[:, COLUMN["tick"]] = range(len(rows))
    axes = len(machine.axes)
    rows[:, of_axes("joint_command", axes)] = commanded(rows[:, of_axes("setpoint", axes)], machine)
    return rows
