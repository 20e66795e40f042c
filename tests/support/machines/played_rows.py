"""What the pump has handed over, held against the recorder's rows, the program and the drives' limits.

By the frames alone: a drive that is told to follow is sent no jump and no more than its limits; a row says
what was sent two periods later; a row's place on its motion is where its joints are, and the next one is not
far from it. Whatever a late tick finds, and whatever befalls the bus meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from support.machines import late_runs
from support.machines.late_runs import COUNTS, ROUNDED, Healthy, Played, Verdict, Watched

from controller.geometry.arrays import Array
from controller.ipc.handoff import (
    BRAKED,
    COLUMN,
    OFF_PATH,
    PLAYED,
    STOOD,
    TAKEN_BACK,
    TAKEN_BACK_BRAKED,
    of_axes,
)
from controller.runtime.startup import SessionError
from controller.runtime.stepped import Run
from controller.state.modes import Mode, Request
from controller.tick.stock import DELAY
from drives.commission import CommissionError
from drives.pump.plan_memory import FOLLOWS, Phase

ON_PATH_MM = 1e-6  # or rad: of a row from the place that it names
BESIDE_MM = 0.010  # along a stop the counts go by cubics through the path's rows
RESTS_S = 1.0  # after a fault, until the drives are without torque
ENABLED = 0x0F  # of a controlword (CiA 402)
TAKEN = TAKEN_BACK | TAKEN_BACK_BRAKED


def judged(
    healthy: Healthy, child: Watched, verdict: Verdict, period: int, braked: int, run: Run | None
) -> None:
    """As ``late_runs.Judge``; what motors do where the bus itself has faults is judged elsewhere."""
    if not verdict.late.faults:
        late_runs.judged(healthy, child, verdict, period, braked, run)
    verdict.result = verdict.result or child.cycle.modes.fault.name
    verdict.wrongs += wrongs(healthy, child, period, verdict)
    for name in seen(child):
        verdict.shares[name] = 1.0
    if not verdict.late.again or run is None:
        return
    child.at_tick = lambda: None
    child.go(round(RESTS_S / child.machine.period_s))
    try:
        if child.cycle.modes.mode in (Mode.FAULT, Mode.OFF):
            child.request(Request.RESET)
            child.go(round(RESTS_S / child.machine.period_s))
            child.commission_again()
            child.come_up()
        period = child.cycle.tick
        run = child.run(child.walk(healthy.text))
    except (SessionError, CommissionError) as error:
        if not verdict.late.faults:  # what is left of them would befall it as it comes up
            verdict.wrongs.append(f"does not come up again: {error}")
        return
    verdict.shares["again"] = 1.0
    verdict.wrongs += (f"again: {one}" for one in wrongs(healthy, child, period, verdict))


def wrongs(healthy: Healthy, child: Watched, since: int, verdict: Verdict) -> Iterator[str]:
    """What does not hold from the period ``since`` on."""
    child._drain()
    rows = np.concatenate(child._rows)
    rows = rows[rows[:, COLUMN["tick"]] >= since]
    yield from _jumps(healthy, child, since)
    yield from _claims(healthy, child, rows, verdict)
    yield from _places(healthy, child, rows)


# ---- what each drive was sent


def _jumps(healthy: Healthy, child: Watched, since: int) -> Iterator[str]:
    names = [axis.name for axis in healthy.machine.axes]
    for i, name in enumerate(names):
        for begin, stretch in _led(child.played, i, since):
            played = child.played[begin]
            off = abs(stretch[0] * healthy.units[i] - played.motors[i])
            if begin > since and off > healthy.most[0][i] + healthy.machine.axes[i].following.rest:
                yield f"{name} begins to follow {off:.4f} beside its motor in period {begin}"
            values = np.array(stretch) * healthy.units[i]
            for n, most in enumerate(healthy.most, 1):
                found = np.abs(np.diff(values, n)) - 0.5 * n * COUNTS * abs(healthy.units[i])
                own = healthy.of_setpoints[n - 1]
                if found.size and found.max() > most[i] * max(ROUNDED, own * 1.0005):
                    at = begin + int(found.argmax())
                    share = found.max() / most[i]
                    yield f"{name} is sent {share:.4f} of its {('speed', 'acceleration')[n - 1]} at {at}"


def _led(played: dict[int, Played], i: int, since: int) -> Iterator[tuple[int, list[int]]]:
    """(first period, what was sent): while a drive goes by its setpoints, and the pump sends."""
    begin, found = -1, list[int]()
    for n in range(since, max(played) + 2):
        one = played.get(n)
        if one is not None and _follows(one.words[i]) and one.phase is not Phase.SILENT:
            begin = n if not found else begin
            found.append(one.counts[i])
        elif found:
            yield begin, found
            found = []


def _follows(word: int) -> bool:
    """Whether a drive goes by its setpoint, and is not told to stop by itself."""
    return word & FOLLOWS != 0 and word & ENABLED == ENABLED


# ---- what the rows claim


def _claims(healthy: Healthy, child: Watched, rows: Array, verdict: Verdict) -> Iterator[str]:
    """A row's setpoints go out two periods later; one that was taken back says so in the next row.

    Where axes turn back with play, how far that has come is another along a stop: what is left of it is led
    while the path stands, and never while it moves.
    """
    axes, played = len(healthy.machine.axes), child.played
    switches = rows[:, COLUMN["switches"]].astype(int)
    ticks, sent = rows[:, COLUMN["tick"]].astype(int), rows[:, of_axes("setpoint", axes)].astype(np.int64)
    joints = rows[:, of_axes("joint_command", axes)]
    same = (joints[1:] == joints[:-1]).all(axis=1)
    stands = np.r_[True, same] | np.r_[same, True]  # also the row that comes to rest
    for k, (tick, switch) in enumerate(zip(ticks.tolist(), switches.tolist(), strict=True)):
        one = played.get(tick + DELAY)
        next_row = switches[k + 1] if k + 1 < len(rows) else TAKEN
        if one is None or switch & OFF_PATH or next_row & (TAKEN | STOOD):
            continue
        if one.phase in (Phase.SILENT, Phase.GAP):
            continue
        follows = np.array([_follows(word) for word in one.words])
        off = np.abs(np.array(one.counts) - sent[k]) * np.abs(healthy.units) * follows
        brakes = switch & BRAKED or one.phase is Phase.BRAKING
        most = BESIDE_MM * bool(switch & BRAKED) + healthy.play_mm * bool(brakes or stands[k])
        verdict.shares["led"] = max(verdict.shares.get("led", 0.0), float(off.max()) * (not brakes))
        if off.max() > most:
            what = f"{off.max():.7f} in axis {int(off.argmax())}, {one.phase.name}, switches {switch}"
            yield f"the row of {tick} is not what was sent: {what}"


def _places(healthy: Healthy, child: Watched, rows: Array) -> Iterator[str]:
    """The joints of a row are those of its motion at its place."""
    axes, kinematics, segments = len(healthy.machine.axes), child.kinematics, child.planner.segments
    on = rows[rows[:, COLUMN["switches"]].astype(int) & OFF_PATH == 0]
    joints = on[:, of_axes("joint_command", axes)].tolist()
    ids, places = on[:, COLUMN["motion_id"]].astype(int).tolist(), on[:, COLUMN["s"]].tolist()
    ticks = on[:, COLUMN["tick"]].astype(int).tolist()
    for tick, here, number, s in zip(ticks, joints, ids, places, strict=True):
        if number not in segments or child.cycle.jogging.away:
            continue
        there = segments[number].motion.joints(s, kinematics.rotaries(here), kinematics)
        off = np.inf if there is None else float(np.abs(np.subtract(there, here)).max())
        if off > ON_PATH_MM:
            yield f"the row of {tick} is {off:.7f} beside motion {number} at {s:.6f}"


def seen(child: Watched) -> Sequence[str]:
    """What the rows have been through, for the figures of a search."""
    switches = np.concatenate(child._rows)[:, COLUMN["switches"]].astype(int)
    bits = {"played": PLAYED, "braked": BRAKED, "stood": STOOD, "taken_back": TAKEN, "off_path": OFF_PATH}
    return [name for name, bit in bits.items() if (switches & bit).any()]
