"""A run as data: one row per tick, saved as ``.npz``, and what can be measured on it.

The recorder's rows hold joints; the trace adds what the joints mean on the part. It is
computed back from the joints by forward kinematics and not copied from the plan, so an
error of the inverse cannot hide in a trace.

Joints stand here as everywhere outside: mm and degrees in the configured sense, in the
order of the machine file. ``actual`` is what the drives had reported by the tick of its
row; beside the command of the same row it is late by the bus and by the servo.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from controller import npz
from controller.geometry.arrays import Array, columns, distinct
from controller.geometry.passing_place import LOOK_BACK_S, passing
from controller.geometry.placement import Placed
from controller.geometry.vectors import Frame, Number, angle_between, scale, subtract
from controller.ipc.handoff import COLUMN, of_axes, rows_of
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.machine.plain import plain
from controller.messages import TextError, message
from controller.motion.motions import Motion, SurfaceCut
from controller.state.modes import MAX_AXES, Mode

LOOK_AHEAD_TICKS = 2

_NEEDED = {"tick", "mode", "motion_id", "line", "cutting", "s", "feed_mm_s"} | {  # of a recording
    *(f"{name}_{i}" for name in ("joint_command", "setpoint", "actual") for i in range(MAX_AXES)),
}


class HasMotion(Protocol):
    """What a trace needs of a segment of the path."""

    @property
    def motion(self) -> Motion: ...

    def block_u(self, u: Number) -> Number: ...


class TraceError(TextError, ValueError):
    """A file is no trace, or none of this machine: which, and why."""


class Setup(NamedTuple):
    """In which part frame (seen from the table frame) and with which tool a motion runs."""

    part: Frame
    length_mm: float


@dataclass(frozen=True, eq=False)
class Trace:
    """One row per tick from cycle start (row 0); the fields are those of the file."""

    time_s: Array  # (N,)
    joint_command: Array  # (N, axes) before rounding to counts
    joint_setpoint: NDArray[np.int32]  # (N, axes) counts as sent
    joint_actual: Array  # (N, axes)
    tool_tip: Array  # (N, 3) mm, commanded, part frame
    tool_axis: Array  # (N, 3) commanded, part frame
    contact: Array  # (N, 3) mm, part frame; NaN when not cutting
    u: Array  # (N,) of the block's whole surface; NaN when not cutting
    feed_mm_s: Array  # (N,)
    line: NDArray[np.int64]  # (N,) 1-based line of the program, 0 = none
    cutting: NDArray[np.bool_]  # (N,)
    axes: tuple[str, ...]
    period_s: float
    machine: str  # JSON of the whole Machine, its file's text included

    def save(self, path: str | Path) -> None:
        """Write the fields as ``.npz``, whole or not at all; the same trace gives the same bytes."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        values |= {"axes": np.array(self.axes), "period_s": np.float64(self.period_s)}
        new = Path(f"{path}.new")
        try:
            with open(new, "wb") as file:  # a name without .npz stays as it is
                _write(file, values)
            os.replace(new, path)
        finally:
            new.unlink(missing_ok=True)


def _write(file: BinaryIO, values: Mapping[str, Any]) -> None:
    """As ``np.savez_compressed``, in two thirds of its time: rows of a motion hardly shrink."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as npz:
        for name, value in values.items():
            with npz.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(value), allow_pickle=False)


def load(path: str | Path) -> Trace:
    """Read a trace file; TraceError when a field is missing."""
    names = {field.name for field in fields(Trace)}
    values: dict[str, Any] = npz.read(path, names)
    if missing := sorted(names - values.keys()):
        raise TraceError(message("trace.none", path=path, missing=", ".join(missing)))
    values |= {"axes": tuple(map(str, values["axes"])), "machine": str(values["machine"])}
    return Trace(**(values | {"period_s": float(values["period_s"])}))


def of_recording(path: str | Path, machine: Machine, kinematics: Kinematics) -> Trace:
    """The trace of what was kept of a fault (``trace.npz`` in its folder), from its first row on.

    It holds rows of the recorder and no path, so ``contact`` and ``u`` are NaN. Raises ValueError
    for another file, for rows of a version that kept too little and for a machine with another period.
    """
    file = npz.read(path, {"columns", "rows", "period_s"})
    if missing := sorted({"columns", "rows", "period_s"} - file.keys()):
        raise TraceError(message("trace.no_recording", path=path, missing=", ".join(missing)))
    columns, rows, period_s = tuple(map(str, file["columns"])), file["rows"], float(file["period_s"])
    if not set(columns) >= _NEEDED:
        raise TraceError(message("trace.other_version", path=path))
    if period_s != machine.period_s:
        raise TraceError(message("trace.other_period", path=path, found=period_s, machine=machine.period_s))
    rows = rows_of(columns, rows)
    first_tick = int(rows[0, COLUMN["tick"]]) if len(rows) else 0
    return from_rows(rows, machine, kinematics, {}, first_tick=first_tick)


def is_recording(path: str | Path) -> bool:
    """Whether a file holds rows of the recorder. Raises OSError or ValueError where it is no ``.npz``."""
    return "columns" in npz.names(path)


def machine_json(machine: Machine) -> str:
    """A machine as JSON, as ``controller.machine.plain`` has it."""
    return json.dumps(machine, default=plain)


def from_rows(
    rows: Array,
    machine: Machine,
    kinematics: Kinematics,
    segments: Mapping[int, HasMotion],
    setups: Mapping[int, Setup] | None = None,
    first_tick: int | None = None,
) -> Trace:
    """The trace of recorder rows, shape (N, len(ROW)).

    ``segments`` and ``setups`` are by motion id. A surface cut brings its setup itself;
    a motion without one takes that of the cut it leads to, or comes from; a program
    without cuts takes G54 and T1. Row 0 of the trace is ``first_tick``, by default the
    first row of a running machine, so homing stays out.
    """
    rows = rows[_start(rows, first_tick) :]
    axes = len(machine.axes)
    joints = rows[:, of_axes("joint_command", axes)]
    motions = {motion_id: segment.motion for motion_id, segment in segments.items()}
    setup_rows = _setup_rows(rows, motions, setups or {}, machine)
    tip, axis = _on_the_part(joints, kinematics, setup_rows)
    contact, u = _contacts(rows, tip, segments)
    return Trace(
        time_s=(rows[:, COLUMN["tick"]] - rows[:1, COLUMN["tick"]]) * machine.period_s,
        joint_command=joints * _shown_per_unit(machine),
        joint_setpoint=rows[:, of_axes("setpoint", axes)].astype(np.int32),
        joint_actual=rows[:, of_axes("actual", axes)] * _shown_per_unit(machine),
        tool_tip=tip,
        tool_axis=axis,
        contact=contact,
        u=u,
        feed_mm_s=rows[:, COLUMN["feed_mm_s"]].copy(),
        line=rows[:, COLUMN["line"]].astype(np.int64),
        cutting=rows[:, COLUMN["cutting"]] != 0.0,
        axes=tuple(axis.name for axis in machine.axes),
        period_s=machine.period_s,
        machine=machine_json(machine),
    )


def _start(rows: Array, first_tick: int | None) -> int:
    if first_tick is not None:
        return int(np.searchsorted(rows[:, COLUMN["tick"]], first_tick))
    running = np.flatnonzero(rows[:, COLUMN["mode"]] == Mode.RUNNING.value)
    return int(running[0]) if len(running) else len(rows)


def _shown_per_unit(machine: Machine) -> Array:
    return np.array([axis.shown_per_unit for axis in machine.axes])


def _setup_rows(
    rows: Array, motions: Mapping[int, Motion], setups: Mapping[int, Setup], machine: Machine
) -> list[tuple[Setup, NDArray[np.int64]]]:
    """Each setup with the rows that run in it; every row once."""
    ids = rows[:, COLUMN["motion_id"]].astype(np.int64)
    known = dict(setups)
    for motion_id, motion in motions.items():
        if isinstance(motion, SurfaceCut):
            known[motion_id] = Setup(motion.part, motion.length_mm)
    first_tool = machine.tool(1)
    default = Setup(machine.offsets[0], first_tool.length_mm if first_tool else 0.0)
    owners = _owners(ids, known)
    return [(known.get(int(owner), default), np.flatnonzero(owners == owner)) for owner in distinct(owners)]


def _owners(ids: NDArray[np.int64], known: Mapping[int, Setup]) -> NDArray[np.int64]:
    """Per row the motion whose setup it takes: its own, or the next known one, or the last."""
    places = np.flatnonzero(np.isin(ids, list(known)))
    if not len(places):
        return np.full(len(ids), -1)
    following = np.minimum(np.searchsorted(places, np.arange(len(ids))), len(places) - 1)
    return np.asarray(ids[places[following]])


def _on_the_part(
    joints: Array, kinematics: Kinematics, setup_rows: list[tuple[Setup, NDArray[np.int64]]]
) -> tuple[Array, Array]:
    """(tip, axis) of joints in the part frame, each (N, 3)."""
    tip, axis = np.empty((len(joints), 3)), np.empty((len(joints), 3))
    for (part, length_mm), here in setup_rows:
        tips, axes = forward(joints[here], length_mm, kinematics)
        tip[here] = columns(part.from_parent(tuple(tips.T)), len(here))
        axis[here] = columns(part.turn_back(tuple(axes.T)), len(here))
    return tip, axis


def _contacts(rows: Array, tip: Array, segments: Mapping[int, HasMotion]) -> tuple[Array, Array]:
    """(contact (N, 3), u (N,) of its block): back from the tip (Eq. 5); NaN when not cutting."""
    contact, u = np.full((len(rows), 3), np.nan), np.full(len(rows), np.nan)
    ids, cutting = rows[:, COLUMN["motion_id"]], rows[:, COLUMN["cutting"]] != 0.0
    for motion_id, segment in segments.items():
        motion, here = segment.motion, np.flatnonzero((ids == motion_id) & cutting)
        if isinstance(motion, SurfaceCut) and len(here):
            own = motion.arc.u_along(rows[here, COLUMN["s"]])
            contact[here] = tip[here] - _offset(motion, own)
            u[here] = segment.block_u(own)
    return contact, u


def _offset(cut: SurfaceCut, u: Array) -> Array:
    """From the contact to the tip (Eq. 5, or as the cutter is placed), shape (N, 3)."""
    if isinstance(cut.surface, Placed):
        tip = cut.surface.pose(u, cut.offset_mm, np).tip
        return columns(subtract(tip, cut.surface.contact(u, np)), len(u))
    return columns(scale(cut.surface.normal(u, np), cut.offset_mm), len(u))


def forward(joints: Array, length_mm: float, kinematics: Kinematics) -> tuple[Array, Array]:
    """Tips and axes (N, 3) in the table frame from joints (N, axes), mm and rad."""
    pose = kinematics.forward([*joints.T], length_mm, np)
    return columns(pose.tip, len(joints)), columns(pose.axis, len(joints))


# ---- what a trace shows -----------------------------------------------------------


def following_error(trace: Trace) -> Array:
    """Command minus actual of the same tick, (N, axes), mm and degrees: servo and bus together."""
    return np.asarray(trace.joint_command - trace.joint_actual)


def speeds(trace: Trace, machine: Machine) -> Array:
    """Joint speeds of the command as shares of the limits, (N, axes); row 0 is 0."""
    limits = np.array([a.limits.velocity * abs(a.shown_per_unit) for a in machine.axes])
    steps = np.diff(trace.joint_command, axis=0, prepend=trace.joint_command[:1])
    return np.asarray(steps / (trace.period_s * limits))


@dataclass(frozen=True, eq=False)
class PathErrors:
    """How far the real tool is off the commanded path, per row; being late is no path error."""

    path_mm: Array  # (N,) from the actual tip to the nearest point of the commanded tip's path
    axis_deg: Array  # (N,) between the actual axis and the commanded one at that point


def path_errors(trace: Trace, machine: Machine, kinematics: Kinematics, length_mm: float = 0.0) -> PathErrors:
    """Distance of forward(joint_actual) to the path of forward(joint_command), on the table.

    The path is the polyline of the commanded tips within ``LOOK_BACK_S`` before each
    row: where a path comes by the same place twice, only the recent passage counts.
    """
    per_unit = _shown_per_unit(machine)
    n = len(trace.time_s)
    tips, axes = forward(trace.joint_command / per_unit, length_mm, kinematics)
    tip, axis = forward(trace.joint_actual / per_unit, length_mm, kinematics)
    place = passing(tips, tip, int(np.ceil(LOOK_BACK_S / trace.period_s)), LOOK_AHEAD_TICKS).place
    index = np.minimum(place.astype(np.int64), max(n - 2, 0))
    after = np.minimum(index + 1, n - 1)
    share = (place - index)[:, None]
    nearest_tip = tips[index] + share * (tips[after] - tips[index])
    nearest_axis = axes[index] + share * (axes[after] - axes[index])
    angle = angle_between(tuple(nearest_axis.T), tuple(axis.T), np)
    return PathErrors(np.linalg.norm(tip - nearest_tip, axis=1), np.degrees(angle))


@dataclass(frozen=True, slots=True)
class SyncIntervals:
    """Intervals between SYNCs as received on the bus."""

    count: int
    p50_s: float
    p99_s: float
    p999_s: float
    max_s: float
    outside_share: float  # of intervals further than a quarter period from the period


def sync_intervals(stamps_s: Array, period_s: float) -> SyncIntervals:
    """Statistics of receive stamps in seconds, shape (N,); ValueError below two stamps."""
    if len(stamps_s) < 2:
        raise ValueError("Two SYNCs at least make an interval.")
    intervals = np.diff(stamps_s)
    p50, p99, p999 = (float(p) for p in np.percentile(intervals, (50.0, 99.0, 99.9)))
    outside = np.abs(intervals - period_s) > 0.25 * period_s
    return SyncIntervals(len(intervals), p50, p99, p999, float(intervals.max()), float(np.mean(outside)))


@dataclass(frozen=True, slots=True)
class Summary:
    """The figures of a cut, over its cutting ticks."""

    ticks: int
    duration_s: float
    cut_time_s: float
    cut_length_mm: float  # of the contact's path
    following_error: dict[str, float]  # largest, mm or degrees, per axis
    path_error_mm: float
    axis_error_deg: float

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


def summary(trace: Trace, machine: Machine, kinematics: Kinematics, length_mm: float = 0.0) -> Summary:
    """Largest errors while cutting; over the whole trace where nothing is cut."""
    rows = trace.cutting if trace.cutting.any() else np.ones(len(trace.time_s), dtype=bool)
    errors = path_errors(trace, machine, kinematics, length_mm)
    largest = np.abs(following_error(trace)[rows]).max(axis=0)
    return Summary(
        ticks=len(trace.time_s),
        duration_s=len(trace.time_s) * trace.period_s,
        cut_time_s=int(trace.cutting.sum()) * trace.period_s,
        cut_length_mm=cut_length_mm(trace),
        following_error={name: float(v) for name, v in zip(trace.axes, largest, strict=True)},
        path_error_mm=float(errors.path_mm[rows].max()),
        axis_error_deg=float(errors.axis_deg[rows].max()),
    )


def cut_length_mm(trace: Trace) -> float:
    """Length of the contact's path as the sum of its chords, with those of the ticks at both ends of a cut.

    A cut that begins and ends at speed does so within a tick: its share of that tick's step is told by u.
    """
    steps, chords = np.diff(trace.u), np.linalg.norm(np.diff(trace.contact, axis=0), axis=1)
    known = np.concatenate(([False], ~np.isnan(chords), [False])).astype(int)
    first, behind = (np.flatnonzero(np.diff(known) == sign) for sign in (1, -1))
    length = float(np.nansum(chords))
    for step, short in ((first, trace.u[first]), (behind - 1, 1.0 - trace.u[behind])):
        within = (steps[step] > 0.0) & (short <= steps[step])
        length += float((chords[step] * short)[within] @ (1.0 / steps[step][within]))
    return length
