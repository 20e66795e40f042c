"""One line on what the machine is doing now: feed programmed and actual, and what limits it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from controller.handoff import Snapshot
from controller.machine import Machine
from controller.state import Binding, Mode, binding_text


class HasFeed(Protocol):
    """What is needed of a stretch of the path."""

    @property
    def feed_mm_s(self) -> float | None: ...


class LiveLine:
    """Follows snapshots; the actual feed is the way between two of them."""

    def __init__(self, machine: Machine, stretches: Mapping[int, HasFeed]) -> None:
        self._machine, self._stretches = machine, stretches
        self._before: Snapshot | None = None

    def of(self, now: Snapshot) -> str:
        """For instance ``line 8: F 1000, actual 873 mm/min, limited by C acceleration``."""
        before, self._before = self._before, now
        if now.mode is Mode.RUNNING and now.waiting:
            return f"line {now.line}: waiting for {self._awaited(now)}"
        if now.mode is not Mode.RUNNING or now.motion_id not in self._stretches:
            return now.mode.name.lower()
        feed = self._stretches[now.motion_id].feed_mm_s
        share = 1.0 if now.own_feed else now.override
        wanted = "rapid" if feed is None else f"F {60.0 * feed * share:.0f}"
        return f"line {now.line}: {wanted}, actual {self._actual(before, now)}{self._limit(now)}"

    def _awaited(self, now: Snapshot) -> str:
        """What motion stands for."""
        if now.spindle_at_speed:
            return "coolant and clamps"
        return f"the spindle: S {now.spindle_rev_min:.0f}, actual {now.spindle_actual_rev_min:.0f} 1/min"

    def _actual(self, before: Snapshot | None, now: Snapshot) -> str:
        if before is None or before.motion_id != now.motion_id or now.tick == before.tick:
            return "- mm/min"
        took_s = (now.tick - before.tick) * self._machine.period_s
        return f"{60.0 * (now.s - before.s) / took_s:.0f} mm/min"

    def _limit(self, now: Snapshot) -> str:
        if now.limited_by in (Binding.NOTHING, Binding.FEED):
            return ""
        return f", limited by {binding_text(now.limited_by, [axis.name for axis in self._machine.axes])}"
