"""The bus budget as a picture: one tick of every bus along time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.verify.console import in_words, say
from drives.load import timeline
from drives.load.budget import BusBudget
from drives.load.timeline import Slot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 100
WIDTH, PANEL, HEAD, FOOT = 1600, 215, 85, 30  # pixels: of the picture, of a panel, above and below them
LEFT, RIGHT, TITLE, TICKS = 136, 40, 32, 38  # of the axes in a panel: margins
INK, FAINT = "#222222", "#6E6E6E"
# Okabe and Ito's palette, and hatches: the kinds differ for every kind of colour vision, and in print.
LOOKS = {
    "SYNC": ("#222222", ""),
    "feedback": ("#56B4E9", ""),
    "setpoint": ("#E69F00", ""),
    "emergency": ("#D55E00", "/"),
    "SDO": ("#CC79A7", ""),
    "heartbeat": ("#009E73", ""),
    "others": ("#BBBBBB", ""),
}
ALIKE = {  # frames with the look of another
    "speed": "setpoint",
    **dict.fromkeys(("controller_heartbeat", "guarding", "answer"), "heartbeat"),
    **dict.fromkeys(("sdo_question", "sdo_answer"), "SDO"),
}
LANES = (
    ("worst", timeline.worst),
    ("typical", timeline.typical),
    ("at_once", timeline.crowded),
)
LETTER = 8  # pixels, about


def draw(budgets: Sequence[BusBudget], max_share: float, machine: str, path: str | Path) -> None:
    """A panel per bus, as PNG 1600 pixels wide; buses without bit timing have nothing to draw."""
    from matplotlib.figure import Figure

    height = PANEL * len(budgets) + HEAD + FOOT
    figure = Figure(figsize=(WIDTH / DPI, height / DPI), dpi=DPI, facecolor="white")
    panels = [_place(figure, number, height) for number in range(len(budgets))]
    for axes, one in zip(panels, budgets, strict=True):
        _panel(axes, one, max_share)
    panels[-1].set_xlabel(say("bus_picture.time"), fontsize=11)
    _headline(figure, machine, height)
    figure.savefig(path, format="png", dpi=DPI)


def _place(figure: Figure, number: int, height: int) -> Axes:
    """Axes for a panel, counted from above."""
    bottom = height - HEAD - (number + 1) * PANEL + TICKS
    width, tall = WIDTH - LEFT - RIGHT, PANEL - TITLE - TICKS
    return figure.add_axes((LEFT / WIDTH, bottom / height, width / WIDTH, tall / height))


def _headline(figure: Figure, machine: str, height: int) -> None:
    from matplotlib.patches import Patch

    title = say("bus_picture.title", machine=machine)
    figure.text(0.012, 1.0 - 28 / height, title, fontsize=17, color=INK, va="center", weight="bold")
    handles = [
        Patch(facecolor=colour, hatch=hatch, edgecolor="white", label=say(f"bus_picture.frames.{name}"))
        for name, (colour, hatch) in LOOKS.items()
    ]
    figure.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0.008, 1.0 - 44 / height), ncols=len(handles),
        frameon=False, fontsize=10.5,
    )  # fmt: skip


def _panel(axes: Axes, one: BusBudget, max_share: float) -> None:
    width_us = max(one.period_us, one.crowded_us) * 1.01
    for lane, (_name, laid) in enumerate(LANES):
        for slot in laid(one):
            _frame(axes, slot, lane, width_us)
    allowed_us = max_share * one.period_us
    axes.axvline(allowed_us, color=INK, linewidth=1.2, linestyle=(0, (4, 3)))
    axes.axvline(one.period_us, color="#D55E00", linewidth=2.0)
    axes.set_xlim(0.0, width_us)
    axes.set_ylim(len(LANES) - 0.5, -0.5)
    axes.set_yticks(range(len(LANES)), [say(f"bus_picture.{name}") for name, _ in LANES])
    axes.set_title(_title(one, max_share), loc="left", fontsize=11, color=INK, pad=5)
    axes.tick_params(labelsize=9.5, length=3)
    axes.spines[["top", "right"]].set_visible(False)


def _title(one: BusBudget, max_share: float) -> str:
    if not one.bit_rate:
        return say("bus_picture.untimed", bus=one.bus)
    rate = say("bus_picture.rate", bit_rate=one.bit_rate // 1000, period_us=one.period_us)
    full = say("bus_picture.fullest", total_us=one.total_us, share=one.share, typical_us=one.typical_us)
    return f"{one.bus}, {rate}: {full} (dashed: allowed {max_share:.0%}; red: next SYNC)"


def _frame(axes: Axes, slot: Slot, lane: int, width_us: float) -> None:
    colour, hatch = LOOKS[_look(slot)]
    long_us = slot.end_us - slot.start_us
    look: dict[str, Any] = {"color": colour, "edgecolor": "white", "hatch": hatch, "linewidth": 0.8}
    axes.barh(lane, long_us, left=slot.start_us, height=0.72, **look)
    name = slot.row.node or in_words(slot.row.text)
    if long_us / width_us * (WIDTH - LEFT - RIGHT) > LETTER * (len(name) + 1):
        middle_us = 0.5 * (slot.start_us + slot.end_us)
        axes.text(middle_us, lane, name, ha="center", va="center", fontsize=9.5, color=INK)


def _look(slot: Slot) -> str:
    kind = slot.row.frame
    kind = ALIKE.get(kind, kind)
    return kind if kind in LOOKS else "others"
