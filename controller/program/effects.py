"""What lines do to the machine: whether it stands as before when they have been carried out."""

from __future__ import annotations

from collections.abc import Iterable

from controller.program.program import (
    UNSAID,
    Act,
    Action,
    Await,
    Block,
    Dwell,
    OperatorMessage,
    Remark,
    Select,
    Setting,
)

# They stop, end, or turn coolant on or off.
QUIET_ACTS = frozenset({Act.STOP, Act.OPTIONAL_STOP, Act.END, Act.COOLANT, Act.INPUT})


def moves(blocks: Iterable[Block], prepares: bool = False) -> bool:
    """Whether an axis moves, the spindle turns, a tool is changed or an output switched.

    ``prepares``: T alone makes the tool changer bring a pocket.
    """
    return any(_moves(block, prepares) for block in blocks)


def _moves(block: Block, prepares: bool) -> bool:
    match block:
        case Action(act=Act.SPINDLE):
            return block.modal.spindle_rev_min != 0.0
        case Action():
            return block.act not in QUIET_ACTS
        case Await():
            return block.outputs != UNSAID
        case Select():
            return prepares
        case _:
            return not isinstance(block, Dwell | OperatorMessage | Remark | Setting)
