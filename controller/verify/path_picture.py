"""The path of a program from above and from the front: rapids, feeds, surfaces, and the lines that are named.

Coordinates are those of G54 as it is set up. matplotlib is imported when a picture is drawn, as in ``plots``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.model import Machine
from controller.plan.report.picture import FEED, RAPID, SURFACE, Shape, points_of
from controller.verify.console import say

if TYPE_CHECKING:
    from matplotlib.axes import Axes


INCHES, DPI = (16.0, 12.0), 100
# Okabe and Ito's palette, as in ``plots``.
WAYS = {
    RAPID: ("rapid", "#E69F00", 0.8),
    FEED: ("feed", "#0072B2", 1.2),
    SURFACE: ("surface", "#009E73", 1.8),
}
RULING, GUILTY, NOTED, INK = "#DDE7EE", "#D55E00", "#CC79A7", "#222222"
MAX_MARKS = 12  # of each kind
MAX_RULINGS = 200
MARGIN, MARGIN_MM = 0.12, 1.0  # around what is fed, of its size and at least


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


def refused(shape: Shape, machine: Machine, named: Sequence[Mark], title: str, file: Path) -> None:
    """What can be seen of a program that is refused, as PNG, 1600 x 1200 pixels. Raises OSError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=INCHES, dpi=DPI, facecolor="white", layout="constrained")
    figure.suptitle(title, color=INK, weight="bold", wrap=True)
    grid = figure.add_gridspec(2, 1, height_ratios=(3.0, 2.0))
    views(figure.add_subplot(grid[0]), figure.add_subplot(grid[1]), shape, machine, named)
    figure.savefig(file, format="png", dpi=DPI)


def views(top: Axes, front: Axes, shape: Shape, machine: Machine, named: Sequence[Mark]) -> None:
    """Both views of a path, with the places of the lines that are named."""
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
    beside = max(MARGIN * float((high - low).max()), MARGIN_MM)
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
