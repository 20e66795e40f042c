"""``directrix host``: whether a computer is made to hold 1 ms and 0.5 ms, and how long it really does."""

from __future__ import annotations

import contextlib
import json
import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from controller import atomic_file, messages
from controller.cli import host_findings, host_lines, host_measure, host_report, self_test, service
from controller.cli.host_lines import Line
from controller.cli.host_measure import Measured
from controller.cli.host_view import Host
from controller.cli.installation import STATE
from controller.cli.speech import Verbs
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.runtime import wake_ups
from controller.verify.console import Misunderstood, bar, in_words, refusals, say, show, tell
from drives import bus
from drives.bus import BusError

app = Verbs(add_completion=False, no_args_is_help=True)

USUAL_S = 60.0  # of a measurement where nothing is said
LONGEST_S = 31 * 24 * 3600.0


@app.command()
def check(root: Path = Path("/"), as_json: bool = False) -> None:
    """What this computer lacks to hold 1 ms and 0.5 ms: what was found, what is good, what to write where.

    It changes nothing. Exit code 1 when something that is needed is not good or cannot be seen.
    """
    lines = host_findings.look(Host(root))
    failed = [one for one in lines if not one.is_fit]
    if as_json:
        hints = sum(one.verdict == "hint" for one in lines)
        told = [one.to_dict() for one in lines]
        print(json.dumps({"ok": not failed, "failed": len(failed), "hints": hints, "lines": told}))
    else:
        for row in (row for one in lines for row in host_lines.text_rows(one)):
            show.print(row, soft_wrap=True)
        tell.print(_summed(lines, len(failed)))
    if failed:
        raise typer.Exit(1)


def _summed(lines: Sequence[Line], failed: int) -> str:
    counts = {"failed": failed, "all": len(lines), "hints": sum(one.verdict == "hint" for one in lines)}
    return _say("lacks" if failed else "is_fit", **counts)


@app.command()
def measure(
    machine: str | None = None,
    hours: float | None = None,
    seconds: float | None = None,
    period_ms: float | None = None,
    report: Annotated[Path, typer.Option("--report", metavar="FILE")] = Path("host.html"),
    send_sync: bool = False,
    state: Path = STATE,
    as_json: bool = False,
) -> None:
    """How late this computer wakes the tick, for hours: histogram and percentiles as a page to publish.

    Wake-ups, SYNC and cyclictest take turns on the same core. Beside a running machine its own SYNCs are
    heard, and nothing is sent. Exit code 1 when the period is not held.
    """
    with refusals(as_json):
        lasts_s = _lasts_s(hours, seconds)
        if not os.access(report.absolute().parent, os.W_OK):
            raise Misunderstood(_say("no_folder", folder=report.absolute().parent))
        host = Host()
        try:
            made = service.machine_of(machine)
            made = made if period_ms is None else machine_file.with_period(made, period_ms / 1e3)
            found = _measured(made, host, lasts_s, send_sync, state, as_json)
        except (ConfigError, BusError) as error:
            raise Misunderstood(in_words(messages.of_error(error))) from error
        lines = host_findings.look(host)
        atomic_file.write(report, host_report.page(found, lines, host))
        _tell(found, report, as_json)
    if not found.is_fit:
        raise typer.Exit(1)


def _lasts_s(hours: float | None, seconds: float | None) -> float:
    """Raises Misunderstood."""
    if hours is not None and seconds is not None:
        raise Misunderstood(_say("one_of_them"))
    lasts_s = 3600.0 * hours if hours is not None else USUAL_S if seconds is None else seconds
    if not 0.0 < lasts_s <= LONGEST_S:
        raise Misunderstood(_say("too_long", days=LONGEST_S / 86400.0))
    return lasts_s


def _measured(
    machine: Machine, host: Host, seconds: float, send_sync: bool, state: Path, quiet: bool
) -> Measured:
    """Raises BusError, Misunderstood where SYNC may not be sent."""
    buses = machine_file.bus_settings(machine)
    running = host.tick is not None
    if send_sync and running:
        raise Misunderstood(_say("it_runs"))
    with contextlib.ExitStack() as ending:
        before_term = signal.signal(
            signal.SIGTERM, signal.default_int_handler
        )  # as Ctrl-C: the page is written
        ending.callback(signal.signal, signal.SIGTERM, before_term)
        progress = ending.enter_context(bar(say("cli.bar.measuring"), quiet))
        heard = buses if running or send_sync else ()
        echoes = ending.enter_context(wake_ups.echoes_of(heard, machine.period_s))
        if running and not echoes:
            raise Misunderstood(_say("nothing_measured"))
        if running:
            found, before = Measured(machine.period_s, host.core), host.tick_faults()
            found.listen(seconds, echoes, progress)
            found.tick, after = self_test.running_tick(state), host.tick_faults()
            found.minor_faults, found.major_faults = after[0] - before[0], after[1] - before[1]
            return found
        if send_sync and not host_measure.is_silent(echoes):
            raise Misunderstood(_say("another_sync"))
        senders = [
            ending.enter_context(contextlib.closing(bus.open(one, ()))) for one in buses if one.name in echoes
        ]
        found = Measured(machine.period_s, host.core_for(wake_ups.may_be_real_time()))
        found.run(seconds, echoes, senders, progress)
        return found


def _tell(found: Measured, report: Path, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"ok": found.is_fit, "report": str(report), **found.to_dict()}))
        return
    for kind, name, counts in found.rows():
        figures: dict[str, Any] = host_measure.figures(counts, found.limit_s)
        values = {key.replace(".", "_"): value for key, value in figures.items()}
        show.print(host_report.name_of(kind, name))
        show.print(f"  {_say('figures', **values)}", soft_wrap=True)
    tell.print(host_report.verdict(found))
    tell.print(_say("written", file=report))


def _say(key: str, **values: object) -> str:
    return say(f"host.{key}", **values)
