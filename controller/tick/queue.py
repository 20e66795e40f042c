"""What the tick has been given: pieces in plan time, the marks between them, and the stops out of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from controller.geometry.vectors import ROUNDING
from controller.ipc.handoff import Piece, PieceMessage, StopTable
from controller.motion.motions import Motion, ThreadMove, ToolSpline

ON_GRID_S = 1e-7  # a stop begins at just its time, or it is not for this tick
REST_SPEED = 1e-6  # mm/s or deg/s of the law: at rest


class Entry:
    """One piece in the queue, with its place in plan time."""

    __slots__ = (
        "_place",
        "_tau",
        "coefficients",
        "end_s",
        "index",
        "knots",
        "last",
        "motion",
        "piece",
        "start_s",
        "thread",
    )

    def __init__(self, piece: Piece, motion: Motion | None, start_s: float) -> None:
        self.piece = piece
        self.motion = motion
        self.thread = motion if isinstance(motion, ThreadMove) else None
        self.start_s = start_s
        self.end_s = start_s + piece.duration_s
        self.knots = piece.law.knots_s
        self.coefficients = piece.law.coefficients
        self.last = len(self.coefficients) - 1
        self.index = 0  # polynomial of the last look-up: the next is this or a neighbour
        self._tau = math.nan  # of the last look-up, which a tick asks for more than once, and ...
        self._place = (0.0, 0.0, 0.0)  # ... what was found

    def at(self, tau: float) -> tuple[float, float, float]:
        """(s, ds/dtau, d2s/dtau2) at plan time ``tau``, clamped to the law."""
        if tau == self._tau:
            return self._place
        t, knots, i = tau - self.start_s, self.knots, self.index
        if t > knots[-1]:
            t = knots[-1]
        elif t < 0.0:
            t = 0.0
        while i < self.last and t >= knots[i + 1]:
            i += 1
        while i > 0 and t < knots[i]:
            i -= 1
        self.index = i
        x = t - knots[i]
        c0, c1, c2, c3, c4, c5 = self.coefficients[i]
        self._tau = tau
        self._place = found = (
            c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))),
            c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5))),
            2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)),
        )
        return found

    def take_marks(self) -> None:
        """Its marks have been passed, or are another piece's now."""
        self.piece = self.piece._replace(stop=False, optional_stop=False, block_end=False, end=False)

    def take_setting(self) -> None:
        """What it sets has been told."""
        self.piece = self.piece._replace(sets=False, outputs=(0, 0, ()))

    def cut_at(self, end_s: float) -> None:
        """What follows it begins then."""
        self.end_s = end_s
        self.take_marks()

    @property
    def begins_at(self) -> float:
        """Where along its motion it begins: a way back to the path comes to the middle of one."""
        s, _, _ = self.at(self.start_s)
        return s

    def line_at(self, s: float) -> int:
        """Line of the program at ``s``; a spline has many."""
        motion = self.motion
        return motion.line_at(s) if isinstance(motion, ToolSpline) else self.piece.line

    @property
    def leaves_thread(self) -> bool:
        """Whether it ends where its thread does: there the spindle must have come, too."""
        return self.thread is not None and self.at(self.end_s)[0] >= self.thread.end - REST_SPEED

    def rests_at(self, tau: float) -> bool:
        """Whether the plan stands at ``tau``: in a dwell, and where a law begins or ends so."""
        if self.motion is None:
            return True
        inside = self.start_s + ROUNDING < tau < self.end_s - ROUNDING
        return not inside and abs(self.at(tau)[1]) < REST_SPEED

    def binding_at(self, tau: float) -> int:
        """Code of what binds at ``tau``."""
        code, t = 0, tau - self.start_s
        for from_s, name in self.piece.binds:
            if from_s > t:
                break
            code = name
        return code


class Stops:
    """The stop tables of the messages in the queue, each as far as the plan is still what it was made for."""

    def __init__(self) -> None:
        self._tables: list[tuple[StopTable, float]] = []  # with the plan time up to which they hold

    def clear(self) -> None:
        self._tables.clear()

    def add(self, tables: Sequence[StopTable], from_s: float, now_s: float) -> None:
        """From ``from_s`` on the plan is new, and has ``tables``; before it the older ones hold."""
        kept = [(old, min(until_s, from_s)) for old, until_s in self._tables]
        self._tables = [(old, until_s) for old, until_s in kept if until_s > max(now_s, old.start_s)]
        self._tables += [(table, table.end_s) for table in tables if len(table)]

    def row_at(self, tau: float) -> tuple[StopTable, int] | None:
        """The table and row of the stop that begins at ``tau``; None where there is none."""
        for table, until_s in self._tables:
            if table.start_s - ON_GRID_S <= tau < until_s - ON_GRID_S:
                i = round((tau - table.start_s) / table.step_s)
                off = tau - table.start_s - i * table.step_s
                if -ON_GRID_S < off < ON_GRID_S and table.first[i + 1] > table.first[i]:
                    return table, i
        return None


class Queue:
    """The entries in the order of their times. Read: ``end_s``, where it rests; the numbers ``first`` and
    ``last`` of the oldest and the newest, the latter one less than ``first`` where there ``is_empty``.

    An entry keeps its number for as long as it is here; the oldest are forgotten, and 0 is the first ever.
    """

    __slots__ = ("_entries", "_motions", "_stops", "end_s", "first", "is_empty", "last")

    def __init__(self) -> None:
        self._entries: list[Entry] = []
        self.first, self.last, self.is_empty = 0, -1, True
        self._motions: dict[int, Motion] = {}
        self._stops = Stops()
        self.end_s = 0.0

    def __len__(self) -> int:
        return len(self._entries)

    def __getitem__(self, number: int) -> Entry:
        return self._entries[number - self.first]

    def _count(self) -> None:
        """After each change: these are read several times a tick."""
        self.last, self.is_empty = self.first + len(self._entries) - 1, not self._entries

    def numbers_from(self, number: int) -> range:
        return range(number, self.last + 1)

    def at(self, tau: float, now: int) -> Entry | None:
        """The entry that ``tau`` lies in, from number ``now`` on."""
        entries = self._entries[now - self.first :]
        return next((entry for entry in entries if entry.start_s <= tau < entry.end_s), None)

    def stop_at(self, tau: float) -> tuple[StopTable, int] | None:
        """The table and row of the stop that begins at ``tau``; None where there is none."""
        return self._stops.row_at(tau)

    def clear(self, tau: float) -> None:
        """It ends where the clock stands."""
        self.first += len(self._entries)
        self._entries.clear()
        self._motions.clear()
        self._stops.clear()
        self.end_s = tau
        self._count()

    def entries_of(self, message: PieceMessage, start_s: float) -> list[Entry] | None:
        """A message's pieces from ``start_s`` on; None: there are none, or one's motion is not known."""
        entries: list[Entry] = []
        for piece in message.pieces:
            motion = message.motions.get(piece.motion_id, self._motions.get(piece.motion_id))
            if motion is None and piece.motion_id >= 0:
                return None
            entries.append(Entry(piece, motion, start_s))
            start_s = entries[-1].end_s
        return entries or None

    def add(self, message: PieceMessage, entries: Sequence[Entry], tau: float) -> None:
        """Takes a message's ``entries`` in, behind what is here."""
        self._entries += entries
        self._count()
        self.end_s = entries[-1].end_s
        self._motions.update(message.motions)
        self._stops.add(message.stops, message.replace_from_s, tau)

    def truncate(self, start_s: float, now: int) -> int:
        """Drops what begins at ``start_s`` or later and cuts the piece that lies across it.

        The number of the entry under the clock, which was ``now``.
        """
        entries = self._entries
        # A mark without duration just at that time belongs to what stays.
        while entries and entries[-1].start_s > start_s - ROUNDING and entries[-1].end_s > start_s + ROUNDING:
            entries.pop()
        if entries and entries[-1].end_s > start_s + ROUNDING:
            entries[-1].cut_at(start_s)
        self._count()
        return max(self.first, min(now, self.last))

    def forget_before(self, now: int) -> None:
        """Entries behind the clock; a dwell keeps the motion before it, where it stands."""
        entries, keep = self._entries, now - self.first
        while keep > 0 and entries[keep].motion is None:
            keep -= 1
        del entries[:keep]
        self.first += keep
        used = {entry.piece.motion_id for entry in entries}
        for identity in [i for i in self._motions if i not in used]:
            del self._motions[identity]
