"""The last seconds of everything on a bus, in bounded memory.

Frames and their times, the oldest going first. It is a handler like any other: the stepped bus and
the hub call it with every frame (``bus.log(log.keep)``), and a listening port is
drained into it. Nothing is written until somebody asks, with a fault for example.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import merge
from typing import Protocol

from drives.log import candump
from drives.pdo import FRAME_BYTES

# 1 Mbit/s carries 10 500 frames of four bytes a second.
FRAMES_PER_S = 10_500
KEPT_S = 10.0


class Listening(Protocol):
    """What ``drain`` needs of a port."""

    def receive_into(self, buffer: bytearray, /) -> bool: ...


class FrameLog:
    """Keeps the frames of the last ``seconds``, at most ``capacity`` of them; the oldest go first.

    What a live machine hears, ``extend`` and calls, lets go of older ones; ``keep`` of those beyond
    ``capacity`` alone.
    """

    def __init__(self, seconds: float = KEPT_S, capacity: int | None = None) -> None:
        self.seconds = seconds
        # A deque of tuples: a quarter of the time that a ring of bytes takes per frame.
        most = max(1, round(seconds * FRAMES_PER_S) if capacity is None else capacity)
        self._kept: deque[tuple[float, bytes]] = deque(maxlen=most)
        self.keep = self._kept.append  # of time and frame as one; what ``bus.log`` takes
        self._one = bytearray(FRAME_BYTES)

    def __call__(self, frame: bytes, at_s: float) -> None:
        """Keep one frame."""
        self.extend([(at_s, frame)])

    def extend(self, heard: Sequence[tuple[float, bytes]]) -> None:
        """Keep several, each with its time, in their order."""
        kept = self._kept
        kept.extend(heard)
        until_s = kept[-1][0] - self.seconds if kept else 0.0
        while kept and kept[0][0] < until_s:
            kept.popleft()

    def __len__(self) -> int:
        return len(self._kept)

    def clear(self) -> None:
        self._kept.clear()

    def drain(self, port: Listening, now_s: float, most: int = 4096) -> int:
        """Keep what a listening port has received; how many frames that were.

        As of ``now_s``, or of when the kernel got them where the port can tell.
        """
        stamped = getattr(port, "receive_stamped", None)
        offset_s = now_s - time.time()
        for taken in range(most):
            if stamped is not None:
                stamp_s = stamped(self._one)
                if stamp_s is None:
                    return taken
                self(bytes(self._one), min(now_s, stamp_s + offset_s))
            elif port.receive_into(self._one):
                self(bytes(self._one), now_s)
            else:
                return taken
        return most

    def frames(self, until_s: float | None = None) -> Iterator[tuple[float, bytes]]:
        """Time and frame, oldest first, of the last ``seconds`` before ``until_s`` (default: the newest)."""
        kept = self._kept.copy()  # another thread may be listening
        if not kept:
            return
        end_s = kept[-1][0] if until_s is None else until_s
        for at_s, frame in kept:
            if end_s - self.seconds <= at_s <= end_s:
                yield at_s, frame

    def logged(
        self, bus: str, until_s: float | None = None, offset_s: float = 0.0
    ) -> Iterator[candump.Logged]:
        """The same with the name of the bus; ``offset_s`` is added to the times."""
        for at_s, frame in self.frames(until_s):
            yield at_s + offset_s, bus, frame


def merged(
    logs: Mapping[str, FrameLog], until_s: float | None = None, offset_s: float = 0.0
) -> Iterable[candump.Logged]:
    """The frames of several buses, by their names, in the order of time, as ``candump.save`` takes them.

    ``offset_s`` makes wall-clock times of the bus' clock where that is wanted.
    """
    each = [log.logged(bus, until_s, offset_s) for bus, log in logs.items()]
    return merge(*each, key=lambda logged: logged[0])
