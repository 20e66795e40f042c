"""What the tick has been given: pieces in plan time, the marks between them, and the stops out of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from controller.geometry.vectors import ROUNDING
from controller.ipc.handoff import Piece, PieceMessage, StopTable
from controller.motion.motions import Motion, ThreadMove, ToolSpline

ON_GRID_S = 1e-7  # a stop begins at just its time, or it is not for this tick
REST_SPEED = 1e-6  # mm/s or deg/s of the law: at rest


class Entry:
    """One piece in the queue, with its place in plan time."""

    __slots__ = ("coefficients", "end_s", "index", "knots", "last", "motion", "piece", "start_s", "thread")

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

    def at(self, tau: float) -> tuple[float, float, float]:
        """(s, ds/dtau, d2s/dtau2) at plan time ``tau``, clamped to the law."""
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
        return (
            c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))),
            c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5))),
            2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)),
        )

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


def entries_of(message: PieceMessage, known: Mapping[int, Motion], start_s: float) -> list[Entry] | None:
    """A message's pieces from ``start_s`` on; None if there are none, or one's motion is not ``known``."""
    entries = []
    for piece in message.pieces:
        motion = message.motions.get(piece.motion_id, known.get(piece.motion_id))
        if motion is None and piece.motion_id >= 0:
            return None
        entries.append(Entry(piece, motion, start_s))
        start_s = entries[-1].end_s
    return entries or None


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


class Brake:
    """A stop under way: jerk after jerk, from the plan's own s, v and a to rest."""

    __slots__ = ("_held", "_jerks", "_k", "_last", "_n", "_period_s", "a", "active", "left_at", "s", "v")

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._jerks = StopTable.of(0.0, 1.0, 1.0, ()).jerks
        self._k = self._last = self._n = 0
        self._held = 1  # ticks for which each jerk holds
        self.active = False
        self.left_at = 0.0  # speed at which the plan was left
        self.s = self.v = self.a = 0.0

    def begin(self, table: StopTable, row: int, state: tuple[float, float, float]) -> None:
        """Leave the plan at ``state`` (s, v, a)."""
        self.s, self.v, self.a = state
        self.left_at = self.v
        self._jerks, self._k, self._last = table.jerks, table.first[row], table.first[row + 1]
        self._held = max(1, round(table.jerk_step_s / self._period_s))
        self._n = 0
        self.active = True

    def come_to(self, queue: Sequence[Entry], now: int) -> int:
        """Index of the entry in which it is now; its s runs on from motion to motion, but past no rest."""
        entry = queue[now]
        while entry.motion is not None and self.s > entry.motion.end:
            i = now + 1
            while i < len(queue) and queue[i].piece.motion_id == entry.piece.motion_id:
                i += 1
            if i == len(queue) or queue[i - 1].rests_at(queue[i - 1].end_s):
                self.s = entry.motion.end  # by rounding
                break
            self.s -= entry.motion.end
            now, entry = i, queue[i]
        return now

    def stand(self, s: float) -> None:
        """At rest at ``s`` already, without a way to it."""
        self.s, self.v, self.a, self.left_at = s, 0.0, 0.0, 0.0
        self._k = self._last = self._n = 0
        self.active = True

    @property
    def over(self) -> bool:
        """At rest."""
        return self._k >= self._last

    def step(self) -> None:
        """One period on; with the last one speed and acceleration are nothing."""
        h, v, a, j = self._period_s, self.v, self.a, self._jerks[self._k]
        self.s += h * (v + h * (0.5 * a + h * j / 6.0))
        self.v = v + h * (a + 0.5 * h * j)
        self.a = a + h * j
        self._n += 1
        if self._n == self._held:
            self._n = 0
            self._k += 1
            if self._k == self._last:
                self.v = self.a = 0.0

    def save(self) -> tuple[bool, float, float, float, int, int]:
        return self.active, self.s, self.v, self.a, self._k, self._n

    def restore(self, saved: tuple[bool, float, float, float, int, int]) -> None:
        self.active, self.s, self.v, self.a, self._k, self._n = saved
