"""``directrix import`` of a CL file or a program: its five-axis rows as ruled surfaces."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller.cad import path_rows, path_strips, program
from controller.cad.deviation import surfaces
from controller.cad.path_rows import Row
from controller.cad.path_strips import Off, Recognised
from controller.cad.strip import Strip
from controller.cli.new_files import save
from controller.machine.model import Machine, Tool
from controller.machine.tool_profile import flank_mm
from controller.program import blocks
from controller.verify.console import Refused, answered, in_words, say, show, tell
from controller.verify.tables import headed

ALLOWED = 1.5  # times the tolerance, from the lines
SAME_RADIUS_MM = 1e-3


@dataclass(frozen=True, slots=True)
class Wish:
    """What was asked for on the command line."""

    faces: str  # numbers of rows, or all
    tool: int
    feed: float
    spindle: float
    right: bool
    tolerance_mm: float


def import_rows(
    file: Path, is_program: bool, target: Path | None, machine: Machine, wish: Wish, as_json: bool
) -> tuple[Tool, list[dict[str, Any]]] | None:
    """List the rows of a file, or write the program that cuts some; None of a list.

    Raises Refused, BadPath.
    """
    rows = path_rows.read(file, machine, is_program)
    if not rows:
        raise Refused(say("cli.import.path.no_row", file=file))
    cutter = _tool(rows, machine, wish.tool)
    radius = rows[0].radius_mm or cutter.radius_mm
    found = path_strips.recognised(rows, flank_mm(cutter), radius, wish.right, wish.tolerance_mm)
    if target is None:
        _show_list(file, found, radius, wish, as_json)
        return None
    chosen = _chosen(file, found, wish.faces)
    strips = [one.strip for one in chosen if one.strip is not None]
    wanted = program.Wanted(wish.feed, wish.spindle, wish.right, "single")
    written = program.write([f"{file.name}, by directrix import"], strips, cutter, wanted)
    read = surfaces(blocks.stream(written.text.encode(), machine, str(target)))
    cut = []
    for strip, surface in zip(written.strips, read, strict=True):
        of = [one for one in chosen for part in (strip.joined or (strip,)) if one.number == part.face.number]
        for one in of:
            off = path_strips.deviation(one, surface, one.rows[0].radius_mm or radius, wish.right)
            if not off.tip_mm <= ALLOWED * wish.tolerance_mm:
                um = {"off": 1e3 * off.tip_mm, "allowed": 1e3 * ALLOWED * wish.tolerance_mm}
                raise Refused(say("cli.import.path.too_far", number=one.number, **um))
            cut.append(_facts(one, strip, off))
    save(target, written.text)
    if not as_json:
        show.print(_table(target, cut))
        tell.print(say("table.imported", tool=cutter.number, name=cutter.name, program=target))
    return cutter, cut


def _tool(rows: Sequence[Row], machine: Machine, number: int) -> Tool:
    """The tool that is asked for, else the one of the file: by its number, else its radius."""
    known = ", ".join(f"T{one.number} (r {one.radius_mm:g} mm)" for one in machine.tools)
    radius, named = rows[0].radius_mm, number or rows[0].tool or 0
    found = machine.tool(named)
    if number and found is None:
        raise Refused(say("cli.import.no_tool", number=number, known=known))
    if found is not None and (number or radius is None or abs(found.radius_mm - radius) <= SAME_RADIUS_MM):
        return found.worn
    same = [one.worn for one in machine.tools if radius and abs(one.radius_mm - radius) <= SAME_RADIUS_MM]
    if not same:
        key = "cli.import.path.no_cutter" if radius is None else "cli.import.path.no_radius"
        raise Refused(say(key, radius=radius or 0.0, known=known))
    return max(same, key=flank_mm)


def _chosen(file: Path, found: Sequence[Recognised], asked: str) -> list[Recognised]:
    if asked == "all":
        chosen = [one for one in found if one.strip is not None and not one.beside]
        if not chosen:
            raise Refused(say("cli.import.path.none", file=file))
        return chosen
    by_number = {one.number: one for one in found}
    chosen = []
    for word in re.split(r"[,\s]+", asked.strip()):
        one = by_number.get(int(word)) if word.isascii() and word.isdigit() else None
        if one is None:
            known = ", ".join(map(str, by_number))
            raise Refused(say("cli.import.path.number", text=asked, word=word, known=known))
        if one.strip is None:
            why = in_words(one.reason)
            raise Refused(say("cli.import.path.not_cut", number=one.number, why=why))
        chosen.append(one)
    return chosen


def _facts(one: Recognised, strip: Strip | None, off: Off | None) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "number": one.number,
        "kind": "pair" if len(one.rows) > 1 else one.rows[0].kind,
        "line": one.rows[0].line,
        "lines": len(one.rows[0].tips),
        "cut_as": None,
        "passes_beside": one.beside,
        "why_not": in_words(one.reason) or None,
    }
    if strip is None or off is None:
        return facts
    length, height = strip.size()
    return facts | {
        "cut_as": program.code(strip),
        "length_mm": length,
        "height_mm": height,
        "twist_deg": math.degrees(strip.twist_rad()),
        "tip_off_mm": off.tip_mm,
        "axis_off_deg": off.axis_deg,
        "lines_off_mm": off.between_mm,
    }


def _show_list(file: Path, found: Sequence[Recognised], radius_mm: float, wish: Wish, as_json: bool) -> None:
    rows = []
    for one in found:
        off = None
        if one.strip is not None:
            radius = one.rows[0].radius_mm or radius_mm
            off = path_strips.deviation(one, one.strip.surface, radius, wish.right)
        rows.append(_facts(one, one.strip, off))
    if answered(as_json, file=str(file), rows=rows):
        return
    show.print(_table(file, rows))
    for row in rows:
        why = row["why_not"] or (say("cli.import.path.beside") if row["passes_beside"] else "")
        if why:
            show.print(say("table.of_face", number=row["number"], told=why))


def _table(file: Path, rows: Sequence[dict[str, Any]]) -> Any:
    heads = ("face", "path_kind", "line", "cut_as", "length", "ruling", "twist", "tip_off", "axis_off")
    table = headed("table.path_rows", heads, ("path_kind", "cut_as"), file=file.name)
    for row in rows:
        cells = [str(row["number"]), say(f"table.path.{row['kind']}"), str(row["line"]), row["cut_as"] or "-"]
        if row["cut_as"] is not None:
            cells += [f"{row[key]:.2f}" for key in ("length_mm", "height_mm", "twist_deg")]
            cells += [f"{1e3 * row['tip_off_mm']:.2f}", f"{row['axis_off_deg']:.4f}"]
        table.add_row(*cells)
    return table
