"""The runs of the net, drawn from a seed: a machine, a program, and what an operator does meanwhile.

What is drawn is data from then on (``runs.INPUTS``), for the generators draw others tomorrow.
"""

from __future__ import annotations

import math
import random
import re
import tomllib
from collections.abc import Callable
from typing import Any, NamedTuple

import tomlkit
from support.machines import random_operators
from support.parts import (
    blu_compounds,
    cam_programs,
    lines_beside_surfaces,
    random_codes,
    random_grammar,
    vertical_rulings,
)
from support.soak import scenarios

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.runtime.bus_load import overload

SEED = "the net of order 16"
PERIODS_S = (0.0005, 0.001, 0.002, 0.002, 0.003, 0.005)
AS_SHIPPED = 0.25  # share of the machines
HOMED_MM = 560.0  # Z of drawn machines: above the longest tool
OPERATORS = 0.4  # share of the runs in which somebody does something


class Drawn(NamedTuple):
    """One run; ``events``: [tick, request, value] each."""

    name: str
    machine: str  # the whole text of its file
    program: str
    events: tuple[tuple[int, str, float], ...]


def draw(number: int, attempt: int, ticks_of: Callable[[Drawn], int]) -> Drawn:
    """The ``attempt``-th scenario of a number; ``ticks_of``: how long a run takes if nobody does anything.

    Raises ConfigError where its machine is none.
    """
    rng = random.Random(f"{SEED} {number} {attempt}")
    kind = sorted(PROGRAMS)[number % len(PROGRAMS)]
    text, made = machine(rng)
    drawn = Drawn(f"{number:03d} {kind.replace(' ', '-')} {made.name}", text, PROGRAMS[kind](rng, made), ())
    drawn = drawn._replace(program=_placed(rng, drawn.program))
    if rng.random() < OPERATORS and (ticks := ticks_of(drawn)) > 50:
        events = random_operators.events(rng, ticks, rng.randrange(1, 5))
        if rng.random() < 0.2:
            stop = rng.randrange(20, ticks)
            events = [one for one in events if one.tick < stop]
            drawn = drawn._replace(events=((stop, "STOP", 0.0),))
        told = sorted([*((e.tick, e.request.name, e.value) for e in events), *drawn.events])
        drawn = drawn._replace(events=tuple(told))
    return drawn


def _placed(rng: random.Random, program: str) -> str:
    """Now and then in another work offset, and without a word about the path."""
    if rng.random() < 0.3:
        program = program.replace("G54", rng.choice(("G55", "G56")), 1)
    if rng.random() < 0.2:
        program = re.sub(r"\bG61\b *", "", program, count=1)
    return program


# ---- machines


def machine(rng: random.Random) -> tuple[str, Machine]:
    """(text, machine): a shipped one, or one of its build with other limits, offsets and tools."""
    values = tomllib.loads(machine_file.load(rng.choice(machine_file.shipped())).text)
    values["machine"]["gouge"] = "warn"
    values.get("tools", {}).pop("file", None)
    if rng.random() >= AS_SHIPPED:
        _change(rng, values)
    text = tomlkit.dumps(values)
    made = machine_file.read(text, "machine.toml")
    fitting = [one for one in PERIODS_S if not overload(machine_file.with_period(made, one))]
    if fitting:
        values["machine"]["period_s"] = rng.choice(fitting)
    text = tomlkit.dumps(values)
    return text, machine_file.read(text, "machine.toml")


def _change(rng: random.Random, values: dict[str, Any]) -> None:
    values["machine"]["name"] += "-drawn"
    decades = {kind: rng.uniform(-0.6, 0.3) for kind in ("mm", "deg")}
    for axis in values["axis"]:
        _axis(rng, axis, decades)
    _general(rng, values["machine"])
    longest = 0.0
    for tool in values["tool"]:
        _tool(rng, tool)
        longest = max(longest, tool["length_mm"])
    _offsets(rng, values.setdefault("offsets", {}))
    # A changer's places are not moved; without one the tools may be as long as they like.
    if "changer" not in values:
        for axis in values["axis"]:
            if axis["name"] in "XYZ":
                axis["travel_mm"] = [-800.0, 800.0]
            if axis["name"] == "Z":
                axis["homing"]["position_mm"] = values["machine"]["retract_mm"] = HOMED_MM


def _axis(rng: random.Random, axis: dict[str, Any], decades: dict[str, float]) -> None:
    unit = "mm" if axis["kind"] == "linear" else "deg"
    for key in (f"velocity_{unit}_s", f"acceleration_{unit}_s2", f"jerk_{unit}_s3"):
        axis[key] = round(axis[key] * 10.0 ** (decades[unit] + rng.uniform(-0.3, 0.3)), 3)
    axis[f"counts_per_{unit}"] = rng.choice((200_000, -200_000, 65_536, 20_000, -12_345.6))
    if unit == "deg":
        point = axis.get("point_mm", [0.0, 0.0, 0.0])
        axis["point_mm"] = [round(x + rng.choice((0.0, rng.uniform(-30.0, 30.0))), 4) for x in point]
        axis["direction"] = _turned(rng, axis["direction"])
        if axis["kind"] == "table":
            axis["sense"] = rng.choice(("carried", "iso"))
    if rng.random() < 0.2:
        axis["feed_forward"] = True
    if rng.random() < 0.2:
        axis["pitch"] = {f"backlash_{unit}": round(rng.uniform(0.0, 0.02), 4)}
    elif rng.random() < 0.2:
        low, high = axis[f"travel_{unit}"]
        axis["pitch"] = {
            f"at_{unit}": [low, 0.5 * (low + high) + 1.0, high],
            f"up_{unit}": [round(rng.uniform(-0.02, 0.02), 4) for _ in range(3)],
        }


def _turned(rng: random.Random, direction: list[float]) -> list[float]:
    """An axis as measured, somewhere else, or as it was."""
    far = rng.choice((0.0, 0.0, 0.002, 0.3))
    if far == 0.0:
        return direction
    turned = [float(c) + rng.uniform(-far, far) for c in direction]
    return [round(c / math.hypot(*turned), 9) for c in turned]


def _general(rng: random.Random, values: dict[str, Any]) -> None:
    values["clearance_mm"] = round(rng.uniform(1.0, 8.0), 2)
    values["lead_mm"] = round(rng.uniform(0.5, 4.0), 2)
    values["rapid_share"] = rng.choice((1.0, 0.5, 0.83))
    values["placement"] = rng.choice(("single", "single", "double", "optimal", "auto"))
    values["tool_lines"] = rng.choice(("great_circle", "joints"))
    for key, drawn in (
        ("lead_feed", (600.0, 3000.0)),
        ("link_mm", (5.0, 30.0)),
        ("tip_acceleration_mm_s2", (200.0, 3000.0)),
        ("axis_speed_deg_s", (20.0, 200.0)),
    ):
        if rng.random() < 0.3:
            values[key] = round(rng.uniform(*drawn), 2)


def _tool(rng: random.Random, tool: dict[str, Any]) -> None:
    tool["length_mm"] = round(rng.uniform(25.0, 110.0), 3)
    radius = tool["radius_mm"]
    if rng.random() < 0.2:
        tool["corner_mm"] = rng.choice((radius, round(0.3 * radius, 3)))
    if rng.random() < 0.2:
        tool["wear_radius_mm"] = round(rng.uniform(-0.05, 0.05), 4)
        tool["wear_length_mm"] = round(rng.uniform(-0.3, 0.3), 4)


def _offsets(rng: random.Random, offsets: dict[str, Any]) -> None:
    base = offsets.get("G54", [0.0, 0.0, 0.0])
    for name in ("G54", "G55", "G56"):
        near = [round(x + rng.uniform(-20.0, 20.0), 3) for x in base]
        offsets[name] = near
        if rng.random() < 0.4:
            turned = [0.0, 0.0, round(rng.uniform(-180.0, 180.0), 3)]
            if rng.random() < 0.4:
                turned[0] = round(rng.uniform(-3.0, 3.0), 3)
            offsets[name] = {"origin_mm": near, "turned_deg": turned}


# ---- programs


def _head(rng: random.Random) -> str:
    path = rng.choice(("G61", "G64", "G64 P0.02", "G64 P0.05 Q0.1", ""))
    return f"G21 G90 G54 {path}\nT{rng.randrange(1, 5)} M6\nG43\nS{rng.randrange(1000, 9000)} M3\n"


def _rotary_words(rng: random.Random, made: Machine, most_deg: float) -> str:
    return " ".join(
        f"{axis.name}{rng.uniform(-most_deg, most_deg):.3f}" for axis in made.axes if axis.is_rotary
    )


def _at(rng: random.Random, *low_high: tuple[float, float]) -> str:
    return " ".join(f"{a}{rng.uniform(*b):.3f}" for a, b in zip("XYZ", low_high, strict=False))


def _milled(rng: random.Random, _: Machine) -> str:
    """Lines, arcs, helices, dwells, speeds and coolant."""
    rows = [f"G0 {_at(rng, (-30, 30), (-30, 30), (30, 50))}", f"G1 Z{rng.uniform(5, 20):.3f} F800 M8"]
    for _ in range(rng.randrange(4, 10)):
        i, j = rng.uniform(-12, 12), rng.uniform(-12, 12)
        rows.append(
            rng.choice(
                (
                    f"G1 {_at(rng, (-30, 30), (-30, 30))} F{rng.randrange(300, 5000)}",
                    f"G91 {rng.choice(('G2', 'G3'))} X{2 * i:.3f} Y{2 * j:.3f} I{i:.3f} J{j:.3f}\nG90",
                    f"G91 {rng.choice(('G2', 'G3'))} I{i:.3f} J{j:.3f} Z{rng.uniform(-2, 2):.3f}\nG90",
                    f"G4 P{rng.uniform(0.01, 0.2):.3f}",
                    f"S{rng.randrange(1000, 9000)}",
                    f"G93 G1 {_at(rng, (-30, 30), (-30, 30))} F{rng.uniform(20, 90):.2f}\nG94 F900",
                    rng.choice(("M9", "M7", "M8", "M1", "G80")),
                )
            )
        )
    return _head(rng) + "\n".join([*rows, "M5 M9", "G0 Z60", "M30", ""])


def _turning(rng: random.Random, made: Machine) -> str:
    """Lines with words of rotaries, without tool-centre control."""
    rows = [f"G0 {_at(rng, (-20, 20), (-20, 20), (40, 60))}"]
    rows += [
        f"{rng.choice(('G0', 'G1', 'G1'))} {_at(rng, (-20, 20), (-20, 20), (20, 60))} "
        f"{_rotary_words(rng, made, 25.0)} F{rng.randrange(300, 4000)}"
        for _ in range(rng.randrange(3, 8))
    ]
    return _head(rng) + "\n".join([*rows, "G0 Z80", "M30", ""])


def _tips(rng: random.Random, made: Machine) -> str:
    """Tool-centre control with words of rotaries."""
    rows = [f"G43.4 H{rng.randrange(1, 5)}", f"G0 {_at(rng, (-10, 10), (-10, 10), (40, 60))}"]
    for _ in range(rng.randrange(3, 9)):
        words = _rotary_words(rng, made, 20.0) if rng.random() < 0.8 else ""
        rows.append(f"G1 {_at(rng, (-30, 30), (-30, 30), (20, 50))} {words} F{rng.randrange(300, 4000)}")
    return _head(rng).replace("G43\n", "") + "\n".join([*rows, "G49", "M30", ""])


def _tilted(rng: random.Random, _: Machine) -> str:
    """Drilling and lines in a tilted plane."""
    plane = f"G68.2 {_at(rng, (-10, 10), (-10, 10), (0, 10))} I{rng.uniform(-90, 90):.2f} "
    plane += f"J{rng.uniform(0, 25):.2f} K{rng.uniform(-90, 90):.2f}\nG53.1"
    rows = [plane, f"G0 {_at(rng, (-10, 10), (-10, 10), (25, 35))}"]
    cycle = rng.choice(("G81", "G82 P0.1", "G83 Q2.", "G73 Q3.", "G85"))
    rows.append(f"G98 {cycle} {_at(rng, (-10, 10), (-10, 10))} Z-4. R3. F{rng.randrange(200, 1500)}")
    rows += [_at(rng, (-10, 10), (-10, 10)) for _ in range(rng.randrange(0, 3))]
    rows += ["G80", f"G1 {_at(rng, (-10, 10), (-10, 10), (5, 20))}", f"G3 I{rng.uniform(2, 6):.3f} J1."]
    return _head(rng) + "\n".join([*rows, "G0 Z30", "G69", "M30", ""])


def _cone(rng: random.Random, _: Machine) -> str:
    head = "G21 G90 G54 G61\nT2 M6\nS6000 M3\n"
    base, height = rng.uniform(4, 15), rng.uniform(6, 20)
    return head + (
        f"G51 X{base:.2f} Y0. Z-{height:.2f} I0. J0. K-{height:.2f} H{height:.2f} "
        f"R{base * rng.uniform(0.2, 0.8):.2f} D{rng.uniform(60, 360):.1f} "
        f"F{rng.randrange(300, 3000)}.\nM5\nM30\n"
    )


def _clouds(rng: random.Random, _: Machine) -> str:
    """Short five-axis lines with links and corners."""
    cloud = rng.choice(
        (
            lambda: cam_programs.bowl(2, rng.uniform(4, 10), link=rng.choice(("arc", "corner"))),
            lambda: cam_programs.wall(rng.randrange(60, 160)),
            lambda: cam_programs.bowl(2, 5.0).noisy(0.003, rng.randrange(1000)),
        )
    )()
    path = rng.choice(("G61", "G64 P0.01", "G64 P0.05 Q0.2", "G64"))
    return cam_programs.text(cloud, rng.randrange(500, 5000), True, path, rng.random() < 0.2)[0]


def _joined(rng: random.Random, _: Machine) -> str:
    """Compounds in few decimals, with no word of the path."""
    make = rng.choice((blu_compounds.general, blu_compounds.like_the_papers))
    made = make(rng.randrange(10**6), rng.choice((2, 3)))
    return blu_compounds.text(made, rng.choice((100.0, 1000.0, 3000.0)), rng.choice(("G41", "G42")))


def _upright(rng: random.Random, _: Machine) -> str:
    make = rng.choice((vertical_rulings.random_ruled, vertical_rulings.random_rational))
    return make(rng.randrange(10**6)).source


PROGRAMS: dict[str, Callable[[random.Random, Machine], str]] = {
    **scenarios.PARTS,
    "lines and arcs": _milled,
    "rotary lines": _turning,
    "tool centre": _tips,
    "tilted plane": _tilted,
    "cone": _cone,
    "five-axis cloud": _clouds,
    "joined in few decimals": _joined,
    "vertical rulings": _upright,
    "beside surfaces": lambda rng, _: lines_beside_surfaces.part(rng.randrange(10**6)).source,
    "codes": lambda rng, _: random_codes.program(rng),
    "grammar": lambda rng, _: random_grammar.program(rng),
    "shipped contour": lambda _, __: machine_file.shipped_program("contour").read_text(),
}


def sound(number: int, attempt: int, ticks_of: Callable[[Drawn], int]) -> Drawn | None:
    """As ``draw``; None where what was drawn is no machine."""
    try:
        return draw(number, attempt, ticks_of)
    except (ConfigError, ValueError):
        return None
