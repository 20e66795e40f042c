"""The machine as the bus side knows it: buses, drives, spindle, inputs and outputs, in counts."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from controller.machine import compensation, drive_profiles
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Axis, Demand, LoadEncoder, Machine, SpindlePosition, Temperature
from controller.machine.spindle import ANALOGUE_OUTPUT, fastest
from controller.machine.toml_table import ConfigError
from controller.messages import message
from drives.settings import (
    BusSettings,
    FollowingWindow,
    IoSettings,
    MasterSettings,
    NodeSettings,
    SpindleSettings,
)
from drives.text_file import Source, TextFile

IN_POSITION_COUNTS = 2.0
MM_PER_M = 1000.0
IO_EDS = Path(__file__).resolve().parent.parent.parent / "config" / "eds" / "simulated_io.eds"


def bus_settings(machine: Machine) -> tuple[BusSettings, ...]:
    """The machine's buses as the drives' side knows them."""
    return tuple(BusSettings(b.name, b.interface, b.channel, b.bit_rate) for b in machine.buses)


def master_settings(machine: Machine) -> MasterSettings:
    """The controller as a CANopen node on every bus."""
    return MasterSettings(period_s=machine.period_s)


def node_settings(machine: Machine) -> tuple[NodeSettings, ...]:
    """One drive per axis, in the axes' order, in counts; raises ``ConfigError`` without its EDS."""
    slides, axes = Slides(machine.axes), machine.axes
    asked = [replace(axis, limits=slides.limits(axes, i)) for i, axis in enumerate(axes)]
    return tuple(_node(axis, compensation.largest(machine, i), machine) for i, axis in enumerate(asked))


def spindle_settings(machine: Machine) -> SpindleSettings | None:
    """The spindle's drive, None where the controller has none; raises ``ConfigError`` without its EDS."""
    spindle = machine.spindle
    if spindle is None or not spindle.has_drive:
        return None
    return SpindleSettings(
        name="spindle",
        bus=spindle.bus,
        node=spindle.node,
        eds=eds_of(spindle.profile, spindle.eds),
        counts_per_rev=spindle.counts_per_rev,
        mode=spindle.mode,
        at_speed_share=spindle.at_speed_share,
        profile=drive_profiles.load(spindle.profile),
        acceleration_rev_s2=spindle.acceleration_rev_s2,
        most_rev_min=fastest(spindle),
        velocity_unit_counts_s=spindle.stopping.velocity_unit_counts_s,
        acceleration_unit_counts_s2=spindle.stopping.acceleration_unit_counts_s2,
        unsupervised=spindle.unsupervised,
        overrides=spindle.overrides,
        **({} if spindle.position is None else _turned(spindle.position)),
    )


def _turned(told: SpindlePosition) -> dict[str, Any]:
    """Where the spindle's angle comes from."""
    return {
        "position_tpdo": told.tpdo,
        "position_entry": told.index << 16 | told.sub << 8 | 32,
        "position_per_rev": told.counts_per_rev,
        "tells_load": told.load,
    }


def io_settings(machine: Machine) -> tuple[IoSettings, ...]:
    """The nodes with inputs and outputs: none or one."""
    io = machine.io
    if io is None:
        return ()
    inputs, outputs = (max((bit for _, bit in bits), default=0) // 8 + 1 for bits in (io.inputs, io.outputs))
    made = IoSettings("io", io.bus, io.node, io.eds or str(IO_EDS), inputs, outputs)
    idle = {one.channel: one.counts(one.idle) for one in io.analogue_out}
    inverter = machine.spindle.inverter if machine.spindle is not None else None
    if inverter is not None and inverter.index == ANALOGUE_OUTPUT:
        idle[inverter.channel] = inverter.zero_counts
    elif inverter is not None:
        entry = inverter.index << 16 | inverter.channel << 8 | inverter.bits
        made = replace(made, speed_entry=entry, speed_idle=inverter.zero_counts)
    if inverter is not None and (told := inverter.feedback) is not None:
        entry = told.index << 16 | told.channel << 8 | told.bits
        made = replace(made, feedback_entry=entry, feedback_tpdo=told.tpdo)
    analogue = tuple(idle.get(channel, 0) for channel in range(1, max(idle, default=0) + 1))
    return (replace(made, analogue=analogue, unsupervised=io.unsupervised, overrides=io.overrides),)


def all_settings(machine: Machine) -> tuple[NodeSettings | SpindleSettings | IoSettings, ...]:
    """Every node of the machine: what is commissioned, and what takes bus time."""
    spindle = spindle_settings(machine)
    return (*node_settings(machine), *(() if spindle is None else (spindle,)), *io_settings(machine))


@lru_cache(maxsize=64)  # asked with every status, and a path is resolved on the disk
def eds_of(profile: Source, named: Source = "") -> Source:
    """The electronic data sheet that a machine file names, else the one that comes with the profile.

    Raises ``ConfigError`` where neither is there: makers keep the sheets of their drives.
    """
    eds = named or drive_profiles.load(profile).eds
    if not eds:
        raise ConfigError(message("file.no_eds", profile=profile))
    return eds if isinstance(eds, TextFile) else str(Path(eds).resolve())


def _node(axis: Axis, off: float, machine: Machine) -> NodeSettings:
    """``off``: so far beyond its travel its tables may send it (mm, rad)."""
    counts = abs(axis.counts_per_unit)
    ends = sorted(round(q * axis.counts_per_unit) for q in (axis.travel_min - off, axis.travel_max + off))
    return NodeSettings(
        name=axis.name,
        bus=axis.bus,
        node=axis.node,
        eds=eds_of(axis.profile, axis.eds),
        counts_min=ends[0],
        counts_max=ends[1],
        following_error_counts=round(abs(axis.following_error * axis.counts_per_unit)),
        following=_following(axis),
        homing_method=axis.homing.method,
        homing_position_counts=round(axis.homing.position * axis.counts_per_unit),
        absolute=axis.homing.absolute,
        homing_fast_counts_s=round(axis.homing.fast * counts),
        homing_slow_counts_s=round(axis.homing.slow * counts),
        homing_acceleration_counts_s2=round(axis.homing.acceleration * counts),
        velocity_counts_s=axis.limits.velocity * counts,
        acceleration_counts_s2=axis.limits.acceleration * counts,
        quick_stop_counts_s2=axis.stopping.quick_stop * counts,
        most_quick_stop_s=machine.max_quick_stop_s,
        rotary=axis.is_rotary,
        counts_per_si=counts if axis.is_rotary else counts * MM_PER_M,
        velocity_unit_counts_s=axis.stopping.velocity_unit_counts_s,
        acceleration_unit_counts_s2=axis.stopping.acceleration_unit_counts_s2,
        period_s=machine.period_s,
        brake=axis.brake,
        feedback_every=axis.feedback_every,
        feed_forward=axis.feed_forward,
        enable_group=axis.enable_group,
        unsupervised=axis.unsupervised,
        overrides=axis.overrides,
        profile=drive_profiles.load(axis.profile),
        serial=axis.serial,
        probe_tpdo=0 if axis.is_rotary else machine.latch_tpdo,
        temperature_tpdo=axis.temperature.tpdo if axis.temperature else 0,
        temperature_entry=_entry(axis.temperature) if axis.temperature else 0,
        setpoint_deadline_s=axis.setpoint_deadline_s,
        **({} if axis.demand is None else _demand_settings(axis.demand)),
        **({} if axis.load_encoder is None else _load_settings(axis, axis.load_encoder)),
    )


def _demand_settings(told: Demand) -> dict[str, Any]:
    """Where the setpoint comes from that a drive goes by."""
    return {
        "demand_tpdo": told.tpdo,
        "demand_index": told.index,
        "demand_every": told.every,
        "demand_per_count": told.per_count,
    }


def _load_settings(axis: Axis, encoder: LoadEncoder) -> dict[str, Any]:
    """Where the encoder at the load is told, and what it may differ by."""
    return {
        "load_tpdo": encoder.tpdo,
        "load_node": encoder.node,
        "load_entry": encoder.index << 16 | encoder.sub << 8 | 32,
        "load_every": encoder.every,
        "load_per_count": encoder.counts_per_unit / axis.counts_per_unit,
        "most_load_off_counts": encoder.most_off * abs(axis.counts_per_unit),
    }


def _following(axis: Axis) -> FollowingWindow:
    """The controller's own window; what is in position is so within two counts at least."""
    counts, allowed = abs(axis.counts_per_unit), axis.following
    return FollowingWindow(
        rest_counts=allowed.rest * counts,
        speed_s=allowed.at_speed / axis.limits.velocity,
        in_position_counts=max(IN_POSITION_COUNTS, allowed.in_position * counts),
        ticks=allowed.ticks,
        velocity_counts_s=axis.limits.velocity * counts,
        tightens=allowed.tightens,
    )


def _entry(told: Temperature) -> int:
    """As a mapping object has it (CiA 301, 7.5.2.37)."""
    return told.index << 16 | told.sub << 8 | told.bits
