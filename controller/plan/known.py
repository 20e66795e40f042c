"""Laws and stops found before: a check plans what a start then sends, a second start what the first one sent.

What a law depends on is compared by value, so whoever reads a program anew finds what was found for the same
motions; of another program nothing is kept (``memory.forget``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from controller.ipc.handoff import StopTable
from controller.memory import remembered
from controller.plan.feed import profile
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.profile import Profile, State
from controller.plan.feed.ticked import is_row
from controller.plan.stops import table

T = TypeVar("T")

NUMBERS = 1_000_000  # that are kept, of 8 bytes: stops of a minute or two, and laws of many more
MAX_STRETCHES = 40  # segments of one that is kept: to compare many lines takes as long as many a plan


class _Newest:
    """The newest answers by what they depend on, as long as all are not more than so many numbers."""

    def __init__(self) -> None:
        self._found: dict[tuple[object, ...], tuple[Any, int]] = {}
        self._numbers = 0

    def __contains__(self, on: tuple[object, ...]) -> bool:
        return on in self._found

    def of(self, on: tuple[object, ...], answer: Callable[[], T], numbers: Callable[[T], int]) -> T:
        if (known := self._found.get(on)) is None:
            found = answer()
            known = self._found[on] = found, numbers(found)
            self._numbers += known[1]
            while self._numbers > NUMBERS:
                self._numbers -= self._found.pop(next(iter(self._found)))[1]
        made: T = known[0]
        return made


@remembered(1)
def _newest() -> _Newest:
    """Of the program at hand."""
    return _Newest()


def law(course: FeedCourse, begin: State, until: float | None, guess: Profile | None) -> Profile | None:
    """As ``profile.plan``."""
    if not _is_cacheable(course):
        return profile.plan(course, begin, until, guess)
    on = ("law", course.made_of, begin, until, _bytes(guess))
    return _newest().of(on, lambda: profile.plan(course, begin, until, guess), _size)


def laws(courses: Sequence[FeedCourse]) -> list[Profile | None]:
    """As ``law`` of each from rest to rest, with one search for all that are not known."""
    ons = [("law", one.made_of, profile.REST, None, None) if _is_cacheable(one) else None for one in courses]
    new = [k for k, on in enumerate(ons) if on is None or on not in _newest()]
    found = dict(zip(new, profile.plan_each([courses[k] for k in new]), strict=True))
    return [
        found[k] if on is None else _newest().of(on, lambda k=k: found[k], _size)  # type: ignore[misc]
        for k, on in enumerate(ons)
    ]


def stops(course: FeedCourse, found: Profile, first_s: float, last_s: float, step_s: float) -> StopTable:
    """As ``stops.table.stops``."""
    if not _is_cacheable(course):
        return table.stops(course, found, first_s, last_s, step_s)
    on = ("stops", course.made_of, _bytes(found), first_s, last_s, step_s)
    return _newest().of(
        on,
        lambda: table.stops(course, found, first_s, last_s, step_s),
        lambda made: len(made.jerks) + len(made),
    )


def _is_cacheable(course: FeedCourse) -> bool:
    """Exact rows are remembered by their course, and not here."""
    return len(course.segments) <= MAX_STRETCHES and not is_row(course)


def _bytes(found: Profile | None) -> tuple[bytes, bytes] | None:
    return None if found is None else (found.times.tobytes(), found.pieces.tobytes())


def _size(found: Profile | None) -> int:
    return 1 if found is None else found.times.size + found.pieces.size
