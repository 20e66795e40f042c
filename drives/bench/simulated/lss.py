"""Layer setting services of a simulated drive (CiA 305): node id and bit rate before there is a node id.

    waiting --- switch global, selective or fastscan ---> configuration --- switch global ---> waiting

A node id set here is used from the next reset of communication on; a drive without
one (255) boots as soon as it has one and is told to leave the configuration state.
A bit rate is used when the master has it activated, or after power-on if it was stored.
A drive whose bit rate is not the bus's is deaf and silent here (a real one would
disturb it with error frames); on a bus without bit timing every rate will do.
"""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.station import OPERATIONAL, Station

REQUEST, ANSWER = 0x7E5, 0x7E4
UNCONFIGURED = 255
BIT_RATES = (1_000_000, 800_000, 500_000, 250_000, 125_000, 0, 50_000, 20_000, 10_000)  # table 0 by index
SWITCH_GLOBAL, NODE_ID, BIT_TIMING, ACTIVATE, STORE = 0x04, 0x11, 0x13, 0x15, 0x17
SELECT, SELECTED = 0x40, 0x44
IDENTIFY, IDENTIFIED, WITHOUT_ID, IS_WITHOUT_ID = 0x46, 0x4F, 0x4C, 0x50
FASTSCAN, SCAN_RESET = 0x51, 0x80
INQUIRE, INQUIRE_NODE = 0x5A, 0x5E
OK, REFUSED = 0, 1
WORD = Struct("<I")
SWITCH_DELAY = Struct("<H")  # ms


class Lss:
    """The slave's side. ``activate`` is called when a drive without a node id gets one."""

    def __init__(self, station: Station, activate: Callable[[float], None]) -> None:
        self._station = station
        self._activate = activate
        self.configuring = False
        self.pending = station.node  # used after the next reset
        self.stored = station.node  # used after power-on
        self.bit_rate = BIT_RATES[0]  # used after the next activation
        self.stored_rate = BIT_RATES[0]  # used after power-on
        self._selected: list[int] = []
        self._identified: list[int] = []
        self._scanned = 0  # which word of the identity fastscan is at
        self._commands: dict[int, Callable[[bytes, float], bytes | None]] = {
            SWITCH_GLOBAL: self._switch,
            NODE_ID: self._set_node,
            BIT_TIMING: self._set_rate,
            ACTIVATE: self._activate_rate,
            STORE: self._store,
            WITHOUT_ID: self._without_id,
            FASTSCAN: self._scan,
            INQUIRE_NODE: self._tell_node,
        }
        self._commands |= dict.fromkeys(range(SELECT, SELECT + 4), self._select)
        self._commands |= dict.fromkeys(range(IDENTIFY, IDENTIFY + 6), self._identify)
        self._commands |= dict.fromkeys(range(INQUIRE, INQUIRE + 4), self._tell_identity)

    def power_off(self) -> None:
        """What was not stored is forgotten."""
        self.pending, self.bit_rate = self.stored, self.stored_rate
        self.tune()

    def tune(self) -> None:
        """Use the bit rate that was set."""
        link = self._station.link
        if link is not None:
            self._station.in_tune = not link.bit_rate or link.bit_rate == self.bit_rate
            link.relisten()

    def on_frame(self, frame: bytes, now_s: float) -> None:
        """A request on 7E5h; LSS rests while the node is operational."""
        data = frame[8 : 8 + frame[4]].ljust(8, b"\0")
        command = self._commands.get(data[0])
        if command is None or self._station.nmt == OPERATIONAL:
            return
        answer = command(data, now_s)
        if answer is not None:
            at_s = now_s + self._station.parameters.sdo_delay_s
            self._station.send(at_s, ANSWER, answer.ljust(8, b"\0"))

    def _identity(self) -> list[int]:
        return [self._station.dictionary.values[key(0x1018, sub)] for sub in range(1, 5)]

    def _switch(self, data: bytes, now_s: float) -> None:
        was, self.configuring = self.configuring, data[1] == 1
        leaves = was and not self.configuring
        if leaves and self._station.node == UNCONFIGURED and self.pending != UNCONFIGURED:
            self._activate(now_s)

    def _select(self, data: bytes, _now_s: float) -> bytes | None:
        """Four frames with the four words of the identity; who matches all is configured next."""
        place = data[0] - SELECT
        self._selected = [*self._selected[:place], WORD.unpack_from(data, 1)[0]]
        if place < 3 or self._selected != self._identity():
            return None
        self.configuring = True
        return bytes([SELECTED])

    def _identify(self, data: bytes, _now_s: float) -> bytes | None:
        """Six frames: vendor, product, lowest and highest revision and serial number."""
        place = data[0] - IDENTIFY
        self._identified = [*self._identified[:place], WORD.unpack_from(data, 1)[0]]
        if len(self._identified) < 6:
            return None
        vendor, product, low, high, first, last = self._identified
        mine = self._identity()
        inside = low <= mine[2] <= high and first <= mine[3] <= last
        return bytes([IDENTIFIED]) if mine[:2] == [vendor, product] and inside else None

    def _without_id(self, _data: bytes, _now_s: float) -> bytes | None:
        return bytes([IS_WITHOUT_ID]) if self._station.node == UNCONFIGURED else None

    def _set_node(self, data: bytes, _now_s: float) -> bytes | None:
        if not self.configuring:
            return None
        if not (1 <= data[1] <= 127 or data[1] == UNCONFIGURED):
            return bytes([NODE_ID, REFUSED])
        self.pending = data[1]
        return bytes([NODE_ID, OK])

    def _set_rate(self, data: bytes, _now_s: float) -> bytes | None:
        if not self.configuring:
            return None
        if data[1] != 0 or data[2] >= len(BIT_RATES) or not BIT_RATES[data[2]]:
            return bytes([BIT_TIMING, REFUSED])
        self.bit_rate = BIT_RATES[data[2]]
        return bytes([BIT_TIMING, OK])

    def _activate_rate(self, data: bytes, now_s: float) -> None:
        """All devices fall silent for the delay, change, and wait for it once more (not answered)."""
        if self.configuring:
            delay_s = SWITCH_DELAY.unpack_from(data, 1)[0] * 1e-3
            self._station.in_tune = False
            self._station.alarm("bit rate", now_s + 2.0 * delay_s, lambda _now_s: self.tune())

    def _store(self, _data: bytes, _now_s: float) -> bytes | None:
        if not self.configuring:
            return None
        self.stored, self.stored_rate = self.pending, self.bit_rate
        return bytes([STORE, OK])

    def _tell_node(self, _data: bytes, _now_s: float) -> bytes | None:
        return bytes([INQUIRE_NODE, self._station.node]) if self.configuring else None

    def _tell_identity(self, data: bytes, _now_s: float) -> bytes | None:
        word = self._identity()[data[0] - INQUIRE]
        return bytes([data[0]]) + WORD.pack(word) if self.configuring else None

    def _scan(self, data: bytes, _now_s: float) -> bytes | None:
        """Fastscan: the master guesses the identity bit by bit; who agrees so far answers."""
        if self._station.node != UNCONFIGURED or self.configuring:
            return None
        (number,), bit, word, following = WORD.unpack_from(data, 1), data[5], data[6], data[7]
        if bit == SCAN_RESET:
            self._scanned = 0
            return bytes([IDENTIFIED])
        if word != self._scanned or bit > 31 or number >> bit != self._identity()[word] >> bit:
            return None
        if bit == 0:
            self._scanned = following
            self.configuring = word == 3
        return bytes([IDENTIFIED])
