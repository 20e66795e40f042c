"""Jog requests as orders to the tick: one line of the joints, kept the same while a key is down."""

from __future__ import annotations

from controller import jog_frames
from controller.door import DoorError
from controller.geometry import Frame
from controller.handoff import Jog, Snapshot
from controller.jog_frames import JogError
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.state import Mode


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
        """At a share (-1 to 1, not 0) of the jog speed, for 200 ms from now on. Raises DoorError."""
        key = (frame, axis, share > 0.0)
        try:
            if now.mode is Mode.JOG and self._line is not None and key == self._key:
                speed = abs(share) * jog_frames.fastest(machine, self._line.direction)
                return self._line._replace(speed=speed)
            kinematics = self._kinematics_of(machine)
            line = jog_frames.continuous(machine, kinematics, now.joints, frame, axis, share, part, now.homed)
        except JogError as error:
            raise DoorError("bad", str(error), now.mode.name, "JOG") from error
        self._key, self._line = key, line
        return line

    def step(
        self, machine: Machine, now: Snapshot, part: Frame, frame: str, axis: str, distance: float
    ) -> Jog:
        """By a distance (mm, degrees of a rotary). Raises DoorError."""
        self._key = None
        try:
            kinematics = self._kinematics_of(machine)
            return jog_frames.step(machine, kinematics, now.joints, frame, axis, distance, part, now.homed)
        except JogError as error:
            raise DoorError("bad", str(error), now.mode.name, "JOG") from error

    def _kinematics_of(self, machine: Machine) -> Kinematics:
        if self._kinematics is None or self._of is not machine:
            self._of, self._kinematics = machine, Kinematics(machine)
        return self._kinematics
