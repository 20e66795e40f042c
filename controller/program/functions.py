"""The short way of lines that are spindle and coolant alone (M3 to M5, M7 to M9, S).

What such a line does depends on the state before it alone: it is carried out once, and then known.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from controller.program.line import FUNCTION, SPEED, Line, Part
from controller.program.modal import State
from controller.program.program import Action, Block, Place

MAX_STATES = 1000  # that are remembered
_FUNCTIONS = frozenset((3.0, 4.0, 5.0, 7.0, 8.0, 9.0))  # M
_Known = tuple[State, State, list[tuple[int, Action]]]  # before, after, and by which word


class Functions:
    """What was learnt: by state, M and S."""

    def __init__(self, one_of: Callable[[State], State]) -> None:
        """``one_of``: the same state, of those that are known."""
        self._one_of = one_of
        self._known: dict[tuple[int, Part, Part], _Known] = {}

    def done(
        self, parts: Sequence[Part], state: State, found: re.Match[str], number: int
    ) -> tuple[list[Action], State] | None:
        """What a line that COMMON has found does, if that was learnt, and the state after it."""
        known = self._of(parts, state)
        if known is None:
            return None
        _, after, acts = known
        return [Action(Place(number, found.start(part + 1)), act.modal, act.act) for part, act in acts], after

    def read(self, line: Line, state: State) -> tuple[list[Block], State] | None:
        """The same of any line."""
        parts = line.parts
        known = None if parts is None else self._of(parts, state)
        if known is None:
            return None
        _, after, acts = known
        return [Action(line.place(line.column(part)), act.modal, act.act) for part, act in acts], after

    def _of(self, parts: Sequence[Part], state: State) -> _Known | None:
        if parts[FUNCTION] is None and parts[SPEED] is None:
            return None
        known = self._known.get((id(state), parts[FUNCTION], parts[SPEED]))
        return known if known is not None and _is_function(parts) else None

    def learnt(self, line: Line, before: State, after: State, made: Sequence[Block]) -> State:
        """The state after a line that was carried out, which is noted for the next time."""
        parts = line.parts
        if parts is None or (parts[FUNCTION] is None and parts[SPEED] is None) or not _is_function(parts):
            return after
        acts: list[tuple[int, Action]] = []
        for block in made:
            if not isinstance(block, Action):
                return after
            of_m = parts[FUNCTION] is not None and block.place.column == line.column(FUNCTION)
            acts.append((FUNCTION if of_m else SPEED, block))
        after = self._one_of(after)
        if len(self._known) >= MAX_STATES:
            self._known.clear()
        self._known[(id(before), parts[FUNCTION], parts[SPEED])] = (before, after, acts)
        return after


def any_of(values: Sequence[object]) -> bool:
    """Whether one of them is there."""
    return values.count(None) < len(values)


def _is_function(parts: Sequence[Part]) -> bool:
    """Whether it has nothing but S and an M of spindle or coolant."""
    if any_of(parts[:SPEED]):
        return False
    code = parts[FUNCTION]
    return code is None or float(code) in _FUNCTIONS
