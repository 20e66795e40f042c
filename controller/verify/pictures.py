"""Pictures as PNG: a cut and what the joints did, how far its surfaces are off, a path, a check.

matplotlib is imported when a picture is drawn, not before: it is slow to load and most
commands need none. The figure is drawn without pyplot, so no window system is touched.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array
from controller.geometry.surfaces import Surface
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.plan.report.picture import FEED, RAPID, SURFACE, Shape, points_of
from controller.plan.report.survey import BlockUse, Survey
from controller.verify.console import say
from controller.verify.judge import Judged
from controller.verify.trace import HasMotion, Summary, Trace, following_error, speeds, summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PIXELS, INCHES, DPI = (1600, 1000), (16.0, 12.0), 100
# Okabe and Ito's palette: its colours differ for every kind of colour vision, in print too.
JOINT_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00")
RULED, INK, FAINT, CUTTING = "#56B4E9", "#222222", "#6E6E6E", "#EEF5FA"
RULINGS = 24  # per surface
TOOL_AXES = 30  # over the whole cut
NEAR_MM = 4.0  # the way to and from the part is drawn this far around it
MARGIN = 0.03  # of the cut's duration, before and after it


def _figure(title: str) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PIXELS[0] / DPI, PIXELS[1] / DPI), dpi=DPI, facecolor="white")
    figure.text(0.025, 0.962, title, fontsize=19, color=INK, weight="bold", va="center")
    return figure


def _laid_out(title: str) -> Figure:
    """Of panels that find their places."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=INCHES, dpi=DPI, facecolor="white", layout="constrained")
    figure.suptitle(title, color=INK, weight="bold", wrap=True)
    return figure


def cut_picture(trace: Trace, machine: Machine, segments: Mapping[int, HasMotion], path: str | Path) -> None:
    """Draw a trace as PNG, 1600 x 1000 pixels. ``segments`` by motion id give the surfaces."""
    cuts = [s.motion for s in segments.values() if isinstance(s.motion, SurfaceCut)]
    figure = _figure(say("plot.title", name=machine.name))
    figures = summary(trace, machine, kinematics_of(machine), cuts[0].length_mm if cuts else 0.0)
    for height, line in zip((0.925, 0.899), _lines(figures, trace), strict=True):
        figure.text(0.025, height, line, fontsize=12, color="#444444", va="center")
    figure.legend(
        handles=list(_key()), loc="upper left", bbox_to_anchor=(0.02, 0.877), ncols=2, frameon=False,
        fontsize=10.5, borderaxespad=0.0, columnspacing=2.0,
    )  # fmt: skip
    _part(figure.add_axes((0.0, -0.03, 0.56, 0.88), projection="3d"), trace, cuts)
    _time_panels(figure, trace, machine)
    figure.savefig(path, format="png", dpi=DPI)


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
    axes.plot_surface(*np.moveaxis(grid, -1, 0), color=RULED, alpha=0.30, linewidth=0, shade=False)
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


# ---- how far the surfaces of a cut are off -------------------------------------------------


MAX_MAPS = 6  # surfaces that get a map of their own: those that are off most
MIN_MM = 1e-4  # half of the colour scale at least
DEVIATION_COLOURS = "coolwarm_r"  # red: overcut; grey where nothing is off, so that the part is seen on white


def deviations(judged: Sequence[Judged], path: str | Path, title: str) -> None:
    """Draw what ``judge`` found as PNG, 1600 x 1000 pixels."""
    figure = _figure(say("cut_picture.title"))
    figure.text(0.025, 0.925, title, fontsize=12, color="#444444", va="center")
    if not judged:
        figure.text(0.5, 0.5, say("cut_picture.none"), fontsize=14, color=INK, ha="center")
        figure.savefig(path, format="png", dpi=DPI)
        return
    # An edge may be off by more: it shows in full colour, and its figure stands above its map.
    most = max(MIN_MM, *(one.inside.largest_mm for one in judged))
    shown = sorted(judged, key=lambda one: -one.whole.largest_mm)[:MAX_MAPS]
    shown = [one for one in judged if one in shown]
    colours = _deviating_part(figure, judged, most)
    for k, one in enumerate(shown):
        _deviation_map(figure, one, k, len(shown), most)
    bar = figure.colorbar(
        colours, cax=figure.add_axes((0.06, 0.06, 0.38, 0.018)), orientation="horizontal", extend="both"
    )
    bar.set_label(say("cut_picture.scale"), fontsize=10, color=INK)
    if len(shown) < len(judged):
        told = say("cut_picture.left_out", shown=len(shown), all=len(judged))
        figure.text(0.025, 0.89, told, fontsize=11, color=INK, va="center")
    figure.savefig(path, format="png", dpi=DPI)


def _deviating_part(figure: Figure, judged: Sequence[Judged], most: float) -> Any:
    """The surfaces in space; what the colour bar is of."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = ScalarMappable(Normalize(-1e3 * most, 1e3 * most), colormaps[DEVIATION_COLOURS])
    axes: Any = figure.add_axes((0.465, 0.0, 0.48, 0.92), projection="3d")
    for one in judged:
        points, t = _thinned(one)
        faces = colours.to_rgba(
            1e3 * np.nan_to_num(0.25 * (t[1:, 1:] + t[:-1, 1:] + t[1:, :-1] + t[:-1, :-1]))
        )
        axes.plot_surface(
            *np.moveaxis(points, -1, 0), facecolors=faces, rstride=1, cstride=1, linewidth=0, shade=False
        )
        for edge in (points[:, 0], points[:, -1], points[0], points[-1]):
            axes.plot(*edge.T, color=INK, linewidth=0.8)
    every = np.vstack([one.map.points.reshape(-1, 3) for one in judged])
    axes.set_box_aspect(np.maximum(np.ptp(every, axis=0), 1.0))
    for name, label in (("x", "X"), ("y", "Y"), ("z", "Z")):
        getattr(axes, f"set_{name}label")(f"{label} mm", fontsize=10, color=INK)
    axes.tick_params(labelsize=9)
    return colours


def _thinned(one: Judged) -> tuple[Any, Any]:
    """At most some 129 by 17 points of a map."""
    along, across = (max(1, (n - 1) // most) for n, most in zip(one.map.t.shape, (128, 16), strict=True))
    return one.map.points[::along, ::across], one.map.t[::along, ::across]


def _deviation_map(figure: Figure, one: Judged, k: int, count: int, most: float) -> None:
    """Deviation of one surface over u and v, the worst places marked."""
    height = 0.70 / count
    axes = figure.add_axes((0.06, 0.17 + (count - 1 - k) * height, 0.38, height - 0.075))
    axes.imshow(
        1e3 * one.map.t.T, extent=(*one.nominal.share, 1.0, 0.0), aspect="auto", cmap=DEVIATION_COLOURS,
        vmin=-1e3 * most, vmax=1e3 * most, interpolation="bilinear",
    )  # fmt: skip
    for worst, colour in ((one.whole.overcut, "#67001F"), (one.whole.undercut, "#053061")):
        if worst and abs(worst.mm) > MIN_MM:
            axes.plot(worst.u, worst.v, marker="x", markersize=8, color=colour, clip_on=False)
    over = -one.whole.overcut.mm if one.whole.overcut else 0.0
    under = one.whole.undercut.mm if one.whole.undercut else 0.0
    um = {"over": 1e3 * over, "under": 1e3 * under, "inside": 1e3 * one.inside.largest_mm}
    axes.set_title(
        say("cut_picture.surface", line=one.nominal.line, **um),
        loc="left", fontsize=10, color=INK,
    )  # fmt: skip
    axes.set_xlabel("u", fontsize=10, color=INK)
    axes.set_ylabel(say("cut_picture.v"), fontsize=10, color=INK)
    axes.tick_params(labelsize=9)


# ---- a path from above and from the front --------------------------------------------------


WAYS = {
    RAPID: ("rapid", "#E69F00", 0.8),
    FEED: ("feed", "#0072B2", 1.2),
    SURFACE: ("surface", "#009E73", 1.8),
}
RULING, GUILTY, NOTED = "#DDE7EE", "#D55E00", "#CC79A7"
MAX_MARKS = 12  # of each kind
MAX_RULINGS = 200
PATH_MARGIN, MARGIN_MM = 0.12, 1.0  # around what is fed, of its size and at least


class Mark(NamedTuple):
    """A line of the program that a refusal or a note names."""

    line: int
    refused: bool


def marks(lines: Iterable[int], refused: bool) -> list[Mark]:
    """The first ``MAX_MARKS`` lines, each once."""
    several = sorted({line for line in lines if line > 0})
    return [Mark(line, refused) for line in several[:MAX_MARKS]]


def place_of(mark: Mark, shape: Shape) -> int | None:
    """Where a line is marked: at the end of what it feeds, or else of its points."""
    points = points_of(mark.line, shape, of_text=True)
    fed = points & (shape.kinds != RAPID)
    found = np.flatnonzero(fed if fed.any() else points)
    return int(found[-1]) if len(found) else None


def refused_path(shape: Shape, machine: Machine, named: Sequence[Mark], title: str, file: Path) -> None:
    """What can be seen of a program that is refused, as PNG, 1600 x 1200 pixels. Raises OSError."""
    figure = _laid_out(title)
    grid = figure.add_gridspec(2, 1, height_ratios=(3.0, 2.0))
    views(figure.add_subplot(grid[0]), figure.add_subplot(grid[1]), shape, machine, named)
    figure.savefig(file, format="png", dpi=DPI)


def views(top: Axes, front: Axes, shape: Shape, machine: Machine, named: Sequence[Mark]) -> None:
    """Both views of a path, with the places of the lines that are named; coordinates are those of G54."""
    _view(top, shape, machine, (0, 1), named)
    top.set_title(say("check_picture.top"))
    top.legend(frameon=False, fontsize=9, loc="best")
    _view(front, shape, machine, (0, 2), named)
    front.set_title(say("check_picture.front"))


def _view(axes: Axes, shape: Shape, machine: Machine, across: tuple[int, int], named: Sequence[Mark]) -> None:
    from matplotlib.collections import LineCollection

    tips = _in_offset(shape.tips, machine)[:, across]
    rulings = shape.rulings[:: 1 + len(shape.rulings) // MAX_RULINGS].reshape(-1, 3)
    ends = _in_offset(rulings, machine)[:, across].reshape(-1, 2, 2)
    axes.add_collection(LineCollection([*ends], colors=RULING, linewidths=0.6), autolim=False)
    segments = np.stack([tips[:-1], tips[1:]], axis=1) if len(tips) else np.empty((0, 2, 2))
    for kind, (name, colour, width) in WAYS.items():
        mine = segments[shape.kinds[1:] == kind]
        if len(mine):
            dashes = "dashed" if kind == RAPID else "solid"
            drawn = LineCollection([*mine], colors=colour, linewidths=width, linestyles=dashes)
            drawn.set_label(say(f"check_picture.{name}"))
            axes.add_collection(drawn, autolim=False)
    for mark in named:
        _mark(axes, mark, shape, tips)
    _near(axes, tips, shape)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(visible=True, color="#EEEEEE")


def _near(axes: Axes, tips: Array, shape: Shape) -> None:
    """What is fed is seen whole; of rapids what is beside it."""
    fed = shape.kinds != RAPID
    fed[:-1] |= fed[1:]  # where a feed begins
    points = tips[fed] if fed.any() else tips
    low, high = points.min(axis=0), points.max(axis=0)
    beside = max(PATH_MARGIN * float((high - low).max()), MARGIN_MM)
    axes.update_datalim([low - beside, high + beside])
    axes.autoscale_view(tight=True)


def _mark(axes: Axes, mark: Mark, shape: Shape, tips: Array) -> None:
    place = place_of(mark, shape)
    if place is None:
        return
    colour, sign = (GUILTY, "X") if mark.refused else (NOTED, "v")
    label = say("check_picture.refused" if mark.refused else "check_picture.note", line=mark.line)
    x, y = map(float, tips[place])
    axes.plot(
        [x],
        [y],
        sign,
        color=colour,
        markersize=11 if mark.refused else 6,
        label=label,
        zorder=5,
        scalex=False,
        scaley=False,
    )
    if mark.refused:
        axes.text(x, y, f"   {mark.line}", color=colour, weight="bold", va="bottom", clip_on=True)


def _in_offset(points: Array, machine: Machine) -> Array:
    """Places (N, 3) of the table frame as coordinates of G54."""
    frame = machine.offsets[0]
    return np.asarray((points - frame.origin) @ np.array([frame.x, frame.y, frame.z]).T)


# ---- a check -------------------------------------------------------------------------------


KINDS = {"velocity": "#0072B2", "acceleration": "#E69F00", "jerk": "#CC79A7"}
USED, ROOM, OVER = "#0072B2", "#DDDDDD", "#D55E00"


def check_picture(
    survey: Survey,
    blocks: Sequence[BlockUse],
    shape: Shape,
    machine: Machine,
    named: Sequence[Mark],
    title: str,
    file: Path,
) -> None:
    """As PNG, 1600 x 1200 pixels. Raises OSError.

    The path, what each block takes and is held by, how much of their limits axes use. ``blocks``: those that
    take longest, in the program's order.
    """
    figure = _laid_out(title)
    grid = figure.add_gridspec(6, 2, width_ratios=(1.3, 1.0))
    views(figure.add_subplot(grid[:4, 0]), figure.add_subplot(grid[4:, 0]), shape, machine, named)
    _blocks(figure.add_subplot(grid[:3, 1]), blocks)
    _limits(figure.add_subplot(grid[3, 1]), survey)
    _travel(figure.add_subplot(grid[4:, 1]), survey)
    figure.savefig(file, format="png", dpi=DPI)


def _blocks(axes: Axes, blocks: Sequence[BlockUse]) -> None:
    """How long each takes, with its ways; what holds it most stands beside it."""
    taken = [
        sum(part.time_s for part in (one.approach, one.own, one.departure) if part is not None)
        for one in blocks
    ]
    places = range(len(blocks))
    axes.barh(places, taken, color=USED)
    axes.set_yticks(places, [f"{one.line} {one.what}" for one in blocks])
    axes.invert_yaxis()
    axes.set_xlabel("s")
    axes.set_title(say("check_picture.line"))
    for place, one, seconds in zip(places, blocks, taken, strict=True):
        if one.own.binds:
            bound = one.own.binds[0]
            text = f" {bound.what} {100.0 * bound.share:.0f} %"
            axes.text(seconds, place, text, va="center", fontsize=8, color=INK)
    axes.margins(x=0.3)


def _limits(axes: Axes, survey: Survey) -> None:
    """The largest shares of each axis' limits; what is over one has another colour."""
    for k, (kind, colour) in enumerate(KINDS.items()):
        shares = [getattr(joint, f"{kind}_share") for joint in survey.joints]
        colours = [OVER if kind in joint.over else colour for joint in survey.joints]
        places = [place + 0.27 * (k - 1) for place in range(len(shares))]
        axes.bar(places, [100.0 * share for share in shares], 0.25, color=colours, label=kind)
    axes.axhline(100.0, color=INK, linewidth=1.0)
    axes.set_xticks(range(len(survey.joints)), [joint.name for joint in survey.joints])
    axes.set_ylabel(say("check_picture.limit"))
    axes.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def _travel(axes: Axes, survey: Survey) -> None:
    """Of each axis' travel what the program uses, as shares; with the figures at its ends."""
    for place, joint in enumerate(survey.joints):
        low, high = joint.travel
        span = high - low or 1.0
        axes.barh(place, 100.0, color=ROOM)
        begin = 100.0 * (joint.lowest - low) / span
        axes.barh(place, 100.0 * (joint.highest - joint.lowest) / span, left=begin, color=USED)
        words = f"{joint.lowest:.2f} ... {joint.highest:.2f}   of {low:g} ... {high:g}"
        axes.text(2.0, place - 0.45, words, va="bottom", fontsize=8, color=INK)
    axes.set_yticks(range(len(survey.joints)), [joint.name for joint in survey.joints])
    axes.invert_yaxis()
    axes.set_xlabel(say("check_picture.travel"))
