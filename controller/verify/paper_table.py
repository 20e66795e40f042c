"""The paper's comparison for people: two tables that fit 80 columns."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from controller.verify.paper import Errors, Method, PaperComparison, Part, Printed

HEADS = ("contour\num", "axis\ndeg", "axis,\nnearest", "feed\n%", "X Y Z\nby axis", "X Y Z\nin all")


def render(comparison: PaperComparison, console: Console) -> None:
    """Print the comparison as two tables, each with a line on how to read it."""
    console.print(
        f"Eq. 7 at {comparison.feed_mm_s:g} mm/s along C1 ({comparison.length_mm:.4f} mm): largest errors "
        "at the samples and between them, where orientation or joints run linearly.",
        highlight=False,
    )
    console.print(_methods(comparison.methods))
    console.print(
        "contour: contact to C1. axis: to the ruling due at that instant; nearest: to the ruling "
        "through the nearest point of C1. feed: speed of the contact along C1. X Y Z by axis: what "
        "the axis error alone moves them, um (Eq. 11, the paper's figure); in all: against X Y Z due "
        "at that instant, um.",
        style="dim",
        highlight=False,
    )
    console.print()
    console.print(_parts(comparison.parts))
    console.print(
        "cut: length of C1 over the feed, without ramps and approach. setpoints: per axis, one per 2 ms.",
        style="dim",
        highlight=False,
    )


def _table() -> Table:
    return Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=0)


def _methods(methods: tuple[Method, ...]) -> Table:
    table = _table()
    table.add_column("method", min_width=18, no_wrap=True)
    table.add_column("where", min_width=7, no_wrap=True)
    for head in HEADS:
        table.add_column(head, justify="right", no_wrap=True)
    for method in methods:
        rows = [("at", *_figures(method.at)), ("between", *_figures(method.between))]
        if method.printed is not None:
            rows.append(("paper", *_printed(method.printed)))
        titles = (*_title(method), *[""] * len(rows))
        for i, (title, row) in enumerate(zip(titles, rows, strict=False)):
            style = "dim" if row[0] == "paper" else ""
            table.add_row(title, *row, style=style, end_section=i == len(rows) - 1)
    return table


def _title(method: Method) -> tuple[str, str]:
    period = "" if method.period_s is None else f", {method.period_s * 1e3:g} ms"
    return method.name + period, f"{method.between_samples} linear"


def _figures(e: Errors) -> tuple[str, ...]:
    figures = (
        1e3 * e.contour_mm,
        e.axis_deg,
        e.axis_at_contact_deg,
        100.0 * e.feed_share,
        e.position_um,
        e.machine_um,
    )
    return tuple(map(_short, figures))


def _printed(p: Printed) -> tuple[str, ...]:
    contour_um = None if p.contour_mm is None else 1e3 * p.contour_mm
    cells = (contour_um, p.axis_deg, None, None, p.position_um, None)
    return tuple("" if cell is None else f"{cell:g}" for cell in cells)


def _short(value: float) -> str:
    """Three digits; what is nothing but rounding reads 0."""
    return "0" if abs(value) < 1e-8 else f"{value:.3g}"


def _parts(parts: tuple[Part, ...]) -> Table:
    table = _table()
    table.add_column("part", min_width=28, no_wrap=True)
    for head in ("length\nmm", "feed\nmm/min", "cut\ns", "paper\ns", "set-\npoints"):
        table.add_column(head, justify="right", no_wrap=True)
    for part in parts:
        table.add_row(
            f"{part.name}\n  {part.feed_word}: {part.note}",
            "\n".join(f"{length:.4f}" for length in part.lengths_mm),
            f"{part.feed_mm_min:g}",
            f"{part.cut_time_s:.2f}",
            f"{part.reported_s:g}",
            str(part.setpoints),
            end_section=True,
        )
    return table
