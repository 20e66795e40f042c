"""What the machine shows of itself: plain values in shown units (mm, degrees, mm/min)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from controller.geometry.vectors import Frame
from controller.ipc.handoff import Snapshot
from controller.machine import machine_file
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import OFFSETS, Joints, Machine
from controller.messages import message, several
from controller.motion.pieces import STANDSTILL
from controller.plan.path import spindle_by_hand
from controller.plan.restart.reentry import room_along_axis
from controller.program import dynamic_offset
from controller.program.modal import State
from controller.program.program import Tip
from controller.runtime.plan_messages import MotionFacts
from controller.service.active_codes import active_codes
from controller.service.jobs import UNDER_WAY
from controller.service.usage import Usage
from controller.state import figures, queue_refusals
from controller.state.fault_table import Sender
from controller.state.figures import Reading
from controller.state.live_state import status_values as told_by_tick
from controller.state.modes import Binding, Fault, Mode, binding_text, fault_message
from controller.state.queue_refusals import QueueRefusal

PER_MIN = 60.0
AT_LIMIT = 1e-3  # mm or rad from the end of the travel


def machine_values(
    machine: Machine,
    now: Snapshot,
    way: MotionFacts | None,
    state: State,
    in_spindle: int = 1,
    age_s: float = 0.0,
    ends_s: float | None = None,
) -> dict[str, Any]:
    """All of ``status`` that a snapshot tells, with the motion under way and the modal state in force.

    ``in_spindle``: a tool's number; ``age_s``: since the snapshot was new; ``ends_s``: in so long the queue
    ends though the program does not. What is a value of the snapshot comes as ``live_state`` declares it;
    the rest is what the machine file or the plan makes of one.
    """
    told, kinematics = told_by_tick(now), kinematics_of(machine)
    state = dynamic_offset.standing(state, machine.pair(now.joints, 0.0), machine, kinematics)
    return {
        **told,
        "not_homed": [
            a.name for i, a in enumerate(machine.axes) if not (now.homed & ~now.untrusted) >> i & 1
        ],
        "stands_at_stop": now.mode is Mode.HOLD and now.motion_id == STANDSTILL,
        "joints": joints(machine, kinematics, now, way, state),
        "work_offset": OFFSETS[state.modal.offset],
        **tip(machine, kinematics, now, state, in_spindle),
        "feed_mm_min": {"programmed": _programmed(now, way), **told["feed_mm_min"]},
        "limited_by": _limited_by(machine, now),
        "in_block": way.in_block(now.s) if way is not None else None,
        "codes": list(active_codes(state)),
        "spindle": _spindle(machine, told["spindle"]),
        "coolant": {"mist": bool(now.coolant & 1), "flood": bool(now.coolant & 2)},
        "inputs": _bits(machine.io.inputs if machine.io else (), now.inputs),
        "outputs": _bits(machine.io.outputs if machine.io else (), now.outputs),
        "analogue_outputs": _levels(machine, now),
        "tick": {**told["tick"], "period_ms": machine.period_s * 1e3, "age_s": age_s},
        "notices": [
            *_notices(machine, now),
            *(
                [{"name": "PLAN_SILENT", **message("plan_silent", seconds=ends_s)}]
                if ends_s is not None
                else []
            ),
        ],
    }


# What nobody tells any more once the tick's process is gone: the drives stop by themselves, unseen.
_OUT = ("coolant", "inputs", "outputs", "analogue_outputs")
_UNSEEN = ("at_rest", "feed_mm_min", "limited_by", "spindle", "codes", *_OUT)
_NAMES = ("axis", "node", "bus")  # of a drive: known whatever it does


def ended(now: Snapshot) -> Snapshot:
    """The last snapshot of a tick that is gone, as a fault: no axis may be trusted to be where it says."""
    as_fault = now._replace(mode=Mode.FAULT, fault=Fault.CONTROLLER_GONE, fault_axis=-1)
    every = (1 << len(now.joints)) - 1
    return as_fault._replace(homed=0, untrusted=every, rate=0.0, limited_by=0, waiting=False)


def unseen(told: Mapping[str, Any], over: bool = True) -> dict[str, Any]:
    """A status by ``ended``: positions, and what drives said, are the last; the rest is not known.

    ``over``: so is the run; of a tick that hangs it may go on.
    """
    joints = {
        name: {**row, "to_go": None, "error": None, "limit": None} for name, row in told["joints"].items()
    }
    drives = [{**row, "state": None} for row in told["drives"]]
    job = told["job"]
    if over and job is not None and job["state"] in UNDER_WAY:
        job = {**job, "state": "fault"}
    gone = {key: unknown(told[key]) for key in _UNSEEN}
    return {**told, **gone, "joints": joints, "drives": drives, "job": job}


def not_begun(told: Mapping[str, Any]) -> dict[str, Any]:
    """A status by ``blank``, before the first tick: every field is there, and none is known."""
    drives = [{**unknown(row), **{key: row[key] for key in _NAMES}} for row in told["drives"]]
    kept = {key: told[key] for key in ("mode", "not_homed", "job", "in_block", "tool", "ended_early", "run")}
    return {**unknown(told), **kept, "on_table": None, "drives": drives}


def unknown(value: Any) -> Any:
    """The same keys, and nothing known under any of them."""
    if isinstance(value, Mapping):
        return {key: unknown(one) for key, one in value.items()}
    return [] if isinstance(value, list) else None


def _notices(machine: Machine, now: Snapshot) -> list[dict[str, Any]]:
    """What stands in the way, or stopped nothing."""
    axis, sender = machine.axis_off(now.warning_axis), Sender(now.chatter_id, now.chatter_per_s)
    faults = ((now.interlock, ""), (now.warning, axis))
    found = [
        {"name": fault.name, **fault_message(fault, of, sender=sender)}
        for fault, of in faults
        if fault is not Fault.NONE
    ]
    stuck = now.mode is Mode.RUNNING and now.at_rest and now.refusal is not QueueRefusal.NONE
    return (
        [*found, {"name": f"QUEUE_{now.refusal.name}", **queue_refusals.refusal_message(now.refusal)}]
        if stuck
        else found
    )


def tool_change(machine: Machine, number: int, usage: Usage | None = None) -> dict[str, Any]:
    """What the operator is asked to do where a program waits for a tool, and whether that one is worn."""
    tool = machine.tool(number)
    name = f" ({tool.name})" if tool is not None and tool.name else ""
    key = "tool_change" if number else "tool_out"
    asks = message(key, number=number, name=name)
    known = [one.number for one in machine.tools]
    worn = usage.worn_message("tool_worn", number, known) if usage is not None else None
    return {"number": number, **(asks if worn is None else several(asks, worn))}


def spindle_change(rev_min: float) -> dict[str, Any]:
    """What the operator is asked to do where a program waits for a spindle that he switches; signed."""
    return {
        "rev_min": rev_min,
        **several(spindle_by_hand.instruction(rev_min), message("spindle_change.go_on")),
    }


def _spindle(machine: Machine, told: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of it; how one turns of which nobody reports that is not known."""
    if machine.spindle is not None and machine.spindle.reports_speed:
        return dict(told)
    is_driven = machine.spindle is not None and machine.spindle.is_driven
    return {**told, "actual_rev_min": None, "at_speed": told["at_speed"] if is_driven else None}


def _bits(names: tuple[tuple[str, int], ...], word: int) -> dict[str, bool]:
    return {name: bool(word >> bit & 1) for name, bit in names}


def _levels(machine: Machine, now: Snapshot) -> dict[str, float]:
    outs = machine.io.analogue_out if machine.io else ()
    return {out.name: value for out, value in zip(outs, now.analogue, strict=False)}


def reading(machine: Machine, kinematics: Kinematics, joints: Joints, state: State) -> Reading:
    """How words are read under a modal state, with the joints (mm, rad) there."""
    modal = dynamic_offset.standing(state, machine.pair(joints, 0.0), machine, kinematics).modal
    of_tip = modal.tilted or modal.tip is not Tip.OFF
    return Reading(modal.frame(machine), modal.length_mm, of_tip, modal.turned_rad)


def joints(
    machine: Machine, kinematics: Kinematics, now: Snapshot, way: MotionFacts | None, state: State
) -> dict[str, dict[str, Any]]:
    """By axis: where it is told to be, where it is, how far it still goes."""
    shown, actual = machine.shown(now.joints), machine.shown(now.actual)
    read = reading(machine, kinematics, now.joints, state)
    work = figures.work(machine, kinematics, now.joints, read)
    end = work
    if way is not None:  # where an origin that follows the part is by then
        end = figures.work(machine, kinematics, way.end, reading(machine, kinematics, way.end, state))
    to_go = figures.to_go(work, end)
    return {
        axis.name: {
            "machine": shown[i],
            "work": work[i],
            "to_go": to_go[i],
            "actual": actual[i],
            "error": shown[i] - actual[i],
            "homed": bool(now.homed >> i & 1),
            "limit": _limit(now.joints[i], axis.travel_min, axis.travel_max, axis.shown_per_unit),
        }
        for i, axis in enumerate(machine.axes)
    }


def _limit(q: float, lowest: float, highest: float, shown_per_unit: float) -> str | None:
    """The end of the travel at which the axis stands, in its shown sense."""
    low, high = ("+", "-") if shown_per_unit < 0.0 else ("-", "+")
    return low if q <= lowest + AT_LIMIT else high if q >= highest - AT_LIMIT else None


def tip(
    machine: Machine, kinematics: Kinematics, now: Snapshot, state: State, in_spindle: int = 1
) -> dict[str, Any]:
    """Tip and axis of the tool in the spindle: in the part frame that is in force, and on the table."""
    modal = state.modal
    tool = modal.tool_in(machine) if modal.tool == in_spindle else machine.tool(in_spindle)
    length_mm = tool.length_mm if tool is not None else 0.0
    part, table = (
        figures.tip(kinematics, now.joints, length_mm, frame) for frame in (modal.frame(machine), Frame())
    )
    return {
        "tip": dict(zip("XYZ", map(float, part.tip), strict=True)),
        "axis": dict(zip("IJK", map(float, part.axis), strict=True)),
        # The same seen from the table with the rotaries at zero, for pictures.
        "on_table": {
            "tip": [float(p) for p in table.tip],
            "axis": [float(p) for p in table.axis],
            "length_mm": length_mm,
        },
    }


def retract_room_mm(machine: Machine, now: Snapshot) -> float | None:
    """How far (mm) the tool can go off along its own axis from where it stands, within the travel.

    Rounded down to a micrometre, so that what is told may be asked for; None where the axis is not
    known or the machine takes no retract: it moves, is off, or stands off the path already.
    """
    known = now.homed == machine.every_axis and not now.untrusted
    stands = now.mode in (Mode.HOLD, Mode.READY) and now.at_rest and not now.stopping
    if not known or not stands or now.away:
        return None
    room_mm = room_along_axis(now.joints, machine, kinematics_of(machine))
    return math.floor(room_mm * 1e3) / 1e3


def _programmed(now: Snapshot, way: MotionFacts | None) -> float | None:
    if way is None or way.feed_mm_s is None:
        return None
    begun = [feed for s, feed in way.feed_steps if s <= now.s]
    return (begun[-1] if begun else way.feed_mm_s) * PER_MIN


def _limited_by(machine: Machine, now: Snapshot) -> str | None:
    """What holds the speed down, in words."""
    if now.mode is not Mode.RUNNING or now.limited_by == Binding.NOTHING:
        return None
    return binding_text(now.limited_by, [axis.name for axis in machine.axes])


def facts(machine: Machine, fitted: Mapping[str, Any]) -> dict[str, Any]:
    """What does not change while the machine runs, but for what is fitted."""
    return {
        "name": machine.name,
        "period_s": machine.period_s,
        "axes": [
            {
                "name": axis.name,
                "kind": axis.kind.value,
                "unit": "deg" if axis.is_rotary else "mm",
                "sense": axis.sense.value,
                "travel": sorted((axis.travel_min * k, axis.travel_max * k)),
                "velocity": axis.limits.velocity * abs(k),
                "acceleration": axis.limits.acceleration * abs(k),
                "jerk": axis.limits.jerk * abs(k),
                "bus": axis.bus,
                "node": axis.node,
                "following_error": axis.following_error * abs(k),
                "brake": axis.brake,
                "home": axis.homing.position * k,
                "clamp": axis.clamp.output if axis.clamp is not None else None,
                "homing_method": axis.homing.method,
                "absolute": axis.homing.absolute,
                "profile": Path(axis.profile).stem,
                "supervision": node.profile.supervision.value,
                "direction": list(axis.direction),
                "point_mm": list(axis.point_mm),
            }
            for axis, node in zip(machine.axes, machine_file.node_settings(machine), strict=True)
            for k in (axis.shown_per_unit,)
        ],
        "buses": [
            {"name": bus.name, "interface": bus.interface, "channel": bus.channel, "bit_rate": bus.bit_rate}
            for bus in machine.buses
        ],
        "spindle": {
            "max_rev_min": machine.spindle.max_rev_min,
            "driven": machine.spindle.is_driven,
            "tells_load": machine.spindle.position is not None and machine.spindle.position.load,
            "adaptive": machine.spindle.adaptive is not None,
        }
        if machine.spindle
        else None,
        "inputs": [name for name, _ in machine.io.inputs] if machine.io else [],
        "outputs": [name for name, _ in machine.io.outputs] if machine.io else [],
        "retract_mm": machine.retract_mm,
        "rapid_share": machine.rapid_share,
        "clearance_mm": machine.clearance_mm,
        "macros": [
            {"name": macro.name, "lines": list(macro.lines), "role": macro.role} for macro in machine.macros
        ],
        **fitted,
    }
