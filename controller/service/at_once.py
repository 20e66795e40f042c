"""Commands that leave for the tick here and now: hold, stop, jog, spindle, coolant and clamps by hand."""

from __future__ import annotations

from controller.commands.table import Request
from controller.ipc.control_socket import Answer, Values
from controller.messages import Key
from controller.service.handler_context import HandlerContext
from controller.service.jogging import slowed
from controller.service.preconditions import permitted
from controller.service.refusals import number, refused


def hold(handlers: HandlerContext, _: Values) -> Answer:
    """Also of what is only being prepared: it does not go out, which is what was asked for."""
    sequencer = handlers.service.sequencer
    given_up = "" if sequencer.busy == "home" else sequencer.give_up()  # drives home by themselves
    changer = handlers.service.changer
    if changer is not None and changer.under_way:  # maybe between two steps, where the tick holds already
        changer.hold()
        given_up = given_up or "change"
    return handlers.ask(Request.HOLD, instead=_given_up(given_up))


def stop(handlers: HandlerContext, _: Values) -> Answer:
    """Also of what is only being prepared: a check, a start, the next axes that home."""
    if given_up := handlers.service.sequencer.give_up():
        handlers.plan_gives_up()
    return handlers.ask(Request.STOP, instead=_given_up(given_up or handlers.give_up_load()))


def _given_up(name: str) -> Values | None:
    """What a hold or stop has done of which the tick itself had nothing to do; None: nothing."""
    return {"outcome": "given_up", "what": name} if name else None


def estop(handlers: HandlerContext, _: Values) -> Answer:
    handlers.service.sequencer.give_up()
    return handlers.ask(Request.ESTOP)


def disable(handlers: HandlerContext, _: Values) -> Answer:
    handlers.service.sequencer.give_up()
    return handlers.ask(Request.DISABLE)


def resume(handlers: HandlerContext, _: Values) -> Answer:
    """Along the program only from where it was held: off it the tool must return first."""
    service = handlers.service
    if not service.sequencer.busy and (why := service.run.no_resume):
        raise refused("refused", service.processes.now().mode.name, "RESUME", why=Key(why))
    if service.changer is None:
        return handlers.ask(Request.RESUME)
    service.changer.resume(permitted(service, Request.RESUME))  # it alone lets the tick go on
    return {}


# ---- jogging


def jog(handlers: HandlerContext, values: Values) -> Answer:
    """Dead-man: without the next one within 200 ms the axes come to rest."""
    service, now = handlers.service, permitted(handlers.service, Request.JOG)
    frame, axis, share = values["frame"], values["axis"], values["speed"]
    line = handlers.jogging.continuous(service.set_up.machine, now, handlers.part(), frame, axis, share)
    line = slowed(service.set_up.machine, line, frame, axis, values["feed"])
    if not handlers.presses.may_move(values["press"]):
        raise refused("press_ended", now.mode.name, "JOG")
    return handlers.answer_of(service.engine.jog(line), Request.JOG)


def jog_step(handlers: HandlerContext, values: Values) -> Answer:
    service, now = handlers.service, permitted(handlers.service, Request.JOG)
    frame, axis, distance = values["frame"], values["axis"], values["distance"]
    line = handlers.jogging.step(service.set_up.machine, now, handlers.part(), frame, axis, distance)
    line = slowed(service.set_up.machine, line, frame, axis, values["feed"])
    return handlers.answer_of(service.engine.jog(line), Request.JOG)


# ---- by hand


def spindle(handlers: HandlerContext, values: Values) -> Answer:
    """Signed; 0 = off. Raises CommandRefused."""
    machine, tool = handlers.service.set_up.machine, handlers.service.set_up.tool
    assert machine.spindle is not None
    rev_min = number(values, "rev_min", -machine.spindle.max_rev_min, machine.spindle.max_rev_min)
    if rev_min and not machine.may_turn(tool):
        raise refused("spindle_must_stand", tool=tool)
    if abs(rev_min) > (most := machine.max_rev_min(tool)):
        raise refused("spindle_too_fast", speed=abs(rev_min), tool=tool, most=most)
    return handlers.ask(Request.SPINDLE, rev_min, rev_min=rev_min)


def coolant(handlers: HandlerContext, values: Values) -> Answer:
    """Raises CommandRefused."""
    io = handlers.service.set_up.machine.io
    outputs = dict(io.outputs) if io else {}
    wanted = 0
    for bit, (kind, output) in enumerate((("mist", "mist"), ("flood", "coolant"))):
        if values[kind]:
            if output not in outputs:
                raise refused("no_output", code="bad", name=output)
            wanted |= 1 << bit
    permitted(handlers.service, Request.COOLANT)
    return handlers.ask(Request.COOLANT, float(wanted), mist=values["mist"], flood=values["flood"])


def clamps(handlers: HandlerContext, values: Values) -> Answer:
    """``open``: names of the axes whose clamps are open, and of no other ones. Raises CommandRefused."""
    axes = handlers.service.set_up.machine.axes
    clamped = [axis.name for axis in axes if axis.clamp is not None]
    wanted = 0
    for name in values["open"]:
        if name not in clamped:
            raise refused("no_clamp", code="bad", axis=name, allowed=", ".join(clamped) or "–")
        wanted |= 1 << [axis.name for axis in axes].index(name)
    permitted(handlers.service, Request.CLAMPS)
    return handlers.ask(Request.CLAMPS, float(wanted), open=values["open"])
