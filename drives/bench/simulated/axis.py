"""The application side of a simulated drive: CiA 402 states, modes, demand and faults.

It knows no frames. The drive around it (drive.py) hands in controlwords and targets,
calls ``step`` once per interpolation period, and lends it its station: dictionary,
alarms, emergencies.

The drive's own clock is locked to SYNC: each SYNC ends one interpolation period
whatever its jitter, so motion depends on the setpoints only. Where the axis moves by
itself (profiles, homing, stops) it says so (``alive``) and periods pass without SYNC too.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from drives.bench.simulated import homing
from drives.bench.simulated.dictionary import Abort, Code
from drives.bench.simulated.emergency import Emergencies
from drives.bench.simulated.machine402 import POWERED, Command, Power, command, following
from drives.bench.simulated.modes import BIT_12, HALT, HALTABLE, HOMING, MODES, REACHED, CyclicPosition, Mode
from drives.bench.simulated.parameters import LostSync
from drives.bench.simulated.power_stage import PowerStage
from drives.bench.simulated.servo import Servo
from drives.bench.simulated.setpoints import LIMIT, NO_LIMIT, NO_TARGET_YET
from drives.bench.simulated.station import Station
from drives.bench.simulated.stops import Stops

REMOTE, VOLTAGE = 1 << 9, 1 << 4
DEVIATES = 1 << 13
MODE_BITS = 0x0270  # controlword bits 4 .. 6 and 9
FOLLOWING_FAULT, LIMIT_SWITCH_FAULT, SYNC_LOST, EXTERNAL_FAULT = 0x8611, 0x8612, 0x8700, 0x9000

Moment = Callable[[float], None]  # called with the time


class Axis(PowerStage):
    """One motor with its power stage. ``alive``: periods must pass; ``faulted``: it has tripped."""

    def __init__(self, station: Station, emergencies: Emergencies, alive: Moment, faulted: Moment) -> None:
        super().__init__(station)
        self._emergencies = emergencies
        self._alive = alive
        self._faulted = faulted
        self.stops = Stops(self)
        self.sensors.probes.told = self.units.reported_position
        self.sensors.interlock = lambda: self.sto
        self.mode = 0
        self._law: Mode = Mode(self)
        self.unsettled = True  # the state has changed since the controlword was looked at
        self.statusword = 0
        self.causes: set[int] = set()  # injected errors that are still there: no fault reset
        self._errors: set[int] = set()  # what the present fault is made of
        self.sto = False  # safe torque off
        self.slipped = 0.0  # increments that the load is behind the motor, as an encoder there tells it
        self.homing_methods = homing.KNOWN  # what 6098h takes
        self._deviates = self._halted = self._saturated = 0
        self._lagging_s: float | None = None
        self.configure()
        self.refresh()

    # -- the dictionary

    def configure(self) -> None:
        """Take over what may have been written."""
        get = self.dictionary.get
        self.units.configure()
        self.low, self.high = self.units.limits()
        self._window = math.inf if get(0x6065) == NO_LIMIT else float(self.units.distance_at(0x6065))
        period_s = (get(0x60C2, 1) or 1) * 10.0 ** get(0x60C2, 2)
        if period_s != self.period_s:
            self.period_s = period_s
            nature = self.parameters
            frequency_hz = nature.frequency_hz * nature.stiffness
            self.servo.tune(period_s, frequency_hz, nature.damping, nature.feed_forward)
        self.brake.scale = scale = self.units.scale
        self.servo.limit(self.parameters.strongest_counts_s2 * scale, self.speed_limit())
        law = self._law
        if isinstance(law, CyclicPosition) and self.follows and law.limits != (self.generator is not None):
            self.generator = law.begin()
        self.sensors.period_s = period_s
        self.sensors.watch()

    # -- every period

    def time_out(self, now_s: float) -> None:
        """Interpolation time-out: a drive that follows setpoints stops by itself."""
        if not (self.cyclic and self.follows):
            return
        self.servo.take_up()
        self.guesses = NO_TARGET_YET
        if self.parameters.lost_sync is LostSync.FAULT:
            self.fail(SYNC_LOST, now_s)
        else:
            self._emergencies.tell(SYNC_LOST, now_s)
            self.quick_stop_input(now_s)

    def step(self, now_s: float) -> None:
        """One interpolation period ends, the next one begins."""
        servo = self.servo
        if self.generator is None:
            servo.step(self.target)
        else:
            self.station.now_s = now_s
            servo.step(self.generator())
        saturated = LIMIT if servo.limited else 0
        if saturated != self._saturated:
            self._saturated = saturated
            self.refresh()
        lag = servo.start - servo.position
        if lag > self._window or lag < -self._window:
            self._lag_too_far(now_s)
        elif self._lagging_s is not None:
            self._lagging_s = None
        if self.sensors.watches:
            for look in self.sensors.watches:
                look(now_s)

    @property
    def remembers_nothing(self) -> bool:
        """Its next period depends on what it shows: no demand goes on by itself; sensors see motion only."""
        demand = self.generator is None or (self.follows and isinstance(self._law, CyclicPosition))
        return type(self.servo) is Servo and demand and self._lagging_s is None

    @property
    def needs_periods(self) -> bool:
        """It moves by itself: periods must pass, SYNC or not."""
        return self.powered and self.generator is not None and not (self.follows and self._law.cyclic)

    @property
    def follows(self) -> bool:
        """The demand is the mode's, and no stop's."""
        return self.power is Power.ENABLED and self.stops.leaving is None and not self._halted

    @property
    def cyclic(self) -> bool:
        return self._law.cyclic

    def moves_by_itself(self) -> None:
        self._alive(self.station.now_s)

    def _lag_too_far(self, now_s: float) -> None:
        """6065h is exceeded; after 6066h milliseconds that is a fault."""
        if self._lagging_s is None:
            self._lagging_s = now_s
        if now_s - self._lagging_s >= self.dictionary.get(0x6066) * 1e-3 and self.power is Power.ENABLED:
            self._deviates = DEVIATES
            self.fail(FOLLOWING_FAULT, now_s)

    def overrun(self, now_s: float) -> None:
        """Further onto a pressed limit switch is a fault, or a quick stop; homing may."""
        if self.mode == HOMING or self.power is not Power.ENABLED:
            return
        if self.parameters.limit_fault:
            self.fail(LIMIT_SWITCH_FAULT, now_s)
        else:
            self.quick_stop_input(now_s)
            self.say_limit(True)

    # -- states

    def boot(self) -> None:
        """Transition 1."""
        self.enter(Power.DISABLED)

    def command(self, word: int, now_s: float) -> None:
        """Act on a controlword."""
        self.station.now_s = now_s
        before, self.controlword = self.controlword, word
        self.unsettled = False
        if self.power is Power.ENABLED and word != before:
            self._command_mode(word, before)
        asked = command(word, before)
        if self.stops.leaving is not None and asked is Command.ENABLE:
            self.stops.stay()
            return
        state = following(self.power, asked) if asked is not None else None
        if state is not None and asked is not None:
            self._go(state, asked, now_s)

    def _command_mode(self, word: int, before: int) -> None:
        if (word ^ before) & HALT and self.mode in HALTABLE:
            if word & HALT:
                self.stops.halt()
                self._halted = HALT
            else:
                self._halted = 0
                self.resume()
        elif (word ^ before) & MODE_BITS and not self._halted:
            self._law.word(word, before)
            if self.needs_periods:
                self._alive(self.station.now_s)

    def _go(self, state: Power, asked: Command, now_s: float) -> None:
        """A transition that the standard draws."""
        if state is Power.ENABLED:
            self._ask_enable(now_s)
        elif asked is Command.RESET:
            self._reset(now_s)
        elif state is Power.QUICK_STOP:
            self.stops.quick_stop()
        elif self.power is Power.ENABLED and asked is not Command.DISABLE_VOLTAGE:
            self.stops.leave(state, now_s)
        elif state is not Power.READY or not self.sto:
            self.enter(state)
            if asked is Command.ENABLE:  # from READY: 3, and 4 in one go
                self._ask_enable(now_s)

    def _ask_enable(self, now_s: float) -> None:
        """The brake takes its time; from a quick stop only 605Ah = 5 .. 8 lets the drive go on."""
        if self.power is Power.QUICK_STOP:
            if self.dictionary.get(0x605A) >= 5:
                self.enter(Power.ENABLED)
        elif not self.station.waiting("enable"):
            self.brake.release(now_s, self._enable)

    def _enable(self, now_s: float) -> None:
        self.station.now_s = now_s
        asked = command(self.controlword, self.controlword)
        if self.power is Power.SWITCHED_ON and asked is Command.ENABLE:
            self.enter(Power.ENABLED)
        else:
            self.brake.close(now_s)

    def _reset(self, now_s: float) -> None:
        if self.causes:
            return
        self._deviates = 0
        self.enter(Power.DISABLED)
        self._emergencies.reset(self._errors, now_s)
        self._errors.clear()

    def enter(self, state: Power) -> None:
        """A state, with all that begins and ends with it."""
        was_powered = self.powered
        self.power = state
        self.unsettled = True
        self.powered = state in POWERED
        self.stops.leaving = None
        self._halted = 0
        if self.powered and not was_powered:
            self.brake.current_comes()
            self._alive(self.station.now_s)
        speed = self.servo.velocity
        if (was_powered and not self.powered) or state is Power.ENABLED:
            self.stand()
            self.servo.velocity = speed  # a motor that turns is caught, not nailed down
        if was_powered and not self.powered:
            self.brake.current_gone(self.station.now_s, speed)
        self.refresh()

    def stand(self) -> None:
        """The demand is where the motor is; in CSP the next target leads on from there."""
        self.servo.rest()
        self.target = self.actual()
        self.guesses = NO_TARGET_YET
        self._lagging_s = None
        self.clamped = self._saturated = 0
        self.generator = None
        if self.power is Power.ENABLED:
            self.resume()

    def resume(self) -> None:
        """The demand is the mode's again."""
        self.generator = self._law.begin()
        self.refresh()
        if self.needs_periods:
            self._alive(self.station.now_s)

    def halted(self) -> None:
        """The ramp of a halt has ended."""
        self.generator = self.hold
        self._halted |= REACHED
        self.refresh()

    def refresh(self) -> None:
        """The statusword, which changes with events only."""
        word = self.power.value | self.limit | self.clamped | self._deviates
        word |= 0 if self.sto else VOLTAGE
        word |= 0 if self.dictionary.local_control else REMOTE
        if self.power is Power.ENABLED and self.stops.leaving is None:
            word |= self._saturated | (self._halted & REACHED if self._halted else self._mode_bits())
        elif self.power is Power.QUICK_STOP and self.generator == self.hold:
            word |= REACHED
        self.statusword = word

    def _mode_bits(self) -> int:
        """Statusword bits of the mode; a cyclic target that a limit cuts short is not followed."""
        cut_short = self._law.cyclic and (self.limit or self.clamped)
        return self._law.bits & ~BIT_12 if cut_short else self._law.bits

    def switch_off(self) -> None:
        """As after power-on; the motor stays where it is."""
        self.causes.clear()
        self._errors.clear()
        self._deviates = self.limit = 0
        self.station.cancel("enable")
        self.mode, self._law, self.controlword = 0, Mode(self), 0
        self.sensors.probes.forget()
        self.enter(Power.NOT_READY)

    def power_off(self, now_s: float) -> None:
        """The supply is gone: no current."""
        self.station.now_s = now_s
        self.enter(Power.NOT_READY)
        self.brake.power_on(now_s)

    def power_on(self, now_s: float) -> None:
        """Only an absolute encoder knows where the axis is now."""
        self.brake.power_on(now_s)
        if not self.parameters.absolute_encoder:
            self.recount(-self.servo.position)

    # -- faults and what comes from outside

    def fail(self, code: int, now_s: float) -> None:
        """An error: emergency message and the fault reaction."""
        self.station.now_s = now_s
        self._errors.add(code)
        self._emergencies.report(code, now_s)
        self.stops.trip()
        self._faulted(now_s)

    def lose_connection(self, now_s: float) -> None:
        """Abort connection option, 6007h."""
        self.station.now_s = now_s
        self.stops.connection_lost()

    def set_sto(self, active: bool, now_s: float) -> None:
        """Safe torque off: the current is gone at once, and none can be had."""
        self.station.now_s = now_s
        self.sto = active
        if not active:
            self._emergencies.gone(EXTERNAL_FAULT, now_s)
        else:
            self._emergencies.report(EXTERNAL_FAULT, now_s)
            if self.power not in (Power.NOT_READY, Power.FAULT, Power.FAULT_REACTION):
                self.enter(Power.DISABLED)
            elif self.power is Power.FAULT_REACTION:
                self.enter(Power.FAULT)
        self.refresh()

    def quick_stop_input(self, now_s: float) -> None:
        """A quick stop ordered by a digital input."""
        self.station.now_s = now_s
        if self.power is Power.ENABLED:
            self.stops.quick_stop()

    # -- modes and counting

    def ask_mode(self, mode: int) -> None:
        if mode not in MODES:
            raise Abort(Code.VALUE)
        at_s = self.station.now_s + self.parameters.mode_delay_s
        self.station.alarm("mode", at_s, lambda now_s: self._set_mode(mode, now_s))

    def _set_mode(self, mode: int, now_s: float) -> None:
        self.station.now_s = now_s
        if mode == self.mode:
            return
        self.mode, self._law = mode, MODES[mode](self)
        self._halted = 0
        if self.power is Power.ENABLED:
            self._change_over()
        self.refresh()

    def _change_over(self) -> None:
        """The new mode takes the motor as it is: one that turns is not nailed down."""
        speed = self.servo.velocity
        self.stand()
        if abs(speed) * self.period_s >= 1.0:
            self.servo.velocity = speed
            self.servo.take_up()
            self.resume()

    def recount(self, counts: float) -> None:
        """Move the origin of the counting (homing)."""
        self.servo.shift(counts)
        self.sensors.moved += counts
        self.target = self.actual()
