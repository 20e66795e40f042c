"""A pump on an interface of Linux, and a tick that publishes as it likes: what the bus hears of it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from guest import absence, on_can
from support.drives.pump_ticks import EXERCISES, Tick

from drives import bus, pdo
from drives.bus import CanSocket
from drives.settings import BusSettings


def joined(filters: tuple[tuple[int, int], ...]) -> CanSocket:
    port = bus.open(BusSettings("bus", "socketcan", "vcan0", 1_000_000), filters)
    assert isinstance(port, CanSocket)
    return port


@pytest.mark.parametrize("exercise", EXERCISES, ids=lambda one: one.__name__)
def test_whatever_is_published_and_when_no_period_is_lost_or_doubled(
    exercise: Callable[[Tick], None],
) -> None:
    for left in reversed(range(on_can.ATTEMPTS)):
        tick = Tick(joined(pdo.TICK_FILTERS), joined(((0, 0),)), "socketcan vcan0", on_can.PERIOD_S)
        try:
            tick.ready()
            exercise(tick)
            return
        except AssertionError:
            away = absence.figures().away()  # for so long that the motors stand: what follows begins anew
            on_can.skip_if_away(away and not left)
            if not away:
                raise
        finally:
            tick.end()
