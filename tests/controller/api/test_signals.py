"""Signals of a scope out of rows of ticks: values, triggers, thinning, files."""

from __future__ import annotations

import csv
import io
import random

import numpy as np
import pytest

from controller.api import signals
from controller.api.signals import Signals
from controller.ipc.handoff import COLUMN, ROW
from controller.machine import machine_file

MACHINE = machine_file.load("trunnion")
PERIOD_S = MACHINE.period_s


def rows(n: int, first: int = 100) -> np.ndarray:
    """Ticks in which X runs along a parabola of 3 mm/s2 and C, in radians, evenly."""
    found = np.zeros((n, len(ROW)))
    tick = np.arange(first, first + n)
    found[:, COLUMN["tick"]] = tick
    found[:, COLUMN["joint_command_0"]] = 1.5 * (tick * PERIOD_S) ** 2
    found[:, COLUMN["actual_0"]] = found[:, COLUMN["joint_command_0"]] - 0.25
    found[:, COLUMN["joint_command_4"]] = np.radians(10.0) * tick * PERIOD_S
    found[:, COLUMN["feed_mm_s"]] = 2.0
    return found


def test_every_signal_that_is_named_has_values_and_a_unit() -> None:
    found = Signals(rows(20), MACHINE)
    for name in signals.names(MACHINE):
        assert found.values(name).shape == (20,), name


def test_positions_errors_and_their_changes_are_in_shown_units() -> None:
    found = Signals(rows(20), MACHINE)
    inner = slice(5, 15)
    assert found.values("X.error", inner) == pytest.approx(0.25)
    assert found.values("X.acceleration", inner) == pytest.approx(3.0, rel=1e-6)
    assert found.values("C.velocity", inner) == pytest.approx(10.0, rel=1e-9)
    assert found.values("feed", inner) == pytest.approx(120.0)


def test_a_window_has_the_same_values_as_the_whole() -> None:
    found = Signals(rows(50), MACHINE)
    for name in ("X.velocity", "X.acceleration", "X.jerk"):
        whole = found.values(name)[10:30]
        assert np.array_equal(found.values(name, slice(10, 30)), whole, equal_nan=True)


def test_nothing_is_told_of_a_change_over_ticks_that_are_missing() -> None:
    gap = np.delete(rows(20), 10, axis=0)
    velocity = Signals(gap, MACHINE).values("X.velocity")
    assert np.flatnonzero(np.isnan(velocity)).tolist() == [0, 10]


def test_a_signal_that_is_not_there_is_refused() -> None:
    with pytest.raises(KeyError):
        Signals(rows(3), MACHINE).values("Q.command")


def test_rows_are_found_by_their_ticks() -> None:
    found = Signals(rows(10), MACHINE)
    assert found.between(102, 104) == slice(2, 5)
    assert found.between(None, 50) == slice(0, 0)
    assert found.between(500, None) == slice(10, 10)


TRIGGERS = [
    # values, level, edge, begin, index, why
    ([0, 1, 2, 3], 2.0, "rising", 1, 2, "reaching the level counts"),
    ([3, 2, 1, 0], 2.0, "falling", 1, 1, "from above"),
    ([3, 2, 1, 0], 2.0, "rising", 1, None, "it never rises"),
    ([2, 2, 2], 2.0, "either", 1, None, "lying on the level is no crossing"),
    ([0, 3, 0, 3], 1.0, "rising", 2, 3, "the first one lies before the search"),
    ([0, 3], 1.0, "rising", 2, None, "nothing is left to look at"),
    ([1, 1, 4], 0.0, "change", 1, 2, "any change"),
    ([float("nan"), 5], 1.0, "rising", 1, None, "from nothing known"),
    ([5], 1.0, "rising", 1, None, "one tick is no edge"),
]


@pytest.mark.parametrize(("values", "level", "edge", "begin", "index", "why"), TRIGGERS)
def test_a_trigger_fires_at_the_first_crossing(
    values: list[float], level: float, edge: str, begin: int, index: int | None, why: str
) -> None:
    assert signals.crossing(np.array(values, dtype=float), level, edge, begin) == index, why


def test_a_trigger_found_piece_by_piece_is_the_one_of_the_whole() -> None:
    seed = random.randrange(2**32)
    values = np.random.default_rng(seed).normal(size=500)
    whole = signals.crossing(values, 2.0, "rising")
    for end in range(1, 501):
        found = signals.crossing(values[:end], 2.0, "rising")
        assert found == (whole if whole is not None and end > whole else None), f"seed {seed}"


def test_thinning_loses_no_spike() -> None:
    values = np.zeros(10_000)
    values[7_777], values[1_234] = 5.0, -3.0
    thin = signals.thinned(np.arange(10_000), [values], 300)
    assert len(thin.ticks) <= 300
    assert thin.high[0].max() == 5.0 and thin.low[0].min() == -3.0
    assert thin.per_column * len(thin.ticks) >= 10_000


def test_thinning_leaves_few_ticks_as_they_are_and_nothing_as_nothing() -> None:
    thin = signals.thinned(np.arange(5), [np.arange(5.0)], 10)
    assert thin.per_column == 1 and thin.low[0].tolist() == [0, 1, 2, 3, 4]
    assert len(signals.thinned(np.arange(0), [np.zeros(0)], 10).ticks) == 0


def test_what_is_not_known_is_null_in_json() -> None:
    assert signals.plain(np.array([1.0, np.nan, np.inf, 1 / 3])) == [1.0, None, None, 0.333333333]


def test_a_csv_file_gives_every_tick_back_with_all_digits() -> None:
    found = Signals(rows(4500), MACHINE)
    text = b"".join(signals.csv(found, ["X.command", "X.velocity"], found.between(None, None))).decode()
    head, *lines = list(csv.reader(io.StringIO(text)))
    assert head == ["tick", "time_s", "X.command [mm]", "X.velocity [mm/s]"]
    assert len(lines) == 4500 and lines[0][3] == ""
    assert [float(line[2]) for line in lines] == found.values("X.command").tolist()


def test_an_npz_file_gives_every_tick_back() -> None:
    found = Signals(rows(30), MACHINE)
    with np.load(io.BytesIO(signals.npz(found, ["X.command", "C.error"], slice(3, 9)))) as file:
        assert file["tick"].tolist() == list(range(103, 109))
        assert file["X.command"] == pytest.approx(found.values("X.command")[3:9])
        assert file["units"].tolist() == ["mm", "°"] and float(file["period_s"]) == PERIOD_S


def test_setpoints_of_a_run_are_positions_and_the_rest_is_not_known() -> None:
    counts = np.array([[0, 0, 0, 0, 0], [200_000, 0, 0, 0, -400_000]])
    found = Signals(signals.rows_of_setpoints(counts, MACHINE), MACHINE)
    assert found.values("X.command") == pytest.approx([0.0, 1.0])
    assert found.values("C.command") == pytest.approx([0.0, -2.0])
    assert np.isnan(found.values("X.error")).all() and found.ticks.tolist() == [0, 1]
