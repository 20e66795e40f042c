"""A simulated axis as its modes of operation and its ways to standstill know it: current, brake, demand."""

from __future__ import annotations

from abc import abstractmethod
from collections import deque

from drives.bench.simulated.brake import Brake
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Abort, Code, Dictionary
from drives.bench.simulated.machine402 import Power
from drives.bench.simulated.motion import Demand
from drives.bench.simulated.sensors import Sensors
from drives.bench.simulated.setpoints import Setpoints
from drives.bench.simulated.station import Station
from drives.settings import INT32_MAX, INT32_MIN

RECORD_AT = key(0x60C1, 1)
SIZE_AT, WAITING_AT, CLEAR_AT = key(0x60C4, 2), key(0x60C4, 4), key(0x60C4, 6)


class Records:
    """The buffer of one drive.

    CiA 402-2: 60C1h into a buffer as 60C4h describes. 60C4h:02 is the size in use; 0 means that there is none
    and 60C1h itself is the set-point. Records come out first in, first out, one per period (60C4h:03 = 0).
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self._values = dictionary.values
        self._waiting: deque[int] = deque()
        self._open = True  # 60C4h:06: 1 lets records in
        dictionary.writers[RECORD_AT] = self._put
        dictionary.writers[SIZE_AT] = lambda _size: self.clear()
        dictionary.writers[CLEAR_AT] = self._let_in
        dictionary.readers[WAITING_AT] = lambda: len(self._waiting)

    @property
    def size(self) -> int:
        return self._values.get(SIZE_AT, 0)

    def clear(self) -> None:
        self._waiting.clear()

    def take(self) -> int | None:
        """The record of the next period; None when the controller has not kept up."""
        return self._waiting.popleft() if self._waiting else None

    def _put(self, record: int) -> None:
        """A full buffer takes no more (060A0023h)."""
        if not self.size:
            return
        if not self._open or len(self._waiting) >= self.size:
            raise Abort(Code.NO_RESOURCE)
        self._waiting.append(record)

    def _let_in(self, access: int) -> None:
        self._open = bool(access)
        if not access:
            self.clear()


class PowerStage(Setpoints):
    """One motor with its current and brake; ``generator`` is its demand where none comes with SYNC."""

    def __init__(self, station: Station) -> None:
        super().__init__(station)
        self.brake = Brake(station, self.servo)
        self.sensors = Sensors(station, self.servo, self.brake, self.overrun)
        self.records = Records(self.dictionary)
        self.controlword = 0
        self.power = Power.NOT_READY
        self.powered = False
        self.home_offset = 0x607C  # object with the position at the homed point; 0 = there is none
        self.offsets_mapped = False  # 60B0h, 60B1h or 60B2h comes by RPDO
        self.generator: Demand | None = None

    def actual(self) -> int:
        """Where the motor is, in whole increments."""
        return max(INT32_MIN, min(INT32_MAX, round(self.servo.position)))

    def hold(self) -> float:
        """The demand stands."""
        return self.servo.end

    @abstractmethod
    def enter(self, state: Power) -> None:
        """A state, with all that begins and ends with it."""

    @abstractmethod
    def resume(self) -> None:
        """The demand is the mode's again."""

    @abstractmethod
    def halted(self) -> None:
        """The ramp of a halt has ended."""

    @abstractmethod
    def moves_by_itself(self) -> None:
        """Periods must pass, SYNC or not."""

    @abstractmethod
    def recount(self, counts: float) -> None:
        """Move the origin of the counting (homing)."""

    @abstractmethod
    def overrun(self, now_s: float) -> None:
        """Further onto a pressed limit switch."""
