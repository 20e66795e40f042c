"""A CiA 402 servo drive on the virtual bus: CiA 301 around an ``Axis``.

It owns no bus, thread or clock: the bus calls its handlers with a frame and the
time, and its ``timer`` when ``due_s`` is reached. The same object steps with the
stepped clock and runs behind the hub.

The way of SYNC is the hot one: with five drives at 2 ms and ten times real time it
may cost 12 us per drive. So nothing is scheduled or looked up there that can be
kept ready, and supervision of SYNC itself costs one comparison.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from struct import Struct

from drives import pdo
from drives.pdo import COMMAND, DATA_AT, FRAME, PDO_BYTES
from drives.settings import INT32_MAX, INT32_MIN
from drives.simulated import pdo_map
from drives.simulated.axis import Axis
from drives.simulated.dictionary import EDS, Dictionary, key
from drives.simulated.parameters import LostSync, Parameters
from drives.simulated.sdo_server import SdoServer
from drives.virtual_bus import Handler, Link

INITIALISING, STOPPED = 0, pdo.NMT_STOPPED
OPERATIONAL, PRE_OPERATIONAL = pdo.NMT_OPERATIONAL, pdo.NMT_PRE_OPERATIONAL
START, STOP, ENTER_PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82

HEARTBEAT_LOST, PDO_TOO_SHORT, PDO_TOO_LONG, SYNC_LOST = 0x8130, 0x8210, 0x8220, 0x8700
COMMUNICATION_ERROR, GENERIC_ERROR = 0x10, 0x01  # bits of the error register, 1001h

FEEDBACK = Struct("<IB3xHi2x")
LATEST_PERIODS = 2.5  # FAULT drives trip this long after the last SYNC
MOST_CATCH_UP = 500  # periods made up for after a long silence; by then every ramp has ended

Alarm = Callable[[float], None]


class SimulatedDrive:
    """One drive; attach it to a ``SteppedBus``."""

    def __init__(self, node: int, parameters: Parameters = Parameters(), eds: Path = EDS) -> None:  # noqa: B008
        self.node = node
        self.parameters = parameters
        self.due_s = math.inf
        self.nmt = INITIALISING
        self.lost_syncs = 0  # SYNCs that did not come
        self.early_syncs = 0  # SYNCs less than half a period after the last: not counted as a period
        self._alarms: dict[str, tuple[float, Alarm]] = {}
        self._link: Link | None = None
        self._sync_s = 0.0
        self._guessed = 0  # periods already made up for since the last SYNC
        self._received: bytes | None = None  # the newest standard RPDO, latched by SYNC
        self._latched: dict[int, tuple[pdo_map.Pdo, bytes]] = {}  # other synchronous RPDOs
        self._syncs = 0
        self._heard_s: dict[int, float] = {}  # heartbeats of others by node
        self.dictionary = Dictionary(node, eds)
        self.dictionary.readers[key(0x2000)] = lambda: self.lost_syncs
        self.axis = Axis(self.dictionary, parameters, self._emergency, self._alarm)
        self._sdo = SdoServer(self.dictionary)
        pdo_map.guard(self.dictionary)
        self._configure()

    # -- the bus

    def join(self, link: Link, now_s: float) -> None:
        self._link = link
        self._alarm("boot", now_s + self.parameters.boot_s, self._boot)

    def listens(self) -> dict[int, Handler]:
        heard: dict[int, Handler] = {
            pdo.NMT: self._on_nmt,
            pdo.SYNC: self._on_sync,
            0x600 + self.node: self._on_sdo,
        }
        for watched in self._watched():
            heard[pdo.HEARTBEAT + watched] = partial(self._on_heartbeat, watched)
        for mapped in self._rpdos:
            fast = mapped.entries == pdo_map.FAST_IN and mapped.synchronous
            heard[mapped.can_id] = self._on_standard_rpdo if fast else partial(self._on_rpdo, mapped)
        return heard

    def timer(self, now_s: float) -> None:
        """Run the alarms that are due."""
        for name, alarm in list(self._alarms.items()):
            at_s, what = alarm
            # An alarm that ran before may have taken this one back or set it anew.
            if at_s <= now_s and self._alarms.get(name) is alarm:
                del self._alarms[name]
                what(now_s)
        self.due_s = min((at_s for at_s, _ in self._alarms.values()), default=math.inf)

    def _alarm(self, name: str, at_s: float, what: Alarm) -> None:
        self._alarms[name] = (at_s, what)
        if at_s < self.due_s:
            self.due_s = at_s
        if self._link is not None:
            self._link.wake(at_s)

    def _send(self, at_s: float, can_id: int, data: bytes) -> None:
        if self._link is not None:
            self._link.send(at_s, can_id, FRAME.pack(can_id, len(data), data))

    # -- SYNC and process data

    def _on_sync(self, _frame: bytes, now_s: float) -> None:
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
        elif self._latched:
            self._take_latched(now_s)
        elif axis.powered:
            axis.guess()
        if counts:
            self._sync_s = now_s
            if axis.powered:
                axis.step(now_s)
        if self.nmt == OPERATIONAL:
            self._report(now_s + self._tpdo_delay_s)

    def _report(self, at_s: float) -> None:
        """The TPDOs of this SYNC: what was true at the SYNC, sent a little later."""
        if self._fast_out and self._link is not None:
            axis = self.axis
            position = round(axis.servo.position)
            if not INT32_MIN <= position <= INT32_MAX:
                position = axis.actual()
            frame = FEEDBACK.pack(self._fast_out, PDO_BYTES, axis.statusword, position)
            self._link.send(at_s, self._fast_out, frame)
        if self._tpdos:
            self._syncs += 1
            for mapped in self._tpdos:
                if self._syncs % max(1, mapped.kind) == 0 and self._link is not None:
                    self._link.send(at_s, mapped.can_id, mapped.give(self.dictionary))

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
        self.lost_syncs += missing
        for _ in range(min(missing, MOST_CATCH_UP)):
            if axis.powered:
                axis.guess()
                axis.step(now_s)

    def _live(self, now_s: float) -> None:
        """Catch up with the clock between SYNCs: a SYNC is missing half a period after it was due."""
        if self.axis.powered:
            self._catch_up(math.floor((now_s - self._sync_s) / self.axis.period_s - 0.5), now_s)

    def _on_standard_rpdo(self, frame: bytes, now_s: float) -> None:
        if self.nmt != OPERATIONAL:
            return
        if frame[4] == PDO_BYTES:
            self._received = frame
        else:
            self._wrong_length(frame[4], PDO_BYTES, now_s)

    def _on_rpdo(self, mapped: pdo_map.Pdo, frame: bytes, now_s: float) -> None:
        if self.nmt != OPERATIONAL:
            return
        if frame[4] != mapped.length:
            self._wrong_length(frame[4], mapped.length, now_s)
        elif mapped.synchronous:
            self._latched[mapped.can_id] = (mapped, frame)
        else:
            self.axis.tell_time(now_s)
            mapped.take(self.dictionary, frame)

    def _take_latched(self, now_s: float) -> None:
        self.axis.tell_time(now_s)
        for mapped, frame in self._latched.values():
            mapped.take(self.dictionary, frame)
        self._latched.clear()

    def _wrong_length(self, found: int, wanted: int, now_s: float) -> None:
        self._emergency(PDO_TOO_SHORT if found < wanted else PDO_TOO_LONG, now_s)

    # -- services

    def _on_sdo(self, frame: bytes, now_s: float) -> None:
        if self.nmt in (INITIALISING, STOPPED) or frame[4] != 8:
            return
        self._live(now_s)
        self.axis.tell_time(now_s)
        answer = self._sdo.answer(frame[DATA_AT:])
        if answer is not None:
            self._send(now_s + self.parameters.sdo_delay_s, pdo.SDO_ANSWER + self.node, answer)
        if frame[DATA_AT] >> 5 in (0, 1):  # a download may have changed anything
            self._configure()

    def _configure(self) -> None:
        """Take over what the dictionary says now."""
        self.axis.configure()
        self._soonest_s = 0.5 * self.axis.period_s
        self._latest_s = 1.5 * self.axis.period_s
        self._tpdo_delay_s = self.parameters.tpdo_delay_s
        self._rpdos = pdo_map.active(self.dictionary, pdo_map.RPDO_AT, pdo_map.RPDO_MAP_AT)
        tpdos = pdo_map.active(self.dictionary, pdo_map.TPDO_AT, pdo_map.TPDO_MAP_AT)
        fast = [mapped for mapped in tpdos if mapped.entries == pdo_map.FAST_OUT and mapped.kind == 1]
        self._fast_out = fast[0].can_id if fast else 0
        self._tpdos = [mapped for mapped in tpdos if mapped not in fast[:1]]
        if self._link is not None:
            self._link.relisten()
        self._start_beat()

    def _on_nmt(self, frame: bytes, now_s: float) -> None:
        command, node = frame[DATA_AT], frame[DATA_AT + 1]
        if node not in (0, self.node) or self.nmt == INITIALISING:
            return
        if command in (RESET_NODE, RESET_COMMUNICATION):
            self._restart(command, now_s)
        elif command in (START, STOP, ENTER_PRE_OPERATIONAL):
            self._enter({START: OPERATIONAL, STOP: STOPPED}.get(command, PRE_OPERATIONAL), now_s)

    def _enter(self, state: int, now_s: float) -> None:
        """A drive that loses its process data while it moves acts on 6007h."""
        left = self.nmt == OPERATIONAL and state != OPERATIONAL
        self.nmt = state
        self._received = None
        self._latched.clear()
        if left:
            self._live(now_s)
            self.axis.lose_connection(now_s)
            self._follow_ramp(now_s)

    def _restart(self, command: int, now_s: float) -> None:
        self._enter(INITIALISING, now_s)
        self.axis.switch_off()
        self.dictionary.reset(0x1000, 0x1FFF if command == RESET_COMMUNICATION else 0xFFFF)
        self._heard_s.clear()
        self._alarms.clear()
        self._alarm("boot", now_s + self.parameters.boot_s, self._boot)

    def _boot(self, now_s: float) -> None:
        self._configure()
        self.nmt = PRE_OPERATIONAL
        self._sync_s = now_s
        self._send(now_s, pdo.HEARTBEAT + self.node, bytes([INITIALISING]))
        self._start_beat()
        if self.parameters.lost_sync is LostSync.FAULT:
            self._alarm("sync", now_s, self._watch_sync)

    # -- heartbeats

    def _start_beat(self) -> None:
        wanted = self.dictionary.values[key(0x1017)] > 0 and self.nmt != INITIALISING
        if not wanted:
            self._alarms.pop("beat", None)
        elif "beat" not in self._alarms:
            self._alarm("beat", self.axis.now_s, self._beat)  # at once

    def _beat(self, now_s: float) -> None:
        self._send(now_s, pdo.HEARTBEAT + self.node, bytes([self.nmt]))
        period_s = self.dictionary.values[key(0x1017)] * 1e-3
        if period_s > 0.0:
            self._alarm("beat", now_s + period_s, self._beat)

    def _watched(self) -> dict[int, float]:
        """Nodes whose heartbeat is watched, and how long they may be silent (1016h)."""
        entries = (self.dictionary.values[key(0x1016, sub)] for sub in (1, 2))
        return {e >> 16 & 0x7F: (e & 0xFFFF) * 1e-3 for e in entries if e >> 16 & 0x7F and e & 0xFFFF}

    def _on_heartbeat(self, node: int, _frame: bytes, now_s: float) -> None:
        """Watching starts with the first heartbeat; the alarm is set once and looks at the newest."""
        self._heard_s[node] = now_s
        name = f"heartbeat of {node}"
        if name not in self._alarms:
            self._alarm(name, now_s + self._watched()[node], partial(self._look_for, node))

    def _look_for(self, node: int, now_s: float) -> None:
        silent_s = self._watched().get(node)
        if silent_s is None or node not in self._heard_s:
            return
        expires_s = self._heard_s[node] + silent_s
        if now_s < expires_s:
            self._alarm(f"heartbeat of {node}", expires_s, partial(self._look_for, node))
            return
        del self._heard_s[node]
        self._live(now_s)
        self._emergency(HEARTBEAT_LOST, now_s)
        self.axis.lose_connection(now_s)
        self._follow_ramp(now_s)
        if self.dictionary.values[key(0x1029, 1)] == 0 and self.nmt == OPERATIONAL:
            self._enter(PRE_OPERATIONAL, now_s)
        elif self.dictionary.values[key(0x1029, 1)] == 2:
            self._enter(STOPPED, now_s)

    # -- faults

    def inject(self, code: int, now_s: float, lasting: bool = False) -> None:
        """Let the drive have an error (an emergency code); a lasting one refuses the fault reset."""
        if lasting:
            self.axis.causes.add(code)
        self._live(now_s)
        self.axis.fail(code, now_s)
        self._follow_ramp(now_s)

    def _watch_sync(self, now_s: float) -> None:
        """Only drives that fault on a lost SYNC need to look for it."""
        expires_s = self._sync_s + LATEST_PERIODS * self.axis.period_s
        if now_s < expires_s or not self.axis.powered:
            self._alarm("sync", max(expires_s, now_s + self.axis.period_s), self._watch_sync)
            return
        self._live(now_s)
        self.axis.fail(SYNC_LOST, now_s)
        self._follow_ramp(now_s)
        self._alarm("sync", now_s + 1.0, self._watch_sync)

    def _follow_ramp(self, now_s: float) -> None:
        """While the drive stops by itself it lives from period to period, SYNC or not."""
        self._live(now_s)
        if self.axis.powered and self.axis.moves_by_itself:
            self._alarm("ramp", now_s + self.axis.period_s, self._follow_ramp)

    def _emergency(self, code: int, now_s: float) -> None:
        """EMCY object, 603Fh, the error register and the history 1003h."""
        values = self.dictionary.values
        communication = 0x8100 <= code < 0x8300
        register = 0 if code == 0 else GENERIC_ERROR | (COMMUNICATION_ERROR if communication else 0)
        values[key(0x603F)], values[key(0x1001)] = code, register
        if code:
            for sub in range(8, 1, -1):
                values[key(0x1003, sub)] = values[key(0x1003, sub - 1)]
            values[key(0x1003, 1)] = code
            values[key(0x1003)] = min(8, values[key(0x1003)] + 1)
        if self.nmt in (PRE_OPERATIONAL, OPERATIONAL):
            data = code.to_bytes(2, "little") + bytes([register]) + bytes(5)
            self._send(now_s, pdo.EMCY + self.node, data)
