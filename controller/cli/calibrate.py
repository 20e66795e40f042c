"""``directrix calibrate``: the machine's own geometry from what was measured, written when it is told to.

Without ``--write`` nothing is changed. With it the machine file is replaced whole, its comments stay, and
what was before is kept beside it.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from controller import messages
from controller.calibration import (
    DOFS,
    MAX_DEG,
    MAX_MM,
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
from controller.cli import remote
from controller.cli.client import Url
from controller.cli.speech import speaking
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Vector, unit
from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import OFFSETS, Machine
from controller.machine.toml_table import ConfigError, read_text
from controller.plan.surfaces.cuts import surface_of
from controller.program import blocks, linked
from controller.program.program import CutCone, CutNurbs, CutRuled
from controller.runtime import checked
from controller.verify import console, maps
from controller.verify import trace as traces
from controller.verify.audit import Watched
from controller.verify.console import Refused, refusals, show, spoken

app = typer.Typer(help="The machine's own geometry from what was measured.", no_args_is_help=True)

Measured = Annotated[Path, typer.Argument(help="The table that was measured (CSV).")]
MachineFile = Annotated[str, typer.Option("--machine", help="Machine file, or the name of a shipped one.")]
Write = Annotated[bool, typer.Option("--write", help="Write it into the machine file.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
SphereRadius = Annotated[float, typer.Option("--sphere-radius", help="Of the sphere, mm.")]
Length = Annotated[
    float, typer.Option("--length", help="Of the probe: gauge line to the centre of its ball, mm.")
]
Ball = Annotated[float, typer.Option("--ball-radius", help="Of the probe's ball, mm.")]
Centre = Annotated[
    str, typer.Option("--centre", help="X,Y,Z of the sphere, table frame with rotaries at zero, mm.")
]
Stem = Annotated[str, typer.Option("--stem", help="I,J,K: the way that the sphere's stem points.")]
Recorded = Annotated[Path, typer.Argument(help="Of simulate --trace, or of a recording (.npz).")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Draw it (.png).")]
Program = Annotated[Path | None, typer.Option("--program", help="Whose surfaces were touched.")]
Free = Annotated[str, typer.Option("--free", help="Moves along X Y Z and turns about them, A B C.")]
OffsetName = Annotated[str, typer.Option("--offset", help="Work offset: G54 ...")]
MOST_POSITIONS = 100


def say(key: str, **values: object) -> str:
    return console.say(f"calibration.{key}", **values)


@contextlib.contextmanager
def refused(as_json: bool) -> Iterator[None]:
    """What a measurement is refused for, in the language that is spoken."""
    with refusals(as_json, lambda: (ConfigError,)):
        try:
            yield
        except Refusal as error:
            raise Refused(messages.text(error.said, spoken.get()), **error.said) from error


def written(machine: str, edit: Callable[[str], str]) -> dict[str, str]:
    """A machine file with an edit; of the new one and of the old one the paths."""
    file = Path(machine)
    if not file.is_file():
        raise Refusal("shipped", machine=machine)
    kept = machine_edit.write(file, edit(read_text(file)), f"{datetime.now():%Y%m%d-%H%M%S}")
    return {"file": str(file), "kept": str(kept)}


def tell_written(told: dict[str, str] | None) -> None:
    show.print(say("written", **told) if told else say("not_written"), markup=False)


def vector(text: str, option: str) -> Vector:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise Refusal("no_vector", option=option, found=text) from None
    return x, y, z


@app.command()
@speaking
def rotaries(
    measured: Measured,
    sphere_radius: SphereRadius,
    machine: MachineFile = "trunnion",
    max_mm: Annotated[float, typer.Option("--max-mm", help="A larger move of a centre is refused.")] = MAX_MM,
    max_deg: Annotated[
        float, typer.Option("--max-deg", help="A larger turn of an axis is refused.")
    ] = MAX_DEG,
    add: Annotated[int, typer.Option("--add", help="So many positions to add are told.", min=0, max=24)] = 4,
    write: Write = False,
    as_json: Json = False,
) -> None:
    """Centres and directions of the rotaries from a sphere that was probed at many of their positions."""
    with refused(as_json):
        made = machine_file.load(machine)
        touches = touch_table.read(read_text(measured), made, measured.name)
        fit = rotary_fit.fit(touches, made, sphere_radius)
        sphere = positions.Sphere(fit.sphere_mm, fit.radius_mm)
        probe = positions.Probe(float(touches.length_mm[0]), float(touches.radius_mm[0]))
        advice = positions.advise(fit.machine, sphere, probe, add, done=touches) if add else None
        told = rotary_report.report(fit, made, advice)
        rotary_report.refuse_large(told, max_mm, max_deg)
        done = written(machine, lambda text: machine_edit.rotaries(text, fit.machine)) if write else None
        if as_json:
            print(json.dumps({"ok": True, "machine": made.name, **told, "written": done}))
            return
        _show_rotaries(told)
        tell_written(done)


def _show_rotaries(told: dict[str, Any]) -> None:
    x, y, z = told["sphere_mm"]
    counts = {name: told[name] for name in ("touches", "positions", "scatter_um")}
    show.print(say("rotaries", **counts, radius_mm=told["sphere_radius_mm"], x=x, y=y, z=z), markup=False)
    table = Table()
    for head in ("axis", "point", "direction", "moved", "turned", "bound"):
        table.add_column(say(f"head_{head}"), no_wrap=True)
    for row in told["rotaries"]:
        table.add_row(
            row["axis"],
            " ".join(f"{c + 0.0:.4f}" for c in row["point_mm"]),
            " ".join(f"{c + 0.0:.7f}" for c in row["direction"]),
            f"{row['moved_um']:.1f}",
            f"{row['turned_deg']:.5f}",
            f"{row['bound_um']:.2f}, {row['bound_deg']:.5f}",
        )
    show.print(table)
    before, after = told["dispersion_um"]["before"], told["dispersion_um"]["after"]
    figures = {
        "before": before["max"],
        "before_rms": before["rms"],
        "after": after["max"],
        "after_rms": after["rms"],
    }
    show.print(say("dispersion", **figures, valuation=told["valuation"]), markup=False)
    for one, other, value in told["correlated"]:
        show.print(say("correlated", one=one, other=other, value=value), markup=False)
    if told["unseen"]:
        show.print(say("unseen", names=", ".join(told["unseen"])), markup=False)
    if told["doubtful_touches"]:
        show.print(say("doubtful", rows=", ".join(map(str, told["doubtful_touches"]))), markup=False)
    if told["add_positions_deg"]:
        show.print(say("add", places=_places(told["add_positions_deg"])), markup=False)


def _places(rows: list[dict[str, float]]) -> str:
    return "; ".join(" ".join(f"{name}{value:.1f}" for name, value in row.items()) for row in rows)


@app.command(name="positions")
@speaking
def positions_to_probe(
    centre: Centre,
    sphere_radius: SphereRadius,
    length: Length,
    ball_radius: Ball = 3.0,
    stem: Stem = "0,0,1",
    count: Annotated[int, typer.Option("--count", min=3, max=MOST_POSITIONS, help="So many.")] = 16,
    machine: MachineFile = "trunnion",
    as_json: Json = False,
) -> None:
    """Which positions of the rotaries to probe a sphere at, and what bounds they would leave."""
    with refused(as_json):
        made = machine_file.load(machine)
        sphere = positions.Sphere(vector(centre, "--centre"), sphere_radius, unit(vector(stem, "--stem")))
        advice = positions.advise(made, sphere, positions.Probe(length, ball_radius), count)
        axes = [made.axes[i] for i in made.rotary()]
        rows = [
            {axis.name: q * axis.shown_per_unit for axis, q in zip(axes, place, strict=True)}
            for place in advice.positions
        ]
        bounds = {
            axis.name: {"um": 1e3 * mm, "deg": math.degrees(rad)}
            for axis, (mm, rad) in zip(axes, advice.bounds, strict=True)
        }
        if as_json:
            print(json.dumps({"ok": True, "positions_deg": rows, "bounds": bounds}))
            return
        show.print(_places(rows), markup=False)
        for name, bound in bounds.items():
            show.print(say("would_leave", axis=name, **bound), markup=False)


@app.command(name="axis")
@speaking
def axis_by_iso_230_2(
    measured: Measured,
    axis: Annotated[str, typer.Option("--axis", help="Name of the axis.")],
    machine: MachineFile = "trunnion",
    plot: Plot = None,
    write: Write = False,
    as_json: Json = False,
) -> None:
    """Accuracy and repeatability of an axis (ISO 230-2), and its pitch table."""
    with refused(as_json):
        made = machine_file.load(machine)
        its = next((one for one in made.axes if one.name == axis), None)
        if its is None:
            raise Refusal("no_axis", axis=axis, names=" ".join(one.name for one in made.axes))
        runs = axis_accuracy.read(read_text(measured), measured.name)
        told = axis_accuracy.report(runs, its)
        if plot:
            pictures.axis(runs, axis, "deg" if its.is_rotary else "mm", plot)
        table = axis_accuracy.table(runs, its)
        done = written(machine, lambda text: machine_edit.pitch(text, its, table)) if write else None
        if as_json:
            print(json.dumps({"ok": True, **told, "table": table, "written": done}))
            return
        show.print(_figures(told, ("reversal", "repeatability", "systematic", "mean_deviation", "accuracy")))
        tell_written(done)


def _figures(told: dict[str, Any], names: tuple[str, ...]) -> Table:
    made = Table()
    made.add_column(told["axis"])
    made.add_column(told["unit"].replace("um", "µm"), justify="right")
    for name in names:
        if told[name] is not None:
            made.add_row(say(f"iso_{name}"), f"{told[name]:.2f}")
    return made


@app.command(name="circle")
@speaking
def circle_by_iso_230_4(
    recorded: Recorded,
    axes: Annotated[str, typer.Option("--axes", help="The two axes, as XY.")] = "XY",
    machine: MachineFile = "trunnion",
    plot: Plot = None,
    as_json: Json = False,
) -> None:
    """Circular test (ISO 230-4) of two axes from a recording with circles in both senses."""
    with refused(as_json):
        trace = _trace(recorded, machine_file.load(machine))
        if len(axes) != 2 or not set(axes) <= set(trace.axes) & set("XYZ"):
            raise Refusal("no_plane", axes=axes)
        pair = [trace.axes.index(name) for name in axes]
        command, actual = trace.joint_command[:, pair], trace.joint_actual[:, pair]
        found = list(circular_test.circles(command, actual, trace.line))
        told = circular_test.report(found, (axes[0], axes[1]))
        if plot:
            pictures.circle(found, (axes[0], axes[1]), plot)
        if as_json:
            print(json.dumps({"ok": True, **told}))
            return
        for name in ("counter_clockwise", "clockwise"):
            if name in told:
                show.print(say(f"circle_{name}", radius_mm=told["radius_mm"], **told[name]), markup=False)
        if "H_um" in told:
            both = {name: told[name] for name in ("G_bidirectional_um", "H_um")}
            show.print(say("circle_both", **both), markup=False)


@app.command(name="tip")
@speaking
def tip_by_iso_10791_6(
    recorded: Recorded,
    length: Length = 0.0,
    machine: MachineFile = "trunnion",
    plot: Plot = None,
    as_json: Json = False,
) -> None:
    """Five-axis test with a sphere (ISO 10791-6): what the tip does that should stand while rotaries turn."""
    with refused(as_json):
        made = machine_file.load(machine)
        trace = _trace(recorded, made)
        rows = (trace.joint_command, trace.joint_actual, trace.line)
        found = five_axis_test.stands(made, kinematics_of(made), length, *rows)
        told = five_axis_test.report(found)
        if plot:
            pictures.tip(found, plot)
        if as_json:
            print(json.dumps({"ok": True, **told}))
            return
        for row in told["lines"]:
            x, y, z = row["range_um"]
            figures = {"x_um": x, "y_um": y, "z_um": z, "largest_um": row["largest_um"]}
            show.print(say("tip", line=row["line"], **figures), markup=False)


def _trace(file: Path, made: Machine) -> traces.Trace:
    """Raises Refused where it is none."""
    try:
        if traces.is_recording(file):
            return traces.of_recording(file, made, kinematics_of(made))
        return traces.load(file)
    except ValueError as error:
        raise Refused(str(error)) from error


@app.command()
@speaking
def part(
    measured: Measured,
    program: Program = None,
    offset: OffsetName = "G54",
    free: Free = DOFS,
    machine: MachineFile = "trunnion",
    write: Write = False,
    send: Annotated[bool, typer.Option("--send", help="Set it at the machine behind --url.")] = False,
    url: Url = remote.URL,
    as_json: Json = False,
) -> None:
    """The work offset that fits touches on a part best: on surfaces of its program, planes, bores."""
    with refused(as_json):
        made = machine_file.load(machine)
        if not set(free) <= set(DOFS) or len(set(free)) < len(free) or not free:
            raise Refusal("no_dofs", free=free)
        found, touches = _part(measured, program, offset, free, made)
        told = part_fit.report(found, touches)
        values = {"origin_mm": told["origin_mm"], "turned_deg": told["turned_deg"]}
        done = written(machine, lambda text: machine_edit.offset(text, offset, values)) if write else None
        if send:
            with remote.connected(url, remote.known_token()) as at, at.control():
                at.put(f"offsets/{offset}", values)
        if as_json:
            print(json.dumps({"ok": True, "offset": offset, **told, "written": done, "sent": send}))
            return
        x, y, z = told["origin_mm"]
        a, b, c = told["turned_deg"]
        show.print(say("part", offset=offset, x=x, y=y, z=z, a=a, b=b, c=c), markup=False)
        show.print(
            say("part_fits", before=told["before_um"]["rms"], after=told["after_um"]["rms"]), markup=False
        )
        show.print(_touches(told["touches"]))
        tell_written(done)


@app.command()
@speaking
def inspect(
    measured: Measured,
    program: Annotated[Path, typer.Option("--program", help="What was cut.")],
    offset: OffsetName = "G54",
    machine: MachineFile = "trunnion",
    as_json: Json = False,
) -> None:
    """By how much a wall deviates where it was touched, beside what its program should leave there."""
    with refused(as_json):
        made = machine_file.load(machine)
        found, touches = _part(measured, program, offset, "", made)
        told = part_fit.report(found, touches)
        predicted = _predicted(program, made)
        for row in told["touches"]:
            row["predicted_um"] = _at(predicted.get(row["feature"]), row["u"], row["v"])
        if as_json:
            print(json.dumps({"ok": True, **told}))
            return
        figures = told["after_um"]
        show.print(say("inspected", **figures), markup=False)
        show.print(_touches(told["touches"], with_plan=True))


@app.command()
@speaking
def points(
    program: Annotated[Path, typer.Argument(help="The part program.")],
    line: Annotated[int, typer.Option("--line", help="Line of the surface.")],
    along: Annotated[int, typer.Option("--along", min=1, max=200, help="So many along it.")] = 8,
    across: Annotated[int, typer.Option("--across", min=1, max=50, help="So many across it.")] = 3,
    machine: MachineFile = "trunnion",
) -> None:
    """Where to probe a surface: places and normals out of the cutter's side, part frame, as CSV."""
    with refused(False):
        surfaces, sides = _surfaces(program, machine_file.load(machine))
        if line not in surfaces:
            raise Refusal("no_line", line=line, lines=", ".join(map(str, surfaces)) or "-")
        print("feature,u,v,X,Y,Z,I,J,K")
        for u, v, place, normal in features.places(surfaces[line], along, across):
            out = [sides[line] * c for c in normal]
            print(f"line {line}," + ",".join(f"{c + 0.0:.6f}" for c in (u, v, *place, *out)))


def _part(
    measured: Path, program: Path | None, offset: str, free: str, made: Machine
) -> tuple[part_fit.PartFit, touch_table.Touches]:
    if offset not in OFFSETS:
        raise Refusal("no_offset", offset=offset)
    touches = touch_table.read(read_text(measured), made, measured.name)
    surfaces = _surfaces(program, made)[0] if program else {}
    names = {name: features.named(name, surfaces, measured.name) for name in dict.fromkeys(touches.features)}
    start = made.offset(OFFSETS.index(offset)).frame
    return part_fit.fit(touches, names, made, start, free), touches


def _surfaces(program: Path, made: Machine) -> tuple[dict[int, Surface], dict[int, float]]:
    """By line: the surfaces of a program in its part frame, and on which side of each the cutter is."""
    found: dict[int, Surface] = {}
    sides: dict[int, float] = {}
    text = linked.linked(program.read_bytes(), linked.beside(program))
    for block in blocks.stream(text, made, str(program)):
        if isinstance(block, CutCone | CutRuled | CutNurbs):
            found[block.place.line], sides[block.place.line] = surface_of(block), block.modal.side.value
    return found, sides


def _predicted(program: Path, made: Machine) -> dict[str, Any]:
    """By ``line N`` the deviations (um) that the plan's own cut leaves, v by u on an even grid."""
    text = linked.linked(program.read_bytes(), linked.beside(program))
    task = checked.task(text, str(program), replace(made, gouge="warn"))
    watched = Watched(checked.path_of(task, checked.chosen_for(task, lambda share: None)).items)
    for _ in watched:
        pass
    own = maps.maps(
        watched.stretches,
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


def _touches(rows: list[dict[str, Any]], with_plan: bool = False) -> Table:
    table = Table()
    heads = ("touch", "feature", "u", "v", "deviation", *(("predicted",) if with_plan else ()))
    for head in heads:
        table.add_column(say(f"head_{head}"), justify="left" if head == "feature" else "right")
    for row in rows:
        uv = ["" if row[name] is None else f"{row[name]:.4f}" for name in "uv"]
        cells = [str(row["touch"]), row["feature"], *uv, f"{row['deviation_um']:.1f}"]
        if with_plan:
            cells.append("" if row["predicted_um"] is None else f"{row['predicted_um']:.1f}")
        table.add_row(*cells, style="dim" if row["beside"] else None)
    return table
