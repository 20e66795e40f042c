"""What may be measured, by name: what it takes, its values with bounds, and whether it tells what to write.

Page, REST and command line evaluate by these. A table of touches is that of ``touch_table``, one of an axis
that of ``axis_accuracy``; ticks are what a recorder holds of a run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from controller.calibration import DOFS, MAX_DEG, MAX_MM
from controller.calibration.refusal import Refusal
from controller.machine.model import OFFSETS

Takes = Literal["touches", "laser", "ticks", "nothing"]
PLANES = ("XY", "YZ", "ZX")
MAX_TEXT = 20


class Amount(NamedTuple):
    """A number with its bounds; without ``usual`` it must be said."""

    lowest: float
    highest: float
    unit: str
    usual: float | None = None
    whole: bool = False


class Choice(NamedTuple):
    """One of some words, or where there are none any short one; without ``usual`` it must be said."""

    choices: Sequence[str] = ()
    usual: str | None = None


class Measurement(NamedTuple):
    """``program``: whether it is about surfaces of one; "maybe": it goes without, too."""

    takes: Takes
    values: Mapping[str, Amount | Choice]
    writes: bool = False  # a machine file
    program: Literal["no", "maybe", "yes"] = "no"


_MM, _PLACE = "mm", (-5000.0, 5000.0, "mm")
_SPHERE = Amount(0.5, 200.0, _MM)
_OFFSET = Choice(OFFSETS, OFFSETS[0])
MEASUREMENTS: Mapping[str, Measurement] = {
    "rotaries": Measurement(
        "touches",
        {
            "sphere_radius": _SPHERE,
            "max_mm": Amount(0.0, 100.0, _MM, MAX_MM),
            "max_deg": Amount(0.0, 10.0, "deg", MAX_DEG),
            "add": Amount(0, 24, "", 4, whole=True),
        },
        writes=True,
    ),
    "positions": Measurement(
        "nothing",
        {
            **{f"centre_{axis}": Amount(*_PLACE) for axis in "xyz"},
            "sphere_radius": _SPHERE,
            **{f"stem_{axis}": Amount(-1.0, 1.0, "", float(axis == "k")) for axis in "ijk"},
            "length": Amount(0.0, 2000.0, _MM),
            "ball_radius": Amount(0.05, 50.0, _MM, 3.0),
            "count": Amount(3, 100, "", 16, whole=True),
        },
    ),
    "axis": Measurement("laser", {"axis": Choice()}, writes=True),
    "circle": Measurement("ticks", {"axes": Choice(PLANES, "XY")}),
    "tip": Measurement("ticks", {"length": Amount(0.0, 2000.0, _MM, 0.0)}),
    "thermal": Measurement("touches", {"offset": _OFFSET}, writes=True),
    "part": Measurement("touches", {"offset": _OFFSET, "free": Choice((), DOFS)}, True, "maybe"),
    "inspect": Measurement("touches", {"offset": _OFFSET}, False, "yes"),
    "points": Measurement(
        "nothing",
        {
            "line": Amount(1, 10_000_000, "", whole=True),
            "along": Amount(1, 200, "", 8, whole=True),
            "across": Amount(1, 50, "", 3, whole=True),
        },
        program="yes",
    ),
}


def listed() -> list[dict[str, Any]]:
    """Every measurement as page and REST have it."""
    return [
        {
            **one._asdict(),
            "name": name,
            "values": [{"name": value, **kind._asdict()} for value, kind in one.values.items()],
        }
        for name, one in MEASUREMENTS.items()
    ]


def named(name: str) -> Measurement:
    """Raises Refusal."""
    if name not in MEASUREMENTS:
        raise Refusal("no_measurement", found=name, allowed=", ".join(MEASUREMENTS))
    return MEASUREMENTS[name]


def complete(name: str, said: Mapping[str, object]) -> dict[str, Any]:
    """All values of a measurement, those that were not said as usual. Raises Refusal."""
    known = named(name).values
    if foreign := next((one for one in said if one not in known), None):
        raise Refusal("no_value", name=foreign, measurement=name, allowed=", ".join(known))
    return {value: _value(value, kind, said.get(value)) for value, kind in known.items()}


def _value(name: str, kind: Amount | Choice, said: object) -> Any:
    found = kind.usual if said is None else said
    if isinstance(kind, Choice):
        if isinstance(found, str) and len(found) <= MAX_TEXT and (found in kind.choices or not kind.choices):
            return found
        raise Refusal("value_choice", name=name, found=found, allowed=", ".join(kind.choices) or "text")
    if (
        isinstance(found, int | float)
        and not isinstance(found, bool)
        and kind.lowest <= found <= kind.highest
        and (not kind.whole or found == int(found))
    ):
        return int(found) if kind.whole else float(found)
    bounds = {"lowest": kind.lowest, "highest": kind.highest, "unit": kind.unit}
    raise Refusal("value_whole" if kind.whole else "value_number", name=name, found=found, **bounds)
