"""The rows of the fault matrix that only processes can show, in every mode, and what came of them.

Times are those of the bus: the stamps of its frames. A position is seen where a frame tells it, so a
standstill is dated by the last frame that shows motion.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from support.faults.process_scene import MODES, ProcessScene
from support.live.live_machines import until
from support.oracles import latched_setpoints

from controller.ipc.handoff import COLUMN, Snapshot
from controller.state import stop_times
from controller.state.modes import ALL_AXES, FAULTS, Fault, Mode, stands_within_s
from drives import cia402, pdo
from drives.cia402 import State

LATE_S = 0.1  # what a hub that shares two processors with others may write too late
SETTLED_S = 0.3  # looked at for so long after the promise
GOES_ON_TICKS = 250
LOOKED_AT, MIN_ROWS = 30_000, 10  # rows of the recorder
ON_PATH = (Mode.READY, Mode.RUNNING, Mode.HOLD, Mode.STOPPING, Mode.JOG, Mode.FAULT)

N, F = Fault.NONE, Fault
SKIPS = frozenset({F.TOO_MANY_SKIPS})
BUS = frozenset({F.BUS_ERROR, F.BUS_OFF, F.SEND_FAILED, F.FEEDBACK_LOST, F.NODE_RESET, F.HEARTBEAT_LOST})


class Cell(NamedTuple):
    """What came of one fault in one mode; ``promised_s`` 0 = nothing had to stop."""

    case: str
    mode: str
    fault: Fault
    stood_s: float
    promised_s: float
    problems: tuple[str, ...]

    def text(self) -> str:
        word = self.fault.name if self.fault is not N else "goes on"
        took = f" {1000 * self.stood_s:.0f}/{1000 * self.promised_s:.0f} ms" if self.promised_s else ""
        return word + took + (" !" if self.problems else "")


# ---- what is done ----------------------------------------------------------------------------


def tick_killed(scene: ProcessScene, mode: str) -> list[Cell]:
    """The drives stop by their own supervision; the parent keeps the recording; then all begins anew."""
    assert scene.tick is not None
    os.kill(scene.tick.pid, signal.SIGKILL)
    scene.tick.process.wait()
    promised_s = _promise(scene, F.CONTROLLER_GONE)
    scene.look_until(time.time() + promised_s + SETTLED_S)
    struck_s = max(at for at, frame in scene.log.frames() if pdo.unpack(frame)[0] == pdo.SYNC)
    stood_s = scene.stood_after_s(struck_s)
    problems = _stood(stood_s, promised_s) + _smooth(scene)
    states = [cia402.state(scene.client.read(node, 0x6041) & 0xFFFF) for node in scene.nodes]
    held = [axis.name for axis, state in zip(scene.machine.axes, states, strict=True) if _moves(state)]
    if held:
        problems.append(f"{held} are still in operation")
    scene.keeper.keep(scene.now, F.CONTROLLER_GONE)
    problems += _recorded(scene, F.CONTROLLER_GONE)
    scene.end_controller()
    return [Cell("tick SIGKILL", mode, F.CONTROLLER_GONE, stood_s, promised_s, tuple(problems))]


def _moves(state: State) -> bool:
    return state in (State.OPERATION_ENABLED, State.FAULT_REACTION_ACTIVE)


def tick_stopped(scene: ProcessScene, mode: str) -> list[Cell]:
    """Shortly, longer, and so long that the drives have given it up; the first two may well go on."""
    cells: list[Cell] = []
    for stopped_s in (0.005, 0.05, 0.5):
        if cells and (cells[-1].fault is not N or not scene.again(mode)):
            break
        struck_s = scene.bus_s()
        scene.stop_tick(stopped_s)
        now = _settled(scene)
        named = SKIPS if stopped_s >= 0.5 else SKIPS | {N}
        # The drives did not wait for the controller.
        cells.append(_judged(scene, f"tick SIGSTOP {stopped_s * 1000:.0f} ms", mode, now, named, struck_s))
    return cells


def planner_killed(scene: ProcessScene, mode: str) -> list[Cell]:
    assert scene.plan is not None
    struck_s, queued = scene.bus_s(), scene.now
    struck_s += max(0.0, queued.queue_end_s - queued.plan_time_s)  # to its end the cut goes on
    scene.plan.process.kill()
    scene.plan.process.wait()
    scene.meet()
    named = frozenset({F.PLANNER_GONE if mode in ("cutting", "resume") else N})
    if mode == "homing":
        until(lambda: scene.now.mode is not Mode.HOMING)
    if mode in ("cutting", "resume"):
        until(lambda: scene.now.mode is not Mode.RUNNING)
    now = _settled(scene)
    return [_judged(scene, "planner killed", mode, now, named, struck_s)]


def hub_restarted(scene: ProcessScene, mode: str) -> list[Cell]:
    """Drives that have just been switched on know nothing: they must not move, and nothing is trusted."""
    scene.restart_hub()
    now = _settled(scene)
    problems = _named(now, BUS) + _smooth(scene)
    if mode != "homing" and now.untrusted != ALL_AXES:
        problems.append(f"still trusted: {ALL_AXES & ~now.untrusted:05b}")
    problems += [f"homed: {now.homed:05b}"] if now.homed else []
    states = {cia402.state(scene.client.read(node, 0x6041) & 0xFFFF) for node in scene.nodes}
    counts = {scene.client.read(node, 0x6064) for node in scene.nodes}
    if states != {State.SWITCH_ON_DISABLED} or counts != {0}:
        problems.append(f"new drives are in {states} at {counts}")
    problems += _recorded(scene, now.fault)
    return [Cell("hub restarted", mode, now.fault, 0.0, 0.0, tuple(problems))]


CASES: dict[str, Callable[[ProcessScene, str], list[Cell]]] = {
    "tick_killed": tick_killed,
    "tick_stopped": tick_stopped,
    "planner_killed": planner_killed,
    "hub_restarted": hub_restarted,
}


# ---- what is judged ----------------------------------------------------------------------------


def _settled(scene: ProcessScene) -> Snapshot:
    """The snapshot when a fault stands and is kept, or when the machine has gone on for a while."""
    begun = scene.now.tick

    def done() -> bool:
        now = scene.now
        kept = scene.keeper.look(now)
        if now.mode is Mode.FAULT:
            return kept and now.at_rest
        return now.tick > begun + GOES_ON_TICKS

    until(done)
    return scene.now


def _judged(
    scene: ProcessScene, case: str, mode: str, now: Snapshot, named: frozenset[Fault], struck_s: float
) -> Cell:
    problems = _named(now, named) + _smooth(scene) + _trusted(now)
    stood_s = promised_s = 0.0
    stops = FAULTS[now.fault].reaction > 0 or (case == "planner killed" and mode == "jog")
    if stops:
        fault = now.fault if now.fault is not N else F.PLANNER_GONE
        promised_s = _promise(scene, fault)
        if now.warning is not N:  # the drives had given the controller up
            promised_s = max(promised_s, _promise(scene, F.CONTROLLER_GONE))
        stood_s = scene.stood_after_s(struck_s)
        problems += _stood(stood_s, promised_s)
    if now.fault is not N:
        problems += _recorded(scene, now.fault)
    elif scene.keeper.saved:
        problems.append("a recording without a fault")
    return Cell(case, mode, now.fault, stood_s, promised_s, tuple(problems))


def _promise(scene: ProcessScene, fault: Fault) -> float:
    return stands_within_s(fault, stop_times.of(scene.machine))


def _stood(stood_s: float, promised_s: float) -> list[str]:
    if stood_s <= promised_s + LATE_S:
        return []
    return [f"stood after {1000 * stood_s:.0f} ms, promised {1000 * promised_s:.0f} ms"]


def _named(now: Snapshot, named: Iterable[Fault]) -> list[str]:
    allowed = set(named)
    if now.fault in allowed:
        return []
    return [f"was called {now.fault.name} (also {now.warning.name}), not {sorted(f.name for f in allowed)}"]


def _trusted(now: Snapshot) -> list[str]:
    """What a fault or its companion has cost must be homed again; nothing else."""
    costs = any(not FAULTS[one].position_trusted for one in (now.fault, now.warning))
    found = ["axes are homed and not trusted"] if now.homed & now.untrusted else []
    if now.fault is not N and costs != bool(now.untrusted) and now.homed | now.untrusted == ALL_AXES:
        found.append(f"untrusted axes: {now.untrusted:05b}")
    return found


def _smooth(scene: ProcessScene) -> list[str]:
    """What the drives were told on the path keeps the limits, and begins from rest after a gap."""
    rows = scene.recorder.last(LOOKED_AT)
    # With a quick stop, and off the path, what is commanded is where the drives are.
    good = np.isin(rows[:, COLUMN["mode"]], ON_PATH) & np.isin(rows[:, COLUMN["fault"]], (N, F.PLANNER_GONE))
    last = int(np.flatnonzero(good)[-1]) + 1 if good.any() else 0
    others = np.flatnonzero(~good[:last])
    rows = rows[int(others[-1]) + 1 if len(others) else 0 : last]
    if len(rows) < MIN_ROWS:
        return []
    velocity, acceleration, _ = latched_setpoints.most(rows, scene.machine)
    found = [f"velocity {velocity:.4f} of the limit"] if velocity > 1.0 + 1e-6 else []
    return found + ([f"acceleration {acceleration:.4f} of the limit"] if acceleration > 1.001 else [])


def _recorded(scene: ProcessScene, fault: Fault) -> list[str]:
    made = scene.keeper.saved
    if made is None:
        return [f"nothing was recorded: {scene.keeper.problem}"]
    names = sorted(path.name for path in made.iterdir())
    wrong = names != ["fault.json", "frames.log", "trace.npz"] or fault.name not in made.name
    return [f"recorded: {made.name} with {names}"] if wrong else []


# ---- a row ----------------------------------------------------------------------------------------


def row(case: str, folder: Path) -> list[Cell]:
    """A process fault in mode after mode, on one bus; each recovery is shown by what follows it."""
    scene = ProcessScene(folder)
    try:
        cells: list[Cell] = []
        for mode in MODES:
            if mode != "homing":
                _start_again(scene)
            scene.bring(mode)
            cells += CASES[case](scene, mode)
        _start_again(scene)
        scene.ready()
    finally:
        scene.close()
    return cells


def _start_again(scene: ProcessScene) -> None:
    """As the remedy says: another controller where it is gone, otherwise reset and go on."""
    if scene.tick is None:
        scene.start_controller()
    else:
        scene.off()
        scene.start_plan()


def table(cells: list[Cell]) -> str:
    """The matrix as text: a row per fault, a column per mode; ! = not as it should be."""
    rows = [["process fault", *MODES]]
    for name in dict.fromkeys(cell.case for cell in cells):
        here = {cell.mode: cell.text() for cell in cells if cell.case == name}
        rows.append([name, *(here.get(mode, "over before") for mode in MODES)])
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join("  ".join(t.ljust(w) for t, w in zip(r, widths, strict=True)).rstrip() for r in rows)
