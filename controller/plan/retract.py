"""Hold, look, go on: off the part along the tool axis, wherever the operator jogs, and the same way back.

```
     path  ======*======        * held here
                 |  retract: along the tool axis
                 o-----o        jogged, as often as wanted; every turn of the way is kept
                       |
                       o        back: the same turns in reverse, then down along the tool axis
```
With another tool the tip goes the same way back: the joints are shifted by the difference
of the two lengths along the tool axis, and the last way down ends where the new tool cuts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from controller.geometry.vectors import ROUNDING
from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import Key, Said, said, text
from controller.plan.restart import entry
from controller.plan.restart.entry import along_axis
from controller.plan.restart.program_position import Spot
from controller.plan.stretch import Chain, Pause, straight
from controller.plan.surfaces import audit
from controller.program import modal
from controller.program.program import Act, Place
from controller.state.modes import Mode

RETRACT_MM_S = 10.0  # off the part, and on all of the way back but its end
CORNER_MM = 0.05  # a turn of a jogged way that is less (or so many degrees) is none


class NotPossible(Exception):
    """Why the tool cannot leave the path, or not come back, and what to do."""

    def __init__(self, why: Said) -> None:
        super().__init__(text(why))
        self.said = why


def is_held(now: Snapshot) -> bool:
    """Whether the machine is held and stands."""
    return now.mode is Mode.HOLD and now.at_rest and not now.stopping


def see_held(now: Snapshot, what: str) -> None:
    """Raises NotPossible unless the machine is held and stands."""
    if not is_held(now):
        raise NotPossible(said("aside.not_held", what=Key(f"aside.{what}"), mode=now.mode.name))


@dataclass(slots=True)
class Aside:
    """The tool is off the path; where it has been since. ``held``: joints on the path."""

    spot: Spot
    held: Joints
    place: Place
    feed_mm_s: float  # of the path where it was held
    retract_mm: float
    turns: list[Joints] = field(default_factory=list)  # of the way, the end of the retract first
    off: bool = False  # the retract has come to its end
    returning: bool = False
    _last: Joints | None = None  # seen since the last turn

    @property
    def marks(self) -> tuple[object, ...]:
        """Changes with whatever ``see`` or its owner has noted."""
        return self.off, self.returning, len(self.turns), self._last

    def see(self, now: Snapshot) -> None:
        """Note where a jog has led; call it with every snapshot."""
        here = now.joints
        if self._last is not None and _off_line(self.turns[-1], self._last, here) > CORNER_MM:
            self.turns.append(self._last)
        self._last = here
        if now.at_rest and _apart(here, self.turns[-1]) > ROUNDING:
            self.turns.append(here)
            self._last = None


def retract(aside: Aside, machine: Machine, kinematics: Kinematics) -> Iterator[Chain | Pause]:
    """The way off the path, to a stop. Raises NotPossible."""
    room = entry.room_along_axis(aside.held, machine, kinematics)
    if not 0.0 < aside.retract_mm <= room:
        raise NotPossible(said("aside.room", by=aside.retract_mm, room=room))
    off = along_axis(aside.held, aside.retract_mm, kinematics)
    aside.turns = [off]
    return _way([aside.held, off], [RETRACT_MM_S], "retract", aside.place, kinematics)


def back(
    aside: Aside,
    now: Joints,
    target: Joints,
    lengths_mm: tuple[float, float],
    machine: Machine,
    kinematics: Kinematics,
) -> Iterator[Chain | Pause]:
    """The way back from ``now`` to the joints ``target`` on the path, to a stop. Raises NotPossible.

    ``lengths_mm``: of the tool that left the path, and of the one that comes back.
    """
    before, after = lengths_mm
    if after - before >= max(aside.retract_mm, 1e-9):
        raise NotPossible(said("aside.longer", longer=after - before, off=aside.retract_mm))
    turns = [longer(turn, after - before, kinematics) for turn in (now, *reversed(aside.turns))]
    over = along_axis(target, aside.retract_mm, kinematics)
    corners = [now, *turns, over, target]
    down = min(RETRACT_MM_S, aside.feed_mm_s)
    feeds = [RETRACT_MM_S if aside.retract_mm else down] * (len(corners) - 2) + [down]
    for corner in corners:
        excess = audit.outside_at(machine, corner)
        if excess is not None:
            beyond = audit.beyond(machine.axes[excess.axis], excess)
            raise NotPossible(said("travel.beyond_back", **beyond))
    return _way(corners, feeds, "return", aside.place, kinematics)


def longer(joints: Joints, by_mm: float, kinematics: Kinematics) -> Joints:
    """The joints at which a tool that is longer by ``by_mm`` has its tip in the same place."""
    return along_axis(joints, by_mm, kinematics) if by_mm else joints


def _way(
    corners: list[Joints], feeds: list[float], name: str, place: Place, kinematics: Kinematics
) -> Iterator[Chain | Pause]:
    legs: Iterable[tuple[Joints, Joints, float]] = zip(corners[:-1], corners[1:], feeds, strict=True)
    stretches = [straight(name, place, a, b, feed, kinematics) for a, b, feed in legs]
    yield from (Chain((stretch,)) for stretch in stretches if stretch is not None)
    yield Pause(place, modal.power_on().modal, act=Act.STOP)


def _apart(a: Joints, b: Joints) -> float:
    return max(abs(p - q) for p, q in zip(a, b, strict=True))


def _off_line(start: Joints, middle: Joints, end: Joints) -> float:
    """How far ``middle`` is off the line from ``start`` to ``end``, in mm, or degrees of a rotary."""
    way, part = _scaled(start, end), _scaled(start, middle)
    square = sum(w * w for w in way)
    share = sum(w * p for w, p in zip(way, part, strict=True)) / square if square > 0.0 else 0.0
    return max(abs(p - min(max(share, 0.0), 1.0) * w) for w, p in zip(way, part, strict=True))


def _scaled(start: Joints, end: Joints) -> list[float]:
    return [b - a for a, b in zip(start, end, strict=True)]
