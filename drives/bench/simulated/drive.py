"""A CiA 402 servo drive on the virtual bus: a CANopen ``Device`` around an ``Axis``.

The way of SYNC is the hot one: with five drives at 2 ms and ten times real time it
may cost 12 us per drive. So nothing is scheduled or looked up there that can be
kept ready, and supervision of SYNC itself costs one comparison. Whatever is not the
controller's own mapping goes by ``ProcessData``. A drive whose last period has left
everything as it was, and that is told the same again, does the same: it answers what
it answered, and nothing need be worked out for that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from struct import Struct
from typing import Final

from drives.bench.simulated import pdo_map
from drives.bench.simulated.axis import Axis
from drives.bench.simulated.data_sheet import EDS, key
from drives.bench.simulated.device import APPLICATION, Device
from drives.bench.simulated.dictionary import Abort, Code, Dictionary
from drives.bench.simulated.inputs import NEGATIVE_LIMIT, POSITIVE_LIMIT, STO, Inputs
from drives.bench.simulated.machine402 import POWERED
from drives.bench.simulated.parameters import Parameters
from drives.bench.simulated.pdo_map import Pdo
from drives.bench.simulated.spindle_motor import SpindleMotor
from drives.bench.simulated.station import OPERATIONAL
from drives.bench.simulated.units import OBJECTS
from drives.bench.virtual.virtual_bus import Handler
from drives.pdo import COMMAND, DATA_AT, PDO_BYTES
from drives.settings import ADDITIONAL_POSITION, INT32_MAX, INT32_MIN
from drives.text_file import Source

FEEDBACK: Final = Struct("<IB3xHi2x")
LATEST_PERIODS = 2.5  # drives with an interpolation time-out act this long after the last SYNC
QUIET_PERIODS = 4.0  # without SYNC after which the others live on by their own clock
MAX_CATCH_UP = 500  # periods made up for after a long silence; by then every ramp has ended
TARGET = key(0x607A)
OFFSETS = (key(0x60B0), key(0x60B1), key(0x60B2))


RANGE_AT = 0x607B
LOW, HIGH = 1, 2
MAX_TORQUE = 0x7FFF


def publish(axis: Axis) -> None:
    """Bind an axis to its drive's dictionary: objects that are live, and those whose writing acts."""
    dictionary, servo, units = axis.dictionary, axis.servo, axis.units
    readers: dict[int, Callable[[], int]] = {
        0x6040: lambda: axis.controlword,
        0x6041: lambda: axis.statusword,
        0x6061: lambda: axis.mode,
        0x6062: lambda: units.reported_position(servo.start),
        0x6063: axis.actual,
        0x6064: lambda: units.reported_position(servo.position),
        0x606B: lambda: units.reported_velocity((servo.end - servo.start) / axis.period_s),
        0x606C: lambda: units.reported_velocity(servo.velocity),
        0x607A: lambda: units.reported_position(axis.target),
        0x6077: lambda: _torque(axis),
        0x60F4: lambda: units.reported_position(servo.start - servo.position),
        0x60FC: lambda: round(servo.start),
    }
    writers: dict[int, Callable[[int], None]] = {
        0x6040: lambda word: _command(axis, word),
        0x607A: lambda target: axis.aim(units.increments(target)),
        0x6060: axis.ask_mode,
        0x6098: lambda method: _known_method(axis, method),
    }
    dictionary.readers.update({key(index): reader for index, reader in readers.items()})
    dictionary.readers[key(ADDITIONAL_POSITION, 1)] = lambda: units.reported_position(
        servo.position - axis.slipped
    )
    dictionary.writers.update({key(index): writer for index, writer in writers.items()})
    for where in dictionary.values:
        if where >> 8 in OBJECTS:
            dictionary.writers[where] = lambda _value: _standing(axis)
    for sub in (LOW, HIGH):
        dictionary.writers[key(RANGE_AT, sub)] = partial(_check_range, dictionary, sub)


def _command(axis: Axis, word: int) -> None:
    """A ramp does not begin anew with a controlword that asks for it again."""
    if word != axis.controlword or axis.stops.leaving is None:
        axis.command(word, axis.station.now_s)


def _check_range(dictionary: Dictionary, sub: int, value: int) -> None:
    """607Bh: the maximum may not be below the minimum; 0, 0 = no range, and 0 may be first to go."""
    low = value if sub == LOW else dictionary.get(RANGE_AT, LOW)
    high = value if sub == HIGH else dictionary.get(RANGE_AT, HIGH)
    if low > high and dictionary.get(RANGE_AT, LOW + HIGH - sub):
        raise Abort(Code.MAX_BELOW_MIN)


def _standing(axis: Axis) -> None:
    """Units do not change under a motor with current."""
    if axis.powered:
        raise Abort(Code.DEVICE_STATE)


def _torque(axis: Axis) -> int:
    """6077h, thousandths of the rated torque: what accelerates the motor, friction left out."""
    if not axis.powered:
        return 0
    thousandths = round(axis.servo.acceleration / axis.parameters.torque_counts_s2)
    return max(-MAX_TORQUE, min(MAX_TORQUE, thousandths))


def _known_method(axis: Axis, method: int) -> None:
    if method not in axis.homing_methods:
        raise Abort(Code.VALUE)


class SimulatedDrive(Device):
    """One drive; attach it to a ``SteppedBus``. Node 255: it waits for LSS to give it one."""

    def __init__(self, node: int, parameters: Parameters = Parameters(), eds: Source = EDS) -> None:  # noqa: B008
        super().__init__(node, parameters, eds)
        self.lost_syncs = 0  # SYNCs that did not come
        self._sync_s = 0.0
        self._guessed = 0  # periods already made up for since the last SYNC
        self._received: bytes | None = None  # the newest standard RPDO, latched by SYNC
        self._told: bytes | None = None  # the one that the last SYNC latched
        self._rests: tuple[object, ...] | None = None  # the state that it has left as it was
        self._said = b""  # the answer to it
        self._fast_in: list[Pdo] = []
        self._deadline: Pdo | None = None  # of the standard RPDO, if it has one
        self._fast_out = 0  # identifier of the standard TPDO, if it is as the controller maps it
        self._latched = self.process.latched  # one dict for ever: looked at with every SYNC
        self.axis = Axis(self, self.emergencies, self._alive, self._faulted)
        self.inputs = Inputs(self.axis)
        publish(self.axis)
        self.process.taken = self._taken
        self.dictionary.readers[key(0x2000)] = lambda: self.lost_syncs
        self.dictionary.writers[key(0x2001)] = lambda code: self.inject(code, self.now_s)
        self.configure()

    # -- SYNC and process data

    def _on_sync(self, frame: bytes, now_s: float) -> None:
        """One period ends: latch the setpoint, move the motor, report where it is."""
        axis, received, before = self.axis, self._received, None
        gap_s = now_s - self._sync_s
        counts = True  # as a period
        if not self._soonest_s <= gap_s < self._latest_s:
            counts = self._irregular(gap_s, now_s)
        elif received is not None and received == self._told and not self._latched:
            before = self._state()
            if before == self._rests:
                self._repeat(frame, now_s)
                return
        self._told = received
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
            axis.guess(now_s)
        if self._latched:
            self.process.take_latched(now_s)
        if counts:
            self._count(now_s)
            if axis.powered:
                axis.step(now_s)
        if self.nmt == OPERATIONAL:
            self._report(frame, now_s)
        repeats = before is not None and self._may_repeat() and before == self._state()
        self._rests = before if repeats else None

    def _count(self, now_s: float) -> None:
        """A period has passed."""
        self._sync_s = now_s
        if self.axis.powered:
            # The bus may still ask at the old time, and finds nothing due.
            expires_s = self.watch_s = now_s + self._patience_s
            self.due_s = expires_s if expires_s < self._alarm_s else self._alarm_s

    def _state(self) -> tuple[object, ...]:
        """All that the answer to a SYNC, and what it does to the drive, depend on, besides the setpoint."""
        axis = self.axis
        return (
            self.nmt,
            axis.statusword,
            axis.controlword,
            axis.unsettled,
            axis.generator,
            axis.target,
            axis.servo.state,
            axis.sensors.watches,
            axis.dictionary.changes,
        )

    def _may_repeat(self) -> bool:
        """Whether ``_state`` is all: the fast TPDO is sent, and the demand remembers nothing."""
        return bool(self._fast_out) and self.nmt == OPERATIONAL and self.axis.remembers_nothing

    def _repeat(self, frame: bytes, now_s: float) -> None:
        """What the last SYNC has done and left as it was; other TPDOs look themselves what they tell."""
        self._received = None
        if self.axis.generator is not None:
            self.now_s = now_s
        self._count(now_s)
        self._send(frame, now_s)

    def _report(self, frame: bytes, now_s: float) -> None:
        """The TPDOs of this SYNC: what was true at the SYNC, sent a little later."""
        if self._fast_out:
            position = round(self.axis.servo.position)
            if not INT32_MIN <= position <= INT32_MAX:
                position = self.axis.actual()
            self._said = FEEDBACK.pack(self._fast_out, PDO_BYTES, self.axis.statusword, position)
        self._send(frame, now_s)

    def _send(self, frame: bytes, now_s: float) -> None:
        at_s = now_s + self._tpdo_delay_s
        if self._fast_out and self.link is not None:
            self.link.send(at_s, self._fast_out, self._said)
        if self._slow_out:
            self.process.after_sync(frame[DATA_AT] if frame[4] else 0, at_s, now_s)

    def _irregular(self, gap_s: float, now_s: float) -> bool:
        """A SYNC too soon is no period (False); before one too late the missing periods are made up for."""
        if gap_s < self._soonest_s:
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
        for _ in range(min(missing, MAX_CATCH_UP)):
            if axis.powered:
                axis.guess(now_s)
                axis.step(now_s)

    def _live(self, now_s: float) -> None:
        """Catch up with the clock between SYNCs: a SYNC is missing half a period after it was due."""
        if self.axis.powered:
            self._catch_up(self._missed(now_s), now_s)

    def _missed(self, now_s: float) -> int:
        return math.floor((now_s - self._sync_s) / self.axis.period_s - 0.5)

    def _alive(self, now_s: float) -> None:
        """The axis has become powered or moves by itself: from now on periods pass, SYNC or not."""
        if self.axis.powered and self.watch_s == math.inf:
            self.watch_from(max(self._sync_s + self._patience_s, now_s + self.axis.period_s))
        if self._missed(now_s) - self._guessed > MAX_CATCH_UP or not self.waiting("period"):
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
            if self._deadline is not None:
                self.process.watch(self._deadline, now_s)

    def _taken(self, used: Pdo, now_s: float) -> None:
        """A target that does not wait for SYNC: what is left of this period leads towards it already."""
        axis = self.axis
        left = 1.0 - (now_s - self._sync_s) / axis.period_s
        if (
            left > 0.0
            and axis.cyclic
            and axis.follows
            and any(where == TARGET for where, _, _ in used.fields)
        ):
            axis.servo.end += left * (axis.target - axis.servo.end)

    # -- what a drive adds to a device

    def _own_handlers(self) -> dict[int, Handler]:
        return {mapped.can_id: self._on_standard_rpdo for mapped in self._fast_in}

    def _take_over(self, rpdos: list[Pdo], tpdos: list[Pdo]) -> None:
        axis = self.axis
        axis.offsets_mapped = any(where in OFFSETS for r in rpdos for where, _, _ in r.fields)
        axis.configure()
        self._soonest_s = 0.5 * axis.period_s
        self._latest_s = 1.5 * axis.period_s
        self._patience_s = axis.period_s * (LATEST_PERIODS if self.parameters.times_out else QUIET_PERIODS)
        self._tpdo_delay_s = self.parameters.tpdo_delay_s
        plain = self.sync.window_s == 0.0 and axis.units.plain
        before, self._fast_in = self._fast_in, [r for r in rpdos if plain and pdo_map.is_fast_in(r)][:1]
        if before != self._fast_in:
            self._wanted = ()  # the same frames go another way
        fast = [t for t in tpdos if plain and pdo_map.is_fast_out(t)][:1]
        self._fast_out = fast[0].can_id if fast else 0
        slow_in = [r for r in rpdos if r not in self._fast_in]
        self._deadline = next((r for r in self._fast_in if r.event_s > 0.0), None)
        self.process.configure(rpdos, tpdos, fast[0] if fast else None, slow_in)
        others = [t for t in tpdos if t not in fast]
        self._rests = None
        self._slow_out = not plain or any(t.looks_at_sync or t.may_change_by_itself for t in others)

    def _may_store(self) -> bool:
        return self.axis.power not in POWERED

    def _enter(self, state: int, now_s: float) -> None:
        if state != self.nmt:
            self._received = None
        super()._enter(state, now_s)

    def _lose_connection(self, now_s: float) -> None:
        """Abort connection option, 6007h."""
        self.axis.lose_connection(now_s)

    def _switch_off(self) -> None:
        self.axis.switch_off()

    def _power_off(self, now_s: float) -> None:
        self._received = None
        self.axis.power_off(now_s)

    def _power_on(self, now_s: float) -> None:
        self.axis.power_on(now_s)

    def _booted(self, now_s: float) -> None:
        self._sync_s = now_s
        self._guessed = 0
        self.axis.boot()
        self.watch_from(now_s)

    # -- faults

    def _faulted(self, now_s: float) -> None:
        self._behave(APPLICATION, now_s)

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

    def strike(self, closed: bool, counts: float, now_s: float) -> None:
        """The input of its first touch probe has changed where its motor was at ``counts``."""
        self.axis.sensors.probes.strike(0, closed, counts)
        self.process.look(now_s)

    def jam(self, jammed: bool, now_s: float) -> None:
        """The motor is stuck, or free again."""
        self._live(now_s)
        self.axis.servo.jam(jammed)

    def weaken(self, share: float, now_s: float) -> None:
        """So much of the torque is there; 1 = all of it."""
        self._live(now_s)
        self.axis.servo.weaken(share)

    def torque_off(self, active: bool, now_s: float) -> None:
        """Safe torque off by its terminal."""
        self._set_terminal(STO, active, now_s)

    def press_switch(self, upper: bool, pressed: bool, now_s: float) -> None:
        """A limit switch by its terminal."""
        self._set_terminal(POSITIVE_LIMIT if upper else NEGATIVE_LIMIT, pressed, now_s)

    def _set_terminal(self, bit: int, active: bool, now_s: float) -> None:
        self._live(now_s)
        word = self.inputs.word
        self.inputs.set(word | bit if active else word & ~bit, now_s)

    def place_switch(self, counts: int | None, now_s: float) -> None:
        """A limit switch at this position, at the end beyond it; None takes it away."""
        self._live(now_s)
        self.axis.sensors.place_switch(counts)

    def twin(self) -> SimulatedDrive:
        """Another drive of the kind with the same node id, and a serial number of its own."""
        return type(self)(self.node, self.parameters, self.dictionary.path)

    # -- the motor itself, as somebody sees it who stands beside it

    @property
    def motor_counts(self) -> float:
        """Where the motor is, in increments of its encoder."""
        return self.axis.servo.shaft

    @property
    def units_per_count(self) -> float:
        """Of a position as the drive reports it (6064h); what is written into it may change it."""
        return self.axis.units.position

    @property
    def motor_counts_s(self) -> float:
        return self.axis.servo.velocity

    def feel(self, power_rev_s: float, counts_per_rev: float) -> None:
        """A cut loads the motor, where it is a spindle's that feels it: see ``SpindleMotor.feel``."""
        if isinstance(motor := self.axis.servo, SpindleMotor):
            motor.feel(power_rev_s, 1000.0 * self.axis.parameters.torque_counts_s2, counts_per_rev)

    @property
    def origin_counts(self) -> float:
        """By how much the counting has moved since power-on: ``motor_counts`` less this never jumps."""
        return self.axis.sensors.moved

    def watch(self, now_s: float) -> None:
        """SYNC has stayed away, or the drive has no current: what counts puts the watch off by itself."""
        axis = self.axis
        expires_s = self._sync_s + self._patience_s
        self.watch_s = max(expires_s, now_s + axis.period_s)
        if not axis.powered:
            self.watch_s = math.inf  # nothing can stay away that would be missed; see ``_alive``
        elif now_s >= expires_s:
            self._live(now_s)
            if self.parameters.times_out:
                axis.time_out(now_s)
