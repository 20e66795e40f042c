"""From what the bus side knows about a node to the simulated device that takes its place."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from drives.bench.simulated import families, homing
from drives.bench.simulated.data_sheet import EDS, key
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IO_EDS, IoNode
from drives.bench.simulated.parameters import Parameters
from drives.settings import IoSettings, NodeSettings, SpindleSettings

NodeLike = NodeSettings | SpindleSettings | IoSettings
COUNTS_PER_REV = 4096.0  # of a spindle that nobody describes
SPINDLE_REV_S2 = 200.0  # a spindle motor's own limit, above what a controller asks of it
# Of a motor over what its axis needs, where nothing else is said.
QUICK_STOP_SHARE = 2.4  # of a quick stop that the machine file wants over the acceleration: the torque has it
TORQUE_RESERVE, SPEED_RESERVE = 3.0, 1.05
# Of the axis' velocity: homing, where the drive's defaults are beyond it.
SEARCH_SHARE, EDGE_SHARE = 0.2, 0.02
COAST_SHARE, BRAKE_SHARE = 0.25, 1.0  # of the axis' acceleration: what friction and the brake take away


def drive(settings: NodeSettings, parameters: Parameters) -> SimulatedDrive:
    """A servo drive of its node's data sheet and profile. Raises OSError without the sheet.

    An absolute encoder finds the axis where homing would have put it.
    """
    if settings.absolute:
        at = settings.homing_position_counts
        parameters = replace(parameters, position_counts=at, absolute_encoder=True)
    parameters = replace(parameters, brake=parameters.brake and settings.brake)
    size = settings.counts_per_si
    known = (0.0, size) if settings.rotary else (size, 0.0)
    parameters = replace(parameters, counts_per_metre=known[0], counts_per_radian=known[1])
    nature = _sized(parameters, *_needs(settings))
    made = SimulatedDrive(settings.node, nature, settings.eds or EDS)
    made.dictionary.believe(settings.overrides)
    families.restrict(made, settings.profile)
    if velocity := settings.velocity_unit_counts_s:
        made.axis.units.set_own(velocity, settings.acceleration_unit_counts_s2)
        made.configure()
    _pace_homing(made, settings)
    usual = Parameters()
    if nature.switches == usual.switches and nature.home_switch == usual.home_switch:
        _place_switches(made, settings)
    return made


def _pace_homing(made: SimulatedDrive, settings: NodeSettings) -> None:
    """A search at which the axis cannot move is not what a drive was set up for: its defaults are lowered."""
    axis, dictionary = made.axis, made.dictionary
    axis.units.configure()
    scale, most = axis.units.scale, settings.velocity_counts_s
    if most <= 0.0 or not (dictionary.has(0x6099, 1) and dictionary.has(0x6099, 2)):
        return
    for sub, share in ((1, SEARCH_SHARE), (2, EDGE_SHARE)):
        if (counts_s := axis.units.speed_at(0x6099, sub) / scale) > most:
            where = key(0x6099, sub)
            lower = max(1, round(dictionary.get(0x6099, sub) * share * most / counts_s))
            dictionary.factory[where] = dictionary.values[where] = lower


def _place_switches(made: SimulatedDrive, settings: NodeSettings) -> None:
    """Where homing by a switch or an index pulse leads to the position that the machine file gives it."""
    axis, nature = made.axis, made.parameters
    if settings.absolute or settings.homing_method not in homing.METHODS:
        return
    units = axis.units
    units.configure()
    pace = homing.Pace(
        settings.homing_fast_counts_s or units.speed_at(0x6099, 1) / units.scale,
        settings.homing_slow_counts_s or units.speed_at(0x6099, 2) / units.scale,
        settings.homing_acceleration_counts_s2 or units.acceleration_at(0x609A) / units.scale,
    )
    at, travel = settings.homing_position_counts, (settings.counts_min, settings.counts_max)
    site = homing.site(settings.homing_method, at, travel, pace, nature.index_counts / units.scale)

    def counted(*places: float) -> list[float]:
        """In the counting from power-on, rising."""
        return sorted(nature.position_counts + units.increments(q - site.stand) for q in places)

    low, high = counted(*site.limits)
    first, last = counted(*site.home)
    axis.sensors.place((low, high), (first, last), counted(site.index)[0])


def _needs(settings: NodeSettings) -> tuple[float, float]:
    """Counts/s and counts/s^2 that the axis asks of its motor; 0 = not known."""
    quick_stop = settings.quick_stop_counts_s2 / QUICK_STOP_SHARE
    return settings.velocity_counts_s, max(settings.acceleration_counts_s2, quick_stop)


def _sized(parameters: Parameters, velocity_counts_s: float, acceleration_counts_s2: float) -> Parameters:
    """A motor for an axis that moves so fast (0 = not known), unless it has been chosen."""
    sizes: dict[str, Any] = {
        "strongest_counts_s2": TORQUE_RESERVE * acceleration_counts_s2,
        "coast_counts_s2": COAST_SHARE * acceleration_counts_s2,
        "brake_counts_s2": BRAKE_SHARE * acceleration_counts_s2,
        "fastest_counts_s": SPEED_RESERVE * velocity_counts_s,
    }
    usual = Parameters()
    free = [name for name in sizes if getattr(parameters, name) == getattr(usual, name)]
    changes = {name: sizes[name] for name in free if sizes[name]}
    return replace(parameters, **changes)


def spindle(settings: SpindleSettings, parameters: Parameters) -> SimulatedDrive:
    """A drive whose motor turns on and on: its position wraps, and its torque is limited."""
    motor = parameters.motor
    most = (SPINDLE_REV_S2 if motor is None else motor.strongest_rev_s2) * abs(settings.counts_per_rev)
    nature = _sized(replace(parameters, most_acceleration=most), 0.0, most)
    made = SimulatedDrive(settings.node, nature, settings.eds or EDS)
    made.dictionary.believe(settings.overrides)
    return families.restrict(made, settings.profile)


def inputs_and_outputs(settings: IoSettings, parameters: Parameters) -> IoNode:
    made = IoNode(settings.node, parameters, settings.eds or IO_EDS)
    made.dictionary.believe(settings.overrides)
    return made


def beside(
    spindles: Iterable[int], others: Iterable[int], parameters: Parameters
) -> list[SimulatedDrive | IoNode]:
    """Spindles, and inputs and outputs, by their node ids, for who knows no more of them."""
    made: list[SimulatedDrive | IoNode] = [
        spindle(SpindleSettings("spindle", "", node, "", COUNTS_PER_REV), parameters) for node in spindles
    ]
    return made + [inputs_and_outputs(IoSettings("io", "", node, ""), parameters) for node in others]


def device(settings: NodeLike, parameters: Parameters) -> SimulatedDrive | IoNode:
    """The device of any kind of node. Raises OSError where its data sheet is missing."""
    if isinstance(settings, IoSettings):
        return inputs_and_outputs(settings, parameters)
    if isinstance(settings, SpindleSettings):
        return spindle(settings, parameters)
    return drive(settings, parameters)
