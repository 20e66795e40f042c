"""The program that is loaded, and what has become of it."""

from __future__ import annotations

import errno
import hashlib
import os
from collections import deque
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from controller import own_files
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, Snapshot
from controller.machine.changes import Change
from controller.machine.model import Joints, Machine, Tool
from controller.messages import Message, message
from controller.motion.pieces import STANDSTILL
from controller.plan.report.passing import Mark, passed_s
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.plan.timetable import Passed
from controller.plan.waits import ramp_s
from controller.program import carried, linked, probing_cycles
from controller.program.modal import State
from controller.program.program import refused_on_the_way
from controller.runtime.plan_messages import Announcement, MotionFacts, News, Program
from controller.runtime.starts import Start
from controller.service import journal
from controller.service.durations import Durations
from controller.service.probed import result_of
from controller.service.refusals import number, refused, whole
from controller.service.runs import Rows
from controller.service.time_left import TimeLeft
from controller.state.modes import Mode

MDI = "MDI"
READER = "reader"  # in the values of a ``load``: number of the user who asks for it
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


class Motions:
    """By their number, until they are passed."""

    def __init__(self) -> None:
        self.ways: dict[int, MotionFacts] = {}
        self._fed: set[int] = set()  # those at feed
        self._passed = 0  # motions before this one are no more among ``_fed``

    def hear(self, ways: dict[int, MotionFacts]) -> None:
        """Some more have been sent."""
        self.ways.update(ways)
        self._fed.update(number for number, way in ways.items() if way.feed_mm_s is not None)

    def fed_in(self, motion_ids: Collection[int]) -> set[int]:
        """Those of the motions of the newest ticks at which the tool is fed."""
        fed = self._fed.intersection(motion_ids)
        first = min((number for number in motion_ids if 0 <= number < ENTRY_ID), default=0)
        self._fed.difference_update(range(self._passed, first))
        self._passed = max(self._passed, first)
        return {number for number in fed if number < ENTRY_ID}

    def under_way(self, motion_id: int) -> MotionFacts | None:
        """That one; those of the program before it are forgotten."""
        passed = motion_id if motion_id < ENTRY_ID else 0  # an entry, and a way aside, lie beside it
        for old in [name for name in list(self.ways) if 0 <= name < passed]:
            self.ways.pop(old, None)
        return self.ways.get(motion_id)

    def fraction(self, motion_id: int, s: float) -> float:
        """Of its program line that is done at a place of a motion."""
        way = self.ways.get(motion_id)
        return way.fraction(s) if way is not None else 0.0

    def place(self, motion_id: int, s: float, marks: Sequence[Mark]) -> Passed | None:
        """As a check marks it; None where it is none of the program's, or the check has no ``marks``."""
        way = self.ways.get(motion_id)
        return way.place(s) if way is not None and marks else None


class Announced:
    """What the program says, sets and asks for: due when the tool comes to it."""

    def __init__(self) -> None:
        self.messages: list[str] = []  # that it said last
        self._due: deque[Announcement] = deque()
        self._asked: dict[int, tuple[int, ...]] = {}  # tools, by line
        self._reached = -1  # the last motion that was under way
        self._named: int | None = None  # the tool that T has just named
        self._turn: Announcement | None = None  # the last that asks for the spindle to be switched by hand
        self._found: list[dict[str, Any]] = []  # results of probing cycles

    def hear(self, news: News) -> None:
        """The plan has read on."""
        for line, tools in news.changes.items():
            self._asked[line] = (*self._asked.get(line, ()), *tools)
        self._due.extend(news.messages)

    def pass_rows(self, motion_ids: Iterable[int]) -> None:
        """The motions of the ticks since: of short ones, and of the last before a stop, no snapshot shows."""
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
            self._named = said.tool if said.tool is not None else self._named
            self._turn = said if said.rev_min is not None else self._turn
            if said.text:
                self.messages = [*self.messages, said.text][-MAX_MESSAGES:]
                self._found += filter(None, [result_of(said.text)])
        return changes

    def _is_due(self, said: Announcement, now: Snapshot) -> bool:
        at_pause = said.line == now.line and now.at_rest and self._reached >= said.motion_id - 1
        return self._reached >= said.motion_id or at_pause

    def take_named(self) -> int | None:
        """The tool that T has named since this was asked."""
        named, self._named = self._named, None
        return named

    def take_found(self) -> list[dict[str, Any]]:
        """What probing cycles have found since this was asked."""
        results, self._found = self._found, []
        return results

    def awaited_tool(self, line: int, in_spindle: int) -> int | None:
        """Number of the tool that a line at which it stands waits for."""
        return next((tool for tool in self._asked.get(line, ()) if tool != in_spindle), None)

    def awaited_speed(self, now: Snapshot) -> float | None:
        """How the operator is to turn the spindle (rev/min, signed), where it stands and waits for that."""
        asked, stands = self._turn, now.mode is Mode.HOLD and now.at_rest and now.motion_id == STANDSTILL
        if asked is None or not stands or asked.line != now.line or self._reached >= asked.motion_id:
            return None
        return asked.rev_min

    def put_in(self, tool: int, line: int) -> None:
        """What a line asked for is done; the next time that it runs it may ask for another tool."""
        tools = self._asked.get(line, ())
        if tool in tools:
            self._asked[line] = tools[tools.index(tool) + 1 :] or tools[-1:]


@dataclass(slots=True)
class Job:
    """One program; ``state``: loading, loaded, starting, running, held, stopping, then how it ended."""

    program: Program
    sha256: str
    state: str = "loading"
    block_delete: bool = False  # lines that begin with / were left out when it was loaded
    is_own: bool = False  # lines of the control's own: the modal state is not theirs to change
    # As it was checked:
    time: TimeLeft = field(default_factory=TimeLeft)
    blocks: int | None = None
    notes: list[dict[str, Any]] = field(default_factory=list)
    verdict: dict[str, Any] | None = None  # on the form of its surfaces
    restart: list[Message] = field(default_factory=list)  # the state at the place where it begins
    offset: str | None = None  # by which it moves first
    before_s: float = 0.0  # of a whole run at 100 %, before the place where this one begins
    # As it was started last:
    entry: journal.Entry | None = None  # of the journal, where it goes on with that
    start: Start | None = None
    origin_s: float = 0.0  # plan time at which its first piece begins
    fitted: dict[str, Any] = field(default_factory=dict)  # with which it was started ...
    tools: tuple[Tool, ...] = ()  # ... and the tool table as it has made it since
    state_before: State | None = None  # the modal state before it began
    # As it runs, or has run:
    motions: Motions = field(default_factory=Motions)
    announced: Announced = field(default_factory=Announced)
    news: News = field(default_factory=News)
    said: Message | None = None  # why it ended, or was not loaded
    taken: bool = False  # the tick has begun with it
    refused: bool = False  # a block on the way was; the tool stands before it
    lost: bool = False  # the plan that knew the rest of it is gone
    armed_tick: int = -1  # what was seen of the machine before it says nothing of this run
    nominal_s: float = 0.0  # of a whole run at 100 %, before the place where the tool is
    last: Snapshot | None = None  # of the program's own motions
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

    # -- before it runs

    def fit(self, program: Program, fitted: dict[str, Any] | None = None) -> None:
        """It is run as ``program``, with what is ``fitted``; None: with what it was."""
        self.program = program
        self.fitted = self.fitted if fitted is None else fitted

    def go_on_with(self, entry: journal.Entry) -> None:
        """From where the journal has it, as it was begun then."""
        begin = None if entry.job.begin is None else carried.from_json(entry.job.begin)
        start, dry_run_mm = entry.job.start, entry.job.dry_run_mm
        self.entry = entry
        self.program = replace(self.program, start=start, dry_run_mm=dry_run_mm, begin=begin)

    def checked(self, facts: dict[str, Any], durations: Durations) -> dict[str, Any]:
        """What the plan has found of it; what is reported of that."""
        self.before_s, self.blocks, self.notes = facts.pop("passed_s"), facts["blocks"], facts["notes"]
        self.time.check(facts["duration_s"], facts.pop("marks"), facts.pop("events"), durations)
        self.time.stands(facts.pop("timetable"))
        self.verdict, self.restart, self.state = facts["verdict"], facts["restart"], "loaded"
        self.offset = facts.pop("offset", None)
        return {"sha256": self.sha256, "name": self.program.name, **facts}

    def arm(self, tick: int, tools: tuple[Tool, ...] = (), before: State | None = None) -> None:
        """What was of the run before is over; ``tick``: the newest one; ``before``: the modal state."""
        self.armed_tick, self.tools, self.state_before = tick, tools, before
        self.motions, self.announced, self.news = Motions(), Announced(), News(finished=False)
        self.become("starting")
        self.taken = self.refused = self.lost = False
        self.nominal_s, self._seen_s, self.last = self.before_s, None, None
        self.time.begin()

    def begin(self, facts: dict[str, Any], durations: Durations, now: Snapshot) -> None:
        """It is planned: from where, and what is known of it."""
        self.start, self.blocks, self.said = facts["start"], facts["blocks"], None
        self.origin_s = facts["start"].plan_time_s
        self.time.check(facts["duration_s"], facts["marks"], facts["events"], durations)
        self.time.starts(self.origin_s, settles_s(self, now))

    # -- what becomes of it

    def become(self, state: str, why: Message | None = None) -> None:
        """``why``: it ended, or was not loaded."""
        self.state, self.said = state, why

    def take(self) -> None:
        """The tick has begun with it."""
        self.taken = True

    def lose_plan(self) -> None:
        """What another plan reports is not of it."""
        self.lost = True

    def refuse_rest(self, refusal: Message) -> Message:
        """The tool stands at a block that was refused; what is said of that."""
        self.refused, self.said = True, refused_on_the_way(refusal)
        return self.said

    def take_tools(self, tools: tuple[Tool, ...]) -> None:
        """The tool table as the program has made it, or goes on with."""
        self.tools = tools

    def hear(self, news: News) -> None:
        """What the plan reports while it runs."""
        if self.lost:
            return  # it is another plan, which knows nothing of this program
        self.time.hear(news.timetable)
        self.motions.hear(news.ways)
        self.announced.hear(news)
        self.news = news

    def take_rows(self, rows: Rows, period_s: float) -> set[int]:
        """The newest ticks; the motions in them at which the tool was fed through the part."""
        under_way = rows[:, COLUMN["mode"]] != Mode.READY
        motions = rows[under_way, COLUMN["motion_id"]].astype(int).tolist()
        self.announced.pass_rows(motions)
        self.time.take(rows, period_s)
        fed = self.motions.fed_in(set(motions))
        return set() if self.program.dry_run_mm else fed

    def follow(self, now: Snapshot) -> None:
        """Where the tool is, the check knows the time; where it stands, and of what no check was kept, of a
        plan at another override than 100 % so much less, or more, of the check's time has passed."""
        self.state = self.state_at(now)
        place = self.motions.place(now.motion_id, now.s, self.time.marks)
        if 0 <= now.motion_id < ENTRY_ID:
            self.last = now
        if place is not None:
            self.nominal_s = max(self.nominal_s, passed_s(self.time.marks, place))
        elif self._seen_s is not None and now.motion_id < ENTRY_ID:  # not on a way aside
            way = self.motions.ways.get(now.motion_id)
            rapid = way is not None and way.feed_mm_s is None
            share = min(now.rapid_override, 1.0) if rapid else now.feed_share
            self.nominal_s += (now.plan_time_s - self._seen_s) * share
        self._seen_s = now.plan_time_s

    # -- what is known of it

    def state_at(self, now: Snapshot) -> str:
        """The state by this very snapshot, though nobody has drawn conclusions yet."""
        if not self.taken or not self.active:
            return self.state
        return _STATES.get(now.mode, self.state)

    def awaited_tool(self, now: Snapshot, in_spindle: int) -> int | None:
        """Number of the tool that it stands and waits for."""
        waits = self.active and now.mode is Mode.HOLD and now.at_rest
        return self.announced.awaited_tool(now.line, in_spindle) if waits else None

    def elapsed_s(self, now: Snapshot) -> float:
        """Since the start, without what it was held."""
        return max(0.0, now.plan_time_s - self.origin_s) + self.time.stood_s

    def known(self, motion_id: int, s: float) -> journal.RunProgress:
        """Of a place, for the journal."""
        place, way = self.motions.place(motion_id, s, self.time.marks), self.motions.ways.get(motion_id)
        return journal.RunProgress(
            self.motions.fraction(motion_id, s),
            passed_s(self.time.marks, place) if place else None,
            self.duration_s,
            self.elapsed_s(self.last) if self.last is not None else None,
            way.in_block(s) if way is not None else None,
        )


def settles_s(job: Job, now: Snapshot) -> float:
    """What the spindle takes at a start now, until it turns as asked before the first motion: it stops,
    but where the run goes on with what is on.
    """
    machine = job.program.machine
    if machine.spindle is None or not machine.spindle.is_driven:
        return 0.0
    keeps = job.program.begin is not None or (machine.start_state == "keep" and not job.is_own)
    told = now.spindle_rev_min if keeps else 0.0
    return ramp_s(machine.spindle, now.spindle_actual_rev_min, told)


def bars_the_next(job: Job, result: str) -> Message | None:
    """Why it is not started again as it was: the next part is not one whose beginning has been cut."""
    spot = job.program.spot
    if result != "completed" or job.entry is None or spot is None:
        return None
    return message("gone_on_over", program=job.program.name, line=spot.line)


def journalled(job: Job, now: Machine) -> journal.Job:
    """What is run, with where a whole run of it starts; ``now``: with what it has set since."""
    program = job.program
    joints = whole_from(job.start) or homed_position(program.machine)
    run = journal.Job.of(program.name, program.text, now, joints, program.dry_run_mm, job.fitted)
    begin = None if program.begin is None else carried.to_json(program.begin)
    return replace(run, file_sha256=job.sha256, block_delete=job.block_delete, begin=begin)


def read(args: dict[str, Any], machine: Machine) -> Job:
    """The job of a ``load``. Raises CommandRefused."""
    path, reader = Path(str(args.get("path", ""))), args.get(READER)
    text = _content(path, reader)
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
    called = {str(file): Path(str(at)) for file, at in _files(args).items()}
    files = linked.among(called, lambda file: _content(file, reader))
    text = _bounded(linked.linked(text, files, machine), path)
    skips = args.get("block_delete") is True
    text = linked.without_deleted(text) if skips else text
    program = Program(text, name, machine, spot, dry_run_mm=dry_run_mm, unchecked=unchecked)
    return Job(program, found, block_delete=skips)


def _bounded(text: bytes, path: Path) -> bytes:
    """Gives the text back. Raises CommandRefused where it is longer than a program may be."""
    if len(text) > linked.MAX_BYTES:
        raise refused("too_large", code="bad", path=path, most=linked.MAX_BYTES >> 20)
    return text


def _content(path: Path, reader: int | None) -> bytes:
    """Reads a file that its ``reader`` may read, by number of user; None and root: any that the service may.
    A refusal and the record of a run say what is in it. Raises CommandRefused.
    """
    try:
        with own_files.opened(path.resolve(), os.O_RDONLY, shared=True) as file:
            facts = os.fstat(file.fileno())
            if reader and reader != os.geteuid() and not own_files.may_read(reader, path, facts):
                raise own_files.refusal(errno.EPERM, message("own_file.not_readable", user=reader), path)
            return _bounded(file.read(linked.MAX_BYTES + 1), path)
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        raise refused("unreadable", code="bad", path=path, why=error) from error


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


def mdi(text: str, machine: Machine, is_own: bool = False) -> Job:
    """A line of program typed by hand, followed by the shipped cycles that it calls.

    ``is_own``: lines of the control's own, which begin as at power-on.
    """
    data = bytes(linked.linked(text.encode(), lambda _: None))
    return Job(Program(data, MDI, machine, typed=True), hashlib.sha256(data).hexdigest(), is_own=is_own)


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
