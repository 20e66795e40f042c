"""``directrix calibrate``: the machine's own geometry from what was measured, written when that is asked for.

Without ``--write`` nothing is changed. With it the machine file is replaced whole, its comments stay, and
what was before is kept beside it.
"""

from __future__ import annotations

from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.calibration import DOFS, MAX_DEG, MAX_MM, machine_edit, spindle_speed
from controller.calibration.measurements import complete
from controller.calibration.refusal import Refusal
from controller.cli import measurements, remote
from controller.cli.client import Url
from controller.cli.measurements import Inputs, Result
from controller.cli.speech import Verbs
from controller.geometry.vectors import Vector
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.machine.toml_table import read_text
from controller.program import linked
from controller.verify import console
from controller.verify.console import answered, refusals, show

app = Verbs(no_args_is_help=True)

SphereRadius = Annotated[float, typer.Option("--sphere-radius")]
MAX_POSITIONS = 100


def say(key: str, **values: object) -> str:
    return console.say(f"calibration.{key}", **values)


def written(machine: str, found: Result) -> dict[str, str] | None:
    """A machine file with what was found; paths of the new one and of the old one, None without an edit."""
    if found.edit is None:
        return None
    file = Path(machine)
    if not file.is_file():
        raise Refusal("shipped", machine=machine)
    kept = machine_edit.write(file, found.edit(read_text(file)), f"{datetime.now():%Y%m%d-%H%M%S}")
    return {"file": str(file), "kept": str(kept)}


def drawn(found: Result, plot: Path | None) -> None:
    """Its picture, where one is asked for."""
    if plot and found.draw:
        found.draw(plot)


def tell_written(told: dict[str, str] | None) -> None:
    show.print(say("written", **told) if told else say("not_written"))


def vector(text: str, option: str) -> Vector:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise Refusal("no_vector", option=option, found=text) from None
    return x, y, z


@app.command()
def rotaries(
    measured: Path,
    sphere_radius: SphereRadius,
    machine: str = "trunnion",
    max_mm: float = MAX_MM,
    max_deg: float = MAX_DEG,
    add: Annotated[int, typer.Option("--add", min=0, max=24)] = 4,
    write: bool = False,
    as_json: bool = False,
) -> None:
    """Centres and directions of the rotaries from a sphere that was probed at many of their positions."""
    with refusals(as_json):
        made = machine_file.load(machine)
        values = {"sphere_radius": sphere_radius, "max_mm": max_mm, "max_deg": max_deg, "add": add}
        found = measurements.rotaries(_of_table("rotaries", measured, made, values))
        told = found.told
        done = written(machine, found) if write else None
        if not answered(as_json, machine=made.name, **told, written=done):
            _show_rotaries(told)
            tell_written(done)


def _of_table(
    name: str, measured: Path, made: Machine, values: dict[str, Any], program: Path | None = None
) -> Inputs:
    """A measurement of a table, and of a program where one is named. Raises Refusal, OSError."""
    text = b"" if program is None else linked.linked(program.read_bytes(), linked.beside(program), made)
    table = read_text(measured)
    return Inputs(made, complete(name, values), table, measured.name, None, bytes(text), str(program or ""))


def _show_rotaries(told: dict[str, Any]) -> None:
    x, y, z = told["sphere_mm"]
    counts = {name: told[name] for name in ("touches", "positions", "scatter_um")}
    show.print(say("rotaries", **counts, radius_mm=told["sphere_radius_mm"], x=x, y=y, z=z))
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
    show.print(say("dispersion", **figures, valuation=told["valuation"]))
    for one, other, value in told["correlated"]:
        show.print(say("correlated", one=one, other=other, value=value))
    if told["unseen"]:
        show.print(say("unseen", names=", ".join(told["unseen"])))
    if told["doubtful_touches"]:
        show.print(say("doubtful", rows=", ".join(map(str, told["doubtful_touches"]))))
    if told["add_positions_deg"]:
        show.print(say("add", places=_places(told["add_positions_deg"])))


def _places(rows: list[dict[str, float]]) -> str:
    return "; ".join(" ".join(f"{name}{value:.1f}" for name, value in row.items()) for row in rows)


@app.command(name="positions")
def positions_to_probe(
    centre: Annotated[str, typer.Option("--centre")],
    sphere_radius: SphereRadius,
    length: Annotated[float, typer.Option("--length")],
    ball_radius: float = 3.0,
    stem: str = "0,0,1",
    count: Annotated[int, typer.Option("--count", min=3, max=MAX_POSITIONS)] = 16,
    machine: str = "trunnion",
    as_json: bool = False,
) -> None:
    """Which positions of the rotaries to probe a sphere at, and what bounds they would leave."""
    with refusals(as_json):
        made = machine_file.load(machine)
        x, y, z = vector(centre, "--centre")
        i, j, k = vector(stem, "--stem")
        values = {
            **{"centre_x": x, "centre_y": y, "centre_z": z, "stem_i": i, "stem_j": j, "stem_k": k},
            **{"sphere_radius": sphere_radius, "length": length, "ball_radius": ball_radius, "count": count},
        }
        told = measurements.to_probe(Inputs(made, complete("positions", values))).told
        if answered(as_json, **told):
            return
        show.print(_places(told["positions_deg"]))
        for name, bound in told["bounds"].items():
            show.print(say("would_leave", axis=name, **bound))


@app.command(name="axis")
def axis_by_iso_230_2(
    measured: Path,
    axis: Annotated[str, typer.Option("--axis")],
    machine: str = "trunnion",
    plot: Path | None = None,
    write: bool = False,
    as_json: bool = False,
) -> None:
    """Accuracy and repeatability of an axis (ISO 230-2), and its pitch table."""
    with refusals(as_json):
        made = machine_file.load(machine)
        found = measurements.axis(_of_table("axis", measured, made, {"axis": axis}))
        told = found.told
        drawn(found, plot)
        done = written(machine, found) if write else None
        if not answered(as_json, **told, written=done):
            show.print(
                _figures(told, ("reversal", "repeatability", "systematic", "mean_deviation", "accuracy"))
            )
            tell_written(done)


@app.command(name="spindle")
def spindle_by_tachometer(
    measured: Path, machine: str = "trunnion", write: bool = False, as_json: bool = False
) -> None:
    """Scale and offset of an inverter's analogue output, from readings of a tachometer."""
    with refusals(as_json):
        made = machine_file.load(machine)
        fitted = spindle_speed.fit(read_text(measured), measured.name, made)
        edit = partial(
            machine_edit.inverter, zero_counts=fitted.zero_counts, full_rev_min=fitted.full_rev_min
        )
        done = written(machine, Result(fitted.figures, edit)) if write else None
        if not answered(as_json, **fitted.figures, written=done):
            show.print(say("spindle", **fitted.figures))
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
def circle_by_iso_230_4(
    recorded: Path,
    axes: str = "XY",
    machine: str = "trunnion",
    plot: Path | None = None,
    as_json: bool = False,
) -> None:
    """Circular test (ISO 230-4) of two axes from a recording with circles in both senses."""
    with refusals(as_json):
        made = machine_file.load(machine)
        found = measurements.circle(Inputs(made, {"axes": axes}, recording=recorded))
        told = found.told
        drawn(found, plot)
        if answered(as_json, **told):
            return
        for name in ("counter_clockwise", "clockwise"):
            if name in told:
                show.print(say(f"circle_{name}", radius_mm=told["radius_mm"], **told[name]))
        if "H_um" in told:
            both = {name: told[name] for name in ("G_bidirectional_um", "H_um")}
            show.print(say("circle_both", **both))


@app.command(name="tip")
def tip_by_iso_10791_6(
    recorded: Path,
    length: float = 0.0,
    machine: str = "trunnion",
    plot: Path | None = None,
    as_json: bool = False,
) -> None:
    """Five-axis test with a sphere (ISO 10791-6): what the tip does that should stand while rotaries turn."""
    with refusals(as_json):
        made = machine_file.load(machine)
        found = measurements.tip(Inputs(made, complete("tip", {"length": length}), recording=recorded))
        told = found.told
        drawn(found, plot)
        if answered(as_json, **told):
            return
        for row in told["lines"]:
            x, y, z = row["range_um"]
            figures = {"x_um": x, "y_um": y, "z_um": z, "largest_um": row["largest_um"]}
            show.print(say("tip", line=row["line"], **figures))


@app.command()
def thermal(
    measured: Path, offset: str = "G54", machine: str = "trunnion", write: bool = False, as_json: bool = False
) -> None:
    """By how much the machine has moved since a reference was where its work offset says."""
    with refusals(as_json):
        made = machine_file.load(machine)
        found = measurements.thermal(_of_table("thermal", measured, made, {"offset": offset}))
        told = found.told
        done = written(machine, found) if write else None
        if answered(as_json, **told, written=done):
            return
        x, y, z = told["shift_mm"]
        show.print(say("thermal", x=x, y=y, z=z, rms=told["after_um"]["rms"]))
        show.print(_touches(told["touches"]))
        tell_written(done)


@app.command()
def part(
    measured: Path,
    program: Path | None = None,
    offset: str = "G54",
    free: str = DOFS,
    machine: str = "trunnion",
    write: bool = False,
    send: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """The work offset that fits touches on a part best: on surfaces of its program, planes, bores."""
    with refusals(as_json):
        made = machine_file.load(machine)
        values = {"offset": offset, "free": free}
        found = measurements.part(_of_table("part", measured, made, values, program))
        told = found.told
        done = written(machine, found) if write else None
        if send:
            with remote.connected(url, remote.known_token()) as at, at.control():
                at.put(f"offsets/{offset}", measurements.offset_of(told))
        if answered(as_json, **told, written=done, sent=send):
            return
        x, y, z = told["origin_mm"]
        a, b, c = told["turned_deg"]
        show.print(say("part", offset=offset, x=x, y=y, z=z, a=a, b=b, c=c))
        show.print(say("part_fits", before=told["before_um"]["rms"], after=told["after_um"]["rms"]))
        show.print(_touches(told["touches"]))
        tell_written(done)


@app.command()
def inspect(
    measured: Path,
    program: Annotated[Path, typer.Option("--program")],
    offset: str = "G54",
    machine: str = "trunnion",
    as_json: bool = False,
) -> None:
    """By how much a wall deviates where it was touched, beside what its program should leave there."""
    with refusals(as_json):
        made = machine_file.load(machine)
        told = measurements.inspect(_of_table("inspect", measured, made, {"offset": offset}, program)).told
        if answered(as_json, **told):
            return
        figures = told["after_um"]
        show.print(say("inspected", **figures))
        show.print(_touches(told["touches"], with_plan=True))


@app.command()
def points(
    program: Path,
    line: Annotated[int, typer.Option("--line")],
    along: Annotated[int, typer.Option("--along", min=1, max=200)] = 8,
    across: Annotated[int, typer.Option("--across", min=1, max=50)] = 3,
    machine: str = "trunnion",
) -> None:
    """Where to probe a surface: places and normals out of the cutter's side, part frame, as CSV."""
    with refusals(False):
        made = machine_file.load(machine)
        text = bytes(linked.linked(program.read_bytes(), linked.beside(program), made))
        values = complete("points", {"line": line, "along": along, "across": across})
        told = measurements.points(Inputs(made, values, text=text, program=str(program))).told
        print("feature,u,v,X,Y,Z,I,J,K")
        for row in told["points"]:
            numbers = (row["u"], row["v"], *row["point_mm"], *row["normal"])
            print(f"{told['feature']}," + ",".join(f"{c + 0.0:.6f}" for c in numbers))


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
