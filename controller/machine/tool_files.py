"""Tool tables of others, in and out: LinuxCNC's ``tool.tbl`` and JSON with the property names of ISO 13399.

    T7 P7 D6.000000 Z52.400000 ;end mill 6 mm

``tool.tbl`` has a line per tool: number, pocket, diameter, length, behind ``;`` what the operator calls it.

    {"tools": [{"number": 7, "description": "end mill", "DC": 6.0, "LF": 52.4, "APMX": 15.0, "RE": 0.5}]}

DC is the cutting diameter, LF the functional length, APMX the length that cuts, RE the corner radius, mm;
TAPER, the half angle of the flank in degrees, is our own. Rows are as ``setup_data.tools_of`` tells them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from xml.sax.saxutils import escape

from controller.machine.toml_table import ConfigError

Row = Mapping[str, Any]
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)
_LINE = re.compile(rf"\s*(?:{_WORD.pattern}\s*)*", re.IGNORECASE)
_OFFSETS = "XYABCUVW"  # of tools on lathes and of probes: none are known here
ISO = {"DC": "radius_mm", "LF": "length_mm", "APMX": "flute_mm", "RE": "corner_mm", "TAPER": "taper_deg"}
MAX_NAME = 60


def table_text(rows: Iterable[Row]) -> str:
    """As ``tool.tbl``: lengths and radii as they are now, wear laid in."""
    return "".join(
        f"T{row['number']} P{row['number']} D{2.0 * (row['radius_mm'] + row['wear_radius_mm']):.6f} "
        f"Z{row['length_mm'] + row['wear_length_mm']:.6f} ;{row['name']}\n"
        for row in rows
    )


def read_table(text: str, name: str) -> list[dict[str, Any]]:
    """Number, name, radius and length of each tool. Raises ConfigError."""
    found = [_tool(line, f"{name}:{n}") for n, line in enumerate(text.splitlines(), 1) if _is_row(line)]
    return _unlike(found, name)


def _is_row(line: str) -> bool:
    return bool(line.partition(";")[0].strip())


def _tool(line: str, where: str) -> dict[str, Any]:
    words, _, remark = line.partition(";")
    if not _LINE.fullmatch(words):
        raise ConfigError(
            f"{where}: {words.strip()!r} is no row of a tool table; write T, P, D and Z with numbers."
        )
    values = {letter.upper(): float(number) for letter, number in _WORD.findall(words)}
    for letter in _OFFSETS:
        if values.get(letter):
            raise ConfigError(
                f"{where}: {letter}{values[letter]:g} is an offset across the tool, none has one: remove it."
            )
    number, diameter = values.get("T", 0.0), values.get("D", 0.0)
    if not 1.0 <= number <= 99999.0 or number != math.floor(number):
        raise ConfigError(f"{where}: has no number of a tool; write T1 to T99999 first.")
    if diameter <= 0.0:
        raise ConfigError(f"{where}: T{number:.0f} has no diameter; write D above 0.")
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
    made = {"number": row["number"], "description": row["name"]}
    return {**made, **{iso: round(values[ours], 9) for iso, ours in ISO.items()}}


def read_json(text: str, name: str) -> list[dict[str, Any]]:
    """Each tool as far as it is said. Raises ConfigError."""
    try:
        rows = json.loads(text)["tools"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ConfigError(f'{name}: is no JSON with a list "tools"; write one.') from error
    if not isinstance(rows, list):
        raise ConfigError(f'{name}: "tools" is no list; write one object per tool in it.')
    return _unlike([_said(row, f"{name}: tool {n} of the list") for n, row in enumerate(rows, 1)], name)


def _said(row: Any, where: str) -> dict[str, Any]:
    known = {"number", "description", *ISO}
    if not isinstance(row, dict) or (unknown := set(row) - known):
        found = (
            f"{sorted(unknown)[0]!r} is none of its properties" if isinstance(row, dict) else "is no object"
        )
        raise ConfigError(f"{where}: {found}; allowed are {', '.join(sorted(known))}.")
    number = row.get("number")
    if type(number) is not int or not 1 <= number <= 99999:
        raise ConfigError(f'{where}: "number" is {number!r}; it must be a whole number from 1 to 99999.')
    made: dict[str, Any] = {"number": number, "name": str(row.get("description", ""))[:MAX_NAME]}
    for iso, ours in ISO.items():
        value = row.get(iso)
        if value is None:
            continue
        if type(value) not in (int, float) or not math.isfinite(value):
            raise ConfigError(f"{where}: {iso} is {value!r}; it must be a number.")
        made[ours] = value / 2.0 if iso == "DC" else float(value)
    if made.get("radius_mm", 0.0) <= 0.0:
        raise ConfigError(f"{where}: has no DC, the cutting diameter; write it, above 0.")
    return made


def _unlike(found: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
    numbers = [row["number"] for row in found]
    twice = next((n for n in numbers if numbers.count(n) > 1), None)
    if twice is not None:
        raise ConfigError(f"{name}: T{twice} is there twice; leave one row.")
    if not found:
        raise ConfigError(f"{name}: has no tool in it; write a row for each.")
    return found


def completed(rows: Iterable[Row], there: Mapping[int, Row], flute_mm: float | None) -> list[dict[str, Any]]:
    """The rows with the length that cuts: their own, that of the tool of this number, or ``flute_mm``.

    Raises ConfigError where none is known: a guess would let a shank into the part.
    """
    made = []
    for row in rows:
        known = row.get("flute_mm") or there.get(row["number"], {}).get("flute_mm") or flute_mm
        if known is None:
            raise ConfigError(
                f"T{row['number']}: the file does not say the length that cuts, and the table has it not; "
                "give --flute, or APMX in JSON."
            )
        made.append({**row, "flute_mm": known})
    return made


# ---- its picture


def picture(row: Row) -> str:
    """The tool's profile as SVG, to scale: what cuts, the neck above it, the holder; the tip below."""
    radius, flute, corner = row["radius_mm"], row["flute_mm"], min(row["corner_mm"], row["radius_mm"])
    wider = math.tan(row["taper_rad"])
    above = [part for part in row["holder"] or ()]
    top = max([row["length_mm"], 1.2 * flute, *(high for _, high, _ in above)])
    wide = max([radius + wider * flute, *(half for _, _, half in above)])
    body = _outline(radius, flute, corner, wider)
    neck = _box(flute, max(top if not above else above[0][0], flute), radius + wider * flute, "neck")
    parts = [body, neck, *(_box(low, high, half, "holder") for low, high, half in above)]
    margin = 0.08 * max(top, 2.0 * wide)
    box = (-wide - margin, -top - margin, 2.0 * (wide + margin), top + 2.0 * margin)
    measures = f"D {2.0 * radius:g}, {flute:g} mm cut, length {row['length_mm']:g} mm"
    title = escape(f"T{row['number']} {row['name']}: {measures}")
    style = (
        ".cut{fill:#c9a227}.neck{fill:#9aa3ab}.holder{fill:#5b6670}"
        f"path{{stroke:#222;stroke-width:{0.004 * box[3]:.4g}}}"
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{" ".join(f"{x:.4g}" for x in box)}" role="img">'
        f"<title>{title}</title><style>{style}</style>{''.join(parts)}</svg>\n"
    )


def _outline(radius: float, flute: float, corner: float, wider: float) -> str:
    """What cuts, from the tip (y = 0) upwards, both sides; SVG's y leads down."""
    half = radius + wider * flute
    flat = radius - corner
    arc = f"A{corner:.5g} {corner:.5g} 0 0 0 {radius:.5g} {-corner:.5g}" if corner else ""
    back = f"A{corner:.5g} {corner:.5g} 0 0 0 {-flat:.5g} 0" if corner else ""
    sides = f"L{half:.5g} {-flute:.5g}L{-half:.5g} {-flute:.5g}L{-radius:.5g} {-corner:.5g}"
    return f'<path class="cut" d="M{-flat:.5g} 0L{flat:.5g} 0{arc}{sides}{back}Z"/>'


def _box(low: float, high: float, half: float, what: str) -> str:
    if high <= low:
        return ""
    return f'<path class="{what}" d="M{-half:.5g} {-low:.5g}H{half:.5g}V{-high:.5g}H{-half:.5g}Z"/>'


FORMATS: Sequence[str] = (".tbl", ".json")
