"""Hold, look, go on: off the part along the tool axis, wherever one jogs, and back by a way of its own.

```
     path  ======*======        * held here
                 |  retract: along the tool axis, as often as wanted
                 o-----o        jogged
```
Where the tool has been meanwhile does not matter to the way back: it is laid from where the tool stands, with
what is in the spindle by then (``restart.entry``), to a place off the part. There the tool waits, and goes in
by a lead once it is resumed (``restart.reentry``).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import Key, message
from controller.plan.restart import reentry
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import RETRACT_MM_S, NotPossible, along_axis
from controller.plan.stretch import Chain, Pause, Stretch, straight
from controller.program import modal
from controller.program.program import Act, Place
from controller.state.modes import Mode

__all__ = ["RETRACT_MM_S", "Aside", "NotPossible"]


def is_held(now: Snapshot) -> bool:
    """Whether the machine is held and stands."""
    return now.mode is Mode.HOLD and now.at_rest and not now.stopping


def see_held(now: Snapshot, what: str) -> None:
    """Raises NotPossible unless the machine is held and stands."""
    if not is_held(now):
        raise NotPossible(message("aside.not_held", what=Key(f"aside.{what}"), mode=now.mode.name))


@dataclass(slots=True)
class Aside:
    """The tool is off the path. ``held``: joints on the path."""

    spot: Spot
    held: Joints
    place: Place
    retracted: bool = False  # at least once: it does not come back to the path by jogging
    off: bool = False  # the retract has come to its end
    returning: bool = False

    @property
    def marks(self) -> tuple[object, ...]:
        """Changes with whatever its owner has noted."""
        return self.off, self.returning, self.retracted


def retract(
    now: Joints, by_mm: float, place: Place, machine: Machine, kinematics: Kinematics
) -> Iterator[Chain | Pause]:
    """The way off along the tool axis, to a stop. Raises NotPossible."""
    room = reentry.room_along_axis(now, machine, kinematics)
    if not 0.0 < by_mm <= room:
        raise NotPossible(message("aside.room", by=by_mm, room=room))
    off = straight("retract", place, now, along_axis(now, by_mm, kinematics), RETRACT_MM_S, kinematics)
    return ending([] if off is None else [off], place)


def ending(way: Iterable[Stretch], place: Place) -> Iterator[Chain | Pause]:
    """A way aside: one move after the other, to a stop."""
    yield from (Chain((stretch,)) for stretch in way)
    yield Pause(place, modal.power_on().modal, act=Act.STOP)
