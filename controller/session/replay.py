"""The planner's turns of a live run, made again at the same ticks of a stepped one.

Without an override the windows of a plan depend on the program alone. An override is planned from
where the tick is when the planner looks, and counts from where its message is taken: both are in
the record of a run, so that every setpoint comes again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from controller.handoff import PieceMessage, Snapshot
from controller.plan.planner import Planner
from controller.session.events import Turn


class Replay:
    """Between planner and tick; ``deliver`` is the planner's ``send``, ``stand`` what a long gap does."""

    def __init__(
        self, deliver: Callable[[PieceMessage], bool], stand: Callable[[], None] = lambda: None
    ) -> None:
        self._deliver, self._stand = deliver, stand
        self._turns: deque[Turn] = deque()
        self._waiting: deque[PieceMessage] = deque()
        self.active = False

    def begin(self, turns: Sequence[Turn]) -> None:
        """From here on messages wait for their tick, if there are turns at all."""
        self._turns, self.active = deque(turns), bool(turns)
        self._waiting.clear()

    @property
    def pending(self) -> bool:
        """Whether the planner has turns left: what stands still will go on."""
        return bool(self._turns)

    def send(self, message: PieceMessage) -> bool:
        """As the planner's ``send``."""
        if self.active and not message.is_keepalive:
            self._waiting.append(message)
            return True
        return self._deliver(message)

    def before_start(
        self, planner: Planner, now: Callable[[], Snapshot | None], tick: Callable[[], None]
    ) -> None:
        """What was planned and taken at rest; each message has a tick to be taken in."""
        while self._turns and self._turns[0].tick < 0:
            turn = self._turns.popleft()
            self._make(turn, planner, now())
            if turn.pieces:
                tick()

    def before(self, n: int, planner: Planner, now: Snapshot | None) -> None:
        """The turns that belong before the n-th tick."""
        while self._turns and self._turns[0].tick <= n:
            self._make(self._turns.popleft(), planner, now)

    def _make(self, turn: Turn, planner: Planner, now: Snapshot | None) -> None:
        if turn.stand:
            self._stand()
        elif turn.pieces:
            if self._waiting:
                self._deliver(self._waiting.popleft())
        elif now is not None:
            planner.lead_s = turn.lead_s
            planner.work(now)
