"""The short way of lines that are spindle and coolant alone (M3 to M5, M7 to M9, S).

What such a line does depends on the state before it alone: it is carried out once, and then known.
"""

from __future__ import annotations

from collections.abc import Sequence

from controller.program.line import FUNCTION, SPEED, Line, Part
from controller.program.modal import State
from controller.program.plain import MAX_STATES, CommonLines, any_of
from controller.program.program import Action, Block

_FUNCTIONS = frozenset((3.0, 4.0, 5.0, 7.0, 8.0, 9.0))  # M


class Functions:
    """What was learnt: by state, M and S."""

    def __init__(self, common: CommonLines) -> None:
        self._common = common
        self._known: dict[tuple[int, Part, Part], tuple[State, State, list[tuple[int, Action]]]] = {}

    def read(self, line: Line, state: State) -> tuple[list[Block], State] | None:
        """What a line does that was learnt, and the state after it; None of any other."""
        parts = line.parts
        if parts is None or (parts[FUNCTION] is None and parts[SPEED] is None):
            return None
        known = self._known.get((id(state), parts[FUNCTION], parts[SPEED]))
        if known is None or not _is_function(parts):
            return None
        _, after, acts = known
        made: list[Block] = []
        for part, act in acts:
            made.append(Action(line.place(line.column(part)), act.modal, act.act))
        return made, after

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
        after = self._common.one_of(after)
        if len(self._known) >= MAX_STATES:
            self._known.clear()
        self._known[(id(before), parts[FUNCTION], parts[SPEED])] = (before, after, acts)
        return after


def _is_function(parts: Sequence[Part]) -> bool:
    """Whether it has nothing but S and an M of spindle or coolant."""
    if any_of(parts[:SPEED]):
        return False
    code = parts[FUNCTION]
    return code is None or float(code) in _FUNCTIONS
