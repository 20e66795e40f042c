"""``directrix fit``: for each surface of a program the largest cutter that keeps a tolerance."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rich.table import Table

from controller.cli import workers
from controller.geometry.defects import DefectKind, defect
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.plan.surfaces.cuts import described, surface_of
from controller.program import blocks, linked
from controller.program.program import CutCone, CutNurbs, CutRuled
from controller.verify import fits, tables
from controller.verify.console import Refused, bar, refusals, say, show
from controller.workers import Workers

MIN_MM, MAX_MM = 1e-4, 10.0
FIT_S = 5.0  # that one surface takes, about


def fit(
    program: Path,
    tolerance: float = 0.01,
    machine: str = "trunnion",
    count: workers.Count = 0,
    cluster: workers.Cluster = "",
    as_json: bool = False,
) -> None:
    """For each surface the largest radius, free and of the tool table, and the placement that keep it.

    As check and verify judge its cut with its leads, alone: they see its neighbours, too.
    """
    with refusals(as_json):
        made = machine_file.load(machine)
        if not MIN_MM <= tolerance <= MAX_MM:
            raise Refused(say("table.no_tolerance", tolerance=tolerance, least=MIN_MM, most=MAX_MM))
        if not program.is_file():
            raise Refused(say("table.no_file", program=program))
        asked = list(_surfaces(program, made))
        if not asked:
            raise Refused(say("table.no_surface", program=program))
        found = []
        with Workers(count, cluster) as crew, bar(say("cli.bar.fitting"), as_json) as progress:
            fitted = partial(fits.fit, tools=made.tools, tolerance_mm=tolerance)
            for one, best in zip(asked, crew.each(fitted, asked, FIT_S), strict=True):
                found.append((one, best))
                progress(len(found) / len(asked))
        if as_json:
            surfaces = [
                {"line": one.line, "hollow_mm": _finite(one.hollow_mm()), "fits": [b.to_dict() for b in best]}
                for one, best in found
            ]
            print(
                json.dumps(
                    {"ok": True, "program": str(program), "tolerance_mm": tolerance, "surfaces": surfaces}
                )
            )
            return
        show.print(_table(found, tolerance))
        for one, row in ((one, row) for one, best in found for row in best if row.why):
            cutter = say(f"table.cutter.{row.kind}")
            show.print(say("table.no_cutter", line=one.line, cutter=cutter, why=row.why))


def _surfaces(program: Path, machine: Machine) -> Iterator[fits.SurfaceToFit]:
    """The surfaces of a program; raises ProgramError where one is none that could be cut."""
    name = str(program)
    text = linked.linked(program.read_bytes(), linked.beside(program), machine)
    for block in blocks.stream(text, machine, name):
        if isinstance(block, CutCone | CutRuled | CutNurbs):
            surface, place = surface_of(block), block.place
            wrong = defect(surface)
            if wrong is not None and wrong.kind is not DefectKind.TWIST:
                raise place.refusal(name, described(block, wrong))
            yield fits.SurfaceToFit(block, machine)


def _finite(value: float) -> float | None:
    return value if value < 1e9 else None


def _table(found: list[tuple[fits.SurfaceToFit, list[fits.Best]]], tolerance: float) -> Table:
    heads = ("line", "cutter", "radius", "placement", "off", "of_table")
    table = tables.headed("table.fits", heads, ("cutter", "placement", "of_table"), tolerance=1e3 * tolerance)
    for one, best in found:
        line = str(one.line)
        for row in best:
            table.add_row(line, *_cells(row))
            line = ""
    return table


def _cells(row: fits.Best) -> tuple[str, ...]:
    kind, none = say(f"table.cutter.{row.kind}"), say("table.none")
    kind = f"{kind} {row.taper_deg:.3g}°" if row.taper_deg else kind
    own = f"T{row.tool} r {row.tool_radius_mm:g}, {row.tool_placement}" if row.tool is not None else none
    if row.radius_mm <= 0.0:
        return kind, none, "", "", own
    more = "≥ " if row.radius_mm >= fits.LARGEST_MM * (1.0 - 1e-9) else ""
    return kind, f"{more}{row.radius_mm:.2f} mm", row.placement, f"{1e3 * row.off_mm:.1f} µm", own
