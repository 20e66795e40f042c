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
from controller.program.modal import State, tool_list
from controller.program.offset_words import Here
from controller.program.program import Block, JointLine, TipLine
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
        raise here.ask.refusal(
            word, "G53.3 takes positions in the plane, and G91 is active: write G90 before it"
        )
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
        raise here.ask.refusal(
            word,
            f"{code} turns the tool to a tilted plane and none is defined: write G68.2 or G68.3 before it",
        )
    return state


def _with_length(here: Here, state: State) -> State:
    """H of Fanuc's G53.6: the length of that tool, as of G43."""
    word = here.ask.words.get("H")
    if word is None or here.ask.code("length"):
        return state
    tool, number = None, here.ask.whole(word)
    if number and (tool := state.tool(number, here.machine)) is None:
        raise here.ask.refusal(
            word, f"{word.text} names no tool: the tool table has {tool_list(here.machine)}; use one of these"
        )
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
        raise here.ask.refusal(
            given or word,
            f"{code} P{p} chooses nothing: P0 is the nearest position of the rotary axes, P1 and P2 the "
            "positive and the negative one of the primary axis; write one of these",
        )
    machine, kinematics = here.machine, here.position.chain()
    axis = kinematics.nearest_reached(axis, ROUNDING_RAD)
    found = kinematics.candidates(axis, None, machine.turns(), now)
    lead = primary(machine)
    allowed = [pair for pair in found if p == 0 or _is_asked(machine, p, lead, pair, now)]
    if not allowed:
        everywhere = [q for q in kinematics.branches(axis, math, None, now) if not any(map(math.isnan, q))]
        raise here.ask.refusal(word, f"{code} {_unreachable(machine, everywhere, found, p, axis)}")
    return min(allowed, key=lambda pair: _way(pair, now, lead))


def _is_asked(machine: Machine, p: int, lead: int, pair: Pair, now: Pair) -> bool:
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


def _unreachable(machine: Machine, pairs: list[Pair], within: list[Pair], p: int, axis: Vector) -> str:
    """Why no position is left: of ``pairs`` in any turn those ``within`` the travel are not as P asks."""
    i, j, k = (0.0 if abs(c) < 5e-7 else c for c in axis)
    what = f"cannot turn the tool along Z of this plane ({i:.6g} {j:.6g} {k:.6g} on the table)"
    if not pairs:
        return f"{what}: {_lost(machine)}; tilt the part, or choose another plane"
    listed = within if within else pairs
    shown = " or ".join(
        _shown(machine, pair) for pair in sorted(listed, key=lambda q: _way(q, (0.0, 0.0), 0))[:4]
    )
    advice = "leave out P" if within else "tilt the part, or choose another plane"
    needs = f"P{p} leaves none of {shown}" if within else f"it needs {shown}"
    return f"{what}: {needs}, and the travel is {_travel(machine)}; {advice}"


def _lost(machine: Machine) -> str:
    """No position gives the axis of the tool."""
    names = " and ".join(machine.axes[i].name for i in machine.rotary())
    if not names:
        return "it stands along Z, and no axis of this machine turns it"
    return f"no position of {names} gives this tool axis, whatever their travel"


def _shown(machine: Machine, pair: Pair) -> str:
    axes = (machine.axes[i] for i in machine.rotary())
    rows = (f"{axis.name}{q * axis.shown_per_unit:.4f}" for axis, q in zip(axes, pair, strict=False))
    return " ".join(rows)


def _travel(machine: Machine) -> str:
    told = []
    for axis in (machine.axes[i] for i in machine.rotary()):
        low, high = sorted(q * axis.shown_per_unit for q in (axis.travel_min, axis.travel_max))
        told.append(f"{axis.name} {low:.6g} to {high:.6g}")
    return ", ".join(told)
