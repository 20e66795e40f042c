"""The journal of the running program: where it was, so that it can be gone on with after the worst.

A document of the service's store: replaced once a second while the program runs, and at every standstill.
What stands there is where a restart begins, and never beyond what is cut:

```
    commanded  -------*---------->        running: what was commanded LAG_S ago, so the drives have
    cut        ------------->              been there whatever happens between this look and the disk
                      ^ written
```
At a standstill (hold, stop, fault on the path) it is the very place; where the drives stopped by
themselves, beside the path, it is again what was commanded a moment before. Nothing starts by it: it only
says whether a restart may be offered, and from where.
"""

from __future__ import annotations

import hashlib
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from controller.ipc.handoff import COLUMN, Snapshot
from controller.machine.model import REFERENCES, Joints, Machine
from controller.machine.offset_table import FIXTURES, KEPT_OFFSETS, OFFSETS
from controller.messages import Key, Message, chain, message, text
from controller.plan.restart.program_position import AFTER_CHANGE, ENTRY_ID, FORMER, Spot
from controller.program import carried
from controller.state.modes import FAULTS, Mode, Reaction
from controller.store.service_store import ServiceStore

DOCUMENT = "journal"  # in the store
EVERY_S = 0.5  # between two entries of a run; with writing, never more than a second of cut is lost
LAG_S = 0.05  # longer than drives lag behind and a tick may be late
FORMAT = 1
ROWS = 2000  # of the recorder, to look for the last place of a stop

Rows = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Job:
    """What is run; it does not change while it runs."""

    name: str
    program_sha256: str
    machine_sha256: str  # of the machine file
    offsets_sha256: str
    tools_sha256: str
    start: Joints  # mm, rad; where a whole run starts
    dry_run_mm: float = 0.0
    # With which the run was begun: its lines set anew what they set since, from the first one on.
    fitted: dict[str, Any] | None = None  # None: not known
    before_sha256: str = ""  # of the offsets before the program changed them last
    file_sha256: str = ""  # of its file alone; ``program_sha256`` is with what it calls, less what it skips
    block_delete: bool = False  # lines that begin with / were skipped
    begin: dict[str, Any] | None = None  # the modal state that it began with, where not that of power-on

    @classmethod
    def of(
        cls,
        name: str,
        program: bytes,
        machine: Machine,
        start: Joints,
        dry_run_mm: float = 0.0,
        fitted: dict[str, Any] | None = None,
    ) -> Job:
        """Of a program on a machine with its offsets and tools as they are now."""
        offsets, tools = fitted_sha256(machine)
        sums = sha256(program), sha256(machine.text.encode()), offsets, tools
        return cls(name, *sums, start, dry_run_mm, fitted, file_sha256=sums[0])


@dataclass(frozen=True, slots=True)
class Entry:
    """One state of the journal."""

    job: Job
    spot: Spot
    exact: bool  # written at a standstill; otherwise at or before what is cut
    tool: int  # number of the tool in the spindle
    mode: str
    fault: str
    homed: int  # bit mask
    time_s: float  # since 1970
    ended: bool = False  # nothing is left of the program
    passed_s: float | None = None  # of a whole run at 100 %, before the place; None: not known ...
    duration_s: float | None = None  # ... and what it takes in all
    elapsed_s: float | None = None
    in_block: dict[str, Any] | None = None
    # In the middle of a tool change: the tool that goes, the one that comes (0 = none), and the line of M6.
    change: tuple[int, int, int] | None = None

    @property
    def required_tool(self) -> int:
        """Number of the tool with which the program goes on."""
        return self.tool if self.change is None else self.change[1]

    @property
    def done(self) -> float | None:
        """Share of a whole run at 100 %."""
        return None if self.passed_s is None or not self.duration_s else self.passed_s / self.duration_s

    @property
    def left_s(self) -> float | None:
        """Of a whole run at 100 %."""
        return None if self.passed_s is None or not self.duration_s else self.duration_s - self.passed_s


class RunProgress(NamedTuple):
    """Of a place: the fraction of its line, and of a whole run at 100 % what is before it, and all of it."""

    fraction: float = 0.0
    passed_s: float | None = None
    duration_s: float | None = None
    elapsed_s: float | None = None  # since the start, as it was run
    in_block: dict[str, Any] | None = None  # what the motion was, the share of it that was done, and u


def unknown(motion_id: int, s: float) -> RunProgress:
    """Of a place that nobody knows more of."""
    return RunProgress()


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def fitted_sha256(machine: Machine) -> tuple[str, str]:
    """Of all offsets, reference points and kept parameters, and of the tools.

    Fixtures count where one is set: what was written before there were any is the same without them.
    """
    names = OFFSETS if machine.unset[-len(FIXTURES) :] == FIXTURES else KEPT_OFFSETS
    unset = tuple(name for name in machine.unset if name in names)
    points = [machine.reference(code) for code in REFERENCES]
    shifts = machine.turned_rad[: len(names)], machine.shift, machine.suspended, points, machine.parameters
    offsets = f"{machine.offsets[: len(names)]!r} {unset!r} {shifts!r}"
    return sha256(offsets.encode()), sha256(repr(machine.tools).encode())


# --- in the store


def write(entry: Entry, store: ServiceStore) -> None:
    """Returns when the disk has it, also a full one. Raises OSError."""
    store.keep(DOCUMENT, {"format": FORMAT, **asdict(entry), "spot": list(entry.spot)})


def read(store: ServiceStore) -> Entry | None:
    """The entry, or the one before it where that is damaged. Raises OSError."""
    return store.document(DOCUMENT, entry_of, None)


def entry_of(values: Any) -> Entry:
    """Raises ValueError, KeyError or TypeError for anything but what ``write`` writes."""
    if values.pop("format") != FORMAT:
        raise ValueError("another format")
    job = values.pop("job")
    line, fraction, motion_id, s = values.pop("spot")
    spot = Spot(int(line), float(fraction), int(motion_id), float(s))
    start = tuple([float(q) for q in job.pop("start")])
    job.setdefault("file_sha256", job["program_sha256"])  # older ones
    if job.get("begin") is not None:
        carried.from_json(job["begin"])  # which it must be
    if (change := values.pop("change", None)) is not None:
        out, into, at = map(int, change)
        values["change"] = out, into, at
    return Entry(job=Job(start=start, **job), spot=spot, **values)


# --- whether a restart may be offered


def refusal(entry: Entry | None, now: Job, homed: int, untrusted: int, axes: int) -> Message | None:
    """Why the program is not gone on with; None where a restart may be offered.

    ``now``: the same program on the machine as it is now; ``homed`` and ``untrusted``: bit
    masks of the ``axes`` axes. A changed tool is no reason: the rest is cut as the new one does it.
    """
    if entry is None or entry.ended:
        return message("not_interrupted")
    then = entry.job
    changed = [
        name
        for name, same in (
            ("the_program", then.program_sha256 == now.program_sha256),
            ("the_machine_file", then.machine_sha256 == now.machine_sha256),
            ("a_work_offset", now.offsets_sha256 in (then.offsets_sha256, then.before_sha256)),
        )
        if not same
    ]
    if changed:
        what = chain("and", [Key(name) for name in changed])
        return message("changed", program=then.name, line=entry.spot.line, what=what)
    if homed != (1 << axes) - 1 or untrusted:
        return message("lost", program=then.name, line=entry.spot.line)
    return None


def spot_of(entry: Entry, now: Job) -> Spot:
    """Where to go on: exactly there, or, with other tools, at the same fraction of the block; after a tool
    change that was interrupted, for what is left of its steps no program knows.
    """
    spot = entry.spot
    if entry.change is not None:
        return Spot(entry.change[2], 0.0, AFTER_CHANGE)
    return spot if entry.job.tools_sha256 == now.tools_sha256 else Spot(spot.line, spot.fraction, FORMER)


# --- what to write, and when


class Journal:
    """Looks at every snapshot and writes what is due; one per service.

    It needs the tick's snapshots and recorder only, so the plan may be dead. ``problem`` is the
    sentence on the last entry that could not be written, "" if it could.
    """

    def __init__(
        self, store: ServiceStore, clock: Callable[[], float] = time.monotonic, last: Entry | None = None
    ) -> None:
        """``last``: as it was found."""
        self._store, self._clock = store, clock
        self._job: Job | None = None
        self._tool = 1
        self._seen: Spot | None = None  # the last place on the program
        self._known = RunProgress()  # of it
        self._recent: deque[tuple[float, Spot, RunProgress]] = deque()
        self._written_s = float("-inf")
        self._ran = False
        self.problem = ""
        self.last = last  # as it was written last, or found
        self.change: tuple[int, int, int] | None = None  # under way, as ``Entry.change``
        self._here: tuple[Entry, Machine, Job] | None = None

    def begin(self, job: Job, tool: int = 1, spot: Spot | None = None) -> None:
        """A program is started, or gone on with at ``spot``; the entry stays as it is until it moves."""
        self._job, self._tool, self._seen, self._known = job, tool, spot, RunProgress()
        self._recent.clear()
        self._written_s, self._ran = float("-inf"), False

    def why_not(self, machine: Machine, homed: int, untrusted: int) -> Message | None:
        """As ``refusal``, of the last entry and its own program on a machine as it is now."""
        entry, known = self.last, self._here
        if entry is None:
            return message("not_interrupted")
        if known is None or known[0].job is not entry.job or known[1] is not machine:
            here = Job.of(entry.job.name, b"", machine, entry.job.start, entry.job.dry_run_mm)
            known = entry, machine, replace(here, program_sha256=entry.job.program_sha256)
            self._here = known
        return refusal(entry, known[2], homed, untrusted, len(machine.axes))

    def go_on_as(self, job: Job) -> None:
        """Other tools were fitted in a hold: what is left is of another path, so line and fraction count."""
        self._job = job
        if self._seen is not None:
            self._seen = Spot(self._seen.line, self._seen.fraction, FORMER)
        self._recent.clear()

    def fitted(self, machine: Machine, now: Snapshot) -> None:
        """The program sets offsets or tools: written before they are, so that a loss of power finds both."""
        if self._job is None:
            return
        offsets, tools = fitted_sha256(machine)
        before = self._job.offsets_sha256
        self._job = replace(self._job, offsets_sha256=offsets, tools_sha256=tools, before_sha256=before)
        if self._recent:
            self._write(now, *self._recent[0][1:], False, False)

    def see_change(self, tools: tuple[int, int] | None, line: int) -> None:
        """The one that goes and the one that comes of a change under way, 0 = none; None: no change is."""
        before = self.change
        self.change = None if tools is None else (*tools, before[2] if before else line)

    def in_spindle(self, tool: int) -> None:
        """The program, or an operator, has changed the tool."""
        self._tool = tool

    def look(
        self,
        now: Snapshot,
        rows: Callable[[int], Rows],
        known: Callable[[int, float], RunProgress] = unknown,
    ) -> None:
        """Call it with every new snapshot.

        ``rows`` are the recorder's last so many; ``known`` tells of a motion's s what is for people, and
        for a restart with another tool.
        """
        if self._job is None:
            return
        if now.mode is Mode.RUNNING:
            self._run(now, known)
        elif self._ran and now.at_rest and now.mode is not Mode.STOPPING:
            self._ran = False
            if now.mode is Mode.FAULT and FAULTS[now.fault].reaction >= Reaction.QUICK_STOP:
                self._off_the_path(now)
                return
            self._stand(now, rows, known)
            if self._seen is not None:
                self._write(now, self._seen, self._known, True, False)
        elif self.problem and self._clock() - self._written_s >= EVERY_S:
            self._written_s = self._clock()
            self.keep()  # the disk may take it by now

    def _off_the_path(self, now: Snapshot) -> None:
        """Each drive stopped by a ramp of its own: where the path was left the drives had not yet been."""
        if self._recent:
            self._write(now, *self._recent[0][1:], False, False)

    def completed(self, last: Snapshot) -> None:
        """The program came to its end, which the plan may tell later than the tick stands."""
        if self._job is not None and self._seen is not None:
            self._ran = False
            self._write(last, self._seen, self._known, True, True)

    def lost(self, last: Snapshot) -> None:
        """The tick is gone: the drives have been where it led them a moment before."""
        if self._ran and self._recent:
            self._ran = False
            self._write(last, *self._recent[0][1:], False, False)

    def _run(self, now: Snapshot, known: Callable[[int, float], RunProgress]) -> None:
        at_s, self._ran = self._clock(), True
        if _is_programs(now.motion_id):
            self._see(now.line, now.motion_id, now.s, known)
        if self._seen is None:
            return  # on the way into the program, and nothing of it is done
        self._recent.append((at_s, self._seen, self._known))
        while len(self._recent) > 1 and at_s - self._recent[1][0] >= LAG_S:
            self._recent.popleft()
        if at_s - self._written_s >= EVERY_S:
            self._write(now, *self._recent[0][1:], False, False)

    def _stand(
        self, now: Snapshot, rows: Callable[[int], Rows], known: Callable[[int, float], RunProgress]
    ) -> None:
        """The very place; after a stop the tick has forgotten it, but not its recorder."""
        if _is_programs(now.motion_id):
            self._see(now.line, now.motion_id, now.s, known)
            return
        for row in rows(ROWS)[::-1]:
            number = int(row[COLUMN["motion_id"]])
            if _is_programs(number):
                self._see(int(row[COLUMN["line"]]), number, float(row[COLUMN["s"]]), known)
                return

    def _see(self, line: int, motion_id: int, s: float, known: Callable[[int, float], RunProgress]) -> None:
        self._known = known(motion_id, s)
        self._seen = Spot(line, self._known.fraction, motion_id, s)

    def _write(self, now: Snapshot, spot: Spot, known: RunProgress, exact: bool, ended: bool) -> None:
        assert self._job is not None
        entry = Entry(
            self._job,
            spot,
            exact,
            self._tool,
            now.mode.name,
            now.fault.name,
            now.homed,
            time.time(),
            ended,
            *known[1:],
            change=None if ended else self.change,
        )
        self._written_s, self.last = self._clock(), entry
        self.keep()

    def keep(self) -> None:
        """Write the last entry, again where it was lost."""
        if self.last is None:
            return
        try:
            write(self.last, self._store)
            self.problem = ""
        except OSError as error:
            self.problem = text(message("journal_unwritten", file=self._store.file, why=error))


def _is_programs(motion_id: int) -> bool:
    """Not a pause, nor an entry or another way aside."""
    return 0 <= motion_id < ENTRY_ID
