"""What the command line prints for people: tables that fit 80 columns."""

from __future__ import annotations

import heapq
import json
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TextIO

import numpy as np
from numpy.typing import NDArray

from controller.ipc.handoff import COLUMN
from controller.machine.model import Machine
from controller.plan.feed.binding import NUMBER_OF_CODES
from controller.plan.report.stored import Overcut
from controller.plan.report.survey import MAX_SHARES, BlockUse, Survey
from controller.plan.report.tally import Bound, Part, bounds
from controller.plan.report.works import CUTS
from controller.plan.segment import motion_named
from controller.verify.console import say, word

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from controller.verify.paper import Errors, Method, PaperComparison, PaperPart, Printed

_Pairs = Iterator[tuple[str, str]]


MIN_SHARE = 0.005  # of the time; what binds for less is not worth a word in a table
TWISTED_MM = 1e-4  # less is shown as nothing
MAX_BINDS = 3  # in one row
FULL = 1.0005  # of a limit: 100.1 % in the table
MAX_HOLES = 40  # of the table; JSON has more


def blocks(rows: Rows) -> Table:
    """What ``check`` found out about every block, or about those that take longest."""
    table = headed("table.blocks", ("line", "what", "length", "time", "feed", "binds"), left=("what",))
    table.columns[-1].no_wrap, table.columns[-1].justify = False, "left"
    for block in rows.longest:
        line = f"{block.line}" if block.lines == 1 else f"{block.line}-{block.last_line}"
        for what, part in _parts(block):
            table.add_row(
                line,
                what,
                f"{part.length_mm:.2f}",
                f"{part.time_s:.2f}",
                _feed(part),
                "\n".join(binding_texts(part.binds)),
            )
            line = ""
    if rows.left_out:
        table.caption = say("table.longest", shown=len(rows.longest), more=rows.left_out)
    return table


def _titled(title: str, **looks: bool) -> Table:
    """Imported when a table is shown: who wants JSON does not wait for it."""
    from rich.table import Table

    return Table(title=title, **looks)  # type: ignore[arg-type]


def headed(title: str, heads: Sequence[str], left: Collection[str] = (), **values: object) -> Table:
    """A table by the keys of its title and its columns; figures are on the right."""
    table = _titled(say(title, **values))
    for head in heads:
        table.add_column(say(f"table.{head}"), justify="left" if head in left else "right", no_wrap=True)
    return table


def kind(what: str) -> str:
    """What a block or a step does, in words."""
    motion = motion_named(what)
    return say(f"table.kind.{what}") if motion == "form.motion.other" else say(motion)


def _parts(block: BlockUse) -> Iterator[tuple[str, Part]]:
    what = kind(block.what)
    if block.lines > 1:
        what = say("table.several", count=block.lines, what=what)
    names = (say("table.approach"), what, say("table.departure"))
    for name, part in zip(names, (block.approach, block.own, block.departure), strict=True):
        if part and part.time_s > 0.0:
            yield name, part


def _feed(part: Part) -> str:
    if part.length_mm == 0.0:
        return ""
    mean = f"{part.feed_mean:.0f}"
    return say("table.of", part=mean, whole=f"{part.feed:.0f}") if part.feed else mean


def binding_texts(found: Sequence[Bound]) -> list[str]:
    """What binds most, in words: 'programmed feed 54 %', 'C acceleration 43 %'."""
    worth = [bound for bound in found if bound.share >= MIN_SHARE][:MAX_BINDS]
    return [f"{_bound(bound)} {100 * bound.share:.0f} %" for bound in worth]


def _bound(bound: Bound) -> str:
    if bound.axis and bound.kind:
        return f"{bound.axis} {word(f'bound.{bound.kind}', bound.kind)}"
    return word(f"bound.{bound.what}", bound.what)


def whole(found: Survey, program: str, machine: str) -> str:
    """The last lines of ``check``."""
    done = [say(f"table.work.{one.what}", time=one.time_s, length=one.length_mm) for one in found.work]
    cuts = any(one.what in CUTS for one in found.work)
    part = say("table.work_part", parts=", ".join(done)) if cuts else say("table.no_cut")
    rows = [say("table.can_run", program=program, machine=machine)]
    rows.append(say("table.in_all", time=found.duration_s, part=part))
    if found.waits_s:
        rows.append(say("table.waits", time=found.waits_s))
    if limits := binding_texts(found.cut_binds):
        rows.append(say("table.limited", limits=", ".join(limits)))
    return "\n".join(rows)


def overcut(overcuts: Sequence[Overcut]) -> str:
    """What the cuts take too much of their own surfaces, where that is most."""
    worst = max(overcuts, key=lambda one: one.mm)
    if worst.mm < TWISTED_MM:
        return say("table.no_overcut")
    return say("table.overcut", um=1e3 * worst.mm, line=worst.line, u=worst.u, v=worst.v)


def tools(found: Survey) -> Table:
    """What each tool does."""
    heads = ("t", "cut_time", "rapid_time", "cut_length", "speed_range", "feed_range", "deepest")
    table = headed("table.tools", heads)
    for use in found.tools:
        deepest = "" if use.deepest_mm is None else f"{use.deepest_mm:.3f}"
        times = f"{use.cut_s:.1f}", f"{use.rapid_s:.1f}"
        ranges = _range(use.spindle_rev_min), _range(use.feed_mm_min)
        table.add_row(f"T{use.tool}", *times, f"{use.cut_mm:.1f}", *ranges, deepest)
    return table


def _range(ends: tuple[float, float] | None) -> str:
    low, high = ("", "") if ends is None else (f"{end:.0f}" for end in ends)
    return low if low == high else f"{low}-{high}"


def holes(found: Survey) -> Table:
    """The first holes of its cycles; figures have their axis where the plane is not that of X and Y."""
    heads = ("line", "t", "cycle", "offset", "x", "y", "from", "to")
    table = headed("table.holes", heads, left=("cycle", "offset"))
    for hole in found.holes[:MAX_HOLES]:
        first, second, normal = hole.axes
        axes = (first, second, normal, normal)
        letters = ("XYZ"[i] if hole.plane != "G17" else "" for i in axes)
        values = hole.place[first], hole.place[second], hole.begin, hole.end
        figures = (f"{letter}{value:.3f}" for letter, value in zip(letters, values, strict=True))
        table.add_row(f"{hole.line}", f"T{hole.tool}", hole.cycle, hole.offset, *figures)
    if (shown := table.row_count) < found.hole_count:
        table.caption = say("table.more_holes", shown=shown, all=found.hole_count)
    return table


def bound_in(rows: NDArray[np.float64], machine: Machine) -> tuple[Bound, ...]:
    """What limited a run that was recorded, as shares of the time in which it moved."""
    moving = rows[rows[:, COLUMN["motion_id"]] >= 0.0]
    codes = moving[:, COLUMN["limited_by"]].astype(int)
    ticks = np.bincount(codes, minlength=NUMBER_OF_CODES)
    return bounds(ticks.astype(np.float64), machine)


def joints(found: Survey) -> Table:
    """What ``check`` found out about every joint."""
    heads = ("axis", "from", "to", "travel", "velocity", "acceleration", "jerk")
    table = headed("table.joints", heads, left=("axis",))
    for use in found.joints:
        shares = {kind: f"{100 * getattr(use, f'{kind}_share'):.1f} %" for kind in MAX_SHARES}
        table.add_row(
            use.name,
            f"{use.lowest:.3f}",
            f"{use.highest:.3f}",
            f"{use.travel[0]:g} .. {use.travel[1]:g}",
            *(
                f"{share} {word('programs.over_limit')}" * (kind in use.over) or share
                for kind, share in shares.items()
            ),
        )
    if any(
        getattr(use, f"{kind}_share") > FULL and kind not in use.over
        for use in found.joints
        for kind in MAX_SHARES
    ):
        most = {kind: 100.0 * share for kind, share in MAX_SHARES.items()}
        table.caption = say("table.within", **most)
    return table


def figures(title: str, values: Mapping[str, Any]) -> Table:
    """The figures of a run, as ``simulate`` and ``demo`` give them with --json."""
    table = _titled(say(title), show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right")
    for name, value in (*_run(values), *_errors(values), *_syncs(values)):
        table.add_row(name, value)
    return table


def _run(values: Mapping[str, Any]) -> _Pairs:
    fault = f": {values['fault']}" if values["fault"] else ""
    yield say("table.program"), Path(values["program"]).name
    yield say("table.result"), word(f"result.{values['result']}", values["result"]) + fault
    yield say("table.motion"), say("table.ticks", time=values["duration_s"], ticks=values["ticks"])
    yield say("table.cut"), say("table.cut_c1", time=values["cut_time_s"], length=values["cut_length_mm"])
    if limits := values.get("binds"):
        names = (say("table.limited_by"), "", "")
        yield from zip(names, binding_texts([Bound(**one) for one in limits]), strict=False)
    if resumes := values.get("assumed_resumes"):
        yield say("table.stops"), say("table.resumed", count=resumes)
    if left := values.get("events_left"):
        yield say("table.events_left"), say("table.not_sent", count=left)


def _errors(values: Mapping[str, Any]) -> _Pairs:
    errors: Mapping[str, float] = values["following_error"]
    for unit, names in (("mm", "XYZ"), ("deg", "ABC")):
        largest = ", ".join(f"{name} {error:.3f}" for name, error in errors.items() if name in names)
        if largest:
            shown = say("unit.deg") if unit == "deg" else unit
            yield say("table.following_error") if unit == "mm" else "", f"{largest} {shown}"
    yield say("table.path_error"), f"{1e3 * values['path_error_mm']:.3f} um"
    yield say("table.axis_error"), f"{values['axis_error_deg']:.2e} {say('unit.deg')}"
    yield say("table.skips"), f"{values['skips']}"
    if "times_real_time" in values:
        yield say("table.speed"), say("table.real_time", times=values["times_real_time"])


def _syncs(values: Mapping[str, Any]) -> _Pairs:
    for bus, sync in values.get("sync", {}).items():
        ms = ("p50_s", "p99_s", "p999_s", "max_s")
        yield say("table.sync", bus=bus), "p50 / p99 / p99.9 / max"
        yield "", " / ".join(f"{1e3 * sync[key]:.3f}" for key in ms) + " ms"
        share = f"{100 * sync['outside_share']:.3f} %"
        yield say("table.outside"), say("table.of", part=share, whole=sync["count"])


# ---- the blocks of a check on their way to the reader --------------------------------------


MAX_ROWS = 40  # of the table; JSON has all
IN_MEMORY = 1 << 20  # bytes of JSON before they go to a file
CHUNK = 1 << 16


class Rows:
    """Takes blocks one by one; memory does not grow with their number."""

    def __init__(self) -> None:
        self.count = 0
        self.left_out = 0  # that move, but not as long as the longest
        self._longest: list[tuple[float, int, BlockUse]] = []
        self._text: IO[str] = tempfile.SpooledTemporaryFile(IN_MEMORY, "w+", encoding="utf-8")  # noqa: SIM115

    def take(self, block: BlockUse) -> None:
        """The next block."""
        self._text.write(("," if self.count else "") + json.dumps(block.to_dict()))
        self.count += 1
        took_s = sum(part.time_s for part in (block.own, block.approach, block.departure) if part)
        if took_s == 0.0:
            return
        row = (took_s, -self.count, block)
        if len(self._longest) < MAX_ROWS:
            heapq.heappush(self._longest, row)
        else:
            heapq.heappushpop(self._longest, row)
            self.left_out += 1

    @property
    def longest(self) -> list[BlockUse]:
        """The blocks that take longest, in the order of the program."""
        return [block for _, _, block in sorted(self._longest, key=lambda row: -row[1])]

    def write(self, facts: dict[str, Any], out: TextIO) -> None:
        """One JSON object on one line: the facts, and all blocks as ``blocks``."""
        out.write(json.dumps(facts)[:-1] + ', "blocks": [')
        self._text.seek(0)
        while chunk := self._text.read(CHUNK):
            out.write(chunk)
        out.write("]}\n")


# ---- the comparison of the paper -----------------------------------------------------------


FIGURES = ("contour", "axis", "nearest", "feed_share", "by_axis", "in_all")
OF_PARTS = ("length", "feed", "cut", "reported", "setpoints")


def paper(comparison: PaperComparison, console: Console) -> None:
    """Print the comparison as two tables, each with a line on how to read it."""
    figures = {"feed": comparison.feed_mm_s, "length": comparison.length_mm}
    console.print(say("paper.title", **figures), highlight=False)
    console.print(_methods(comparison.methods))
    console.print(say("paper.of_methods"), style="dim", highlight=False)
    console.print()
    console.print(_paper_parts(comparison.parts))
    console.print(say("paper.of_parts"), style="dim", highlight=False)


def _bare_table() -> Table:
    from rich import box
    from rich.table import Table

    return Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=0)


def _methods(methods: tuple[Method, ...]) -> Table:
    table = _bare_table()
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


def _paper_parts(parts: tuple[PaperPart, ...]) -> Table:
    table = _bare_table()
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
