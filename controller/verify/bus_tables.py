"""The bus budget as text, 80 columns wide: who sends what when, and what is left."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

from rich import box
from rich.bar import Bar
from rich.console import Group
from rich.table import Table

from drives.load import timeline
from drives.load.budget import BusBudget
from drives.load.bus_frames import Row

COLUMNS, NUMBERS = 79, 35  # of the page; of id, bytes, lengths and start
SHORTEST_BAR = 10


def bus(one: BusBudget, max_share: float) -> Group:
    """One bus: its fullest tick along time, what comes now and then, and the sums."""
    return Group(_tick(one), _seldom(one), *sentences(one, max_share), "")


def _table(title: str | None, first: str, others: Sequence[str]) -> Table:
    table = Table(
        title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, title_justify="left"
    )
    table.add_column(first, no_wrap=True)
    for head in others:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def _tick(one: BusBudget) -> Table:
    title = f"{one.bus}: {_rate(one)}, one tick of {one.period_us:g} us at its worst"
    table = _table(title, "frame", ("id", "bytes", "worst", "mean", "from"))
    slots = timeline.worst(one)
    names = [slot.row.what + _every(slot.row) for slot in slots]
    width = max(SHORTEST_BAR, COLUMNS - NUMBERS - max(map(len, names)))
    size = max(one.period_us, one.total_us)
    table.add_column(f"to{size:>{width - 3}g}", width=width, no_wrap=True)
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
    table = _table(None, "now and then", ("id", "bytes", "worst", "mean", "every"))
    for what, rows in _alike((*one.background, *one.occasional)):
        ids = " .. ".join(dict.fromkeys(f"{row.can_id:03X}h" for row in (rows[0], rows[-1])))
        first = rows[0]
        every = f"{1.0 / first.per_tick:g} ticks" if first.per_tick else "event"
        worst, mean = max(row.worst_us for row in rows), max(row.typical_us for row in rows)
        table.add_row(what, ids, str(first.data_bytes), f"{worst:.0f}", f"{mean:.0f}", every)
    return table


def _alike(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """Rows of one kind together: heartbeats of X Y Z as one, in the order of the budget."""

    def kind(row: Row) -> tuple[str, int, float, str]:
        return row.what.split(" of ")[0], row.data_bytes, row.per_tick, str(row.sender == "controller")

    order = list(dict.fromkeys(map(kind, rows)))
    for key, found in groupby(sorted(rows, key=lambda row: order.index(kind(row))), kind):
        together = list(found)
        names = " ".join(row.what.split(" of ")[1] for row in together if " of " in row.what)
        yield f"{key[0]} of {names}" if names else key[0], together


def sentences(one: BusBudget, max_share: float) -> Iterator[str]:
    """The sums in words."""
    if not one.bit_rate:
        yield "No bit timing: frames take no time on this virtual bus, so that everything fits."
        return
    yield (
        f"Fullest tick {one.total_us:.0f} us = {one.share:.1%} of the tick, allowed {max_share:.0%}; "
        f"heartbeats {one.background_us:.0f} us a tick."
    )
    yield (
        f"A typical tick takes {one.typical_us:.0f} us = {one.typical_us / one.period_us:.1%}, "
        f"the longest over all payloads {one.longest_us:.0f} us."
    )
    if one.spare_us >= 0.0:
        yield f"Setpoints are across after {one.last_us:.0f} us: a tick may send {one.spare_us:.0f} us late."
    yield _at_once(one)
    every = one.sdo_every(max_share)
    paced = f"one question every {every} ticks" if every and every > 1 else "one question every tick"
    yield f"SDO while it runs: {paced if every else 'none'}."


def _at_once(one: BusBudget) -> str:
    text = f"Everything in one tick, SDO and emergencies too: {one.crowded_us:.0f} us"
    room_us = one.period_us - one.total_us
    if room_us <= 0.0:
        return f"{text}; never worked off."
    ticks = max(1, math.ceil((one.crowded_us - one.total_us) / room_us))
    return f"{text}, worked off in {ticks} {'tick' if ticks == 1 else 'ticks'}."


def _rate(one: BusBudget) -> str:
    return f"{one.bit_rate // 1000} kbit/s" if one.bit_rate else "no bit timing"
