"""What an operator wants to jog, as a line of the joints for the tick: the same one while a key is down.

Three frames, all with the rotaries where they are, so that every line is straight:

* ``joint``: one axis of the machine file, in the sense that is shown;
* ``part``: X Y Z of the active work offset;
* ``tool``: Z along the tool axis away from the part, X and Y across it.

Two linear axes make a diagonal, ``X+Y`` or ``X-Y``, in any of them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from controller import messages
from controller.geometry.vectors import ROUNDING, Frame, Vector, X, Y, Z, norm, rotate, scale, subtract, unit
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Jog, Snapshot
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Joints, Kind, Machine
from controller.state.modes import Mode

FRAMES = ("joint", "part", "tool")
_LETTERS: dict[str, Vector] = {"X": X, "Y": Y, "Z": Z}
_NOISE = 1e-12  # of a unit vector: what rounding leaves of a component that is nothing


class JogError(Exception):
    """What cannot be jogged, with what is allowed: ``said``, and in words."""

    def __init__(self, key: str, **values: object) -> None:
        """``key``: of the catalogue's text."""
        self.said = messages.message(key, **values)
        super().__init__(messages.text(self.said))


class Stance(NamedTuple):
    """Where a machine stands that is to be jogged."""

    machine: Machine
    kinematics: Kinematics
    joints: Sequence[float]  # as commanded: mm, rad
    part: Frame  # the active work offset
    homed: int  # bit mask

    def continuous(self, frame: str, axis: str, share: float) -> Jog:
        """Motion at ``share`` (-1 to 1, not 0) of the jog speed for as long as it is asked for.

        The jog speed is the largest that all axes of the line may have, times the machine file's share for
        rapids. Raises JogError.
        """
        if not (math.isfinite(share) and 0.0 < abs(share) <= 1.0):
            raise JogError("jog_share", share=share)
        sign = math.copysign(1.0, share)
        line = tuple([sign * d for d in self.direction(frame, axis)])
        return Jog(line, abs(share) * fastest(self.machine, line))

    def step(self, frame: str, axis: str, distance: float) -> Jog:
        """Motion by ``distance`` as shown (mm, degrees of a rotary), either way, at the jog speed."""
        if not math.isfinite(distance) or distance == 0.0:
            raise JogError("jog_distance", distance=distance)
        jog = self.continuous(frame, axis, math.copysign(1.0, distance))
        return jog._replace(length=abs(distance / _shown_per_unit(self.machine, frame, axis)))

    def direction(self, frame: str, axis: str) -> Joints:
        """The joints' way per mm (per rad of a rotary) along a positive axis or diagonal. Raises JogError."""
        if len(axis) > 1:
            return self._diagonal(frame, axis)
        if frame == "joint":
            return _joint(self.machine, axis)
        if frame not in FRAMES:
            raise JogError("jog_frame", frame=frame, allowed=", ".join(FRAMES))
        if axis not in _LETTERS:
            raise JogError("jog_letter", frame=frame, axis=axis)
        if missing := [a.name for i, a in enumerate(self.machine.axes) if not self.homed >> i & 1]:
            raise JogError("jog_not_homed", frame=frame, axes=", ".join(missing))
        letter = _LETTERS[axis]
        return _slides(self.machine, (self._of_tool if frame == "tool" else self._of_part)(letter))

    def _diagonal(self, frame: str, axes: str) -> Joints:
        """Of two linear axes, ``X+Y`` or ``X-Y``. Raises JogError."""
        one, sign, other = axes[0], axes[1], axes[2]
        linear = {self.machine.axes[i].name for i in self.machine.linear()}
        if one == other or not {one, other} <= linear:
            raise JogError("jog_diagonal", axis=axes)
        share = math.copysign(math.sqrt(0.5), 1.0 if sign == "+" else -1.0)
        pairs = zip(self.direction(frame, one), self.direction(frame, other), strict=True)
        return tuple([math.sqrt(0.5) * a + share * b for a, b in pairs])

    def _of_part(self, letter: Vector) -> Vector:
        """What the slides do for a way of the part; the tables carry it."""
        pair, linear = self.machine.pair(self.joints, 0.0), self.kinematics.linear
        return subtract(linear(self.part.turn(letter), pair, 0.0), linear((0.0, 0.0, 0.0), pair, 0.0))

    def _of_tool(self, way: Vector) -> Vector:
        """What the slides do for a way of the tool; the heads carry it, the one next to the tool first."""
        axes = zip(self.machine.axes, self.joints, strict=True)
        for direction, angle_rad in [(a.direction, q) for a, q in axes if a.kind is Kind.HEAD][::-1]:
            way = rotate(unit(direction), angle_rad, way)
        return way

    def goes(self, line: Joints) -> None:
        """Raises JogError where an axis stands at the end of its travel that the line would lead beyond.

        The tick goes as far as the travel of homed axes lets it, which from there is nowhere.
        """
        for i, (axis, q, d) in enumerate(zip(self.machine.axes, self.joints, line, strict=True)):
            end = axis.travel_max if d > 0.0 else axis.travel_min
            if d and self.homed >> i & 1 and (end - q) * math.copysign(1.0, d) < ROUNDING:
                unit_ = "deg" if axis.is_rotary else "mm"
                raise JogError("jog_limit", axis=axis.name, limit=end * axis.shown_per_unit, unit=unit_)


def fastest(machine: Machine, line: Joints) -> float:
    """The jog speed along a line, in its units per s."""
    rows = zip(machine.axes, line, strict=True)
    return machine.rapid_share * min(axis.limits.velocity / abs(d) for axis, d in rows if d)


def slowed(machine: Machine, line: Jog, frame: str, axis: str, feed: float | None) -> Jog:
    """At no more than ``feed``, mm/min along the line or degrees/min of a rotary; None: as it is."""
    if feed is None:
        return line
    return line._replace(speed=min(line.speed, feed / 60.0 / abs(_shown_per_unit(machine, frame, axis))))


def _shown_per_unit(machine: Machine, frame: str, name: str) -> float:
    return next((axis.shown_per_unit for axis in machine.axes if axis.name == name and frame == "joint"), 1.0)


def _joint(machine: Machine, name: str) -> Joints:
    names = [axis.name for axis in machine.axes]
    if name not in names:
        raise JogError("jog_axis", axis=name, allowed=", ".join(names))
    sign = math.copysign(1.0, machine.axes[names.index(name)].shown_per_unit)
    return tuple([sign if one == name else 0.0 for one in names])


def _slides(machine: Machine, way: Vector) -> Joints:
    """A way of X, Y and Z as joints of length 1, without what rounding has left."""
    x, y, z = scale(way, 1.0 / norm(way))
    found = dict(zip(machine.linear(), (x, y, z), strict=True))
    return tuple([q if abs(q := found.get(i, 0.0)) > _NOISE else 0.0 for i in range(len(machine.axes))])


MAX_ENDED = 100  # presses that are remembered
SILENCE_S = 0.2  # of a press without a name: longer, and the next request is another one


class Presses:
    """Which press of a key may still move the machine.

    A held key asks again and again, and would take back within a moment the stop that somebody
    else has asked for. So a stop ends the press itself: what comes of it later moves nothing, and
    neither does a request that its own end has overtaken on the way.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """``clock`` in seconds."""
        self._clock = clock
        self._held = ""
        self._asked_s = -SILENCE_S
        self._ended: dict[str, None] = {}  # the latest last

    def may_move(self, press: str) -> bool:
        """Whether this press goes on, or begins; "" is one without a name, known by its rhythm."""
        if not press:
            now_s = self._clock()
            if now_s - self._asked_s >= SILENCE_S:
                self._ended.pop("", None)
            self._asked_s = now_s
        if press in self._ended:
            return False
        self._held = press
        return True

    def end(self, press: str = "") -> None:
        """That one; "" is the one that asked last."""
        self._ended[press or self._held] = None
        while len(self._ended) > MAX_ENDED:
            del self._ended[next(iter(self._ended))]


class Jogging:
    """Remembers the line under way: refreshed from where the axes are, it would turn by rounding."""

    def __init__(self) -> None:
        self._key: tuple[str, str, bool] | None = None
        self._line: Jog | None = None
        self._of: Machine | None = None
        self._kinematics: Kinematics | None = None

    def continuous(
        self, machine: Machine, now: Snapshot, part: Frame, frame: str, axis: str, share: float
    ) -> Jog:
        """At a share (-1 to 1, not 0) of the jog speed, for 200 ms from now on. Raises CommandRefused."""
        key = (frame, axis, share > 0.0)
        try:
            if now.mode is Mode.JOG and self._line is not None and key == self._key:
                speed = abs(share) * fastest(machine, self._line.direction)
                return self._line._replace(speed=speed)
            here = self._stance(machine, now, part)
            line = here.continuous(frame, axis, share)
            if now.mode is not Mode.JOG:  # under way it comes to rest there, asked for until it is let go
                here.goes(line.direction)
        except JogError as error:
            raise CommandRefused("bad", error.said, now.mode.name, "JOG") from error
        self._key, self._line = key, line
        return line

    def step(
        self, machine: Machine, now: Snapshot, part: Frame, frame: str, axis: str, distance: float
    ) -> Jog:
        """By a distance (mm, degrees of a rotary). Raises CommandRefused."""
        self._key = None
        try:
            here = self._stance(machine, now, part)
            line = here.step(frame, axis, distance)
            here.goes(line.direction)
            return line
        except JogError as error:
            raise CommandRefused("bad", error.said, now.mode.name, "JOG") from error

    def _stance(self, machine: Machine, now: Snapshot, part: Frame) -> Stance:
        if self._kinematics is None or self._of is not machine:
            self._of, self._kinematics = machine, kinematics_of(machine)
        return Stance(machine, self._kinematics, now.joints, part, now.homed)
