"""What the drives were really told: a setpoint counts when a SYNC has them use it.

After a long gap the tick takes back what no SYNC has latched and begins again from rest, for the
drives have stood meanwhile. So a run is a row of parts, each of them smooth, and each after the
first out of rest. Where a plan came too late for its step, the row of that step is none of what was
sent, and no row has what was: there a part ends, too, and the next begins as it is.
"""

from __future__ import annotations

import numpy as np
from support.machines.stepped_runs import shares

from controller.ipc.handoff import COLUMN, STOOD, TAKEN_BACK, TAKEN_BACK_BRAKED
from controller.machine.model import Machine

REST = 3  # places in a row that are the same
AXES = 5  # of the machines that it knows


def parts(rows: np.ndarray, first: str = "joint_command_0") -> list[np.ndarray]:
    """(N, 5) each: the commands of the recorder's ``rows`` as SYNCs latched them, gap to gap.

    A part after a gap begins with the place of the last one before it, three times: at rest.
    """
    switches = rows[:, COLUMN["switches"]].astype(int)
    taken_back = switches & (TAKEN_BACK | TAKEN_BACK_BRAKED) != 0
    sent = (rows[1:, COLUMN["sync_sent"]] != 0.0) & ~taken_back[1:]
    used = rows[:-1, COLUMN[first] : COLUMN[first] + AXES]
    gaps = np.flatnonzero((switches & STOOD != 0) | taken_back)
    found, begin = [], 0
    for end in [*gaps, len(rows)]:
        here = used[begin:end][sent[begin:end]]
        if found and len(found[-1]) and not (begin < len(rows) and taken_back[begin]):
            here = np.concatenate([np.repeat(found[-1][-1:], REST, axis=0), here])
        found.append(here)
        begin = end
    return found


def most(rows: np.ndarray, machine: Machine) -> tuple[float, float, float]:
    """Largest share of velocity, acceleration and jerk limits in any part."""
    tables = [shares(part, machine) for part in parts(rows) if len(part) > REST]
    first, second, third = (max(float(t[k].max(initial=0.0)) for t in tables) for k in range(3))
    return first, second, third


def described(rows: np.ndarray, machine: Machine) -> str:
    """Each part with more than a thousandth over the limit of acceleration: its length, where, the axis."""
    found = []
    for k, part in enumerate(parts(rows)):
        if len(part) > REST:
            acceleration = shares(part, machine)[1]
            at, axis = np.unravel_index(int(np.argmax(acceleration)), acceleration.shape)
            if acceleration[at, axis] > 1.001:
                beside = part[max(at - 2, 0) : at + 4, axis].tolist()
                found.append(f"part {k} of {len(part)}: {machine.axes[axis].name} at {at}, {beside}")
    return "; ".join(found)
