"""Random contours beside an independent computation of the cutter's way: distances alone, and shapely's."""

from __future__ import annotations

import cmath
import math
import random
from collections import Counter

import numpy as np
import pytest
import shapely
from support.machines.traced_programs import mill
from support.oracles.beside_contour import hindrance, to_all, touched
from support.parts import random_contours
from support.parts.random_contours import Piece
from support.suite import seed

from controller.program import blocks
from controller.program.program import JointArc, JointLine, ProgramError

DIGITS = {12: 1e-6, 4: 1e-3}  # as exact as floats, and as CAM systems write; mm from the contour


def way(text: str) -> list[Piece]:
    """The cutter's way as lines and arcs of X and Y, with lead-in and lead-out."""
    built, here, made = mill(), 0j, []
    for block in blocks.read(text.encode(), built, "p.ngc").blocks:
        if not isinstance(block, JointLine | JointArc):
            continue
        x, y = (block.targets[i] for i in built.linear()[:2])
        assert x is not None and y is not None
        made.append(_piece(block, here, complex(x, y)))
        here = made[-1].end
    return made[1:]


def _piece(block: JointLine | JointArc, start: complex, end: complex) -> Piece:
    if isinstance(block, JointLine) or block.centre_mm is None:
        return Piece(start, end)
    centre = start + complex(*block.centre_mm)
    sense = -1.0 if block.clockwise else 1.0
    turn = cmath.phase((end - centre) / (start - centre)) * sense % (2.0 * math.pi)
    return Piece(start, end, centre, sense * (turn if abs(end - start) > 1e-6 else 2.0 * math.pi))


def check(pieces: list[Piece], off: float, cut: list[Piece], within: float) -> None:
    """The way keeps its distance everywhere, on its side, and touches whatever can be touched."""
    points = np.array([p for piece in cut for p in piece.points(0.1 * abs(off))])
    away = to_all(points, pieces)
    assert abs(away - abs(off)).max() < within
    for sample in touched(pieces, off, 0.1 * abs(off)):
        if sample.free.any():
            assert to_all(sample.centres[sample.free], cut).max() < within


def apart(pieces: list[Piece], cut: list[Piece]) -> float:
    """The least distance of the way from the contour, as shapely has it of chords within 1e-4 mm of both."""
    lines = [[(p.real, p.imag) for piece in some for p in piece.points(0.02)] for some in (pieces, cut)]
    return float(shapely.LineString(lines[0]).distance(shapely.LineString(lines[1])))


@pytest.mark.parametrize("digits", DIGITS)
def test_the_way_is_beside_the_contour_or_refused(digits: int) -> None:
    outcomes = judged(random.Random(4), 6, digits)
    assert outcomes["cut"] and outcomes["refused"] and not outcomes["refused without need"]


@pytest.mark.slow
@pytest.mark.parametrize("part", range(100))
def test_so_it_is_beside_a_thousand_contours(part: int) -> None:
    outcomes = judged(random.Random(f"{seed.SEED} {part}"), 10, sorted(DIGITS)[part % len(DIGITS)])
    assert outcomes["cut"] and outcomes["refused without need"] <= 1, outcomes


@pytest.mark.parametrize("part", [0, *(pytest.param(part, marks=pytest.mark.slow) for part in range(1, 41))])
def test_a_contour_that_crosses_itself_on_purpose_is_cut_along_each_of_its_lines(part: int) -> None:
    rng, cut = random.Random(f"{seed.SEED} {part}"), 0
    for _ in range(10):
        radius, left, digits = rng.choice((0.5, 3.0, 6.35)), rng.random() < 0.5, rng.choice(sorted(DIGITS))
        pieces, off = random_contours.crossing(rng, radius), radius if left else -radius
        text = random_contours.text(pieces, f"G4{1 if left else 2}.1 D{2.0 * radius}", digits)
        try:
            gone = way(text)[1:-1]
        except ProgramError as error:  # the cutter has no room in one of its corners
            assert "between the two the contour is narrower" not in error.sentence, f"{error}\n{text}"
            continue
        cut += 1
        for number, piece in enumerate(pieces):  # by itself, as far as its neighbours let the cutter come
            near = pieces[max(0, number - 3) : number + 4]
            sample = touched(near, off, 0.2 * radius)[near.index(piece)]
            if sample.free.any():
                assert to_all(sample.centres[sample.free], gone).max() < DIGITS[digits], text
    assert cut > 3


def judged(rng: random.Random, count: int, digits: int) -> Counter[str]:
    """How many contours are cut as they are to be, and how many refused, with need and without."""
    outcomes = Counter[str]()
    for _ in range(count):
        radius = rng.choice((0.5, 3.0, 6.35))
        pieces, left = random_contours.contour(rng, radius), rng.random() < 0.5
        off = radius if left else -radius
        text = random_contours.text(pieces, f"G4{1 if left else 2}.1 D{2.0 * radius}", digits)
        why = hindrance(pieces, off)
        try:
            cut = way(text)[1:-1]
        except ProgramError as error:
            assert 2 < error.line <= len(pieces) + 4, error
            outcomes["refused" if why else "refused without need"] += 1
            continue
        check(pieces, off, cut, DIGITS[digits])
        assert abs(apart(pieces, cut) - radius) < 1e-3, text
        outcomes["cut"] += 1
    return outcomes
