"""Hold, go aside, fit another tool, come back: nothing gets into the walls, and nothing waits in contact."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.machines.held_walls import HEIGHT_MM, KINDS, OLD, Came, Held, Part, machine

from controller.machine.model import Tool

DEEP_MM = 0.05  # the form tolerance of the programs
CLEAR_MM = 0.15  # off every wall while it waits
WALL = Part.surfaces(
    [
        (
            np.array([(0.0, 0.0, 20.0), (10.0, 1.0, 20.0), (20.0, 1.0, 20.0), (30.0, 0.0, 20.0)]),
            np.array([(0.0, 0.0, 0.0), (10.0, 2.0, 0.0), (20.0, 2.0, 0.0), (30.0, 0.0, 0.0)]),
        ),
        (
            np.array([(30.0, 0.0, 20.0), (40.0, -1.0, 20.0), (50.0, -1.0, 20.0), (60.0, 0.0, 20.0)]),
            np.array([(30.0, 0.0, 0.0), (40.0, -2.0, 0.0), (50.0, -2.0, 0.0), (60.0, 0.0, 0.0)]),
        ),
    ]
)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Held]:
    yield Held(tmp_path_factory.mktemp("aside"))


def tool(radius_mm: float, length_mm: float = 0.0, **shape: Any) -> Tool:
    old = machine().tool(2)
    assert old is not None
    return replace(old, radius_mm=radius_mm, length_mm=length_mm, **shape)


def assert_off(came: Came, label: object) -> None:
    assert max(came.on_the_way, came.after) < DEEP_MM, (label, came)
    assert came.waiting < -CLEAR_MM, (label, came)


def middle(bench: Held, part: Part) -> int:
    ticks = bench.cutting(part)
    return ticks[int(0.6 * len(ticks))]


@pytest.mark.parametrize("radius_mm", [5.0])
def test_a_thicker_tool_that_was_fitted_within_the_wall_is_refused_and_the_old_one_can_go_on(
    bench: Held, radius_mm: float
) -> None:
    bench.held(WALL, middle(bench, WALL))
    assert not bench.led("retract", distance_mm=12.0)
    stood = bench.stepped.joints
    program = bench.program_of(WALL, tool(radius_mm))
    for verb in ("return", "retract"):
        why = bench.led(verb, program=program, distance_mm=20.0)
        assert f"would stand {radius_mm - 1.5:.1f}" in why and "retract above the part first" in why
    assert bench.stepped.joints == stood
    bench.jogged((0.0, 0.0, 2.0, 0.0, 0.0))
    assert not bench.led("retract", distance_mm=HEIGHT_MM), "the old one is back: further off"
    assert_off(bench.brought_back(WALL, tool(radius_mm), restart=False), radius_mm)


@pytest.mark.parametrize(
    ("fitted", "restart"),
    [(None, False), (tool(1.0, -5.0), True), (tool(3.0, 8.0), False), (tool(3.0, 8.0), True)],
)
def test_a_tool_comes_back_from_above_the_part_off_the_wall_and_goes_in_by_a_lead(
    bench: Held, fitted: Tool | None, restart: bool
) -> None:
    bench.held(WALL, middle(bench, WALL))
    assert not bench.led("retract", distance_mm=HEIGHT_MM + 12.0)
    assert_off(bench.brought_back(WALL, fitted, restart), (fitted, restart))
    assert bench.moved_into_the_cut_by_a_lead(WALL)


ASIDE = ("above", "low", "jogged off", "jogged along")


def led_aside(bench: Held, how: str, rng: random.Random) -> None:
    """Off the part in one of the ways that an operator takes."""
    if how == "above":
        assert not bench.led("retract", distance_mm=HEIGHT_MM + rng.uniform(10.0, 30.0))
    elif how == "low":
        assert not bench.led("retract", distance_mm=rng.uniform(0.5, HEIGHT_MM))
    if how != "above" or rng.random() < 0.5:
        up = 30.0 if how == "above" else 0.0
        bench.jogged((0.0, 0.0, up + rng.uniform(1.0, 8.0), 0.0, 0.0))
    if how.startswith("jogged") or (how == "above" and rng.random() < 0.5):
        bench.jogged((rng.uniform(-30.0, 30.0) if how != "jogged off" else 1.0, 0.0, 45.0, 0.0, 0.0))


OTHERS = (
    lambda rng: {"radius_mm": OLD["radius_mm"], "length_mm": rng.uniform(0.5, 9.0)},
    lambda rng: {"radius_mm": OLD["radius_mm"], "length_mm": -rng.uniform(0.5, 9.0)},
    lambda rng: {"radius_mm": rng.uniform(1.6, 5.0)},
    lambda rng: {"radius_mm": rng.uniform(0.6, 1.4), "length_mm": rng.uniform(-3.0, 3.0)},
    lambda rng: {"radius_mm": 1.5, "corner_mm": rng.choice((0.5, 1.5))},
    lambda rng: {"radius_mm": 1.0, "holder": ((rng.uniform(6.0, 30.0), 60.0, rng.uniform(3.0, 9.0)),)},
)


def held_at_random(bench: Held, seed: int, count: int, kind: str) -> tuple[int, int]:
    """How many came back, and how many were refused."""
    rng = random.Random(seed)
    part = Part.random(rng, kind)
    ticks, refused = bench.cutting(part), 0
    for k in range(count):
        size = OTHERS[(seed + k) % len(OTHERS)](rng)
        fitted = None if k % 7 == 6 else tool(**size)
        tick, how, restart = rng.choice(ticks), rng.choice(ASIDE), rng.random() < 0.4
        label = (kind, seed, k, tick, how, restart, size)
        bench.held(part, tick)
        led_aside(bench, how, rng)
        came = bench.brought_back(part, fitted, restart)
        if came.refused:
            refused += 1
            assert fitted is not None, (label, came.refused)
            reaches_out = fitted.radius_mm > OLD["radius_mm"] or fitted.length_mm > 0.0 or fitted.holder
            assert reaches_out, (label, came.refused)
            continue
        assert max(came.on_the_way, came.after) < DEEP_MM, (label, came)
        assert came.waiting < -CLEAR_MM, (label, came)
    return count - refused, refused


@pytest.mark.parametrize("kind", KINDS)
def test_holds_at_random_places_of_walls_and_lines(bench: Held, kind: str) -> None:
    came, _ = held_at_random(bench, KINDS.index(kind), 1, kind)
    assert came


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20, 41))
def test_hundreds_of_holds_at_random_places(bench: Held, seed: int) -> None:
    came, refused = held_at_random(bench, seed, 25, KINDS[seed % len(KINDS)])
    assert came > refused, (came, refused)
