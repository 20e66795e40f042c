"""The tilt that a check offers lets a cut go on where the rotary would turn under the standing tool."""

from __future__ import annotations

import math
import random
import re
from dataclasses import replace

import pytest
from support.machines.traced_programs import mill, named, sentences, trace

from controller.machine.model import Machine
from controller.machine.offset_table import OffsetTable

HEIGHT_MM, LENGTH_MM = 10.0, 30.0
SLOW = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 60)]


def wall(begin: float, turned: float, along: tuple[float, float], across: tuple[float, float]) -> str:
    """A straight wall on the line that is ``turned`` (rad), from ``begin`` (mm) on: its upper edge is off the
    lower one by so many mm at its begin and at its end, along the line and across it.
    """
    rows = []
    for z in (HEIGHT_MM, 0.0):
        for k in range(4):
            share, up = k / 3.0, z / HEIGHT_MM
            a = begin + share * LENGTH_MM + up * (along[0] + share * (along[1] - along[0]))
            b = up * (across[0] + share * (across[1] - across[0]))
            x, y = a * math.cos(turned) - b * math.sin(turned), a * math.sin(turned) + b * math.cos(turned)
            rows.append(f"X{x:.6f} Y{y:.6f} Z{z:.1f}")
    first, *rest = rows
    return "\n".join([f"G52 {first} F1500.", *rest]) + "\n"


def tilted(built: Machine, turned: tuple[float, float, float]) -> Machine:
    """The machine with its part set up so."""
    first, *others = built.offsets
    frame = OffsetTable(origin_mm=first.origin, turned_deg=turned).offset().frame
    return replace(built, offsets=(frame, *others))


@pytest.mark.parametrize("seed", [*range(3), *SLOW])
def test_the_tilt_of_the_note_mends_the_stop(seed: int) -> None:
    """A wall that rights itself along its line, and one that leans across it from there on."""
    draw = random.Random(seed)
    turned = draw.uniform(-math.pi, math.pi)
    rights, leans = draw.choice((-1.0, 1.0)) * draw.uniform(0.5, 4.0), draw.uniform(0.5, 3.0)
    text = wall(-LENGTH_MM, turned, (rights, 0.0), (0.0, 0.0)) + wall(0.0, turned, (0.0, 0.0), (0.0, leans))
    built = mill()
    traced = trace(text, built)
    (swivel,) = named(traced, "swivel")
    note = sentences(traced)
    degrees = math.degrees(abs(swivel.end[4] - swivel.start[4]))
    assert f"C turns by {degrees:.1f} degrees" in note
    found = re.search(r"turned_deg = \[(.+?)\]", note)
    assert found is not None
    x, y, z = map(float, found[1].split(","))
    assert not named(trace(text, tilted(built, (x, y, z))), "swivel")
