"""Memory of a process: what it keeps of programs, what freed arrays it keeps, and when it looks for rubbish.

A process that lives on meets ever new programs: what it remembers of one (``remembered``) it can ``forget``
with the next, and ``give_back`` to the system what one took that was larger than others.

In one long computation it is the other way round. What an array gives back is asked for again within the
same millisecond. And what imports and runs make in thousands and keep (classes, frames, rows) is no rubbish:
to look through it every 700 objects costs and finds nothing.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from functools import _lru_cache_wrapper, lru_cache
from typing import TypeVar

T = TypeVar("T")

_FORGET: list[Callable[[], None]] = []

# glibc's malloc.h. By default an array of 128 kB and more is a mapping of its own, and what is free at the
# end of the heap goes back to the system: the pages of the next array must be made and cleared anew.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
LARGEST_BYTES = 32 << 20  # the most that glibc takes as a limit of what comes from the heap
KEPT_BYTES = 128 << 20
# Objects more than before; the default of Python is 700. The log of a bus alone keeps 105 000 frames.
COLLECT_EVERY = 200_000


def remembered(most: int) -> Callable[[Callable[..., T]], _lru_cache_wrapper[T]]:
    """As ``lru_cache``, for what the parts of one program are asked for again and again."""

    def cached(function: Callable[..., T]) -> _lru_cache_wrapper[T]:
        found = lru_cache(most)(function)
        _FORGET.append(found.cache_clear)
        return found

    return cached


def forget() -> None:
    """All that is ``remembered``, of whatever program."""
    for one in _FORGET:
        one()


def give_back() -> None:
    """What is freed goes back to the system: after a large program, a process would stay as large."""
    if (trim := _of_glibc("malloc_trim")) is not None:
        trim(0)


def keep_freed() -> None:
    """For the rest of this process; without glibc nothing is changed."""
    if (mallopt := _of_glibc("mallopt")) is not None:
        mallopt(_MMAP_THRESHOLD, LARGEST_BYTES)
        mallopt(_TRIM_THRESHOLD, KEPT_BYTES)


def collect_rarely() -> None:
    """For the rest of this process: rings of dead objects wait longer, what is there now is not looked at."""
    gc.freeze()
    gc.set_threshold(COLLECT_EVERY)


def _of_glibc(name: str) -> Callable[..., int] | None:
    """None in another library of C."""
    import ctypes

    found: Callable[..., int] | None = getattr(ctypes.CDLL(None), name, None)
    return found
