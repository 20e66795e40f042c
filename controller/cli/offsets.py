"""``directrix offsets``: what is set at a machine beside its file; set it, or touch off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any
from urllib.parse import quote

import typer
from rich.table import Table

from controller.cli import remote, speech
from controller.cli.client import Url, connected, named
from controller.verify.console import Refused, answered, say, show

EVERY = Mapping[str, str | float]


def offsets(
    name: Annotated[str, typer.Argument()] = "",
    origin: str = "",
    turned: str = "",
    rotary: list[str] | None = None,
    touch: list[str] | None = None,
    tool: int | None = None,
    forget: str | None = None,
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Show offsets, shift, reference points and kept parameters, and where each comes from; set an offset."""
    if not name and (origin or turned or rotary or touch or tool):
        raise typer.BadParameter(speech.say("offset_no_name"))
    if forget is not None and not forget.strip():
        raise typer.BadParameter(speech.say("offset_forget_what"))
    with connected(url, as_json) as machine:
        if name:
            values = _values(machine, name, origin, turned, named(rotary))
            reads = typed(touch)
            if not (values or reads):
                raise Refused(speech.say("offset_nothing", name=name))
            with machine.control(take_over):
                if values:
                    machine.put(f"offsets/{quote(name, safe='')}", values)
                if reads:
                    machine.post(f"offsets/{quote(name, safe='')}/touch_off", {**reads, "tool": tool})
        if forget:
            with machine.control(take_over):
                machine.delete(f"offsets/{quote(forget, safe='')}")
        found = machine.get("offsets")
        if not answered(as_json, **found):
            show.print(table(found))


def _values(machine: remote.Machine, name: str, origin: str, turned: str, rotary: EVERY) -> dict[str, Any]:
    """What is set: what is not said stays as it is. Nothing where nothing is said. Raises Refused."""
    if not (origin or turned or rotary):
        return {}
    now = machine.get("offsets")["offsets"].get(name, {})
    values: dict[str, Any] = {key: now[key] for key in ("origin_mm", "turned_deg") if key in now}
    if origin:
        values["origin_mm"] = _three("--origin", origin)
    if turned:
        values["turned_deg"] = _three("--turned", turned)
    return {**values, **({"rotary_deg": _letters("--rotary", rotary, "C=15")} if rotary else {})}


def _three(option: str, typed: str) -> list[float]:
    """Raises Refused."""
    try:
        x, y, z = (float(part) for part in typed.split(","))
    except ValueError:
        raise Refused(speech.say("three_numbers", option=option, found=typed)) from None
    return [x, y, z]


def typed(touch: Sequence[str] | None) -> dict[str, str]:
    """By axis what it is to read, as it was typed: +0.1 is no number. Raises Refused."""
    return {axis.upper(): str(one) for axis, one in named(touch, [*"XYZABCxyzabc"]).items()}


def _letters(option: str, typed: EVERY, example: str) -> dict[str, float]:
    """Raises Refused."""
    found = dict[str, float]()
    for axis, value in typed.items():
        if not isinstance(value, float):
            raise Refused(speech.say("letters", option=option, found=f"{axis}={value}", example=example))
        found[axis.upper()] = value
    return found


def table(found: Mapping[str, Any]) -> Table:
    made = Table()
    for head in ("name", "xyz", "rotaries", "turned", "source"):
        made.add_column(say(f"table.{head}"))
    sources = {source: say(f"table.source.{source}") for source in ("file", "machine")}
    for name, row in found["offsets"].items():
        if not row["unset"]:
            turned = _numbers(row["turned_deg"]) if any(row["turned_deg"]) else ""
            made.add_row(name, _numbers(row["origin_mm"]), _rotary(row), turned, sources[row["source"]])
    shift = found["shift"]
    state = " (G92.2)" if shift["suspended"] else ""
    made.add_row(f"G92{state}", _numbers(shift["origin_mm"]), _rotary(shift), "", sources[shift["source"]])
    for name, row in found["references"].items():
        rotary = {axis: value for axis, value in row.items() if axis in "ABC"}
        xyz = _numbers([row[axis] for axis in "XYZ"])
        made.add_row(name, xyz, _rotary({"rotary_deg": rotary}), "", sources[row["source"]])
    for name, value in found["parameters"].items():
        made.add_row(name, f"{value:g}", "", "", sources["machine"])
    return made


def _numbers(values: list[float]) -> str:
    return " ".join(f"{round(value, 3) + 0.0:.3f}" for value in values)  # no -0.000


def _rotary(row: Mapping[str, Any]) -> str:
    return " ".join(f"{axis}{value:.3f}" for axis, value in row.get("rotary_deg", {}).items() if value)
