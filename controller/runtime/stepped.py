"""A whole machine on the stepped clock: planner, tick, bus and simulated drives in one process.

The same loop, cycle, planner, commissioning and drives as in production; only the
clock is another. No threads, no wall-clock time: the same machine, program and events
give the same setpoints, as fast as the computer can.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
import numpy.typing as npt

from controller.ipc.handoff import (
    COLUMN,
    Outcome,
    OwnBoard,
    PieceInbox,
    PieceOutbox,
    Recorder,
    RequestInbox,
    piece_pair,
    request_pair,
    send_arrangement,
    send_jog,
    send_request,
)
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints, Machine
from controller.motion.pieces import FIRST_MARK
from controller.plan.planner import Planner
from controller.plan.segment import ContinuousPath, PathItem, straight
from controller.program.program import Place
from controller.runtime import cyclic, simulation
from controller.runtime.contour_error import DemandOf
from controller.runtime.contour_watch import ContourWatch, reaction
from controller.runtime.events import Event
from controller.runtime.recording import Keeper
from controller.runtime.simulation import LostSync, MotorParameters
from controller.runtime.startup import Came, SessionError, StartUp, arrangement, came_to, no_start
from controller.state import stop_times
from controller.state.fault_table import NOBODY, Sender
from controller.state.modes import Fault, Mode, Request, sentence
from controller.state.queue_refusals import QueueRefusal
from controller.tick.cycle import Cycle
from controller.tick.loop import Loop, SteppedClock
from drives import commission, pdo
from drives.arranged import Arranged
from drives.log.frame_log import FrameLog
from drives.pump.plan_memory import Memory
from drives.pump.stepped import SteppedPump

if TYPE_CHECKING:
    from controller.runtime.simulation import Bench, Observer

PLAN_EVERY_S = 0.008  # between two turns of the planner, in whole ticks: an override shows soon
KEEPALIVE_EVERY = 16  # turns of it
IDLE_TICKS = 100  # at rest with nothing to do, while the planner has had many turns: nothing will come
DRAIN_EVERY = 4096  # ticks between two looks at the recorder
STANDING_WORDS = (Request.HOLD, Request.RESUME, Request.STOP)
WAIT_TIMEOUT_S = 10.0  # beyond the tick's own for enabling or homing, which says more
# Looked up every tick, and an enum's members are slow to look up.
_RUNNING: Final = Mode.RUNNING
_HOLD: Final = Mode.HOLD
_FAULT: Final = Mode.FAULT

Rows = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Run:
    """What came of one program: rows of the recorder from cycle start, and how it ended."""

    rows: Rows
    result: str  # "completed", "fault", "stopped" or "held" as asked, or "stuck": nobody has asked for it
    fault: Fault
    fault_axis: int
    first_tick: int
    skips: int
    assumed_resumes: int  # program stops (M0) after which an operator's resume was assumed
    events_left: int  # requests whose tick the run did not reach
    fault_text: str = ""  # for the operator, and where the recording lies
    refusal: QueueRefusal = QueueRefusal.NONE  # of the plan's last message, where it is stuck
    lacks_from: int | None = None  # SYNC from which on a record lacks what its planner did: it was killed

    @property
    def line(self) -> int:
        """Of the program, at its end; 0 = none."""
        return int(self.rows[-1, COLUMN["line"]]) if len(self.rows) else 0


def _end_of_program(rows: Rows) -> int:
    """The first of the READY rows at the end; what follows it is only the looking whether it stands."""
    others = np.flatnonzero(rows[:, COLUMN["mode"]] != Mode.READY)
    return int(others[-1]) + 1 if len(others) else 0


class Items(Protocol):
    """A path as a whole, or one that is read as it is walked."""

    @property
    def items(self) -> Iterable[PathItem]: ...


@dataclass(frozen=True, slots=True)
class Way:
    """A path of a few items."""

    items: Sequence[PathItem]


class SteppedMachine:
    """Powers up, commissions, homes and runs programs."""

    def __init__(
        self,
        machine: Machine,
        *,
        stiffness: Mapping[str, float] | None = None,
        lost_sync: LostSync = LostSync.HOLD,
        lateness: Callable[[int], float] | None = None,
        recordings: Path | None = None,
        motor: MotorParameters | None = None,
        bench: Bench | None = None,
    ) -> None:
        """``stiffness``: factor on the position gain by axis name; ``lateness``: see SteppedClock.

        ``motor``: how the spindle lags and slips.
        ``recordings``: folder for what is kept of a fault; None = nothing is kept.
        ``bench``: what its probe can touch, and its spindle cut.
        """
        self.machine = machine
        self.kinematics = kinematics_of(machine)
        if motor is None and bench is not None and bench.cut is not None:
            motor = MotorParameters()
        self.rig = simulation.rig_of(machine, stiffness, lost_sync, motor)
        self.touch = None if bench is None else simulation.wired(bench, machine, self.rig)
        self._ticks_in_sdo = False
        networks = {
            bus.name: commission.Network(self.rig.port(pdo.SERVICE_FILTERS, bus.name), self._pass_time())
            for bus in machine.buses
        }
        self._operator, request_end = request_pair()
        self._numbers = itertools.count(1)
        self.times = stop_times.of(machine)  # once commissioned: as its drives were found
        self._start_up = StartUp(
            machine, networks, self._ask, lambda: self.cycle.modes.homed, self._take_arranged
        )
        self._start_up.commission()
        ports = {bus.name: self.rig.port(pdo.TICK_FILTERS, bus.name) for bus in machine.buses}
        self._group = cyclic.group(machine, ports)
        self._plan_end, tick_end = piece_pair()
        self.board, self.recorder = OwnBoard(len(machine.axes)), Recorder()
        self._offset_s = self.rig.now_s
        plans = cyclic.plans(machine)
        advance = self._advance if plans is None else self._pump(plans).advance
        self.clock = SteppedClock([advance], lateness)
        self.inverter = simulation.stepped_inverter(machine, lambda: self.rig.now_s)
        self.cycle = Cycle(
            machine,
            self._group,
            PieceInbox(tick_end),
            RequestInbox(request_end, len(machine.axes)),
            self.board,
            self.recorder,
            self.clock.now_s,
            plans,
            None if self.inverter is None else self.inverter.slot,
        )
        self._loop = Loop(self.cycle, self.clock, with_pump=plans is not None)
        self.outbox = PieceOutbox(self._plan_end)
        self.planner = Planner(machine, self.kinematics, self.outbox.send, remember=True)
        self._keeper = None if recordings is None else self._keeping(recordings)
        self._observer: Observer | None = None
        self.contour: ContourWatch | None = None  # of the run under way
        self._held = self._reacts = False  # it was held for its contour error, or would be
        self._rows: list[Rows] = []
        self._take: Callable[[Rows], object] = self._rows.append
        self._turns = 0  # of the planner
        self._idle = 0  # ticks in which nothing moved, and nothing was there that would
        self._skips_before = 0  # while coming up

    def _take_arranged(self, found: tuple[Arranged, ...]) -> None:
        self.times = stop_times.of(self.machine, found)
        send_arrangement(self._operator, arrangement(self.machine, found))

    def _pump(self, plans: Memory) -> SteppedPump:
        return SteppedPump(
            cyclic.player(self.machine, self._group, plans), self.machine.period_s, self._advance
        )

    def _advance(self, now_s: float) -> None:
        self.rig.advance(now_s + self._offset_s)
        if self.inverter is not None:
            self.inverter.advance()

    def _pass_time(self) -> commission.Pump:
        """What SDO waits by: the bus alone, or the whole machine where the drives must hear the master."""
        alone = commission.stepped_pump(self.rig)

        def pump() -> float:
            if not self._ticks_in_sdo:
                return alone()
            self.tick()
            return self.rig.now_s

        return pump

    def commission_again(self) -> None:
        """After a fault that has cost drives their settings; the tick goes on. Raises CommissionError."""
        self._offset_s = self.rig.now_s - self.clock.now_s()
        self._ticks_in_sdo = True
        try:
            self._start_up.commission()
        finally:
            self._ticks_in_sdo = False

    def request(self, request: Request, value: float = 0.0) -> int:
        """Ask the tick for something; the number by which ``cycle.answers`` has what came of it."""
        number = next(self._numbers)
        send_request(self._operator, request, value, number)
        return number

    def _came_of(self, number: int) -> tuple[Outcome, Fault]:
        now = self.board.read()
        return (Outcome.NONE, Fault.NONE) if now is None else now.came_of(number)

    def _keeping(self, recordings: Path) -> Keeper:
        logs = {name: FrameLog() for name in self.rig.buses}
        for name, bus in self.rig.buses.items():
            bus.log(logs[name].keep)
        return Keeper(self.machine, self.recorder, logs, recordings)

    def tick(self) -> None:
        self._loop.tick()
        if self._keeper is not None and (self.cycle.modes.mode is _FAULT or self._keeper.saved):
            self._is_recorded()
        if self._observer is not None:
            self._observer.look()

    def observe(self) -> Observer:
        """Somebody who looks at the motors with every tick from now on; a run waits until they stand."""
        self._observer = simulation.observer(self.machine, self.cycle, self.rig)
        return self._observer

    def watch_contour(self, demand_of: DemandOf, acts: bool = True) -> ContourWatch:
        """Looks at the contour error of the next run, and ``acts`` as the machine file says."""
        self.contour, self._held = ContourWatch(self.machine, demand_of), False
        self._reacts = acts
        return self.contour

    def _is_recorded(self) -> bool:
        """Whether nothing is left to be recorded of a fault."""
        now = self.board.read()
        return self._keeper is None or now is None or self._keeper.look(now)

    @property
    def joints(self) -> Joints:
        """The commanded joints."""
        return self.cycle.follow.joints

    def come_up(self) -> None:
        """Home every axis, group by group, and enable. Raises SessionError."""
        self._start_up.come_up()

    def _ask(self, request: Request, value: float, wanted: Mode) -> Came:
        # SDO has let time pass on the bus alone.
        self._offset_s = self.rig.now_s - self.clock.now_s()
        number = self.request(request, value)
        longest_s = stop_times.ENABLE_S + stop_times.HOMING_S + WAIT_TIMEOUT_S
        for _ in range(round(longest_s / self.machine.period_s)):
            self.tick()
            now = self.board.read()
            if now is not None and (came := came_to(now, number, request, value, wanted)) is not None:
                return came
        return self.cycle.modes.mode, self.cycle.modes.fault, self.cycle.modes.fault_axis

    def stand_at(self, joints: Joints, plan_time_s: float) -> None:
        """Where a recorded run began, by place and by the path clock; homed and enabled it goes there."""
        way = straight("position", Place(1, 1), self.joints, joints, None, self.kinematics)
        if way is not None:
            self.run(Way((ContinuousPath((way,)),)))
        self.cycle.follow.set_joints(joints)
        self.cycle.follow.set_clock(plan_time_s)
        self.tick()

    # --- a program

    def run(
        self,
        path: Items,
        events: Sequence[Event] = (),
        progress: Callable[[float], None] = lambda _: None,
    ) -> Run:
        """Run a path to its end, or to where the events, a fault or a refused block leave it at rest.

        ``events`` in the order of their ticks; a list may be added to meanwhile.
        Raises SessionError where an open door, or an axis that must be homed, forbids the start.
        """
        self.begin_rows()
        follow = self.cycle.follow
        self.planner.load(path.items, follow.queue_end_s, follow.epoch)
        self._plan()
        started = self.request(Request.START)
        first, self._skips_before = self.cycle.tick + 1, self.cycle.sync.skips
        self._idle = asked_for = resumes = n = 0  # ``asked_for``: events that have been sent
        plan_every = max(1, round(PLAN_EVERY_S / self.machine.period_s))
        while True:
            while asked_for < len(events) and events[asked_for].tick <= n:
                if events[asked_for].request is Request.STOP:
                    self.planner.drop()
                self.send(events[asked_for])
                asked_for += 1
                self._idle = 0
            waiting = events[asked_for:]
            if n % plan_every == 0:
                self._plan()
            self.tick()
            if n == 0:
                self.see_started(started)
            n += 1
            self.keep_rows(n, progress)
            if not self.stands(waiting) and not self._at_program_stop(events, n):
                continue
            if self.cycle.modes.mode is Mode.HOLD:
                asked = self._is_operator_hold(events, n)
                if self._goes_on(waiting, asked):
                    continue
                if not asked:
                    resumes += not self._between_steps()
                    self._prepare()
                    self.request(Request.RESUME)
                    continue
            return self._ended(first, resumes, len(waiting), events, n)

    def begin(self, path: Items) -> None:
        """Load a path and ask for its start; ``go`` then lets time pass."""
        follow = self.cycle.follow
        self.planner.load(path.items, follow.queue_end_s, follow.epoch)
        self._plan()
        self.request(Request.START)

    def go(self, ticks: int, done: Callable[[], bool] = lambda: False) -> Rows:
        """Let time pass for so many ticks or until ``done``; the recorder's rows of it."""
        self.recorder.drain()
        rows = []
        plan_every = max(1, round(PLAN_EVERY_S / self.machine.period_s))
        for n in range(ticks):
            if n % plan_every == 0:
                self._plan()
            self.tick()
            if n % DRAIN_EVERY == DRAIN_EVERY - 1:
                rows.append(self.recorder.drain())
            if done():
                break
        return np.concatenate([*rows, self.recorder.drain()])

    def begin_rows(self, take: Callable[[Rows], object] | None = None) -> None:
        """Rows of the recorder are kept from here on, or ``take`` gets them, some thousand at a time."""
        self.recorder.drain()
        self._rows.clear()
        self._take = take or self._rows.append

    def keep_rows(self, n: int, progress: Callable[[float], None]) -> None:
        """After the n-th tick; ``progress`` gets the seconds of motion."""
        if n % self._drain_every == 0:
            self._drain()
            progress(n * self.machine.period_s)

    @property
    def _drain_every(self) -> int:
        """Ticks."""
        return DRAIN_EVERY if self.contour is None else self.contour.portion

    def _drain(self) -> None:
        rows = self.recorder.drain()
        self._take(rows)
        for excess in self.contour.take(rows) if self.contour is not None else ():
            asked = reaction(self.machine, self.cycle.modes.override)
            if asked is not None and self._reacts and not excess.over:
                self._held |= asked[0] is Request.HOLD
                self.request(*asked)

    def end_rows(self) -> None:
        """No more are kept, or taken."""
        self._drain()
        if self.contour is not None:
            self.contour.see_all()

    def recorded_rows(self) -> Rows:
        """All since ``begin_rows``."""
        self.end_rows()
        return np.concatenate(self._rows)

    def see_started(self, number: int) -> None:
        """Raises SessionError where the machine forbids the start."""
        modes = self.cycle.modes
        why = no_start(self.machine, modes.interlock, modes.untrusted)
        if why and modes.mode is Mode.READY and self._came_of(number)[0] is Outcome.REFUSED:
            raise SessionError(why)

    def stands(self, waiting: Sequence[Event]) -> bool:
        """Whether nothing moves any more, or will before a request comes."""
        modes, follow = self.cycle.modes, self.cycle.follow
        if modes.mode is not _RUNNING:
            # READY comes a tick after the standstill.
            return follow.at_rest and not follow.stopping and modes.mode is not Mode.STOPPING
        if not follow.at_rest or follow.stopping or self.cycle.peripherals.waiting:
            self._idle = 0
            return False
        # An override of 0, or a program that was refused on the way: only a request can change that.
        goes = follow.pending and follow.goes(True, modes.override, modes.rapid_override)
        self._idle = 0 if goes else self._idle + 1
        return self._idle > IDLE_TICKS and not waiting

    def _at_program_stop(self, events: Sequence[Event], n: int) -> bool:
        """At M0 the plan itself is at rest: a resume that is assumed costs no time."""
        held = self.cycle.modes.mode is _HOLD and not self.cycle.follow.stopping
        return held and not self._is_operator_hold(events, n)

    def _between_steps(self) -> bool:
        """Whether it is a stop of the tool changer, which no operator has to resume."""
        piece = self.cycle.follow.piece
        return piece is not None and piece.motion_id <= FIRST_MARK

    def _prepare(self) -> None:
        """Where a pocket is brought to the spindle beside the path: its simulated switches follow.

        Of which pocket does not matter to them.
        """
        changer = self.machine.changer
        if changer is None or not self._between_steps():
            return
        for step in changer.prepare:
            if told := changer.output_word(step, 1):
                self.request(Request.PREPARE, told)

    def _goes_on(self, waiting: Sequence[Event], asked: bool) -> bool:
        """Whether the operator will still end this hold; of a program stop, by the next word at all."""
        words = [event.request for event in waiting if event.request in STANDING_WORDS]
        return any(word is not Request.HOLD for word in (words if asked else words[:1]))

    def _plan(self) -> None:
        now = self.board.read()
        if now is not None:
            self.planner.work(now)
        self._turns += 1
        if self._turns % KEEPALIVE_EVERY:
            self.outbox.flush()
        else:
            self.planner.keepalive()

    def send(self, event: Event) -> None:
        """What an operator asks for."""
        if event.jog is not None:
            send_jog(self._operator, event.jog, next(self._numbers))
        else:
            self.request(event.request, event.value)

    def _is_operator_hold(self, events: Sequence[Event], n: int) -> bool:
        """Whether this standstill is an operator's hold, and not a program stop."""
        if self.cycle.modes.fault is not Fault.NONE or self._held:
            return True  # a door, for example: nobody resumes that by himself
        asked = [e.request for e in events if e.tick <= n and e.request in (Request.HOLD, Request.RESUME)]
        return bool(asked) and asked[-1] is Request.HOLD

    @property
    def fault_text(self) -> str:
        """The operator's sentence on the present fault, with its recording."""
        modes = self.cycle.modes
        if modes.fault is Fault.NONE:
            return ""
        now = self.board.read()
        axis = self.machine.axis_off(modes.fault_axis, now.fault_off if now is not None else 0.0)
        sender = NOBODY if now is None else Sender(now.chatter_id, now.chatter_per_s)
        told = sentence(modes.fault, axis, modes.warning, sender=sender)
        return told + (self._keeper.location_text if self._keeper else "")

    def stand_still(self) -> None:
        """After a fault the drives' own way to standstill belongs to what is kept of it, or looked at."""
        while not (self._is_recorded() and (self._observer is None or self._observer.settled)):
            self.tick()

    def _ended(self, first: int, resumes: int, left: int, events: Sequence[Event], n: int) -> Run:
        self.stand_still()
        modes = self.cycle.modes
        if modes.mode is Mode.FAULT:
            result = "fault"
        elif modes.mode in (Mode.HOLD, Mode.RUNNING):
            asked = modes.mode is Mode.HOLD or 0.0 in (modes.override, modes.rapid_override)
            result = "held" if asked else "stuck"
        else:
            stopped = any(e.request is Request.STOP and e.tick < n for e in events)
            result = "stopped" if stopped and not self.planner.finished_path else "completed"
        rows = self.recorded_rows()
        if result == "completed":
            rows = rows[: _end_of_program(rows) + 1]
        return Run(
            rows,
            result,
            modes.fault,
            modes.fault_axis,
            first,
            self.cycle.sync.skips - self._skips_before,
            resumes,
            left,
            self.fault_text,
            self.cycle.refusal if result == "stuck" else QueueRefusal.NONE,
        )
