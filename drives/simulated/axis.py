"""The application side of a simulated drive: CiA 402 states, modes, demand and faults.

It knows no frames. The drive around it (drive.py) hands in controlwords and targets,
calls ``step`` once per interpolation period, and gives it two ways out: an emergency
message and an alarm at a later time.

The drive's own clock is locked to SYNC: each SYNC ends one interpolation period
whatever its jitter, so motion depends on the setpoints only.
"""

from __future__ import annotations

from collections.abc import Callable

from drives.settings import INT32_MAX, INT32_MIN
from drives.simulated import motion
from drives.simulated.dictionary import Abort, Code, Dictionary, key
from drives.simulated.machine402 import POWERED, Command, Power, command, following
from drives.simulated.parameters import LostSync, Parameters
from drives.simulated.servo import Servo

CSP, HOMING = 8, 6
MODES = (0, HOMING, CSP)

REMOTE, VOLTAGE = 1 << 9, 1 << 4
REACHED, LIMIT, FOLLOWS, DEVIATES = 1 << 10, 1 << 11, 1 << 12, 1 << 13
HOMING_RUNS, HOMING_IDLE, HOMING_DONE, HOMING_FAILED = 0, REACHED, REACHED | FOLLOWS, REACHED | DEVIATES
START_HOMING = 1 << 4

FOLLOWING_FAULT = 0x8611
MOST_GUESSES = 2

Emergency = Callable[[int, float], None]  # code, now_s; code 0 = error gone
Alarm = Callable[[str, float, Callable[[float], None]], None]  # name, at_s, what


class Axis:
    """One motor with its power stage."""

    def __init__(
        self, dictionary: Dictionary, parameters: Parameters, emergency: Emergency, alarm: Alarm
    ) -> None:
        self._dictionary = dictionary
        self._parameters = parameters
        self._emergency = emergency
        self._alarm = alarm
        self.servo = Servo(parameters.position_counts)
        self.power = Power.DISABLED
        self.mode = 0
        self.controlword = 0
        self.unsettled = True  # the state has changed since the controlword was looked at
        self.powered = False
        self.statusword = 0
        self.target = parameters.position_counts
        self.causes: set[int] = set()  # injected errors that are still there: no fault reset
        self.period_s = 0.0
        self._generator: Callable[[], float] | None = None
        self._homing = HOMING_IDLE
        self.limit = self._deviates = 0
        self._counted = 0.0  # present counting minus power-on counting
        self._lagging_s: float | None = None
        self.guesses = 0
        self._enabling = False
        self.now_s = 0.0
        self._publish()
        self.configure()
        self._refresh()

    # -- the dictionary

    def _publish(self) -> None:
        """Live objects, and objects whose writing does something."""
        readers: dict[int, Callable[[], int]] = {
            0x6040: lambda: self.controlword,
            0x6041: lambda: self.statusword,
            0x6061: lambda: self.mode,
            0x6062: lambda: round(self.servo.start),
            0x6064: self.actual,
            0x606C: lambda: round(self.servo.velocity),
            0x607A: lambda: self.target,
            0x60F4: lambda: round(self.servo.start - self.servo.position),
        }
        writers: dict[int, Callable[[int], None]] = {
            0x6040: lambda word: self.command(word, self.now_s),
            0x607A: self.aim,
            0x6060: self._ask_mode,
            0x6098: _known_method,
        }
        self._dictionary.readers.update({key(index): reader for index, reader in readers.items()})
        self._dictionary.writers.update({key(index): writer for index, writer in writers.items()})

    def configure(self) -> None:
        """Take over what may have been written."""
        get = self._dictionary.get
        self.low, self.high = get(0x607D, 1), get(0x607D, 2)
        window = get(0x6065)
        self._window = float("inf") if window == 0xFFFF_FFFF else float(window)
        period_s = get(0x60C2, 1) * 10.0 ** get(0x60C2, 2)
        if period_s != self.period_s:
            self.period_s = period_s
            nature = self._parameters
            frequency_hz = nature.frequency_hz * nature.stiffness
            self.servo.tune(period_s, frequency_hz, nature.damping, nature.feed_forward)

    def tell_time(self, now_s: float) -> None:
        """The time at which the dictionary is being written."""
        self.now_s = now_s

    def actual(self) -> int:
        """Position actual value, 6064h."""
        return max(INT32_MIN, min(INT32_MAX, round(self.servo.position)))

    # -- every period

    def aim(self, target: int) -> None:
        """A new target position; outside of 607Dh it is held there and bit 11 says so."""
        if self.low <= target <= self.high:
            self.target = target
            limit = 0
        else:
            self.target = max(self.low, min(self.high, target))
            limit = LIMIT
        if limit != self.limit:
            self.limit = limit
            self._refresh()
        self.guesses = 0

    def guess(self) -> None:
        """No new target came for the next period."""
        if self._parameters.lost_sync is LostSync.EXTRAPOLATE and self.guesses < MOST_GUESSES:
            self.guesses += 1
            self.target = round(2.0 * self.servo.end - self.servo.start)

    def step(self, now_s: float) -> None:
        """One interpolation period ends, the next one begins."""
        servo = self.servo
        servo.step(self.target if self._generator is None else self._generator())
        lag = servo.start - servo.position
        if lag > self._window or lag < -self._window:
            self._lag_too_far(now_s)
        elif self._lagging_s is not None:
            self._lagging_s = None

    @property
    def moves_by_itself(self) -> bool:
        """A ramp or a homing run is under way: it needs no SYNC to go on."""
        return self._generator is not None

    def _lag_too_far(self, now_s: float) -> None:
        """6065h is exceeded; after 6066h milliseconds that is a fault."""
        if self._lagging_s is None:
            self._lagging_s = now_s
        if now_s - self._lagging_s >= self._dictionary.get(0x6066) * 1e-3 and self.power is Power.ENABLED:
            self._deviates = DEVIATES
            self.fail(FOLLOWING_FAULT, now_s)

    # -- states

    def command(self, word: int, now_s: float) -> None:
        """Act on a controlword."""
        before, self.controlword = self.controlword, word
        self.unsettled = False
        if self.mode == HOMING and self.power is Power.ENABLED and (word ^ before) & START_HOMING:
            self._switch_homing(bool(word & START_HOMING))
        asked = command(word, before)
        state = following(self.power, asked) if asked is not None else None
        if state is None or asked is None:
            return
        if state is Power.ENABLED:
            self._ask_enable(now_s)
        elif asked is Command.RESET:
            self._reset(now_s)
        elif state is Power.QUICK_STOP:
            self.quick_stop(now_s)
        else:
            self._enter(state)

    def _ask_enable(self, now_s: float) -> None:
        """The brake takes its time; from a quick stop only 605Ah = 5 .. 8 lets the drive go on."""
        if self.power is Power.QUICK_STOP:
            if self._dictionary.get(0x605A) >= 5:
                self._enter(Power.ENABLED)
        elif not self._enabling:
            self._enabling = True
            self._alarm("enable", now_s + self._parameters.enable_delay_s, self._enable)

    def _enable(self, _now_s: float) -> None:
        self._enabling = False
        asked = command(self.controlword, self.controlword)
        if self.power is Power.SWITCHED_ON and asked is Command.ENABLE:
            self._enter(Power.ENABLED)

    def _reset(self, now_s: float) -> None:
        if self.causes:
            return
        self._deviates = 0
        self._enter(Power.DISABLED)
        self._emergency(0, now_s)

    def _enter(self, state: Power) -> None:
        self.power = state
        self.unsettled = True
        self.powered = state in POWERED
        if not self.powered or state is Power.ENABLED:
            self._stand()
        self._refresh()

    def _stand(self) -> None:
        """The demand is where the motor is; in CSP the next target leads on from there."""
        self.servo.rest()
        self.target = self.actual()
        self._lagging_s = None
        self._generator = None if self.mode == CSP else self._hold
        if not self.powered:
            self._generator = None
        if self._homing == HOMING_RUNS:
            self._homing = HOMING_IDLE

    def _hold(self) -> float:
        return self.servo.end

    def _refresh(self) -> None:
        """The statusword, which changes with events only."""
        word = self.power.value | REMOTE | VOLTAGE | self.limit | self._deviates
        if self.power is Power.ENABLED and self.mode == CSP:
            word |= FOLLOWS
        elif self.power is Power.ENABLED and self.mode == HOMING:
            word |= self._homing
        elif self.power is Power.QUICK_STOP and self._generator == self._hold:
            word |= REACHED
        self.statusword = word

    # -- stopping

    def switch_off(self) -> None:
        """As after power-on; the motor stays where it is."""
        self.causes.clear()
        self._deviates = self.limit = 0
        self._enabling = False
        self.mode, self.controlword = 0, 0
        self._enter(Power.DISABLED)

    def quick_stop(self, _now_s: float) -> None:
        """Quick stop by 605Ah: 0 current off; 1, 2 ramp, then off; 5, 6 ramp and stay."""
        option = self._dictionary.get(0x605A)
        if option == 0 or not self.powered:
            self._enter(Power.DISABLED)
            return
        self._enter(Power.QUICK_STOP)
        self._ramp(slow=option in (1, 5), then=Power.QUICK_STOP if option >= 5 else Power.DISABLED)

    def fail(self, code: int, now_s: float) -> None:
        """An error: emergency message and the fault reaction."""
        self._emergency(code, now_s)
        self.trip()

    def trip(self) -> None:
        """Fault reaction by 605Eh: 0 current off; 1 slow, 2 quick ramp; then FAULT."""
        if self.power in (Power.FAULT, Power.FAULT_REACTION):
            return
        option = self._dictionary.get(0x605E)
        if option == 0 or not self.powered:
            self._enter(Power.FAULT)
            return
        self._enter(Power.FAULT_REACTION)
        self._ramp(slow=option == 1, then=Power.FAULT)

    def lose_connection(self, now_s: float) -> None:
        """Abort connection option, 6007h: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop."""
        option = self._dictionary.get(0x6007)
        if option == 1:
            self.trip()
        elif option == 2 and self.power not in (Power.FAULT, Power.FAULT_REACTION):
            self._enter(Power.DISABLED)
        elif option == 3 and self.power is Power.ENABLED:
            self.quick_stop(now_s)

    def _ramp(self, slow: bool, then: Power) -> None:
        def stopped() -> None:
            if then is not self.power:
                self._enter(then)
            else:
                self._generator = self._hold
                self._refresh()

        deceleration = self._dictionary.get(0x6084 if slow else 0x6085)
        self._generator = motion.ramp_down(self.servo, deceleration, self.period_s, stopped)

    # -- modes and homing

    def _ask_mode(self, mode: int) -> None:
        if mode not in MODES:
            raise Abort(Code.VALUE)
        self._alarm("mode", self.now_s + self._parameters.mode_delay_s, lambda _now_s: self._set_mode(mode))

    def _set_mode(self, mode: int) -> None:
        if mode == self.mode:
            return
        self.mode = mode
        self._homing = HOMING_IDLE
        if self.power is Power.ENABLED:
            self._stand()
        self._refresh()

    def _switch_homing(self, start: bool) -> None:
        """Controlword bit 4 starts homing on its rising edge and breaks it off on its falling one."""
        if not start:
            if self._homing == HOMING_RUNS:
                self._stand()
            self._refresh()
            return
        method = self._dictionary.get(0x6098)
        self._homing = HOMING_RUNS
        if method in motion.HERE:
            self._homed(self.servo.position)
        else:
            self._search(motion.SWITCH_SIDE[method])
        self._refresh()

    def _search(self, side: int) -> None:
        get = self._dictionary.get
        switch = self._parameters.switches[side > 0] + self._counted
        how = motion.Search(side, switch, get(0x6099, 1), get(0x6099, 2), get(0x609A))
        self._generator = motion.search(self.servo, how, self.period_s, self._homed)

    def _homed(self, edge: float) -> None:
        """``edge`` (present counting) becomes 607Ch."""
        counts = self._dictionary.get(0x607C) - edge
        self.servo.shift(counts)
        self._counted += counts
        self.target = self.actual()
        self._generator = self._hold
        self._homing = HOMING_DONE
        self._refresh()


def _known_method(method: int) -> None:
    if method not in motion.METHODS:
        raise Abort(Code.VALUE)
