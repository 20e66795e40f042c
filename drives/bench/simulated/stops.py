"""How a simulated drive stops by itself (CiA 402-2): the option codes 605Ah - 605Eh and 6007h.

                                0        1     2       3         4        5 .. 8
    605Ah  quick stop           at once  slow  quick   current   voltage  as 1 .. 4, and stay
    605Bh  shutdown             at once  slow
    605Ch  disable operation    at once  slow
    605Dh  halt                          slow  quick   current   voltage
    605Eh  fault reaction       at once  slow  quick   current   voltage
    6007h  connection lost      nothing  fault disable voltage   quick stop

Slow is the profile's deceleration 6084h, quick 6085h, both within 60C6h; at the current or voltage limit
a drive stops as hard as it can, here twice as hard as quick.
"""

from __future__ import annotations

from collections.abc import Callable

from drives.bench.simulated import motion
from drives.bench.simulated.machine402 import Power
from drives.bench.simulated.power_stage import PowerStage

AT_ONCE, SLOW, QUICK = 0, 1, 2
STAYS = 5  # 605Ah from here on: remain in QUICK STOP ACTIVE
HARDEST = 2.0
STEEPEST = 0xFFFF_FFFF  # where a drive's default is 0, not set
NOTHING, FAULT, DISABLE, QUICK_STOP = 0, 1, 2, 3  # 6007h


class Stops:
    """Ways to standstill of one axis."""

    def __init__(self, axis: PowerStage) -> None:
        self._axis = axis
        self.leaving: Power | None = None  # where shutdown or disable operation leads

    def quick_stop(self) -> None:
        """Transition 11, then 12 by itself or not at all."""
        axis = self._axis
        option = axis.dictionary.get(0x605A)
        if option == AT_ONCE or not axis.powered:
            axis.enter(Power.DISABLED)
            return
        stays = option >= STAYS
        axis.enter(Power.QUICK_STOP)
        self._ramp(option - 4 if stays else option, lambda: self._stood(None if stays else Power.DISABLED))

    def trip(self) -> None:
        """Transitions 13 and 14."""
        axis = self._axis
        if axis.power in (Power.FAULT, Power.FAULT_REACTION):
            return
        option = axis.dictionary.get(0x605E)
        if option == AT_ONCE or not axis.powered:
            axis.enter(Power.FAULT)
            return
        axis.enter(Power.FAULT_REACTION)
        self._ramp(option, lambda: self._stood(Power.FAULT))

    def connection_lost(self) -> None:
        axis = self._axis
        option = axis.dictionary.get(0x6007)
        if option == FAULT:
            self.trip()
        elif option == DISABLE and axis.power not in (Power.FAULT, Power.FAULT_REACTION):
            axis.enter(Power.DISABLED)
        elif option == QUICK_STOP and axis.power is Power.ENABLED:
            self.quick_stop()

    def leave(self, state: Power, now_s: float) -> None:
        """Transitions 5 and 8: shutdown or disable operation, ramp and brake first."""
        axis = self._axis
        option = axis.dictionary.get(0x605B if state is Power.READY else 0x605C)
        self.leaving = state
        if option == AT_ONCE:
            self._set_brake(now_s)
        else:
            self._ramp(option, lambda: self._set_brake(axis.station.now_s))

    def stay(self) -> None:
        """Operation is enabled again before the ramp has ended."""
        self.leaving = None
        self._axis.brake.release(self._axis.station.now_s, lambda _now_s: None)
        self._axis.resume()

    def halt(self) -> None:
        """Controlword bit 8: stop, and stay enabled."""
        self._ramp(self._axis.dictionary.get(0x605D), self._axis.halted)

    def _set_brake(self, now_s: float) -> None:
        """The current goes when the brake holds."""
        self._axis.generator = self._axis.hold
        self._axis.brake.close(now_s, self._braked)

    def _braked(self, _now_s: float) -> None:
        if self.leaving is not None and self._axis.power is Power.ENABLED:
            self._axis.enter(self.leaving)

    def _stood(self, then: Power | None) -> None:
        axis = self._axis
        if then is not None:
            axis.enter(then)
        else:
            axis.generator = axis.hold
            axis.refresh()

    def _ramp(self, option: int, stopped: Callable[[], None]) -> None:
        axis = self._axis
        deceleration = axis.units.acceleration_at(0x6084 if option == SLOW else 0x6085) or STEEPEST
        if option > QUICK:
            deceleration = round(HARDEST * deceleration)
        else:
            deceleration = min(deceleration, axis.units.most_acceleration_at(0x60C6))
        if axis.guesses > 0:
            axis.servo.take_up()
        axis.generator = motion.ramp_down(axis.servo, deceleration, axis.period_s, stopped)
        axis.moves_by_itself()
