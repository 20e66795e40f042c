"""Memory for one long computation: freed arrays stay with the process, and the collector comes seldom.

What an array gives back is asked for again within the same millisecond. And what imports and runs make in
thousands and keep (classes, frames, rows) is no rubbish: to look through it every 700 objects costs and
finds nothing.
"""

from __future__ import annotations

import gc

# glibc's malloc.h. By default an array of 128 kB and more is a mapping of its own, and what is free at the
# end of the heap goes back to the system: the pages of the next array must be made and cleared anew.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
LARGEST_BYTES = 32 << 20  # the most that glibc takes as a limit of what comes from the heap
KEPT_BYTES = 128 << 20
# Objects more than before; the default of Python is 700. The log of a bus alone keeps 105 000 frames.
COLLECT_EVERY = 200_000


def keep_freed() -> None:
    """For the rest of this process; without glibc nothing is changed."""
    import ctypes

    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, LARGEST_BYTES)
        mallopt(_TRIM_THRESHOLD, KEPT_BYTES)


def collect_rarely() -> None:
    """For the rest of this process: rings of dead objects wait longer, what is there now is not looked at."""
    gc.freeze()
    gc.set_threshold(COLLECT_EVERY)
