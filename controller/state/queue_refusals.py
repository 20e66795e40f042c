"""Why the tick does not take a message of pieces: each reason once, with its sentence in the catalogues."""

from __future__ import annotations

from enum import IntEnum

from controller.messages import Message, message


class QueueRefusal(IntEnum):
    """A reason; the first that holds, in this order."""

    NONE = 0  # it was taken
    OLD = 1  # its number is not above that of the last message taken
    VOID = 2  # it came with a stop or a reset that empties the queue
    MODE = 3  # the machine is neither READY, RUNNING nor in HOLD
    EPOCH = 4  # made for a queue that has been given up since
    STOPPING = 5  # the tool is leaving the plan for a standstill
    EMPTY = 6  # no piece is in it
    LATE = 7  # it would replace what may no longer be replaced
    GAP = 8  # it begins after the end of what is queued
    UNKNOWN_MOTION = 9  # a piece is of a motion that never came
    UNREACHABLE = 10  # the axes cannot take the place at which it begins
    ELSEWHERE = 11  # it begins beside the place of the axes
    JUMP = 12  # it goes on at another place of a motion than the queue is at then


def refusal_message(refusal: QueueRefusal) -> Message:
    """The sentence of a reason; of NONE that the last message was taken."""
    return message(f"queue.{refusal.name}")
