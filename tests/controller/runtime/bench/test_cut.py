"""The simulated cut by itself: the power of the text-book, where the tip is, and what its file may say."""

from __future__ import annotations

from dataclasses import replace

import pytest

from controller.geometry.vectors import Frame
from controller.machine.toml_table import ConfigError, Table, parse
from controller.runtime.bench import cut as cuts
from controller.runtime.bench.cut import Cut, Stock
from drives.bench.simulated.spindle_motor import MotorParameters, SpindleMotor

CUT = "[cut]\nforce_n_mm2 = 1800.0\nrated_nm = 12.0\nlength_mm = 100.0\n"
STOCK = "[[stock]]\nlow_mm = [0.0, -5.0, -5.0]\nhigh_mm = [20.0, 5.0, 5.0]\nsection_mm2 = {}\n"


def top(text: str) -> Table:
    return parse(text, "part.toml")


def cut(frame: Frame = Frame()) -> Cut:  # noqa: B008 (frozen)
    found = cuts.read(top(CUT + STOCK.format(15.0) + STOCK.format(3.0)), frame)
    assert found is not None
    return found


def test_the_power_is_that_of_the_chip() -> None:
    """P = k_c Q: 1800 N/mm2 x 15 mm2 x 10 mm/s = 270 W."""
    assert cut().power_w((10.0, 0.0, 0.0), 10.0) == pytest.approx(270.0)
    assert cut().power_w((10.0, 0.0, 0.0), 20.0) == pytest.approx(540.0)


def test_there_is_none_outside_of_the_stock() -> None:
    assert cut().power_w((21.0, 0.0, 0.0), 10.0) == 0.0


@pytest.mark.parametrize(("turns", "share"), [(50.0, 1.0), (100.0, 0.5), (-50.0, 1.0), (0.0, 0.0)])
def test_the_slower_the_spindle_the_more_torque_takes_the_same_power(turns: float, share: float) -> None:
    motor = SpindleMotor(0.0, MotorParameters())
    motor.velocity = 4096.0 * turns
    motor.feel(25.0, 1e6, 4096.0)
    assert motor.cutting == pytest.approx(0.5e6 * share)


def test_the_stock_lies_where_the_part_does() -> None:
    moved = cut(Frame((100.0, 0.0, 0.0)))
    assert moved.power_w((10.0, 0.0, 0.0), 10.0) == 0.0
    assert moved.power_w((110.0, 0.0, 0.0), 10.0) > 0.0


def test_the_first_box_counts() -> None:
    other = replace(cut(), stock=(Stock((0.0, -5.0, -5.0), (5.0, 5.0, 5.0), 1.0), *cut().stock))
    assert 15.0 * other.power_w((2.0, 0.0, 0.0), 10.0) == pytest.approx(other.power_w((10.0, 0.0, 0.0), 10.0))


def test_a_file_without_it_cuts_nothing() -> None:
    assert cuts.read(top('name = "part"\n'), Frame()) is None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (CUT.replace("rated_nm = 12.0\n", ""), "rated_nm: is missing"),
        (CUT.replace("1800.0", "-1.0"), "is not above zero"),
        (CUT + "more = 1\n", "this key is not known"),
        (CUT + STOCK.format(-1.0), "is not above zero"),
    ],
)
def test_a_mistake_is_told(text: str, why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        cuts.read(top(text), Frame())
