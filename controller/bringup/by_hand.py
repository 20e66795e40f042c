"""Steps of a bring-up in which the operator works something by hand, and the control says what it sees of it.

An input is known by its edge: which one came, whether it was the one that was meant, and whether it went
back. So are the terminals of a drive (60FDh). A stop is known by its fault, and by the input that made it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping

from controller.bringup.protocol import Outcome
from controller.bringup.site import Site
from controller.bringup.steps import ESTOP_INPUT, Step
from controller.bringup.ticks import NotDone, Stop
from controller.messages import Message, message

LOOK_S = 0.1  # between two looks
EDGE_S = 30.0  # within which what was asked for must be seen
CHANNELS = (1, 2)  # of safe torque off
SWITCHES = {"negative": 1, "positive": 2, "home": 4}  # bits of 60FDh (CiA 402-2)
# The homing methods (CiA 402-2) that need a switch; those between need none of the axis' own.
NEEDED = {"negative": (1, 17), "positive": (2, 18), "home": (*range(3, 15), *range(19, 31))}
CLAMP_LOOK_S = 0.02

Levels = Mapping[str, bool]


def inputs(step: Step, site: Site) -> Outcome:
    """Every input of the I/O node but the emergency stop: worked, seen, and seen to go back."""
    io = site.bench.machine.io
    names = [name for name, _ in io.inputs if name != ESTOP_INPUT] if io is not None else []
    outcome = Outcome(True)
    with _drives_off(site):
        for name in names:
            _worked(site, f"turn.{name}", name, site.bench.inputs, outcome, name)
    return outcome


def switches(step: Step, site: Site) -> Outcome:
    """Limit and reference switches of an axis; one that is not fitted must not be needed for homing."""
    outcome, method = Outcome(True), site.axis(step.of).homing.method
    with _drives_off(site):
        if site.bench.switches(step.of) is None:
            raise NotDone(message("bringup.no_terminals", axis=step.of))

        def read() -> Levels:
            word = site.bench.switches(step.of) or 0
            return {name: bool(word & bit) for name, bit in SWITCHES.items()}

        for name in SWITCHES:
            needed = method in NEEDED[name]
            what = message(f"bringup.switch.{name}", axis=step.of)
            if not read()[name]:
                _worked(site, f"switch.{step.of}.{name}", name, read, outcome, what, needed)
            elif needed:  # the machine was homed by it
                outcome.figures.append(message("bringup.figure.homed_on", what=what))
            else:  # of a limit switch it is wrong; a reference switch that nothing uses may be anything
                list_of = outcome.figures if name == "home" else outcome.findings
                list_of.append(message("bringup.stands_on", what=what))
    outcome.good = not outcome.findings
    return outcome


def _worked(
    site: Site,
    action: str,
    wanted: str,
    read: Callable[[], Levels],
    outcome: Outcome,
    what: Message | str,
    needed: bool = True,
) -> None:
    """One of some inputs, there and back; what is wrong goes into ``outcome``.

    ``needed``: it is a fault where it is not seen; else the operator says that it is not there.
    """
    before = read()
    after = _changed(site, action, message("bringup.hand.work", what=what), read, before)
    came = [name for name in before if after[name] != before[name]]
    if not came:
        (outcome.findings if needed else outcome.figures).append(
            message("bringup.no_edge" if needed else "bringup.not_there", what=what)
        )
    elif came != [wanted]:
        outcome.findings.append(message("bringup.other_edge", what=what, found=", ".join(came)))
    if came:
        back = _changed(site, action, message("bringup.hand.back", what=what), read, after)
        if back != before:
            outcome.findings.append(message("bringup.no_way_back", what=what))
        elif came == [wanted]:
            outcome.figures.append(message("bringup.figure.edge", what=what))
    outcome.good = not outcome.findings


def _changed(site: Site, action: str, request: Message, read: Callable[[], Levels], before: Levels) -> Levels:
    """What is seen after something was asked for; as before where nothing has come of it."""
    with site.watched(action, request) as gives_up:
        for _ in range(round(EDGE_S / LOOK_S)):
            site.bench.wait(LOOK_S)
            if read() != before:
                site.bench.wait(LOOK_S)  # until it no longer bounces
                return read()
            if gives_up():
                break
    return before


@contextlib.contextmanager
def _drives_off(site: Site) -> Iterator[None]:
    """Nothing moves of what is pressed, and nothing is a fault that would be one while they are on.

    They go on again only when the operator has said that nobody is at the machine. Raises NotDone.
    """
    site.bench.power(False)
    clamps = (axis.clamp.open_s for axis in site.bench.machine.axes if axis.clamp is not None)
    site.bench.wait(max((LOOK_S, *clamps)))  # they close with it
    try:
        yield
    finally:
        site.by_hand("stand_clear", message("bringup.hand.clear"))
        if site.bench.stopped_by() is None:
            site.bench.power(True)
        else:  # the supply's own input: a fault whether the drives are on or off
            site.bench.recover()


# ---- stops


def estop(step: Step, site: Site) -> Outcome:
    """Seen by its input, and a fault."""
    before = site.bench.inputs().get(ESTOP_INPUT)
    stop, after = _stop(site, "estop_press", message("bringup.hand.estop"))
    outcome = _stopped(site, "estop_release", stop)
    if stop is not None and after.get(ESTOP_INPUT) == before:
        outcome.findings.append(message("bringup.no_edge", what=ESTOP_INPUT))
    outcome.good = not outcome.findings
    return outcome


def sto(step: Step, site: Site) -> Outcome:
    """Each channel alone takes the torque from the drive, which says so itself."""
    outcome = Outcome(True)
    for channel in CHANNELS:
        request = message("bringup.hand.sto", axis=step.of, channel=channel)
        stop, _ = _stop(site, f"sto_press.{step.of}", request)
        seen = _stopped(site, f"sto_release.{step.of}", stop)
        outcome.figures += seen.figures
        outcome.findings += seen.findings
        if stop is not None and stop.axis not in ("", step.of):
            outcome.findings.append(message("bringup.other_drive", axis=step.of, found=stop.axis))
    outcome.good = not outcome.findings
    return outcome


def _stop(site: Site, action: str, request: Message) -> tuple[Stop | None, Levels]:
    """The fault that comes of it, and the inputs as they are then."""
    with site.watched(action, request) as gives_up:
        for _ in range(round(EDGE_S / LOOK_S)):
            if (stop := site.bench.stopped_by()) is not None or gives_up():
                break
            site.bench.wait(LOOK_S)
    site.bench.wait(LOOK_S)
    return stop, site.bench.inputs()


def _stopped(site: Site, release: str, stop: Stop | None) -> Outcome:
    """Released, and up again."""
    site.by_hand(release, message("bringup.hand.release"))
    if stop is None:
        return Outcome(False, findings=[message("bringup.not_stopped")])
    site.bench.recover()
    return Outcome(True, figures=[message("bringup.figure.stopped_by", why=stop.why)])


# ---- clamp


def clamp(step: Step, site: Site) -> Outcome:
    """Opened and closed; its input says how long each took, and without one the operator whether it did."""
    own = site.axis(step.of).clamp
    assert own is not None  # ``steps`` has none of it else
    outcome = Outcome(True)
    for is_open in (True, False):
        site.bench.clamp(step.of, is_open)
        if not own.input:
            key = "bringup.ask.clamp_open" if is_open else "bringup.ask.clamp_closed"
            if not site.operator.confirms(message(key, axis=step.of)):
                outcome.findings.append(message("bringup.not_seen"))
            continue
        seconds = _seconds_until(site, own.input, not is_open)
        word = message("bringup.clamp_open" if is_open else "bringup.clamp_closed")
        outcome.figures.append(message("bringup.figure.clamp", axis=step.of, word=word, seconds=seconds))
        outcome.measured[f"{'open' if is_open else 'close'}_s"] = seconds
        if seconds > own.open_s:
            late = {"axis": step.of, "word": word, "input": own.input, "most": own.open_s}
            outcome.findings.append(message("bringup.clamp_late", **late))
    outcome.good = not outcome.findings
    return outcome


def _seconds_until(site: Site, name: str, level: bool) -> float:
    """Until an input has a level; ``EDGE_S`` where it does not come to it."""
    looks = round(EDGE_S / CLAMP_LOOK_S)
    for n in range(looks):
        if site.bench.inputs()[name] is level:
            return n * CLAMP_LOOK_S
        site.bench.wait(CLAMP_LOOK_S)
    return looks * CLAMP_LOOK_S
