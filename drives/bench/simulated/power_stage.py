"""A simulated axis as its modes of operation and its ways to standstill know it: current, brake, demand."""

from __future__ import annotations

from abc import abstractmethod

from drives.bench.simulated.brake import Brake
from drives.bench.simulated.machine402 import Power
from drives.bench.simulated.motion import Demand
from drives.bench.simulated.records import Records
from drives.bench.simulated.sensors import Sensors
from drives.bench.simulated.setpoints import Setpoints
from drives.bench.simulated.station import Station
from drives.settings import INT32_MAX, INT32_MIN


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
