"""Objects of the drive profile that are live, and those whose writing does something."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drives.bench.simulated.aborts import Abort, Code
from drives.bench.simulated.axis import Axis
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Dictionary
from drives.bench.simulated.units import OBJECTS
from drives.settings import ADDITIONAL_POSITION

RANGE_AT = 0x607B
LOW, HIGH = 1, 2
MAX_TORQUE = 0x7FFF


def publish(axis: Axis) -> None:
    """Bind an axis to its drive's dictionary."""
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
