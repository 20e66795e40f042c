"""Machines that are not quite as their file says, and a sphere probed on them by their own screws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from controller.calibration.positions import Probe, Sphere
from controller.calibration.rotary_fit import across, moved
from controller.calibration.touch_table import Touches
from controller.geometry.arrays import Array
from controller.geometry.vectors import add, unit
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Axis, Machine

LEVER_MM = 100.0  # at which a rotary's angle counts as a length


@dataclass(frozen=True)
class Errors:
    """The most of each, in mm; of rotaries at ``LEVER_MM``."""

    centre_mm: float = 0.5
    tilt_deg: float = 0.1
    backlash_mm: float = 0.0
    pitch_mm: float = 0.0
    scale: float = 0.0


@dataclass(frozen=True)
class Screw:
    """Of one axis: where it is where it was told to be ``q``, come to in a sense."""

    home: float
    unit: float
    scale: float
    pitch: float
    wave: float
    phase: float
    backlash: float

    def at(self, q: Array | float, sense: Array | float) -> Array | float:
        wave = np.sin((q - self.home) * self.wave + self.phase) - math.sin(self.phase)
        return (
            q + self.scale * (q - self.home) + self.unit * (self.pitch * wave - 0.5 * sense * self.backlash)
        )


@dataclass(frozen=True)
class Hidden:
    """The machine as it is: rotaries where they really are, and its screws."""

    machine: Machine
    screws: tuple[Screw, ...]

    def real(self, joints: Array, senses: Array) -> Array:
        rows = zip(self.screws, joints.T, senses.T, strict=True)
        return np.column_stack([screw.at(q, sense) for screw, q, sense in rows])


def hidden(told: Machine, rng: np.random.Generator, errors: Errors) -> Hidden:
    axes = tuple(_axis(axis, rng, errors) for axis in told.axes)
    return Hidden(replace(told, axes=axes), tuple(_screw(axis, rng, errors) for axis in told.axes))


def _axis(axis: Axis, rng: np.random.Generator, errors: Errors) -> Axis:
    if not axis.is_rotary:
        return axis
    shift = rng.normal(size=3)
    shift *= errors.centre_mm * rng.uniform() / np.linalg.norm(shift)
    tilt, way = math.radians(errors.tilt_deg) * rng.uniform(), rng.uniform(0, 2 * math.pi)
    turned = moved(axis, across(axis.direction), (0.0, 0.0, tilt * math.cos(way), tilt * math.sin(way)))
    return replace(turned, point_mm=add(axis.point_mm, tuple(float(c) for c in shift)))


def _screw(axis: Axis, rng: np.random.Generator, errors: Errors) -> Screw:
    one = 1.0 / LEVER_MM if axis.is_rotary else 1.0
    wave_mm = rng.uniform(60.0, 300.0)
    return Screw(
        home=axis.homing.position,
        unit=one,
        scale=0.0 if axis.is_rotary else errors.scale * rng.uniform(-1, 1),
        pitch=errors.pitch_mm * rng.uniform(),
        wave=2.0 * math.pi / (math.radians(wave_mm) if axis.is_rotary else wave_mm),
        phase=rng.uniform(0, 2 * math.pi),
        backlash=errors.backlash_mm * rng.uniform(),
    )


def probed(
    told: Machine,
    real: Hidden,
    sphere: Sphere,
    probe: Probe,
    places: Sequence[tuple[float, ...]],
    rng: np.random.Generator,
    scatter_mm: float = 1e-3,
) -> Touches:
    """Nine touches at every place: along the tool, at four sides and at four between.

    The rotaries, and slides that stand during a touch, have come to their places in the positive sense.
    """
    rows = [row for place in places for row in _at(told, real, sphere, probe, place, rng, scatter_mm)]
    joints, ways, senses = (np.array(column) for column in zip(*rows, strict=True))
    n = len(joints)
    flat = np.full(n, probe.length_mm), np.full(n, probe.radius_mm)
    return Touches(joints, ways, *flat, senses, ("sphere",) * n)


def _at(told, real, sphere, probe, place, rng, scatter_mm):
    """Each where its way meets the sphere, on the machine as it is."""
    kinematics, truth, linear = kinematics_of(told), kinematics_of(real.machine), list(told.linear())
    pair = (*place, 0.0, 0.0)[:2]
    centre = np.array(kinematics.linear(sphere.centre, pair, probe.length_mm))
    base = np.array(kinematics.arrange((*centre, *pair)))
    lower = np.array(kinematics.linear(sphere.centre, pair, probe.length_mm + 1.0)) - centre
    up = lower / np.linalg.norm(lower)  # the tool axis as the slides see it: longer tools stand further off
    one = np.cross(up, unit((0.3, 0.5, 0.2)))
    one /= np.linalg.norm(one)
    other = np.cross(up, one)
    sides = [math.cos(a) * one + math.sin(a) * other for a in np.arange(4) * math.pi / 2 + 0.3]
    reach = sphere.radius_mm + probe.radius_mm
    for way in [-up, *sides, *((side - up) / math.sqrt(2.0) for side in sides)]:
        senses = np.ones(len(told.axes))
        senses[linear] = np.where(np.abs(way) > 0.02, np.sign(way), 1.0)

        def joints(t, way=way):
            found = base.copy()
            found[linear] += t * way
            return found

        def gap(t, senses=senses, joints=joints):
            stands = real.real(joints(t)[None], senses[None])[0]
            tip = np.array(truth.forward(tuple(stands), probe.length_mm).tip)
            return np.linalg.norm(tip - np.array(sphere.centre)) - reach

        touched = brentq(gap, -reach - 4.0, 0.0, xtol=1e-12)
        yield joints(touched + rng.normal() * scatter_mm), way, senses
