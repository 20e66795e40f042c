"""What the command line prints for people: tables that fit 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.table import Table

from controller.plan.survey import Survey

Rows = Iterator[tuple[str, str]]


def joints(found: Survey) -> Table:
    """What ``check`` found out about every joint."""
    table = Table(title="Joints over the whole path (mm, degrees) and shares of their limits")
    for head in ("axis", "from", "to", "travel", "velocity", "accel.", "jerk"):
        table.add_column(head, justify="left" if head == "axis" else "right", no_wrap=True)
    for use in found.joints:
        shares = (use.velocity_share, use.acceleration_share, use.jerk_share)
        table.add_row(
            use.name,
            f"{use.lowest:.3f}",
            f"{use.highest:.3f}",
            f"{use.travel[0]:g} .. {use.travel[1]:g}",
            *(f"{100 * share:.1f} %" for share in shares),
        )
    return table


def figures(title: str, values: Mapping[str, Any]) -> Table:
    """The figures of a run, as ``simulate`` and ``demo`` give them with --json."""
    table = Table(title=title, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right")
    for name, value in (*_run(values), *_errors(values), *_syncs(values)):
        table.add_row(name, value)
    return table


def _run(values: Mapping[str, Any]) -> Rows:
    fault = f": {values['fault']}" if values["fault"] else ""
    yield "program", Path(values["program"]).name
    yield "result", values["result"] + fault
    yield "motion in all", f"{values['duration_s']:.2f} s, {values['ticks']} ticks"
    yield "cut", f"{values['cut_time_s']:.2f} s, {values['cut_length_mm']:.4f} mm of C1"
    if resumes := values.get("assumed_resumes"):
        yield "program stops (M0)", f"{resumes}, a resume was assumed after each"
    if left := values.get("events_left"):
        yield "events after the end", f"{left}, not sent"


def _errors(values: Mapping[str, Any]) -> Rows:
    errors: Mapping[str, float] = values["following_error"]
    for unit, names in (("mm", "XYZ"), ("deg", "ABC")):
        largest = ", ".join(f"{name} {error:.3f}" for name, error in errors.items() if name in names)
        yield "largest following error" if unit == "mm" else "", f"{largest} {unit}"
    yield "largest path error", f"{1e3 * values['path_error_mm']:.3f} um"
    yield "largest axis error", f"{values['axis_error_deg']:.2e} deg"
    yield "skipped ticks", f"{values['skips']}"
    if "times_real_time" in values:
        yield "speed", f"{values['times_real_time']:.1f} times real time"


def _syncs(values: Mapping[str, Any]) -> Rows:
    for bus, sync in values.get("sync", {}).items():
        ms = ("p50_s", "p99_s", "p999_s", "max_s")
        yield f"SYNC intervals on {bus}", "p50 / p99 / p99.9 / max"
        yield "", " / ".join(f"{1e3 * sync[key]:.3f}" for key in ms) + " ms"
        yield "outside 1 +- 1/4 T", f"{100 * sync['outside_share']:.3f} % of {sync['count']}"


def budget(one: Any, max_share: float) -> Table:
    """One bus of ``drives.budget``: every frame of a tick."""
    table = Table(title=f"{one.bus}: {one.bit_rate} bit/s, tick of {one.period_us:g} us")
    for head in ("frame", "id", "bytes", "per tick", "worst us", "typical us"):
        table.add_column(head, justify="left" if head == "frame" else "right")
    for row in (*one.cyclic, *one.background):
        numbers = f"{row.per_tick:g}", f"{row.worst_us:.0f}", f"{row.typical_us:.0f}"
        table.add_row(row.what, f"{row.can_id:03X}h", str(row.data_bytes), *numbers)
    table.caption = (
        f"every tick at its worst {one.total_us:.0f} us, typical {one.typical_us:.0f} us\n"
        f"{100 * one.share:.1f} % of the tick at its worst; allowed {100 * max_share:.0f} %"
    )
    return table
