"""Jog requests as orders to the tick: one line of the joints, kept the same while a key is down."""

from __future__ import annotations

import time
from collections.abc import Callable

from controller.geometry.vectors import Frame
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Jog, Snapshot
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine
from controller.service import jog_frames
from controller.service.jog_frames import JogError
from controller.state.modes import Mode

MAX_ENDED = 100  # presses that are remembered
SILENCE_S = 0.2  # of a press without a name: longer, and the next request is another one

# Verbs that end whatever press of a key is under way, whoever asks for them.
ENDS = frozenset({"hold", "stop", "estop", "disable", "jog_stop"})


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
                speed = abs(share) * jog_frames.fastest(machine, self._line.direction)
                return self._line._replace(speed=speed)
            kinematics = self._kinematics_of(machine)
            line = jog_frames.continuous(machine, kinematics, now.joints, frame, axis, share, part, now.homed)
            if (
                now.mode is not Mode.JOG
            ):  # under way it comes to rest there, and is asked for until it is let go
                jog_frames.goes(machine, now.joints, line.direction, now.homed)
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
            kinematics = self._kinematics_of(machine)
            line = jog_frames.step(machine, kinematics, now.joints, frame, axis, distance, part, now.homed)
            jog_frames.goes(machine, now.joints, line.direction, now.homed)
            return line
        except JogError as error:
            raise CommandRefused("bad", error.said, now.mode.name, "JOG") from error

    def _kinematics_of(self, machine: Machine) -> Kinematics:
        if self._kinematics is None or self._of is not machine:
            self._of, self._kinematics = machine, kinematics_of(machine)
        return self._kinematics
