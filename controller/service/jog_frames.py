"""What an operator wants to jog, as a line of the joints: the order that the tick takes.

Three frames, all with the rotaries where they are, so that every line is straight:

* ``joint``: one axis of the machine file, in the sense that is shown;
* ``part``: X Y Z of the active work offset;
* ``tool``: Z along the tool axis away from the part, X and Y across it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from controller import messages
from controller.geometry.vectors import Frame, Vector, X, Y, Z, norm, rotate, scale, subtract, unit
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Kind, Machine
from controller.motion.pieces import Jog

FRAMES = ("joint", "part", "tool")
_LETTERS: dict[str, Vector] = {"X": X, "Y": Y, "Z": Z}
_NOISE = 1e-12  # of a unit vector: what rounding leaves of a component that is nothing
_STUCK = 1e-9  # mm or rad: less is no motion


class JogError(Exception):
    """What cannot be jogged, with what is allowed: ``said``, and in words."""

    def __init__(self, key: str, **values: object) -> None:
        """``key``: of the catalogue's text."""
        self.said = messages.said(key, **values)
        super().__init__(messages.text(self.said))


def continuous(
    machine: Machine,
    kinematics: Kinematics,
    joints: Sequence[float],
    frame: str,
    axis: str,
    share: float,
    part: Frame,
    homed: int,
) -> Jog:
    """Motion at ``share`` (-1 to 1, not 0) of the jog speed for as long as it is asked for.

    ``joints`` as commanded (mm, rad); ``part`` is the active work offset; ``homed`` the tick's bit mask.
    The jog speed is the largest that all axes of the line may have, times the machine file's share for
    rapids. Raises JogError.
    """
    if not (math.isfinite(share) and 0.0 < abs(share) <= 1.0):
        raise JogError("jog_share", share=share)
    line = direction(machine, kinematics, joints, frame, axis, part, homed)
    return Jog(_times(line, math.copysign(1.0, share)), abs(share) * fastest(machine, line))


def step(
    machine: Machine,
    kinematics: Kinematics,
    joints: Sequence[float],
    frame: str,
    axis: str,
    distance: float,
    part: Frame,
    homed: int,
    share: float = 1.0,
) -> Jog:
    """Motion by ``distance`` as shown (mm, degrees of a rotary), either way; as ``continuous`` else."""
    if not math.isfinite(distance) or distance == 0.0:
        raise JogError("jog_distance", distance=distance)
    jog = continuous(machine, kinematics, joints, frame, axis, math.copysign(share, distance), part, homed)
    shown = next((a.shown_per_unit for a in machine.axes if a.name == axis and frame == "joint"), 1.0)
    return jog._replace(length=abs(distance / shown))


def to(machine: Machine, joints: Sequence[float], target: Sequence[float], speed: float) -> Jog | None:
    """The straight line of the joints to ``target`` (mm, rad); None where they stand there.

    ``speed``: mm/s of the slides, or rad/s where only rotaries move. The tick ends on ``target`` itself.
    """
    way = tuple([b - a for a, b in zip(joints, target, strict=True)])
    slides = math.hypot(*(way[i] for i in machine.linear()))
    length = slides or math.hypot(*way)
    return Jog(way, speed / length, 1.0) if length > 0.0 else None


def direction(
    machine: Machine,
    kinematics: Kinematics,
    joints: Sequence[float],
    frame: str,
    axis: str,
    part: Frame,
    homed: int,
) -> Joints:
    """The joints' way per mm (per rad of a rotary) along the positive axis. Raises JogError."""
    if frame == "joint":
        return _joint(machine, axis)
    if frame not in FRAMES:
        raise JogError("jog_frame", frame=frame, allowed=", ".join(FRAMES))
    if axis not in _LETTERS:
        raise JogError("jog_letter", frame=frame, axis=axis)
    if missing := [a.name for i, a in enumerate(machine.axes) if not homed >> i & 1]:
        raise JogError("jog_not_homed", frame=frame, axes=", ".join(missing))
    letter = _LETTERS[axis]
    way = _of_tool(machine, joints, letter) if frame == "tool" else None
    return _slides(machine, way or _of_part(machine, kinematics, joints, part.turn(letter)))


def goes(machine: Machine, joints: Sequence[float], line: Joints, homed: int) -> None:
    """Raises JogError where an axis stands at the end of its travel that the line would lead beyond.

    The tick goes as far as the travel of homed axes lets it, which from there is nowhere.
    """
    for i, (axis, q, d) in enumerate(zip(machine.axes, joints, line, strict=True)):
        end = axis.travel_max if d > 0.0 else axis.travel_min
        if d and homed >> i & 1 and (end - q) * math.copysign(1.0, d) < _STUCK:
            unit = "deg" if axis.is_rotary else "mm"
            raise JogError("jog_limit", axis=axis.name, limit=end * axis.shown_per_unit, unit=unit)


def fastest(machine: Machine, line: Joints) -> float:
    """The jog speed along a line, in its units per s."""
    rows = zip(machine.axes, line, strict=True)
    return machine.rapid_share * min(axis.limits.velocity / abs(d) for axis, d in rows if d)


def _joint(machine: Machine, name: str) -> Joints:
    names = [axis.name for axis in machine.axes]
    if name not in names:
        raise JogError("jog_axis", axis=name, allowed=", ".join(names))
    sign = math.copysign(1.0, machine.axes[names.index(name)].shown_per_unit)
    return tuple([sign if one == name else 0.0 for one in names])


def _of_part(machine: Machine, kinematics: Kinematics, joints: Sequence[float], way: Vector) -> Vector:
    """What the slides do for a way of the table frame; the tables carry it."""
    pair = machine.pair(joints, 0.0)
    return subtract(kinematics.linear(way, pair, 0.0), kinematics.linear((0.0, 0.0, 0.0), pair, 0.0))


def _of_tool(machine: Machine, joints: Sequence[float], way: Vector) -> Vector:
    """What the slides do for a way of the tool; the heads carry it, the one next to the tool first."""
    heads = [(a.direction, q) for a, q in zip(machine.axes, joints, strict=True) if a.kind is Kind.HEAD]
    for axis, angle_rad in reversed(heads):
        way = rotate(unit(axis), angle_rad, way)
    return way


def _slides(machine: Machine, way: Vector) -> Joints:
    """A way of X, Y and Z as joints of length 1, without what rounding has left."""
    x, y, z = scale(way, 1.0 / norm(way))
    found = dict(zip(machine.linear(), (x, y, z), strict=True))
    return tuple([q if abs(q := found.get(i, 0.0)) > _NOISE else 0.0 for i in range(len(machine.axes))])


def _times(line: Joints, sign: float) -> Joints:
    return tuple([sign * d for d in line])
