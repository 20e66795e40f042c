"""The hand that does to a stepped bus what a fault script says.

Frames are judged as they begin on the wire, so a fault befalls what is sent then,
whoever queued it and when. Faults of nodes are done between frames. Everything is
decided by the bus' clock, by counts and by a seed: the same run has the same faults.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from random import Random

from drives import pdo
from drives.bench.virtual.fault_kinds import Action, Injection, ScriptError
from drives.bench.virtual.fault_nodes import Nodes
from drives.bench.virtual.virtual_bus import Fate, SteppedBus
from drives.pdo import DATA_AT
from drives.texts import message

ROUNDING_S = 1e-6  # a frame takes longer
REMEMBERING = (Action.REPEAT, Action.FOREIGN)


@dataclass(slots=True)
class _Active:
    """A fault of frames that has begun."""

    injection: Injection
    until_s: float
    left: float  # frames
    content: bytes = b""  # REPEAT: of the last frame before
    behind_s: float = -math.inf  # DELAY that lasts: when the last one delayed is due; none overtakes it
    held: list[tuple[int, bytes]] = field(default_factory=list)  # REORDER: source and frame

    def wants(self, start_s: float, can_id: int) -> bool:
        return can_id == self.injection.can_id and (self.goes_on(start_s) or self.owes(start_s))

    def goes_on(self, start_s: float) -> bool:
        return self.left > 0 and start_s < self.until_s

    def owes(self, start_s: float) -> bool:
        """It is over, but for frames that it still holds."""
        return bool(self.held) or start_s < self.behind_s


class Injector:
    """Attached to a bus; ``log`` tells what was done: (time in s of the bus' clock, the line)."""

    def __init__(self, bus: SteppedBus, origin_s: float = 0.0, seed: int = 0) -> None:
        self.log: list[tuple[float, str]] = []
        self.syncs = 0  # on the wire, since the origin
        self._bus = bus
        self._origin_s = origin_s
        self._random = Random(seed)
        self._by_time: list[Injection] = []  # faults of frames that wait for a time
        self._next_s = math.inf  # the first of them
        self._by_sync: list[Injection] = []
        self._active: list[_Active] = []
        self._seen: dict[int, bytes] = {}  # content of the newest frame, by identifiers that are of interest
        self.silent: set[int] = set()  # sources whose frames get lost before the wire
        self._untouchable: set[int] = set()  # sequences of frames that have had their share
        self._nodes = Nodes(bus, self.silent, self._seen)
        if bus.faults is not None:
            raise ScriptError(message("script.bus_has_faults"))
        bus.faults = self

    def add(self, injection: Injection) -> None:
        """One fault more. Raises ScriptError for a node that is not on the bus."""
        self._nodes.prepare(injection)
        if injection.can_id is not None and injection.action in REMEMBERING:
            self._seen.setdefault(injection.can_id, b"")
        if injection.when.sync:
            self._by_sync.append(injection)
        elif injection.action.of_frames:
            self._by_time.append(injection)
            self._next_s = min(self._next_s, self._time_of(injection))
        else:
            at_s = max(self._time_of(injection), self._bus.now_s)
            self._bus.agenda.add(at_s, lambda now_s: self._act(injection, now_s))

    @property
    def finished(self) -> bool:
        """Whether every fault of frames has happened, all of it."""
        return not (self._by_time or self._by_sync or any(a.left > 0 for a in self._active))

    def remove(self) -> None:
        """Take the faults off the bus; what has happened stays."""
        self._bus.faults = None

    def _time_of(self, injection: Injection) -> float:
        return self._origin_s + injection.when.at_s

    # -- frames

    def judge(self, start_s: float, can_id: int, sequence: int, source: int, frame: bytes) -> bytes | Fate:
        """See ``virtual_bus.Faults``."""
        if source in self.silent:
            return Fate.WITHHELD
        if start_s >= self._next_s:
            self._begin_timed(start_s)
        if can_id == pdo.SYNC and start_s > self._origin_s - ROUNDING_S:
            self.syncs += 1
            if self._by_sync:
                self._begin_counted(start_s)
        if can_id in self._seen:
            self._remember(start_s, can_id, frame)
        if not self._active:
            return frame
        if sequence in self._untouchable:
            self._untouchable.discard(sequence)
            return frame
        for active in self._active:
            if active.wants(start_s, can_id) and self._random.random() < active.injection.odds:
                return self._befall(active, start_s, can_id, source, frame)
        return frame

    def _remember(self, start_s: float, can_id: int, frame: bytes) -> None:
        """The content that a repeated frame will have: the newest from before."""
        repeats = (a for a in self._active if a.injection.action is Action.REPEAT)
        if not any(active.wants(start_s, can_id) for active in repeats):
            self._seen[can_id] = frame

    def _begin_timed(self, start_s: float) -> None:
        due = [i for i in self._by_time if self._time_of(i) <= start_s]
        self._by_time = [i for i in self._by_time if self._time_of(i) > start_s]
        self._next_s = min((self._time_of(i) for i in self._by_time), default=math.inf)
        for injection in due:
            self._begin(injection, max(self._time_of(injection), self._origin_s))

    def _begin_counted(self, start_s: float) -> None:
        due = [i for i in self._by_sync if i.when.sync <= self.syncs]
        self._by_sync = [i for i in self._by_sync if i.when.sync > self.syncs]
        for injection in due:
            if injection.action.of_frames:
                self._begin(injection, start_s)
            else:
                # Between frames: before this SYNC is heard.
                self._bus.agenda.add(start_s, lambda now_s, i=injection: self._act(i, now_s))  # type: ignore[misc]

    def _begin(self, injection: Injection, from_s: float) -> None:
        until_s = from_s + injection.duration_s if injection.duration_s else math.inf
        left = math.inf if injection.count is None else injection.count
        self._active = [a for a in self._active if a.goes_on(from_s) or a.owes(from_s)]
        content = self._seen.get(injection.can_id or 0, b"")
        self._active.append(_Active(injection, until_s, left, content))

    def _befall(
        self, active: _Active, start_s: float, can_id: int, source: int, frame: bytes
    ) -> bytes | Fate:
        """Let the fault happen to this frame."""
        injection, bus = active.injection, self._bus
        action = injection.action
        if action is Action.REORDER:
            return self._swap(active, start_s, can_id, source, frame)
        if action is Action.DELAY and injection.count is None:
            return self._queue(active, start_s, can_id, source, frame)
        active.left -= 1
        self._note(injection, start_s)
        if action is Action.REPEAT:
            active.content = active.content or frame
            return active.content
        if action is Action.DROP:
            return Fate.LOST
        if action is Action.CORRUPT:
            return Fate.SPOILT
        if action is Action.FALSIFY:
            return _falsified(frame, injection)
        again_s = start_s + injection.delay_s  # of a duplicate: as soon as the wire is free
        self._untouchable.add(bus.submit_again(source, again_s, can_id, frame))
        return Fate.WITHHELD if action is Action.DELAY else frame

    def _queue(self, active: _Active, start_s: float, can_id: int, source: int, frame: bytes) -> Fate:
        """A delay that lasts is a queue: they keep their order, also those that come when it is over."""
        if active.goes_on(start_s):
            self._note(active.injection, start_s)
            active.behind_s = start_s + active.injection.delay_s
        self._untouchable.add(self._bus.submit_again(source, active.behind_s, can_id, frame))
        return Fate.WITHHELD

    def _swap(self, active: _Active, start_s: float, can_id: int, source: int, frame: bytes) -> bytes | Fate:
        """Hold a frame back until the next of its identifier has begun; then it follows that."""
        if not active.held:
            active.held.append((source, frame))
            self._note(active.injection, start_s)
            return Fate.WITHHELD
        held_source, held = active.held.pop()
        active.left -= 1
        self._untouchable.add(self._bus.submit_again(held_source, start_s, can_id, held))
        return frame

    def _act(self, injection: Injection, now_s: float) -> None:
        """Do a fault of a node."""
        self._note(injection, now_s)
        self._nodes.befall(injection, now_s)

    def _note(self, injection: Injection, at_s: float) -> None:
        self.log.append((at_s, injection.text()))


def _falsified(frame: bytes, injection: Injection) -> bytes:
    """A frame with some bits turned; the byte must be among those that are sent."""
    changed = bytearray(frame)
    if injection.byte < frame[4]:
        changed[DATA_AT + injection.byte] ^= injection.mask
    return bytes(changed)
