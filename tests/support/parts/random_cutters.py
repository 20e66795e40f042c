"""Unseen surfaces with unseen cutters: cones, ruled surfaces, blades; necks, shanks, tapers, balls."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from support.parts import random_nurbs, random_surfaces

from controller.machine import machine_file
from controller.machine.model import Machine, Tool

RULING_MM = 15.0  # of all but cones, about


def drawn(seed: int) -> tuple[str, Machine]:
    """A program with cuts by T1, and the trunnion with that tool and a form tolerance; gouges only warn."""
    rng = np.random.default_rng(seed)
    kind, side = str(rng.choice(["ruled", "blade", "cone"])), str(rng.choice(["G41", "G42"]))
    side += f" P{rng.choice([1, 1, 2, 3])}"
    if kind == "cone":
        text, ruling = _cone(rng, side)
    elif kind == "ruled":
        members = random_surfaces.compound(seed, int(rng.choice([1, 2])))
        text, ruling = random_surfaces.text(members, 600.0, side), RULING_MM
    else:
        text, ruling = random_nurbs.text(*random_nurbs.blade(seed), 600.0, side), RULING_MM
    made = machine_file.load("trunnion")
    tolerance = float(rng.choice([0.01, 0.05, 0.2]))
    tools = (_tool(rng, ruling), *made.tools[1:])
    return text.replace("T2", "T1"), replace(made, tools=tools, tolerance_mm=tolerance, gouge="warn")


def _cone(rng: np.random.Generator, side: str) -> tuple[str, float]:
    radius, height = float(rng.uniform(6.0, 20.0)), float(rng.uniform(5.0, 20.0))
    upper, swept = (
        float(rng.uniform(0.0, 1.4)) * radius,
        float(rng.choice([-1, 1]) * rng.uniform(40.0, 300.0)),
    )
    size = f"H{height:.3f} R{upper:.3f} D{swept:.3f}"
    cut = f"G51 X{radius:.3f} Y0. Z0. I0. J0. K0. {size} F600."
    return f"G21 G90 G54 G61\nT1 M6\nS6000 M3\n{side}\n{cut}\nG40\nM30\n", math.hypot(height, radius - upper)


def _tool(rng: np.random.Generator, ruling_mm: float) -> Tool:
    radius = float(rng.choice([0.8, 1.5, 3.0, 5.0]))
    corner, taper = (
        float(rng.choice([0.0, 0.0, radius, radius / 3.0])),
        float(rng.choice([0.0, 0.0, 0.04, 0.12])),
    )
    flute = float(rng.choice([0.7 * ruling_mm, ruling_mm + 0.1, ruling_mm + 3.0, 2.0 * ruling_mm])) + corner
    wide = radius + (flute - corner) * math.tan(taper)
    holders = {
        "none": (),
        "neck": ((flute, flute + 60.0, 0.8 * radius),),
        "shank": ((flute, flute + 60.0, wide),),
        "holder": ((flute + 6.0, flute + 60.0, wide + 4.0),),
    }
    held, below = holders[str(rng.choice(list(holders)))], float(rng.choice([0.0, 0.0, 1.0]))
    return Tool(
        1, "drawn", radius, 0.0, flute, corner_mm=corner, taper_rad=taper, holder=held, below_mm=below
    )
