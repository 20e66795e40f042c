"""Machines for tests: the paper's four, a table with a head, two heads, and oblique ones."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from controller.geometry.vectors import Frame, Vector, X, Y, Z, unit
from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Axis, Bus, Following, Homing, Kind, Limits, Machine, Sense, Spindle, Tool

# Those that cut the paper's programs, which start no spindle: it is switched by hand.
TILTING = tuple(
    name
    for name, made in ((name, machine_file.load(name)) for name in machine_file.shipped())
    if len(made.rotary()) == 2 and made.spindle is not None and not made.spindle.is_driven
)

W = (0.0, 96.0, 120.0)  # the paper's tilt axis -> rotary centre, mm
R = (8.0, 0.0, 0.0)  # rotary centre -> part origin, mm

# (name, kind, direction, point) of the two rotaries: tables base to work, heads base to tool
ROTARIES: dict[str, tuple[tuple[str, Kind, Vector, Vector], tuple[str, Kind, Vector, Vector]]] = {
    "fig4a": (("A", Kind.TABLE, X, (0.0, 0.0, 0.0)), ("C", Kind.TABLE, Z, W)),
    "fig4b": (("B", Kind.TABLE, Y, (0.0, 0.0, 0.0)), ("C", Kind.TABLE, Z, W)),
    "fig4c": (("B", Kind.TABLE, Y, (0.0, 0.0, 0.0)), ("A", Kind.TABLE, X, W)),
    "fig4d": (("A", Kind.TABLE, X, (0.0, 0.0, 0.0)), ("B", Kind.TABLE, Y, W)),
    "table_head": (("B", Kind.HEAD, Y, (0.0, 0.0, 150.0)), ("C", Kind.TABLE, Z, (30.0, 40.0, 0.0))),
    "head_head": (("C", Kind.HEAD, Z, (0.0, 0.0, 200.0)), ("B", Kind.HEAD, Y, (0.0, 0.0, 120.0))),
    "oblique": (
        ("B", Kind.TABLE, unit((0.0, 1.0, 1.0)), (0.0, 0.0, 0.0)),
        ("C", Kind.TABLE, Z, (0.0, 0.0, 40.0)),
    ),
}


def machine(kind: str = "fig4a", **changes: object) -> Machine:
    """A machine of ``ROTARIES`` with the limits of the shipped trunnion; ``changes`` replace its fields."""
    return _build(kind, ROTARIES[kind], **changes)


def random_machine(rng: random.Random) -> Machine:
    """Two rotaries in any direction and place on any side; the one at the tool tilts it for sure."""
    while True:
        rows = (_random_rotary(rng, "A"), _random_rotary(rng, "C"))
        built = _build("random", rows)
        try:
            kinematics_of(built)
        except ValueError:
            continue
        return built


def _random_rotary(rng: random.Random, name: str) -> tuple[str, Kind, Vector, Vector]:
    direction = unit((rng.gauss(0, 1), rng.gauss(0, 1), rng.gauss(0, 1)))
    point = (rng.uniform(-200, 200), rng.uniform(-200, 200), rng.uniform(-200, 200))
    return name, rng.choice((Kind.TABLE, Kind.HEAD)), direction, point


def rotary_travel(built: Machine) -> tuple[tuple[float, float], tuple[float, float]]:
    first, second = (built.axes[i] for i in built.rotary())
    return (first.travel_min, first.travel_max), (second.travel_min, second.travel_max)


def _build(
    name: str,
    rotaries: tuple[tuple[str, Kind, Vector, Vector], tuple[str, Kind, Vector, Vector]],
    **changes: object,
) -> Machine:
    linear = [
        _axis(letter, Kind.LINEAR, d, (0.0, 0.0, 0.0), 1000.0, Limits(200.0, 2000.0, 50000.0), node)
        for node, (letter, d) in enumerate(zip("XYZ", (X, Y, Z), strict=True), start=1)
    ]
    travels = (math.radians(120.0), math.radians(3600.0))
    limits = (_degrees(180.0, 1500.0, 30000.0), _degrees(360.0, 3000.0, 60000.0))
    turning = [
        _axis(letter, side, d, p, travel, limit, node)
        for node, (letter, side, d, p), limit, travel in zip((4, 5), rotaries, limits, travels, strict=True)
    ]
    built = Machine(
        name=name,
        period_s=0.002,
        clearance_mm=2.0,
        lead_mm=3.0,
        retract_mm=200.0,
        rapid_share=0.5,
        gouge="refuse",
        max_bus_share=0.8,
        skip_limit_per_s=5.0,
        axes=(*linear, *turning),
        buses=(Bus("main", "virtual", "hub", 1_000_000),),
        tools=(Tool(1, "end mill 6", 3.0, 0.0, 15.0), Tool(2, "end mill 3", 1.5, 0.0, 15.0)),
        offsets=(Frame((W[0] + R[0], W[1] + R[1], W[2] + R[2])),) + (Frame(),) * 5,
        spindle=Spindle(24000.0, ""),  # it turns as programs say, and nobody is asked
        text="",
    )
    return replace(built, **changes)  # type: ignore[arg-type]


def _degrees(velocity: float, acceleration: float, jerk: float) -> Limits:
    return Limits(math.radians(velocity), math.radians(acceleration), math.radians(jerk))


def _axis(
    name: str, kind: Kind, direction: Vector, point: Vector, travel: float, limits: Limits, node: int
) -> Axis:
    counts = 200_000.0 if kind is Kind.LINEAR else math.degrees(200_000.0)
    return Axis(
        name=name,
        kind=kind,
        direction=direction,
        point_mm=point,
        sense=Sense.CARRIED,
        travel_min=-travel,
        travel_max=travel,
        limits=limits,
        counts_per_unit=counts,
        bus="main",
        node=node,
        profile="simulated",
        homing=Homing(),
        following_error=1.0,
        following=Following(0.1, 1.0, 0.01, tightens=True),
        brake=False,
    )
