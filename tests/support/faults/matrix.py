"""Faults x modes: does each, judges what came of it, and brings the machine back to work.

One machine goes through all modes of a fault, so that "run again" is shown by the next mode.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from support.faults.cases import AXIS, Case
from support.faults.invariants import allowed, wrongs
from support.faults.scene import MODES, Scene, jumps, stood_after_s

from controller.runtime.bench.observer import Sight
from controller.state.modes import FAULTS, Fault, Mode, Reaction, Recovery, Request, stands_within_s

SLACK = 1.003  # rounding to counts


@dataclass(frozen=True, slots=True)
class Cell:
    """What came of one fault in one mode."""

    case: str
    mode: str
    fault: Fault
    stood_s: float
    promised_s: float
    jump: float  # largest step of a setpoint in use, share of the velocity limit
    fastest: float  # of the motors, share of the velocity limit
    problems: tuple[str, ...]

    def text(self) -> str:
        word = self.fault.name if self.fault is not Fault.NONE else "goes on"
        took = f" {1000.0 * self.stood_s:.0f}/{1000.0 * self.promised_s:.0f} ms" if self.promised_s else ""
        return f"{word}{took}" + (" !" if self.problems else "")


def run(case: Case, mode: str, scene: Scene) -> Cell:
    """One cell; the scene is left ready for the next one."""
    _make_ready(scene, mode)
    scene.looks.clear()
    scene.observer.begin(0.0)
    began_s = scene.rig.now_s
    scene.resumed_s = math.inf
    struck: list[float] = []

    def strike() -> None:
        struck.append(scene.rig.now_s)
        case.strike(scene)

    MODES[mode](scene, strike)
    scene.after_tick = lambda: None
    fault = _shown(scene)
    sight = scene.observer.sight
    promised_s = stands_within_s(fault, scene.times)
    event_s = _event_s(sight, struck[0] - began_s, fault) + began_s
    stood_s = stood_after_s(scene, event_s, case.free) if fault is not Fault.NONE else 0.0
    jump, slope = jumps(scene)
    limits = [axis.limits.velocity for axis in scene.machine.axes]
    fast = float((sight.turned / limits).max())
    problems = [
        *_named(case, mode, scene, fault),
        *_stood(stood_s, promised_s),
        *_smooth(jump, slope),
        *wrongs(sight, scene.times),  # whatever the machine says of it
        *_recorded(scene, fault),
        *_recovered(scene, fault, mode),
    ]
    return Cell(case.name, mode, fault, stood_s, promised_s, jump, fast, tuple(problems))


def _event_s(sight: Sight, struck_s: float, fault: Fault) -> float:
    """When what the promise counts from was: of a following error the first tick outside of the window.

    A plan that is gone counts from the end of the queue, where it is told.
    """
    if fault is Fault.PLANNER_GONE:
        return next((seen.time_s for seen in sight.ticks if seen.fault is fault), struck_s)
    if fault is not Fault.FOLLOWING_ERROR:
        return struck_s
    beyond = (sight.distance > allowed(sight)).any(axis=1)
    return next(
        (
            seen.time_s
            for seen, off in zip(sight.ticks, beyond, strict=True)
            if off and seen.time_s >= struck_s
        ),
        struck_s,
    )


def _make_ready(scene: Scene, mode: str) -> None:
    modes = scene.cycle.modes
    if modes.mode is Mode.READY and mode == "homing":
        scene.request(Request.DISABLE)
        scene.settle(0.4)
    elif modes.mode is not Mode.READY and mode != "homing":
        scene.come_up()
    scene.settle(0.05)


def _shown(scene: Scene) -> Fault:
    """The fault; a hold of the machine's own has been resumed, and stopped, since it was shown."""
    seen = [look.fault for look in scene.looks if FAULTS[look.fault].reaction is Reaction.HOLD]
    return scene.cycle.modes.fault or (seen[-1] if seen else Fault.NONE)


def _named(case: Case, mode: str, scene: Scene, fault: Fault) -> list[str]:
    modes, found = scene.cycle.modes, []
    if fault not in case.allowed(mode):
        wanted = ", ".join(one.name for one in case.allowed(mode))
        found.append(f"was called {fault.name} of axis {modes.fault_axis}, not {wanted}")
    row = FAULTS[fault]
    if row.reaction is Reaction.LOST_DRIVE and modes.fault_axis != AXIS and not case.all_axes:
        found.append(f"axis {modes.fault_axis} was named")
    trusted = not modes.untrusted
    # What is being homed has no position yet; what came on top may have cost it.
    expected = row.position_trusted and FAULTS[modes.warning].position_trusted and mode != "homing"
    if fault is not Fault.NONE and trusted is not expected:
        found.append(f"position trusted: {trusted}")
    if modes.homed & modes.untrusted:
        found.append("axes are homed and not trusted")
    return found


def _stood(stood_s: float, promised_s: float) -> list[str]:
    if stood_s <= promised_s:
        return []
    return [f"stood after {1000 * stood_s:.0f} ms, promised {1000 * promised_s:.0f} ms"]


def _smooth(jump: float, slope: float) -> list[str]:
    found = []
    if jump > SLACK:
        found.append(f"a setpoint stepped {jump:.3f} times the velocity limit")
    if slope > SLACK:
        found.append(f"setpoints accelerated {slope:.3f} times the limit")
    return found


def _recorded(scene: Scene, fault: Fault) -> list[str]:
    keeper = scene.keeper
    if scene.cycle.modes.mode is not Mode.FAULT:
        return ["a recording without a fault"] if keeper.saved else []
    if keeper.saved is None:
        return ["nothing was recorded"]
    names = sorted(path.name for path in keeper.saved.iterdir())
    facts = json.loads((keeper.saved / "fault.json").read_text())
    found = [] if names == ["fault.json", "frames.log", "trace.npz"] else [f"recorded: {names}"]
    if facts["fault"] != fault.name:
        found.append(f"the recording says {facts['fault']}")
    if str(keeper.saved) not in scene.fault_text:
        found.append("the sentence does not name the recording")
    return found


def _recovered(scene: Scene, fault: Fault, mode: str) -> list[str]:
    """As the remedy says, and not less: an axis that is not trusted forbids the start."""
    least = Recovery.HOME if mode == "homing" else Recovery.NOTHING
    recovery = max(FAULTS[fault].recovery, FAULTS[scene.cycle.modes.warning].recovery, least)
    scene.heal()
    if scene.cycle.modes.mode is not Mode.FAULT:
        return [] if fault is Fault.NONE or _came_back(scene) else ["it did not go on after RESUME"]
    scene.request(Request.RESET)
    scene.settle(0.05)
    if recovery >= Recovery.COMMISSION:
        scene.commission_again()
    if recovery >= Recovery.HOME:
        scene.come_up()
    else:
        scene.request(Request.ENABLE)
        scene.settle(0.4)
    modes = scene.cycle.modes
    if modes.mode is not Mode.READY or modes.fault is not Fault.NONE or modes.untrusted:
        return [f"after {recovery.name} it is in {modes.mode.name} with {modes.fault.name}"]
    return []


def _came_back(scene: Scene) -> bool:
    """Whether a hold that was resumed ran again, without its reason."""
    after = [look for look in scene.looks if look.at_s > scene.resumed_s]
    return any(look.mode is Mode.RUNNING and look.fault is Fault.NONE for look in after)


def table(cells: list[Cell]) -> str:
    """The matrix as text: a row per fault, a column per mode; ! = not as it should be."""
    rows = [["fault", *MODES]]
    for name in dict.fromkeys(cell.case for cell in cells):
        here = {cell.mode: cell.text() for cell in cells if cell.case == name}
        rows.append([name, *(here.get(mode, "") for mode in MODES)])
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join(text.ljust(w) for text, w in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def row(
    case: Case, folder: Path, modes: Iterable[str] = MODES, made: Callable[[Path], Scene] = Scene
) -> list[Cell]:
    """A fault in mode after mode, on one machine; recordings go to ``folder``."""
    scene = made(folder)
    return [run(case, mode, scene) for mode in modes]
