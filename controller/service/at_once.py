"""Commands that leave for the tick here and now: hold, stop, jog, spindle, coolant and clamps by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from controller.commands.table import Request
from controller.ipc.control_socket import Answer, Values
from controller.messages import Key
from controller.service.jogging import slowed
from controller.service.preconditions import permitted
from controller.service.refusals import number, refused

if TYPE_CHECKING:
    from controller.service.command_handlers import Desk


def hold(desk: Desk, _: Values) -> Answer:
    """Also of what is only being prepared: it does not go out, which is what was asked for."""
    sequencer = desk.service.sequencer
    given_up = "" if sequencer.busy == "home" else sequencer.give_up()  # drives home by themselves
    changer = desk.service.changer
    if changer is not None and changer.under_way:  # maybe between two steps, where the tick holds already
        changer.hold()
        given_up = given_up or "change"
    return desk.ask(Request.HOLD, instead=_given_up(given_up))


def stop(desk: Desk, _: Values) -> Answer:
    """Also of what is only being prepared: a check, a start, the next axes that home."""
    if given_up := desk.service.sequencer.give_up():
        desk.plan_gives_up()
    return desk.ask(Request.STOP, instead=_given_up(given_up or desk.give_up_load()))


def _given_up(name: str) -> Values | None:
    """What a hold or stop has done of which the tick itself had nothing to do; None: nothing."""
    return {"outcome": "given_up", "what": name} if name else None


def estop(desk: Desk, _: Values) -> Answer:
    desk.service.sequencer.give_up()
    return desk.ask(Request.ESTOP)


def disable(desk: Desk, _: Values) -> Answer:
    desk.service.sequencer.give_up()
    return desk.ask(Request.DISABLE)


def resume(desk: Desk, _: Values) -> Answer:
    """Along the program only from where it was held: off it the tool must return first."""
    service = desk.service
    if not service.sequencer.busy and (why := service.run.no_resume):
        raise refused("refused", service.processes.now().mode.name, "RESUME", why=Key(why))
    if service.changer is None:
        return desk.ask(Request.RESUME)
    service.changer.resume(permitted(service, Request.RESUME))  # it alone lets the tick go on
    return {}


# ---- jogging


def jog(desk: Desk, values: Values) -> Answer:
    """Dead-man: without the next one within 200 ms the axes come to rest."""
    service, now = desk.service, permitted(desk.service, Request.JOG)
    frame, axis, share = values["frame"], values["axis"], values["speed"]
    line = desk.jogging.continuous(service.set_up.machine, now, desk.part(), frame, axis, share)
    line = slowed(service.set_up.machine, line, frame, axis, values["feed"])
    if not desk.presses.may_move(values["press"]):
        raise refused("press_ended", now.mode.name, "JOG")
    return desk.answer_of(service.engine.jog(line), Request.JOG)


def jog_step(desk: Desk, values: Values) -> Answer:
    service, now = desk.service, permitted(desk.service, Request.JOG)
    frame, axis, distance = values["frame"], values["axis"], values["distance"]
    line = desk.jogging.step(service.set_up.machine, now, desk.part(), frame, axis, distance)
    line = slowed(service.set_up.machine, line, frame, axis, values["feed"])
    return desk.answer_of(service.engine.jog(line), Request.JOG)


# ---- by hand


def spindle(desk: Desk, values: Values) -> Answer:
    """Signed; 0 = off. Raises CommandRefused."""
    machine, tool = desk.service.set_up.machine, desk.service.set_up.tool
    assert machine.spindle is not None
    rev_min = number(values, "rev_min", -machine.spindle.max_rev_min, machine.spindle.max_rev_min)
    if rev_min and not machine.may_turn(tool):
        raise refused("spindle_must_stand", tool=tool)
    return desk.ask(Request.SPINDLE, rev_min, rev_min=rev_min)


def coolant(desk: Desk, values: Values) -> Answer:
    """Raises CommandRefused."""
    io = desk.service.set_up.machine.io
    outputs = dict(io.outputs) if io else {}
    wanted = 0
    for bit, (kind, output) in enumerate((("mist", "mist"), ("flood", "coolant"))):
        if values[kind]:
            if output not in outputs:
                raise refused("no_output", code="bad", name=output)
            wanted |= 1 << bit
    permitted(desk.service, Request.COOLANT)
    return desk.ask(Request.COOLANT, float(wanted), mist=values["mist"], flood=values["flood"])


def clamps(desk: Desk, values: Values) -> Answer:
    """``open``: names of the axes whose clamps are open, and of no other ones. Raises CommandRefused."""
    axes = desk.service.set_up.machine.axes
    clamped = [axis.name for axis in axes if axis.clamp is not None]
    wanted = 0
    for name in values["open"]:
        if name not in clamped:
            raise refused("no_clamp", code="bad", axis=name, allowed=", ".join(clamped) or "–")
        wanted |= 1 << [axis.name for axis in axes].index(name)
    permitted(desk.service, Request.CLAMPS)
    return desk.ask(Request.CLAMPS, float(wanted), open=values["open"])
