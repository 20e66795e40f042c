"""The hand that does to a stepped bus what a fault script says.

Frames are judged as they begin on the wire, so a fault befalls what is sent then,
whoever queued it and when. Faults of nodes are done between frames. Everything is
decided by the bus' clock, by counts and by a seed: the same run has the same faults.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from random import Random
from typing import Protocol, cast

from drives import pdo
from drives.pdo import DATA_AT
from drives.virtual.fault_script import MASTER, Action, Injection, ScriptError
from drives.virtual.virtual_bus import Fate, SteppedBus

ROUNDING_S = 1e-6  # a frame takes longer
BABBLE_EVERY_S = 135e-6  # a frame of eight bytes at 1 Mbit/s, where the bus has no bit timing of its own


class Resettable(Protocol):
    """A device that can lose its supply for a moment."""

    def power_cycle(self, now_s: float) -> None: ...


@dataclass(slots=True)
class _Active:
    """A fault of frames that has begun."""

    injection: Injection
    until_s: float
    left: float  # frames
    held: list[tuple[int, bytes]] = field(default_factory=list)  # REORDER: source and frame

    def wants(self, start_s: float, can_id: int) -> bool:
        lasts = self.left > 0 and start_s < self.until_s
        return can_id == self.injection.can_id and (lasts or bool(self.held))


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
        self._silent: set[int] = set()  # sources whose frames get lost before the wire
        self._untouchable: set[int] = set()  # sequences of frames that have had their share
        if bus.faults is not None:
            raise ScriptError("this bus has faults already: add to those")
        bus.faults = self

    def add(self, injection: Injection) -> None:
        """One fault more. Raises ScriptError for a node that is not on the bus."""
        if injection.node is not None and injection.node != MASTER:
            self._source(injection.node)
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
        if source in self._silent:
            return Fate.WITHHELD
        if start_s >= self._next_s:
            self._begin_timed(start_s)
        if can_id == pdo.SYNC and start_s > self._origin_s - ROUNDING_S:
            self.syncs += 1
            if self._by_sync:
                self._begin_counted(start_s)
        if not self._active:
            return frame
        if sequence in self._untouchable:
            self._untouchable.discard(sequence)
            return frame
        for active in self._active:
            if active.wants(start_s, can_id) and self._random.random() < active.injection.odds:
                return self._befall(active, start_s, can_id, source, frame)
        return frame

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
        self._active = [a for a in self._active if a.left > 0 or a.held]
        self._active.append(_Active(injection, until_s, left))

    def _befall(
        self, active: _Active, start_s: float, can_id: int, source: int, frame: bytes
    ) -> bytes | Fate:
        """Let the fault happen to this frame."""
        injection, bus = active.injection, self._bus
        action = injection.action
        if action is Action.REORDER:
            return self._swap(active, start_s, can_id, source, frame)
        active.left -= 1
        self._note(injection, start_s)
        if action is Action.DROP:
            return Fate.LOST
        if action is Action.CORRUPT:
            return Fate.SPOILT
        if action is Action.FALSIFY:
            return _falsified(frame, injection)
        again_s = start_s + injection.delay_s  # of a duplicate: as soon as the wire is free
        self._untouchable.add(bus.submit_again(source, again_s, can_id, frame))
        return Fate.WITHHELD if action is Action.DELAY else frame

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

    # -- nodes

    def _act(self, injection: Injection, now_s: float) -> None:
        """Do a fault of a node."""
        self._note(injection, now_s)
        if injection.action is Action.BABBLE:
            self._babble(injection, now_s)
        elif injection.action is Action.BUS_OFF:
            self._switch_off(injection, now_s)
        elif injection.action is Action.SILENCE:
            self._silence(injection, now_s)
        elif injection.action is Action.QUEUE_FULL:
            self._fill(injection, now_s)
        elif injection.node is not None:
            device = cast(Resettable, self._bus.device(self._source(injection.node)))
            device.power_cycle(now_s)

    def _switch_off(self, injection: Injection, now_s: float) -> None:
        bus = self._bus
        at_node = injection.node is not None and injection.node != MASTER
        controller = bus.errors.of(self._source(injection.node or 0)) if at_node else bus.masters
        bus.errors.switch_off(controller, now_s, restarts=False)
        if injection.duration_s:
            bus.agenda.add(now_s + injection.duration_s, lambda at_s: bus.errors.restart(controller, at_s))

    def _silence(self, injection: Injection, now_s: float) -> None:
        """Nothing of it reaches the wire, which it does not notice; it hears as before."""
        sources = self._sources(injection)
        self._silent.update(sources)
        if injection.duration_s:
            until_s = now_s + injection.duration_s
            self._bus.agenda.add(until_s, lambda _: self._silent.difference_update(sources))

    def _fill(self, injection: Injection, now_s: float) -> None:
        """Its transmit queue takes nothing more; what is in it goes out."""
        bus, sources = self._bus, self._sources(injection)

        def relieve(_now_s: float) -> None:
            for source in sources:
                bus.take_again(source)

        for source in sources:
            bus.take_no_more(source)
        bus.agenda.add(now_s + injection.duration_s, relieve)

    def _babble(self, injection: Injection, now_s: float) -> None:
        """A sender with always one more frame waiting, until its time is over."""
        bus, can_id = self._bus, injection.can_id or 0
        source = bus.connect(lambda _frame, _at_s: None)
        frame = bytes(pdo.frame(can_id, bytes(8)))
        until_s = now_s + injection.duration_s
        every_s = bus.frame_s(can_id, frame) or BABBLE_EVERY_S

        def go_on(at_s: float) -> None:
            if at_s >= until_s:
                bus.disconnect(source)
                bus.mute(source)
                return
            bus.submit(source, at_s, can_id, frame)
            bus.agenda.add(at_s + every_s, go_on)

        bus.submit(source, now_s, can_id, frame)
        go_on(now_s)

    def _sources(self, injection: Injection) -> list[int]:
        if injection.node == MASTER:
            return self._bus.errors.users(self._bus.masters)
        return [self._source(injection.node or 0)]

    def _source(self, node_id: int) -> int:
        try:
            return self._bus.source_of(node_id)
        except KeyError:
            raise ScriptError(f"node {node_id} is not on this bus") from None

    def _note(self, injection: Injection, at_s: float) -> None:
        self.log.append((at_s, injection.text()))


def _falsified(frame: bytes, injection: Injection) -> bytes:
    """A frame with some bits turned; the byte must be among those that are sent."""
    changed = bytearray(frame)
    if injection.byte < frame[4]:
        changed[DATA_AT + injection.byte] ^= injection.mask
    return bytes(changed)
