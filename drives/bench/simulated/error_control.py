"""Error control of a simulated drive (CiA 301, 7.2.8.2): heartbeat both ways, or node guarding.

Watching a node starts with its first heartbeat, watching the master with its first
remote request. An alarm is set once and looks at the newest sign of life, so a sign
costs one assignment. A drive whose heartbeat producer runs does not answer guarding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drives import pdo
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Abort, Code
from drives.bench.simulated.station import INITIALISING, Station
from drives.bench.virtual.virtual_bus import Handler

CONSUMER_AT, CONSUMERS = 0x1016, 8
TOGGLE = 0x80
MS = 1e-3

Lost = Callable[[float], None]  # a watched node is silent, or speaks again


class HeartbeatProducer:
    """1017h: the state every so many milliseconds, the first one at once."""

    def __init__(self, station: Station) -> None:
        self._station = station
        # A new time starts at once, whatever was left of the old one.
        station.dictionary.writers[key(0x1017)] = lambda _ms: station.cancel("beat")

    @property
    def period_s(self) -> float:
        return self._station.dictionary.values[key(0x1017)] * MS

    def configure(self) -> None:
        station = self._station
        if self.period_s <= 0.0 or station.nmt == INITIALISING:
            station.cancel("beat")
        elif not station.waiting("beat"):
            station.alarm("beat", station.now_s, self._beat)

    def _beat(self, now_s: float) -> None:
        station = self._station
        station.send(now_s, pdo.HEARTBEAT + station.node, bytes([station.nmt]))
        if self.period_s > 0.0:
            station.alarm("beat", now_s + self.period_s, self._beat)


class HeartbeatConsumer:
    """1016h: nodes whose heartbeat must not stay away."""

    def __init__(self, station: Station, lost: Lost, back: Lost) -> None:
        self._station = station
        self._lost = lost
        self._back = back
        self._heard_s: dict[int, float] = {}  # by node
        self._silent: set[int] = set()
        for sub in range(1, CONSUMERS + 1):
            station.dictionary.writers[key(CONSUMER_AT, sub)] = partial(self._check, sub)

    def _check(self, sub: int, entry: int) -> None:
        """No node may be watched twice (06040043h)."""
        if entry >> 24:
            raise Abort(Code.VALUE)
        node, silent_ms = entry >> 16 & 0xFF, entry & 0xFFFF
        others = (s for s in range(1, CONSUMERS + 1) if s != sub)
        taken = {self._entry(other) >> 16 & 0xFF for other in others if self._entry(other) & 0xFFFF}
        if node and silent_ms and node in taken:
            raise Abort(Code.INCOMPATIBLE)
        self._forget_node(self._entry(sub) >> 16 & 0x7F)
        self._forget_node(node & 0x7F)

    def _forget_node(self, node: int) -> None:
        """Watching starts anew: with the next heartbeat."""
        self._heard_s.pop(node, None)
        self._station.cancel(f"heartbeat of {node}")
        if node in self._silent:
            self._silent.remove(node)
            self._back(self._station.now_s)

    def _entry(self, sub: int) -> int:
        return self._station.dictionary.values.get(key(CONSUMER_AT, sub), 0)

    def watched(self) -> dict[int, float]:
        """How long each node may be silent, s."""
        entries = [self._entry(sub) for sub in range(1, CONSUMERS + 1)]
        return {e >> 16 & 0x7F: (e & 0xFFFF) * MS for e in entries if e >> 16 & 0x7F and e & 0xFFFF}

    def forget(self) -> None:
        self._heard_s.clear()
        self._silent.clear()

    def listens(self) -> dict[int, Handler]:
        return {pdo.HEARTBEAT + node: partial(self._heard, node) for node in self.watched()}

    def _heard(self, node: int, _frame: bytes, now_s: float) -> None:
        self._heard_s[node] = now_s
        if node in self._silent:
            self._silent.remove(node)
            if not self._silent:
                self._back(now_s)
        name = f"heartbeat of {node}"
        if not self._station.waiting(name):
            self._station.alarm(name, now_s + self.watched()[node], partial(self._look_for, node))

    def _look_for(self, node: int, now_s: float) -> None:
        silent_s = self.watched().get(node)
        if silent_s is None or node not in self._heard_s:
            return
        expires_s = self._heard_s[node] + silent_s
        if now_s < expires_s:
            self._station.alarm(f"heartbeat of {node}", expires_s, partial(self._look_for, node))
            return
        del self._heard_s[node]
        self._silent.add(node)
        self._lost(now_s)


class NodeGuard:
    """100Ch, 100Dh: answers remote requests with its state, and misses them."""

    def __init__(self, station: Station, lost: Lost, back: Lost) -> None:
        self._station = station
        self._lost = lost
        self._back = back
        self._toggle = 0
        self._asked_s = 0.0
        self._missed = False

    @property
    def life_s(self) -> float:
        values = self._station.dictionary.values
        return values.get(key(0x100C), 0) * values.get(key(0x100D), 0) * MS

    def forget(self) -> None:
        self._toggle = 0
        self._missed = False

    def listens(self) -> dict[int, Handler]:
        station = self._station
        if station.dictionary.values[key(0x1017)]:
            return {}
        return {pdo.REMOTE_FLAG | pdo.HEARTBEAT + station.node: self._on_remote_request}

    def _on_remote_request(self, _frame: bytes, now_s: float) -> None:
        station = self._station
        if station.nmt == INITIALISING:
            return
        station.send(now_s, pdo.HEARTBEAT + station.node, bytes([self._toggle | station.nmt]))
        self._toggle ^= TOGGLE
        self._asked_s = now_s
        if self._missed:
            self._missed = False
            self._back(now_s)
        if self.life_s > 0.0 and not station.waiting("guard"):
            station.alarm("guard", now_s + self.life_s, self._look)

    def _look(self, now_s: float) -> None:
        expires_s = self._asked_s + self.life_s
        if self.life_s <= 0.0 or self._missed:
            return
        if now_s < expires_s:
            self._station.alarm("guard", expires_s, self._look)
            return
        self._missed = True
        self._lost(now_s)
