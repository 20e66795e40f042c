"""What is done in each step of a bring-up, and what comes of it.

A kind of step is a function of the step, the machine and its operator. What moves the machine is a part
program (``excitation``); what an operator does by hand a simulated machine does itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict

import numpy as np

from controller.bringup import by_hand, charts, excitation, machinery, proposals, response
from controller.bringup.excitation import SHARES, Shown
from controller.bringup.proposals import Proposal
from controller.bringup.protocol import Outcome
from controller.bringup.response import Figures
from controller.bringup.site import Site
from controller.bringup.steps import Step
from controller.bringup.ticks import NotDone, Ticks
from controller.calibration import circular_test
from controller.calibration.refusal import Refusal
from controller.machine import machine_file
from controller.machine.model import Axis
from controller.messages import Message, message

WAYS = {"mm": 10.0, "deg": 90.0}  # that an axis is moved by to be measured
SCALE_SHARE = 0.1  # of the largest speed
SCALE_WITHIN = 0.002  # of the way: a gauge of 0.01 mm sees half of it
OFF_S = 1.0  # that a drive is off while its brake is looked at
RADIUS_MM = 20.0
CIRCLE_SHARES = (0.05, 0.1, 0.25)  # of the largest speed
ROUND_MM = 0.05  # most by which a circle may be off its radius, where the machine file holds no tolerance
SPINDLE_SHARES = (0.25, 0.5, 1.0)  # of the largest speed
SPIN_MARGIN = 1.5  # of ``spin_up_s`` beside what was measured
STOPS_AT_WINDOW = 0.5  # of the following error: speed is raised no further
DRY_RUN_MM = 20.0


def carry_out(step: Step, site: Site) -> Message | None:
    """Conducts a step and keeps what came of it; why it was not ended, where it was not. Raises OSError."""
    try:
        site.protocol.note(step.name, conduct(step, site))
    except NotDone as error:
        return error.said
    return None


def conduct(step: Step, site: Site) -> Outcome:
    """Raises NotDone where the step could not be ended."""
    return CONDUCT[step.kind](step, site)


def _seen(step: Step, site: Site) -> Outcome:
    """What only an operator sees."""
    good = site.operator.confirms(step.text("look"))
    return Outcome(good, findings=[] if good else [message("bringup.not_seen")])


def _brake(step: Step, site: Site) -> Outcome:
    axis, shown = site.axis(step.of), Shown.of(site.axis(step.of))
    ticks = site.bench.switched_off(OFF_S)
    actual = ticks.actual[:, site.index(step.of)]
    moved = float(np.abs(actual - actual[0]).max())
    most = axis.following.rest * abs(axis.shown_per_unit)
    unit = shown.words
    outcome = Outcome(moved <= most, measured={"moved": moved})
    outcome.figures.append(message("bringup.figure.moved", value=moved, unit=unit, seconds=OFF_S))
    outcome.charts.append(charts.standing(shown, actual, ticks.period_s))
    if not outcome.good:
        outcome.findings.append(message("bringup.sags", axis=step.of, moved=moved, most=most, unit=unit))
    return outcome


# ---- direction and scale


def _scale(step: Step, site: Site) -> Outcome:
    axis, shown = site.axis(step.of), Shown.of(site.axis(step.of))
    at = site.bench.positions()[site.index(step.of)]
    way = WAYS[shown.unit]
    if at + way > shown.travel[1]:
        way = -way
    if not shown.travel[0] <= at + way <= shown.travel[1]:
        raise NotDone(message("bringup.no_room", axis=step.of, at=at, unit=shown.words))
    _moved(site, shown, way)
    unit = shown.words
    measured = site.operator.value(message("bringup.ask.gauge", axis=step.of, way=way, unit=unit))
    _moved(site, shown, -way)
    return scale_of(axis, way, measured)


def _moved(site: Site, shown: Shown, way: float) -> None:
    feed = 60.0 * SCALE_SHARE * shown.velocity
    site.bench.run(f"G21 G91 G94 G40\nG1 {shown.name}{way:.6f} F{feed:.3f}\nM30\n", f"scale_{shown.name}")


def scale_of(axis: Axis, way: float, measured: float) -> Outcome:
    """What a gauge says to a way that an axis was moved by; both in mm or degrees, signed."""
    shown = Shown.of(axis)
    unit, off = shown.words, measured / way - 1.0
    figures = [message("bringup.figure.gauge", way=way, value=measured, unit=unit, percent=100.0 * off)]
    outcome = Outcome(abs(off) <= SCALE_WITHIN, figures, measured={"off": off})
    if measured == 0.0:
        outcome.findings.append(message("bringup.stands", axis=axis.name))
    elif not outcome.good:
        key, old = f"counts_per_{shown.unit}", axis.counts_per_unit / axis.shown_per_unit
        old = math.copysign(old, axis.counts_per_unit)
        new = float(f"{old * way / measured:.7g}")
        if measured * way < 0.0:
            outcome.findings.append(message("bringup.turned", axis=axis.name))
        why = message("bringup.why.scale", axis=axis.name, way=way, value=measured, unit=unit)
        outcome.findings.append(
            message("bringup.off_scale", axis=axis.name, percent=100.0 * off, key=key, new=new)
        )
        outcome.proposals.append(Proposal(axis.name, key, old, new, why).to_dict())
    return outcome


# ---- how an axis answers


def _response(step: Step, site: Site) -> Outcome:
    axis, index = site.axis(step.of), site.index(step.of)
    shown, machine = Shown.of(axis), site.bench.machine
    way = excitation.room(shown, site.bench.positions()[index])
    if not way:
        at = site.bench.positions()[index]
        raise NotDone(message("bringup.no_room", axis=step.of, at=at, unit=shown.words))
    outcome, answers = Outcome(True), []
    for share in SHARES:
        made = excitation.excitation(shown, way, share, machine.period_s, axis.feedback_every)
        name = f"response_{step.of}_{100 * share:.0f}"
        ticks = site.bench.run(made.text, name).of_axis(index)
        found = response.bode(ticks, made.highest_hz, abs(axis.shown_per_unit / axis.counts_per_unit))
        figures = response.figures(ticks, made, found, axis.following.in_position * abs(axis.shown_per_unit))
        answers.append((share, found))
        outcome.figures += _figures(shown, figures)
        window = axis.following_error * abs(axis.shown_per_unit)
        if share < SHARES[-1] and figures.error > STOPS_AT_WINDOW * window:
            outcome.findings.append(message("bringup.not_faster", axis=step.of, percent=100.0 * share))
            break
    outcome.measured = asdict(figures)
    outcome.findings += proposals.findings(axis, figures)
    outcome.findings += _unequal(step, site, figures)
    takes = machine_file.node_settings(machine)[index].profile.takes_feed_forward
    outcome.proposals = [one.to_dict() for one in proposals.proposals(axis, figures, takes, machine.period_s)]
    outcome.charts = [*charts.bode(shown, answers), *charts.errors(shown, ticks, made)]
    outcome.good = not outcome.findings
    return outcome


def _unequal(step: Step, site: Site, figures: Figures) -> list[Message]:
    """Beside the axes that were measured before."""
    lags = site.protocol.measured("response", "lag_s")
    others = {name: lag for name, lag in lags.items() if name != step.of}
    return [
        one
        for one in proposals.unequal({**others, step.of: figures.lag_s})
        if one["values"]["axis"] == step.of
    ]


def _figures(shown: Shown, found: Figures) -> list[Message]:
    unit = shown.words
    rows = [
        message("bringup.figure.share", percent=100.0 * found.share, speed=found.speed, unit=unit),
        message("bringup.figure.error", value=found.error, unit=unit),
        message("bringup.figure.lag", value=1e3 * found.lag_s),
        message(
            "bringup.figure.settling", value=1e3 * found.settling_s, overshoot=found.overshoot, unit=unit
        ),
    ]
    key = "bandwidth" if found.bandwidth_hz else "wide"
    rows.append(message(f"bringup.figure.{key}", value=found.bandwidth_hz, peak_db=found.peak_db))
    return [
        *rows,
        message("bringup.figure.seen", value=found.seen_hz, percent=100.0 * response.MAX_UNCERTAINTY),
    ]


# ---- circle


def _circle(step: Step, site: Site) -> Outcome:
    names = step.of[0], step.of[1]
    pair = [site.index(name) for name in names]
    shown = [Shown.of(site.axis(name)) for name in names]
    at = [site.bench.positions()[i] for i in pair]
    text = circles_text((names[0], names[1]), (shown[0], shown[1]), (at[0], at[1]))
    ticks = site.bench.run(text, f"circle_{step.of}")
    rows = [ticks.of_axis(i) for i in pair]
    command, actual = (
        np.stack([getattr(one, what) for one in rows], axis=1) for what in ("setpoint", "actual")
    )
    found = list(circular_test.circles(command, actual, rows[0].line))
    try:
        told = circular_test.report(found, names)
    except Refusal as error:
        raise NotDone(error.said) from error
    off = max(abs(float(np.hypot(*one.path.T).max() - one.radius_mm)) for one in found)
    off = max(off, *(abs(float(np.hypot(*one.path.T).min() - one.radius_mm)) for one in found))
    most = site.bench.machine.tolerance_mm or ROUND_MM
    outcome = Outcome(off <= most, measured={"off_mm": off})
    outcome.figures.append(
        message("bringup.figure.circle", value=1e3 * off, g=told.get("G_bidirectional_um", 0.0))
    )
    outcome.charts.append(charts.circles(found, names))
    if not outcome.good:
        outcome.findings.append(
            message("bringup.not_round", plane=step.of, off_um=1e3 * off, most_um=1e3 * most)
        )
    return outcome


PLANES = {"XY": ("G17", "I", "J"), "XZ": ("G18", "I", "K"), "YZ": ("G19", "J", "K")}


def circles_text(names: tuple[str, str], axes: tuple[Shown, Shown], at: tuple[float, float]) -> str:
    """Circles of both senses at rising feeds, beside where the axes stand, towards the middle of the travel.

    Raises NotDone where there is no room.
    """
    room = [max(one.travel[1] - place, place - one.travel[0]) for one, place in zip(axes, at, strict=True)]
    radius = min(RADIUS_MM, 0.45 * min(room))
    if radius < 0.1 * RADIUS_MM:
        raise NotDone(message("bringup.no_room", axis=names[0], at=at[0], unit="mm"))
    sides = [
        1.0 if one.travel[1] - place >= place - one.travel[0] else -1.0
        for one, place in zip(axes, at, strict=True)
    ]
    plane, first, second = PLANES["".join(names)]
    slowest = min(one.velocity for one in axes)
    lines = [f"G21 G91 G94 G40 G61 {plane}", f"G1 {names[1]}{sides[1] * radius:.6f} F{6.0 * slowest:.3f}"]
    for share in CIRCLE_SHARES:
        for code in ("G3", "G2"):
            where = f"{first}{sides[0] * radius:.6f} {second}0.0"
            lines += [f"{code} {where} F{60.0 * share * slowest:.3f}", "G4 P0.1"]
    lines += [f"G1 {names[1]}{-sides[1] * radius:.6f}", "G17", "M30", ""]
    return "\n".join(lines)


# ---- spindle, and a part


def _spindle(step: Step, site: Site) -> Outcome:
    spindle = site.bench.machine.spindle
    if spindle is None or not spindle.is_driven:
        return _seen(step, site)
    speeds = [round(share * spindle.max_rev_min) for share in SPINDLE_SHARES]
    lines = ["G21 G94"]
    for speed in speeds:
        lines += [f"S{speed} M3", "G4 P0.2", "M5", "G4 P0.2"]
    ticks = site.bench.run("\n".join((*lines, "M30", "")), "spindle")
    taken = [_until_line(ticks, 3 + 4 * n) for n in range(len(speeds))]
    outcome = Outcome(max(taken) <= spindle.spin_up_s, measured={"spin_up_s": max(taken)})
    outcome.figures = [
        message("bringup.figure.spindle", rev_min=speed, seconds=one)
        for speed, one in zip(speeds, taken, strict=True)
    ]
    new = proposals.rounded(SPIN_MARGIN * max(taken))
    if new > 0.0 and abs(new - spindle.spin_up_s) > proposals.CHANGES * spindle.spin_up_s:
        why = message("bringup.why.spin_up", seconds=max(taken))
        outcome.proposals.append(Proposal("spindle", "spin_up_s", spindle.spin_up_s, new, why).to_dict())
    return outcome


def _until_line(ticks: Ticks, line: int) -> float:
    """From the end of the line two before until a line begins, s."""
    begins = int(np.argmax(ticks.line >= line))
    before = np.flatnonzero(ticks.line[:begins] < line - 1)
    return (begins - int(before[-1]) - 1) * ticks.period_s if len(before) else 0.0


def _dry_run(step: Step, site: Site) -> Outcome:
    if site.part is None:
        raise NotDone(message("bringup.no_part"))
    text = site.part.read_text(encoding="utf-8", errors="replace")
    ticks = site.bench.run(text, site.part.name, DRY_RUN_MM)
    outcome = Outcome(True)
    seconds = len(ticks.line) * ticks.period_s
    outcome.figures.append(message("bringup.figure.dry_run", part=site.part.name, seconds=seconds))
    for i, axis in enumerate(site.bench.machine.axes):
        shown, its = Shown.of(axis), ticks.of_axis(i)
        error = float(np.abs(its.error).max(initial=0.0))
        window = axis.following_error * abs(axis.shown_per_unit)
        unit = shown.words
        outcome.figures.append(message("bringup.figure.error_of", axis=axis.name, value=error, unit=unit))
        if error > STOPS_AT_WINDOW * window:
            near = {"error": error, "window": window, "unit": unit}
            outcome.findings.append(message("bringup.near_window", axis=axis.name, **near))
    outcome.good = not outcome.findings
    return outcome


Conducted = Callable[[Step, Site], Outcome]
CONDUCT: Mapping[str, Conducted] = {
    "inputs": by_hand.inputs,
    "switches": by_hand.switches,
    "estop": by_hand.estop,
    "sto": by_hand.sto,
    "brake": _brake,
    "scale": _scale,
    "response": _response,
    "circle": _circle,
    "clamp": by_hand.clamp,
    "spindle": _spindle,
    "changer": machinery.changer,
    "rotaries": machinery.rotaries,
    "dry_run": _dry_run,
}
