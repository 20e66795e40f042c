"""One tick of the machine. ``Cycle.run`` is its table of contents; read it first.

Before the deadline the loop calls ``rehearse`` and ``receive``: caches are filled and drive feedback is
drained while there is time, so that SYNC leaves at the deadline itself. Nothing here sleeps, locks, logs or
raises on what may happen on a machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from controller.ipc.handoff import (
    BRAKED,
    EXPIRED,
    OFF_PATH,
    PLANNER_SILENCE_S,
    PLAYED,
    SETTLED,
    STOOD,
    TAKEN_BACK,
    TAKEN_BACK_BRAKED,
    WAITED,
    Arrangement,
    Outcome,
    PieceInbox,
    PieceMessage,
    Recorder,
    RequestInbox,
    SnapshotBoard,
)
from controller.ipc.inverter_slot import InverterSlot
from controller.machine.model import Joints, Machine
from controller.state.modes import ALWAYS, BY_HAND, DROPS, Fault, Mode, Request, bars
from controller.state.queue_refusals import QueueRefusal
from controller.tick.check import Check
from controller.tick.coupling import Recorded
from controller.tick.drives import Drives
from controller.tick.follow import Step
from controller.tick.lookahead import STANDING, Conditions, Row
from controller.tick.mode import Phase
from controller.tick.parts import Parts
from controller.tick.status_publisher import StatusPublisher
from controller.tick.stock import DELAY, Stock
from drives.pump.plan_memory import Memory
from drives.pump.plan_memory import Phase as PumpPhase

MAX_REQUESTS: Final = 8  # taken in one tick
# Looked up every tick, and an enum's members are slow to look up.
_RUNNING: Final = Mode.RUNNING
_HOLD: Final = Mode.HOLD
_ENDING: Final = Phase.ENDING
_STEADY: Final = Phase.STEADY
_NONE: Final = Fault.NONE
_TAKEN: Final = QueueRefusal.NONE
_LOST: Final = Step.LOST
_STOP: Final = Step.STOP
_END: Final = Step.END
_SET: Final = Step.SET
_SILENT: Final = PumpPhase.SILENT
_GAP: Final = PumpPhase.GAP
FOLLOWING: Final = (Mode.RUNNING, Mode.HOLD, Mode.STOPPING)  # the path, with its outputs
IDLE: Final = (Mode.OFF, Mode.READY)
MOVING: Final = (Mode.RUNNING, Mode.STOPPING, Mode.JOG)


class Again(NamedTuple):
    """What came from the drives and devices in a tick of a run that is made again."""

    waits: bool = False  # motion waited for spindle, coolant or clamps
    fault: Fault = Fault.NONE  # that came up
    thread: Recorded = Recorded()
    share: float = 1.0  # of the feed, by the load of the spindle
    played: int = 0  # ``PLAYED``, ``BRAKED``: the tick was late, and found its period done
    taken_back: int = 0  # likewise of the tick before, whose plan came too late


class Cycle:
    """The tick. Owns the queue, the clock of the path, the mode; borrows the drives."""

    def __init__(
        self,
        machine: Machine,
        group: Drives,
        pieces: PieceInbox,
        requests: RequestInbox,
        snapshot: SnapshotBoard,
        recorder: Recorder,
        now: Callable[[], float],
        plans: Memory | None = None,
        slot: InverterSlot | None = None,
    ) -> None:
        """``plans``: shared with the pump, which then sends SYNC and setpoints; ``slot``: of an inverter."""
        self.machine = machine
        self.group = group
        parts = Parts(machine, group, now, plans, slot)
        self.modes, self.follow, self.jogging = parts.modes, parts.follow, parts.jogging
        self.coupling, self.peripherals, self.adaptive = parts.coupling, parts.peripherals, parts.adaptive
        self.sync, self.probing, self.answers = parts.sync, parts.probing, parts.answers
        self.limit_switches = parts.limit_switches
        self._encoder, self._check, self.stock = parts.encoder, parts.check, parts.stock
        self._replaced_s = math.inf  # plan time from which on the queue was replaced in this tick
        self._assumed = STANDING  # by what the last tick has published
        self._assumed_before = STANDING  # by what the tick before it has
        self._foreseen = self._foreseen_before = (-1, self.coupling.foreseen)  # likewise, with the tick
        self._arrived = False  # the last step came to a mark, or ended a jog: only a tick goes on from there
        self._began = False  # the pump has had its first plan
        self._moved = -1  # the period whose setpoints were computed last
        self._recorded = -1  # the last period that has its row
        self._played = 0  # ``PLAYED``, ``BRAKED`` of this period
        self._taken_back = 0  # bits of ``switches`` for the next row
        self._braked = False  # in the period before this one, and the stop of it is under way
        self._status = StatusPublisher(self, parts, snapshot, recorder)
        self._masks = range(1, machine.every_axis + 1)  # of axes
        self._homing_asked = 0  # axes (bit mask) whose clamps must open before they home
        self._homing_number = 0  # of that request
        self._pieces = pieces
        self._requests = requests
        self._now = now
        self._silence_ticks = round(PLANNER_SILENCE_S / machine.period_s)
        self._silent = 0  # ticks that were run since the plan was last heard
        self._stood = False  # in this tick the path was stood still after a gap
        self.again: Again | None = None  # of a run that is made again
        self._waits = False  # motion waits for spindle, coolant or clamps in this tick
        self._stood_before = False  # so it was before this tick, in a run that is made again
        self.tick = -1
        self._repeated = 0  # ticks since the last one that was run
        self.accepted = 0  # sequence of the last message taken
        self.rejected = 0
        self.refusal = _TAKEN  # of the last message
        # What is of this tick alone, for ``live_state``.
        self.accepted_now = 0
        self.taken = 0
        self.sync_sent = False
        self.switches = 0

    # -- the tick

    def receive(self, now_s: float) -> None:
        """Drains the buses; shortly before the deadline."""
        self.group.receive(now_s)
        self._encoder.decode(self.group.positions)

    def rehearse(self, now_s: float) -> None:
        """Before the deadline: what ``run`` is about to call and to read, for the caches alone.

        Nothing that anybody sees changes, and nothing of the next tick depends on it.
        """
        self.group.fault(now_s)
        follow = self.follow
        follow.rehearse()
        self._check.judge(follow.joints, follow.last, follow.before)
        self._encoder.rehearse(follow.joints)
        self._switches()
        self._status.rehearse()

    def run(self, now_s: float, lateness_s: float, missed: int = 0) -> bool:
        """One tick: ``lateness_s`` after its deadline, ``missed`` deadlines after the last one.

        True if SYNC went out. All times are of the loop's clock, in seconds.
        """
        ticks = 1 + missed
        self.tick += ticks
        self.sync_sent = sent = self._sync(now_s, lateness_s)
        self.sync.count(sent, ticks, lateness_s, self._stood and not sent)
        self.sync.look_for_our_silence(now_s, missed)
        void = self._take_requests()
        self._take_pieces(void)
        if self._supervise(now_s, ticks + self._repeated) or void:
            self._drop()
        if sent or not self.modes.on_path:
            self._move()
        if sent or self._stood:
            self.group.command(self._encoder.setpoints, now_s)
        self.switches = self._switches()
        self._status.record()
        self._stood_before = False
        self._repeated = 0
        return sent

    def run_with_pump(self, now_s: float) -> bool:
        """One tick where the pump sends: after it has handed a period over. False: it has handed over none.

        Of the periods whose tick has not been run, the path takes what the pump has played meanwhile.
        """
        stock = self.stock
        assert stock is not None
        periods = stock.look()
        if not periods:
            self.receive(now_s)
            return False
        braked, ticks = self.sync.braked, len(periods)
        if self.again is not None and self.again.taken_back:
            self._take_back(self.again.taken_back)
        elif stock.refused and self.modes.on_path and self._moved + DELAY < stock.stood_from:
            self._take_back(self._how(self._moved))
        if ticks > 1:
            self._catch_up(stock, periods[:-1], now_s)
        self.group.receive(now_s, ticks, stock.is_late(now_s))
        self._encoder.decode(self.group.positions)
        stock.account_for(stock.period)
        if self.again is not None and self.again.played:
            self._go_on_as_played(stock.period, self.again.played)
            self._publish(stock, False)
            return True
        self.tick, self.sync_sent = stock.period, stock.phase is not _SILENT
        felt = self.sync.braked != braked
        if felt:
            self.modes.fail(Fault.TICK_LATE, -1)
        sent = self.sync_sent or not self._began
        self.sync.count_with_pump(sent, not stock.unsent, ticks, stock.lateness_s, felt)
        anew = self._look_for_a_gap()
        self._moved = stock.period
        self.sync.look_for_our_silence(now_s, ticks - 1 + round(stock.moved_s / self.machine.period_s))
        void = self._take_requests()
        self._take_pieces(void)
        if self._supervise(now_s, ticks) or void:
            self._drop()
        self._move()
        self._braked = self._braked and (self.follow.stopping or self.jogging.active)
        self._assumed_before, self._assumed = self._assumed, self._look_ahead()
        self._publish(stock, anew)
        self.group.send_events(now_s)
        self._record(stock.period)
        return True

    def _catch_up(self, stock: Stock, periods: Sequence[int], now_s: float) -> None:
        """The periods before the newest one, whose ticks were not run."""
        is_ahead = self.idle and stock.memory.at_once > 1
        for period in periods:
            if not is_ahead and self.group.receive_answers(now_s, 1 + len(periods)):
                self._encoder.decode(self.group.positions)
            stock.account_for(period)
            if period + DELAY < stock.stood_from:
                (self._play_again if is_ahead else self._play)(period)

    def _publish(self, stock: Stock, anew: bool) -> None:
        stock.publish(anew)
        self._foreseen_before = self._foreseen
        self._foreseen = stock.period, self.coupling.foreseen

    def starve(self) -> None:
        """The pump's record stands still: it is dead or held back, and the drives stop by themselves."""
        if self.modes.mode is not Mode.FAULT:
            self.modes.fail(Fault.SYNC_LOST, -1)
            self.modes.quick_stop()
        assert self.stock is not None
        self.group.show(self.stock.memory)
        self.publish()

    def _take_back(self, played: int) -> None:
        """The last step was not sent, though its row says so: the pump has gone on by the plan before.

        ``played``: how, as of ``_how``.
        """
        if self._arrived:
            return
        self._assumed, self._foreseen = self._assumed_before, self._foreseen_before
        mover = self.jogging if self.jogging.active else self.follow
        mover.revert()
        tick, foreseen = self._foreseen
        self.coupling.go_by(foreseen, self._moved - 1 - tick)
        self._taken_back = TAKEN_BACK_BRAKED if played & BRAKED else TAKEN_BACK
        self._play(self._moved, played)

    def _play_again(self, period: int) -> None:
        """A period that was played ahead of its time, since nothing happens (``idle``): as the one before."""
        self.tick = self._moved = period
        self._status.repeat()

    def _how(self, period: int) -> int:
        """``PLAYED``, ``BRAKED``: what the pump has sent instead of the step of this period."""
        stock = self.stock
        assert stock is not None
        sends = period + DELAY
        return PLAYED | BRAKED * (stock.brakes_in(sends) or not stock.is_nominal(sends))

    def _play(self, period: int, played: int = 0) -> None:
        """A period whose tick was not run: the path goes on by the plan that the pump had."""
        stock = self.stock
        assert stock is not None
        braked = stock.brakes_in(period + DELAY)
        self.sync.count_played(braked and not self._braked)
        self._go_on_as_played(period, played or self._how(period))
        self._braked = braked

    def _go_on_as_played(self, period: int, played: int) -> None:
        """One period of the path, in which nothing else happens: by what the plan of it has assumed."""
        stock, modes, braked = self.stock, self.modes, bool(played & BRAKED)
        self._played = played
        assumed, goes = self._assumed, not braked and not self._arrived
        assert stock is not None
        self.tick = self._moved = period
        self.sync_sent = True
        self.accepted_now = self.taken = 0
        self._replaced_s = math.inf
        self._commit(stock.period - period)
        if not modes.on_path:
            stock.moved_otherwise()
        elif assumed.by_hand and self.jogging.active:
            if braked:
                modes.end_jog()
            self._jog(assumed.jog_speed if goes else 0.0)
            self._look_ahead()
        else:
            follow = self.follow
            follow.heed(assumed.optional_stop, assumed.single_block)
            goes = goes and not assumed.by_hand
            feed, rapid = float(assumed.feed), float(assumed.rapid)
            go = goes and follow.goes(assumed.running, feed, rapid)
            self._along_path(go, stock.foreseen(assumed, self._replaced_s) if goes else None)
            self._look_ahead()
        self._commit(0)
        if period > self._recorded:
            self._record(period)
        self._played = 0

    def _commit(self, ticks: int) -> None:
        """So many ticks, from the next step on, have gone out as they were foreseen."""
        self.coupling.go_on(ticks, None if self.again is None else self.again.thread)

    def _record(self, period: int) -> None:
        """The row of a period."""
        self.switches = self._switches()
        self._recorded, self._taken_back = period, 0
        self._status.record()

    def _look_for_a_gap(self) -> bool:
        """Whether the pump has stopped sending, or the motors have stood."""
        stock = self.stock
        assert stock is not None
        self._stood = False
        if stock.phase is _GAP and self.modes.on_path:
            last = stock.stood_from - 1 - DELAY  # the tick whose setpoint went out last
            self._stood = self._stand(max(0, self._moved - last))
            return True
        if stock.phase is _SILENT and self.modes.on_path and self._began:
            self.modes.fail(Fault.STOCK_USED_UP, -1)
        self._began = True
        return stock.phase is _SILENT or stock.phase is _GAP

    def _look_ahead(self) -> Conditions:
        """What the next ticks will send, if what is returned does not change."""
        stock = self.stock
        assert stock is not None
        if not self.modes.on_path:
            stock.moved_otherwise()
            return STANDING
        if self.jogging.active:
            stock.moved_by_hand(self.jogging, bool(self._played))
            return Conditions(jog_speed=self.jogging.speed, by_hand=True)
        found = self._conditions()
        stock.moved(found, self._replaced_s)
        return found

    def _conditions(self) -> Conditions:
        modes, follow = self.modes, self.follow
        going = modes.running and not self._waits and not self._arrived
        feed, rapid = modes.override > 0.0, modes.rapid_override > 0.0
        stops = modes.single_block or modes.phase is _ENDING
        return Conditions(going, feed, rapid, follow.optional_stop, stops)

    def repeat(self, now_s: float) -> None:
        """A tick in which nothing happens (``idle``): what the last one has said and left, again."""
        self.tick += 1
        self._repeated += 1
        before, self.sync_sent = self.sync_sent, self.sync.send(self.tick, now_s, 0.0)
        self.sync.count(self.sync_sent, 1, 0.0, False)
        self.group.command(self._encoder.setpoints, now_s)
        if before and self.sync_sent:
            self._status.repeat()
        else:
            self._status.record()

    def _switches(self) -> int:
        modes, stood = self.modes, self._stood or self._stood_before
        asked = self._played + self._taken_back + modes.switched + EXPIRED * self.jogging.expired
        settled = SETTLED * self.coupling.settled
        return asked + STOOD * stood + WAITED * self._waits + OFF_PATH * (not modes.on_path) + settled

    @property
    def at_rest(self) -> bool:
        """Nothing of ours moves, and nothing is about to."""
        return self.modes.mode not in MOVING and self.follow.at_rest

    @property
    def idle(self) -> bool:
        """It stands, with drives on or off, and nothing was asked of it in the last tick."""
        modes = self.modes
        asked = self.taken or self.accepted_now or self._homing_asked
        return self.at_rest and modes.mode in IDLE and modes.phase is _STEADY and not asked

    # -- its steps

    def _sync(self, now_s: float, lateness_s: float) -> bool:
        """SYNC, unless this tick is too late for one. The drives latch what the last tick sent.

        After a long gap that would be a step: they are told first to stand where they are.
        """
        self._stood = self.sync.is_after_a_gap(self.tick, self._stops_within) and self._stand(1)
        return not self._stood and self.sync.send(self.tick, now_s, lateness_s)

    def _stops_within(self) -> float:
        return self._check.stops_within(self.follow.joints, self.follow.last)

    def stand(self) -> None:
        """For a run that is made again: before its next SYNC there was a long gap."""
        self._stood_before = self._stand(1)
        self.group.command(self._encoder.setpoints, self._now())

    def pass_by(self) -> None:
        """For a run that is made again: a tick that came too late for its SYNC."""
        self.run(self._now(), self.machine.period_s)
        self.sync.pass_over()

    def _stand(self, back: int) -> bool:
        """The drives have stood: so does what they are told, and motion begins again from rest.

        ``back``: they have not used what the last so many ticks have sent. False if nothing moved anyway.
        """
        if not self.modes.on_path:
            return False
        stood = self.jogging.stand(back) if self.jogging.active else self.follow.stand(back)
        if stood:
            self._encoder.encode(self.follow.joints)
        return stood

    def _take_requests(self) -> bool:
        """True where one of them has made void what is queued."""
        self.taken, void = 0, False
        for _ in range(MAX_REQUESTS):
            request = self._requests.take()
            if request is None:
                break
            self.taken = self._requests.number or self.taken
            before = self.modes.mode
            taken = self._request(request[0], request[1])
            void = void or (taken and (before, request[0]) in DROPS)
        if self._homing_asked:
            self._home()
        return void

    def _request(self, request: Request, value: float) -> bool:
        """What a request asks for, and the answer to it; whether it was taken."""
        modes, number = self.modes, self._requests.number
        if self._homing_asked and request not in ALWAYS and request is not Request.JOG:
            self._homing_asked = 0
            self.peripherals.opens_for(0)
            self.answers.give(self._homing_number, Outcome.SUPERSEDED)
        if request is Request.HOME and modes.mode is Mode.OFF and value in self._masks:
            self._homing_asked, self._homing_number = int(value), number
            return False  # answered when it begins
        if request is Request.JOG:
            taken = self.jogging.ask(self._requests.jog)
        elif request is Request.ARRANGED:
            taken = self._arrange(self._requests.arranged)
        else:
            taken = request is not Request.HOME and modes.request(
                request, value, self.follow.at_rest, self.jogging.away
            )
            if taken and request in BY_HAND:
                taken = self.peripherals.by_hand(request, value, modes.mode)
        self._answer(request, number, taken)
        return taken

    def _answer(self, request: Request, number: int, taken: bool) -> None:
        if taken:
            self.answers.give(number, Outcome.DONE)
            return
        why = self.modes.interlock if bars(self.modes.interlock, request) else Fault.NONE
        self.answers.give(number, Outcome.REFUSED, why)

    def _arrange(self, found: Arrangement | None) -> bool:
        """The drives have been commissioned: how long their own stops take, and in what they take speeds."""
        if found is None:
            return False
        self.modes.quick_stop_takes(found.quick_stop_s)
        for drive, units in zip(self.group.drives, found.axis_units, strict=False):
            drive.set_velocity_units(units)
        if self.group.spindle is not None:
            self.group.spindle.set_velocity_units(found.spindle_units)
        return True

    def _home(self) -> None:
        """Homing begins when the clamps of its axes are open, which may take some ticks.

        A machine that came up meanwhile, or has a fault, is answered as the table has it.
        """
        axes, axis = self._homing_asked, -1
        if self.modes.mode is Mode.OFF and not self.peripherals.opens_for(axes):
            axis = self.peripherals.late_to_open()
            if axis < 0:
                return
        self._homing_asked = 0
        if axis >= 0:
            self.modes.fail(Fault.CLAMP, axis)
        taken = axis < 0 and self.modes.request(Request.HOME, axes, self.follow.at_rest)
        if not taken:
            self.peripherals.opens_for(0)
        self._answer(Request.HOME, self._homing_number, taken)

    def _take_pieces(self, void: bool) -> None:
        """At most one message, whole or not at all; and how long the plan has been silent.

        None with what is ``void``: it was made for a queue that is given up in this tick.
        Ticks that were missed do not count: what kept this process waiting kept the plan, too.
        """
        self.accepted_now, self._replaced_s = 0, math.inf
        message = self._pieces.take()
        self._silent = 0 if self._pieces.was_heard() else self._silent + 1
        if message is None:
            return
        self.refusal = self._refusal(message, void)
        if self.refusal is _TAKEN:
            self._replaced_s = -math.inf if message.alone else message.replace_from_s
            self.accepted = self.accepted_now = message.sequence
            if self.jogging.away and self.follow.begins_here(message):
                self.jogging.forget_hold()
        else:
            self.rejected = message.sequence
            self.accepted_now = -message.sequence

    def _refusal(self, message: PieceMessage, void: bool) -> QueueRefusal:
        """Why a message is not taken; NONE: it has been."""
        if message.sequence <= self.accepted:
            return QueueRefusal.OLD
        if void:
            return QueueRefusal.VOID
        if not self.modes.takes_pieces:
            return QueueRefusal.MODE
        self.follow.accept(message)
        return self.follow.refusal

    def _planner_gone(self) -> bool:
        return self._pieces.closed or self._silent > self._silence_ticks

    def _look_for_the_plan(self, standing: bool) -> None:
        """What is queued ends at rest: only there a plan that is gone is a fault."""
        mode = self.modes.mode
        gone = mode is _RUNNING and self._planner_gone()
        lost = self.modes.plan_lost and mode in (_RUNNING, _HOLD)
        if (gone or lost) and standing and not (self.follow.pending or self.follow.stopping):
            self.modes.fail(Fault.PLANNER_GONE, -1)

    def _supervise(self, now_s: float, ticks: int) -> bool:
        """Faults, and what follows by itself; True where what is queued is void with it."""
        standing = self.follow.at_rest
        self._look_for_the_plan(standing)
        if self.again is None:
            self.modes.watch(now_s)
        elif self.again.fault is not Fault.NONE:
            self.modes.fail(self.again.fault, -1)
        if self.peripherals.present:
            own = self.follow.own_feed  # M49 takes all overrides
            share = 1.0 if own else self.modes.spindle_override
            self.peripherals.watch(now_s, self.modes, self._encoder.actual, standing, ticks, share)
        if self.limit_switches.present and self.again is None:
            inputs, new, last = self.peripherals.inputs, self.follow.joints, self.follow.last
            self.limit_switches.watch(inputs, self.modes, new, last, self._encoder.actual, ticks)
        if self.adaptive.present:
            self._adapt(ticks)
        if self.probing.present:
            self.probing.watch()
        if self.sync.is_unheard and self.modes.on_path:
            # A path that no drive hears of has no end: the drives stop by their own supervision.
            self.modes.fail(Fault.SEND_FAILED, -1)
            self.modes.quick_stop()
        if self.jogging.active:
            self.jogging.watch(ticks, self._planner_gone())
        return self.modes.progress(ticks, standing)

    def _adapt(self, ticks: int) -> None:
        """How much of its feed the cut is left."""
        if self.again is None:
            turns = self.peripherals.rev_min != 0.0 and self.peripherals.at_speed
            self.adaptive.watch(self.modes, self.follow, turns, ticks)
        else:
            self.adaptive.take(self.modes, self.follow, self.again.share)

    def _drop(self) -> None:
        self.follow.clear()
        self.jogging.forget_hold()

    def _move(self) -> None:
        """The joints of the next SYNC: along the plan, or where the drives are."""
        self._waits = False
        if not self.modes.on_path:
            self.jogging.give_up()
            self.follow.set_joints(self._where_the_drives_are())
            self._encoder.encode(self.follow.joints)
            return
        if self.jogging.active:
            self._jog()
            return
        modes, follow = self.modes, self.follow
        follow.heed(modes.optional_stop, modes.single_block or modes.phase is _ENDING)
        running = modes.mode is _RUNNING
        self._waits = running and self._must_wait()
        self._commit(0)
        running = running and not self._waits
        go, foreseen = follow.goes(running, modes.override, modes.rapid_override), None
        if self.stock is not None and not self._arrived:
            foreseen = self.stock.foreseen(self._conditions(), self._replaced_s)
        self._along_path(go, foreseen)

    def _along_path(self, go: bool, foreseen: Row | None) -> None:
        """One step of the path, and what comes of it; one that is ``foreseen`` was judged then."""
        modes, follow = self.modes, self.follow
        step = follow.step(go, foreseen)
        self._arrived = step is _STOP or step is _END or step is _SET
        piece = follow.piece
        if piece is not None and not piece.sets and modes.mode in FOLLOWING:
            self.peripherals.switch(piece.outputs)
        fault, axis = _NONE, -1
        if foreseen is not None and foreseen.joints is follow.joints and self._encoder.plain:
            self._encoder.take(foreseen.joints, foreseen.counts)
        else:
            fault, axis = self._judge(step, self._check)
        self.peripherals.lead_spindle()
        if fault is not _NONE:
            self._refuse(fault, axis, step)
        elif step is _STOP and modes.running:
            modes.path_stops()
        elif step is _END and modes.running:
            modes.path_ends()
        elif step is _SET and follow.setting is not None:
            self.peripherals.tell(follow.setting)
            if follow.setting.senses is not None:
                self.probing.tell(follow.setting.senses)

    def _must_wait(self) -> bool:
        if self.again is not None:
            return self.again.waits
        peripherals = self.peripherals
        stopped = peripherals.feed_stopped and self.follow.heeds_stop
        apart = self.stock is not None and self.stock.is_apart
        return peripherals.waiting or self.probing.holds or stopped or apart

    def _jog(self, played: float | None = None) -> None:
        """A step by hand; it cannot fail but by an error of ours, and then no path is left.

        ``played``: see ``Jogging.step``.
        """
        jogging = self.jogging
        apart = self.stock is not None and self.stock.is_apart
        is_open = played is None and not apart and self.modes.mode is Mode.JOG and self._opens(jogging.axes)
        fault, axis = self._judge(jogging.step(is_open, played), jogging.check)
        self._arrived = not jogging.active
        if fault is not Fault.NONE:
            self.modes.fail(fault, axis)
            self.follow.revert()
            self.modes.quick_stop()

    def _opens(self, axes: int) -> bool:
        """Whether no clamp holds these axes; one that does not open in time is a fault."""
        if self.peripherals.opens_for(axes):
            return True
        late = self.peripherals.late_to_open()
        if late >= 0:
            self.modes.fail(Fault.CLAMP, late)
        return False

    def _judge(self, step: Step, check: Check) -> tuple[Fault, int]:
        """Checks the step and encodes it; a setpoint that fails stays the last good one."""
        if step is _LOST:
            return Fault.BRANCH_LOST, -1
        follow = self.follow
        fault, axis = check.judge(follow.joints, follow.last, follow.before)
        if fault is _NONE and not self._encoder.encode(follow.joints):
            return Fault.TRAVEL, -1
        return fault, axis

    def _refuse(self, fault: Fault, axis: int, step: Step) -> None:
        """Stop on the path instead; if even that cannot be sent, the drives stop by themselves."""
        self.modes.fail(fault, axis)
        if step is not Step.LOST:
            self.follow.revert()
        again = self.follow.step(False)
        if self._judge(again, self._check)[0] is not Fault.NONE:
            if again is not Step.LOST:
                self.follow.revert()
            self.modes.quick_stop()

    def _where_the_drives_are(self) -> Joints:
        """Actual positions; a drive that already follows keeps its setpoint, or it would chase its lag."""
        rows = zip(self.group.drives, self.follow.joints, self._encoder.actual, strict=True)
        return tuple([told if drive.following else actual for drive, told, actual in rows])

    def publish(self) -> None:
        """What others see of it, where no tick was run."""
        self._status.publish()

    def show_life(self) -> None:
        """Likewise, in place of a tick: it lives."""
        self.tick += 1
        self.publish()
