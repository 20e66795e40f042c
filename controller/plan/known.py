"""Laws and stops found before: a check plans what a start then sends, a second start what the first one sent.

What a law depends on is compared by value, so whoever reads a program anew finds what was found for the same
motions; of another program nothing is kept (``memory.forget``).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from controller.ipc.handoff import StopTable
from controller.memory import remembered
from controller.plan.feed import profile
from controller.plan.feed.course import Course
from controller.plan.feed.profile import Profile, State
from controller.plan.feed.ticked import is_row
from controller.plan.stops import table

LAWS, STOPS = 64, 16  # windows; of each some kB, and up to a MB
MOST = 40  # stretches of one that is kept: to compare many lines takes as long as many a plan


class _Asked:
    """A question: equal to another where all that it depends on is. Once answered it keeps nothing else."""

    __slots__ = ("_answer", "_hash", "_on")

    def __init__(self, on: tuple[object, ...], answer: Callable[[], Any]) -> None:
        self._on, self._hash = on, hash(on)
        self._answer: Callable[[], Any] | None = answer

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Asked) and self._on == other._on

    def answered(self) -> Any:
        """To be asked once: a cache keeps the question, and not the course that was asked about."""
        answer, self._answer = self._answer, None
        assert answer is not None
        return answer()


@remembered(LAWS)
def _law(asked: _Asked) -> Profile | None:
    found: Profile | None = asked.answered()
    return found


@remembered(STOPS)
def _stops(asked: _Asked) -> StopTable:
    found: StopTable = asked.answered()
    return found


def law(course: Course, begin: State, until: float | None, guess: Profile | None) -> Profile | None:
    """As ``profile.plan``."""
    if not _is_kept(course):
        return profile.plan(course, begin, until, guess)
    on = (course.made_of, begin, until, _bytes(guess))
    return _law(_Asked(on, lambda: profile.plan(course, begin, until, guess)))


def stops(course: Course, found: Profile, first_s: float, last_s: float, step_s: float) -> StopTable:
    """As ``stops.table.stops``."""
    if not _is_kept(course):
        return table.stops(course, found, first_s, last_s, step_s)
    on = (course.made_of, _bytes(found), first_s, last_s, step_s)
    return _stops(_Asked(on, lambda: table.stops(course, found, first_s, last_s, step_s)))


def _is_kept(course: Course) -> bool:
    """Exact rows are remembered by their course, and not here."""
    return len(course.stretches) <= MOST and not is_row(course)


def _bytes(found: Profile | None) -> tuple[bytes, bytes] | None:
    return None if found is None else (found.times.tobytes(), found.pieces.tobytes())
