"""Rotary centres and directions from a sphere on the table, probed at many positions of the rotaries.

Every touch says: the centre of the ball is as far from the centre of the sphere as both radii together,

    | tip(joints + errors, chain) - sphere |  =  radius of the sphere + radius of the ball,

``tip`` by the machine's own kinematics (``Kinematics.forward``, table frame). Sought are of every rotary a
point and a direction (two numbers each: what lies along the axis tells nothing), the sphere's centre and its
radius. Beside them stand errors that are not sought but may not be taken for them: backlash of the axes,
scale, level and waves of their pitch. They are held near 0 by what is known of them (a prior), and what that
leaves open stands in the covariance.

So a bound of the report holds what it says: ``BOUND`` standard deviations of the covariance, pitch included.
Linear least squares with priors, repeated (Gauss-Newton); the covariance is that of ISO/IEC Guide 98-3-2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from controller.calibration.refusal import Refusal
from controller.calibration.touch_table import Touches, positions
from controller.geometry.arrays import Array
from controller.geometry.vectors import Number, Vector, X, Y, Z, add, cross, dot, norm, scale, unit
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Axis, Machine

BOUND = 4.0  # standard deviations
DOUBT = 5.0  # times the scatter: no touch is that far off
ROUNDS = 12  # of Gauss-Newton
DONE = 1e-3  # of a standard deviation: nothing moves any more
UNSEEN = 0.5  # of the prior's deviation: what is left above it was not seen by the touches
LEVER_MM = 100.0  # at which an angle counts as much as a length
STEP, TURN = 1e-4, 1e-6  # of difference quotients, mm and rad
FIRST_SCATTER_MM, MIN_SCATTER_MM = 1e-3, 1e-4
PITCHES_MM = (2e-4, 5e-4, 1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 32e-3)  # deviations that are tried
KNOTS = 9  # of a pitch error over what was visited of an axis
FEWEST_POSITIONS, FEWEST_TOUCHES = 3, 4  # and touches at each


@dataclass(frozen=True, slots=True)
class PriorDeviations:
    """What is known before: standard deviations of what the touches must tell apart."""

    scatter_mm: float = 0.0  # of a touch; 0: taken from the residuals
    point_mm: float = 2.0  # of a rotary's point in the file
    direction_rad: float = math.radians(0.5)
    backlash_mm: float = 0.01  # of an axis without a table
    backlash_rad: float = math.radians(0.005)
    scale: float = 3e-5  # of a linear axis without a pitch table, mm per mm
    pitch_mm: float | None = (
        None  # of an axis without one, at ``LEVER_MM`` of a rotary; None: as the touches say
    )
    tabled: float = 0.05  # share of all this that a table in the machine file leaves


@dataclass(frozen=True, slots=True)
class Unknown:
    """One number of the fit."""

    name: str  # "A.point.Y", "C.direction.X", "sphere.X", "radius", "X.backlash" ...
    prior: float  # standard deviation, mm or rad
    sought: bool  # it is asked for; else it only may not be taken for another


@dataclass(frozen=True, eq=False)
class Fit:
    """What the touches say."""

    machine: Machine  # with the rotaries as found
    unknowns: tuple[Unknown, ...]
    values: Array  # (p,), mm and rad
    covariance: Array  # (p, p)
    residuals: Array  # (N,) mm: how much too far the ball was from the sphere
    before: Array  # (N,) mm: the same with the file's rotaries
    spots: tuple[Spot, ...]
    scatter_mm: float  # of one touch, from the residuals
    sphere_mm: Vector  # table frame at zero
    radius_mm: float  # of the sphere
    basis: tuple[tuple[Vector, Vector], ...]  # by rotary: the two directions across it

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of every unknown."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @cached_property
    def correlation(self) -> Array:
        """(p, p), -1 to 1."""
        d = np.maximum(self.deviations, 1e-300)
        return np.asarray(self.covariance / np.outer(d, d))

    def correlated(self, above: float = 0.9) -> list[tuple[str, str, float]]:
        """Pairs of sought numbers that the touches hardly tell apart, worst first."""
        rows = [k for k, u in enumerate(self.unknowns) if u.sought]
        pairs = [(i, j, self.correlation[i, j]) for n, i in enumerate(rows) for j in rows[n + 1 :]]
        worst = sorted((p for p in pairs if abs(p[2]) > above), key=lambda p: -abs(p[2]))
        return [(self.unknowns[i].name, self.unknowns[j].name, float(c)) for i, j, c in worst]

    def unseen(self) -> list[str]:
        """Sought numbers of which the touches say nothing: they are as before."""
        rows = zip(self.unknowns, self.deviations, strict=True)
        return [u.name for u, d in rows if u.sought and d > UNSEEN * u.prior and u.prior < math.inf]

    def bounds(self) -> tuple[tuple[float, float], ...]:
        """By rotary: (mm, rad) within which its centre and direction are, ``BOUND`` deviations."""
        return tuple(Model.bound(self.covariance, k) for k in range(len(self.basis)))

    def doubtful(self) -> list[int]:
        """Touches (numbers from 0) that are further off than scatter explains: a chip, a wrong row."""
        return [int(k) for k in np.flatnonzero(np.abs(self.residuals) > DOUBT * self.scatter_mm)]


@dataclass(frozen=True, slots=True)
class Spot:
    """One position of the rotaries: how far the sphere seems to be from where it should be (mm)."""

    rotaries: tuple[float, ...]  # rad, carried
    touches: int
    before: float
    after: float


def fit(
    touches: Touches,
    machine: Machine,
    sphere_radius_mm: float,
    known: PriorDeviations = PriorDeviations(),
) -> Fit:
    """Rotaries of a machine from touches on one sphere. Raises Refusal where they are too few."""
    rotaries = machine.rotary()
    spots = positions(touches, rotaries)
    if not rotaries:
        raise Refusal("no_rotary", machine=machine.name)
    if len(spots) < FEWEST_POSITIONS or len(touches) < FEWEST_TOUCHES * len(spots):
        raise Refusal("too_few", touches=len(touches), positions=len(spots))
    model = Model(touches, machine, sphere_radius_mm, known)
    return _result(model, spots, _solve(model))


class Model:
    """The residuals as a function of all unknowns."""

    def __init__(self, touches: Touches, machine: Machine, radius_mm: float, known: PriorDeviations) -> None:
        self.touches, self.machine, self.known = touches, machine, known
        self.rotaries, self.linear = machine.rotary(), machine.linear()
        self.basis = tuple(across(machine.axes[i].direction) for i in self.rotaries)
        self.radius_mm = radius_mm
        self.shapes = [_shape(touches, machine, i) for i in range(len(machine.axes))]
        self.centre = np.zeros(3)
        for _ in range(5):  # where the sphere is by the file
            self.centre = self.centre + self._towards()

    @staticmethod
    def bound(covariance: Array, k: int) -> tuple[float, float]:
        """(mm, rad) of rotary ``k``: ``BOUND`` deviations in the worst direction across its axis."""
        blocks = (slice(4 * k, 4 * k + 2), slice(4 * k + 2, 4 * k + 4))
        point, tilt = (float(np.linalg.eigvalsh(covariance[one, one])[-1]) for one in blocks)
        return BOUND * math.sqrt(max(point, 0.0)), BOUND * math.sqrt(max(tilt, 0.0))

    def _towards(self) -> Array:
        """A step of the sphere's centre to where the balls stand about it."""
        apart = self.tips(self.machine, self.touches.joints) - self.centre
        if not self.centre.any():
            return np.asarray(apart.mean(axis=0))
        length = np.linalg.norm(apart, axis=1)
        missed = length - self.radius_mm - self.touches.radius_mm
        return np.asarray(np.linalg.lstsq(apart / length[:, None], missed, rcond=1e-6)[0])

    def unknowns(self, pitch_mm: float) -> tuple[Unknown, ...]:
        known, axes = self.known, self.machine.axes
        found: list[Unknown] = []
        for i, basis in zip(self.rotaries, self.basis, strict=True):
            names = [_named(v) for v in basis]
            found += [Unknown(f"{axes[i].name}.point.{n}", known.point_mm, True) for n in names]
            found += [Unknown(f"{axes[i].name}.direction.{n}", known.direction_rad, True) for n in names]
        found += [Unknown(f"sphere.{n}", math.inf, False) for n in "XYZ"]
        found.append(Unknown("radius", 0.1, False))
        for axis in axes:
            share = known.tabled if axis.pitch is not None else 1.0
            turns = axis.is_rotary
            lost = known.backlash_rad if turns else known.backlash_mm
            off = share * pitch_mm / (LEVER_MM if turns else 1.0)
            found += [
                Unknown(f"{axis.name}.backlash", share * lost, False),
                Unknown(f"{axis.name}.scale", off if turns else share * known.scale, False),
                Unknown(f"{axis.name}.level", off, False),
            ]
            found += [Unknown(f"{axis.name}.pitch.{k}", off, False) for k in range(KNOTS)]
        return tuple(found)

    def tips(self, machine: Machine, joints: Array) -> Array:
        kinematics = kinematics_of(machine)
        length_mm: Number = self.touches.length_mm
        tip, _ = kinematics.forward(list(joints.T), length_mm, np)
        return np.column_stack([np.broadcast_to(c, len(joints)) for c in tip])

    def chain(self, values: Array) -> Machine:
        """The machine with its rotaries moved by the first numbers of ``values``."""
        axes = list(self.machine.axes)
        for k, (i, basis) in enumerate(zip(self.rotaries, self.basis, strict=True)):
            axes[i] = moved(axes[i], basis, tuple(values[4 * k : 4 * k + 4]))
        return replace(self.machine, axes=tuple(axes))

    def apart(self, values: Array, shift: Array | float = 0.0) -> Array:
        """(N, 3) from the centre of the sphere to that of the ball, table frame."""
        n = 4 * len(self.rotaries)
        joints, at = self.touches.joints + shift, n + 4
        for i, shape in enumerate(self.shapes):
            joints[:, i] += shape @ values[at : at + shape.shape[1]]
            at += shape.shape[1]
        return np.asarray(self.tips(self.chain(values), joints) - self.centre - values[n : n + 3])

    def residuals(self, values: Array, shift: Array | float = 0.0) -> Array:
        both = self.radius_mm + values[4 * len(self.rotaries) + 3] + self.touches.radius_mm
        return np.asarray(np.linalg.norm(self.apart(values, shift), axis=1) - both)

    def jacobian(self, values: Array) -> Array:
        """(N, p): by differences of the rotaries and of the joints; the rest follows from those."""
        n, count = 4 * len(self.rotaries), len(self.touches)
        columns = [self._slope(values, k, STEP if k % 4 < 2 else TURN) for k in range(n)]
        toward = self.apart(values)
        columns += [*-(toward / np.linalg.norm(toward, axis=1)[:, None]).T, -np.ones(count)]
        for i, (axis, shape) in enumerate(zip(self.machine.axes, self.shapes, strict=True)):
            columns += list(
                (self._joint_slope(values, i, TURN if axis.is_rotary else STEP)[:, None] * shape).T
            )
        return np.column_stack(columns)

    def _slope(self, values: Array, k: int, h: float) -> Array:
        step = np.zeros(len(values))
        step[k] = h
        return (self.residuals(values + step) - self.residuals(values - step)) / (2.0 * h)

    def _joint_slope(self, values: Array, i: int, h: float) -> Array:
        step = np.zeros(len(self.machine.axes))
        step[i] = h
        return (self.residuals(values, step) - self.residuals(values, -step)) / (2.0 * h)


def _shape(touches: Touches, machine: Machine, i: int) -> Array:
    """(N, 3 + KNOTS): what one unit of backlash, scale, level and of each knot adds to an axis."""
    q, axis = touches.joints[:, i], machine.axes[i]
    low, high = float(q.min()), float(q.max())
    knots = np.linspace(low, high, KNOTS) if high - low > 1e-6 else np.full(KNOTS, low) + np.arange(KNOTS)
    place = np.clip((q - knots[0]) / (knots[1] - knots[0]), 0.0, KNOTS - 1.0)
    hats = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(KNOTS)))
    away = (q - axis.homing.position)[:, None]
    return np.hstack([-0.5 * touches.senses[:, [i]], away, np.ones((len(q), 1)), hats])


def across(direction: Vector) -> tuple[Vector, Vector]:
    """Two directions across an axis, of the machine's own where it stands along one of them."""
    d = unit(direction)
    one = min((X, Y, Z), key=lambda v: abs(dot(v, d)))
    e1 = add(one, scale(d, -dot(one, d)))
    e1 = scale(e1, 1.0 / norm(e1))
    return e1, cross(d, e1)


def _named(v: Vector) -> str:
    """A direction in a word: X where it is along X, else its components."""
    for name, component in zip("XYZ", v, strict=True):
        if abs(abs(component) - 1.0) < 1e-6:
            return name
    return "({:.2f} {:.2f} {:.2f})".format(*v)


def moved(axis: Axis, basis: tuple[Vector, Vector], by: tuple[float, ...]) -> Axis:
    """A rotary with its point (mm) and its direction (rad) moved along the two directions across it."""
    (e1, e2), (a, b, s, t) = basis, (float(x) for x in by)
    point = add(axis.point_mm, add(scale(e1, a), scale(e2, b)))
    direction = unit(add(unit(axis.direction), add(scale(e1, math.tan(s)), scale(e2, math.tan(t)))))
    return replace(axis, point_mm=point, direction=direction)


# ---- the fit -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Solved:
    unknowns: tuple[Unknown, ...]
    values: Array
    covariance: Array
    scatter: float  # of a touch, mm
    likelihood: float  # log, less a constant


def _solve(model: Model) -> _Solved:
    """Gauss-Newton. With every round the pitch errors are taken as large as the touches make likeliest."""
    known, pitches = model.known, PITCHES_MM if model.known.pitch_mm is None else (model.known.pitch_mm,)
    values = np.zeros(len(model.unknowns(0.0)))
    scatter = known.scatter_mm or FIRST_SCATTER_MM
    for _ in range(ROUNDS):
        r, J = model.residuals(values), model.jacobian(values)
        tried = (
            _linear(r, J, values, model.unknowns(pitch), scatter, not known.scatter_mm) for pitch in pitches
        )
        best = max(tried, key=lambda one: one.likelihood)
        step, values, scatter = best.values - values, best.values, best.scatter
        if np.all(np.abs(step) < DONE * np.sqrt(np.diag(best.covariance))):
            break
    return best


def _linear(
    r: Array, J: Array, at: Array, unknowns: tuple[Unknown, ...], scatter: float, is_sought: bool
) -> _Solved:
    """Least squares with priors about ``at``; the scatter of the touches with it where it ``is_sought``."""
    weights = np.array([0.0 if math.isinf(u.prior) else 1.0 / max(u.prior, 1e-12) for u in unknowns]) ** 2
    square, pull = J.T @ J, J.T @ (r - J @ at)
    for _ in range(8 if is_sought else 1):
        covariance = np.linalg.inv(square / scatter**2 + np.diag(weights))
        values = -covariance @ (pull / scatter**2)
        left = r + J @ (values - at)
        chi = float(left @ left)
        free = len(r) - float(np.einsum("ij,ji->", square, covariance)) / scatter**2
        if not is_sought:
            break
        before, scatter = scatter, max(math.sqrt(chi / max(free, 1.0)), MIN_SCATTER_MM)
        if abs(scatter - before) < 1e-3 * before:
            break
    bounded = weights > 0.0
    sizes = -float(np.log(weights[bounded]).sum()) + 2.0 * len(r) * math.log(scatter)
    pulled = chi / scatter**2 + float((values**2 * weights).sum())
    likelihood = -0.5 * (pulled + sizes - float(np.linalg.slogdet(covariance)[1]))
    return _Solved(unknowns, np.asarray(values), np.asarray(covariance), scatter, likelihood)


def _result(
    model: Model,
    rows: list[NDArray[np.int64]],
    solved: _Solved,
) -> Fit:
    n, values = 4 * len(model.rotaries), solved.values
    after, before = model.residuals(values), _by_the_file(model, values)
    normals = model.apart(values)
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    spots = tuple(
        Spot(
            tuple(float(q) for q in model.touches.joints[one[0], list(model.rotaries)]),
            len(one),
            _displaced(normals[one], before[one]),
            _displaced(normals[one], after[one]),
        )
        for one in rows
    )
    sphere = tuple(float(c) for c in model.centre + values[n : n + 3])
    return Fit(
        model.chain(values),
        solved.unknowns,
        values,
        solved.covariance,
        after,
        before,
        spots,
        solved.scatter,
        (sphere[0], sphere[1], sphere[2]),
        model.radius_mm + float(values[n + 3]),
        model.basis,
    )


def _by_the_file(model: Model, values: Array) -> Array:
    """Residuals where only the sphere is fitted, by the rotaries of the file."""
    n = 4 * len(model.rotaries)
    plain = np.zeros(len(values))
    for _ in range(4):
        r, J = model.residuals(plain), np.empty((len(model.touches), 4))
        for k in range(4):
            step = np.zeros(len(values))
            step[n + k] = STEP
            J[:, k] = (model.residuals(plain + step) - model.residuals(plain - step)) / (2.0 * STEP)
        plain[n : n + 4] -= np.linalg.lstsq(J, r, rcond=1e-9)[0]
    return model.residuals(plain)


def _displaced(normals: Array, residuals: Array) -> float:
    """How far the sphere's centre is off at one position, by its touches."""
    return float(np.linalg.norm(np.linalg.lstsq(normals, residuals, rcond=1e-3)[0]))
