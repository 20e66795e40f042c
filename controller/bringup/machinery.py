"""Steps of a bring-up in which the machine works by its own tables and probe: tool changer, and rotaries."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from controller.bringup.protocol import Outcome
from controller.bringup.site import Site
from controller.bringup.steps import Step
from controller.bringup.ticks import NotDone, Ticks
from controller.calibration import positions, rotary_fit, rotary_report, touch_table
from controller.calibration.positions import Probe, Sphere
from controller.calibration.refusal import Refusal
from controller.geometry.arrays import Array
from controller.geometry.vectors import add, scale
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints, Machine, Sensor
from controller.messages import message
from controller.program.output_words import steps_of

POSITIONS = 8  # of the rotaries, at which the sphere is probed
CLEAR_MM = 4.0  # before a touch, and so far beyond where it should come
TOUCH_FEED, WAY_FEED = 120.0, 3000.0  # mm/min
AWAY_MM = 0.02  # most by which a rotary's centre may be off the machine file's, where none is held there


def changer(step: Step, site: Site) -> Outcome:
    """Every tool of the pockets is fetched, the first one last; each step of each change with its time."""
    made, before = site.bench.machine.changer, site.bench.tool()
    assert made is not None  # ``steps`` has none of it else
    tools = [tool for tool in made.pockets if tool and tool != before and _may_be_fetched(site, tool)]
    if not tools:
        raise NotDone(message("bringup.no_tools"))
    ways = list(zip([before, *tools], [*tools, before or tools[0]], strict=True))
    lines = [f"T{tool} M6" for _, tool in ways]
    ticks = site.bench.run("\n".join(("G21", *lines, "M30", "")), "changer")
    outcome = Outcome(True)
    for n, (away, tool) in enumerate(ways):
        rows = steps_of(made, away, tool)
        for (one, _), seconds in zip(rows, _times(ticks, 2 + n), strict=False):
            values = {"tool": tool, "step": one.name, "seconds": seconds}
            outcome.figures.append(message("bringup.figure.changer", **values))
            if seconds > one.within_s:
                outcome.findings.append(message("bringup.changer_late", most=one.within_s, **values))
    outcome.good = not outcome.findings
    return outcome


def _may_be_fetched(site: Site, tool: int) -> bool:
    """The probe stays where it is: nothing is known of what it would touch."""
    probe = site.bench.machine.probe
    return site.bench.machine.tool(tool) is not None and (probe is None or probe.tool != tool)


def _times(ticks: Ticks, line: int) -> list[float]:
    """Of the steps of a change, from stop to stop, s."""
    assert ticks.held is not None
    held = ticks.held[ticks.line == line]
    edges = np.flatnonzero(np.diff(held.astype(np.int8)))
    begins, ends = edges[held[edges]], edges[~held[edges]]
    pairs = ((begin, ends[ends > begin]) for begin in begins)
    return [float(later[0] - begin) * ticks.period_s for begin, later in pairs if len(later)]


# ---- rotaries


def rotaries(step: Step, site: Site) -> Outcome:
    """Centres and directions by a sphere on the table, probed at many positions of the rotaries.

    The probe stands over the sphere to begin with: its first touches say where that is. Raises NotDone.
    """
    machine = site.bench.machine
    if machine.probe is None or (tool := machine.tool(machine.probe.tool)) is None:
        raise NotDone(message("bringup.no_probe"))
    radius = site.operator.value(message("bringup.ask.sphere"))
    site.by_hand("over_sphere", message("bringup.hand.sphere"))
    if machine.changer is None and site.bench.tool() != machine.probe.tool:
        raise NotDone(message("bringup.probe_not_in", tool=machine.probe.tool))
    probe = Probe(tool.length_mm - tool.radius_mm, tool.radius_mm)
    try:
        sphere = _found(site, machine.probe, probe, radius)
        advice = positions.advise(machine, sphere, probe, POSITIONS)
        site.bench.run(_text(machine, machine.probe, sphere, probe, advice.positions), "rotaries")
        touches = touch_table.read(site.bench.touches(), machine, "touches")
        fit = rotary_fit.fit(touches, machine, radius)
    except Refusal as error:
        raise NotDone(error.said) from error
    told = rotary_report.report(fit, machine)
    outcome = Outcome(True, measured={"scatter_um": told["scatter_um"]})
    most_um = 1e3 * (machine.tolerance_mm or AWAY_MM)
    for row in told["rotaries"]:
        values = {name: row[name] for name in ("axis", "moved_um", "turned_deg", "bound_um", "bound_deg")}
        outcome.figures.append(message("bringup.figure.rotary", **values))
        if row["moved_um"] > max(most_um, row["bound_um"]):
            point = ", ".join(f"{value:.4f}" for value in row["point_mm"])
            direction = ", ".join(f"{value:.7f}" for value in row["direction"])
            outcome.findings.append(message("bringup.rotary_off", **values, point=point, direction=direction))
    outcome.good = not outcome.findings
    return outcome


def _found(site: Site, sensor: Sensor, probe: Probe, radius_mm: float) -> Sphere:
    """Where the sphere is, table frame at zero, by its top and sides from where the probe stands."""
    machine = site.bench.machine
    kinematics = kinematics_of(machine)
    reach = radius_mm + probe.radius_mm
    at = tuple(q / axis.shown_per_unit for q, axis in zip(site.bench.positions(), machine.axes, strict=True))
    pose = kinematics.forward(at, probe.length_mm)
    sphere = Sphere(add(pose.tip, scale(pose.axis, -reach - 0.5 * CLEAR_MM)), radius_mm, pose.axis)
    place = tuple(at[i] for i in machine.rotary())
    site.bench.run(_text(machine, sensor, sphere, probe, [place]), "sphere")
    touches = touch_table.read(site.bench.touches(), machine, "touches")
    tips = np.array([kinematics.forward(tuple(q), probe.length_mm).tip for q in touches.joints])
    # Each is as far from the centre c: |tip|^2 = 2 c . tip + (reach^2 - |c|^2), linear in c and the rest.
    A = np.column_stack((2.0 * tips, np.ones(len(tips))))
    x, y, z, _ = np.linalg.lstsq(A, (tips**2).sum(axis=1), rcond=None)[0]
    return Sphere((float(x), float(y), float(z)), radius_mm, pose.axis)


def _text(
    machine: Machine, sensor: Sensor, sphere: Sphere, probe: Probe, places: Sequence[tuple[float, ...]]
) -> str:
    """The program that probes a sphere: at each place of the rotaries along the tool and from four sides."""
    lines = ["G21 G94 G40 G49 G90", f"T{sensor.tool} M6" if machine.changer is not None else ""]
    for place in places:
        lines += _place(machine, sphere, probe, place)
    return "\n".join((*filter(None, lines), "M30", ""))


def _place(machine: Machine, sphere: Sphere, probe: Probe, place: tuple[float, ...]) -> Iterator[str]:
    touches = positions.touches_at(machine, sphere, probe, place)
    above_mm = 2.0 * (sphere.radius_mm + probe.radius_mm + CLEAR_MM)
    out = touches.ways[0] * -1.0  # of the linear axes, along the tool away from the work
    retract = machine.axes[machine.linear()[2]].name
    yield f"G53 G0 {retract}{machine.retract_mm:.4f}"
    yield f"G53 G0 {_words(machine, tuple(touches.joints[0]), machine.rotary())}"
    for joints, way in zip(touches.joints, touches.ways, strict=True):
        start = _moved(machine, joints, way * -CLEAR_MM)
        high = _moved(machine, start, out * above_mm)
        x, y, z = machine.linear()
        yield f"G53 G0 {_words(machine, high, (x, y))}"
        yield f"G53 G1 {_words(machine, high, (z,))} F{WAY_FEED:g}"
        yield f"G53 G1 {_words(machine, start, machine.linear())} F{WAY_FEED:g}"
        yield f"G91 G38.2 {_way(machine, way * 2.0 * CLEAR_MM)} F{TOUCH_FEED:g}"
        yield "G90"
        yield f"G53 G1 {_words(machine, start, machine.linear())} F{WAY_FEED:g}"
        yield f"G53 G1 {_words(machine, high, machine.linear())} F{WAY_FEED:g}"
    yield f"G53 G0 {retract}{machine.retract_mm:.4f}"


def _moved(machine: Machine, joints: Joints, by: Array) -> Joints:
    moved = list(joints)
    for index, way in zip(machine.linear(), by, strict=True):
        moved[index] += float(way)
    return tuple(moved)


def _words(machine: Machine, joints: Joints, which: tuple[int, ...]) -> str:
    shown = machine.shown(joints)
    return " ".join(f"{machine.axes[i].name}{shown[i]:.5f}" for i in which)


def _way(machine: Machine, by: Array) -> str:
    names = (machine.axes[i].name for i in machine.linear())
    return " ".join(f"{name}{way:.5f}" for name, way in zip(names, by, strict=True))
