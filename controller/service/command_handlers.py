"""The verbs of the door: what an operator asks for, refused in a sentence or done.

What must not wait (hold, stop, e-stop, overrides, jog) is a datagram that leaves here and
now, in the door's thread; what takes long goes to the sequencer.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from controller.geometry.vectors import Frame
from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.messages import Key
from controller.plan.retract import RETRACT_MM_S
from controller.service import (
    diagnostics,
    fitting,
    jobs,
    node_status,
    preconditions,
    restart_preview,
    runs,
    sequences,
    tool_places,
    usage,
    whole_status,
)
from controller.service.acknowledged import Acknowledged, refusal
from controller.service.jobs import Job
from controller.service.jogging import ENDS, Jogging, Presses
from controller.service.refusals import by_fault, number, refused, switch, whole
from controller.service.sequencer import Going
from controller.service.service import Service
from controller.service.thread_guard import way_out
from controller.state.modes import MOVES, Mode, Request, bars
from controller.tick.mode import MAX_OVERRIDE, SPINDLE_OVERRIDES

MAX_DISTANCE = 1e5  # mm or degrees of one step; the travel is the tick's own limit
MAX_WITHDRAW_MM = 500.0
MAX_MDI = 10_000  # characters
LOAD = "load"


class Desk:
    """Call it with a verb and its arguments."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._jogging, self._presses = Jogging(), Presses()
        self._answers = Acknowledged(service.machine, lambda: service.engine)
        self._errands = ThreadPoolExecutor(2, "errands")  # what waits for a disk
        self._loading = Going()  # the last program that is loaded or let go of: only that counts
        self._verbs: dict[str, Callable[[Values], Answer]] = {
            "status": lambda _: whole_status.status(service),
            "facts": lambda _: whole_status.facts(service),
            "restart": lambda _: self._errands.submit(restart_preview.restart, self._service),
            "load": self._load,
            "unload": self._unload,
            "start": self._start,
            "hold": self._hold,
            "resume": self._resume,
            "stop": self._stop,
            "estop": self._estop,
            "single_block": lambda args: self._switch(Request.SINGLE_BLOCK, args),
            "optional_stop": lambda args: self._switch(Request.OPTIONAL_STOP, args),
            "adaptive_feed": self._adaptive_feed,
            "override": lambda args: self._override(Request.OVERRIDE, args),
            "rapid_override": lambda args: self._override(Request.RAPID_OVERRIDE, args),
            "spindle_override": self._spindle_override,
            "spindle": self._spindle,
            "coolant": self._coolant,
            "clamps": self._clamps,
            "enable": self._enable,
            "disable": self._disable,
            "home": self._home,
            "reset": self._reset,
            "mdi": self._mdi,
            "probe": self._probe,
            "probed": lambda _: {"found": service.probed.told()},
            "retract": self._retract,
            "withdraw": self._withdraw,
            "return": lambda _: self._aside("return"),
            "jog": self._jog,
            "jog_step": self._jog_step,
            "jog_stop": lambda _: self._ask(Request.JOG_STOP),
            "set_offset": lambda args: self._errands.submit(fitting.set_offset, service, args),
            "set_tool": lambda args: self._errands.submit(fitting.set_tool, service, args),
            "forget": lambda args: self._errands.submit(fitting.forget, service, args),
            "drives": self._drives,
            "alarms": lambda _: {"alarms": self._service.alarms.list()},
            "acknowledge": lambda args: self._errands.submit(self._acknowledge, args),
            "runs": lambda _: self._errands.submit(lambda: {"runs": runs.list_runs(self._service.state)}),
            "rows": lambda args: self._errands.submit(diagnostics.rows, self._service.engine.recorder, args),
            "buses": lambda _: self._errands.submit(self._buses),
            "usage": lambda _: self._errands.submit(service.usage.told),
            "tool_life": lambda args: self._errands.submit(usage.tool_life, service.usage, args),
            "tool_renewed": lambda args: self._errands.submit(usage.tool_renewed, service.usage, args),
            "maintenance": lambda args: self._errands.submit(usage.maintenance, service.usage, args),
            "changer": lambda _: self._errands.submit(tool_places.told, service),
            "changer_confirm": lambda args: self._errands.submit(tool_places.confirm, service, args),
            "changer_pocket": lambda args: self._errands.submit(tool_places.give_pocket, service, args),
            "maintained": lambda args: self._errands.submit(usage.maintained, service.usage, args),
        }

    def __call__(self, verb: str, args: Values) -> Answer:
        """The result, or a future of it. Raises CommandRefused."""
        act = self._verbs.get(verb)
        if act is None:
            raise refused("no_verb", code="bad", verb=verb, allowed=", ".join(self._verbs))
        if verb in ENDS:  # before it is asked whether the mode takes it: a press may just begin
            self._presses.end(str(args.get("press", "")))
        return act(args)

    def close(self) -> None:
        """Nobody asks any more; what waits for a disk is done first."""
        self._answers.close()
        self._errands.shutdown(wait=True)

    # -- looking

    def _drives(self, _: Values) -> Values:
        service = self._service
        now = service.now()
        return {"drives": node_status.drives(service.machine, now, service.logs, service.homing)}

    def _buses(self) -> Values:
        service = self._service
        return diagnostics.buses(service.machine, service.logs, service.engine.recorder)

    def _acknowledge(self, args: Values) -> Values:
        return {"acknowledged": self._service.alarms.acknowledge(whole(args, "id"))}

    # -- at once

    def _ask(
        self, request: Request, value: float = 0.0, instead: Values | None = None, **told: Any
    ) -> Answer:
        """A datagram to the tick, and what it answers; see ``Acknowledged``. Raises CommandRefused."""
        now = self._service.now()
        if request in MOVES:
            preconditions.tick_goes_on(self._service, now, request.name)
        return self._answers.of(self._service.engine.request(request, value), request, told, instead)

    def _permitted(self, request: Request) -> Snapshot:
        """The newest snapshot. Raises CommandRefused where it refuses the request."""
        now = self._service.now()
        preconditions.tick_goes_on(self._service, now, request.name)
        if why := refusal(self._service.machine, now, request):
            raise CommandRefused("refused", why, now.mode.name, request.name)
        return now

    def _jog(self, args: Values) -> Answer:
        """Dead-man: without the next one within 200 ms the axes come to rest."""
        share = number(args, "speed", -1.0, 1.0)
        if share == 0.0:
            return self._ask(Request.JOG_STOP)
        preconditions.not_in_thread(self._service, "JOG")
        now, part = self._permitted(Request.JOG), self._part()
        service, frame, axis = self._service, str(args.get("frame", "joint")), str(args.get("axis", ""))
        line = self._jogging.continuous(service.machine, now, part, frame, axis, share)
        if not self._presses.may_move(str(args.get("press", ""))):
            raise refused("press_ended", now.mode.name, "JOG")
        return self._answers.of(service.engine.jog(line), Request.JOG, {})

    def _jog_step(self, args: Values) -> Answer:
        distance = number(args, "distance", -MAX_DISTANCE, MAX_DISTANCE)
        preconditions.not_in_thread(self._service, "JOG")
        now, part = self._permitted(Request.JOG), self._part()
        service, frame, axis = self._service, str(args.get("frame", "joint")), str(args.get("axis", ""))
        line = self._jogging.step(service.machine, now, part, frame, axis, distance)
        return self._answers.of(service.engine.jog(line), Request.JOG, {})

    def _part(self) -> Frame:
        """The frame of the program's positions that is active."""
        service = self._service
        found = service.engine.snapshot()
        if found is None:
            return service.machine.part()
        return service.in_force(found).modal.frame(service.machine)

    def _hold(self, _: Values) -> Answer:
        """Also of what is only being prepared: it does not go out, which is what was asked for."""
        sequencer = self._service.sequencer
        given_up = "" if sequencer.busy == "home" else sequencer.give_up()  # drives home by themselves
        changer = self._service.changer
        if changer is not None and changer.under_way:  # maybe between two steps, where the tick holds already
            changer.hold()
            given_up = given_up or "change"
        return self._ask(Request.HOLD, instead=_given_up(given_up))

    def _stop(self, _: Values) -> Answer:
        """Also of what is only being prepared: a check, a start, the next axes that home."""
        if given_up := self._service.sequencer.give_up():
            self._plan_gives_up()
        return self._ask(Request.STOP, instead=_given_up(given_up or self._no_load()))

    def _no_load(self) -> str:
        """Whoever stops, unloads or loads something else has no use for a check that goes on; its verb."""
        self._loading.give_up()
        if self._service.sequencer.busy != LOAD:
            return ""
        self._plan_gives_up()
        return LOAD

    def _plan_gives_up(self) -> None:
        with contextlib.suppress(CommandRefused):  # a plan that is gone has given it up
            self._service.engine.line.give_up()

    def _estop(self, _: Values) -> Answer:
        self._service.sequencer.give_up()
        return self._ask(Request.ESTOP)

    def _resume(self, _: Values) -> Answer:
        """Along the program only from where it was held: off it the tool must return first."""
        service = self._service
        if not service.sequencer.busy and (why := service.no_resume):
            raise refused("refused", service.now().mode.name, "RESUME", why=Key(why))
        if service.changer is None:
            return self._ask(Request.RESUME)
        service.changer.resume(self._permitted(Request.RESUME))  # it alone lets the tick go on
        return {}

    def _switch(self, request: Request, args: Values) -> Answer:
        on = switch(args, "on")
        return self._ask(request, float(on), on=on)

    def _adaptive_feed(self, args: Values) -> Answer:
        """Raises CommandRefused where the machine file has no law for it."""
        spindle = self._service.machine.spindle
        if spindle is None or spindle.adaptive is None:
            raise refused("no_adaptive", code="bad")
        return self._switch(Request.ADAPTIVE_FEED, args)

    def _override(self, request: Request, args: Values) -> Answer:
        share = number(args, "share", 0.0, MAX_OVERRIDE)
        return self._ask(request, share, share=share)

    def _spindle_override(self, args: Values) -> Answer:
        share = number(args, "share", *SPINDLE_OVERRIDES)
        return self._ask(Request.SPINDLE_OVERRIDE, share, share=share)

    # -- spindle, coolant and clamps by hand

    def _spindle(self, args: Values) -> Answer:
        """Signed; 0 = off. Raises CommandRefused."""
        spindle = self._service.machine.spindle
        if spindle is None or not spindle.is_driven:
            raise refused("no_spindle", code="bad")
        preconditions.changer_is_sure(self._service, "SPINDLE")
        rev_min = number(args, "rev_min", -spindle.max_rev_min, spindle.max_rev_min)
        if rev_min and not self._service.machine.may_turn(self._service.tool):
            raise refused("spindle_must_stand", tool=self._service.tool)
        self._permitted(Request.SPINDLE)
        return self._ask(Request.SPINDLE, rev_min, rev_min=rev_min)

    def _coolant(self, args: Values) -> Answer:
        """Raises CommandRefused."""
        outputs = dict(self._service.machine.io.outputs) if self._service.machine.io else {}
        wanted = 0
        for bit, (kind, output) in enumerate((("mist", "mist"), ("flood", "coolant"))):
            if switch(args, kind):
                if output not in outputs:
                    raise refused("no_output", code="bad", name=output)
                wanted |= 1 << bit
        self._permitted(Request.COOLANT)
        return self._ask(Request.COOLANT, float(wanted), mist=bool(wanted & 1), flood=bool(wanted & 2))

    def _clamps(self, args: Values) -> Answer:
        """``open``: names of the axes whose clamps are open, and of no other ones. Raises CommandRefused."""
        clamped = [axis.name for axis in self._service.machine.axes if axis.clamp is not None]
        names, wanted = args.get("open"), 0
        for name in names if isinstance(names, list) else []:
            if name not in clamped:
                raise refused("no_clamp", code="bad", axis=name, allowed=", ".join(clamped) or "–")
            wanted |= 1 << [axis.name for axis in self._service.machine.axes].index(name)
        self._permitted(Request.CLAMPS)
        return self._ask(Request.CLAMPS, float(wanted), open=names)

    def _disable(self, _: Values) -> Answer:
        self._service.sequencer.give_up()
        return self._ask(Request.DISABLE)

    # -- what takes long

    def _sequence(
        self, name: str, work: Callable[[], Values], going: Going | None = None, behind: str = ""
    ) -> Answer:
        found = self._service.engine.snapshot()
        mode = found.mode.name if found is not None else "OFF"
        return self._service.sequencer.do(name, work, mode, going, behind)

    def _enable(self, _: Values) -> Answer:
        now = self._service.now()
        if now.mode is Mode.READY:
            return {"done": True, "mode": now.mode.name}
        self._permitted(Request.ENABLE)
        return self._sequence("enable", lambda: sequences.enable(self._service))

    def _home(self, args: Values) -> Answer:
        service = self._service
        now = service.now()
        axes = _axis_numbers(service.machine, args.get("axes"), now.mode)
        preconditions.tick_goes_on(service, now, "HOME")
        if now.mode is not Mode.READY:  # there the drives are switched off first
            self._permitted(Request.HOME)
        preconditions.not_running(self._service, "HOME")
        preconditions.not_in_thread(self._service, "HOME")
        preconditions.changer_is_sure(self._service, "HOME")
        going = Going()
        return self._sequence("home", lambda: sequences.home(service, axes, going), going)

    def _reset(self, _: Values) -> Answer:
        service = self._service
        now = service.engine.snapshot()
        if (
            service.engine.tick_alive
            and now is not None
            and now.mode is not Mode.FAULT
            and not service.stands(now)
            and service.commissioned
        ):
            raise refused("no_fault", now.mode.name, "RESET")
        return self._sequence("reset", lambda: sequences.reset(service))

    def _load(self, args: Values) -> Answer:
        service = self._service
        preconditions.not_running(self._service, "LOAD")
        given_up = self._no_load()
        self._loading = going = Going()

        def work() -> Values:
            if going.given_up:
                raise refused("given_up", verb=LOAD)
            if args.get("restart") is True:
                job = restart_preview.gone_on_with(service, args)
            else:
                job = jobs.read(args, service.machine)
            job.program = replace(job.program, begin=service.begins_with(job, service.now()))
            service.job, service.interrupted = job, None
            try:
                return sequences.load(service, job)
            except CommandRefused as error:
                job.state, job.said = "refused", error.said
                raise

        return self._sequence(LOAD, work, behind=given_up)

    def _unload(self, _: Values) -> Answer:
        """A check of it that is under way is given up, and has come to its end with the answer."""
        preconditions.not_running(self._service, "UNLOAD")

        def work() -> Values:
            self._service.job = self._service.interrupted = None
            return {}

        given_up = self._no_load()
        return self._sequence("unload", work, behind=given_up) if given_up else work()

    def _start(self, args: Values) -> Answer:
        service = self._service
        now = service.now()
        job = service.job
        if now.mode is Mode.HOLD:
            return self._resume({})
        if job is None:
            raise refused("not_loaded", now.mode.name, "START")
        if job.state == "loading":
            raise refused("still_loading", now.mode.name, "START", program=job.program.name)
        if job.state == "refused":
            why = job.said
            raise refused("not_ready", now.mode.name, "START", program=job.program.name, why=why)
        self._permitted(Request.START)
        preconditions.not_in_thread(self._service, "START")
        if args.get("worn") is not True:
            usage.check_worn(service.usage, service.tool, job.program.name, service.tool_numbers)
        return self._begin("start", job, args.get("unrecorded") is True)

    def _begin(self, name: str, job: Job, unrecorded: bool = False) -> Answer:
        service = self._service
        self._permitted(Request.START)
        preconditions.not_running(self._service, name.upper())
        preconditions.changer_is_sure(self._service, name.upper())
        going = Going()
        return self._sequence(name, lambda: sequences.start(service, job, going, unrecorded), going)

    def _mdi(self, args: Values) -> Answer:
        text = args.get("text")
        if not isinstance(text, str) or not text.strip() or len(text) > MAX_MDI:
            raise refused("no_text", code="bad", most=MAX_MDI)
        preconditions.not_in_thread(self._service, "MDI")
        return self._begin("mdi", jobs.mdi(text, self._service.machine))

    def _probe(self, args: Values) -> Answer:
        """A probing cycle, from where the probe stands."""
        preconditions.not_in_thread(self._service, "PROBE")
        return self._begin("probe", jobs.probing(args, self._service.machine, self._service.tool))

    def _retract(self, args: Values) -> Answer:
        """Off along the tool axis: out of a held program, or from READY, as after a fault."""
        service, now, mm = self._service, self._service.now(), number(args, "mm", 0.0, MAX_DISTANCE)
        preconditions.not_in_thread(self._service, "RETRACT")
        preconditions.changer_is_sure(self._service, "RETRACT")
        if now.mode not in (Mode.HOLD, Mode.READY) or not now.at_rest:
            raise refused("not_retracted", now.mode.name, "RETRACT")
        room_mm = whole_status.retract_room_mm(service, now)
        if room_mm is not None and not 0.0 < mm <= room_mm:
            raise refused("retract_room", now.mode.name, "RETRACT", mm=mm, room=room_mm)
        if now.mode is Mode.HOLD:
            return self._aside("retract", mm)
        preconditions.not_running(self._service, "RETRACT")
        self._permitted(Request.JOG)
        line = self._jogging.step(service.machine, now, self._part(), "tool", "Z", mm)
        line, going = line._replace(speed=min(line.speed, RETRACT_MM_S)), Going()
        return self._sequence("retract", lambda: sequences.retract(service, line, going), going)

    def _withdraw(self, args: Values) -> Answer:
        """Out of a thread along it, by what is known of it or ``mm``; or it ``is_out`` already, by hand."""
        service, now = self._service, self._service.now()
        found = service.thread.found
        if found is None:
            raise refused("not_in_thread", now.mode.name, "WITHDRAW")
        if args.get("is_out") is True:
            preconditions.not_running(self._service, "WITHDRAW")
            service.thread.is_out()
            return {}
        mm = None if args.get("mm") is None else number(args, "mm", 0.1, MAX_WITHDRAW_MM)
        if found.pitch_mm == 0.0:
            raise refused("thread_unknown", now.mode.name, "WITHDRAW")
        return self._begin("withdraw", jobs.own(way_out(service.machine, found, mm), service.machine))

    def _aside(self, verb: str, distance_mm: float = 0.0) -> Answer:
        service, now = self._service, self._service.now()
        if now.mode is not Mode.HOLD or not now.at_rest:
            raise refused("not_held", now.mode.name, verb.upper())
        if bars(now.interlock, Request.RESUME):
            raise by_fault(now.interlock, now.mode.name, verb.upper())
        going = Going()
        return self._sequence(verb, lambda: sequences.aside(service, verb, distance_mm, going), going)


def _given_up(name: str) -> Values | None:
    """What a hold or stop has done of which the tick itself had nothing to do; None: nothing."""
    return {"outcome": "given_up", "what": name} if name else None


def _axis_numbers(machine: Machine, names: object, mode: Mode) -> tuple[int, ...]:
    """Numbers of axes by their names, all of them for None. Raises CommandRefused."""
    known = [axis.name for axis in machine.axes]
    if names is None:
        return tuple(range(len(known)))
    if not isinstance(names, list) or not names or not all(name in known for name in names):
        raise refused("no_axes", mode.name, "HOME", "bad", axes=repr(names), allowed=" ".join(known))
    return tuple(sorted({known.index(name) for name in names}))
