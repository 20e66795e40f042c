"""A tool changer at work: its journal, kept before every step moves, and the dialogue after one that broke.

The plan has laid the steps of M6 with a stop before each and one behind the last
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

import sqlite3
import threading
from collections.abc import Callable, Iterable
from typing import Any

from controller.ipc.handoff import Snapshot
from controller.machine.model import Changer, ChangerStep, Io
from controller.machine.tool_store import AWAY, SPINDLE, Step, ToolStore
from controller.messages import Said, said, several
from controller.motion.pieces import FIRST_MARK
from controller.program.program import Changing
from controller.program.tool_change_words import steps_of
from controller.service.tool_preparation import Preparation, Tick
from controller.state.modes import Fault, Mode, Request, bars

SLOWER = 2.0  # a step without an input of its own may take so much longer than it says: at an override


class ToolChanger:
    """One per service with a changer; ``look`` with every new snapshot, from one thread."""

    def __init__(
        self,
        store: ToolStore,
        changer: Callable[[], Changer],
        tick: Tick,
        tell: Callable[[str, Said], object],
        period_s: float,
        worn: Callable[[int], Said | None],
        io: Io | None,
    ) -> None:
        """``changer``: as its pockets are now; ``tell``: name and words of an alarm; ``worn``: what is to be
        said of a tool at the end of its life, None of any other."""
        self.store = store
        self._changer, self._tick, self._tell, self._period_s = changer, tick, tell, period_s
        self._worn = worn
        self.beside = Preparation(store, changer, io, tick, tell, period_s)
        self._worn_at: int | None = None  # the stop that has told of a worn tool
        self._lock = threading.Lock()  # of the one RESUME that is under way
        self._asked: int | None = None  # its number
        self._marks: dict[int, Changing] = {}
        self._now: Changing | None = None  # the stop passed last, while a change is under way
        self._keeps = False  # an operator has held: no step begins
        self._told = False  # that the step does not come to its end
        self._seen_tick = 0
        self._ran = 0  # ticks that the step has run
        self._waits = False  # a change for the pocket that is prepared

    # -- of a run

    def arm(self) -> None:
        """A run begins."""
        with self._lock:
            self._marks.clear()
            self._now, self._keeps, self._told, self._asked = None, False, False, None
            self._worn_at, self._waits = None, False
            self.beside.end()

    def hear(self, marks: Iterable[Changing]) -> None:
        """Stops that the plan has read."""
        with self._lock:
            self._marks |= {mark.number: mark for mark in marks}

    def ended(self) -> None:
        """The run is over; a change that was under way is in doubt from now on."""
        step, self._now, self._waits = self._now, None, False
        self.beside.end()
        if step is not None and self.store.step is not None:
            self._tell("CHANGE_BROKEN", self.doubt or said("change_broken"))

    @property
    def under_way(self) -> bool:
        """Whether a run is in the middle of a change."""
        return self._now is not None or self._waits

    def change(self, now: Snapshot) -> Said | None:
        """The step of the change under way, in words; None where there is none, or it is held.

        The stops between its steps are no holds: nobody has asked for one, and it goes on by itself.
        """
        mark, here = self._now, self._next_mark(now)
        if (mark is None and here is None) or now.mode not in (Mode.RUNNING, Mode.HOLD):
            return None
        if now.mode is Mode.HOLD:
            barred = now.fault is not Fault.NONE or bars(now.interlock, Request.RESUME)
            if here is None or self._keeps or barred:
                return None
        return self._step_words(here or mark)

    def _step_words(self, mark: Changing | None) -> Said | None:
        if mark is None:
            return None
        out, into = mark.tool_out, mark.tool_in
        if mark.moves_nothing:
            return said("changing_not", into=into)
        if self._waits:
            return said("changing_waits", into=into)
        rows = steps_of(self._changer(), out, into)
        at = min(mark.step, len(rows) - 1)
        key = "changing" if out and into else "changing_out" if out else "changing_in"
        return said(key, out=out, into=into, number=at + 1, steps=len(rows), step=rows[at][0].name)

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
        self._keeps = self._told = False
        if self._mark(now) is None:
            self._go_on(now)

    # -- looking on

    def look(self, now: Snapshot) -> None:
        """Keeps the journal at a stop of the changer, and lets the tick go on."""
        mark = self._mark(now)
        self._look_beside(now, mark)
        if mark is None:
            self._watch(now)
        elif not self._keeps and self._free(now) and self._may_begin(mark) and self._kept(mark):
            self._began(now)
            self._go_on(now)

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

    def _mark(self, now: Snapshot) -> Changing | None:
        """The stop at which the tick stands."""
        return self._next_mark(now) if now.at_rest else None

    def _next_mark(self, now: Snapshot) -> Changing | None:
        """The stop at which the tick holds, or comes to rest."""
        if now.mode is not Mode.HOLD or now.motion_id > FIRST_MARK:
            return None
        return self._marks.get(FIRST_MARK - now.motion_id)

    def _free(self, now: Snapshot) -> bool:
        """Whether the tick has answered the last RESUME."""
        return self._asked is None or now.has_taken(self._asked)

    def _go_on(self, now: Snapshot) -> None:
        with self._lock:
            if self._free(now):
                self._asked = self._tick.request(Request.RESUME)

    def _kept(self, mark: Changing) -> bool:
        """The step before is over, and this one is known to the disk. Otherwise the run is stopped."""
        if self._now == mark or (mark.moves_nothing and self._now is None):
            return True  # planned once more, as after another override: it stands where it stood
        why = self._refusal(mark)
        try:
            if why is None and mark.last:
                self.store.end()
            elif why is None:
                self.store.begin(self._step(mark))
        except sqlite3.Error as error:
            why = said("change_not_kept", why=str(error))
        if why is not None:
            self._refuse(why, True)
            return False
        if mark.last:
            self.beside.taken(mark.tool_in)
        self._now = None if mark.last else mark
        return True

    def _refuse(self, why: Said, ends: bool) -> None:
        """Told; a change that was to begin or go on ends with it."""
        self._tell("CHANGE_REFUSED", why)
        if ends:
            self._keeps = True
            self._tick.request(Request.STOP)

    def _refusal(self, mark: Changing) -> Said | None:
        """Why the change may not go on: it does not begin with its first step, or tools are elsewhere."""
        if self._now is not None:
            same = (self._now.tool_out, self._now.tool_in, self._now.step + 1)
            return None if (mark.tool_out, mark.tool_in, mark.step) == same else said("change_out_of_step")
        if mark.step != 0 or mark.last:
            return said("change_out_of_step")
        if self.doubt is not None:
            return self.doubt
        store, changer = self.store, self._changer()
        if store.spindle != mark.tool_out:
            return said("change_other_tool", found=store.spindle, wanted=mark.tool_out)
        places = store.places
        if mark.tool_in and places.get(mark.tool_in) != changer.pocket(mark.tool_in):
            return said("change_not_there", tool=mark.tool_in, pocket=changer.pocket(mark.tool_in))
        if mark.tool_out and changer.pocket(mark.tool_out) in places.values():
            return said("change_taken", tool=mark.tool_out, pocket=changer.pocket(mark.tool_out))
        return None

    def _step(self, mark: Changing) -> Step:
        changer = self._changer()
        step, pocket = steps_of(changer, mark.tool_out, mark.tool_in)[mark.step]
        away = mark.tool_out and mark.step < len(changer.put_away)
        carries = (mark.tool_out if away else mark.tool_in) if step.carries else 0
        return Step(mark.tool_out, mark.tool_in, mark.step, step.name, carries, pocket if away else SPINDLE)

    # -- the time of a step

    def _began(self, now: Snapshot) -> None:
        self._seen_tick = now.tick
        self._ran, self._told = 0, False

    def _watch(self, now: Snapshot) -> None:
        """A step that takes too long is held, and told in the words of its builder."""
        mark = self._now
        if mark is None:
            return
        if now.mode is Mode.RUNNING:
            self._ran += now.tick - self._seen_tick
        self._seen_tick = now.tick
        step = steps_of(self._changer(), mark.tool_out, mark.tool_in)[mark.step][0]
        late = self._ran * self._period_s > SLOWER * step.within_s
        missing = now.mode is Mode.HOLD and now.fault is Fault.INPUT_MISSING
        if (late or missing) and not self._told:
            self._told, self._ran = True, 0
            self._tell("CHANGE_STEP", _late(step, mark, self._count(mark)))
            if late and now.mode is Mode.RUNNING:
                self._keeps = True
                self._tick.request(Request.HOLD)

    def _count(self, mark: Changing) -> int:
        return len(steps_of(self._changer(), mark.tool_out, mark.tool_in))

    # -- what is known, and the dialogue

    @property
    def doubt(self) -> Said | None:
        """What an operator must confirm before anything moves; None: nothing."""
        if self._now is not None:
            return None
        if not self.store.known:
            return said("changer_unknown")
        step = self.store.step
        if step is None:
            beside = self.beside.doubt
            return None if beside is None else several(beside, said("changer_confirm"))
        told = said("change_interrupted", out=step.tool_out, into=step.tool_in, step=step.name)
        return several(told, *self._whereabouts(), said("changer_confirm"))

    @property
    def unsure(self) -> dict[int, int]:
        """Of a change that is not over the tools that may be elsewhere, and the pocket of each.

        Whatever the step: a drawbar that closes as its power goes grips what stands before it.
        """
        step = self.store.step
        if step is None:
            return {}
        changer = self._changer()
        taking = step.step >= (len(changer.put_away) if step.tool_out else 0)
        tools = (step.tool_out, step.tool_in if taking else 0)
        return {tool: changer.pocket(tool) or AWAY for tool in tools if tool}

    def _whereabouts(self) -> list[Said]:
        """Of the tools of the change where they are, or may be."""
        spindle = self.store.spindle
        begun = said("change_spindle", tool=spindle) if spindle else said("change_spindle_empty")
        return [
            begun,
            *(said("change_carried", tool=tool, pocket=pocket) for tool, pocket in self.unsure.items()),
        ]

    def told(self) -> dict[str, Any]:
        """For status, page and command line."""
        step, changer, mark = self.store.step, self._changer(), self._now
        places = self.store.places if self.store.known else {}
        unsure = self.unsure
        return {
            "spindle": None if unsure else self.store.spindle,
            "pockets": [
                {
                    "pocket": number,
                    "tool": tool or None,
                    "here": None if not tool or tool in unsure or not places else places.get(tool) == number,
                }
                for number, tool in enumerate(changer.pockets, 1)
            ],
            "away": self.store.away,  # also where nobody has confirmed it: then it is what was last known
            "unsure": sorted(unsure),
            "step": None
            if step is None
            else {**step._asdict(), "steps": self._count(mark) if mark is not None else None},
            "held": self._keeps and (mark is not None or self._worn_at is not None),
            **self.beside.told(),
            "doubt": self.doubt,
        }


def _late(step: ChangerStep, mark: Changing, steps: int) -> Said:
    what: dict[str, Any] = {"number": mark.step + 1, "steps": steps, "step": step.name, "fails": step.fails}
    return several(said("change_late", **what), said("change_late_do"))
