"""What a machine's kinematics is to all others: joints from a pose and a pose from joints.

A round tool stands by five numbers: X Y Z and two angles that tell the direction of its axis. The angles are
a *pair* of rotaries, first and second, and a motion carries these five whatever machine it is made for.
``order`` says which of them each axis of the machine is. One that no axis makes stands still at 0. Five
interpolated joints are the most (``MAX_AXES``): no axis stands beside another that does the same.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from operator import itemgetter
from types import ModuleType
from typing import ClassVar, Protocol

from controller.geometry.touches import Seen
from controller.geometry.vectors import Frame, Number, Pose, Vector, X, Y, Z, subtract
from controller.machine.model import STILL, Joints, Machine
from controller.messages import Key

Pair = tuple[float, float]
Travel = tuple[Pair, Pair]

TURN = 2.0 * math.pi
MAX_TURNS = 1000


class Kinematics(Protocol):
    """The geometry of one machine, prepared for the tick; stateless after construction.

    A machine of its own writes ``branches``, ``linear`` and ``forward``. What the others say here is true of
    one without a pole: a direction of the tool at which the rotary next to the work is free.
    """

    turning: ClassVar[int]  # how many rotaries a machine of this build has beside X, Y and Z
    axes: ClassVar[Key]  # all of its axes, as a text
    order: tuple[int, ...]  # joint i is number order[i] of X, Y, Z, first and second rotary
    arrange: Callable[[Sequence[Number]], tuple[Number, ...]]  # of these five the joints, in their order
    rotaries: Callable[[Joints], Pair]  # of the joints the pair
    lean_rad: float = 0.0  # most by which the tool axis gives way beside a pole that is missed by a hair
    unreached: str = "reach.none"  # the key of what is told where ``branches`` is nan

    def __init__(self, machine: Machine) -> None:
        self.order = order_of(machine)
        self.arrange = itemgetter(*self.order)
        pair = machine.rotary()
        self.rotaries = itemgetter(*pair) if len(pair) == 2 else self._rotaries

    def __hash__(self) -> int:
        return object.__hash__(self)  # what is remembered is of this very one

    # ---- what every machine has of its own

    def branches(
        self,
        axis: Vector,
        m: ModuleType = math,
        inside: Vector | None = None,
        keep: tuple[Number, Number] = STILL,
        seen: Seen | None = None,
    ) -> list[tuple[Number, Number]]:
        """Both pairs of rotaries (rad, carried sense) that put the spindle along ``axis`` of the table frame.

        Principal values, one pair twice where there is one only; nan where ``axis`` is out of reach. Floats,
        arrays (``m=numpy``) or series (``m=jets``). At a pole the free rotary follows ``inside``, a vector
        towards where the axis is just inside the block; without one it keeps its place in ``keep``.
        ``seen``: of a cut that touches the pole the axis with its direction there.
        """
        ...

    def linear(
        self, tip: Vector, rotaries: tuple[Number, Number], length_mm: float, m: ModuleType = math
    ) -> Vector:
        """X, Y, Z (mm) that bring the tip of a tool to ``tip`` of the table frame."""
        ...

    def forward(self, joints: Sequence[Number], length_mm: float, m: ModuleType = math) -> Pose:
        """Pose in the table frame (rotaries at zero) from joints in the order of ``machine.axes``."""
        ...

    # ---- what follows from it

    def spread(self, joints: Sequence[Number]) -> list[Number]:
        """X, Y, Z, first and second rotary of joints; the other way round than ``arrange``."""
        values: list[Number] = [0.0] * 5
        for joint, place in zip(joints, self.order, strict=True):
            values[place] = joint
        return values

    def _rotaries(self, joints: Joints) -> Pair:
        _, _, _, first, second = self.spread(joints)
        return first, second

    def inverse(
        self,
        pose: Pose,
        near: Pair,
        length_mm: float,
        inside: Vector | None = None,
        seen: Seen | None = None,
    ) -> Joints | None:
        """Joints for a pose of the table frame, on branch and turns nearest to the pair ``near`` (rad).

        ``length_mm`` is the tool's. None where the axis is out of reach.
        """
        tip, axis = pose
        near1, near2 = near
        best, least = None, math.inf
        for q1, q2 in self.branches(axis, math, inside, near, seen):
            if q1 != q1 or q2 != q2:  # nan: out of reach
                return None
            q1 += TURN * round((near1 - q1) / TURN)
            q2 += TURN * round((near2 - q2) / TURN)
            d1, d2 = q1 - near1, q2 - near2
            far = d1 * d1 + d2 * d2
            if far < least:
                best, least = (q1, q2), far
        if best is None:
            return None
        x, y, z = self.linear(tip, best, length_mm)
        return self.arrange((x, y, z, best[0], best[1]))

    def candidates(
        self, axis: Vector, inside: Vector | None, travel: Travel, keep: Pair = STILL
    ) -> list[Pair]:
        """All branches in all turns inside the travel of (first, second), rad; empty out of reach."""
        found: list[Pair] = []
        for pair in self.branches(axis, math, inside, keep):
            if not any(map(math.isnan, pair)):
                turns = [_turns(q, low, high) for q, (low, high) in zip(pair, travel, strict=True)]
                found += [(q1, q2) for q1, q2 in itertools.product(*turns) if (q1, q2) not in found]
        return found

    def tool_axis(self, rotaries: Pair) -> Vector:
        """From tip to spindle, in the table frame, with the rotaries there (floats, rad)."""
        return self.forward(self.arrange((0.0, 0.0, 0.0, *rotaries)), 0.0).axis

    def of_axes(self, frame: Frame, rotaries: Pair, length_mm: float) -> Frame:
        """A frame of the table in which X Y Z of a tip are read, as the linear axes see it.

        While the rotaries stand (floats, rad), positions of X Y Z are places of that frame.
        """
        zero = self.linear((0.0, 0.0, 0.0), rotaries, 0.0)
        turned = [subtract(self.linear(v, rotaries, 0.0), zero) for v in (frame.x, frame.y, frame.z)]
        return Frame(self.linear(frame.origin, rotaries, length_mm), *turned)

    # ---- poles, and the end of what the rotaries reach

    @property
    def work(self) -> int:
        """Which of the two rotaries (0 or 1) stands next to the work: at a pole it is free."""
        return 0

    def work_frame(self) -> tuple[Vector, Vector, Vector]:
        """Unit vectors (table frame) that ``Seen`` counts along: two across that rotary's axis, and it."""
        return X, Y, Z

    def seen(self, axis: Vector) -> Seen:
        """``axis`` as the rotary next to the work sees it."""
        return Seen(*axis, 1.0)

    def reaches_pole(self, side: float) -> bool:
        """Whether the tool axis can stand along that rotary's (``side`` > 0) or against it."""
        return False

    def near_pole(self, axis: Vector) -> bool:
        """Whether ``axis`` (floats) is so near a pole that its rotary takes its limit from inside."""
        return False

    def is_clear_of_pole(self, axis: Vector) -> bool:
        """Whether the rotaries' derivatives keep their digits where the tool is along ``axis`` (floats)."""
        return True

    def off_pole(self, axis: Vector, m: ModuleType = math) -> Number:
        """Sine of the angle between the tool axis and the axis of the rotary next to the work."""
        return 1.0 + 0.0 * axis[0]

    @property
    def is_bounded(self) -> bool:
        """Whether ``off_limit`` tells where the tool axis comes to the end of reach."""
        return False

    def off_limit(self, axis: Vector) -> Number:
        """Sine of the angle from where both branches are one, of axes whose components are (N,)."""
        return 1.0 + 0.0 * axis[0]

    def nearest_reached(self, axis: Vector, most_rad: float) -> Vector:
        """``axis`` (floats), or the nearest one in reach where that is no further off than ``most_rad``."""
        return axis


def order_of(machine: Machine) -> tuple[int, ...]:
    """Which of X, Y, Z, first and second rotary each axis of the machine is."""
    places = {index: place for place, index in enumerate((*machine.linear(), *machine.rotary()))}
    return tuple(places[i] for i in range(len(machine.axes)))


def _turns(angle: float, low: float, high: float) -> list[float]:
    """``angle`` in every turn between ``low`` and ``high``; a limit overstepped by rounding is met."""
    first = math.ceil(max((low - 1e-9 - angle) / TURN, -MAX_TURNS))
    last = math.floor(min((high + 1e-9 - angle) / TURN, MAX_TURNS))
    return [min(max(angle + TURN * k, low), high) for k in range(first, last + 1)]
