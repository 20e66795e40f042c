"""What ``directrix import`` shows: the faces of a file, and what was written of them."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller import messages
from controller.cad import picture, words
from controller.machine.model import Tool
from controller.messages import Said
from controller.verify.console import say, show, spoken, tell
from controller.verify.tables import headed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from controller.cad.deviation import Deviation
    from controller.cad.kernel import Face, Part
    from controller.cad.program import Written
    from controller.cad.strip import Strip

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Seen:
    """One face: its strips, the largest first, or why it has none."""

    face: Face
    strips: tuple[Strip, ...]
    reason: Said | None
    off_ruled_mm: float
    triangles: Array  # of the face, (N, 3, 3) mm

    def to_dict(self) -> dict[str, Any]:
        middle, normal = picture.middle(self.triangles)
        facts: dict[str, Any] = {
            "number": self.face.number,
            "kind": self.face.kind,
            "in_solid": self.face.in_solid,
            "middle_mm": _rounded(middle),
            "normal": _rounded(normal),
            "off_ruled_mm": _finite(self.off_ruled_mm),
            "cut_as": None,
            "why_not": messages.text(self.reason, spoken.get()) or None,
        }
        if not self.strips:
            return facts
        first = self.strips[0]
        length, height = first.size()
        return facts | {
            "cut_as": words.code(first),
            "length_mm": length,
            "height_mm": height,
            "concave_radius_mm": _finite(first.concave_mm()),
            "twist_deg": math.degrees(first.twist_rad()),
            "prolonged_mm": first.prolonged_mm,
            "pieces": len(self.strips),
            "remark": _remarks(first),
        }


def _rounded(place: Array) -> list[float] | None:
    """None of a face that could not be drawn."""
    values = [round(float(x), 6) for x in place]
    return values if all(map(math.isfinite, values)) else None


def _remarks(strip: Strip) -> str | None:
    return "; ".join(messages.text(one, spoken.get()) for one in strip.remarks) or None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def faces(file: Path, part: Part, seen: Sequence[Seen], as_json: bool) -> None:
    """The table of ``--list``."""
    rows = [one.to_dict() for one in seen]
    if as_json:
        print(json.dumps({"ok": True, "file": str(file), "unit": part.unit, "faces": rows}))
        return
    shape = ("middle", "normal", "length", "ruling", "off_ruled", "hollow", "twist")
    heads = ("face", "face_kind", "cut_as", *shape)
    table = headed("table.faces", heads, ("face_kind", "cut_as"), file=file.name, unit=part.unit)
    for row in rows:
        table.add_row(*_cells(row))
    show.print(table)
    for row in rows:
        _remark(
            row["number"],
            row["why_not"],
            row.get("remark"),
            "" if row["in_solid"] else say("cli.import.loose"),
        )


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    off = "" if row["off_ruled_mm"] is None else _short(row["off_ruled_mm"])
    where = (_three(row["middle_mm"], 1), _three(row["normal"], 2))
    first = (str(row["number"]), row["kind"], row["cut_as"] or "-", *where)
    if row["cut_as"] is None:
        return *first, "", "", off
    hollow = row["concave_radius_mm"]
    return (
        *first,
        f"{row['length_mm']:.2f}",
        f"{row['height_mm']:.2f}",
        off,
        "" if hollow is None else f"{hollow:.3f}",
        f"{row['twist_deg']:.2f}" if row["twist_deg"] > 1e-3 else "",
    )


def picture_of(seen: Sequence[Seen]) -> str:
    """Of all faces, as SVG."""
    return picture.drawn(
        [
            picture.Shown(one.face.number, one.triangles, bool(one.strips))
            for one in seen
            if len(one.triangles)
        ]
    )


def _three(values: Sequence[float] | None, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values or ())


def _short(mm: float) -> str:
    return f"{1e3 * mm:.3f} µm" if mm < 1.0 else f"{mm:.3f} mm"


def _remark(number: int, *remarks: str | None) -> None:
    if told := "; ".join(filter(None, remarks)):
        show.print(say("table.of_face", number=number, told=told), markup=False)


def written(
    file: Path, target: Path, tool: Tool, made: Written, found: Sequence[Deviation], as_json: bool
) -> None:
    """The table of a program that was written: each face in cut order, and how far off it is."""
    rows: list[dict[str, Any]] = [
        {
            "number": strip.face.number,
            "kind": strip.face.kind,
            "cut_as": words.code(strip),
            "to_face_mm": one.to_face_mm,
            "to_written_mm": one.to_written_mm,
            "remark": _remarks(strip),
        }
        for strip, one in zip(made.strips, found, strict=True)
    ]
    if as_json:
        facts = {"ok": True, "file": str(file), "program": str(target), "tool": tool.number, "faces": rows}
        print(json.dumps(facts))
        return
    heads = ("face", "face_kind", "cut_as", "to_face", "to_written")
    table = headed("table.off_faces", heads, ("face_kind", "cut_as"), program=target.name)
    for row in rows:
        away = [f"{1e3 * row[key]:.4f}" for key in ("to_face_mm", "to_written_mm")]
        table.add_row(str(row["number"]), row["kind"], row["cut_as"], *away)
    show.print(table)
    for row in rows:
        _remark(row["number"], row["remark"])
    tell.print(say("table.imported", tool=tool.number, name=tool.name, program=target), markup=False)
