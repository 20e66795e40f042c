"""M70 to M73: the modal state kept, and given back (as LinuxCNC).

M70 keeps it, M72 gives it back, M71 forgets it; M73 keeps it and has it given back when the sub
ends. Each call of a sub has its own. The motion mode stays as it is, and so does the tool.
"""

from __future__ import annotations

from dataclasses import replace

from controller.plan.text.line import Line, Word
from controller.plan.text.modal import State
from controller.plan.text.program import Act, Action, Block

KEEP, FORGET, GIVE_BACK, KEEP_FOR_SUB = 70.0, 71.0, 72.0, 73.0
CODES = (KEEP, FORGET, GIVE_BACK, KEEP_FOR_SUB)


class Saved:
    """What is kept in one run of a program."""

    def __init__(self) -> None:
        self._kept: dict[int, State] = {}  # by the number of the call

    def carry_out(self, line: Line, state: State) -> tuple[State, list[Block], Line]:
        """The state, what it does to the machine, and the line without these codes."""
        words = [word for word in line.words if word.letter == "M" and word.value in CODES]
        if not words:
            return state, [], line
        made: list[Block] = []
        for word in words:
            state = self._one(line, word, state, made)
        return state, made, line.with_words(tuple(w for w in line.words if w not in words))

    def _one(self, line: Line, word: Word, state: State, made: list[Block]) -> State:
        for ended in [call for call in self._kept if call > line.sub]:
            del self._kept[ended]
        if word.value in (KEEP, KEEP_FOR_SUB):
            self._kept[line.sub] = state
        elif word.value == FORGET:
            self._kept.pop(line.sub, None)
        elif line.sub not in self._kept:
            raise line.refusal(
                word, "M72 has nothing to give back: M70 or M73 keeps the state before, in the same sub"
            )
        else:
            return _given_back(line, word, state, self._kept[line.sub], made)
        return state


def _given_back(line: Line, word: Word, now: State, kept: State, made: list[Block]) -> State:
    modal = replace(kept.modal, tool=now.modal.tool, cutter=now.modal.cutter)
    place = line.place(word.column)
    if modal.spindle_rev_min != now.modal.spindle_rev_min:
        made.append(Action(place, modal, Act.SPINDLE))
    if modal.coolant != now.modal.coolant:
        made.append(Action(place, modal, Act.COOLANT))
    return replace(
        kept, modal=modal, motion=now.motion, cleared=now.cleared, selected=now.selected, cuts=now.cuts
    )
