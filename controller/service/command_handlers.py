"""The verbs of the door: what an operator asks for, refused in a sentence or done.

What must not wait (hold, stop, e-stop, overrides, jog) is a datagram that leaves here and
now, in the door's thread; what takes long goes to the sequencer.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

from controller.geometry.vectors import Frame
from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.ipc.handoff import Snapshot, blank
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.messages import Key, said
from controller.plan.retract import RETRACT_MM_S
from controller.service import (
    diagnostics,
    jobs,
    node_status,
    restart_preview,
    runs,
    sequences,
    status,
    tool_store,
    wear,
)
from controller.service.acknowledged import Acknowledged, refusal
from controller.service.jobs import Job
from controller.service.jogging import ENDS, Jogging, Presses
from controller.service.refusals import by_fault, number, refused, whole
from controller.service.sequencer import Going
from controller.service.service import Service
from controller.service.thread_guard import way_out
from controller.service.tool_changer import ToolChanger
from controller.state.modes import Mode, Request, bars
from controller.tick.mode import MAX_OVERRIDE, SPINDLE_OVERRIDES

MAX_DISTANCE = 1e5  # mm or degrees of one step; the travel is the tick's own limit
MAX_WITHDRAW_MM = 500.0
MAX_MDI = 10_000  # characters
AT_REST = (Mode.OFF, Mode.READY, Mode.FAULT)


class Desk:
    """Call it with a verb and its arguments."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._jogging, self._presses = Jogging(), Presses()
        self._answers = Acknowledged(service.machine, lambda: service.engine)
        self._errands = ThreadPoolExecutor(2, "errands")  # what waits for a disk
        self._verbs: dict[str, Callable[[Values], Answer]] = {
            "status": self._status,
            "facts": self._facts,
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
            "retract": self._retract,
            "withdraw": self._withdraw,
            "return": lambda _: self._aside("return"),
            "jog": self._jog,
            "jog_step": self._jog_step,
            "jog_stop": lambda _: self._ask(Request.JOG_STOP),
            "set_offset": lambda args: self._errands.submit(self._set_offset, args),
            "set_tool": lambda args: self._errands.submit(self._set_tool, args),
            "forget": lambda args: self._errands.submit(self._forget, args),
            "drives": self._drives,
            "alarms": lambda _: {"alarms": self._service.alarms.list()},
            "acknowledge": lambda args: self._errands.submit(self._acknowledge, args),
            "runs": lambda _: self._errands.submit(lambda: {"runs": runs.list_runs(self._service.state)}),
            "rows": lambda args: self._errands.submit(diagnostics.rows, self._service.engine.recorder, args),
            "buses": lambda _: self._errands.submit(self._buses),
            "usage": lambda _: self._errands.submit(service.usage.told),
            "tool_life": lambda args: self._errands.submit(wear.tool_life, service.usage, args),
            "tool_renewed": lambda args: self._errands.submit(wear.tool_renewed, service.usage, args),
            "maintenance": lambda args: self._errands.submit(wear.maintenance, service.usage, args),
            "changer": lambda _: self._errands.submit(self._changer),
            "changer_confirm": lambda args: self._errands.submit(self._changer_confirm, args),
            "changer_pocket": lambda args: self._errands.submit(self._changer_pocket, args),
            "maintained": lambda args: self._errands.submit(wear.maintained, service.usage, args),
        }

    def __call__(self, verb: str, args: Values) -> Answer:
        """The result, or a future of it. Raises CommandRefused."""
        act = self._verbs.get(verb)
        if act is None:
            raise refused("no_verb", code="bad", verb=verb, allowed=", ".join(self._verbs))
        if verb in ENDS:  # before it is asked whether the mode takes it: a press may just begin
            self._presses.end(str(args.get("press", "")))
        return act(args)

    # -- looking

    def _status(self, _: Values) -> Values:
        service = self._service
        alive, found = service.engine.tick_alive, service.engine.snapshot()
        sequence = service.sequencer.now
        kept = {
            "fault": service.fault_at(found, alive),
            "sequence": sequence.to_dict() if sequence is not None else None,
            "tick_alive": alive,
            "plan_alive": service.engine.plan_alive,
            "commissioned": service.commissioned,
        }
        if found is None or found.tick < 0:
            return {**status.not_begun(self._told(blank(len(service.machine.axes)))), **kept}
        if not alive:
            return {**status.unseen(self._told(status.ended(found))), **kept}
        return {**self._told(found), **kept}

    def _with_notices(self, told: Values) -> Values:
        """That the tool stands in a thread and no program turns it; that nobody knows where the changer's
        tools are; that the run, or the last, has no record.

        An alarm tells of the record, too: but where the disk is full, nobody can keep that either.
        """
        notices, found = told["notices"], self._service.thread.found
        if found is not None and self._service.running is None:
            values = {"depth": found.depth_mm, "pitch": found.pitch_mm, "line": found.line}
            notices = [*notices, {"name": "IN_THREAD", **said("in_thread", **values)}]
        changer = self._service.changer
        if changer is not None and (doubt := changer.doubt) is not None:
            notices = [*notices, {"name": "CHANGER_IN_DOUBT", **doubt}]
        if self._service.unrecorded is not None:
            notices = [*notices, {"name": "NOT_RECORDED", **self._service.unrecorded}]
        return {**told, "notices": notices}

    def _told(self, now: Snapshot) -> Values:
        """What a snapshot tells, with the job and the motion under way."""
        service = self._service
        job = service.running or service.job
        way = job.way(now.motion_id) if job is not None and job.active else None
        asked = job.asked_tool(now, service.tool) if job is not None else None
        age_s = service.pulse.age_s(now.tick)
        ends_s = service.last_second.left_s
        values = status.machine_values(service.machine, now, way, service.tool, age_s, ends_s)
        return {
            "time_s": now.tick * service.machine.period_s,
            **self._with_notices(values),
            "aside": service.aside,
            "retract_room_mm": self._retract_room_mm(now),
            "tool": service.tool or None,
            **({"in_block": _last_block(job)} if job is not None and not job.active else {}),
            "tool_change": status.tool_change(service.machine, asked, service.usage) if asked else None,
            "changer": service.changer.told() if service.changer is not None else None,
            "control": None,
            "job": job.to_dict(now) if job is not None else None,
            "drives": node_status.drives(service.machine, now, service.logs, service.homing),
            "jogging": now.mode is Mode.JOG,
        }

    def _facts(self, _: Values) -> Values:
        service = self._service
        return {
            **status.facts(service.engine.machine, setup_data.told(service.machine, service.fitted)),
            "state": str(service.state),
            "pids": service.engine.pids,
        }

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
        self._service.now()
        return self._answers.of(self._service.engine.request(request, value), request, told, instead)

    def _permitted(self, request: Request) -> Snapshot:
        """The newest snapshot. Raises CommandRefused where it refuses the request."""
        now = self._service.now()
        if why := refusal(self._service.machine, now, request):
            raise CommandRefused("refused", why, now.mode.name, request.name)
        return now

    def _jog(self, args: Values) -> Answer:
        """Dead-man: without the next one within 200 ms the axes come to rest."""
        share = number(args, "speed", -1.0, 1.0)
        if share == 0.0:
            return self._ask(Request.JOG_STOP)
        self._not_in_thread("JOG")
        now, part = self._permitted(Request.JOG), self._part()
        service, frame, axis = self._service, str(args.get("frame", "joint")), str(args.get("axis", ""))
        line = self._jogging.continuous(service.machine, now, part, frame, axis, share)
        if not self._presses.may_move(str(args.get("press", ""))):
            raise refused("press_ended", now.mode.name, "JOG")
        return self._answers.of(service.engine.jog(line), Request.JOG, {})

    def _jog_step(self, args: Values) -> Answer:
        distance = number(args, "distance", -MAX_DISTANCE, MAX_DISTANCE)
        self._not_in_thread("JOG")
        now, part = self._permitted(Request.JOG), self._part()
        service, frame, axis = self._service, str(args.get("frame", "joint")), str(args.get("axis", ""))
        line = self._jogging.step(service.machine, now, part, frame, axis, distance)
        return self._answers.of(service.engine.jog(line), Request.JOG, {})

    def _part(self) -> Frame:
        """The work offset that is active: of the motion that is held, else G54."""
        service = self._service
        found = service.engine.snapshot()
        way = service.running.way(found.motion_id) if service.running is not None and found else None
        if way is None:
            return service.machine.part()
        return way.part if way.part is not None else service.machine.offset(way.offset).frame

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
        service = self._service
        loads = "load" if service.sequencer.busy == "load" else ""
        if given_up := service.sequencer.give_up() or loads:
            with contextlib.suppress(CommandRefused):  # a plan that is gone has given it up
                service.engine.line.give_up()
        return self._ask(Request.STOP, instead=_given_up(given_up))

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
        on = self._on(args, "on")
        return self._ask(request, float(on), on=on)

    @staticmethod
    def _on(args: Values, name: str) -> bool:
        on = args.get(name)
        if not isinstance(on, bool):
            raise refused("not_switch", code="bad", name=name, value=on)
        return on

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
        self._changer_is_sure("SPINDLE")
        rev_min = number(args, "rev_min", -spindle.max_rev_min, spindle.max_rev_min)
        self._permitted(Request.SPINDLE)
        return self._ask(Request.SPINDLE, rev_min, rev_min=rev_min)

    def _coolant(self, args: Values) -> Answer:
        """Raises CommandRefused."""
        outputs = dict(self._service.machine.io.outputs) if self._service.machine.io else {}
        wanted = 0
        for bit, (kind, output) in enumerate((("mist", "mist"), ("flood", "coolant"))):
            if self._on(args, kind):
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

    def _sequence(self, name: str, work: Callable[[], Values], going: Going | None = None) -> Answer:
        found = self._service.engine.snapshot()
        mode = found.mode.name if found is not None else "OFF"
        return self._service.sequencer.do(name, work, mode, going)

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
        if now.mode is not Mode.READY:  # there the drives are switched off first
            self._permitted(Request.HOME)
        self._not_running("HOME")
        self._not_in_thread("HOME")
        self._changer_is_sure("HOME")
        going = Going()
        return self._sequence("home", lambda: sequences.home(service, axes, going), going)

    def _reset(self, _: Values) -> Answer:
        service = self._service
        now = service.engine.snapshot()
        if (
            service.engine.tick_alive
            and now is not None
            and now.mode is not Mode.FAULT
            and service.commissioned
        ):
            raise refused("no_fault", now.mode.name, "RESET")
        return self._sequence("reset", lambda: sequences.reset(service))

    def _load(self, args: Values) -> Answer:
        service = self._service
        self._not_running("LOAD")

        def work() -> Values:
            job = jobs.read(args, service.machine)
            if args.get("restart") is True:
                job = restart_preview.gone_on_with(service, job)
            service.job = job
            try:
                return sequences.load(service, job)
            except CommandRefused as error:
                job.state, job.said = "refused", error.said
                raise

        return self._sequence("load", work)

    def _unload(self, _: Values) -> Values:
        self._not_running("UNLOAD")
        self._service.job = None
        return {}

    def _not_running(self, request: str) -> None:
        running, found = self._service.running, self._service.engine.snapshot()
        if running is not None:
            mode = found.mode.name if found is not None else "OFF"
            raise refused("running", mode, request, program=running.program.name)

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
        self._not_in_thread("START")
        if args.get("worn") is not True:
            wear.check(service.usage, service.tool, job.program.name)
        return self._begin("start", job, args.get("unrecorded") is True)

    def _begin(self, name: str, job: Job, unrecorded: bool = False) -> Answer:
        service = self._service
        self._permitted(Request.START)
        self._not_running(name.upper())
        self._changer_is_sure(name.upper())
        going = Going()
        return self._sequence(name, lambda: sequences.start(service, job, going, unrecorded), going)

    def _mdi(self, args: Values) -> Answer:
        text = args.get("text")
        if not isinstance(text, str) or not text.strip() or len(text) > MAX_MDI:
            raise refused("no_text", code="bad", most=MAX_MDI)
        self._not_in_thread("MDI")
        return self._begin("mdi", jobs.mdi(text, self._service.machine))

    def _retract(self, args: Values) -> Answer:
        """Off along the tool axis: out of a held program, or from READY, as after a fault."""
        service, now, mm = self._service, self._service.now(), number(args, "mm", 0.0, MAX_DISTANCE)
        self._not_in_thread("RETRACT")
        self._changer_is_sure("RETRACT")
        if now.mode not in (Mode.HOLD, Mode.READY) or not now.at_rest:
            raise refused("not_retracted", now.mode.name, "RETRACT")
        room_mm = self._retract_room_mm(now)
        if room_mm is not None and not 0.0 < mm <= room_mm:
            raise refused("retract_room", now.mode.name, "RETRACT", mm=mm, room=room_mm)
        if now.mode is Mode.HOLD:
            return self._aside("retract", mm)
        self._not_running("RETRACT")
        self._permitted(Request.JOG)
        line = self._jogging.step(service.machine, now, self._part(), "tool", "Z", mm)
        line, going = line._replace(speed=min(line.speed, RETRACT_MM_S)), Going()
        return self._sequence("retract", lambda: sequences.retract(service, line, going), going)

    def _not_in_thread(self, request: str) -> None:
        """Raises CommandRefused where the tool stands in a thread: ``withdraw`` and Resume alone move it."""
        if (found := self._service.thread.found) is not None:
            mode, line = self._service.now().mode.name, found.line
            depth, pitch = found.depth_mm, found.pitch_mm
            raise refused("in_thread", mode, request, depth=depth, pitch=pitch, line=line)

    def _changer_is_sure(self, request: str) -> None:
        """Raises CommandRefused in the middle of a tool change, and until the tools' places are confirmed."""
        changer = self._service.changer
        if changer is None:
            return
        if changer.under_way:
            raise refused("change_under_way", self._service.now().mode.name, request)
        if (doubt := changer.doubt) is not None:
            raise CommandRefused("refused", doubt, self._service.now().mode.name, request)

    def _withdraw(self, args: Values) -> Answer:
        """Out of a thread along it, by what is known of it or ``mm``; or it ``is_out`` already, by hand."""
        service, now = self._service, self._service.now()
        found = service.thread.found
        if found is None:
            raise refused("not_in_thread", now.mode.name, "WITHDRAW")
        if args.get("is_out") is True:
            self._not_running("WITHDRAW")
            service.thread.is_out()
            return {}
        mm = None if args.get("mm") is None else number(args, "mm", 0.1, MAX_WITHDRAW_MM)
        if found.pitch_mm == 0.0:
            raise refused("thread_unknown", now.mode.name, "WITHDRAW")
        return self._begin("withdraw", jobs.mdi(way_out(service.machine, found, mm), service.machine))

    def _retract_room_mm(self, now: Snapshot) -> float | None:
        """As ``status.retract_room_mm``; None while the tool is aside, or a run is just ending."""
        service = self._service
        if service.aside or service.returning or (now.mode is Mode.READY and service.running is not None):
            return None
        return status.retract_room_mm(service.machine, now)

    def _aside(self, verb: str, distance_mm: float = 0.0) -> Answer:
        service, now = self._service, self._service.now()
        if now.mode is not Mode.HOLD or not now.at_rest:
            raise refused("not_held", now.mode.name, verb.upper())
        if bars(now.interlock, Request.RESUME):
            raise by_fault(now.interlock, now.mode.name, verb.upper())
        going = Going()
        return self._sequence(verb, lambda: sequences.aside(service, verb, distance_mm, going), going)

    # -- the tool changer

    def _its_changer(self) -> ToolChanger:
        """Raises CommandRefused where the machine has none."""
        if self._service.changer is None:
            raise refused("no_changer", code="bad")
        return self._service.changer

    def _changer(self) -> Values:
        changer = self._its_changer()
        names = ("time_s", "what", "tool_out", "tool_in", "step", "name")
        return {**changer.told(), "log": [dict(zip(names, row, strict=True)) for row in changer.store.log()]}

    def _changer_confirm(self, args: Values) -> Values:
        """Where every tool is, as an operator has seen it, and that the changer stands clear.

        ``spindle``: the tool in it, 0 = none; ``away``: tools out of the machine; each other one is in its
        pocket. Raises CommandRefused.
        """
        service, changer = self._service, self._its_changer()
        self._not_running("CHANGER")
        if not self._on(args, "clear"):
            raise refused("changer_not_clear", code="bad")
        spindle, away = whole(args, "spindle", wear.MAX_TOOL), args.get("away") or []
        away = away if isinstance(away, list) else [away]
        known = {tool.number for tool in service.machine.tools}
        for tool in (spindle, *away):
            if type(tool) is not int or (tool not in known and tool != 0):
                raise refused("changer_no_tool", code="bad", tool=tool, allowed=_listed(known))
        if spindle and spindle in away:
            raise refused("changer_twice", code="bad", tool=spindle)
        pockets = service.machine.changer.pockets if service.machine.changer is not None else ()
        service.confirm_tools(tool_store.placed(pockets, spindle or 0, away))
        return changer.told()

    def _changer_pocket(self, args: Values) -> Values:
        """Whose a pocket is; from then on somebody must confirm where the tools are."""
        service, changer = self._service, self._its_changer()
        pocket, tool = whole(args, "pocket"), whole(args, "tool")
        with self._fitting("pockets", "SET POCKETS"):
            machine = setup_data.with_pocket(service.machine, str(pocket), tool)
            pockets = machine.changer.pockets if machine.changer is not None else ()
            changer.store.forget()
            values = {str(number): its for number, its in enumerate(pockets, 1)}
            service.fit(machine, {**service.fitted, "pockets": values})
        return changer.told()

    # -- what is fitted

    def _set_offset(self, args: Values) -> Values:
        name, values = str(args.get("name", "")), args.get("values")
        return self._fit("offsets", name, values, partial(setup_data.with_offset, name=name, values=values))

    def _set_tool(self, args: Values) -> Values:
        values = dict(args)
        number = values.pop("number", None)
        if not isinstance(number, int) or isinstance(number, bool):
            raise refused("not_whole", code="bad", name="number", value=number)
        tool = None if values.pop("remove", False) else values
        return self._fit(
            "tools", str(number), tool, partial(setup_data.with_tool, number=number, values=tool)
        )

    def _fit(self, what: str, key: str, values: Any, change: Callable[[Machine], Machine]) -> Values:
        """One value of the store, which then counts instead of the machine file's."""
        service = self._service
        with self._fitting(what, f"SET {what.upper()}"):
            machine = change(service.machine)
            rotary = setup_data.rotary_deg(machine, key) if what == "offsets" else {}
            if rotary:  # though it was not said
                values = {**(values if isinstance(values, dict) else {"origin_mm": values}), **rotary}
            service.fit(machine, {**service.fitted, what: {**service.fitted.get(what, {}), key: values}})
        return setup_data.told(service.machine, service.fitted)

    def _forget(self, args: Values) -> Values:
        """What was set at the machine, or by a program, is the machine file's again."""
        service, name = self._service, str(args.get("name", ""))
        what = "tools" if name.startswith("T") else "offsets"
        with self._fitting(what, "FORGET"):
            try:
                values = setup_data.without(service.fitted, name)
            except KeyError:
                raise refused("not_set_here", code="bad", name=name) from None
            service.fit(setup_data.applied(service.file, values), values)
        return setup_data.told(service.machine, service.fitted)

    @contextlib.contextmanager
    def _fitting(self, what: str, request: str) -> Iterator[None]:
        """At rest only: a program under way was planned with what was fitted when it began.

        But a tool that was led off the path of a held program may be changed for another.
        """
        service = self._service
        with service.fitting:  # one change at a time, and no start in the middle of one
            now = service.engine.snapshot()
            if now is not None and not self._may_fit(what, now):
                raise refused("not_fitted", now.mode.name, request, what=Key(what))
            try:
                yield
            except ConfigError as error:
                raise CommandRefused("bad", str(error)) from error

    def _may_fit(self, what: str, now: Snapshot) -> bool:
        service = self._service
        if what == "tools" and service.aside and now.mode is Mode.HOLD:
            return service.sequencer.busy != "return"  # which is planned with those that are fitted
        return now.mode in AT_REST and service.running is None


def _given_up(name: str) -> Values | None:
    """What a hold or stop has done of which the tick itself had nothing to do; None: nothing."""
    return {"outcome": "given_up", "what": name} if name else None


def _listed(tools: set[int]) -> str:
    return ", ".join(f"T{number}" for number in sorted(tools))


def _axis_numbers(machine: Machine, names: object, mode: Mode) -> tuple[int, ...]:
    """Numbers of axes by their names, all of them for None. Raises CommandRefused."""
    known = [axis.name for axis in machine.axes]
    if names is None:
        return tuple(range(len(known)))
    if not isinstance(names, list) or not names or not all(name in known for name in names):
        raise refused("no_axes", mode.name, "HOME", "bad", axes=repr(names), allowed=" ".join(known))
    return tuple(sorted({known.index(name) for name in names}))


def _last_block(job: Job) -> Values | None:
    """Of a program that has ended: where in its block it was."""
    return status.in_block(job.last, job.ways.get(job.last.motion_id)) if job.last is not None else None
