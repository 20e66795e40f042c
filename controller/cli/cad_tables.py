"""What ``directrix import`` shows: the faces of a file, and what was written of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.cad import picture, program
from controller.machine.model import Machine, Tool
from controller.messages import Message
from controller.verify.console import answered, in_words, say, show, tell
from controller.verify.tables import headed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from controller.cad.deviation import Deviation
    from controller.cad.kernel import Face, Part
    from controller.cad.program import Written
    from controller.cad.strip import Strip

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SeenFace:
    """One face: its strips, the largest first, or why it has none; what it is on the part; what cuts it."""

    face: Face
    strips: tuple[Strip, ...]
    reason: Message | None
    off_ruled_mm: float
    triangles: Array  # of the face, (N, 3, 3) mm
    role: str = ""  # of ``roles.ROLES``
    tools: tuple[Tool, ...] = ()  # the thickest first

    def to_dict(self) -> dict[str, Any]:
        middle, normal = picture.middle(self.triangles)
        facts: dict[str, Any] = {
            "number": self.face.number,
            "kind": self.face.kind,
            "role": self.role or None,
            "in_solid": self.face.in_solid,
            "middle_mm": _rounded(middle),
            "normal": _rounded(normal),
            "off_ruled_mm": _finite(self.off_ruled_mm),
            "cut_as": None,
            "why_not": in_words(self.reason) or None,
        }
        if not self.strips:
            return facts
        first = self.strips[0]
        length, height = first.size()
        return facts | {
            "cut_as": program.code(first),
            "length_mm": length,
            "height_mm": height,
            "concave_radius_mm": _finite(first.concave_mm()),
            "twist_deg": math.degrees(first.twist_rad()),
            "prolonged_mm": first.prolonged_mm,
            "pieces": len(self.strips),
            "tools": [tool.number for tool in self.tools],
            "remark": _remarks(first),
        }


def _rounded(place: Array) -> list[float] | None:
    """None of a face that could not be drawn."""
    values = [round(float(x), 6) for x in place]
    return values if all(map(math.isfinite, values)) else None


def _remarks(strip: Strip) -> str | None:
    return "; ".join(in_words(one) for one in strip.remarks) or None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def faces(file: Path, part: Part, seen: Sequence[SeenFace], as_json: bool) -> None:
    """The table of ``--list``: within 80 columns."""
    rows = [one.to_dict() for one in seen]
    if answered(as_json, file=str(file), unit=part.unit, faces=rows):
        return
    heads = ("face", "role", "cut_as", "length", "ruling", "hollow", "twist", "tool")
    table = headed("table.faces", heads, ("role", "cut_as", "tool"), file=file.name, unit=part.unit)
    for row in rows:
        table.add_row(*_cells(row))
    show.print(table)
    told = [
        (row["number"], row["why_not"], row.get("remark"), "" if row["in_solid"] else say("cli.import.loose"))
        for row in rows
    ]
    _show_remarks(told)


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    what = say(f"table.role.{row['role']}") if row["role"] else row["kind"]
    if row["cut_as"] is None:
        return str(row["number"]), what, "-", "", "", "", "", ""
    hollow = row["concave_radius_mm"]
    return (
        str(row["number"]),
        what,
        row["cut_as"],
        f"{row['length_mm']:.2f}",
        f"{row['height_mm']:.2f}",
        "" if hollow is None else f"{hollow:.3f}",
        f"{row['twist_deg']:.2f}" if row["twist_deg"] > 1e-3 else "",
        f"T{row['tools'][0]}" if row["tools"] else "-",
    )


def picture_of(seen: Sequence[SeenFace], machine: Machine) -> str:
    """Of all faces, as SVG, coloured by the thickest tool that cuts them."""
    numbers = [tool.number for tool in machine.tools]
    shown = [
        picture.Shown(
            one.face.number, one.triangles, _rulings(one.strips), _colour(one, numbers), one.face.in_solid
        )
        for one in seen
        if len(one.triangles)
    ]
    used = {one.tools[0].number: one.tools[0] for one in seen if one.tools}
    legend = [
        (picture.colour_of(number, numbers), say("cli.import.cut_by", tool=number, name=used[number].name))
        for number in sorted(used)
    ]
    if any(one.strips and not one.tools for one in seen):
        legend.append((picture.NO_TOOL, say("cli.import.no_tool_cuts")))
    legend.append((picture.OTHER, say("cli.import.not_ruled")))
    return picture.drawn(shown, legend)


def _colour(one: SeenFace, numbers: Sequence[int]) -> picture.Colour:
    if one.tools:
        return picture.colour_of(one.tools[0].number, numbers)
    return picture.NO_TOOL if one.strips else picture.OTHER


def _rulings(strips: Sequence[Strip]) -> Array:
    """Some rulings of strips, (N, 2, 3) mm."""
    share = np.linspace(0.0, 1.0, picture.RULINGS)
    rows = [np.stack([one.lower.at(share), one.upper.at(share)], axis=1) for one in strips]
    return np.concatenate([np.zeros((0, 2, 3)), *rows])


def _show_remarks(told: Sequence[tuple[int, str | None, str | None, str | None]]) -> None:
    """Each remark once, with the faces that it is about."""
    of: dict[str, list[int]] = {}
    for number, *remarks in told:
        if words_ := "; ".join(filter(None, remarks)):
            of.setdefault(words_, []).append(number)
    for sentence, numbers in of.items():
        key = "table.of_face" if len(numbers) == 1 else "table.of_faces"
        show.print(say(key, number=", ".join(map(str, numbers)), told=sentence))


def off_faces(made: Written, found: Sequence[Deviation]) -> list[dict[str, Any]]:
    """Of a program that was written: each face in cut order, and how far off it is."""
    return [
        {
            "number": strip.face.number,
            "joined": [part.face.number for part in strip.joined],
            "kind": strip.face.kind,
            "cut_as": program.code(strip),
            "to_face_mm": one.to_face_mm,
            "to_written_mm": one.to_written_mm,
            "remark": _remarks(strip),
        }
        for strip, one in zip(made.strips, found, strict=True)
    ]


def written(target: Path, tool: Tool, rows: Sequence[dict[str, Any]]) -> None:
    """The table of that."""
    heads = ("face", "face_kind", "cut_as", "to_face", "to_written")
    table = headed("table.off_faces", heads, ("face_kind", "cut_as"), program=target.name)
    for row in rows:
        away = [f"{1e3 * row[key]:.4f}" for key in ("to_face_mm", "to_written_mm")]
        numbers = "+".join(map(str, row["joined"] or [row["number"]]))
        table.add_row(numbers, row["kind"], row["cut_as"], *away)
    show.print(table)
    _show_remarks([(row["number"], row["remark"], None, None) for row in rows])
    tell.print(say("table.imported", tool=tool.number, name=tool.name, program=target))
