"""``directrix bench``: every figure beside its reference, measured in one run, with parts that add up.

A benchmark is a file of ``tests/benchmarks``, run as a process of its own, one after the other.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import textwrap
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from controller import atomic_file
from controller.cli import checkout
from controller.cli.host_view import Host
from controller.verify import console
from controller.verify.console import Refused, answered, bar, refusals, say, show, tell

BEGIN, END = "<!-- figures -->", "<!-- end of figures -->"
SAME = 1e-6  # that parts may miss the whole by

BOUNDS = ("at_most", "at_least", "at_most_times")  # what may be promised of a figure

Report = Mapping[str, Any]


def bench(
    name: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...")] = None,
    short: bool = False,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="DIR")] = None,
    readme: Annotated[Path | None, typer.Option("--readme", metavar="FILE")] = None,
    as_json: bool = False,
) -> None:
    """Measure: every figure beside its reference in the same run (cyclictest, rs274, bounds, one worker ...).

    A computer that does something else meanwhile spoils them: compare ratios of one run.
    """
    with refusals(as_json):
        folder = checkout.tests() / "benchmarks"
        known = sorted(file.stem for file in folder.glob("*.py"))
        if unknown := sorted(set(name or ()) - set(known)):
            raise Refused(_say("unknown", name=unknown[0], known=" ".join(known)))
        if readme is not None:
            _marked(readme)
        found: dict[str, Report] = {}
        with bar(say("cli.bar.measuring"), as_json) as progress:
            for k, one in enumerate(wanted := name or known):
                progress(k / len(wanted), one)
                found[one] = _measured(folder / f"{one}.py", short)
                if not as_json:
                    show.print(_table(one, found[one]))
        if plot is not None:
            _draw(found, plot)
        if readme is not None:
            text = readme.read_text(encoding="utf-8")
            head, _, rest = text.partition(BEGIN)
            made = f"{head}{BEGIN}\n{_page(found, short)}{END}{rest.partition(END)[2]}"
            atomic_file.write(readme, made)
        if failed := [one for one, report in found.items() if "error" in report]:
            raise Refused(_say("failed", names=" ".join(failed)), benchmarks=found)
        answered(as_json, short=short, benchmarks=found)


def _say(key: str, **values: object) -> str:
    return console.say(f"bench.{key}", **values)


def _measured(file: Path, short: bool) -> Report:
    """What a benchmark tells; ``error`` where it told nothing, or parts that do not add up."""
    command = [sys.executable, str(file), "--json", *(["--short"] if short else [])]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        return {"error": (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]}
    report: Report = json.loads(done.stdout.splitlines()[-1])
    parts = report["parts"]
    if parts and not abs(math.fsum(parts.values()) - 1.0) < SAME:
        return {"error": _say("parts", sum=100.0 * math.fsum(parts.values()))}
    return report


# ---- for people --------------------------------------------------------------------


def _table(name: str, report: Report) -> Table:
    table = Table(title=name, title_justify="left", caption=report.get("error") or report["note"] or None)
    table.add_column(_say("figure"))
    table.add_column(_say("value"), justify="right")
    table.add_column(_say("beside"))
    table.add_column(_say("ratio"), justify="right")
    table.add_column(_say("promised"))
    for one in report.get("figures", ()):
        table.add_row(*map(Text, (one["name"], *_cells(one))))
    for part, share in report.get("parts", {}).items():
        table.add_row(
            Text(f"  {part}"), f"{100.0 * share:.1f} %", Text(_say("of", whole=report["whole"])), "", ""
        )
    return table


def _cells(one: Mapping[str, Any]) -> tuple[str, str, str, str]:
    value = f"{one['value']:.4g} {one['unit']}".strip()
    beside = "" if one["reference"] is None else f"{one['beside']} {one['reference']:.4g}"
    ratio = "" if one["ratio"] is None else f"{one['ratio']:.3g}"
    return value, beside, ratio, _promise(one)


def _promise(one: Mapping[str, Any]) -> str:
    """What is promised of a figure; empty where nothing is."""
    said = [_say(bound, limit=f"{one[bound]:g}") for bound in BOUNDS if one[bound] is not None]
    return ", ".join(said)


def _marked(readme: Path) -> None:
    """Raises Refused where a page has no place for the figures, OSError where it cannot be read."""
    text = readme.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise Refused(_say("no_marks", file=readme, begin=BEGIN, end=END))


def _page(found: Mapping[str, Report], short: bool) -> str:
    """The figures of which something is promised as a table in Markdown, with what they were measured on."""
    rows = ["| what | value | beside it in the same run | ratio | promised |", "|---|---|---|---|---|"]
    for name, report in found.items():
        for one in report.get("figures", ()):
            if _promise(one):
                rows.append(f"| `{name}`: {' | '.join((one['name'], *_cells(one)))} |")
    day = datetime.now(UTC).date().isoformat()
    words = f"`directrix bench{' --short' if short else ''}` of {day} on {_processor()}."
    return "\n".join([textwrap.fill(words, 118), "", *rows, ""])


def _processor() -> str:
    from controller import workers

    return f"{workers.cores()} cores of {Host().processor or 'a processor'}"


def _draw(found: Mapping[str, Report], folder: Path) -> None:
    """A picture for each benchmark: figures over their references, and the parts of the whole."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    folder.mkdir(parents=True, exist_ok=True)
    for name, report in found.items():
        rows = [one for one in report.get("figures", ()) if one["ratio"]]
        parts = report.get("parts", {})
        if not rows and not parts:
            continue
        height = 1.2 + 0.28 * len(rows) + (1.0 if parts else 0.0)
        ratio = [max(len(rows), 1), 3 if parts else 0.01]
        drawn, (above, below) = pyplot.subplots(
            2, 1, figsize=(9.0, height), height_ratios=ratio, layout="constrained"
        )
        _bars(above, rows)
        left = 0.0
        for part, share in parts.items():
            below.barh([0], [share], left=left, label=f"{part} {share:.0%}")
            left += share
        below.set_axis_off()
        if parts:
            below.legend(ncols=3, fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(0.0, 0.0))
        drawn.suptitle(name)
        drawn.savefig(folder / f"{name}.png", dpi=120)
        pyplot.close(drawn)
    tell.print(_say("drawn", folder=folder))


def _bars(axes: Any, rows: Sequence[Mapping[str, Any]]) -> None:
    labels = [f"{one['name']} / {one['beside']}" for one in rows]
    axes.barh(labels, [one["ratio"] for one in rows])
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.invert_yaxis()
    axes.tick_params(labelsize=7)
    if rows and max(one["ratio"] for one in rows) > 20.0 * min(one["ratio"] for one in rows):
        axes.set_xscale("log")
