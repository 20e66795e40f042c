"""Listens to a stepped bus and holds what went over the wire against the bus budget."""

from __future__ import annotations

from collections import defaultdict
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.runtime.bench import surroundings
from drives import pdo
from drives.bench.simulated.rig import rig
from drives.bench.virtual.virtual_bus import SteppedBus
from drives.load.budget import BusBudget

ID_AND_FLAGS = 0xE000_07FF


def take_the_worst(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the buses of stepped machines take every frame at its worst, as the budget does."""
    monkeypatch.setattr(surroundings, "rig", partial(rig, worst_stuffing=True))


class Wire:
    """Everything on one bus since ``forget``: times (s) at which frames had arrived, by identifier."""

    def __init__(self, bus: SteppedBus, budget: BusBudget) -> None:
        self.bus, self.budget = bus, budget
        self.times_s: dict[int, list[float]] = defaultdict(list)
        self.lengths: dict[int, set[int]] = defaultdict(set)
        self.busy_s = 0.0
        bus.connect(self._heard)
        self.forget()

    def forget(self) -> None:
        self.times_s.clear()
        self.lengths.clear()
        self.busy_s = self.bus.busy_s

    def _heard(self, frame: bytes, at_s: float) -> None:
        can_id = int.from_bytes(frame[:4], "little") & ID_AND_FLAGS
        self.times_s[can_id].append(at_s)
        self.lengths[can_id].add(frame[4])

    @property
    def syncs_s(self) -> NDArray[np.float64]:
        return np.array(self.times_s[pdo.SYNC])

    def per_tick(self, can_id: int) -> NDArray[np.int64]:
        """Frames of an identifier from each SYNC to the next; what came before the first counts nowhere."""
        ticks = np.searchsorted(self.syncs_s, self.times_s[can_id], side="left")
        return np.bincount(ticks, minlength=len(self.syncs_s) + 1)[1:-1]

    def overruns(self) -> int:
        """Ticks in which not every setpoint and feedback of the budget was across before the next SYNC."""
        bad = np.zeros(len(self.syncs_s) - 1, dtype=bool)
        for row in self.budget.cyclic:
            if row.frame in ("setpoint", "feedback") and row.per_tick == 1.0:
                bad |= self.per_tick(row.can_id) != 1
        return int(bad.sum())

    def uncounted(self) -> set[tuple[int, int]]:
        """(identifier, bytes) of what was sent and is not in the budget."""
        counted = {
            (row.can_id | (pdo.REMOTE_FLAG if row.remote else 0), row.data_bytes) for row in self.budget.rows
        }
        sent = {(can_id, n) for can_id, lengths in self.lengths.items() for n in lengths}
        return sent - counted

    def busy_us_per_tick(self) -> float:
        """Mean time the wire was taken."""
        return 1e6 * (self.bus.busy_s - self.busy_s) / max(1, len(self.times_s[pdo.SYNC]))
