"""What a fault script does to nodes: to controllers and hardware, and as a stranger on the bus."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol, cast

from drives import pdo
from drives.bench.virtual.fault_kinds import MASTER, Action, Injection, ScriptError
from drives.bench.virtual.virtual_bus import Node, SteppedBus
from drives.texts import message

BABBLE_EVERY_S = 135e-6  # a frame of eight bytes at 1 Mbit/s, where the bus has no bit timing of its own
FOREIGN_EVERY_S = 1e-3
SDO_REQUEST = 0x600
WRITE_ONE_BYTE = 0x2F  # expedited download (CiA 301, 7.2.4.3.3)
WRITE_WHOLE = 0x22  # likewise; as many bytes as the object has
MODES_OF_OPERATION = 0x6060
NMT_COMMANDS = {"start": 0x01, "stop": 0x02, "preop": 0x80, "reset": 0x81, "reset_communication": 0x82}


class Supplied(Protocol):
    """A device that can lose its supply."""

    def power_cycle(self, now_s: float) -> None: ...

    def power_off(self, now_s: float) -> None: ...

    def power_on(self, now_s: float) -> None: ...


class Twin(Supplied, Node, Protocol):
    """A device that can be put on the bus."""


class Motorised(Supplied, Protocol):
    """A drive whose hardware can fail."""

    def jam(self, jammed: bool, now_s: float) -> None:
        """The motor is stuck, or free again."""

    def weaken(self, share: float, now_s: float) -> None:
        """So much of the torque is there; 1 = all of it."""

    def torque_off(self, active: bool, now_s: float) -> None:
        """Safe torque off."""

    def press_switch(self, upper: bool, pressed: bool, now_s: float) -> None:
        """A limit switch, as if its cam were there."""

    def place_switch(self, counts: int | None, now_s: float) -> None:
        """A limit switch at this position, at the end that lies beyond it; None takes it away."""

    def twin(self) -> Twin:
        """Another device of the kind with the same node id."""


class Nodes:
    """Does it. ``silent``: sources that are not heard; ``seen``: newest frames by identifier."""

    def __init__(self, bus: SteppedBus, silent: set[int], seen: dict[int, bytes]) -> None:
        self._bus = bus
        self._silent = silent
        self._seen = seen
        self._stranger: int | None = None
        self._twins: dict[int, Twin] = {}  # second devices by node id, without supply until their time
        self._doings: dict[Action, Callable[[Injection, float], None]] = {
            Action.BABBLE: self._babble,
            Action.BUS_OFF: self._switch_off,
            Action.SILENCE: self._silence,
            Action.QUEUE_FULL: self._fill,
            Action.NODE_RESET: lambda fault, now_s: self._supplied(fault).power_cycle(now_s),
            Action.POWER: self._cut_supply,
            Action.JAM: self._jam,
            Action.WEAK: self._weaken,
            Action.STO: self._torque_off,
            Action.LIMIT: self._place_switch,
            Action.SWITCH: self._press_switch,
            Action.MODE: self._write_mode,
            Action.WRITE: self._write,
            Action.NMT: self._command,
            Action.FOREIGN: self._forge,
            Action.SECOND: lambda fault, now_s: self._twins[fault.node or 0].power_on(now_s),
        }

    def prepare(self, injection: Injection) -> None:
        """Raises ScriptError for a node that is not on the bus, or has no such part."""
        if injection.node is None or injection.node == MASTER:
            return
        device = self._bus.device(self._source(injection.node))
        if injection.action.of_drives and not hasattr(device, "jam"):
            raise ScriptError(message("script.no_drive", node=injection.node, action=injection.action.value))
        if injection.action is Action.SECOND and injection.node not in self._twins:
            twin = self._twins[injection.node] = cast(Motorised, device).twin()
            self._bus.attach(twin)
            twin.power_off(self._bus.now_s)

    def befall(self, injection: Injection, now_s: float) -> None:
        """Let it happen now."""
        self._doings[injection.action](injection, now_s)

    def _until(self, injection: Injection, now_s: float, what: Callable[[float], None]) -> None:
        """What ends it, if it has an end."""
        if injection.duration_s:
            self._bus.agenda.add(now_s + injection.duration_s, what)

    # -- hardware

    def _supplied(self, injection: Injection) -> Supplied:
        return cast(Supplied, self._bus.device(self._source(injection.node or 0)))

    def _drive(self, injection: Injection) -> Motorised:
        return cast(Motorised, self._supplied(injection))

    def _cut_supply(self, injection: Injection, now_s: float) -> None:
        device = self._supplied(injection)
        device.power_off(now_s)
        self._until(injection, now_s, device.power_on)

    def _jam(self, injection: Injection, now_s: float) -> None:
        drive = self._drive(injection)
        drive.jam(True, now_s)
        self._until(injection, now_s, partial(drive.jam, False))

    def _weaken(self, injection: Injection, now_s: float) -> None:
        drive = self._drive(injection)
        drive.weaken((injection.value or 100) / 100.0, now_s)
        self._until(injection, now_s, partial(drive.weaken, 1.0))

    def _torque_off(self, injection: Injection, now_s: float) -> None:
        drive = self._drive(injection)
        drive.torque_off(True, now_s)
        self._until(injection, now_s, partial(drive.torque_off, False))

    def _place_switch(self, injection: Injection, now_s: float) -> None:
        drive = self._drive(injection)
        drive.place_switch(injection.value, now_s)
        self._until(injection, now_s, partial(drive.place_switch, None))

    def _press_switch(self, injection: Injection, now_s: float) -> None:
        drive, upper = self._drive(injection), injection.word == "high"
        drive.press_switch(upper, True, now_s)
        self._until(injection, now_s, partial(drive.press_switch, upper, False))

    # -- a stranger's frames

    def _say(self, can_id: int, data: bytes, now_s: float) -> None:
        if self._stranger is None:
            self._stranger = self._bus.connect(lambda _frame, _at_s: None)
        self._bus.submit(self._stranger, now_s, can_id, bytes(pdo.frame(can_id, data)))

    def _write_mode(self, injection: Injection, now_s: float) -> None:
        mode = (injection.value or 0) & 0xFF
        head = bytes([WRITE_ONE_BYTE]) + MODES_OF_OPERATION.to_bytes(2, "little")
        self._say(SDO_REQUEST + (injection.node or 0), head + bytes([0, mode, 0, 0, 0]), now_s)

    def _write(self, injection: Injection, now_s: float) -> None:
        index, _, sub = injection.word.partition(":")
        head = bytes([WRITE_WHOLE]) + int(index, 16).to_bytes(2, "little") + bytes([int(sub, 16)])
        value = (injection.value or 0) & 0xFFFF_FFFF
        self._say(SDO_REQUEST + (injection.node or 0), head + value.to_bytes(4, "little"), now_s)

    def _command(self, injection: Injection, now_s: float) -> None:
        self._say(pdo.NMT, bytes([NMT_COMMANDS[injection.word], injection.node or 0]), now_s)

    def _forge(self, injection: Injection, now_s: float) -> None:
        """Frames with an identifier that is another's: so many of them, or as long as it lasts."""
        can_id = injection.can_id or 0
        until_s = now_s + injection.duration_s if injection.duration_s else float("inf")
        left = float("inf") if injection.count is None else injection.count

        def go_on(at_s: float) -> None:
            nonlocal left
            if at_s >= until_s or left <= 0:
                return
            left -= 1
            seen = self._seen.get(can_id, b"")
            self._say(can_id, injection.data or bytes(seen[4] if seen else 8), at_s)
            self._bus.agenda.add(at_s + FOREIGN_EVERY_S, go_on)

        go_on(now_s)

    # -- controllers

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
            raise ScriptError(message("script.not_on_this_bus", node_id=node_id)) from None
