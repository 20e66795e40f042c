"""What the command line prints for people: tables that fit 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from controller.ipc.handoff import COLUMN
from controller.machine.model import Machine
from controller.plan.feed.binding import NUMBER_OF_CODES
from controller.plan.report.stored import Overcut
from controller.plan.report.survey import BlockUse, Survey
from controller.plan.report.tally import Bound, Part, bounds
from controller.verify.rows import Rows as Blocks

Rows = Iterator[tuple[str, str]]


MIN_SHARE = 0.005  # of the time; what binds for less is not worth a word in a table
TWISTED_MM = 1e-4  # less is told as nothing
MAX_BINDS = 3  # in one row


def blocks(rows: Blocks) -> Table:
    """What ``check`` found out about every block, or about those that take longest."""
    table = Table(title="Blocks: mm, s, mean feed of the programmed (mm/min), and what binds")
    for head in ("line", "what", "length", "time", "feed of F", "binds"):
        table.add_column(
            head, justify="left" if head in ("what", "binds") else "right", no_wrap=head != "binds"
        )
    for block in rows.longest:
        line = f"{block.line}" if block.lines == 1 else f"{block.line}-{block.last_line}"
        for what, part in _parts(block):
            table.add_row(
                line,
                what,
                f"{part.length_mm:.2f}",
                f"{part.time_s:.2f}",
                _feed(part),
                "\n".join(told(part.binds)),
            )
            line = ""
    if rows.left_out:
        table.caption = f"The {len(rows.longest)} that take longest; {rows.left_out} more with --json."
    return table


def _parts(block: BlockUse) -> Iterator[tuple[str, Part]]:
    what = block.what if block.lines == 1 else f"{block.lines} {block.what}s"
    for name, part in (("approach", block.approach), (what, block.own), ("departure", block.departure)):
        if part and part.time_s > 0.0:
            yield name, part


def _feed(part: Part) -> str:
    if part.length_mm == 0.0:
        return ""
    return f"{part.feed_mean:.0f}" + (f" of {part.feed:.0f}" if part.feed else "")


def told(found: Sequence[Bound]) -> list[str]:
    """What binds most, in words: 'feed 54 %', 'C acceleration 43 %'."""
    worth = [bound for bound in found if bound.share >= MIN_SHARE][:MAX_BINDS]
    return [f"{bound.what} {100 * bound.share:.0f} %" for bound in worth]


def whole(found: Survey, program: str, machine: str) -> str:
    """The last lines of ``check``."""
    cut = f"{found.cut_time_s:.2f} s cut {found.cut_length_mm:.4f} mm of C1"
    part = f"of which {cut}" if found.cuts_mm else "nothing is cut"
    limits = told(found.cut_binds)
    slow = f"\nWhere a feed is programmed, it is limited by {', '.join(limits)}." if limits else ""
    waits = (
        f"\nSpindle, clamps and tool changes may take {found.waits_s:.1f} s more." if found.waits_s else ""
    )
    return f"{program} can run on {machine}:\n{found.duration_s:.3f} s in all, {part}.{waits}{slow}"


def overcut(overcuts: Sequence[Overcut]) -> str:
    """What the cuts take too much of their own surfaces, where that is most."""
    worst = max(overcuts, key=lambda one: one.mm)
    if worst.mm < TWISTED_MM:
        return "No cut goes below its own surface."
    place = f"line {worst.line}, u = {worst.u:.3f}, v = {worst.v:.2f}"
    return f"The cuts go up to {1e3 * worst.mm:.1f} µm below their own surfaces ({place}); see verify."


def bound_in(rows: NDArray[np.float64], machine: Machine) -> tuple[Bound, ...]:
    """What limited a run that was recorded, as shares of the time in which it moved."""
    moving = rows[rows[:, COLUMN["motion_id"]] >= 0.0]
    codes = moving[:, COLUMN["limited_by"]].astype(int)
    ticks = np.bincount(codes, minlength=NUMBER_OF_CODES)
    return bounds(ticks.astype(np.float64), machine)


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
    yield "motion in all", f"{values['duration_s']:.3f} s, {values['ticks']} ticks"
    yield "cut", f"{values['cut_time_s']:.2f} s, {values['cut_length_mm']:.4f} mm of C1"
    if limits := values.get("binds"):
        names = ("limited by", "", "")
        yield from zip(names, told([Bound(**one) for one in limits]), strict=False)
    if resumes := values.get("assumed_resumes"):
        yield "program stops (M0)", f"{resumes}, a resume was assumed after each"
    if left := values.get("events_left"):
        yield "events after the end", f"{left}, not sent"


def _errors(values: Mapping[str, Any]) -> Rows:
    errors: Mapping[str, float] = values["following_error"]
    for unit, names in (("mm", "XYZ"), ("deg", "ABC")):
        largest = ", ".join(f"{name} {error:.3f}" for name, error in errors.items() if name in names)
        if largest:
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
