"""systemd's watchdog: fed by a tick that goes on, starved by one that hangs."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from controller.machine.machine_file import load
from controller.service import main, processes
from controller.service.engine import Engine
from controller.service.folders import Folders
from controller.service.processes import Processes


class Watched:
    """A service of which only the tick is looked at; it ends after so many looks."""

    def __init__(self, ticks: list[int], alive: bool, starting: bool = False) -> None:
        self._ticks, self.yes = ticks, False
        self.engine = SimpleNamespace(tick_alive=alive, snapshot=lambda: None)
        self.processes = SimpleNamespace(starting=starting)
        self.run, self.watch = SimpleNamespace(job=None), self

    def look(self) -> Any:
        tick = self._ticks.pop(0)
        self.yes = not self._ticks
        return SimpleNamespace(tick=tick, at_rest=True) if tick >= 0 else None


@pytest.mark.parametrize(
    ("ticks", "alive", "fed"),
    [
        (list(range(6)), True, 6),
        ([7] * 6, True, 1),  # it hangs: the first look found a new tick
        ([7, 7, 8, 8, 8, 9], True, 3),
        ([7] * 6, False, 6),  # it is gone: its alarm is told, and a reset starts another
    ],
)
def test_the_watchdog_is_fed_by_a_tick_that_goes_on_or_is_known_to_be_gone(
    ticks: list[int], alive: bool, fed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(main, "FEED_S", 0.0)
    watched, told = Watched(ticks, alive), []
    main.watch(watched, lambda: watched.yes, told.append, 0.0)  # type: ignore[arg-type]
    assert told.count("WATCHDOG=1") == fed


def test_the_watchdog_is_fed_while_another_tick_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(main, "FEED_S", 0.0)
    watched, told = Watched([-1] * 4, alive=False, starting=True), []
    main.watch(watched, lambda: watched.yes, told.append, 0.0)  # type: ignore[arg-type]
    assert told.count("WATCHDOG=1") == 4


def test_a_tick_that_never_comes_is_not_waited_for_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = Engine(load("trunnion"), tmp_path, Folders.within(tmp_path), lambda _: None)
    made = Processes(engine, None, tmp_path)  # type: ignore[arg-type]
    assert not made.starting, "nobody has asked for one"
    made._begun_s = time.monotonic()
    assert made.starting
    monkeypatch.setattr(processes, "START_S", 0.0)
    assert not made.starting
