"""Frames that come far more often than they were asked for: who sends them, and how many a second.

A healthy node sends its feedback once a SYNC, a heartbeat a few times a second, and an emergency when
something has happened. One that is broken, or that a stranger has set up otherwise, can fill the bus, and
then it is its neighbours that are missed: of two frames the one with the lower identifier goes first.

Only frames are counted that a healthy tick has few of, so it costs a healthy tick nothing:

    heartbeats, emergencies, event-driven process data     each by itself
    more feedbacks of one drive to a SYNC than it had      of each drive
    owed, those that were missed included
    frames of no node of ours                              of the identifier that most of them have

A count is a bucket that frames fill and time drains. What came while nobody listened is credited with the
whole of that time: a tick that was late finds no chatter in what has gathered.
"""

from __future__ import annotations

from typing import Final

from drives import pdo

# A heartbeat is due some 20 times a second, a drive that trips sends a handful of emergencies at once, and a
# bus that was kept busy for a second brings what has gathered.
SELDOM_PER_S, SELDOM = 100.0, 40.0
# Process data that go on change, and frames of others: as many as one a tick of most machines.
OFTEN_PER_S, OFTEN = 1000.0, 50.0
FEEDBACKS = 20.0
FLOODS: Final = 8.0  # in a bucket, of a bus on which others are missed at the same time
# A transfer of the slow side may fill what is left of the bus; it is behind all process data.
SLOW: Final = (pdo.SDO_ANSWER, pdo.SDO_QUESTION)
NOBODY: Final = -1


class Chatter:
    """What is reported of a group's buses: ``can_id`` (``NOBODY``: none) and ``per_s`` frames a second."""

    def __init__(self) -> None:
        self.can_id = NOBODY
        self.per_s = 0.0

    def forget(self) -> None:
        """RESET, or ENABLED anew."""
        self.can_id = NOBODY
        self.per_s = 0.0

    def report(self, bucket: Bucket, now_s: float) -> None:
        """The first that is too many is the one that is reported, with its largest figure."""
        if self.can_id in (NOBODY, bucket.can_id):
            self.can_id, self.per_s = bucket.can_id, max(self.per_s, bucket.per_s(now_s))


class Bucket:
    """Read: ``can_id``, ``level`` (frames above what drains)."""

    __slots__ = ("_began_s", "_drains_per_s", "_frames", "at_s", "can_id", "level", "most")

    def __init__(self, can_id: int, drains_per_s: float, most: float) -> None:
        self.can_id, self.most = can_id, most
        self._drains_per_s = drains_per_s
        self.level = 0.0
        self.at_s = float("-inf")  # of the last frame
        self._frames = 0
        self._began_s = 0.0  # the time for which it counts, see ``per_s``

    def count(self, now_s: float, since_s: float) -> bool:
        """Counts one frame of those that have come since ``since_s``; whether they are too many."""
        if now_s != self.at_s:
            left = self.level - self._drains_per_s * (now_s - self.at_s)
            if left <= 0.0:
                self._frames, self._began_s = 0, since_s
                left = max(left, self._drains_per_s * (since_s - now_s))
            self.level, self.at_s = left, now_s
        self.level += 1.0
        self._frames += 1
        return self.level > self.most

    def level_at(self, now_s: float) -> float:
        """What is in it now."""
        return self.level - self._drains_per_s * (now_s - self.at_s)

    def per_s(self, now_s: float) -> float:
        """How many a second came since it was empty."""
        return self._frames / (now_s - self._began_s) if now_s > self._began_s else 0.0


class Strangers(Bucket):
    """The bucket of the identifier that most of the frames of no node have (Boyer and Moore's vote)."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__(NOBODY, OFTEN_PER_S, OFTEN)

    def vote(self, can_id: int, now_s: float, since_s: float) -> bool:
        """Counts one frame of an identifier for it, or against the one that leads; an SDO is its question."""
        if pdo.group(can_id) == pdo.SDO_ANSWER:
            can_id += pdo.SDO_QUESTION - pdo.SDO_ANSWER
        if can_id == self.can_id:
            return self.count(now_s, since_s) and not is_slow(can_id)
        if self.level_at(now_s) <= 0.0:
            self.can_id, self.at_s, self.level = can_id, float("-inf"), 0.0
            self.count(now_s, since_s)
        else:
            self.level -= 1.0
        return False


def is_slow(can_id: int) -> bool:
    """Whether frames of this identifier may come as fast as the bus takes them."""
    return pdo.group(can_id) in SLOW or can_id in (pdo.LSS_ANSWER, pdo.LSS_ANSWER + 1)
