"""A CiA 402 servo drive on the virtual bus: CiA 301 around an ``Axis``.

It owns no bus, thread or clock: the bus calls its handlers with a frame and the
time, and its ``timer`` when ``due_s`` is reached. The same object steps with the
stepped clock and runs behind the hub.

The way of SYNC is the hot one: with five drives at 2 ms and ten times real time it
may cost 12 us per drive. So nothing is scheduled or looked up there that can be
kept ready, and supervision of SYNC itself costs one comparison. Whatever is not the
controller's own mapping goes by ``ProcessData``.
"""

from __future__ import annotations

import math
from pathlib import Path
from struct import Struct

from drives import pdo
from drives.pdo import COMMAND, DATA_AT, PDO_BYTES
from drives.settings import INT32_MAX, INT32_MIN
from drives.simulated import identifiers, lss, pdo_map
from drives.simulated.axis import Axis
from drives.simulated.data_sheet import EDS, key
from drives.simulated.emergency import Emergencies
from drives.simulated.error_control import HeartbeatConsumer, HeartbeatProducer, NodeGuard
from drives.simulated.lss import Lss
from drives.simulated.machine402 import POWERED
from drives.simulated.parameters import LostSync, Parameters
from drives.simulated.pdo_map import Pdo
from drives.simulated.process_data import ProcessData
from drives.simulated.sdo_server import SdoServer
from drives.simulated.station import INITIALISING, OPERATIONAL, PRE_OPERATIONAL, STOPPED, Station
from drives.simulated.storage import Storage
from drives.simulated.sync import Sync
from drives.virtual_bus import Handler, Link

START, STOP, ENTER_PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82
STATES = {START: OPERATIONAL, STOP: STOPPED, ENTER_PRE_OPERATIONAL: PRE_OPERATIONAL}
ERROR_STATES = {0: PRE_OPERATIONAL, 2: STOPPED}  # 1029h; 0 counts in OPERATIONAL only

CONNECTION_LOST, SYNC_LOST = 0x8130, 0x8700
FEEDBACK = Struct("<IB3xHi2x")
LATEST_PERIODS = 2.5  # FAULT drives trip this long after the last SYNC
MOST_CATCH_UP = 500  # periods made up for after a long silence; by then every ramp has ended


class SimulatedDrive(Station):
    """One drive; attach it to a ``SteppedBus``. Node 255: it waits for LSS to give it one."""

    def __init__(self, node: int, parameters: Parameters = Parameters(), eds: Path = EDS) -> None:  # noqa: B008
        super().__init__(node, parameters, eds)
        self.lost_syncs = 0  # SYNCs that did not come
        self.early_syncs = 0  # SYNCs less than half a period after the last: not counted as a period
        self._sync_s = 0.0
        self._guessed = 0  # periods already made up for since the last SYNC
        self._received: bytes | None = None  # the newest standard RPDO, latched by SYNC
        self._fast_out = 0  # identifier of the standard TPDO, if it is as the controller maps it
        self._heard: dict[int, Handler] = {}
        self._wanted: tuple[object, ...] = ()  # what the handlers were made for
        self.emergencies = Emergencies(self)
        self.axis = Axis(self, self.emergencies, self._alive, self._faulted)
        self.process = ProcessData(self, self.emergencies)
        self._latched = self.process.latched  # one dict for ever: looked at with every SYNC
        self.sync = Sync(self, self.emergencies, self._on_sync)
        self.storage = Storage(self.dictionary, lambda: self.axis.power not in POWERED)
        self.lss = Lss(self, self._get_node)
        self._sdo = SdoServer(self.dictionary)
        self._producer = HeartbeatProducer(self)
        self._consumer = HeartbeatConsumer(self, self._connection_lost, self._connection_back)
        self._guard = NodeGuard(self, self._connection_lost, self._connection_back)
        identifiers.guard(self.dictionary)
        pdo_map.guard(self.dictionary)
        self.dictionary.readers[key(0x2000)] = lambda: self.lost_syncs
        self.dictionary.writers[key(0x2001)] = lambda code: self.inject(code, self.now_s)
        self._configure()

    # -- the bus

    def join(self, link: Link, now_s: float) -> None:
        self.link = link
        self.now_s = now_s
        if self.node != lss.UNCONFIGURED:
            self.alarm("boot", now_s + self.parameters.boot_s, self._boot)

    def listens(self) -> dict[int, Handler]:
        return self._heard

    def _handlers(self) -> dict[int, Handler]:
        heard: dict[int, Handler] = {pdo.NMT: self._on_nmt, lss.REQUEST: self.lss.on_frame}
        if self.node == lss.UNCONFIGURED:
            return heard
        heard |= {0x600 + self.node: self._on_sdo}
        heard |= self._consumer.listens() | self._guard.listens() | self.process.listens()
        for mapped in self._fast_in:
            heard[mapped.can_id] = self._on_standard_rpdo
        return heard | self.sync.listens()

    def timer(self, now_s: float) -> None:
        """An alarm may change what an event-driven TPDO shows."""
        super().timer(now_s)
        if self.process.events:
            self.process.look(now_s)

    # -- SYNC and process data

    def _on_sync(self, frame: bytes, now_s: float) -> None:
        """One period ends: latch the setpoint, move the motor, report where it is."""
        axis = self.axis
        gap_s = now_s - self._sync_s
        counts = True  # as a period
        if not self._soonest_s <= gap_s < self._latest_s:
            counts = self._irregular(gap_s, now_s)
        received = self._received
        if received is not None:
            self._received = None
            word, target = COMMAND.unpack_from(received, DATA_AT)
            if word != axis.controlword or axis.unsettled:
                axis.command(word, now_s)
            if axis.limit or not axis.low <= target <= axis.high:
                axis.aim(target)
            else:
                axis.target = target
                axis.guesses = 0
        elif axis.powered and not self._latched:
            axis.guess()
        if self._latched:
            self.process.take_latched(now_s)
        if counts:
            self._sync_s = now_s
            if axis.powered:
                axis.step(now_s)
        if self.nmt == OPERATIONAL:
            self._report(frame, now_s)

    def _report(self, frame: bytes, now_s: float) -> None:
        """The TPDOs of this SYNC: what was true at the SYNC, sent a little later."""
        at_s = now_s + self._tpdo_delay_s
        if self._fast_out and self.link is not None:
            axis = self.axis
            position = round(axis.servo.position)
            if not INT32_MIN <= position <= INT32_MAX:
                position = axis.actual()
            self.link.send(
                at_s, self._fast_out, FEEDBACK.pack(self._fast_out, PDO_BYTES, axis.statusword, position)
            )
        if self._slow_out:
            self.process.sync_s = now_s
            self.process.after_sync(frame[DATA_AT] if frame[4] else 0, at_s, now_s)

    def _irregular(self, gap_s: float, now_s: float) -> bool:
        """A SYNC too soon is no period (False); before one too late the missing periods are made up for."""
        if gap_s < self._soonest_s:
            self.early_syncs += 1
            return False
        if self.axis.powered:
            self._catch_up(round(gap_s / self.axis.period_s) - 1, now_s)
        self._guessed = 0
        return True

    def _catch_up(self, periods: int, now_s: float) -> None:
        """Live through periods without SYNC, ``periods`` since the last one."""
        axis = self.axis
        missing = periods - self._guessed
        if missing <= 0:
            return
        self._guessed = periods
        if axis.cyclic:
            self.lost_syncs += missing
        for _ in range(min(missing, MOST_CATCH_UP)):
            if axis.powered:
                axis.guess()
                axis.step(now_s)

    def _live(self, now_s: float) -> None:
        """Catch up with the clock between SYNCs: a SYNC is missing half a period after it was due."""
        if self.axis.powered:
            self._catch_up(self._missed(now_s), now_s)

    def _missed(self, now_s: float) -> int:
        return math.floor((now_s - self._sync_s) / self.axis.period_s - 0.5)

    def _alive(self, now_s: float) -> None:
        """The axis has become powered or moves by itself: from now on periods pass, SYNC or not."""
        if self._missed(now_s) - self._guessed > MOST_CATCH_UP or not self.waiting("period"):
            self._guessed = max(self._guessed, self._missed(now_s))
        if self.axis.needs_periods and not self.waiting("period"):
            self.alarm("period", now_s + self.axis.period_s, self._pass_period)

    def _pass_period(self, now_s: float) -> None:
        self._live(now_s)
        if self.axis.needs_periods:
            self.alarm("period", now_s + self.axis.period_s, self._pass_period)

    def _on_standard_rpdo(self, frame: bytes, now_s: float) -> None:
        if self.nmt != OPERATIONAL:
            return
        if frame[4] == PDO_BYTES or self.process.long_enough(frame[4], PDO_BYTES, now_s):
            self._received = frame

    # -- SDO

    def _on_sdo(self, frame: bytes, now_s: float) -> None:
        if self.nmt in (INITIALISING, STOPPED) or frame[4] != 8:
            return
        self._live(now_s)
        self.now_s = now_s
        was_writing = self._sdo.writing
        self._answer(self._sdo.answer(frame[DATA_AT:]), now_s)
        if not self._sdo.writing and (was_writing or frame[DATA_AT] >> 5 in (0, 1)):
            self._configure()  # a download may have changed anything
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

    def _configure(self) -> None:
        """Take over what the dictionary says now."""
        axis = self.axis
        rpdos = pdo_map.active(self.dictionary, pdo_map.RPDO_AT, pdo_map.RPDO_MAP_AT)
        tpdos = pdo_map.active(self.dictionary, pdo_map.TPDO_AT, pdo_map.TPDO_MAP_AT)
        axis.offsets_mapped = any(where in OFFSETS for r in rpdos for where, _, _ in r.fields)
        axis.configure()
        self.sync.configure()
        self._soonest_s = 0.5 * axis.period_s
        self._latest_s = 1.5 * axis.period_s
        self._tpdo_delay_s = self.parameters.tpdo_delay_s
        plain = self.sync.window_s == 0.0
        self._fast_in = [r for r in rpdos if plain and pdo_map.is_fast_in(r)][:1]
        fast = [t for t in tpdos if plain and pdo_map.is_fast_out(t)][:1]
        self._fast_out = fast[0].can_id if fast else 0
        self.process.window_s = self.sync.window_s
        slow_in = [r for r in rpdos if r not in self._fast_in]
        self.process.configure(slow_in, tpdos, fast[0] if fast else None)
        self._slow_out = len(tpdos) > len(fast) or not plain
        self._producer.configure()
        self._listen(rpdos, tpdos)

    def _listen(self, *pdos: list[Pdo]) -> None:
        """Tell the bus when other identifiers or handlers than before are wanted."""
        sync, guard = self.sync, self._guard.listens()
        wanted = (self.node, *map(tuple, pdos), sync.shape, self._consumer.watched(), guard.keys())
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
        """A drive that loses its process data while it moves acts on 6007h."""
        before, self.nmt = self.nmt, state
        self.now_s = now_s
        if before == state:
            return
        self._received = None
        self.process.stop()
        if state != PRE_OPERATIONAL and state != OPERATIONAL:
            self._sdo.forget()
            self.cancel("sdo")
        if before == OPERATIONAL:
            self._live(now_s)
            self.axis.lose_connection(now_s)
        if state == OPERATIONAL:
            self.process.start(now_s)

    def _restart(self, command: int, now_s: float) -> None:
        """Reset node or communication: stored values, or defaults, come back."""
        self._enter(INITIALISING, now_s)
        self.cancel_all()
        self.axis.switch_off()
        self.node = self.dictionary.node = self.lss.pending
        self.lss.configuring = False
        first, last = 0x1000, 0x1FFF if command == RESET_COMMUNICATION else 0xFFFF
        self.dictionary.reset(first, last)
        self.storage.restore(first, last)
        for part in (self._consumer, self._guard, self.emergencies):
            part.forget()
        self._configure()
        if self.node != lss.UNCONFIGURED:
            self.alarm("boot", now_s + self.parameters.boot_s, self._boot)

    def _get_node(self, now_s: float) -> None:
        """LSS has given a drive without one its node id."""
        self._restart(RESET_NODE, now_s)

    def _boot(self, now_s: float) -> None:
        self.now_s = now_s
        self.nmt = PRE_OPERATIONAL
        self._sync_s = now_s
        self._guessed = 0
        self.axis.boot()
        self._configure()
        self.send(now_s, pdo.HEARTBEAT + self.node, bytes([INITIALISING]))
        if self.parameters.lost_sync is LostSync.FAULT:
            self.alarm("sync", now_s, self._watch_sync)

    # -- faults

    def _connection_lost(self, now_s: float) -> None:
        """The master's heartbeat or guarding stays away: 6007h and 1029h:01."""
        self.now_s = now_s
        self._live(now_s)
        self.emergencies.report(CONNECTION_LOST, now_s)
        self.axis.lose_connection(now_s)
        self._behave(1, now_s)

    def _connection_back(self, now_s: float) -> None:
        self.emergencies.gone(CONNECTION_LOST, now_s)

    def _faulted(self, now_s: float) -> None:
        self._behave(2, now_s)

    def _behave(self, sub: int, now_s: float) -> None:
        """Error behaviour, 1029h: sub-index 1 communication, 2 drive."""
        option = self.dictionary.values[key(0x1029, sub)]
        if option in ERROR_STATES and (option != 0 or self.nmt == OPERATIONAL):
            self._enter(ERROR_STATES[option], now_s)

    def inject(self, code: int, now_s: float, lasting: bool = False) -> None:
        """Let the drive have an error (an emergency code); a lasting one refuses the fault reset."""
        if lasting:
            self.axis.causes.add(code)
        self._live(now_s)
        self.axis.fail(code, now_s)

    def take_local_control(self, taken: bool) -> None:
        """Somebody operates the drive at its panel: statusword bit 9, no writing from the bus."""
        self.dictionary.local_control = taken
        self.axis.refresh()

    def _watch_sync(self, now_s: float) -> None:
        """Only drives that fault on a lost SYNC need to look for it."""
        expires_s = self._sync_s + LATEST_PERIODS * self.axis.period_s
        if now_s < expires_s or not self.axis.powered:
            self.alarm("sync", max(expires_s, now_s + self.axis.period_s), self._watch_sync)
            return
        self._live(now_s)
        self.axis.fail(SYNC_LOST, now_s)
        self.alarm("sync", now_s + 1.0, self._watch_sync)


OFFSETS = (key(0x60B0), key(0x60B1))
