"""The program that is loaded, and what has become of it."""

from __future__ import annotations

import hashlib
import os
from collections import deque
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from controller import messages as catalogue
from controller import own_files
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.machine.changes import Change
from controller.machine.model import Joints, Machine, Tool
from controller.plan.report.passing import passed_s
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.plan.timetable import Passed
from controller.program import carried, linked, probing_cycles
from controller.program.modal import State
from controller.runtime.starts import Start
from controller.service import journal
from controller.service.planner_client import News, Program, Said, Way
from controller.service.probed import found
from controller.service.refusals import number, refused, whole
from controller.service.time_left import Left, TimeLeft
from controller.state.modes import Mode

MDI = "MDI"
MAX_BYTES = 1 << 30  # of a program
MAX_TYPED = 1000  # bytes of a line typed by hand that are told
INTERRUPTED = "interrupted"  # by the end of its service; it is not loaded
UNDER_WAY = ("starting", "running", "held", "stopping")
_STATES = {
    Mode.READY: "stopping",  # at its end already, and about to be filed
    Mode.RUNNING: "running",
    Mode.HOLD: "held",
    Mode.JOG: "held",
    Mode.STOPPING: "stopping",
    Mode.FAULT: "stopping",
}


MAX_MESSAGES = 20  # that are shown


@dataclass(slots=True)
class Job:
    """One program; ``state``: loading, loaded, starting, running, held, stopping, then how it ended."""

    program: Program
    sha256: str
    state: str = "loading"
    block_delete: bool = False  # lines that begin with / were left out when it was loaded
    time: TimeLeft = field(default_factory=TimeLeft)
    blocks: int | None = None
    notes: list[dict[str, Any]] = field(default_factory=list)
    verdict: dict[str, Any] | None = None  # on the form of its surfaces
    restart: list[catalogue.Said] = field(default_factory=list)  # the state at the place where it begins
    entry: journal.Entry | None = None  # of the journal, where it goes on with that
    start: Start | None = None  # of its last run
    origin_s: float = 0.0  # plan time at which its first piece begins
    ways: dict[int, Way] = field(default_factory=dict)
    fed: set[int] = field(default_factory=set)  # motions at feed, until they are passed
    changes: dict[int, tuple[int, ...]] = field(default_factory=dict)  # tools that it asks for, by line
    news: News = field(default_factory=News)
    said: catalogue.Said | None = None  # why it ended, or was not loaded
    taken: bool = False  # the tick has begun with it
    refused: bool = False  # a block on the way was; the tool stands before it
    lost: bool = False  # the plan that knew the rest of it is gone
    armed_tick: int = -1  # what was seen of the machine before it tells nothing of this run
    before_s: float = 0.0  # of a whole run at 100 %, before the place where this one begins
    nominal_s: float = 0.0  # of that run, before the place where the tool is
    last: Snapshot | None = None  # of the program's own motions
    messages: list[str] = field(default_factory=list)  # what the program said last
    next_tool: int | None = None  # that T has just named, where a changer prepares
    found: list[dict[str, Any]] = field(default_factory=list)  # of that the results of probing cycles
    is_own: bool = False  # lines of the control's own: the modal state is not theirs to change
    state_before: State | None = None  # the modal state before it began
    fitted: dict[str, Any] = field(default_factory=dict)  # with which it was started ...
    tools: tuple[Tool, ...] = ()  # ... and the tool table as it has made it since
    _due: deque[Said] = field(default_factory=deque)  # what it will say
    _passed: int = 0  # motions before this one are no more among ``fed``
    _reached: int = -1  # the last motion that was under way
    _seen_s: float | None = None  # plan time of the last look

    @property
    def is_mdi(self) -> bool:
        """A line typed by hand."""
        return self.program.typed

    @property
    def duration_s(self) -> float | None:
        """Of the whole program, by the clock of its path: without what it waits for."""
        return self.time.duration_s

    @property
    def active(self) -> bool:
        """Between the start and the end."""
        return self.state in UNDER_WAY

    def arm(self, tick: int) -> None:
        """What was of the run before is over; ``tick`` is the newest one."""
        self.armed_tick = tick
        self.ways.clear()
        self.fed.clear()
        self._passed = 0
        self.changes.clear()
        self._due.clear()
        self.next_tool = None
        self._reached, self.messages, self.found = -1, [], []
        self.news = News(finished=False)
        self.state, self.said = "starting", None
        self.taken = self.refused = self.lost = False
        self.nominal_s, self._seen_s, self.last = self.before_s, None, None
        self.time.begin()

    def told(self) -> dict[str, Any]:
        """What a record says of it."""
        spot = self.program.spot
        line = spot.line if spot is not None else None
        return {"name": self.program.name, "sha256": self.sha256, "line": line}

    def journalled(self, now: Machine) -> journal.Job:
        """What is run, with where a whole run of it starts; ``now``: with what it has set since."""
        program = self.program
        joints = whole_from(self.start) or homed_position(program.machine)
        run = journal.Job.of(program.name, program.text, now, joints, program.dry_run_mm, self.fitted)
        begin = None if program.begin is None else carried.to_json(program.begin)
        return replace(run, file_sha256=self.sha256, block_delete=self.block_delete, begin=begin)

    def state_at(self, now: Snapshot) -> str:
        """The state by this very snapshot, though nobody has drawn conclusions yet."""
        if not self.taken or not self.active:
            return self.state
        return _STATES.get(now.mode, self.state)

    def pass_time(self, now: Snapshot) -> None:
        """Where the tool is, the check knows the time; where it stands, and of what no check was kept, of a
        plan at another override than 100 % so much less, or more, of the check's time has passed."""
        place = self.place(now.motion_id, now.s)
        if 0 <= now.motion_id < ENTRY_ID:
            self.last = now
        if place is not None:
            self.nominal_s = max(self.nominal_s, passed_s(self.time.marks, place))
        elif self._seen_s is not None and now.motion_id < ENTRY_ID:  # not on a way aside
            way = self.ways.get(now.motion_id)
            rapid = way is not None and way.feed_mm_s is None
            share = min(now.rapid_override, 1.0) if rapid else now.feed_share
            self.nominal_s += (now.plan_time_s - self._seen_s) * share
        self._seen_s = now.plan_time_s

    def fraction(self, motion_id: int, s: float) -> float:
        """Of its program line that is done at a place of a motion."""
        way = self.ways.get(motion_id)
        return way.fraction(s) if way is not None else 0.0

    def place(self, motion_id: int, s: float) -> Passed | None:
        """As a check marks it; None where it is none of the program's, or no check has marks."""
        way = self.ways.get(motion_id)
        return way.place(s) if way is not None and self.time.marks else None

    def known(self, motion_id: int, s: float) -> journal.Known:
        """Of a place, for the journal."""
        place, way = self.place(motion_id, s), self.ways.get(motion_id)
        return journal.Known(
            self.fraction(motion_id, s),
            passed_s(self.time.marks, place) if place else None,
            self.duration_s,
            self._elapsed_s(self.last) if self.last is not None else None,
            way.in_block(s) if way is not None else None,
        )

    def _elapsed_s(self, now: Snapshot) -> float:
        return max(0.0, now.plan_time_s - self.origin_s) + self.time.stood_s

    def hear(self, news: News) -> None:
        """What the plan tells while it runs."""
        if self.lost:
            return  # it is another plan, which knows nothing of this program
        self.time.hear(news.timetable)
        self.ways.update(news.ways)
        self.fed.update(number for number, way in news.ways.items() if way.feed_mm_s is not None)
        for line, tools in news.changes.items():
            self.changes[line] = (*self.changes.get(line, ()), *tools)
        self._due.extend(news.messages)
        self.news = news

    def fed_in(self, motion_ids: Collection[int]) -> set[int]:
        """Those of the motions of the newest ticks at which the tool is fed through the part."""
        found = self.fed.intersection(motion_ids) if not self.program.dry_run_mm else set()
        first = min((number for number in motion_ids if 0 <= number < ENTRY_ID), default=0)
        self.fed.difference_update(range(self._passed, first))
        self._passed = max(self._passed, first)
        return {number for number in found if number < ENTRY_ID}

    def pass_rows(self, motion_ids: Iterable[int]) -> None:
        """The motions of the ticks since: of short ones, and of the last before a stop, no snapshot tells."""
        self._reached = max(self._reached, *(number for number in motion_ids if number < ENTRY_ID), -1)

    def say(self, now: Snapshot, ended: bool = False) -> list[Change]:
        """What the program says and sets up to here and has not before; ``ended``: all that is left.

        What it says is noted, what it sets is given back.
        """
        if now.motion_id < ENTRY_ID:
            self._reached = max(self._reached, now.motion_id)
        changes: list[Change] = []
        while self._due and (ended or self._is_due(self._due[0], now)):
            said = self._due.popleft()
            changes += said.changes
            self.next_tool = said.tool if said.tool is not None else self.next_tool
            if said.text:
                self.messages = [*self.messages, said.text][-MAX_MESSAGES:]
                self.found += filter(None, [found(said.text)])
        return changes

    def _is_due(self, said: Said, now: Snapshot) -> bool:
        at_pause = said.line == now.line and now.at_rest and self._reached >= said.motion_id - 1
        return self._reached >= said.motion_id or at_pause

    def way(self, motion_id: int) -> Way | None:
        """Of the motion under way; those of the program that lie behind it are forgotten."""
        passed = motion_id if motion_id < ENTRY_ID else 0  # an entry, and a way aside, lie beside it
        for old in [name for name in list(self.ways) if 0 <= name < passed]:
            self.ways.pop(old, None)
        return self.ways.get(motion_id)

    def asked_tool(self, now: Snapshot, in_spindle: int) -> int | None:
        """Number of the tool that it stands and waits for."""
        waits = self.active and now.mode is Mode.HOLD and now.at_rest
        tools = self.changes.get(now.line, ()) if waits else ()
        return next((tool for tool in tools if tool != in_spindle), None)

    def put_in(self, tool: int, line: int) -> None:
        """What a line asked for is done; the next time that it runs it may ask for another tool."""
        tools = self.changes.get(line, ())
        if tool in tools:
            self.changes[line] = tools[tools.index(tool) + 1 :] or tools[-1:]

    def to_dict(self, now: Snapshot) -> dict[str, Any]:
        state, left = self.state_at(now), self._left(now)
        if self.last is not None and (now.line == 0 or not self.active):
            now = self.last  # an emergency stop has taken all away, or it has ended: the last place stays
        shown = self.active or self.last is not None
        return {
            "name": self.program.name,
            "sha256": self.sha256,
            "text": self._typed(),
            "state": state,
            "line": now.line if shown else self.program.spot.line if self.program.spot else None,
            "restart": self.restart,
            "dry_run_mm": self.program.dry_run_mm or None,
            "block_delete": self.block_delete,
            "block": now.motion_id if shown and now.motion_id >= 0 else None,
            "fraction": self._share(),
            "blocks": self.blocks,
            "duration_s": self.duration_s,
            "elapsed_s": self._elapsed_s(now) if shown else None,
            **left._asdict(),
            "checking": self.news.checking,
            "message": self.messages[-1] if self.messages else None,
            "messages": self.messages,
            "notes": self.notes,
            "verdict": self.verdict,
            **catalogue.facts(self.said),
        }

    def ended_early(self, result: str, why: catalogue.Said | None) -> catalogue.Said | None:
        """What a run that did not come to its end leaves to be read; None of one that did."""
        if result == "completed":
            return None
        typed = (self._typed() or "").strip().split("\n")[0]
        program = (
            catalogue.Key("ended.cycle") if self.is_own else f"{MDI} {typed}" if typed else self.program.name
        )
        line = self.last.line if self.last is not None else 0
        if why is None:
            return catalogue.said("ended.stopped", program=program, line=line)
        return catalogue.said("ended.why", program=program, line=line, why=why)

    def _typed(self) -> str | None:
        """A line typed by hand is in no store, and told here."""
        if not self.is_mdi:
            return None
        return bytes(linked.parts(self.program.text)[0][:MAX_TYPED]).decode(errors="replace")

    def _left(self, now: Snapshot) -> Left:
        if self.state in ("loading", "completed"):
            return Left()
        if self.state in ("loaded", "starting"):
            return self.time.before_start(self.before_s)
        if not self.active:
            return self.time.after_end(self.nominal_s)
        ends_s = now.queue_end_s if self.news.finished else None
        return self.time.running(now, self.nominal_s, ends_s, self.news.aside or self.news.returning)

    def _share(self) -> float | None:
        """Of a whole run that is done."""
        if not self.duration_s or self.state == "loading":
            return None
        done_s = self.before_s if self.state == "loaded" else self.nominal_s
        return 1.0 if self.state == "completed" else min(1.0, done_s / self.duration_s)


def read(args: dict[str, Any], machine: Machine) -> Job:
    """The job of a ``load``. Raises CommandRefused."""
    path = Path(str(args.get("path", "")))
    try:
        with own_files.opened(path.resolve(), os.O_RDONLY, shared=True) as file:
            if os.fstat(file.fileno()).st_size > MAX_BYTES:
                raise refused("too_large", code="bad", path=path, most=MAX_BYTES >> 20)
            text = file.read()
    except OSError as error:
        raise refused("unreadable", code="bad", path=path, why=error.strerror) from error
    found = hashlib.sha256(text).hexdigest()
    wanted = args.get("sha256")
    if wanted is not None and wanted != found:
        raise refused("other_sum", code="bad", path=path, found=found, wanted=wanted)
    line, fraction = whole(args, "line") or 0, _from_0(args, "fraction", 1.0)
    if fraction and not line:
        raise refused("no_line", code="bad", fraction=fraction)
    spot = Spot(line, fraction) if line else None
    dry_run_mm = _from_0(args, "dry_run_mm", 1000.0)
    unchecked = args.get("unchecked") is True and spot is None  # a place in the middle needs the whole
    name = str(args.get("name") or path.name)
    text = linked.linked(text, linked.among({str(file): Path(str(at)) for file, at in _files(args).items()}))
    skips = args.get("block_delete") is True
    text = linked.without_deleted(text) if skips else text
    program = Program(text, name, machine, spot, dry_run_mm=dry_run_mm, unchecked=unchecked)
    return Job(program, found, block_delete=skips)


def interrupted(entry: journal.Entry) -> dict[str, Any]:
    """As ``to_dict``, of what a service before this one ran and did not end: where it was."""
    said = catalogue.said("interrupted", program=entry.job.name, line=entry.spot.line)
    return {
        "name": entry.job.name,
        "sha256": entry.job.file_sha256,
        "text": None,
        "state": INTERRUPTED,
        "line": entry.spot.line,
        "restart": [],
        "dry_run_mm": entry.job.dry_run_mm or None,
        "block_delete": entry.job.block_delete,
        "block": entry.spot.motion_id if entry.spot.motion_id >= 0 else None,
        "fraction": entry.done,
        "blocks": None,
        "duration_s": entry.duration_s,
        "elapsed_s": entry.elapsed_s,
        **Left(entry.left_s)._asdict(),
        "checking": None,
        "message": None,
        "messages": [],
        "notes": [],
        "verdict": None,
        "starts": None,
        **catalogue.facts(said),
    }


def _files(args: dict[str, Any]) -> dict[str, Any]:
    """Names and paths of files whose subs may be called."""
    files = args.get("files")
    return files if isinstance(files, dict) else {}


def whole_from(start: Start | None) -> Joints | None:
    """Where the whole run starts of which this was a start."""
    if start is None:
        return None
    return start.joints if start.spot is None else start.whole_from


def homed_position(machine: Machine) -> Joints:
    """Where the axes stand when all of them have been homed (mm, rad)."""
    return tuple(axis.homing.position for axis in machine.axes)


def mdi(text: str, machine: Machine) -> Job:
    """A line of program typed by hand, with the shipped cycles that it calls behind it."""
    data = bytes(linked.linked(text.encode(), lambda _: None))
    return Job(Program(data, MDI, machine, typed=True), hashlib.sha256(data).hexdigest())


def own(text: str, machine: Machine) -> Job:
    """Lines of the control's own, which begin as at power-on."""
    job = mdi(text, machine)
    job.is_own = True
    return job


def probing(args: dict[str, Any], machine: Machine, tool: int) -> Job:
    """A probing cycle as a line typed by hand, with the tool in the spindle. Raises CommandRefused."""
    values = args.get("values") or {}
    named = values if isinstance(values, dict) else {str(values): None}
    by_hand = tool if machine.changer is None else 0
    try:
        data = probing_cycles.program(args.get("cycle"), named, args.get("offset"), machine.unset, by_hand)
    except probing_cycles.CycleRefused as error:
        raise CommandRefused("bad", error.said) from error
    return Job(Program(data, MDI, machine, typed=True), hashlib.sha256(data).hexdigest(), is_own=True)


def _from_0(args: dict[str, Any], key: str, highest: float) -> float:
    """0 where it is missing or null. Raises CommandRefused."""
    return 0.0 if args.get(key) is None else number(args, key, 0.0, highest)
