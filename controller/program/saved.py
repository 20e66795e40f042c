"""M70 to M73: the modal state kept, and given back (as LinuxCNC).

M70 keeps it, M72 gives it back, M71 forgets it; M73 keeps it and has it given back when the sub
ends. Each call of a sub has its own. The motion mode stays as it is, and so does the tool.
"""

from __future__ import annotations

from dataclasses import replace

from controller.machine.model import Machine
from controller.program.line import Line, Word
from controller.program.modal import State
from controller.program.program import Act, Action, Block

KEEP, FORGET, GIVE_BACK, KEEP_FOR_SUB = 70.0, 71.0, 72.0, 73.0
GIVEN_BACK = (
    *("mm_per_unit", "side", "absolute", "speed_rev_min", "turning", "feed_deg_s", "inverse", "per_turn"),
    *("turn_feed", "centres_absolute", "to_clearance"),
)
CODES = (KEEP, FORGET, GIVE_BACK, KEEP_FOR_SUB)


class Saved:
    """What is kept in one run of a program."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._kept: dict[int, State] = {}  # by the number of the call

    def carry_out(self, line: Line, state: State) -> tuple[State, list[Block], Line]:
        """The state, what it does to the machine, and the line without these codes."""
        words = [word for word in line.words if word.letter == "M" and word.value in CODES]
        if not words:
            return state, [], line
        if len(words) > 1:
            raise line.refusal(words[1], "saved.two", first=words[0].text)
        made: list[Block] = []
        state = self._one(line, words[0], state, made)
        return state, made, line.with_words(tuple(w for w in line.words if w not in words))

    def _one(self, line: Line, word: Word, state: State, made: list[Block]) -> State:
        for ended in [call for call in self._kept if call > line.sub]:
            del self._kept[ended]
        if word.value in (KEEP, KEEP_FOR_SUB):
            self._kept[line.sub] = state
        elif word.value == FORGET:
            self._kept.pop(line.sub, None)
        elif line.sub not in self._kept:
            raise line.refusal(word, "saved.none")
        else:
            state, blocks = _given_back(line, word, state, self._kept[line.sub], self._machine)
            made += blocks
        return state


def _given_back(
    line: Line, word: Word, now: State, kept: State, machine: Machine
) -> tuple[State, list[Block]]:
    """Of the kept state what LinuxCNC keeps: neither the motion mode nor what stands behind the offsets."""
    modal = replace(kept.modal, tool=now.modal.tool, cutter=now.modal.cutter, outputs=now.modal.outputs)
    state = now._replace(modal=modal, **{name: getattr(kept, name) for name in GIVEN_BACK})
    state = state.with_origins(replace(now.origins, index=kept.origins.index), machine)
    place, made = line.place(word.column), list[Block]()
    if modal.spindle_rev_min != now.modal.spindle_rev_min:
        made.append(Action(place, state.modal, Act.SPINDLE))
    if modal.coolant != now.modal.coolant:
        made.append(Action(place, state.modal, Act.COOLANT))
    return state, made
