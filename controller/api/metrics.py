"""``/metrics`` for Prometheus: figures of the machine, of what is kept of it, and of the panel.

Names keep to Prometheus' own rules (prometheus.io/docs/practices/naming): base units, the unit after the
name, ``_total`` for what only counts up. So lengths are in metres and angles in radians here, and
nowhere else outside. What a metric is stands in the messages, under ``metrics.`` and its name.
"""

from __future__ import annotations

import asyncio
import math
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fastapi import Request, Response
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.registry import Collector

from controller import messages
from controller.api.access import panel_of
from controller.api.answers import VARY, Refusal, spoken
from controller.api.app_state import Panel
from controller.api.router import VIEW, Router, body
from controller.api.store import Sizes
from controller.state.modes import SHOWN_MODES

router = Router(tags=["metrics"])
KIND = "text/plain; version=0.0.4; charset=utf-8"
ENDS = ("completed", "stopped", "refused", "fault", "interrupted", "lost")  # of a run

Family = GaugeMetricFamily | CounterMetricFamily

# Name, place in the status, factor to the base unit.
GAUGES = (
    ("override_ratio", ("override",), 1.0),
    ("rapid_override_ratio", ("rapid_override",), 1.0),
    ("feed_meters_per_second", ("feed_mm_min", "actual"), 1e-3 / 60.0),
    ("job_left_seconds", ("job", "left_s"), 1.0),
    ("job_elapsed_seconds", ("job", "elapsed_s"), 1.0),
    ("tick_late_max_seconds", ("tick", "late_max_ms"), 1e-3),
    ("tick_age_seconds", ("tick", "age_s"), 1.0),
    ("tick_period_seconds", ("tick", "period_ms"), 1e-3),
    ("tick_alive", ("tick_alive",), 1.0),
)
COUNTERS = (
    ("ticks", ("tick", "number")),
    ("tick_skips", ("tick", "skips")),
    ("bus_lost_frames", ("tick", "lost_frames")),
)
BY_JOINT = (("position", "actual"), ("following_error", "error"))
UNITS = {"mm": ("meters", 1e-3), "deg": ("radians", math.radians(1.0))}


@dataclass(slots=True)
class Kept:
    """Figures of store and state folder; where the store cannot be read, nothing."""

    runs: dict[str, tuple[int, float, float]] = field(default_factory=dict)
    alarms: dict[str, tuple[int, int]] = field(default_factory=dict)
    disk: tuple[int, int] | None = None  # size and free space, bytes
    parts: dict[str, int] = field(default_factory=dict)  # of the state folder, bytes
    readable: bool = False


@router.get("/metrics", VIEW, carries=body("text/plain", is_text=True))
async def metrics(request: Request) -> Response:
    """Figures for Prometheus; directrix_up tells whether the service answers."""
    panel = panel_of(request)
    status: dict[str, Any] = {}
    facts: dict[str, Any] = {}
    with suppress(Refusal):
        status = await panel.watch.status()
        facts = await panel.door.ask("facts")
    kept = await asyncio.to_thread(_disk_metrics, panel.store.folder, panel.sizes)
    sums = await panel.past.ask_if_there(lambda past: (past.sums_of_runs(), past.sums_of_alarms()))
    if sums is not None:
        kept.runs, kept.alarms, kept.readable = *sums, True
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Figures(status, facts, kept, panel, request.app.version))
    headers = {"Vary": VARY, "Content-Language": spoken.get()}
    return Response(generate_latest(registry), media_type=KIND, headers=headers)


def _disk_metrics(state: Path, sizes: Sizes) -> Kept:
    kept = Kept()
    with suppress(OSError):
        found = shutil.disk_usage(state)
        kept.disk, kept.parts = (found.total, found.free), sizes.known()
    return kept


class _Figures(Collector):
    """The figures of one moment."""

    def __init__(
        self, status: Mapping[str, Any], facts: Mapping[str, Any], kept: Kept, panel: Panel, version: str
    ) -> None:
        self._status, self._facts, self._kept, self._panel = status, facts, kept, panel
        self._version = version

    def collect(self) -> Iterator[Family]:
        yield _gauge("build_info", "version", {self._version: 1.0})
        yield _gauge("up", "", {"": bool(self._status)})
        yield _gauge("store_up", "", {"": self._kept.readable})
        yield _gauge("listeners", "", {"": self._panel.events.listeners})
        yield from self._machine()
        yield from self._joints()
        yield from self._of_runs()
        yield from self._of_alarms()
        yield from self._disk()

    def _machine(self) -> Iterator[Family]:
        status = self._status
        for name, path, factor in GAUGES:
            if (value := _number(_at(status, path))) is not None:
                yield _gauge(name, "", {"": value * factor})
        for name, path in COUNTERS:
            if (value := _number(_at(status, path))) is not None:
                yield _counter(name, "", {"": max(0.0, value)})
        now = status.get("mode")
        modes = {mode: mode == now for mode in SHOWN_MODES} if now else {}
        yield _gauge("mode", "mode", modes)
        fault = _at(status, ("fault", "name"))
        yield _gauge("fault", "fault", {str(fault): 1.0} if fault else {})
        yield from self._drives()

    def _drives(self) -> Iterator[Family]:
        rows = {str(row.get("axis")): row for row in self._status.get("drives") or ()}
        ages = {axis: row.get("heartbeat_age_s") for axis, row in rows.items()}
        yield _gauge("drive_heartbeat_age_seconds", "axis", ages)
        frames = {axis: row.get("malformed") for axis, row in rows.items()}
        yield _counter("drive_malformed_frames", "axis", frames)
        for name in ("missed_setpoints", "overdue_setpoints"):
            yield _counter(f"drive_{name}", "axis", {axis: row.get(name) for axis, row in rows.items()})

    def _joints(self) -> Iterator[Family]:
        joints: Mapping[str, Any] = self._status.get("joints") or {}
        for unit, (word, factor) in UNITS.items():
            axes = [str(axis["name"]) for axis in self._facts.get("axes") or () if axis["unit"] == unit]
            for name, key in BY_JOINT:
                found = {axis: _number(_at(joints, (axis, key))) for axis in axes}
                values = {axis: value * factor for axis, value in found.items() if value is not None}
                yield _gauge(f"joint_{name}_{word}", "axis", values)

    def _of_runs(self) -> Iterator[Family]:
        """All ends from the first scrape on: a counter that comes with 1 has no increase to be seen."""
        if not self._kept.readable:
            return
        none = (0, 0.0, 0.0)
        sums = {end: self._kept.runs.get(end, none) for end in dict.fromkeys((*ENDS, *self._kept.runs))}
        sums.pop("running", None)  # one that ends would count down
        for i, name in enumerate(("runs", "run_seconds", "cut_seconds")):
            yield _counter(name, "result", {end: row[i] for end, row in sums.items()})

    def _of_alarms(self) -> Iterator[Family]:
        if self._kept.readable:
            rows = self._kept.alarms
            told = {name: row[0] for name, row in rows.items()}
            yield _counter("alarms", "name", told)
            waiting = {name: row[1] for name, row in rows.items()}
            yield _gauge("alarms_open", "name", waiting)

    def _disk(self) -> Iterator[Family]:
        if self._kept.disk is not None:
            size, free = self._kept.disk
            yield _gauge("disk_size_bytes", "", {"": size})
            yield _gauge("disk_free_bytes", "", {"": free})
            yield _gauge("state_bytes", "part", self._kept.parts)


def _gauge(name: str, label: str, values: Mapping[str, Any]) -> Family:
    family = GaugeMetricFamily(f"directrix_{name}", _help(name), labels=[label] if label else [])
    return _filled(family, label, values)


def _counter(name: str, label: str, values: Mapping[str, Any]) -> Family:
    """The library puts ``_total`` after the name."""
    family = CounterMetricFamily(f"directrix_{name}", _help(name), labels=[label] if label else [])
    return _filled(family, label, values)


def _help(name: str) -> str:
    """What a metric is, in the language of who asks."""
    return messages.of(spoken.get()).texts[f"metrics.{name}"]


def _filled(family: Family, label: str, values: Mapping[str, Any]) -> Family:
    """``values`` by that label; without one, a single value of any key."""
    for key, value in values.items():
        if (number := _number(value)) is not None:
            family.add_metric([key] if label else [], number)
    return family


def _at(status: Mapping[str, Any], path: Iterable[str]) -> Any:
    found: Any = status
    for key in path:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None
