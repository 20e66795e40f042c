"""Differences of the commanded joints against the limits, over every row, so that a failure names its place.

The judge sees what an outside observer of ``simulate`` sees: joints per period and what
the machine said it was doing. Nothing of the plan is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from support.machines.stepped_runs import Cut, shares

from controller.ipc.handoff import COLUMN
from controller.runtime.events import Event
from controller.state.modes import Fault, Mode

BOUNDS = (1.0005, 1.002, 1.02)  # of velocity, acceleration and jerk, for differences over one period
KINDS = ("velocity", "acceleration", "jerk")
STILL = 3  # rows of standstill before and behind a run, so that its ends count too
RECENT = 200  # ticks within which an event is named


class Share(NamedTuple):
    """The largest share of one limit of one axis, and where it came."""

    kind: int  # 0 velocity, 1 acceleration, 2 jerk
    axis: str
    share: float
    tick: int  # row of the trace whose joints completed the difference
    where: str

    def __str__(self) -> str:
        return f"{self.share:.4f} of {self.axis}'s {KINDS[self.kind]} at {self.where}"


def standing(done: Cut, start: Sequence[float] | None = None) -> np.ndarray:
    """Joints (N + 2 STILL, 5) with standstill at both ends; a run starts from the homing positions.

    Ticks that sent no SYNC moved nothing and are left out.
    """
    home = [axis.homing.position for axis in done.machine.axes] if start is None else start
    moved = done.joints[done.column("sync_sent") != 0.0]
    ends = [moved[-1]] * STILL if done.run.fault is Fault.NONE else []
    return np.array([home] * STILL + [*moved] + ends)


def worst(done: Cut, events: Sequence[Event] = (), start: Sequence[float] | None = None) -> list[Share]:
    """The largest share of each limit of each axis, the worst first."""
    joints = standing(done, start)
    rows = np.flatnonzero(done.column("sync_sent") != 0.0)
    found = []
    for kind, of_kind in enumerate(shares(joints, done.machine)):
        for i, axis in enumerate(done.machine.axes):
            k = int(of_kind[:, i].argmax())
            tick = int(rows[np.clip(k + kind + 1 - STILL, 0, len(rows) - 1)])
            found.append(Share(kind, axis.name, float(of_kind[k, i]), tick, happening(done, tick, events)))
    return sorted(found, key=lambda share: share.share / BOUNDS[share.kind], reverse=True)


def happening(done: Cut, tick: int, events: Sequence[Event] = ()) -> str:
    """What went on at a row of the trace, in words."""
    row = done.rows[tick]
    mode = Mode(int(row[COLUMN["mode"]])).name.lower()
    segment = done.segments.get(int(row[COLUMN["motion_id"]]))
    name = segment.name if segment is not None else "standstill"
    near = [e for e in events if 0 <= tick - e.tick <= RECENT]
    after = f", {tick - near[-1].tick} ticks after {near[-1].request.name} {near[-1].value:g}" if near else ""
    line, s = int(row[COLUMN["line"]]), row[COLUMN["s"]]
    return f"tick {tick} ({mode}, {name}, line {line}, s = {s:.4f}{after})"


def assert_in_limits(
    done: Cut, label: object, events: Sequence[Event] = (), start: Sequence[float] | None = None
) -> None:
    """First, second and third differences within 1.0005, 1.002 and 1.02 of the limits, at every row."""
    found = worst(done, events, start)
    top = [max(s.share for s in found if s.kind == kind) for kind in range(3)]
    print(f"\n{label}: velocity {top[0]:.4f}, acceleration {top[1]:.4f}, jerk {top[2]:.4f}")
    over = [str(share) for share in found if share.share > BOUNDS[share.kind]]
    assert not over, f"{label}: " + "; ".join(over)
