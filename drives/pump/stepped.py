"""The pump on a stepped clock: each period at just its time, and chosen shortly before."""

from __future__ import annotations

from collections.abc import Callable

from drives.pump.player import EARLY_SHARE, Player


class SteppedPump:
    """Plays a period each ``period_s``, from the first on that ``advance`` comes to."""

    def __init__(self, player: Player, period_s: float, advance: Callable[[float], None]) -> None:
        """``advance``: lets the bus pass time, up to a time of the clock (s)."""
        self._player, self._period_s, self._advance = player, period_s, advance
        self._played = 0
        self._prepared = False

    def advance(self, now_s: float) -> None:
        """All periods that are due until then, and the bus."""
        player, period_s = self._player, self._period_s
        while (self._played + 1 - EARLY_SHARE) * period_s <= now_s + 1e-9:
            if not self._prepared:
                self._prepared = True
                player.prepare()
            due_s = (self._played + 1) * period_s
            if due_s > now_s + 1e-9:
                break
            self._advance(due_s)
            self._played += 1
            self._prepared = False
            player.send(round((due_s + period_s) * 1e9), 0)
        self._advance(now_s)
