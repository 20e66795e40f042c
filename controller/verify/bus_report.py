"""The bus budget as text, 80 columns wide, and as a picture: who sends what when, and what is left."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.bar import Bar
from rich.console import Group
from rich.table import Table

from controller.verify.console import in_words, say
from drives.load import bus_frames, timeline
from drives.load.budget import BusBudget
from drives.load.bus_frames import Row
from drives.load.timeline import Slot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS, NUMBERS = 79, 35  # of the page; of id, bytes, lengths and start
SHORTEST_BAR = 10


def bus(one: BusBudget, max_share: float) -> Group:
    """One bus: its fullest tick along time, what comes now and then, and the sums."""
    return Group(_tick(one), _seldom(one), *sentences(one, max_share), "")


def _table(title: str | None, first: str, others: Sequence[str]) -> Table:
    table = Table(
        title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, title_justify="left"
    )
    table.add_column(say(f"bus_table.{first}"), no_wrap=True)
    for head in others:
        table.add_column(say(f"bus_table.{head}"), justify="right", no_wrap=True)
    return table


def _tick(one: BusBudget) -> Table:
    title = say("bus_table.tick", bus=one.bus, rate=_rate(one), period=one.period_us)
    table = _table(title, "frame", ("id", "bytes", "worst", "mean", "from"))
    slots = timeline.worst(one)
    names = [in_words(slot.row.text) + _every(slot.row) for slot in slots]
    width = max(SHORTEST_BAR, COLUMNS - NUMBERS - max(map(len, names)))
    size = max(one.period_us, one.total_us)
    to = say("bus_table.to")
    table.add_column(f"{to}{size:>{width - len(to) - 1}g}", width=width, no_wrap=True)
    for name, slot in zip(names, slots, strict=True):
        row = slot.row
        numbers = f"{row.worst_us:.0f}", f"{row.typical_us:.0f}", f"{slot.start_us:.0f}"
        bar = Bar(size, slot.start_us, slot.end_us, width=width, color="cyan")
        table.add_row(name, f"{row.can_id:03X}h", str(row.data_bytes), *numbers, bar)
    return table


def _every(row: Row) -> str:
    """Of feedback that does not come with every SYNC."""
    return "" if row.per_tick == 1.0 else f" 1/{round(1 / row.per_tick)}"


def _seldom(one: BusBudget) -> Table:
    """The other frames, those of one kind in one row."""
    table = _table(None, "seldom", ("id", "bytes", "worst", "mean", "every"))
    for what, rows in _alike((*one.background, *one.occasional)):
        ids = " .. ".join(dict.fromkeys(f"{row.can_id:03X}h" for row in (rows[0], rows[-1])))
        first = rows[0]
        every = say("bus_table.event")
        if first.per_tick:
            every = say("bus_table.ticks", count=1.0 / first.per_tick)
        worst, mean = max(row.worst_us for row in rows), max(row.typical_us for row in rows)
        table.add_row(what, ids, str(first.data_bytes), f"{worst:.0f}", f"{mean:.0f}", every)
    return table


def _alike(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """Rows of one kind together: heartbeats of X Y Z as one, in the order of the budget."""

    def kind(row: Row) -> tuple[str, int, float, str]:
        return row.frame, row.data_bytes, row.per_tick, str(row.sender == "controller")

    order = list(dict.fromkeys(map(kind, rows)))
    for key, found in groupby(sorted(rows, key=lambda row: order.index(kind(row))), kind):
        together = list(found)
        yield in_words(bus_frames.text(key[0], " ".join(row.node for row in together))), together


def sentences(one: BusBudget, max_share: float) -> Iterator[str]:
    """The sums in words."""
    if not one.bit_rate:
        yield say("bus_table.untimed")
        return
    sums = {"total": one.total_us, "share": one.share, "most": max_share, "background": one.background_us}
    yield say("bus_table.fullest", **sums)
    typical = {"typical": one.typical_us, "share": one.typical_us / one.period_us, "longest": one.longest_us}
    yield say("bus_table.typical", **typical)
    if one.spare_us >= 0.0:
        yield say("bus_table.spare", last=one.last_us, spare=one.spare_us)
    yield _at_once(one)
    every = one.sdo_every(max_share)
    if every and every > 1:
        yield say("bus_table.sdo_every", ticks=every)
    else:
        yield say("bus_table.sdo_each" if every else "bus_table.sdo_none")


def _at_once(one: BusBudget) -> str:
    room_us = one.period_us - one.total_us
    if room_us <= 0.0:
        return say("bus_table.crowded_for_ever", crowded=one.crowded_us)
    ticks = max(1, math.ceil((one.crowded_us - one.total_us) / room_us))
    key = "bus_table.crowded_once" if ticks == 1 else "bus_table.crowded"
    return say(key, crowded=one.crowded_us, ticks=ticks)


def _rate(one: BusBudget) -> str:
    return f"{one.bit_rate // 1000} kbit/s" if one.bit_rate else say("bus_table.no_timing")


# ---- the picture ---------------------------------------------------------------------------


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


def picture(budgets: Sequence[BusBudget], max_share: float, machine: str, path: str | Path) -> None:
    """A panel per bus, as PNG 1600 pixels wide; buses without bit timing have nothing to picture."""
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
