"""A tool changer at work: its journal, kept before every step moves, and the dialogue after one that broke.

The plan has laid the steps of M6 with a stop before each and one after the last
(``program/tool_change_words``); the tick holds there. Here the stop is seen, the store takes in one
transaction what the step before has done and which step comes, and only then the tick is told to go on:

    tick    ... step k ...  HOLD                       step k+1 ...
    store                       "k over, k+1 begun"
    RESUME                                         ->

Every RESUME of a machine with a changer goes out from here, and the next not before the tick has answered the
last: no stop is ever passed that the store has not seen. What is under way when all ends is told at the next
start (``doubt``), and until an operator has confirmed where the tools are nothing moves but by jog.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import Any

from controller.ipc.handoff import Snapshot
from controller.machine.model import Changer, Io
from controller.messages import Message, message, several
from controller.motion.pieces import FIRST_MARK
from controller.program.output_words import steps_of
from controller.program.program import Changing
from controller.service.tool_preparation import Preparation, Tick
from controller.state.modes import Fault, Mode, Request, bars
from controller.store.tool_store import AWAY, SPINDLE, Step, ToolStore

SLOWER = 2.0  # a step without an input of its own may take so much longer than it says: at an override


class _Stops:
    """Those of a changer that the plan has read, by their number."""

    def __init__(self) -> None:
        self._marks: dict[int, Changing] = {}

    def hear(self, marks: Iterable[Changing]) -> None:
        """Some more."""
        self._marks = {**self._marks, **{mark.number: mark for mark in marks}}

    def coming(self, now: Snapshot) -> Changing | None:
        """The one at which the tick holds, or comes to rest."""
        if now.mode is not Mode.HOLD or now.motion_id > FIRST_MARK:
            return None
        return self._marks.get(FIRST_MARK - now.motion_id)

    def at(self, now: Snapshot) -> Changing | None:
        """The one at which the tick stands."""
        return self.coming(now) if now.at_rest else None


class _Resume:
    """The next not before the tick has answered the last."""

    def __init__(self, tick: Tick) -> None:
        self._tick = tick
        self._lock = threading.Lock()
        self._asked: int | None = None  # number of the request

    def forget(self) -> None:
        """A run begins."""
        self._asked = None

    def free(self, now: Snapshot) -> bool:
        """Whether the tick has answered the last."""
        return self._asked is None or now.has_taken(self._asked)

    def ask(self, now: Snapshot) -> None:
        """Nothing where the last is not answered."""
        with self._lock:
            if self.free(now):
                self._asked = self._tick.request(Request.RESUME)


class _StepTime:
    """How long a step has run; one that takes too long is reported once, in the words of its builder."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._seen_tick = 0
        self._ran = 0  # ticks
        self._told = False

    def begin(self, now: Snapshot) -> None:
        """A step begins."""
        self._seen_tick, self._ran, self._told = now.tick, 0, False

    def report_again(self) -> None:
        """An operator lets it go on."""
        self._told = False

    def look(self, now: Snapshot, mark: Changing, changer: Changer) -> tuple[Message | None, bool]:
        """What is reported of the step just now; and whether it takes too long."""
        if now.mode is Mode.RUNNING:
            self._ran += now.tick - self._seen_tick
        self._seen_tick = now.tick
        rows = steps_of(changer, mark.tool_out, mark.tool_in)
        step = rows[mark.step][0]
        late = self._ran * self._period_s > SLOWER * step.within_s
        missing = now.mode is Mode.HOLD and now.fault is Fault.INPUT_MISSING
        if self._told or not (late or missing):
            return None, False
        self._told, self._ran = True, 0
        of: dict[str, Any] = {"number": mark.step + 1, "steps": len(rows), "step": step.name}
        return several(message("change_late", **of, fails=step.fails), message("change_late_do")), late


class Whereabouts:
    """Of one store; the steps of a change are written to it here."""

    def __init__(self, store: ToolStore, changer: Callable[[], Changer]) -> None:
        """``changer``: as its pockets are now."""
        self._store, self._changer = store, changer

    @property
    def unsure(self) -> dict[int, int]:
        """Of a change that is not over the tools that may be elsewhere, and the pocket of each.

        Whatever the step: a drawbar that closes as its power goes grips what stands before it.
        """
        step = self._store.step
        if step is None:
            return {}
        changer = self._changer()
        taking = step.step >= (len(changer.put_away) if step.tool_out else 0)
        tools = (step.tool_out, step.tool_in if taking else 0)
        return {tool: changer.pocket(tool) or AWAY for tool in tools if tool}

    @property
    def spindle(self) -> int:
        """Number of the tool in it; 0 = none, or nobody knows."""
        return 0 if self.unsure else self._store.spindle or 0

    def doubt(self, beside: Message | None) -> Message | None:
        """What an operator must confirm before anything moves; ``beside``: of a preparation."""
        store = self._store
        if not store.known:
            return message("changer_unknown")
        if store.step is None:
            return None if beside is None else several(beside, message("changer_confirm"))
        step, spindle = store.step, store.spindle
        told = message("change_interrupted", out=step.tool_out, into=step.tool_in, step=step.name)
        begun = message("change_spindle", tool=spindle) if spindle else message("change_spindle_empty")
        carried = (
            message("change_carried", tool=tool, pocket=pocket) for tool, pocket in self.unsure.items()
        )
        return several(told, begun, *carried, message("changer_confirm"))

    def refusal(self, mark: Changing) -> Message | None:
        """Why a change does not begin: a tool is not where it is taken, or where it goes another one is."""
        store, changer, places = self._store, self._changer(), self._store.places
        out, into = mark.tool_out, mark.tool_in
        if store.spindle != out:
            return message("change_other_tool", found=store.spindle, wanted=out)
        if into and places.get(into) != changer.pocket(into):
            return message("change_not_there", tool=into, pocket=changer.pocket(into))
        if out and changer.pocket(out) in places.values():
            return message("change_taken", tool=out, pocket=changer.pocket(out))
        return None

    def begin(self, mark: Changing) -> None:
        """The step before is over, and this one begins; or all is. Raises OSError."""
        if mark.last:
            self._store.end()
            return
        changer = self._changer()
        step, pocket = steps_of(changer, mark.tool_out, mark.tool_in)[mark.step]
        away = mark.tool_out and mark.step < len(changer.put_away)
        carries = (mark.tool_out if away else mark.tool_in) if step.carries else 0
        to = pocket if away else SPINDLE
        self._store.begin(Step(mark.tool_out, mark.tool_in, mark.step, step.name, carries, to))

    def to_json(self, mark: Changing | None) -> dict[str, Any]:
        """For status, page and command line; ``mark``: of the change under way."""
        store, step, changer, unsure = self._store, self._store.step, self._changer(), self.unsure
        places = store.places if store.known else {}
        steps = None if mark is None else len(steps_of(changer, mark.tool_out, mark.tool_in))
        return {
            "spindle": None if unsure else store.spindle,
            "pockets": [
                {
                    "pocket": number,
                    "tool": tool or None,
                    "here": None if not tool or tool in unsure or not places else places.get(tool) == number,
                }
                for number, tool in enumerate(changer.pockets, 1)
            ],
            "away": store.away,  # also where nobody has confirmed it: then it is what was last known
            "unsure": sorted(unsure),
            "step": None if step is None else {**step._asdict(), "steps": steps},
        }


class ToolChanger:
    """One per service with a changer; ``look`` with every new snapshot, from one thread."""

    def __init__(
        self,
        store: ToolStore,
        changer: Callable[[], Changer],
        tick: Tick,
        tell: Callable[[str, Message], object],
        period_s: float,
        worn: Callable[[int], Message | None],
        io: Io | None,
    ) -> None:
        """``changer``: as its pockets are now; ``tell``: name and words of an alarm; ``worn``: what is to be
        said of a tool at the end of its life, None of any other."""
        self.store, self.whereabouts = store, Whereabouts(store, changer)
        self._changer, self._tick, self._tell, self._worn = changer, tick, tell, worn
        self.beside = Preparation(store, changer, io, tick, tell, period_s)
        self._stops, self._resume, self._time = _Stops(), _Resume(tick), _StepTime(period_s)
        self._worn_at: int | None = None  # the stop that has reported a worn tool
        self._now: Changing | None = None  # the stop passed last, while a change is under way
        self._keeps = False  # an operator has held: no step begins
        self._waits = False  # a change for the pocket that is prepared

    # -- of a run

    def arm(self) -> None:
        """A run begins."""
        self._stops = _Stops()
        self._resume.forget()
        self._time.report_again()
        self._now, self._keeps, self._worn_at, self._waits = None, False, None, False
        self.beside.end()

    def hear(self, marks: Iterable[Changing]) -> None:
        """Stops that the plan has read."""
        self._stops.hear(marks)

    def ended(self) -> None:
        """The run is over; a change that was under way is in doubt from now on."""
        step, self._now, self._waits = self._now, None, False
        self.beside.end()
        if step is not None and self.store.step is not None:
            self._tell("CHANGE_BROKEN", self.doubt or message("change_broken"))

    @property
    def under_way(self) -> bool:
        """Whether a run is in the middle of a change."""
        return self._now is not None or self._waits

    def change(self, now: Snapshot) -> Message | None:
        """The step of the change under way, in words; None where there is none, or it is held.

        The stops between its steps are no holds: nobody has asked for one, and it goes on by itself.
        """
        here = self._stops.coming(now)
        mark = here or self._now
        if mark is None or now.mode not in (Mode.RUNNING, Mode.HOLD):
            return None
        if now.mode is Mode.HOLD:
            barred = now.fault is not Fault.NONE or bars(now.interlock, Request.RESUME)
            if here is None or self._keeps or barred:
                return None
        return _in_words(self._changer(), mark, self._waits)

    @property
    def tools(self) -> tuple[int, int] | None:
        """Of a change whose first step has begun: the one that goes and the one that comes, 0 = none."""
        mark = self._now
        return None if mark is None or mark.moves_nothing else (mark.tool_out, mark.tool_in)

    def hold(self) -> None:
        """Also of a changer that stands between two steps."""
        self._keeps = True

    def resume(self, now: Snapshot) -> None:
        """The operator's RESUME in a hold, which goes out here or with the next look."""
        self._keeps = False
        self._time.report_again()
        if self._stops.at(now) is None:
            self._resume.ask(now)

    # -- looking on

    def look(self, now: Snapshot) -> None:
        """Keeps the journal at a stop of the changer, and lets the tick go on."""
        mark = self._stops.at(now)
        self._look_beside(now, mark)
        if mark is None:
            self._watch(now)
        elif not self._keeps and self._resume.free(now) and self._may_begin(mark) and self._store_step(mark):
            self._time.begin(now)
            self._resume.ask(now)

    def _may_begin(self, mark: Changing) -> bool:
        return not self._holds_worn(mark) and self._stands(mark)

    def _look_beside(self, now: Snapshot, mark: Changing | None) -> None:
        """What T prepares while the run goes on; an operator's hold lets no step of it begin."""
        goes_on = now.mode is Mode.RUNNING or (mark is not None and not self._keeps)
        sure = self._now is None and self.store.known and self.store.step is None
        why = self.beside.look(now, goes_on and sure)
        if why is not None:
            self._refuse(why, mark is not None)

    def _stands(self, mark: Changing) -> bool:
        """Whether the tool's pocket is where it is taken."""
        if self._now is not None or mark.last or self._refusal(mark) is not None:
            return True  # prepared before its first step, or refused in a moment
        self._waits = not self.beside.stands(mark.tool_in)
        return not self._waits

    def _holds_worn(self, mark: Changing) -> bool:
        """Before a tool comes, or cuts on, that is worn nothing moves, until RESUME takes it as it is."""
        if mark.step != 0 or self._now is not None or self._worn_at == mark.number:
            return False
        worn = self._worn(mark.tool_in)
        if worn is not None:
            self._worn_at, self._keeps = mark.number, True
            self._tell("CHANGE_WORN", worn)
        return worn is not None

    def _store_step(self, mark: Changing) -> bool:
        """Store the step before it moves; where that fails the run is stopped, and it is False."""
        if self._now == mark or (mark.moves_nothing and self._now is None):
            return True  # planned once more, as after another override: it stands where it stood
        why = self._refusal(mark)
        try:
            if why is None:
                self.whereabouts.begin(mark)
        except OSError as error:
            why = message("change_not_kept", why=error)
        if why is not None:
            self._refuse(why, True)
            return False
        if mark.last:
            self.beside.taken(mark.tool_in)
        self._now = None if mark.last else mark
        return True

    def _refuse(self, why: Message, ends: bool) -> None:
        """Told; a change that was to begin or go on ends with it."""
        self._tell("CHANGE_REFUSED", why)
        if ends:
            self._keeps = True
            self._tick.request(Request.STOP)

    def _refusal(self, mark: Changing) -> Message | None:
        """Why the change may not go on: it does not begin with its first step, or tools are elsewhere."""
        if self._now is not None:
            same = (self._now.tool_out, self._now.tool_in, self._now.step + 1)
            return None if (mark.tool_out, mark.tool_in, mark.step) == same else message("change_out_of_step")
        if mark.step != 0 or mark.last:
            return message("change_out_of_step")
        return self.doubt or self.whereabouts.refusal(mark)

    def _watch(self, now: Snapshot) -> None:
        """A step that takes too long is held, and reported."""
        if self._now is None:
            return
        told, late = self._time.look(now, self._now, self._changer())
        if told is not None:
            self._tell("CHANGE_STEP", told)
        if late and now.mode is Mode.RUNNING:
            self._keeps = True
            self._tick.request(Request.HOLD)

    # -- what is known

    @property
    def doubt(self) -> Message | None:
        """What an operator must confirm before anything moves; None: nothing."""
        return None if self._now is not None else self.whereabouts.doubt(self.beside.doubt)

    def to_json(self) -> dict[str, Any]:
        """For status, page and command line."""
        return {
            **self.whereabouts.to_json(self._now),
            "held": self._keeps and (self._now is not None or self._worn_at is not None),
            **self.beside.to_json(),
            "doubt": self.doubt,
        }


def _in_words(changer: Changer, mark: Changing, waits: bool) -> Message:
    """The step of a change; ``waits``: for the pocket that is prepared."""
    out, into = mark.tool_out, mark.tool_in
    if mark.moves_nothing:
        return message("changing_not", into=into)
    if waits:
        return message("changing_waits", into=into)
    rows = steps_of(changer, out, into)
    at = min(mark.step, len(rows) - 1)
    key = "changing" if out and into else "changing_out" if out else "changing_in"
    return message(key, out=out, into=into, number=at + 1, steps=len(rows), step=rows[at][0].name)
