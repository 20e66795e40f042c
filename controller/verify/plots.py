"""One picture of a cut: the part with the tool on it, and what the joints did over time.

matplotlib is imported when a picture is drawn, not before: it is slow to load and most
commands need none. The figure is drawn without pyplot, so no window system is touched.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array
from controller.geometry.surfaces import Surface
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.verify.console import say
from controller.verify.trace import HasMotion, Summary, Trace, following_error, speeds, summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


PIXELS = (1600, 1000)
DPI = 100
# Okabe and Ito's palette: its colours differ for every kind of colour vision, in print too.
JOINT_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00")
SURFACE, INK, FAINT, CUTTING = "#56B4E9", "#222222", "#6E6E6E", "#EEF5FA"
RULINGS = 24  # per surface
TOOL_AXES = 30  # over the whole cut
NEAR_MM = 4.0  # the way to and from the part is drawn this far around it
MARGIN = 0.03  # of the cut's duration, before and after it


def cut_picture(trace: Trace, machine: Machine, stretches: Mapping[int, HasMotion], path: str | Path) -> None:
    """Draw a trace as PNG, 1600 x 1000 pixels. ``stretches`` by motion id give the surfaces."""
    from matplotlib.figure import Figure

    cuts = [s.motion for s in stretches.values() if isinstance(s.motion, SurfaceCut)]
    figure = Figure(figsize=(PIXELS[0] / DPI, PIXELS[1] / DPI), dpi=DPI, facecolor="white")
    _headline(figure, trace, machine, cuts)
    figure.legend(
        handles=list(_key()), loc="upper left", bbox_to_anchor=(0.02, 0.877), ncols=2, frameon=False,
        fontsize=10.5, borderaxespad=0.0, columnspacing=2.0,
    )  # fmt: skip
    _part(figure.add_axes((0.0, -0.03, 0.56, 0.88), projection="3d"), trace, cuts)
    _time_panels(figure, trace, machine)
    figure.savefig(path, format="png", dpi=DPI)


def _headline(figure: Figure, trace: Trace, machine: Machine, cuts: list[SurfaceCut]) -> None:
    figures = summary(trace, machine, kinematics_of(machine), cuts[0].length_mm if cuts else 0.0)
    figure.text(
        0.025, 0.962, say("plot.title", name=machine.name), fontsize=19, color=INK, weight="bold", va="center"
    )
    for height, line in zip((0.925, 0.899), _lines(figures, trace), strict=True):
        figure.text(0.025, height, line, fontsize=12, color="#444444", va="center")


def _lines(figures: Summary, trace: Trace) -> tuple[str, str]:
    what = (
        say("plot.cut", cut_length_mm=figures.cut_length_mm, cut_time_s=figures.cut_time_s)
        if figures.cut_length_mm
        else say("plot.no_cut")
    )
    return (
        say("plot.period", what=what, period=trace.period_s * 1000.0),
        say("plot.errors", path=figures.path_error_mm * 1000.0, axis=figures.axis_error_deg * 1000.0),
    )


# ---- the part ----------------------------------------------------------------------


def _part(axes: Any, trace: Trace, cuts: list[SurfaceCut]) -> None:
    """Surfaces with rulings, the way of the tip, and the tool axis here and there."""
    for cut in cuts:
        _surface(axes, cut.surface)
    reach_mm = max((_height(cut.surface) for cut in cuts), default=10.0) * 1.35
    drawn = [*map(_corners, cuts), _tool(axes, trace, reach_mm)]
    low, high = (f(np.vstack(drawn), axis=0) for f in (np.nanmin, np.nanmax))
    _way(axes, trace, low, high)
    _frame(axes, low, high)


def _surface(axes: Any, surface: Surface) -> None:
    upper, lower = _edges(surface, np.linspace(0.0, 1.0, 121))
    grid = np.stack((upper, lower))
    axes.plot_surface(*np.moveaxis(grid, -1, 0), color=SURFACE, alpha=0.30, linewidth=0, shade=False)
    for edge, width in ((upper, 1.2), (lower, 2.2)):
        axes.plot(*edge.T, color=JOINT_COLOURS[0], linewidth=width)
    for top, foot in zip(*_edges(surface, np.linspace(0.0, 1.0, RULINGS + 1)), strict=True):
        axes.plot(*np.stack((top, foot)).T, color=JOINT_COLOURS[0], linewidth=0.6, alpha=0.7)


def _edges(surface: Surface, u: Array) -> tuple[Array, Array]:
    """Points of C0 and of C1, each (N, 3)."""
    upper, lower = (
        np.stack([np.broadcast_to(c, u.shape) for c in curve.at(u, np)], axis=1)
        for curve in (surface.upper, surface.lower)
    )
    return upper, lower


def _corners(cut: SurfaceCut) -> Array:
    return np.vstack(_edges(cut.surface, np.linspace(0.0, 1.0, 41)))


def _height(surface: Surface) -> float:
    upper, lower = _edges(surface, np.linspace(0.0, 1.0, 41))
    return float(np.linalg.norm(upper - lower, axis=1).max())


def _tool(axes: Any, trace: Trace, reach_mm: float) -> Array:
    """Tool axes at even steps of the cut; their ends, (N, 3)."""
    rows = np.flatnonzero(trace.cutting)
    if not len(rows):
        return trace.tool_tip
    rows = rows[np.linspace(0, len(rows) - 1, min(TOOL_AXES, len(rows))).astype(int)]
    tips, tops = trace.tool_tip[rows], trace.tool_tip[rows] + reach_mm * trace.tool_axis[rows]
    for tip, top in zip(tips, tops, strict=True):
        axes.plot(*np.stack((tip, top)).T, color=FAINT, linewidth=0.9)
    axes.plot(*tips.T, linestyle="none", marker="o", markersize=3.2, color=JOINT_COLOURS[4], label="_")
    return np.vstack((tips, tops))


def _way(axes: Any, trace: Trace, low: Array, high: Array) -> None:
    near = np.all((trace.tool_tip > low - NEAR_MM) & (trace.tool_tip < high + NEAR_MM), axis=1)
    cutting = trace.cutting
    for shown, style in (
        (near & cutting, {"color": JOINT_COLOURS[4], "linewidth": 1.8}),
        (near & ~cutting, {"color": FAINT, "linewidth": 1.2, "linestyle": (0, (3, 2))}),
    ):
        axes.plot(*np.where(shown[:, None], trace.tool_tip, np.nan).T, **style)


def _frame(axes: Any, low: Array, high: Array) -> None:
    """Equal aspect, labels in mm."""
    pad = 0.04 * float((high - low).max())
    size = high - low + 2.0 * pad
    for name, centre, extent in zip("xyz", 0.5 * (low + high), size, strict=True):
        getattr(axes, f"set_{name}lim")(centre - 0.5 * extent, centre + 0.5 * extent)
        getattr(axes, f"set_{name}label")(f"{name.upper()}, mm", labelpad=7, fontsize=11)
    axes.set_box_aspect(size, zoom=0.97)
    axes.view_init(elev=32, azim=-62)
    for pane in (axes.xaxis, axes.yaxis, axes.zaxis):
        pane.set_pane_color((1.0, 1.0, 1.0, 0.0))
        pane._axinfo["grid"].update(color="#EBEBEB", linewidth=0.6)
    axes.tick_params(labelsize=9, pad=2)
    axes.locator_params(axis="z", nbins=5)


def _key() -> Iterator[Any]:
    from matplotlib.lines import Line2D

    blue, red = JOINT_COLOURS[0], JOINT_COLOURS[4]
    yield Line2D([], [], color=blue, linewidth=2.2, label=say("plot.surface"))
    yield Line2D([], [], color=red, linewidth=1.8, marker="o", markersize=3.2, label=say("plot.cutting"))
    yield Line2D([], [], color=FAINT, linewidth=0.9, label=say("plot.axis"))
    yield Line2D([], [], color=FAINT, linewidth=1.2, linestyle=(0, (3, 2)), label=say("plot.not_cutting"))


# ---- over time ---------------------------------------------------------------------


def _time_panels(figure: Figure, trace: Trace, machine: Machine) -> None:
    """Six panels over one time axis."""
    shown = _window(trace)
    linear = [i for i, axis in enumerate(machine.axes) if not axis.is_rotary]
    rotary = [i for i, axis in enumerate(machine.axes) if axis.is_rotary]
    following = following_error(trace)
    share = np.abs(speeds(trace, machine)) * 100.0
    panels: list[tuple[str, Array, list[int]]] = [
        (say("plot.linear"), trace.joint_command, linear),
        (say("plot.rotary"), trace.joint_command, rotary),
        (say("plot.speed"), share, linear + rotary),
        (say("plot.feed"), _contact_feed(trace)[:, None] * 60.0, []),
        (say("plot.error_um"), following * 1e3, linear),
        (say("plot.error_mdeg"), following * 1e3, rotary),
    ]
    grid = figure.add_gridspec(len(panels), 1, left=0.625, right=0.982, top=0.955, bottom=0.058, hspace=0.42)
    first: Axes | None = None
    for row, (title, values, columns) in enumerate(panels):
        axes = figure.add_subplot(grid[row, 0], sharex=first)
        first = first or axes
        _panel(axes, title, trace, values, columns, shown)
        axes.tick_params(labelbottom=row == len(panels) - 1)
    axes.set_xlabel(say("plot.time"), fontsize=11)


def _window(trace: Trace) -> slice:
    """The cut with a margin; approach and retract would squeeze it to nothing."""
    cutting = np.flatnonzero(trace.cutting)
    if not len(cutting):
        return slice(0, len(trace.time_s))
    margin = int(MARGIN * (cutting[-1] - cutting[0])) + 1
    return slice(max(cutting[0] - margin, 0), cutting[-1] + margin + 1)


def _contact_feed(trace: Trace) -> Array:
    """Speed of the contact along C1 by its chords, mm/s; NaN when not cutting."""
    chords = np.linalg.norm(np.diff(trace.contact, axis=0, prepend=np.full((1, 3), np.nan)), axis=1)
    return np.asarray(chords / trace.period_s)


def _panel(axes: Axes, title: str, trace: Trace, values: Array, columns: list[int], shown: slice) -> None:
    time = trace.time_s[shown]
    for start, end in _spans(trace.cutting[shown]):
        axes.axvspan(time[start], time[end - 1], color=CUTTING, linewidth=0)
    for i in columns:
        axes.plot(time, values[shown, i], color=JOINT_COLOURS[i], linewidth=1.3, label=trace.axes[i])
    if not columns:
        axes.plot(time, values[shown, 0], color=INK, linewidth=1.3)
    axes.set_title(title, loc="left", fontsize=11, color=INK, pad=4)
    axes.set_xlim(time[0], time[-1])
    axes.set_ylim(*_range(trace, values[:, columns or [0]]))
    axes.grid(True, color="#E3E3E3", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9)
    axes.locator_params(axis="y", nbins=5)
    if columns:
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=len(columns), frameon=False, fontsize=10.5,
            borderaxespad=0.0, handlelength=1.4, columnspacing=1.2, handletextpad=0.5,
        )  # fmt: skip


def _range(trace: Trace, values: Array) -> tuple[float, float]:
    """What the cut itself needs, with air: approach and retract may leave the panel."""
    seen = values[trace.cutting] if trace.cutting.any() else values
    seen = seen[np.isfinite(seen).all(axis=1)]
    low, high = (float(seen.min()), float(seen.max())) if seen.size else (0.0, 1.0)
    if low >= 0.0 and low < 0.5 * high:
        low = 0.0
    # A joint that stands still gets a panel of its own size, not of its rounding.
    air = 0.12 * max(high - low, 0.02 * max(abs(low), abs(high)), 1e-3)
    return low - (air if low != 0.0 else 0.02 * (high - low)), high + air


def _spans(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """(start, end) of the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    for start, end in edges.reshape(-1, 2):
        yield int(start), int(end)
