"""What a path waits for beside its motion, and how long that is expected to take.

For spindle, clamps, tool changes and inputs the controller waits at rest while the path clock stands: no
part of a program's duration, but of the time that it takes. ``laid`` puts a ``Wait`` on each pause of a path.
Its seconds are what the machine file makes likely (ramp of the spindle, ``usual_s`` of its devices); its name
is that under which the service remembers what it really took.

A stop for the operator (M0, M1) has no time: nobody knows when he will be there. A change of the tool by
hand, and a spindle that he switches, have the one that the machine file says.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from controller.machine.model import Machine, Spindle
from controller.plan.segment import ContinuousPath, PathItem, Pause, Wait
from controller.program.output_words import steps_of
from controller.program.program import Act, Changing, Level, Place

# What is switched at rest, and seen to be so.
SETTING = (Act.SPINDLE, Act.COOLANT, Act.OUTPUT, Act.INPUT, Act.TOOL, Act.CLAMP, Act.PROBE)
SET_TICKS = 5  # that any of it costs: the axes are in position, a drive has answered
STOPPED_REV_S = 0.1  # slower than this a spindle stands
JOURNAL_S = 0.02  # between two steps of a tool changer, until the journal is on the disk
CHANGE, BY_HAND, STOP, OPTIONAL = "change", "by hand", "stop", "optional stop"
SPINDLE_BY_HAND = "hand spindle"
JOURNAL, SET, ORIENT, AGAIN = "journal", "set", "orient", "orient again"  # names of waits


_HALTS = {Act.STOP: STOP, Act.OPTIONAL_STOP: OPTIONAL}


def laid(items: Iterable[PathItem], machine: Machine, rev_min: float = 0.0) -> Iterator[PathItem]:
    """The same path with a ``Wait`` on each pause; ``rev_min``: of the spindle before it."""
    waits = _Waits(machine, rev_min)
    for item in items:
        yield item if isinstance(item, ContinuousPath) else replace(item, wait=waits.of(item))


def ramp_s(spindle: Spindle, before: float, after: float) -> float:
    """How long it takes from one speed to another (rev/min, signed), and is then at speed."""
    near = max(spindle.at_speed_share * abs(after) / 60.0, STOPPED_REV_S)
    seconds = max(0.0, abs(after - before) / 60.0 - near) / spindle.acceleration_rev_s2
    return min(seconds, spindle.spin_up_s)


class _Waits:
    """Pauses in their order; all is clamped before the first."""

    def __init__(self, machine: Machine, rev_min: float) -> None:
        self._machine = machine
        self._rev_min, self._open = rev_min, 0
        self._changed: Place | None = None  # of the last M6
        self._step: Changing | None = None  # of the changer, that is under way
        self._oriented = False  # the output of M19 is on, as it stays until it is told off

    def of(self, pause: Pause) -> Wait:
        """The next pause of the path."""
        wait = self._switched(pause) if pause.act in SETTING else self._stopped(pause)
        if pause.act is Act.TOOL:
            self._changed = pause.place
        if pause.changing is not None:
            self._step = None if pause.changing.last else pause.changing
        self._rev_min, self._open = pause.modal.spindle_rev_min, pause.open_clamps
        self._oriented = self._is_oriented(pause)
        return wait

    def _is_oriented(self, pause: Pause) -> bool:
        """Of the spindle, after a pause."""
        io = self._machine.io
        if io is None or io.orient is None:
            return False
        told = pause.awaits.outputs if pause.awaits is not None else pause.modal.outputs
        bit = 1 << io.switched.index(io.orient.output)
        asked = pause.awaits is not None and io.awaited[pause.awaits.number] == io.orient.input
        lets_go = pause.act in (Act.OUTPUT, Act.INPUT) and told.off & bit
        return (self._oriented or asked) and not lets_go

    def _stopped(self, pause: Pause) -> Wait:
        if pause.changing is not None:
            begins = pause.changing.step == 0 and not pause.changing.last
            goes_on_s = JOURNAL_S + self._machine.period_s
            return Wait(JOURNAL, goes_on_s, CHANGE if begins else "")
        if pause.act is Act.STOP and pause.place == self._changed:
            return Wait(BY_HAND, self._machine.tool_change_s, BY_HAND)
        if pause.turns and self._machine.spindle is not None:
            return Wait(SPINDLE_BY_HAND, self._machine.spindle.by_hand_s, STOP)
        return Wait(stops=_HALTS.get(pause.act, "") if pause.act else "")

    def _switched(self, pause: Pause) -> Wait:
        if not self._machine.has_peripherals:
            return Wait()
        found = [
            wait for wait in (self._spindle(pause), self._clamps(pause), self._input(pause)) if wait.name
        ]
        name = " + ".join(wait.name for wait in found) or SET
        longest = max((wait.seconds for wait in found), default=0.0)
        return Wait(name, longest + SET_TICKS * self._machine.period_s)

    def _spindle(self, pause: Pause) -> Wait:
        spindle, before, after = self._machine.spindle, self._rev_min, pause.modal.spindle_rev_min
        if spindle is None or not spindle.is_driven or before == after:
            return Wait()
        return Wait(f"spindle {before:g} to {after:g}", ramp_s(spindle, before, after))

    def _clamps(self, pause: Pause) -> Wait:
        """They move side by side."""
        changed = pause.open_clamps ^ self._open
        axes = [axis for i, axis in enumerate(self._machine.axes) if axis.clamp and changed >> i & 1]
        moved = f"clamps {self._open:b} to {pause.open_clamps:b}" if axes else ""
        return Wait(moved, max((axis.clamp.usual_s for axis in axes if axis.clamp), default=0.0))

    def _input(self, pause: Pause) -> Wait:
        """Of a step of the changer, of M19, or one that a program waits for: of that nothing is known."""
        io, changer, asked = self._machine.io, self._machine.changer, pause.awaits
        if io is None or asked is None:
            return Wait()
        name = io.awaited[asked.number]
        if io.orient is not None and name == io.orient.input:
            return Wait(AGAIN) if self._oriented else Wait(ORIENT, io.orient.usual_s)
        if changer is None or self._step is None:
            gears = () if self._machine.spindle is None else self._machine.spindle.gears
            shifted_s = next((one.usual_s for one in gears if one.input == name), 0.0)
            return Wait(f"input {name}", shifted_s)
        step, pocket = steps_of(changer, self._step.tool_out, self._step.tool_in)[self._step.step]
        changes = asked.level in (Level.RISE, Level.FALL)  # the others are there, as a rule
        return Wait(f"{step.name} {pocket}" if step.pocket else step.name, step.usual_s if changes else 0.0)
