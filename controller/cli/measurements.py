"""What a measurement comes to: one function for each of ``calibration.measurements``, of plain values.

``directrix calibrate`` calls them, and ``measure_worker`` for the panel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np

from controller.calibration import (
    DOFS,
    axis_accuracy,
    circular_test,
    features,
    five_axis_test,
    machine_edit,
    part_fit,
    pictures,
    positions,
    rotary_fit,
    rotary_report,
    touch_table,
)
from controller.calibration.refusal import Refusal
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import unit
from controller.machine.kinematics import kinematics_of
from controller.machine.model import OFFSETS, Machine
from controller.plan.surfaces.cuts import surface_of
from controller.program import blocks
from controller.program.program import CutCone, CutNurbs, CutRuled
from controller.runtime import checked
from controller.verify import maps
from controller.verify import trace as traces
from controller.verify.audit import Watched

Values = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Inputs:
    """What is evaluated; ``values`` as ``measurements.complete`` gives them."""

    machine: Machine
    values: Values
    table: str = ""  # CSV
    file: str = ""  # its name
    recording: Path | None = None
    text: bytes = b""  # of the program with all that it calls
    program: str = ""  # its name


@dataclass(frozen=True, slots=True)
class Result:
    """What is reported; the edit of a machine file; a picture (PNG), drawn into a file."""

    told: dict[str, Any]
    edit: Callable[[str], str] | None = None
    draw: Callable[[Path | IO[bytes]], None] | None = None


def rotaries(asked: Inputs) -> Result:
    """Raises Refusal."""
    made, values = asked.machine, asked.values
    touches = touch_table.read(asked.table, made, asked.file)
    fit = rotary_fit.fit(touches, made, values["sphere_radius"])
    sphere = positions.Sphere(fit.sphere_mm, fit.radius_mm)
    probe = positions.Probe(float(touches.length_mm[0]), float(touches.radius_mm[0]))
    add = values["add"]
    advice = positions.advise(fit.machine, sphere, probe, add, done=touches) if add else None
    told = rotary_report.report(fit, made, advice)
    rotary_report.refuse_large(told, values["max_mm"], values["max_deg"])
    return Result(told, lambda text: machine_edit.rotaries(text, fit.machine))


def to_probe(asked: Inputs) -> Result:
    """Positions of the rotaries, and what bounds they would leave. Raises Refusal."""
    made, values = asked.machine, asked.values
    x, y, z = (values[f"centre_{axis}"] for axis in "xyz")
    i, j, k = (values[f"stem_{axis}"] for axis in "ijk")
    sphere = positions.Sphere((x, y, z), values["sphere_radius"], unit((i, j, k)))
    probe = positions.Probe(values["length"], values["ball_radius"])
    advice = positions.advise(made, sphere, probe, values["count"])
    axes = [made.axes[i] for i in made.rotary()]
    rows = [
        {axis.name: q * axis.shown_per_unit for axis, q in zip(axes, place, strict=True)}
        for place in advice.positions
    ]
    bounds = {
        axis.name: {"um": 1e3 * mm, "deg": math.degrees(rad)}
        for axis, (mm, rad) in zip(axes, advice.bounds, strict=True)
    }
    return Result({"positions_deg": rows, "bounds": bounds})


def axis(asked: Inputs) -> Result:
    """By ISO 230-2. Raises Refusal."""
    made, name = asked.machine, asked.values["axis"]
    its = next((one for one in made.axes if one.name == name), None)
    if its is None:
        raise Refusal("no_axis", axis=name, names=" ".join(one.name for one in made.axes))
    runs = axis_accuracy.read(asked.table, asked.file)
    table = axis_accuracy.table(runs, its)
    told = {**axis_accuracy.report(runs, its), "table": table}
    draw = partial(pictures.axis, runs, name, "deg" if its.is_rotary else "mm")
    return Result(told, lambda text: machine_edit.pitch(text, its, table), draw)


def circle(asked: Inputs) -> Result:
    """By ISO 230-4. Raises Refusal."""
    trace, axes = _trace(asked), asked.values["axes"]
    if len(axes) != 2 or not set(axes) <= set(trace.axes) & set("XYZ"):
        raise Refusal("no_plane", axes=axes)
    pair = [trace.axes.index(name) for name in axes]
    command, actual = trace.joint_command[:, pair], trace.joint_actual[:, pair]
    found = list(circular_test.circles(command, actual, trace.line))
    names = (axes[0], axes[1])
    return Result(circular_test.report(found, names), draw=partial(pictures.circle, found, names))


def tip(asked: Inputs) -> Result:
    """By ISO 10791-6. Raises Refusal."""
    trace, made = _trace(asked), asked.machine
    rows = (trace.joint_command, trace.joint_actual, trace.line)
    found = five_axis_test.stands(made, kinematics_of(made), asked.values["length"], *rows)
    return Result(five_axis_test.report(found), draw=partial(pictures.tip, found))


def _trace(asked: Inputs) -> traces.Trace:
    """Raises Refusal where it is none."""
    if asked.recording is None:
        raise Refusal("no_recording")
    try:
        if traces.is_recording(asked.recording):
            return traces.of_recording(asked.recording, asked.machine, kinematics_of(asked.machine))
        return traces.load(asked.recording)
    except ValueError as error:
        raise Refusal("bad_recording", why=str(error)) from error


def part(asked: Inputs) -> Result:
    """Raises Refusal."""
    free, offset = asked.values["free"], asked.values["offset"]
    if not set(free) <= set(DOFS) or len(set(free)) < len(free) or not free:
        raise Refusal("no_dofs", free=free)
    found, touches = _part(asked, free)
    told = {"offset": offset, **part_fit.report(found, touches)}
    values = offset_of(told)
    return Result(told, lambda text: machine_edit.offset(text, offset, values))


def thermal(asked: Inputs) -> Result:
    """By how much the machine has moved since a reference was where its offset says. Raises Refusal.

    What is told of X Y Z is where the tool is too far: a reference that seems to lie lower is touched with a
    tool that stands higher than it was told.
    """
    found, touches = _part(asked, "XYZ")
    before = asked.machine.offset(OFFSETS.index(asked.values["offset"])).frame.origin
    known = asked.machine.thermal_shift_mm
    shift = [k - (a - b) for k, a, b in zip(known, found.frame.origin, before, strict=True)]
    told = part_fit.report(found, touches)
    kept = {name: told[name] for name in ("scatter_um", "bounds", "before_um", "after_um", "touches")}
    facts = {"shift_before_mm": list(known), "shift_mm": shift, **kept}
    return Result(facts, partial(machine_edit.thermal, shift=shift))


def offset_of(told: Values) -> dict[str, list[float]]:
    """The work offset that a part was found with."""
    return {"origin_mm": told["origin_mm"], "turned_deg": told["turned_deg"]}


def inspect(asked: Inputs) -> Result:
    """Raises Refusal; ProgramError of a program that cannot be planned."""
    found, touches = _part(asked, "")
    told = part_fit.report(found, touches)
    predicted = _predicted(asked)
    for row in told["touches"]:
        row["predicted_um"] = _at(predicted.get(row["feature"]), row["u"], row["v"])
    return Result(told)


def points(asked: Inputs) -> Result:
    """Where to probe a surface, out of the cutter's side, part frame. Raises Refusal."""
    surfaces, sides = _surfaces(asked)
    values = asked.values
    line = values["line"]
    if line not in surfaces:
        raise Refusal("no_line", line=line, lines=", ".join(map(str, surfaces)) or "-")
    rows = []
    for u, v, place, normal in features.places(surfaces[line], values["along"], values["across"]):
        out = [sides[line] * c + 0.0 for c in normal]
        rows.append({"u": u, "v": v, "point_mm": [c + 0.0 for c in place], "normal": out})
    return Result({"feature": f"line {line}", "points": rows})


def _part(asked: Inputs, free: str) -> tuple[part_fit.PartFit, touch_table.Touches]:
    offset, made = asked.values["offset"], asked.machine
    if offset not in OFFSETS:
        raise Refusal("no_offset", offset=offset)
    touches = touch_table.read(asked.table, made, asked.file)
    surfaces = _surfaces(asked)[0] if asked.text else {}
    names = {name: features.named(name, surfaces, asked.file) for name in dict.fromkeys(touches.features)}
    return part_fit.fit(touches, names, made, made.offset(OFFSETS.index(offset)).frame, free), touches


def _surfaces(asked: Inputs) -> tuple[dict[int, Surface], dict[int, float]]:
    """By line: the surfaces of a program in its part frame, and on which side of each the cutter is."""
    found: dict[int, Surface] = {}
    sides: dict[int, float] = {}
    for block in blocks.stream(asked.text, asked.machine, asked.program):
        if isinstance(block, CutCone | CutRuled | CutNurbs):
            found[block.place.line], sides[block.place.line] = surface_of(block), block.modal.side.value
    return found, sides


def _predicted(asked: Inputs) -> dict[str, Any]:
    """By ``line N`` the deviations (um) that the plan's own cut leaves, v by u on an even grid."""
    task = checked.task(asked.text, asked.program, replace(asked.machine, gouge="warn"))
    watched = Watched(checked.path_of(task, checked.chosen_for(task, lambda share: None)).items)
    for _ in watched:
        pass
    own = maps.maps(
        watched.segments,
        lambda: blocks.stream(task.text, task.machine, task.name, start=task.start),
        task.machine,
        task.kinematics,
    )
    return {f"line {row['line']}": row["map_um"] for row in own.get("surfaces", [])}


def _at(rows: Any, u: float | None, v: float | None) -> float | None:
    """A map at u and v, straight between its places; None where nothing is predicted."""
    if rows is None or u is None or v is None:
        return None
    grid = np.array([[math.nan if value is None else value for value in row] for row in rows])
    across, along = grid.shape
    x, y = u * (along - 1), v * (across - 1)
    i, j = min(int(x), along - 2), min(int(y), across - 2)
    s, t = x - i, y - j
    square = grid[j : j + 2, i : i + 2]
    value = float(np.array([1 - t, t]) @ square @ np.array([1 - s, s]))
    return None if math.isnan(value) else value


EVALUATE: Mapping[str, Callable[[Inputs], Result]] = {
    "rotaries": rotaries,
    "positions": to_probe,
    "axis": axis,
    "circle": circle,
    "tip": tip,
    "thermal": thermal,
    "part": part,
    "inspect": inspect,
    "points": points,
}
