"""The client verbs that look or bring: ``directrix status``, ``upload``, ``runs``, ``alarms``, over REST."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote

import typer
from rich.console import RenderableType
from rich.live import Live
from rich.text import Text

from controller.cli import remote, status_view
from controller.cli.client import Url, connected, tell_done
from controller.cli.remote import Machine
from controller.cli.speech import say
from controller.verify.console import Refused, answered, bar, show, tell, word

Most = Annotated[int, typer.Option("--most", min=1, max=200)]

WATCH_S = 0.25  # between two looks
CHECK_S = 0.3
MAX_OPEN = 10  # alarms under a status
CHECKED = ("passed", "refused", "failed", "none")


# --- status


def status(watch: bool = False, url: Url = remote.URL, as_json: bool = False) -> None:
    """Mode, positions, feed and what limits it, time left, alarms; once, or live.

    Where the service is gone: what it told last, and exit code 1.
    """
    with connected(url, as_json) as machine:
        if watch and not as_json:
            follow(machine)
            return
        now = machine.get("status", last=True)
        gone_s = now.get("gone_s")
        if as_json:
            print(json.dumps({"ok": gone_s is None, **now}))
        else:
            show.print(status_view.view(now, _open_alarms(machine)))
    if gone_s is not None:
        raise typer.Exit(1)


def follow(machine: Machine, pause: Callable[[float], None] = time.sleep) -> None:
    """Live in a terminal; into a file or a pipe a line per change. Ends by Ctrl-C alone.

    A panel or a service that is started anew meanwhile is waited for, and that is told.
    """
    with contextlib.suppress(KeyboardInterrupt):
        if show.is_terminal:
            _live(machine, pause)
        else:
            _lines(machine, pause)


def _live(machine: Machine, pause: Callable[[float], None]) -> None:
    with Live(console=show.console, auto_refresh=False) as live:
        while True:
            live.update(_seen(machine), refresh=True)
            pause(WATCH_S)


def _seen(machine: Machine) -> RenderableType:
    try:
        return status_view.view(machine.get("status", last=True), _open_alarms(machine))
    except Refused as refused:
        return Text(str(refused), "red")


def _lines(machine: Machine, pause: Callable[[float], None]) -> None:
    before = ""
    while True:
        try:
            now = status_view.line(machine.get("status", last=True))
        except Refused as refused:
            now = str(refused)
        if now != before:
            print(now, flush=True)
        before = now
        pause(WATCH_S)


def _open_alarms(machine: Machine) -> list[dict[str, Any]]:
    """Those that nobody has acknowledged; of a service that is gone none are known."""
    try:
        found: list[dict[str, Any]] = machine.get("alarms", only="open", most=MAX_OPEN)["alarms"]
    except Refused as refused:
        if refused.facts.get("code") != "gone":
            raise
        return []
    return found


# --- upload


def upload(
    file: Path, name: str = "", wait: bool = True, url: Url = remote.URL, as_json: bool = False
) -> None:
    """Bring a program into the machine's store, where it is checked; it never starts by itself."""
    with connected(url, as_json) as machine:
        sent = upload_file(machine, file, name or file.name)
        if wait:
            sent = wait_for_check(machine, str(sent["name"]), as_json)
        check = sent.get("check") or {}
        if check.get("state") in ("refused", "failed"):
            raise Refused(check_refusal(str(sent["name"]), check["result"]), **sent)
        tell_done(_stored(str(sent["name"]), check), sent, as_json)


def upload_file(machine: Machine, file: Path, name: str) -> dict[str, Any]:
    """Streamed, with the checksum first: what was cut off on the way is not kept."""
    if not file.is_file():
        raise Refused(say("no_file", file=file))
    with file.open("rb") as content:
        form = {"sha256": hashlib.file_digest(content, "sha256").hexdigest()}
        content.seek(0)
        sent: dict[str, Any] = machine.post("programs", files={"file": (name, content)}, data=form)
    return sent


def wait_for_check(machine: Machine, name: str, quiet: bool) -> dict[str, Any]:
    """The program's facts once its check has ended."""
    with bar(say("checking", name=name), quiet) as progress:
        while True:
            facts: dict[str, Any] = machine.get(f"programs/{quote(name, safe='')}")
            check = facts.get("check") or {"state": "none"}
            if check["state"] in CHECKED:
                return facts
            progress(float(check.get("progress") or 0.0))
            time.sleep(CHECK_S)


def _stored(name: str, check: Mapping[str, Any]) -> str:
    if check.get("state") != "passed":
        return say("stored_only", name=name)
    result = check.get("result") or {}
    takes_s = result.get("takes_s", result.get("duration_s"))
    long = takes_s is not None
    return say("stored_long" if long else "stored", name=name, clock=status_view.clock(takes_s))


def check_refusal(name: str, result: Mapping[str, Any]) -> str:
    """The check's own sentence, with its place."""
    sentence = str(result.get("sentence") or say("check_failed"))
    place = ":".join(str(result[key]) for key in ("line", "column") if result.get(key) is not None)
    return f"{name}:{place}: {sentence}" if place and not sentence.startswith(name) else sentence


# --- runs and alarms


def runs(
    most: Most = 20,
    keep: int | None = None,
    release: int | None = None,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """What was run, when, how long, and how it ended."""
    with connected(url, as_json) as machine:
        if keep is not None and release is not None:
            raise Refused(say("keep_or_release"))
        for number, on, key in ((keep, True, "run_kept"), (release, False, "run_released")):
            if number is not None:
                done = machine.put(f"runs/{number}/kept", {"on": on})
                tell_done(say(key, number=number), done, as_json)
                return
        found = machine.get("runs", most=most)["runs"]
        if answered(as_json, runs=found):
            return
        for line in _runs(found) if found else (say("no_runs"),):
            show.print(line, soft_wrap=True)


def _runs(found: list[dict[str, Any]]) -> Iterator[str]:
    """A line for each run, and below it why it did not come to its end; the name, of any length, is last."""
    rows = [tuple(say(head) for head in ("run", "began", "took", "result", "program"))]
    for run in found:
        ended_s = run["ended_s"]
        took = status_view.clock(None if ended_s is None else ended_s - run["began_s"])
        result = word(f"result.{run['result']}", run["result"])
        result += f", {say('run_stays')}" if run["facts"].get("kept") else ""
        rows.append((str(run["id"]), _when(run["began_s"]), took, result, run["program"]))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)]
    whys = ("", *(str(run["facts"].get("sentence") or "") for run in found))
    for row, why in zip(rows, whys, strict=True):
        yield "  ".join([*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[-1]])
        if why:
            yield f"    {why}"


def alarms(
    most: Most = 20, acknowledge: int | None = None, url: Url = remote.URL, as_json: bool = False
) -> None:
    """What went wrong, newest first, and who has acknowledged it."""
    with connected(url, as_json) as machine:
        if acknowledge is not None:
            done = machine.post(f"alarms/{acknowledge}/acknowledge")
            tell_done(say("acknowledged", number=acknowledge), done, as_json)
            return
        found = machine.get("alarms", most=most)["alarms"]
        if answered(as_json, alarms=found):
            return
        for alarm in found:
            tell_done(_alarm(alarm), None, False)
        if not found:
            tell.print(say("no_alarms"))


def _alarm(alarm: Mapping[str, Any]) -> str:
    by = say("acknowledged_by", name=alarm["acknowledged_by"])
    seen = by if alarm["acknowledged_s"] else say("open")
    return f"{alarm['id']}  {_when(alarm['at_s'])}  {seen}\n    {alarm['sentence']}"


def _when(at_s: float) -> str:
    return datetime.fromtimestamp(at_s).strftime("%Y-%m-%d %H:%M:%S")
