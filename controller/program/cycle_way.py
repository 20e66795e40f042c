"""The moves of one line of a canned cycle, in program coordinates of the active plane."""

from __future__ import annotations

from dataclasses import replace

from controller.messages import Key
from controller.program import output_words, polar_words
from controller.program.motion_words import PLANES
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
)


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

    def _go(self, x: Coordinate, y: Coordinate, height: Coordinate, feed: Coordinate) -> None:
        """To a place; a rotary of the line's words turns with the rapid over the hole."""
        machine, modal = self.here.machine, self.modal
        made: list[Coordinate] = [None] * len(machine.axes)
        if x is not None:
            for i in machine.rotary():
                made[i] = self.targets[i]
        for axis, value in zip(PLANES[modal.plane], (x, y, height), strict=True):
            made[machine.linear()[axis]] = value
        hole = "" if feed is None else self._hole
        line = JointLine(self.place, modal, tuple(made), False, False, feed, feed, hole=hole)
        self.made.append(line)

    def thread(
        self, height: float, rev_per_mm: float, begin_rev: float | None = 0.0, faster: float = 1.0
    ) -> None:
        """Along the spindle's angle; see ``Thread``."""
        self._go(None, None, height, faster * self.feed)
        line = self.made.pop()
        assert isinstance(line, JointLine)
        self.made.append(replace(line, thread=Thread(rev_per_mm, begin_rev)))

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
