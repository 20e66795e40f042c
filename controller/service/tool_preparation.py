"""T beside a cut: the steps of ``[[changer.prepare]]`` bring a tool's pocket to where M6 takes it.

They switch and look at inputs, and move no axis; so they need no place in the path, and are told to the tick
one by one while it goes on. Before a step switches anything the store has it; after its input it is over,
and between two of them a preparation may end at any time, for the next begins with the first step again:

    T4 ... step 1 | step 2 | step 3   4 stands ready        M6 takes it
    T4 ... step 1 |                   T5: step 1 | step 2 ...

A step that is under way when all ends is told at the next start, and until an operator has looked nothing
moves but by jog. Without a T, or where it is not done yet, M6 waits for the same steps at its first stop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from controller.ipc.handoff import Outcome, Snapshot
from controller.machine.model import Changer, ChangerStep, Io
from controller.messages import Message, message, several
from controller.state.modes import Fault, Request
from controller.store.tool_store import Step, ToolStore


class Tick(Protocol):
    """What is needed of the engine."""

    def request(self, request: Request, value: float = 0.0, /) -> int: ...


class _UnderWay(NamedTuple):
    """A step that has been sent to the tick."""

    tool: int
    number: int  # of the steps, from 0
    asked: int | None  # number of the request; None: it switches nothing
    tick: int  # when
    was_other: bool  # its input has been seen to be otherwise
    late: bool = False  # not done in time, and reported


class Preparation:
    """Of one service with a changer; ``look`` with every new snapshot, from one thread."""

    def __init__(
        self,
        store: ToolStore,
        changer: Callable[[], Changer],
        io: Io | None,
        tick: Tick,
        tell: Callable[[str, Message], object],
        period_s: float,
    ) -> None:
        """``changer``: as its pockets are now; ``tell``: name and words of an alarm."""
        self._store, self._changer, self._asks, self._tell = store, changer, tick, tell
        self._period_s = period_s
        self._inputs: Mapping[str, int] = dict(io.inputs) if io is not None else {}
        self._named = 0  # by T, last; 0 = none
        self._needed = 0  # by M6, which waits for it
        self.ready = 0  # whose pocket stands ready
        self._done = 0, 0  # of which tool so many steps are over
        self._step: _UnderWay | None = None

    # -- what is wanted

    def name(self, tool: int) -> None:
        """T has named it."""
        self._named = tool

    def end(self) -> None:
        """The run is over: the step under way comes to its end, and no other begins."""
        self._named = self._needed = self.ready = 0
        self._done = 0, 0

    def taken(self, tool: int) -> None:
        """M6 has taken it."""
        self._needed = self.ready = 0
        self._named = 0 if self._named == tool else self._named
        self._done = 0, 0

    def stands(self, tool: int) -> bool:
        """Whether M6 can go on; where T has not seen to it, it is done now."""
        self._needed = tool
        return not self._changer().prepare or tool in (0, self.ready)

    @property
    def under_way(self) -> bool:
        """Whether a step has been sent to the tick and is not over."""
        return self._step is not None

    # -- looking on

    def look(self, now: Snapshot, may_begin: bool) -> Message | None:
        """The step under way, and the next one where it ``may_begin``; why nothing can be kept of it."""
        try:
            if self._step is not None:
                self._watch(now, self._step, may_begin)
            elif may_begin and self._wants() and self.doubt is None and now.interlock is Fault.NONE:
                self._begin(now)
        except OSError as error:
            self.end()
            return message("change_not_kept", why=error)
        return None

    @property
    def _tool(self) -> int:
        """That is to be ready."""
        return self._needed or self._named

    def _wants(self) -> bool:
        """A tool that has no pocket, or is not there, M6 refuses."""
        changer, tool = self._changer(), self._tool
        pocket = changer.pocket(tool)
        there = pocket is not None and self._store.places.get(tool) == pocket
        return bool(changer.prepare) and tool not in (0, self.ready) and there

    def _begin(self, now: Snapshot) -> None:
        """To the disk, then to the tick."""
        changer, tool = self._changer(), self._tool
        number = self._done[1] if self._done[0] == tool else 0
        step, pocket = changer.prepare[number], changer.pocket(tool) or 0
        self.ready = 0
        self._store.prepare(Step(0, tool, number, step.name))
        other = not self._is_reached(now, step)
        told = changer.output_word(step, pocket)
        asked = self._asks.request(Request.PREPARE, told) if told else None
        self._step = _UnderWay(tool, number, asked, now.tick, other)

    def _watch(self, now: Snapshot, under_way: _UnderWay, may_begin: bool) -> None:
        step = self._changer().prepare[under_way.number]
        here, taken = self._is_reached(now, step), under_way.asked is None or now.has_taken(under_way.asked)
        if under_way.asked is not None and now.came_of(under_way.asked)[0] is Outcome.REFUSED:
            self._step = None  # a door was opened, or the run has ended: nothing was switched
            self._store.prepared()
            return
        self._step = under_way = under_way._replace(was_other=under_way.was_other or not here)
        if here and taken and (under_way.was_other or step.level in ("on", "off")):
            self._over(now, under_way, may_begin)
        elif not under_way.late and (now.tick - under_way.tick) * self._period_s > step.within_s:
            self._step = under_way._replace(late=True)
            self._tell("CHANGE_PREPARE", self._late(under_way, step))
        if under_way.late and self._step is not None and self._tool != under_way.tool:
            self._step = None  # nobody waits for it any more: it is in doubt

    def _over(self, now: Snapshot, under_way: _UnderWay, may_begin: bool) -> None:
        self._step = None
        self._done = under_way.tool, under_way.number + 1
        if under_way.tool == self._tool and self._done[1] == len(self._changer().prepare):
            self.ready = under_way.tool
        if may_begin and self._wants():
            self._begin(now)
        else:
            self._store.prepared()

    def _is_reached(self, now: Snapshot, step: ChangerStep) -> bool:
        return bool(now.inputs >> self._inputs[step.input] & 1) is (step.level in ("rise", "on"))

    def _late(self, under_way: _UnderWay, step: ChangerStep) -> Message:
        steps = len(self._changer().prepare)
        what: dict[str, Any] = {"number": under_way.number + 1, "steps": steps, "step": step.name}
        return several(
            message("prepare_late", fails=step.fails, tool=under_way.tool, **what), message("prepare_late_do")
        )

    # -- what is known

    @property
    def doubt(self) -> Message | None:
        """A step that was under way when all ended; None: none was."""
        step = self._store.preparation
        if step is None or self._step is not None:
            return None
        return message("prepare_interrupted", tool=step.tool_in, step=step.name)

    def to_json(self) -> dict[str, Any]:
        """For status, page and command line."""
        step = self._store.preparation
        steps = len(self._changer().prepare)
        under_way = None if step is None else {"tool": step.tool_in, "step": step.step, "name": step.name}
        return {"preparing": under_way and {**under_way, "steps": steps}, "ready": self.ready or None}
