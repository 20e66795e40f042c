"""Which positions of the rotaries to probe a sphere at: those that narrow the bounds most, one by one.

A position is worth what its touches would take off the covariance (greedy A-optimal design, on the goals of
``GOAL_MM`` and ``GOAL_RAD``). Considered is what is within travel, and where the probe comes to the sphere
from beyond the end of its stem: at most ``MAX_LEAN_RAD`` between the tool and the way that stem points.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from controller.calibration.refusal import Refusal
from controller.calibration.rotary_fit import FIRST_SCATTER_MM, Model, PriorDeviations
from controller.calibration.touch_table import Touches
from controller.geometry.arrays import Array
from controller.geometry.vectors import Vector, add, dot, norm, rotate, scale, unit
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine

GOAL_MM, GOAL_RAD = 0.001, math.radians(0.0005)
MAX_LEAN_RAD = math.radians(95.0)
GRID = 13  # places of each rotary that are looked at
USUAL = PriorDeviations(pitch_mm=5e-4)


@dataclass(frozen=True, slots=True)
class Sphere:
    """On the table: centre (table frame at zero) and radius, mm, and where its stem points."""

    centre: Vector
    radius_mm: float
    stem: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Probe:
    length_mm: float  # gauge line to the centre of the ball
    radius_mm: float  # of the ball


@dataclass(frozen=True, slots=True)
class Advice:
    """Positions to be probed (rad, carried), in order, and the bounds (mm, rad) that they would leave."""

    positions: tuple[tuple[float, ...], ...]
    bounds: tuple[tuple[float, float], ...]


def advise(
    machine: Machine,
    sphere: Sphere,
    probe: Probe,
    count: int,
    known: PriorDeviations = USUAL,
    done: Touches | None = None,
) -> Advice:
    """``count`` positions more than what is ``done``. Raises Refusal where none is in reach."""
    places = reachable(machine, sphere, probe)
    if not places:
        raise Refusal("none_in_reach", machine=machine.name)
    each = [touches_at(machine, sphere, probe, place) for place in places]
    informations, prior = _informations(machine, sphere, each, known, done)
    found, sofar, wanted = list[int](), prior, _goals(machine)
    for _ in range(min(count, len(places))):
        left = [k for k in range(len(places)) if k not in found]
        costs = [_cost(sofar + informations[k], wanted) for k in left]
        best = left[int(np.argmin(costs))]
        found.append(best)
        sofar = sofar + informations[best]
    covariance = np.asarray(np.linalg.inv(sofar), dtype=np.float64)
    bounds = tuple(Model.bound(covariance, k) for k in range(len(machine.rotary())))
    return Advice(tuple(places[k] for k in found), bounds)


def _goals(machine: Machine) -> Array:
    """One over the variance that is hoped for, of every sought number."""
    return np.array([1.0 / GOAL_MM**2] * 2 + [1.0 / GOAL_RAD**2] * 2) if machine.rotary() else np.zeros(0)


def _cost(information: Array, wanted: Array) -> float:
    variances = np.diag(np.linalg.inv(information))
    n = len(wanted)
    return float(sum(variances[k : k + n] @ wanted for k in range(0, n * (len(variances) // n), n)))


def _informations(
    machine: Machine, sphere: Sphere, each: list[Touches], known: PriorDeviations, done: Touches | None
) -> tuple[list[Array], Array]:
    """Of every position what its touches tell of rotaries and sphere; and what is known without them."""
    scatter = known.scatter_mm or FIRST_SCATTER_MM
    joined = _joined([*each, done] if done is not None else each)
    model = Model(joined, machine, sphere.radius_mm, known)
    n = 4 * len(machine.rotary()) + 4
    J = model.jacobian(np.zeros(len(model.unknowns(0.0))))[:, :n] / scatter
    priors = [one.prior for one in model.unknowns(0.0)[:n]]
    rows = np.split(J, np.cumsum([len(one) for one in each]))
    prior = np.diag([0.0 if math.isinf(p) else p**-2 for p in priors]) + 1e-6 * np.eye(n)
    return [one.T @ one for one in rows[: len(each)]], prior + rows[-1].T @ rows[-1]


def _joined(all_of_them: list[Touches]) -> Touches:
    columns = zip(*((t.joints, t.ways, t.length_mm, t.radius_mm, t.senses) for t in all_of_them), strict=True)
    joints, ways, lengths, radii, senses = (np.concatenate(column) for column in columns)
    names = tuple(itertools.chain.from_iterable(t.features for t in all_of_them))
    return Touches(joints, ways, lengths, radii, senses, names)


def reachable(machine: Machine, sphere: Sphere, probe: Probe) -> list[tuple[float, ...]]:
    """Places on a grid over the travel of the rotaries, one turn at most, where the sphere can be probed."""
    axes = [machine.axes[i] for i in machine.rotary()]
    ends = [(max(a.travel_min, -math.pi), min(a.travel_max, math.pi)) for a in axes]
    grids = [np.linspace(low, high, GRID)[: GRID - (high - low > 2.0 * math.pi - 1e-9)] for low, high in ends]
    places = [tuple(float(q) for q in place) for place in itertools.product(*grids)]
    return [place for place in places if _is_in_reach(machine, sphere, probe, place)]


def _is_in_reach(machine: Machine, sphere: Sphere, probe: Probe, place: tuple[float, ...]) -> bool:
    joints = _joints(machine, sphere.centre, probe, place)
    axis = kinematics_of(machine).forward(joints, probe.length_mm).axis
    if dot(axis, unit(sphere.stem)) < math.cos(MAX_LEAN_RAD):
        return False
    return all(a.travel_min <= q <= a.travel_max for a, q in zip(machine.axes, joints, strict=True))


def _joints(machine: Machine, tip: Vector, probe: Probe, place: tuple[float, ...]) -> tuple[float, ...]:
    kinematics = kinematics_of(machine)
    pair = (*place, 0.0, 0.0)[:2]
    x, y, z = kinematics.linear(tip, (pair[0], pair[1]), probe.length_mm)
    return tuple(float(q) for q in kinematics.arrange((x, y, z, *pair)))


def touches_at(machine: Machine, sphere: Sphere, probe: Probe, place: tuple[float, ...]) -> Touches:
    """Five touches as they would be: along the tool and at four sides of it, square to the sphere."""
    kinematics = kinematics_of(machine)
    axis = kinematics.forward(_joints(machine, sphere.centre, probe, place), probe.length_mm).axis
    side = (
        unit(add(sphere.stem, scale(axis, -dot(sphere.stem, axis))))
        if abs(dot(sphere.stem, axis)) < 0.9
        else None
    )
    one = side or _across(axis)
    normals = [axis, *(rotate(axis, k * math.pi / 2.0, one) for k in range(4))]
    reach = sphere.radius_mm + probe.radius_mm
    joints = [_joints(machine, add(sphere.centre, scale(n, reach)), probe, place) for n in normals]
    nearer = [_joints(machine, add(sphere.centre, scale(n, 0.9 * reach)), probe, place) for n in normals]
    linear = list(machine.linear())
    ways = (np.array(nearer) - np.array(joints))[:, linear]
    ways = ways / np.linalg.norm(ways, axis=1)[:, None]
    senses = np.ones((len(normals), len(machine.axes)))
    senses[:, linear] = np.where(np.abs(ways) > 0.02, np.sign(ways), 1.0)
    count = len(normals)
    flat = np.full(count, probe.length_mm), np.full(count, probe.radius_mm)
    return Touches(np.array(joints), ways, *flat, senses, ("sphere",) * count)


def _across(axis: Vector) -> Vector:
    least = min(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), key=lambda v: abs(dot(v, axis)))
    across = add(least, scale(axis, -dot(least, axis)))
    return scale(across, 1.0 / norm(across))
