"""Process data of a simulated drive besides its fast way (CiA 301, 7.2.2): every transmission type.

TPDO   0         at SYNC, if something changed         252  on request, sampled at SYNC
       1 .. 240  at every so many SYNCs                253  on request
       254, 255  on change, when the inhibit time allows, and by the event timer
RPDO   0 .. 240  latched, used at the next SYNC        254, 255  used at once
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drives.bench.simulated import pdo_map
from drives.bench.simulated.dictionary import Dictionary
from drives.bench.simulated.emergency import Emergencies
from drives.bench.simulated.pdo_map import SYNCHRONOUS_REMOTE, Pdo
from drives.bench.simulated.station import OPERATIONAL, Station
from drives.bench.virtual.virtual_bus import Handler
from drives.pdo import REMOTE_FLAG

TOO_SHORT, TOO_LONG, LATE = 0x8210, 0x8220, 0x8250


class Outgoing:
    """A TPDO and what is remembered of it."""

    __slots__ = ("free_s", "pdo", "reads", "sampled", "sent", "shown", "syncs", "waits_for_start")

    def __init__(self, pdo: Pdo, dictionary: Dictionary) -> None:
        self.pdo = pdo
        self.reads = pdo.reads(dictionary)
        self.sent: bytes | None = None  # data of the newest frame
        self.shown: list[int] = []  # the values of which that is sure
        self.sampled: bytes | None = None  # at the newest SYNC, for type 252
        self.free_s = 0.0  # when the inhibit time has passed
        self.syncs = 0
        self.waits_for_start = pdo.start > 0

    def data(self) -> bytes:
        """The objects' present values."""
        return self.pdo.packed([read() for read in self.reads])


class ProcessData:
    """All PDOs but those the drive itself handles (``taken``)."""

    def __init__(self, station: Station, emergencies: Emergencies) -> None:
        self._station = station
        self._dictionary = station.dictionary
        self._emergencies = emergencies
        self.outgoing: list[Outgoing] = []
        self.events: list[Outgoing] = []  # those that go on change
        self._at_sync: list[Outgoing] = []
        self._incoming: list[Pdo] = []
        self._watched: list[Pdo] = []
        self.overdue: Callable[[float], None] = lambda _now_s: None  # an RPDO has missed its deadline
        self.taken: Callable[[Pdo, float], None] = lambda _pdo, _now_s: None  # an RPDO was used at once
        self.latched: dict[int, tuple[Pdo, bytes]] = {}
        self._came_s: dict[int, float] = {}  # RPDOs with a deadline, by identifier
        self.window_s = 0.0  # 1007h: synchronous data count only so long after SYNC; 0 = always
        self.sync_s = 0.0

    def configure(
        self, rpdos: list[Pdo], tpdos: list[Pdo], fast: Pdo | None, slow: list[Pdo] | None = None
    ) -> None:
        """Take over a configuration; what has not changed keeps its memory.

        The drive sends ``fast`` at SYNC itself; here it is for remote requests only. ``slow``:
        the RPDOs that are received here, if not all of them are.
        """
        before = {out.pdo: out for out in self.outgoing}
        self.outgoing = [before.get(pdo) or Outgoing(pdo, self._dictionary) for pdo in tpdos]
        self._at_sync = [out for out in self.outgoing if out.pdo != fast and out.pdo.looks_at_sync]
        self.events = [out for out in self.outgoing if out.pdo.event_driven]
        for gone in (pdo for pdo in self._watched if pdo not in rpdos):
            self._came_s.pop(gone.can_id, None)
            self._station.cancel(f"rpdo {gone.can_id:x}")
        self._watched = rpdos
        self._incoming = rpdos if slow is None else slow
        self.look(self._station.now_s)

    def listens(self) -> dict[int, Handler]:
        heard: dict[int, Handler] = {pdo.can_id: partial(self.receive, pdo) for pdo in self._incoming}
        for out in self.outgoing:
            if out.pdo.remote:
                heard[REMOTE_FLAG | out.pdo.can_id] = partial(self._on_remote_request, out)
        return heard

    def start(self, now_s: float) -> None:
        """NMT operational: what goes on change goes once."""
        for out in self.outgoing:
            out.sent = out.sampled = None
            out.shown = []
            out.syncs = 0
            out.waits_for_start = out.pdo.start > 0
        self.look(now_s)

    def stop(self) -> None:
        self.latched.clear()
        self._came_s.clear()
        for out in self.events:
            self._station.cancel(f"tpdo {out.pdo.can_id:x}")

    # -- outgoing

    def look(self, now_s: float) -> None:
        """Send what goes on change and has changed."""
        if self._station.nmt != OPERATIONAL:
            return
        for out in self.events:
            values = [read() for read in out.reads]
            if values == out.shown:
                continue
            data = out.pdo.packed(values)
            if data != out.sent:
                self._send_event(out, data, now_s)
            if data == out.sent:
                out.shown = values

    def _send_event(self, out: Outgoing, data: bytes, now_s: float) -> None:
        name = f"tpdo {out.pdo.can_id:x}"
        if now_s < out.free_s:
            self._station.alarm(name, out.free_s, self.look)
            return
        out.free_s = now_s + out.pdo.inhibit_s
        self._send(out, data, now_s)
        if out.pdo.event_s > 0.0:
            self._station.alarm(name, now_s + out.pdo.event_s, partial(self._timed, out))

    def _timed(self, out: Outgoing, now_s: float) -> None:
        """The event timer: send whether something changed or not."""
        if self._station.nmt == OPERATIONAL and out in self.events:
            self._send_event(out, out.data(), max(now_s, out.free_s))

    def after_sync(self, counter: int, at_s: float, now_s: float) -> None:
        """The TPDOs of a SYNC, sent at ``at_s`` unless the window has closed by then."""
        self.sync_s = now_s
        if self._at_sync:
            self._sample(counter, at_s, now_s)
        if self.events:
            self.look(now_s)

    def _sample(self, counter: int, at_s: float, now_s: float) -> None:
        open_window = not self.window_s or at_s - now_s <= self.window_s
        for out in self._at_sync:
            if self._due(out, counter) and open_window:
                self._send(out, out.data(), at_s)
            elif out.pdo.kind == SYNCHRONOUS_REMOTE:
                out.sampled = out.data()

    def _due(self, out: Outgoing, counter: int) -> bool:
        kind = out.pdo.kind
        if kind == 0:
            return out.data() != out.sent
        if kind > pdo_map.LAST_SYNCHRONOUS:
            return False
        if out.waits_for_start and counter:
            if counter != out.pdo.start:
                return False
            out.waits_for_start = False
            out.syncs = kind - 1
        out.syncs += 1
        return out.syncs % kind == 0

    def _on_remote_request(self, out: Outgoing, _frame: bytes, now_s: float) -> None:
        """A remote request."""
        if self._station.nmt != OPERATIONAL:
            return
        data = out.sampled if out.pdo.kind == SYNCHRONOUS_REMOTE else None
        if out.pdo.kind != SYNCHRONOUS_REMOTE or data is not None:
            self._send(out, data or out.data(), now_s)

    def _send(self, out: Outgoing, data: bytes, at_s: float) -> None:
        out.sent, out.shown = data, []
        self._station.send(at_s, out.pdo.can_id, data)

    # -- incoming

    def receive(self, pdo: Pdo, frame: bytes, now_s: float) -> None:
        """An RPDO: too short is not used, of too long the mapped part is."""
        if self._station.nmt != OPERATIONAL or not self._in_window(pdo, now_s):
            return
        if not self.long_enough(frame[4], pdo.length, now_s):
            return
        if pdo.event_s > 0.0:
            self.watch(pdo, now_s)
        if pdo.synchronous:
            self.latched[pdo.can_id] = (pdo, frame)
        else:
            self._station.now_s = now_s
            pdo.take(self._dictionary, frame)
            self.taken(pdo, now_s)
            self.look(now_s)

    def _in_window(self, pdo: Pdo, now_s: float) -> bool:
        return not (pdo.synchronous and self.window_s) or now_s - self.sync_s <= self.window_s

    def long_enough(self, found: int, wanted: int, now_s: float) -> bool:
        if found != wanted:
            self._emergencies.tell(TOO_SHORT if found < wanted else TOO_LONG, now_s)
        return found >= wanted

    def take_latched(self, now_s: float) -> None:
        """SYNC: the synchronous RPDOs take effect."""
        self._station.now_s = now_s
        for pdo, frame in self.latched.values():
            pdo.take(self._dictionary, frame)
        self.latched.clear()

    def watch(self, pdo: Pdo, now_s: float) -> None:
        """The deadline of an RPDO (its event timer) starts with the first one that comes."""
        came_s, can_id = self._came_s, pdo.can_id
        running = can_id in came_s
        came_s[can_id] = now_s
        if running and not self._emergencies.active:
            return
        self._emergencies.gone(LATE, now_s)
        name = f"rpdo {pdo.can_id:x}"
        if not self._station.waiting(name):
            self._station.alarm(name, now_s + pdo.event_s, partial(self._look_for, pdo))

    def _look_for(self, pdo: Pdo, now_s: float) -> None:
        came_s = self._came_s.get(pdo.can_id)
        if came_s is None or pdo not in self._watched:
            return
        if now_s < came_s + pdo.event_s:
            self._station.alarm(f"rpdo {pdo.can_id:x}", came_s + pdo.event_s, partial(self._look_for, pdo))
        else:
            del self._came_s[pdo.can_id]
            self._emergencies.report(LATE, now_s)
            self.overdue(now_s)
