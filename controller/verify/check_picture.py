"""One picture of a check: the path, what each block takes and is held by, how much of their limits axes use.

matplotlib is imported when a picture is drawn, as in ``plots``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from controller.plan.report.survey import BlockUse, Survey
from controller.verify.console import say
from controller.verify.path_picture import DPI, INCHES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's palette, as in ``plots``.
KINDS = {"velocity": "#0072B2", "acceleration": "#E69F00", "jerk": "#CC79A7"}
USED, ROOM, INK, OVER = "#0072B2", "#DDDDDD", "#222222", "#D55E00"


def draw(
    survey: Survey,
    blocks: Sequence[BlockUse],
    path: Callable[[Axes, Axes], None],
    title: str,
    file: Path,
) -> None:
    """As PNG, 1600 x 1200 pixels. Raises OSError.

    ``blocks``: those that take longest, in the program's order; ``path`` draws both views of it.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=INCHES, dpi=DPI, facecolor="white", layout="constrained")
    figure.suptitle(title, color=INK, weight="bold")
    grid = figure.add_gridspec(6, 2, width_ratios=(1.3, 1.0))
    path(figure.add_subplot(grid[:4, 0]), figure.add_subplot(grid[4:, 0]))
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
