"""``directrix demo``: what ``serve --simulate`` runs, and one who asks it for what an operator would.

The service is that of production, with its door; only its folders are gone at the end. What is asked here
goes through the door, as the page's and a script's requests do.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from controller.ipc import control_socket
from controller.ipc.control_socket import Client, CommandRefused
from controller.ipc.handoff import COLUMN
from controller.ipc.packed_rows import unpacked
from controller.machine.model import Machine
from controller.runtime import children, recording
from controller.service import engine, main
from controller.service.folders import Folders
from controller.service.jobs import UNDER_WAY
from controller.service.service import Service
from controller.state.modes import Binding, Fault, binding_text
from controller.store import service_store
from controller.store.set_up_store import SPINDLE
from controller.verify.console import Refused, bar, in_words, say

POLL_S = 0.5
CALM = {"look_s": 0.1}  # of the service itself: nobody waits for what it concludes but us
ROWS = 400  # that are asked for at a time: an answer has no more than 500
# A service has its disk write twenty times a second; what is thrown away needs none.
MEMORY = Path("/dev/shm")
RECORDED_S = 8.0  # for the recording of a fault to be there
FEED = binding_text(Binding.FEED, ())  # what is programmed is no limit
TOOLS = {"example2_ready.ngc": 4}  # what somebody has put into the spindle; else it is T1

Rows = npt.NDArray[np.float64]
Values = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Cut:
    """What came of it; ``rows`` are those of the recorder since the start was asked for."""

    rows: Rows
    result: str  # as a job's state
    fault: Fault
    sentence: str  # why it was not completed; "" where it was
    skips: int
    sync_stamps_s: dict[str, Rows]  # when SYNC left the wire, by bus


def cut(machine: Machine, program: Path, checks: Path, unchecked: bool, quiet: bool) -> Cut:
    """Load, home, start, and look on to the end. Raises Refused, SessionError, ProgramError.

    ``checks``: folder of stored checks; what is kept of a fault goes to the user's recordings.
    """
    in_memory = MEMORY.is_dir() and "TMPDIR" not in os.environ
    made = tempfile.TemporaryDirectory(prefix="directrix-", dir=MEMORY if in_memory else None)
    with children.CtrlC() as ctrl_c, made as text:
        folder = Path(text)
        if (tool := TOOLS.get(program.name)) is not None:
            service_store.put(folder, SPINDLE, tool)
        kept = Folders(folder, checks, recording.folder())
        with served(engine.simulated(machine), kept, folder / "run") as (service, client), _sentences():
            operator = Operator(client, ctrl_c.look)
            with bar(say("cli.bar.checking"), quiet) as progress:
                show = lambda now: progress((now["job"] or {}).get("checking") or 0.0)  # noqa: E731
                operator.done("load", show, path=str(program), name=program.name, unchecked=unchecked)
            operator.done("home")
            with bar(say("cli.bar.cutting"), quiet) as progress:
                rows, last = operator.run(lambda now: progress(_share(now), live_line(now)))
    return _cut(rows, last, service.engine.sync_stamps_s)


@contextlib.contextmanager
def served(machine: Machine, kept: Folders, runtime: Path) -> Iterator[tuple[Service, Client]]:
    """A machine that is looked after by a thread of its own, and a connection to its door."""
    over = threading.Event()
    with main.opened(machine, kept, runtime, stamped=True) as service:
        watch = threading.Thread(target=main.watch, args=(service, over.is_set), kwargs=CALM, name="watch")
        client = Client(control_socket.control_path(runtime))
        watch.start()
        try:
            yield service, client
        finally:
            client.close()
            over.set()
            watch.join()


@contextlib.contextmanager
def _sentences() -> Iterator[None]:
    """What the machine refuses is said as it says it."""
    try:
        yield
    except CommandRefused as error:
        raise Refused(in_words(error.said)) from error


class Operator:
    """One who asks at the door, and looks."""

    def __init__(self, client: Client, end: Callable[[], None] = lambda: None) -> None:
        """``end``: raises where nobody waits for it any more."""
        self._client, self._end = client, end
        self._rows: list[Rows] = []
        self._tick = -1  # of the last row

    def done(self, verb: str, look: Callable[[Values], None] = lambda _: None, **args: Any) -> None:
        """Ask for what takes long, and wait for its end. Raises CommandRefused, Refused."""
        answer = self._client.ask(verb, **args)
        while answer.get("done") is False:
            time.sleep(POLL_S)
            now = self._status()
            look(now)
            sequence = now["sequence"] or {}
            if sequence.get("state") == "failed":
                raise Refused(in_words(sequence))
            answer = {"done": sequence.get("state") != "running"}

    def run(self, look: Callable[[Values], None]) -> tuple[Rows, Values]:
        """Cycle start to the program's end: rows of every tick, and the last status."""
        self._tick = self._status()["tick"]["number"]
        self.done("start", unrecorded=True)  # though there is no room for it
        while (now := self._status())["job"]["state"] in UNDER_WAY:
            look(now)
            if now["spindle_change"]:  # which nobody has to switch here
                self.done("resume")
            if now["tick"]["number"] - self._tick >= ROWS:
                self._take_rows()
            time.sleep(POLL_S)
        now = self._recorded(now)
        self._take_rows()
        return np.concatenate(self._rows), now

    def _status(self) -> Values:
        self._end()
        return self._client.ask("status")

    def _recorded(self, now: Values) -> Values:
        """A fault's recording is written when the machine stands; the drives' way there belongs to it."""
        give_up_s = time.monotonic() + RECORDED_S
        while (shown := now["fault"]) and not shown["recording"] and time.monotonic() < give_up_s:
            time.sleep(POLL_S)
            now = self._status()
        return now

    def _take_rows(self) -> None:
        """All that there are by now."""
        while len(came := unpacked(self._client.ask("rows", after=self._tick))):
            self._rows.append(came)
            self._tick = int(came[-1, COLUMN["tick"]])


def _share(now: Values) -> float:
    """Of a run that is done; of one that was not checked nobody knows it."""
    return now["job"]["fraction"] or 0.0


def _cut(rows: Rows, last: Values, stamps_s: dict[str, Rows]) -> Cut:
    job, shown = last["job"], last["fault"]
    fault = Fault[shown["name"]] if shown else Fault.NONE
    sentence = ""
    if shown:
        kept = f" {say('cli.demo.recording', file=shown['recording'])}" if shown["recording"] else ""
        sentence = f"{in_words(shown)}{kept}"
    elif job["state"] != "completed":
        sentence = in_words(job) or say("cli.demo.ended", state=job["state"])
    return Cut(rows, job["state"], fault, sentence, last["tick"]["skips"], stamps_s)


def live_line(now: Mapping[str, Any]) -> str:
    """Of a status. For instance ``line 8: F 1000, actual 873 mm/min, limited by C acceleration``."""
    if now["mode"] != "RUNNING" or not now["in_block"]:
        return str(now["mode"]).lower()
    line = now["job"]["line"]
    if now["waiting"]:
        return say("cli.demo.waits", line=line, what=_awaited(now["spindle"]))
    feed = now["feed_mm_min"]
    adaptive = now["adaptive"]["share"] if now["adaptive"]["on"] else 1.0
    share = 1.0 if now["own_feed"] else now["override"] * adaptive
    wanted = say("cli.demo.rapid") if feed["programmed"] is None else f"F {feed['programmed'] * share:.0f}"
    is_limited = now["limited_by"] not in (None, FEED)
    figures = {"line": line, "wanted": wanted, "actual": feed["actual"], "limit": now["limited_by"]}
    return say("cli.demo.limited" if is_limited else "cli.demo.line", **figures)


def _awaited(spindle: Mapping[str, Any]) -> str:
    """What motion stands for."""
    if spindle["at_speed"] is not False:
        return say("cli.demo.coolant")
    if spindle["actual_rev_min"] is None:
        return say("cli.demo.spindle_alone", rev_min=spindle["rev_min"])
    return say("cli.demo.spindle", rev_min=spindle["rev_min"], actual_rev_min=spindle["actual_rev_min"])
