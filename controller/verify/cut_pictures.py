"""A picture of the cut surface: heat maps of the deviation over (u, v), and the part in its colours.

matplotlib is imported when a picture is drawn; the figure needs no window system.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.verify.console import say
from controller.verify.judge import Judged
from controller.verify.plots import DPI, INK, PIXELS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_MAPS = 6  # surfaces that get a map of their own: those that are off most
MIN_MM = 1e-4  # half of the colour scale at least
COLOURS = "coolwarm_r"  # red: overcut; grey where nothing is off, so that the part is seen on white


def picture(judged: Sequence[Judged], path: str | Path, title: str) -> None:
    """Draw what ``judge`` found as PNG, 1600 x 1000 pixels."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PIXELS[0] / DPI, PIXELS[1] / DPI), dpi=DPI, facecolor="white")
    figure.text(0.025, 0.962, say("cut_picture.title"), fontsize=19, color=INK, weight="bold", va="center")
    figure.text(0.025, 0.925, title, fontsize=12, color="#444444", va="center")
    if not judged:
        figure.text(0.5, 0.5, say("cut_picture.none"), fontsize=14, color=INK, ha="center")
        figure.savefig(path, format="png", dpi=DPI)
        return
    # An edge may be off by more: it shows in full colour, and its figure stands above its map.
    most = max(MIN_MM, *(one.inside.largest_mm for one in judged))
    shown = sorted(judged, key=lambda one: -one.whole.largest_mm)[:MAX_MAPS]
    shown = [one for one in judged if one in shown]
    colours = _part(figure, judged, most)
    for k, one in enumerate(shown):
        _map(figure, one, k, len(shown), most)
    bar = figure.colorbar(
        colours, cax=figure.add_axes((0.06, 0.06, 0.38, 0.018)), orientation="horizontal", extend="both"
    )
    bar.set_label(say("cut_picture.scale"), fontsize=10, color=INK)
    if len(shown) < len(judged):
        told = say("cut_picture.left_out", shown=len(shown), all=len(judged))
        figure.text(0.025, 0.89, told, fontsize=11, color=INK, va="center")
    figure.savefig(path, format="png", dpi=DPI)


def _part(figure: Figure, judged: Sequence[Judged], most: float) -> Any:
    """The surfaces in space; what the colour bar is of."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = ScalarMappable(Normalize(-1e3 * most, 1e3 * most), colormaps[COLOURS])
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


def _map(figure: Figure, one: Judged, k: int, count: int, most: float) -> None:
    """Deviation of one surface over u and v, the worst places marked."""
    height = 0.70 / count
    axes = figure.add_axes((0.06, 0.17 + (count - 1 - k) * height, 0.38, height - 0.075))
    axes.imshow(
        1e3 * one.map.t.T, extent=(*one.nominal.share, 1.0, 0.0), aspect="auto", cmap=COLOURS,
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
