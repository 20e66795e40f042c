"""A CANopen device on the virtual bus: the CiA 301 core around whatever it does.

It owns no bus, thread or clock: the bus calls its handlers with a frame and the time,
and its ``timer`` when ``due_s`` is reached. The same object steps with the stepped
clock and runs behind the hub. What a kind of device adds (a servo axis, digital
inputs) overrides the few methods that do nothing here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drives import pdo
from drives.bench.simulated import identifiers, lss, pdo_map
from drives.bench.simulated.data_sheet import WRITABLE, key
from drives.bench.simulated.dictionary import Abort, Code, Dictionary
from drives.bench.simulated.emergency import Emergencies
from drives.bench.simulated.error_control import HeartbeatConsumer, HeartbeatProducer, NodeGuard
from drives.bench.simulated.lss import Lss
from drives.bench.simulated.parameters import Parameters
from drives.bench.simulated.pdo_map import Pdo
from drives.bench.simulated.process_data import ProcessData
from drives.bench.simulated.sdo_server import SdoServer
from drives.bench.simulated.station import INITIALISING, OPERATIONAL, PRE_OPERATIONAL, STOPPED, Station
from drives.bench.simulated.sync import Sync, TimeOfDay
from drives.bench.virtual.virtual_bus import Handler, Link
from drives.pdo import DATA_AT
from drives.text_file import Source

START, STOP, ENTER_PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82
STATES = {START: OPERATIONAL, STOP: STOPPED, ENTER_PRE_OPERATIONAL: PRE_OPERATIONAL}
ERROR_BEHAVIOUR_AT = 0x1029 << 8
ERROR_STATES = {0: PRE_OPERATIONAL, 2: STOPPED}  # 1029h; 0 counts in OPERATIONAL only
CONNECTION_LOST = 0x8130
COMMUNICATION, APPLICATION = 1, 2  # sub-indexes of 1029h
SERIAL = 0x1018 << 8 | 4  # the device keeps it, whatever node id it is given


SAVE, LOAD = int.from_bytes(b"save", "little"), int.from_bytes(b"load", "little")
STORE_AT, RESTORE_AT = 0x1010, 0x1011
GROUPS = {1: (0x1000, 0xFFFF), 2: (0x1000, 0x1FFF), 3: (0x6000, 0x9FFF), 4: (0x2000, 0x5FFF)}
# What a command or a moment says is not a parameter.
TRANSIENT = {0x1003, STORE_AT, RESTORE_AT, 0x6040, 0x6060, 0x607A, 0x60FF, 0x60C1, 0x60B8, 0x60FE}


class Storage:
    """Values that survive a reset. ``broken``: the memory chip fails (06060000h).

    1010h "save" and 1011h "load" (CiA 301, 7.5.2.13 - 14). Sub-index 1 holds all, 2 communication, 3
    application, 4 manufacturer defined parameters. Saved values come back with the next reset; after "load"
    the next reset brings defaults.
    """

    def __init__(self, dictionary: Dictionary, may_store: Callable[[], bool]) -> None:
        self._dictionary = dictionary
        self._may_store = may_store
        self._saved: dict[int, int] = {}
        self.broken = False
        for sub in GROUPS:
            dictionary.writers[key(STORE_AT, sub)] = partial(self._save, sub)
            dictionary.writers[key(RESTORE_AT, sub)] = partial(self._load, sub)
            for index in (STORE_AT, RESTORE_AT):
                dictionary.readers[key(index, sub)] = lambda: 1  # on command

    def restore(self, first: int, last: int) -> None:
        """Put the saved values of a range over the defaults."""
        for where, value in self._saved.items():
            if first <= where >> 8 <= last:
                self._dictionary.values[where] = value

    def _save(self, sub: int, signature: int) -> None:
        self._check(signature, SAVE)
        first, last = GROUPS[sub]
        for where, variable in self._dictionary.variables.items():
            kept = variable.access in WRITABLE and variable.size and where >> 8 not in TRANSIENT
            if kept and first <= where >> 8 <= last:
                self._saved[where] = self._dictionary.values[where]

    def _load(self, sub: int, signature: int) -> None:
        self._check(signature, LOAD)
        first, last = GROUPS[sub]
        self._saved = {k: v for k, v in self._saved.items() if not first <= k >> 8 <= last}

    def _check(self, signature: int, wanted: int) -> None:
        if signature != wanted:
            raise Abort(Code.NOT_STORED)
        if self.broken:
            raise Abort(Code.HARDWARE)
        if not self._may_store():
            raise Abort(Code.DEVICE_STATE)


class Device(Station):
    """One node; attach it to a ``SteppedBus``. Node 255: it waits for LSS to give it one."""

    def __init__(self, node: int, parameters: Parameters, eds: Source) -> None:
        """The subclass calls ``configure`` when its own parts are there."""
        super().__init__(node, parameters, eds)
        self.dictionary.factory[SERIAL] = self.dictionary.values.get(SERIAL, node)
        self._heard: dict[int, Handler] = {}
        self._wanted: tuple[object, ...] = ()  # what the handlers were made for
        self.emergencies = Emergencies(self)
        self.process = ProcessData(self, self.emergencies)
        self.process.overdue = self._overdue
        self.sync = Sync(self, self.emergencies, self._on_sync)
        self.storage = Storage(self.dictionary, self._may_store)
        self.lss = Lss(self, self._get_node)
        self.time_of_day = TimeOfDay(self)
        self._sdo = SdoServer(self.dictionary)
        self._producer = HeartbeatProducer(self)
        self._consumer = HeartbeatConsumer(self, self._connection_lost, self._connection_back)
        self._guard = NodeGuard(self, self._connection_lost, self._connection_back)
        identifiers.guard(self.dictionary)
        pdo_map.guard(self.dictionary)

    # -- what kinds of devices do differently

    def _live(self, now_s: float) -> None:
        """Catch up with the clock: something is about to look at or change the application."""

    def _on_sync(self, frame: bytes, now_s: float) -> None:
        """SYNC: synchronous outputs take effect, synchronous inputs are reported."""
        self.process.take_latched(now_s)
        if self.nmt == OPERATIONAL:
            counter = frame[DATA_AT] if frame[4] else 0
            self.process.after_sync(counter, now_s + self.parameters.tpdo_delay_s, now_s)

    def _may_store(self) -> bool:
        """Whether parameters may be written to non-volatile memory now."""
        return True

    def _lose_connection(self, now_s: float) -> None:
        """The process data have stopped, or the master is silent."""

    def _switch_off(self) -> None:
        """As after power-on (NMT reset)."""

    def _power_off(self, now_s: float) -> None:
        """The supply is gone: what no memory keeps is lost."""

    def _power_on(self, now_s: float) -> None:
        """The supply is back, and the device begins afresh."""

    def _booted(self, now_s: float) -> None:
        """The device is about to say boot-up."""

    def _started(self, now_s: float) -> None:
        """NMT operational has been entered."""

    def _take_over(self, rpdos: list[Pdo], tpdos: list[Pdo]) -> None:
        """The mapping and everything else that may have been written."""
        self.process.configure(rpdos, tpdos, None)

    def _own_handlers(self) -> dict[int, Handler]:
        """Identifiers besides those of CiA 301."""
        return {}

    # -- the bus

    @property
    def node_id(self) -> int:
        return self.node

    def join(self, link: Link, now_s: float) -> None:
        self.link = link
        self.now_s = now_s
        if self.node != lss.UNCONFIGURED:
            self.alarm("boot", now_s + self.parameters.boot_s, self._boot)

    def listens(self) -> dict[int, Handler]:
        return self._heard if self.in_tune and self.supplied else {}

    def _handlers(self) -> dict[int, Handler]:
        heard: dict[int, Handler] = {pdo.NMT: self._on_nmt, lss.REQUEST: self.lss.on_frame}
        if self.node == lss.UNCONFIGURED:
            return heard
        heard |= {0x600 + self.node: self._on_sdo}
        heard |= self._consumer.listens() | self._guard.listens() | self.process.listens()
        heard |= self.time_of_day.listens() | self._own_handlers()
        return heard | self.sync.listens()

    def timer(self, now_s: float) -> None:
        """An alarm may change what an event-driven TPDO shows."""
        super().timer(now_s)
        if self.process.events:
            self.process.look(now_s)

    # -- SDO

    def _on_sdo(self, frame: bytes, now_s: float) -> None:
        if self.nmt in (INITIALISING, STOPPED) or frame[4] != 8:
            return
        self._live(now_s)
        self.now_s = now_s
        was_writing = self._sdo.writing
        self._answer(self._sdo.answer(frame[DATA_AT:]), now_s)
        if not self._sdo.writing and (was_writing or frame[DATA_AT] >> 5 in (0, 1)):
            self.configure()  # a download may have changed anything
        if self._sdo.busy:
            self.alarm("sdo", now_s + self.parameters.sdo_patience_s, self._give_up)
        else:
            self.cancel("sdo")
        if self.process.events:
            self.process.look(now_s)

    def _give_up(self, now_s: float) -> None:
        self._answer([self._sdo.give_up()], now_s)

    def _answer(self, frames: list[bytes], now_s: float) -> None:
        for data in frames:
            self.send(now_s + self.parameters.sdo_delay_s, pdo.SDO_ANSWER + self.node, data)

    def configure(self) -> None:
        """Take over what the dictionary says now."""
        rpdos = pdo_map.active(self.dictionary, pdo_map.RPDO_AT, pdo_map.RPDO_MAP_AT)
        tpdos = pdo_map.active(self.dictionary, pdo_map.TPDO_AT, pdo_map.TPDO_MAP_AT)
        self.sync.configure()
        self.process.window_s = self.sync.window_s
        self._take_over(rpdos, tpdos)
        self._producer.configure()
        self._listen(rpdos, tpdos)

    def _listen(self, *pdos: list[Pdo]) -> None:
        """Tell the bus when other identifiers or handlers than before are wanted."""
        guard, time_of_day = self._guard.listens(), self.time_of_day.listens()
        shapes = (self.sync.shape, self._consumer.watched(), guard.keys(), time_of_day.keys())
        wanted = (self.node, *map(tuple, pdos), *shapes)
        if wanted != self._wanted:
            self._wanted = wanted
            self._heard = self._handlers()
            if self.link is not None:
                self.link.relisten()

    # -- NMT

    def _on_nmt(self, frame: bytes, now_s: float) -> None:
        command, node = frame[DATA_AT], frame[DATA_AT + 1]
        if node not in (0, self.node) or self.nmt == INITIALISING or frame[4] != 2:
            return
        if command in (RESET_NODE, RESET_COMMUNICATION):
            self._restart(command, now_s)
        elif command in STATES:
            self._enter(STATES[command], now_s)

    def _enter(self, state: int, now_s: float) -> None:
        """A device that loses its process data brings its outputs to where they are safe."""
        before, self.nmt = self.nmt, state
        self.now_s = now_s
        if before == state:
            return
        self.process.stop()
        if state != PRE_OPERATIONAL and state != OPERATIONAL:
            self._sdo.forget()
            self.cancel("sdo")
        if before == OPERATIONAL:
            self._live(now_s)
            self._lose_connection(now_s)
        if state == OPERATIONAL:
            self._started(now_s)
            self.process.start(now_s)

    def _restart(self, command: int, now_s: float) -> None:
        """Reset node or communication: stored values, or defaults, come back."""
        self._enter(INITIALISING, now_s)
        self._begin_afresh(self.lss.pending, 0x1FFF if command == RESET_COMMUNICATION else 0xFFFF, now_s)

    def power_cycle(self, now_s: float) -> None:
        """The supply fails and comes back: no goodbye, and only what was stored is still known."""
        self.power_off(now_s)
        self.power_on(now_s)

    def power_off(self, now_s: float) -> None:
        """The supply fails: deaf and silent from now on."""
        self.now_s = now_s
        self._live(now_s)
        self.process.stop()
        self._sdo.forget()
        self.nmt = INITIALISING
        self.cancel_all()
        self._power_off(now_s)
        self._switch_supply(False)

    def power_on(self, now_s: float) -> None:
        """The supply comes back."""
        if self.supplied:
            return
        self.now_s = now_s
        self._switch_supply(True)
        self.lss.power_off()
        self._begin_afresh(self.lss.stored, 0xFFFF, now_s)
        self._power_on(now_s)

    def _switch_supply(self, supplied: bool) -> None:
        self.supplied = supplied
        if self.link is not None:
            self.link.relisten()

    def _begin_afresh(self, node: int, last: int, now_s: float) -> None:
        """Initialise: ``last`` is the last index that gets its stored or default value back."""
        self.cancel_all()
        self._switch_off()
        self.node = self.dictionary.node = node
        self.lss.configuring = False
        self.dictionary.reset(0x1000, last)
        self.storage.restore(0x1000, last)
        for part in (self._consumer, self._guard, self.emergencies):
            part.forget()
        self.configure()
        if self.node != lss.UNCONFIGURED:
            self.alarm("boot", now_s + self.parameters.boot_s, self._boot)

    def _get_node(self, now_s: float) -> None:
        """LSS has given a device without one its node id."""
        self._restart(RESET_NODE, now_s)

    def _boot(self, now_s: float) -> None:
        self.now_s = now_s
        self.nmt = PRE_OPERATIONAL
        self._booted(now_s)
        self.configure()
        self.send(now_s, pdo.HEARTBEAT + self.node, bytes([INITIALISING]))

    # -- error control

    def _connection_lost(self, now_s: float) -> None:
        """The master's heartbeat or guarding stays away."""
        self.now_s = now_s
        self._live(now_s)
        self.emergencies.report(CONNECTION_LOST, now_s)
        self._lose_connection(now_s)
        self._behave(COMMUNICATION, now_s)

    def _overdue(self, now_s: float) -> None:
        """The deadline of an RPDO has passed (its event timer): the setpoints have stopped."""
        self.now_s = now_s
        self._live(now_s)
        self._lose_connection(now_s)

    def _connection_back(self, now_s: float) -> None:
        self.emergencies.gone(CONNECTION_LOST, now_s)

    def _behave(self, sub: int, now_s: float) -> None:
        """Error behaviour, 1029h."""
        option = self.dictionary.values.get(ERROR_BEHAVIOUR_AT | sub, 1)
        if option in ERROR_STATES and (option != 0 or self.nmt == OPERATIONAL):
            self._enter(ERROR_STATES[option], now_s)
