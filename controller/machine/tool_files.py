"""Tool tables of others, in and out: LinuxCNC's ``tool.tbl`` and JSON with the property names of ISO 13399.

    T7 P7 D6.000000 Z52.400000 ;end mill 6 mm

``tool.tbl`` has a line per tool: number, pocket, diameter, length, behind ``;`` what the operator calls it.

    {"tools": [{"number": 7, "description": "end mill", "DC": 6.0, "LF": 52.4, "APMX": 15.0, "RE": 0.5}]}

DC is the cutting diameter, LF the functional length, APMX the length that cuts, RE the corner radius, mm;
TAPER, the half angle of the flank in degrees, is our own, and so are POINT (degrees), BARREL, END and BACK,
which only cutters of these forms have. Rows are as ``setup_data.tools_of`` tells them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from xml.sax.saxutils import escape

from controller.messages import Message, message, text

Row = Mapping[str, Any]
FORMATS: Sequence[str] = (".tbl", ".json")
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)
_LINE = re.compile(rf"\s*(?:{_WORD.pattern}\s*)*", re.IGNORECASE)
_OFFSETS = "XYABCUVW"  # of tools on lathes and of probes: none are known here
ISO = {"DC": "radius_mm", "LF": "length_mm", "APMX": "flute_mm", "RE": "corner_mm", "TAPER": "taper_deg"}
OTHER_FORMS = {"POINT": "point_deg", "BARREL": "barrel_mm", "END": "end_mm", "BACK": "back_mm"}
MAX_NAME = 60


class TableRefused(Exception):
    """A text that is no tool table; ``said``: the sentence."""

    def __init__(self, key: str, **values: object) -> None:
        self.said: Message = message(f"tool_file.{key}", **values)
        super().__init__(text(self.said))


def form_of(name: str) -> str:
    """Which of FORMATS a file is, by the ending of its name. Raises TableRefused."""
    form = next((one for one in FORMATS if name.endswith(one)), None)
    if form is None:
        raise TableRefused("ending", file=name, allowed=" ".join(FORMATS))
    return form


def written(rows: Iterable[Row], name: str) -> str:
    """The table as a file of that name has it. Raises TableRefused."""
    return json_text(rows) if form_of(name) == ".json" else table_text(rows)


def taken(
    content: str, name: str, there: Mapping[int, Row], flute_mm: float | None = None
) -> list[dict[str, Any]]:
    """The tools of a file, whole; ``there``: those of the table, by number. Raises TableRefused."""
    read = read_json if form_of(name) == ".json" else read_table
    return completed(read(content, name), there, flute_mm)


def table_text(rows: Iterable[Row]) -> str:
    """As ``tool.tbl``: lengths and radii as they are now, wear laid in."""
    return "".join(
        f"T{row['number']} P{row['number']} D{2.0 * (row['radius_mm'] + row['wear_radius_mm']):.6f} "
        f"Z{row['length_mm'] + row['wear_length_mm']:.6f} ;{row['name']}\n"
        for row in rows
    )


def read_table(content: str, name: str) -> list[dict[str, Any]]:
    """Number, name, radius and length of each tool. Raises TableRefused."""
    found = [_tool(line, f"{name}:{n}") for n, line in enumerate(content.splitlines(), 1) if _is_row(line)]
    return _unlike(found, name)


def _is_row(line: str) -> bool:
    return bool(line.partition(";")[0].strip())


def _tool(line: str, where: str) -> dict[str, Any]:
    words, _, remark = line.partition(";")
    if not _LINE.fullmatch(words):
        raise TableRefused("no_row", where=where, found=words.strip())
    values = {letter.upper(): float(number) for letter, number in _WORD.findall(words)}
    for letter in _OFFSETS:
        if values.get(letter):
            raise TableRefused("across", where=where, word=f"{letter}{values[letter]:g}")
    number, diameter = values.get("T", 0.0), values.get("D", 0.0)
    if not 1.0 <= number <= 99999.0 or number != math.floor(number):
        raise TableRefused("no_number", where=where)
    if diameter <= 0.0:
        raise TableRefused("no_diameter", where=where, tool=int(number))
    return {
        "number": int(number),
        "name": remark.strip()[:MAX_NAME],
        "radius_mm": diameter / 2.0,
        "length_mm": values.get("Z", 0.0),
    }


def json_text(rows: Iterable[Row]) -> str:
    """As JSON."""
    return json.dumps({"tools": [_iso(row) for row in rows]}, indent=1) + "\n"


def _iso(row: Row) -> dict[str, Any]:
    values = {**row, "radius_mm": 2.0 * (row["radius_mm"] + row["wear_radius_mm"])}
    values["length_mm"] += row["wear_length_mm"]
    values["taper_deg"] = math.degrees(row["taper_rad"])
    values["point_deg"] = math.degrees(row["point_rad"]) if row["point_rad"] < math.pi else None
    forms = {iso: ours for iso, ours in OTHER_FORMS.items() if values[ours]}
    made = {"number": row["number"], "description": row["name"]}
    return {**made, **{iso: round(values[ours], 9) for iso, ours in {**ISO, **forms}.items()}}


def read_json(content: str, name: str) -> list[dict[str, Any]]:
    """Each tool as far as it is said. Raises TableRefused."""
    try:
        rows = json.loads(content)["tools"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise TableRefused("no_json", file=name) from error
    if not isinstance(rows, list):
        raise TableRefused("no_list", file=name)
    return _unlike([_parsed_tool(row, name, n) for n, row in enumerate(rows, 1)], name)


def _parsed_tool(row: Any, file: str, n: int) -> dict[str, Any]:
    """The nth tool of the list. Raises TableRefused."""
    known = {"number", "description", *ISO, *OTHER_FORMS}
    place: dict[str, object] = {"file": file, "nth": n}
    if not isinstance(row, dict):
        raise TableRefused("no_object", **place, allowed=", ".join(sorted(known)))
    if unknown := set(row) - known:
        raise TableRefused("foreign", **place, name=sorted(unknown)[0], allowed=", ".join(sorted(known)))
    number = row.get("number")
    if type(number) is not int or not 1 <= number <= 99999:
        raise TableRefused("not_whole", **place, found=repr(number))
    made: dict[str, Any] = {"number": number, "name": str(row.get("description", ""))[:MAX_NAME]}
    for iso, ours in {**ISO, **OTHER_FORMS}.items():
        value = row.get(iso)
        if value is None:
            continue
        if type(value) not in (int, float) or not math.isfinite(value):
            raise TableRefused("not_a_number", **place, name=iso, found=repr(value))
        made[ours] = value / 2.0 if iso == "DC" else float(value)
    if made.get("radius_mm", 0.0) <= 0.0:
        raise TableRefused("no_dc", **place)
    return made


def _unlike(found: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
    numbers = [row["number"] for row in found]
    twice = next((n for n in numbers if numbers.count(n) > 1), None)
    if twice is not None:
        raise TableRefused("twice", file=name, tool=twice)
    if not found:
        raise TableRefused("empty", file=name)
    return found


def completed(rows: Iterable[Row], there: Mapping[int, Row], flute_mm: float | None) -> list[dict[str, Any]]:
    """The rows with the length that cuts: their own, that of the tool of this number, or ``flute_mm``.

    Wear is none: what a file says of a tool is as the tool is now.

    Raises TableRefused where none is known: a guess would let a shank into the part.
    """
    made = []
    for row in rows:
        known = row.get("flute_mm") or there.get(row["number"], {}).get("flute_mm") or flute_mm
        if known is None:
            raise TableRefused("no_flute", tool=row["number"])
        made.append({**row, "flute_mm": known, "wear_radius_mm": 0.0, "wear_length_mm": 0.0})
    return made


# ---- its picture


def picture(row: Row) -> str:
    """The tool's profile as SVG, to scale: what cuts, the neck above it, the holder; the tip below."""
    points = [point for _, outline in row["profile"] for point in outline]
    wide, top = max(rho for rho, _ in points), max(row["length_mm"], *(h for _, h in points))
    margin = 0.08 * max(top, 2.0 * wide)
    box = (-wide - margin, -top - margin, 2.0 * (wide + margin), top + 2.0 * margin)
    measures = f"D {2.0 * row['radius_mm']:g}, {row['flute_mm']:g} mm cut, length {row['length_mm']:g} mm"
    bodies = "".join(_closed(*body) for body in row["profile"])
    title = escape(f"T{row['number']} {row['name']}: {measures}")
    style = (
        ".cutter{fill:#c9a227}.shank{fill:#9aa3ab}.holder{fill:#5b6670}"
        f"path{{stroke:#222;stroke-width:{0.004 * box[3]:.4g}}}"
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{" ".join(f"{x:.4g}" for x in box)}" role="img">'
        f"<title>{title}</title><style>{style}</style>{bodies}</svg>\n"
    )


def _closed(name: str, outline: Sequence[tuple[float, float]]) -> str:
    """A body by its outline, both sides; SVG's y leads down."""
    sides = [*outline, *((-rho, h) for rho, h in reversed(outline))]
    return f'<path class="{name}" d="M{"L".join(f"{rho:.5g} {-h:.5g}" for rho, h in sides)}Z"/>'
