"""The paper's comparison for people: two tables that fit 80 columns."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from controller.verify.console import say
from controller.verify.paper import Errors, Method, PaperComparison, Part, Printed

FIGURES = ("contour", "axis", "nearest", "feed_share", "by_axis", "in_all")
OF_PARTS = ("length", "feed", "cut", "reported", "setpoints")


def render(comparison: PaperComparison, console: Console) -> None:
    """Print the comparison as two tables, each with a line on how to read it."""
    figures = {"feed": comparison.feed_mm_s, "length": comparison.length_mm}
    console.print(say("paper.title", **figures), highlight=False)
    console.print(_methods(comparison.methods))
    console.print(say("paper.of_methods"), style="dim", highlight=False)
    console.print()
    console.print(_parts(comparison.parts))
    console.print(say("paper.of_parts"), style="dim", highlight=False)


def _table() -> Table:
    return Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=0)


def _methods(methods: tuple[Method, ...]) -> Table:
    table = _table()
    table.add_column(say("paper.head.method"), min_width=18, no_wrap=True)
    table.add_column(say("paper.head.where"), min_width=7, no_wrap=True)
    for head in FIGURES:
        table.add_column(say(f"paper.head.{head}"), justify="right", no_wrap=True)
    for method in methods:
        rows = [(say("paper.at"), *_figures(method.at)), (say("paper.between"), *_figures(method.between))]
        if method.printed is not None:
            rows.append((say("paper.printed"), *_printed(method.printed)))
        titles = (*_title(method), *[""] * len(rows))
        for i, (title, row) in enumerate(zip(titles, rows, strict=False)):
            style = "dim" if i > 1 else ""
            table.add_row(title, *row, style=style, end_section=i == len(rows) - 1)
    return table


def _title(method: Method) -> tuple[str, str]:
    period = "" if method.period_s is None else f", {method.period_s * 1e3:g} ms"
    return say(method.name) + period, say(f"paper.linear.{method.between_samples}")


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
    table.add_column(say("paper.head.part"), min_width=28, no_wrap=True)
    for head in OF_PARTS:
        table.add_column(say(f"paper.head.{head}"), justify="right", no_wrap=True)
    for part in parts:
        table.add_row(
            f"{say(part.name)}\n  {part.feed_word}: {say(part.note)}",
            "\n".join(f"{length:.4f}" for length in part.lengths_mm),
            f"{part.feed_mm_min:g}",
            f"{part.cut_time_s:.2f}",
            f"{part.reported_s:g}",
            str(part.setpoints),
            end_section=True,
        )
    return table
