"""``/metrics`` for Prometheus: figures of the machine and of the panel."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from fastapi import APIRouter, Request, Response
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily, InfoMetricFamily
from prometheus_client.registry import Collector

from controller.panel.access import needs, panel_of
from controller.panel.answers import Refusal, documented
from controller.panel.core import Panel
from controller.panel.roles import Role

router = APIRouter(tags=["metrics"])
KIND = "text/plain; version=0.0.4; charset=utf-8"

# Name, what it is, where it stands in the status.
PLAIN = (
    ("override_ratio", "Feed override; 1 = 100 %.", ("override",)),
    ("rapid_override_ratio", "Rapid override; 1 = 100 %.", ("rapid_override",)),
    ("feed_mm_min", "Actual feed.", ("feed_mm_min", "actual")),
    ("job_left_seconds", "Time left of the job.", ("job", "left_s")),
    ("job_elapsed_seconds", "Time since the start of the job.", ("job", "elapsed_s")),
    ("ticks_total", "Ticks since the service began.", ("tick", "number")),
    ("tick_skips_total", "Ticks that were too late and sent nothing.", ("tick", "skips")),
    ("tick_late_max_ms", "The latest tick.", ("tick", "late_max_ms")),
    (
        "tick_age_seconds",
        "Since the newest tick; of many periods: it stands still.",
        ("tick", "age_s"),
    ),
    ("tick_alive", "Whether the tick's process is there.", ("tick_alive",)),
    ("tick_period_ms", "Period of the tick.", ("tick", "period_ms")),
)
BY_JOINT = (
    ("joint_actual", "Position as the drive says, mm or degrees.", "actual"),
    ("joint_following_error", "Following error, mm or degrees.", "error"),
)


@router.get(
    "/metrics",
    dependencies=[needs(Role.VIEW)],
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}, **documented(401, 403)},
)
async def metrics(request: Request) -> Response:
    """Figures for Prometheus; directrix_up tells whether the service answers."""
    panel = panel_of(request)
    try:
        status = await panel.watch.status()
    except Refusal:
        status = {}
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Figures(status, panel))
    return Response(generate_latest(registry), media_type=KIND)


class _Figures(Collector):
    """The figures of one status."""

    def __init__(self, status: Mapping[str, Any], panel: Panel) -> None:
        self._status, self._panel = status, panel

    def collect(self) -> Iterator[GaugeMetricFamily | InfoMetricFamily]:
        status = self._status
        yield _gauge("up", "Whether the controller's service answers.", float(bool(status)))
        yield _gauge("listeners", "Listeners to events.", float(self._panel.events.listeners))
        for name, text, path in PLAIN:
            if (value := _number(_at(status, path))) is not None:
                yield _gauge(name, text, value)
        yield _labelled("mode", "1 for the present mode.", "mode", _mode(status))
        fault = _at(status, ("fault", "name"))
        yield _labelled("fault", "1 for the present fault.", "fault", {str(fault): 1.0} if fault else {})
        joints = status.get("joints") or {}
        for name, text, key in BY_JOINT:
            yield _labelled(name, text, "axis", {axis: row.get(key) for axis, row in joints.items()})
        ages = {str(row.get("axis")): row.get("heartbeat_age_s") for row in status.get("drives") or ()}
        yield _labelled("drive_heartbeat_age_seconds", "Age of the last heartbeat.", "axis", ages)


def _gauge(name: str, text: str, value: float) -> GaugeMetricFamily:
    return GaugeMetricFamily(f"directrix_{name}", text, value=value)


def _labelled(name: str, text: str, label: str, values: Mapping[str, Any]) -> GaugeMetricFamily:
    family = GaugeMetricFamily(f"directrix_{name}", text, labels=[label])
    for key, value in values.items():
        if (number := _number(value)) is not None:
            family.add_metric([key], number)
    return family


def _mode(status: Mapping[str, Any]) -> dict[str, float]:
    mode = status.get("mode")
    return {str(mode): 1.0} if mode else {}


def _at(status: Mapping[str, Any], path: Iterable[str]) -> Any:
    found: Any = status
    for key in path:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None
