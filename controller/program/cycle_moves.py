"""The moves of one line of a canned cycle, in program coordinates of the active plane, and threads.

G33, G33.1 and the rigid G74 and G84: the spindle's angle leads the axis along the tool.

    the spindle stands; down as it turns; both stand at the bottom; back as it turns back; it turns again

The spindle starts from rest together with the axis, so that the first turn is cut as the last one, and a
second pass finds the first. G33 with the spindle off turns it by the sign of K, as M3 where that is positive,
and leaves it standing: so a tap is turned out of its hole. It needs a spindle that tells its position
(``position`` in [spindle]).
"""

from __future__ import annotations

import math
from dataclasses import replace

from controller.messages import Key
from controller.program import output_words, polar_words
from controller.program.modal import Cycle, State
from controller.program.motion_words import PLANES, to_place
from controller.program.offset_words import Here
from controller.program.position import Coordinate
from controller.program.program import (
    Act,
    Action,
    Await,
    Block,
    Dwell,
    JointLine,
    Level,
    Place,
    Targets,
    Thread,
    Tip,
)
from controller.program.words import Word


class Way:
    """Collects the moves of one line, in program coordinates of the plane: first, second and normal axis."""

    def __init__(self, here: Here, place: Place, feed: float, targets: Targets, hole: str = "drill") -> None:
        """``hole``: what is done at feed, as ``JointLine.hole``."""
        self.here, self.place, self.feed, self._hole = here, place, feed, hole
        self.targets = targets  # of the line's words
        self.made: list[Block] = []
        self.modal = here.state.modal  # as the spindle turns just now
        self.repeats, self.end = 1, 0.0  # holes, and the height to which each is left
        first, second, _ = PLANES[here.state.modal.plane]
        now = here.position.in_frame(here.state.modal)
        absolute = here.state.absolute
        said = [here.length_mm("XYZ"[i]) if absolute else None for i in (first, second)]
        values = [now[i] if word is None else word for i, word in zip((first, second), said, strict=True)]
        word = here.ask.line.words[0]
        a, b = here.known(word, values, Key("position.cycle"))
        self.begin = self._over = (a, b)  # the hole that the tool is over

    @property
    def fanuc(self) -> bool:
        return self.here.machine.dialect == "fanuc"

    def hole(self, x: float, y: float, relative: bool) -> tuple[float, float]:
        """The next hole: under G91 one step on."""
        if not relative:
            return x, y
        if (steps := self.here.ask.polar) is not None:
            return polar_words.stepped(self.here.ask, self.here.ask.line.words[0], (x, y), steps)
        first, second, _ = PLANES[self.modal.plane]
        dx, dy = (self.here.length_mm("XYZ"[i]) or 0.0 for i in (first, second))
        return x + dx, y + dy

    def rapid(self, x: Coordinate, y: Coordinate, height: Coordinate) -> None:
        if x is not None and y is not None:
            self._over = (x, y)
        self._go(x, y, height, None)

    def aside(self, shift: tuple[float, float]) -> None:
        """At rapid off the middle of the hole, or with (0, 0) back to it."""
        x, y = self._over
        self._go(x + shift[0], y + shift[1], None, None)

    def cut(self, height: float) -> None:
        self._go(None, None, height, self.feed)

    def _go(
        self, x: Coordinate, y: Coordinate, height: Coordinate, feed: Coordinate, thread: Thread | None = None
    ) -> None:
        """To a place; a rotary of the line's words turns with the rapid over the hole."""
        machine, modal = self.here.machine, self.modal
        made = [*to_place(machine, (x, y, height), PLANES[modal.plane])]
        if x is not None:
            for i in machine.rotary():
                made[i] = self.targets[i]
        hole = "" if feed is None else self._hole
        line = (self.place, modal, tuple(made), False, False, feed, feed)
        self.made.append(JointLine(*line, thread=thread, hole=hole))

    def thread(
        self, height: float, rev_per_mm: float, begin_rev: float | None = 0.0, faster: float = 1.0
    ) -> None:
        """Along the spindle's angle; see ``Thread``."""
        self._go(None, None, height, faster * self.feed, Thread(rev_per_mm, begin_rev))

    def wait(self, seconds: Coordinate) -> None:
        if seconds:
            self.made.append(Dwell(self.place, self.modal, seconds))

    def stand(self) -> None:
        """The spindle stands at its angle, as by M19."""
        word = self.here.ask.line.words[0]
        output, back, most_s = output_words.standing(self.here.ask, word, self.here.machine, "M19")
        self.spindle(0.0)
        self._switch(output, True)
        self.made.append(Await(self.place, self.modal, back, Level.HIGH, most_s))

    def turn(self) -> None:
        """It turns again."""
        machine = self.here.machine
        if machine.io is not None:
            self._switch(len(machine.io.digital_out), False)
        self.spindle(1.0)

    def _switch(self, output: int, on: bool) -> None:
        self.modal = replace(self.modal, outputs=self.modal.outputs.switched(output, on))
        self.made.append(Action(self.place, self.modal, Act.OUTPUT))

    def spindle(self, share: float) -> None:
        """The spindle at ``share`` of its speed: -1 turns it back."""
        said = self.here.state.modal.spindle_rev_min
        self.modal = replace(self.modal, spindle_rev_min=share * said)
        self.made.append(Action(self.place, self.modal, Act.SPINDLE))


THREADS = ("G33", "G33.1")
PITCH_MM = (0.01, 100.0)
MAX_RETURN = 10.0  # I of G33.1: how much faster than down the way up may be


def is_rigid(here: Here) -> bool:
    """Whether the spindle tells the angle that a tap follows."""
    spindle = here.machine.spindle
    return spindle is not None and spindle.position is not None


def thread_blocks(here: Here, code: str, word: Word) -> tuple[list[Block], State]:
    """The moves of G33 (one way) or G33.1 (there and back), and the state after them."""
    normal = PLANES[here.state.modal.plane][2]
    _check_thread(here, code, word, "XYZ"[normal])
    pitch = _pitch_mm(here, code, word)
    way = Way(
        here,
        here.ask.place(word),
        here.state.feed_of_pitch(pitch),
        to_place(here.machine, ()),
        "tap" if code == "G33.1" else "thread",
    )
    (now,) = here.known(word, here.position.in_frame(here.state.modal)[normal : normal + 1], code)
    target = here.length_mm("XYZ"[normal]) or 0.0
    if not here.state.absolute:
        target += now
    if abs(target - now) < PITCH_MM[0]:
        raise here.ask.refusal(word, "thread.nowhere", code=code)
    turning = here.state.turning or (1 if (here.length_mm("K") or 0.0) > 0.0 else -1)
    turned = turning / pitch
    way.spindle(0.0)
    if code == "G33":
        way.thread(target, turned, begin_rev=0.0 if target < now else None)
    else:
        way.thread(target, turned)
        way.thread(now, -turned, begin_rev=None, faster=_faster(here))
    way.spindle(1.0)
    return way.made, here.state


def _check_thread(here: Here, code: str, word: Word, height: str) -> None:
    ask, state = here.ask, here.state
    other = next((letter for letter in "XYZ" if letter != height and letter in ask.words), "")
    values = {"code": code, "height": height, "side": state.side, "other": other}
    ask.refuse_where(
        word,
        (not is_rigid(here), "thread.no_angle"),
        (height not in ask.words, "thread.no_height"),
        (not state.speed_rev_min, "thread.no_speed"),
        (state.turning == 0 and code != "G33", "cycle.standing"),
        (state.modal.tip is not Tip.OFF, "thread.tip_control"),
        (state.side != "G40", "cycle.beside"),
        (other, "thread.beside_others"),
        **values,
    )
    if "F" in ask.words:  # on other controls it is the pitch
        raise ask.refusal(ask.words["F"], "thread.feed", **values)


def _pitch_mm(here: Here, code: str, word: Word) -> float:
    given = here.ask.words.get("K")
    pitch = here.length_mm("K")
    if given is None or pitch is None:
        raise here.ask.refusal(word, "thread.no_pitch", code=code)
    if here.state.turning == 0:  # G33: the sign says which way
        pitch = abs(pitch)
    check_pitch(here, given, pitch)
    return pitch


def check_pitch(here: Here, word: Word, pitch: float) -> None:
    """Raises ProgramError for what is no pitch."""
    low, high = PITCH_MM
    if not low <= pitch <= high:
        raise here.ask.refusal(word, "thread.pitch", pitch=pitch, low=low, high=high)


def _faster(here: Here) -> float:
    """I of G33.1: so many times as fast back as down, at most as fast as the spindle turns."""
    word, spindle = here.ask.words.get("I"), here.machine.spindle
    if word is None or spindle is None:
        return 1.0
    most = min(MAX_RETURN, here.machine.max_rev_min(here.state.modal.tool) / here.state.speed_rev_min)
    if not 0.0 < word.value <= most:
        raise here.ask.refusal(word, "thread.faster", most=most)
    return word.value


def tap(way: Way, cycle: Cycle, clearance: float, bottom: float) -> None:
    """G74 and G84: F over S is the pitch; with Q in pecks, each out to R, all in one thread."""
    rev_s = abs(way.here.state.modal.spindle_rev_min) / 60.0
    ask, turning = way.here.ask, way.here.state.turning
    word = ask.words.get("F") or ask.line.words[0]
    if not rev_s:
        raise ask.refusal(word, "thread.no_speed", code=cycle.code)
    check_pitch(way.here, word, way.feed / rev_s)
    turned = turning * rev_s / way.feed
    depth = cycle.depth or math.inf
    height = clearance
    way.spindle(0.0)
    while height > bottom:
        height = max(height - depth, bottom)
        way.thread(height, turned)
        if height == bottom:
            way.wait(cycle.seconds)
        way.thread(clearance, -turned, begin_rev=None)
    way.spindle(1.0)
