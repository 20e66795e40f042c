"""G53.1, G53.3 and G53.6: the tool turned until it stands along Z of the tilted plane.

Two positions of the rotaries, in many turns, put the tool there. P chooses: 0 the nearest; 1 and 2 under
rs274 the ones to which the primary rotary goes in its positive or negative direction, under fanuc those where
it stands from 0 to 180 or from -180 to 0 degrees. Primary is the rotary next to the base, of one on either
side the table.

G53.1 moves the rotaries alone, G53.6 keeps the tip where it is on the part, G53.3 goes to X Y Z meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import replace

from controller.geometry.vectors import ROUNDING, Vector
from controller.machine.kinematics import Pair
from controller.machine.model import Kind, Machine
from controller.messages import Message, chain, message
from controller.program.modal import State, tool_list
from controller.program.offset_words import Here
from controller.program.program import Block, JointLine, ProgramError, TipLine
from controller.program.words import Word

# Under an oblique rotary a plane at the end of its reach, such as a side of the part, misses it by as much as
# words of three decimals do.
ROUNDING_RAD = math.radians(0.001)
HALF = math.pi


def turned(here: Here) -> tuple[State, list[Block]]:
    """The state after a G53.1, G53.3 or G53.6, and its rapid. Raises ProgramError."""
    code, word = here.ask.codes["one-line"]
    state = _active(here, code, word)
    state = _with_length(here, state)
    modal, place = state.modal, here.ask.place(word)
    first, second = here.known(word, here.position.rotaries, code)
    pair = _chosen(here, code, word, (first, second), modal.frame(here.machine).z)
    tip = here.lengths_mm()
    if code == "G53.3" and not here.state.absolute:
        raise here.ask.refusal(word, "plane.g53_3_relative")
    if code == "G53.6" or tip != (None, None, None):
        stands = code == "G53.6"
        return state, [TipLine(place, modal, tip, pair, None, False, None, None, stands=stands)]
    targets: list[float | None] = [None] * len(here.machine.axes)
    for i, value in zip(here.machine.rotary(), pair, strict=False):
        targets[i] = value
    return state, [JointLine(place, modal, tuple(targets), False, False, None, None)]


def _active(here: Here, code: str, word: Word) -> State:
    """The state in the plane: one that waits for the tool (rs274) counts from here on."""
    origins, state = here.state.origins, here.state
    if origins.waiting is not None:
        return state._replace(cycle=None).with_origins(origins.tilted(origins.waiting), here.machine)
    if origins.plane is None:
        raise here.ask.refusal(word, "plane.none_defined", code=code)
    return state


def _with_length(here: Here, state: State) -> State:
    """H of Fanuc's G53.6: the length of that tool, as of G43."""
    word = here.ask.words.get("H")
    if word is None or here.ask.code("length"):
        return state
    tool, number = None, here.ask.whole(word)
    if number and (tool := state.named(number, here.machine)) is None:
        raise here.ask.refusal(word, "tool.unknown_here", tools=tool_list(here.machine))
    return state._replace(modal=replace(state.modal, length_mm=tool.length_mm if tool is not None else 0.0))


# ---- the choice ------------------------------------------------------------------------


def primary(machine: Machine) -> int:
    """Which of the two rotaries (0 or 1) P chooses by."""
    first, second = machine.pair([axis.kind for axis in machine.axes], Kind.LINEAR)
    return 1 if first is Kind.HEAD and second is Kind.TABLE else 0


def _chosen(here: Here, code: str, word: Word, now: Pair, axis: Vector) -> Pair:
    """The rotaries (rad) that put the tool along ``axis`` of the table frame."""
    given = here.ask.words.get("P")
    p = 0 if given is None else here.ask.whole(given)
    if p > 2:
        raise here.ask.refusal(given or word, "plane.no_solution_chosen", code=code, p=p)
    machine, kinematics = here.machine, here.position.chain()
    axis = kinematics.nearest_reached(axis, ROUNDING_RAD)
    found = kinematics.candidates(axis, None, machine.turns(), now)
    lead = primary(machine)
    allowed = [pair for pair in found if p == 0 or _is_on_side(machine, p, lead, pair, now)]
    if not allowed:
        everywhere = [q for q in kinematics.branches(axis, math, None, now) if not any(map(math.isnan, q))]
        raise _unreachable(here, code, word, everywhere, found, p, axis)
    return min(allowed, key=lambda pair: _way(pair, now, lead))


def _is_on_side(machine: Machine, p: int, lead: int, pair: Pair, now: Pair) -> bool:
    """Whether the primary rotary goes (rs274) or stands (fanuc) on the side of P1 or P2, as it is shown."""
    shown = machine.pair([axis.shown_per_unit for axis in machine.axes], 1.0)[lead]
    sign = math.copysign(1.0, shown) * (1.0 if p == 1 else -1.0)
    if machine.dialect == "rs274":
        return sign * (pair[lead] - now[lead]) >= -ROUNDING
    angle = math.remainder(sign * pair[lead], 2.0 * HALF)
    return angle >= -ROUNDING or angle <= ROUNDING - HALF


def _way(pair: Pair, now: Pair, lead: int) -> tuple[float, ...]:
    """What is made least, one after the other, as Fanuc judges: ways, then angles, of the primary first."""
    order = (lead, 1 - lead)
    ways = [abs(pair[k] - now[k]) for k in order]
    angles = [abs(math.remainder(pair[k], 2.0 * HALF)) for k in order]
    return (*(round(value, 9) for value in (*ways, *angles)), -pair[lead], -pair[1 - lead])


def _unreachable(
    here: Here, code: str, word: Word, pairs: list[Pair], within: list[Pair], p: int, axis: Vector
) -> ProgramError:
    """Why no position is left: of ``pairs`` in any turn those ``within`` the travel are not as P asks."""
    machine, listed = here.machine, within or pairs
    names = chain("and", [machine.axes[i].name for i in machine.rotary()]) if machine.rotary() else ""
    nearest = sorted(listed, key=lambda pair: _way(pair, (0.0, 0.0), 0))[:4]
    key = "plane.p_leaves_none" if within else "plane.beyond_travel" if pairs else "plane.no_axis"
    return here.ask.refusal(
        word,
        key if names else "plane.no_rotary",
        **dict(zip("ijk", (0.0 if abs(c) < 5e-7 else c for c in axis), strict=True)),
        code=code,
        p=p,
        names=names,
        shown=chain("or", [_shown(machine, pair) for pair in nearest]) if nearest else "",
        travel=chain("program.listed", _travel(machine)) if names else "",
    )


def _shown(machine: Machine, pair: Pair) -> str:
    axes = (machine.axes[i] for i in machine.rotary())
    rows = (f"{axis.name}{q * axis.shown_per_unit:.4f}" for axis, q in zip(axes, pair, strict=False))
    return " ".join(rows)


def _travel(machine: Machine) -> list[Message | str]:
    told: list[Message | str] = []
    for axis in (machine.axes[i] for i in machine.rotary()):
        low, high = sorted(q * axis.shown_per_unit for q in (axis.travel_min, axis.travel_max))
        told.append(message("plane.travel", axis=axis.name, low=low, high=high))
    return told
