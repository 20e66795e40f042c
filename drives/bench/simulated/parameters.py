"""What can be chosen about a simulated drive that its object dictionary does not hold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from drives.bench.simulated.plant import PlantParameters
from drives.bench.simulated.servo import DAMPING, NATURAL_FREQUENCY_HZ
from drives.bench.simulated.spindle_motor import MotorParameters

USUALLY_GUESSED = 2  # periods
STRONGEST_COUNTS_S2 = 2e9  # five times the quick stop of the simulated drive's data sheet
COAST_COUNTS_S2, BRAKE_COUNTS_S2 = 1e8, 4e8


class LostSync(Enum):
    """What a drive does when a SYNC, or the setpoint before it, does not come.

    Real drives differ: Kollmorgen and others go on along the line, isel's holds the last
    target, Delta's trips. A missing SYNC is noticed half a period after it was due. One
    miss never trips: FAULT and QUICK_STOP act (8700h) on the second SYNC in a row, 2.5 periods
    after the last, since a SYNC may itself come a quarter period late, and on the third setpoint
    in a row (``patient_periods`` are let pass). Whatever it does, the motor needs its way to stop.
    """

    HOLD = "hold"  # the last target, within the motor's torque
    EXTRAPOLATE = "extrapolate"  # for some periods, then hold
    FAULT = "fault"  # interpolation time-out: the fault reaction's ramp (605Eh), then fault
    QUICK_STOP = "quick_stop"  # interpolation time-out: a quick stop (605Ah)


@dataclass(frozen=True, slots=True)
class Parameters:
    """One simulated drive's nature. Positions are in power-on counting.

    Accelerations and speeds are in position units of the drive, positions in increments of its encoder.
    """

    frequency_hz: float = NATURAL_FREQUENCY_HZ
    damping: float = DAMPING
    feed_forward: float = 0.0  # share of the velocity; 1 = no lag at constant speed
    stiffness: float = 1.0  # factor on the position loop's gain (speed / following error)
    plant: PlantParameters | None = None  # friction, backlash, encoder; None = none of them
    motor: MotorParameters | None = None  # of a spindle that lags and slips; None = an ideal one
    most_acceleration: float = math.inf  # counts/s^2 that the motor can give in velocity modes
    strongest_counts_s2: float = STRONGEST_COUNTS_S2  # that the motor can give, in every mode
    fastest_counts_s: float = math.inf  # that the motor can turn, whatever 607Fh and 6080h say
    torque_counts_s2: float = 1000.0  # acceleration by a thousandth of the rated torque (60B2h)
    coast_counts_s2: float = COAST_COUNTS_S2  # deceleration by friction of a motor without current
    brake_counts_s2: float = BRAKE_COUNTS_S2  # deceleration by the brake of one that still turns
    lost_sync: LostSync = LostSync.HOLD
    extrapolated_periods: int | None = None  # before it does that; None: two if it extrapolates, else none
    patient_periods: int = 2  # without a setpoint before an interpolation time-out
    position_counts: int = 0  # at power-on
    counts_per_metre: float = 0.0  # of the axis, for a drive that speaks of metres; 0 = it was not told
    counts_per_radian: float = 0.0
    absolute_encoder: bool = False  # position and homing survive a loss of the supply
    switches: tuple[float, float] = (-1e8, 1e8)  # limit switches, pressed beyond these
    limit_fault: bool = False  # whether running onto a limit switch trips the drive (8612h)
    home_switch: tuple[float, float] = (0.0, 1e8)  # where it is pressed
    index_counts: float = 10_000.0  # from one index pulse of the encoder to the next
    index_offset: float = 0.0  # position of one of them
    estop_delay_s: float = 0.5  # emergency stop input: quick stop, and torque off so much later (SS1)
    brake: bool = True  # without one a motor without current coasts to its end
    enable_delay_s: float = 0.02  # brake release, SWITCHED ON -> OPERATION ENABLED
    brake_close_s: float = 0.0  # from the brake's command until it holds
    gravity: float = 0.0  # counts/s^2 at which the axis falls without current and brake
    mode_delay_s: float = 0.003  # 6060h -> 6061h
    boot_s: float = 0.02
    sdo_delay_s: float = 0.0004
    sdo_patience_s: float = 2.0  # silence in an SDO transfer after which it is aborted
    tpdo_delay_s: float = 0.0001  # after the end of SYNC

    @property
    def guessed_periods(self) -> int:
        """For how long a drive goes on along the line when no setpoint comes."""
        if self.extrapolated_periods is not None:
            return self.extrapolated_periods
        return USUALLY_GUESSED if self.lost_sync is LostSync.EXTRAPOLATE else 0

    @property
    def times_out(self) -> bool:
        """Whether the drive has an interpolation time-out."""
        return self.lost_sync in (LostSync.FAULT, LostSync.QUICK_STOP)
