"""A work offset from where the tip is."""

from __future__ import annotations

import random

import pytest

from controller.api import touch_off
from controller.machine import machine_file, setup_data
from controller.machine.changes import turned_deg

MACHINE = machine_file.load("trunnion")


def turned(deg: list[float], origin: list[float]) -> dict[str, object]:
    """An offset as the service tells it."""
    made = setup_data.with_offset(MACHINE, "G55", {"origin_mm": origin, "turned_deg": deg})
    return dict(setup_data.offsets_of(made)["G55"])


def test_the_tip_reads_what_was_wanted_and_other_axes_stay() -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for _ in range(50):
        told = turned([rng.uniform(-180, 180) for _ in range(3)], [rng.uniform(-99, 99) for _ in range(3)])
        before = touch_off.frame(told)
        tip = (rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(-50, 50))
        origin = touch_off.origin_for(before, tip, {"Z": 1.5})
        reads = before._replace(origin=origin).from_parent(tip)
        assert reads[2] == pytest.approx(1.5, abs=1e-9), f"seed {seed}"
        assert reads[:2] == pytest.approx(before.from_parent(tip)[:2], abs=1e-9), f"seed {seed}"


@pytest.mark.parametrize("about_y", [0.0, 30.0, -89.0, 90.0, -90.0])
def test_the_turns_that_are_told_make_the_same_axes_again(about_y: float) -> None:
    first = turned([25.0, about_y, -140.0], [1.0, 2.0, 3.0])
    frame = touch_off.frame(first)
    again = touch_off.frame(turned(list(turned_deg(frame)), [1.0, 2.0, 3.0]))
    for old, new in zip(frame, again, strict=True):
        assert new == pytest.approx(old, abs=1e-9)


def test_an_offset_that_is_not_turned_has_no_turns() -> None:
    assert turned_deg(touch_off.frame(turned([0.0] * 3, [8.0, 96.0, 120.0]))) == (0.0, 0.0, 0.0)


def test_a_longer_tool_reaches_further_against_its_axis() -> None:
    told = {"tip": [1.0, 2.0, 3.0], "axis": [0.0, 0.6, 0.8], "length_mm": 10.0}
    assert touch_off.tip_with(told, 20.0) == pytest.approx((1.0, -4.0, -5.0))


def test_under_a_shift_of_g92_the_tip_reads_what_is_wanted() -> None:
    """As G10 L20 does: the offset takes up what the shift leaves."""
    shift = {"origin_mm": [2.0, 0.0, -1.0], "suspended": False}
    made = setup_data.applied(MACHINE, {"shift": {"G92": shift}})
    frame, tip = touch_off.frame(turned([0.0, 0.0, 30.0], [5.0, 6.0, 7.0])), (50.0, 60.0, 70.0)
    origin = touch_off.origin_for(frame, tip, touch_off.under(shift, {"X": 3.0, "Z": 0.0}))
    laid = setup_data.with_offset(made, "G54", {"origin_mm": list(origin), "turned_deg": [0.0, 0.0, 30.0]})
    x, _, z = laid.part().from_parent(tip)
    assert (x, z) == pytest.approx((3.0, 0.0))
    assert touch_off.under({**shift, "suspended": True}, {"X": 3.0}) == touch_off.under(None, {"X": 3.0})
