"""Lines are put off until somebody asks where the program is: it is there all the same."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine

from controller.geometry.vectors import Frame
from controller.program import modal
from controller.program.modal import Modal
from controller.program.position import Position, homed
from controller.program.program import JointLine, Place, Tip, TipLine

TURNED = Frame((1.0, 2.0, 3.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def lines(rng: random.Random, count: int) -> list[JointLine | TipLine]:
    """Some of the tip, of which many say where all axes are, and some lose the rotaries."""
    made = modal.power_on().modal
    modals = [made, replace(made, offset=1), replace(made, length_mm=7.0), replace(made, offset=2)]
    usual = rng.choice((3, 4))  # or with the turned offset, too
    found: list[JointLine | TipLine] = []
    for _ in range(count):
        if rng.random() < 0.3:
            found.append(tip_line(rng, rng.choice(modals[:usual])))
            continue
        targets = tuple(rng.choice((None, None, float(rng.randrange(-50, 50)))) for _ in range(5))
        flags = rng.random() < 0.02, rng.random() < 0.1
        found.append(JointLine(Place(1, 1), rng.choice(modals[:usual]), targets, *flags, None, None))
    return found


def tip_line(rng: random.Random, around: Modal) -> TipLine:
    x, y, z, a, c = (None if rng.random() < 0.1 else rng.uniform(-1.0, 1.0) for _ in range(5))
    axis = (0.1, 0.2, 1.0) if rng.random() < 0.1 else None
    turns = (a, c) if axis is None else (None, None)
    follows = replace(around, tip=Tip.ROTARIES if axis is None else Tip.VECTORS)
    return TipLine(Place(1, 1), follows, (x, y, z), turns, axis, rng.random() < 0.1, None, None)


@pytest.mark.parametrize("seed", range(20))
def test_the_place_is_that_of_going_line_by_line(seed: int) -> None:
    rng = random.Random(seed)
    built = machine("fig4a")
    built = replace(built, offsets=(Frame(), Frame((10.0, 20.0, 30.0)), TURNED, *built.offsets[3:]))
    put_off, step_by_step = Position(built, homed(built)), Position(built, homed(built))
    for line in lines(rng, 200):
        put_off.take(line)
        step_by_step.take(line)
        _ = step_by_step.rotaries  # asked, it goes
        if rng.random() < 0.05:
            assert put_off.in_frame(line.modal) == pytest.approx(step_by_step.in_frame(line.modal))
    assert put_off.joints() == pytest.approx(step_by_step.joints())
