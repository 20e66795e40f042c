"""The search for the fastest law over stretches that run through, from rest or from a state of motion.

Limits from exact derivatives on a mesh, the fastest w(x) on it (``barrier``), a law of
constant jerks through the nodes, and then a dense check of that law. Where a limit is
exceeded between nodes it is tightened there and the search runs again; what is left in
the end is removed by slowing the whole law evenly, which scales velocity, acceleration
and jerk by 1, 2 and 3 powers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from controller.handoff import Law, Quintic
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.plan import barrier, mesh
from controller.plan.law import at_share, split, through
from controller.plan.limits import Derivatives, JointLimits, derivatives, ramp_length
from controller.plan.mesh import BELL_NODES
from controller.plan.path import Stretch

Array = npt.NDArray[np.float64]

MARGIN = 0.998  # of each limit, for what differences on nodes do not see
TIGHTEN_ROUNDS = 8
TIGHTEN_POWER = 1.2
WARM_GAP = 0.05  # of the time, where a search starts from the last one
FINE_VELOCITY, FINE_ACCELERATION, FINE_JERK = 1.0002, 1.0005, 1.015  # good enough between nodes
RESIDUAL_JERK = 1.10  # at single places after all rounds, rather than leave the feed
SPACING = 0.2  # of the even nodes, mm; ramps have their own
NODES_EVEN = (60, 400)  # at least and at most
FINE_SPACING = 0.03  # of the samples that look for narrow places, mm
MOST_NARROW = 12  # of these get nodes of their own
ONSET_NODES = 80
RELAX = 1.02  # a limit that the old law meets is given this much room to begin with
TINY = 1e-30


def feed_of(stretch: Stretch, override: float) -> float:
    """The programmed feed at an override (1.0 = 100 %); a rapid has none."""
    return math.inf if stretch.feed_mm_s is None else stretch.feed_mm_s * override


def limits_of(stretch: Stretch, machine: Machine) -> JointLimits:
    """What a stretch may use of the joints' limits."""
    return JointLimits.of(machine, MARGIN * (machine.rapid_share if stretch.feed_mm_s is None else 1.0))


def junction_speed(before: Stretch, after: Stretch, machine: Machine, kinematics: Kinematics) -> float:
    """Speed at which the jump of rates between two stretches fits into one tick."""
    left = derivatives(before, np.array([before.motion.end]), kinematics)
    right = derivatives(after, np.array([0.0]), kinematics)
    return limits_of(before, machine).junction_speed(left, right, machine.period_s)


@dataclass(frozen=True, slots=True)
class Begin:
    """A state of motion to go on from: place in the run, speed, acceleration, and the law so far."""

    s: float
    v: float
    a: float
    speed_at: Callable[[Array], Array]  # of the law so far, at places from ``s`` to the run's end


@dataclass(slots=True)
class _Node:
    """Which stretch each node of the mesh lies in, and how far along it."""

    index: npt.NDArray[np.intp]
    local: Array


@dataclass(frozen=True, slots=True)
class Excess:
    """Largest share of each limit about each node, per joint, (n + 1, 5); 1.0 is the limit itself."""

    velocity: Array
    acceleration: Array
    jerk: Array

    def slowing(self, jerk: float = FINE_JERK) -> float:
        """Factor on time that would bring everything inside; at most 1.0 where nothing is exceeded."""
        return max(
            float(self.velocity.max()) / FINE_VELOCITY,
            math.sqrt(float(self.acceleration.max()) / FINE_ACCELERATION),
            float(np.cbrt(self.jerk.max() / jerk)),
        )


class Search:
    """The search for the fastest law over stretches that run through."""

    def __init__(
        self,
        run: tuple[Stretch, ...],
        machine: Machine,
        kinematics: Kinematics,
        override: float,
        begin: Begin | None = None,
    ) -> None:
        """From rest at the run's start, or from ``begin``."""
        self._begin = begin
        self.run, self.machine, self.kinematics = run, machine, kinematics
        self.limits = [limits_of(stretch, machine) for stretch in run]
        self.feeds = np.array([feed_of(stretch, override) for stretch in run])
        self.starts = np.concatenate([[0.0], np.cumsum([stretch.motion.end for stretch in run])])
        self.length = float(self.starts[-1])
        self.junctions = [
            junction_speed(before, after, machine, kinematics) for before, after in itertools.pairwise(run)
        ]
        self.mesh = self._make_mesh()
        self.at_nodes = self._derive(self.mesh.nodes.s)

    def laws(self) -> list[Law]:
        rows = self._rows()
        w = barrier.solve(rows, barrier.start(rows))
        best: tuple[float, Array, Array] = (math.inf, w, w)
        for _ in range(TIGHTEN_ROUNDS):
            times, pieces = self._law(rows, w)
            excess = self._excess(times, pieces)
            best = min(best, (excess.slowing(), times, pieces), key=lambda one: one[0])
            if best[0] <= 1.0:
                break
            rows = _tightened(rows, excess)
            w = barrier.solve(rows, barrier.feasible(rows, w, 0.9), WARM_GAP)
        return split(*self._slowed(*best[1:]), self.starts)

    def laws_from_motion(self) -> list[Law] | None:
        """Laws from ``begin`` on; None where the old law cannot be left smoothly.

        The old law, a little slowed further on, is the feasible start that every search
        needs. At the beginning it cannot be slowed; a limit that it meets there is given
        a little room, so that it is feasible strictly.
        """
        old, rows = self._old_law(), self._rows()
        best: tuple[float, Array, Array] = (math.inf, old, old)
        for _ in range(TIGHTEN_ROUNDS):
            w = _slowed_further_on(rows, old)
            times, pieces = self._law(rows, barrier.solve(_relaxed(rows, w), w))
            excess = self._excess(times, pieces)
            best = min(best, (excess.slowing(), times, pieces), key=lambda one: one[0])
            if best[0] <= 1.0:
                break
            rows = _tightened(rows, excess)
        fits = self._excess(*best[1:]).slowing(RESIDUAL_JERK) <= 1.0
        return split(*best[1:], self.starts) if fits else None

    def _old_law(self) -> Array:
        """w of the law so far; its first two nodes carry exactly the speed and acceleration of ``begin``."""
        begin, m = self._begin, self.mesh.nodes
        assert begin is not None
        v = np.maximum(begin.speed_at(m.s), TINY)
        w = np.where(m.s_x > 0.0, (v / np.maximum(m.s_x, TINY)) ** 2, 0.0)
        w[-1] = w[-2]  # at rest w goes on evenly
        w[0] = (begin.v / m.s_x[0]) ** 2
        w[1] = w[0] + 2.0 * (begin.a - m.s_xx[0] * w[0]) / m.s_x[0]
        return np.asarray(w)

    # --- mesh and limits on it

    def _make_mesh(self) -> mesh.Mesh:
        first = self._begin.s if self._begin else 0.0
        left = self.length - first
        samples = np.linspace(first, self.length, int(min(max(left / FINE_SPACING, 200), 4000)))
        d = self._derive(samples)
        limits = self.limits[0]
        speed = np.minimum(limits.path_speed(d), self.feeds[self._nodes(samples).index])
        jerk = limits.path_jerk(d)
        typical = float(np.median(speed))

        def ramp(at: int) -> float:
            return max(ramp_length(float(speed[at]), float(jerk[at])), 1e-6 * self.length)

        bells = _narrow_places(samples - first, speed)
        bells += [
            bell
            for at, low in zip(self.starts[1:-1] - first, self.junctions, strict=True)
            if low < 3.0 * typical and at > 0.0
            for bell in self._bells(float(at), low, typical, float(jerk.min()))
        ]
        if self._begin:
            bells.append(mesh.Bell(0.0, min(ramp(0), left / 4.0)))
        even = min(max(left / SPACING, NODES_EVEN[0]), NODES_EVEN[1])
        made = mesh.make(left, left / even, None if self._begin else ramp(0), ramp(-1), bells)
        return made.moved(first)

    def _bells(self, at: float, low: float, typical: float, jerk: float) -> list[mesh.Bell]:
        """Nodes about a slow place: from the whole ramp down to where the speed is near ``low``.

        At constant jerk v grows from ``low`` with the square of time, so the lowest
        speeds fill only low sqrt(2 low / j) of path and need bells of their own.
        """
        drop = max(typical - low, 0.05 * typical)
        width = min(math.sqrt(drop / jerk) * (typical + low) / 2.0, self.length / 4.0)
        least = min(low * math.sqrt(2.0 * low / jerk), width)
        bells = [mesh.Bell(at, width)]
        while width > least:
            width /= 3.0
            bells.append(mesh.Bell(at, width))
        return bells

    def _nodes(self, s: Array) -> _Node:
        index = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.run) - 1)
        return _Node(index, s - self.starts[index])

    def _derive(self, s: Array) -> Derivatives:
        node = self._nodes(s)
        found = [np.empty((len(s), 5)) for _ in range(3)]
        for k, stretch in enumerate(self.run):
            here = node.index == k
            if here.any():
                d = derivatives(stretch, np.clip(node.local[here], 0.0, stretch.motion.end), self.kinematics)
                found[0][here], found[1][here], found[2][here] = d.first, d.second, d.third
        return Derivatives(*found)

    def _by_node(self, s: Array, which: str) -> Array:
        return np.asarray(np.array([getattr(limit, which) for limit in self.limits])[self._nodes(s).index])

    def _rows(self) -> barrier.Rows:
        m, d = self.mesh.nodes, self.at_nodes
        s_x, s_xx, s_xxx = m.s_x[:, None], m.s_xx[:, None], m.s_xxx[:, None]
        q_x = d.first * s_x
        q_xx = d.second * s_x**2 + d.first * s_xx
        q_xxx = d.third * s_x**3 + 3.0 * d.second * s_x * s_xx + d.first * s_xxx
        speed = np.minimum(
            self._feed_at_nodes(), (self._by_node(m.s, "velocity") / (np.abs(d.first) + TINY)).min(axis=1)
        )
        acceleration, jerk = self._by_node(m.s, "acceleration"), self._by_node(m.s, "jerk")
        for at, low in zip(self.starts[1:-1], self.junctions, strict=True):
            near = np.abs(m.s - at) <= max(3.0 * low * self.machine.period_s, 0.0)
            after = int(np.searchsorted(m.s, at))
            near[after - 1 : after + 1] = True
            speed[near] = np.minimum(speed[near], low)
            jerk[near] *= 0.5
        cap = np.where(m.s_x > 0.0, (speed / np.maximum(m.s_x, TINY)) ** 2, np.inf)
        cap[np.isinf(cap)] = 1e3 * cap[np.isfinite(cap)].max()
        return barrier.Rows(q_x, q_xx, q_xxx, acceleration, jerk, cap, held=2 if self._begin else 0)

    def _feed_at_nodes(self) -> Array:
        """The feed at each node; a node beside a junction keeps to the lower of both feeds."""
        index = self._nodes(self.mesh.nodes.s).index
        feed = self.feeds[index]
        before, after = np.concatenate([index[:1], index[:-1]]), np.concatenate([index[1:], index[-1:]])
        return np.asarray(np.minimum(feed, np.minimum(self.feeds[before], self.feeds[after])))

    def _law(self, rows: barrier.Rows, w: Array) -> tuple[Array, Array]:
        """Times and pieces of the law that ``w`` stands for.

        Read as coefficients of a quadratic spline over the intervals i - 1/2 .. i + 1/2, w has
        in each interval just the w_xx of its row, so the law jerks where and as much as the
        search allowed it. At the joints, w is the mean of its neighbours and w_x their difference.
        """
        m, feed = self.mesh.joints, self._feed_at_nodes()
        inner = m.s_x[1:-1]
        mean, slope = 0.5 * (w[1:] + w[:-1]), np.diff(w)
        v, a = np.zeros(len(m.s)), np.zeros(len(m.s))
        v[1:-1] = inner * np.sqrt(mean)
        a[1:-1] = m.s_xx[1:-1] * mean + 0.5 * inner * slope
        lower = np.minimum(feed[1:], feed[:-1])
        at_feed = self._at_feed(w, feed)
        met, edge = np.zeros((2, len(v)), dtype=bool)
        met[1:-1] = at_feed[1:] & at_feed[:-1]
        edge[1:-1] = at_feed[1:] ^ at_feed[:-1]
        # Beside an even stretch v^2 is the function that is smooth there, not w.
        nodes = self.mesh.nodes
        squares = nodes.s_x**2 * w
        v[edge] = np.sqrt(0.5 * (squares[1:] + squares[:-1]))[edge[1:-1]]
        a[edge] = (0.5 * np.diff(squares) / np.diff(nodes.s))[edge[1:-1]]
        met[1:-1] |= v[1:-1] >= lower * (1.0 - 3e-5)
        v[1:-1] = np.where(met[1:-1], lower, v[1:-1])
        a[met] = 0.0
        a = self._without_overshoot(v, a, met)
        if self._begin:
            v[0], a[0] = self._begin.v, self._begin.a
        return through(m.s, v, a)

    def _at_feed(self, w: Array, feed: Array) -> npt.NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):
            return np.asarray(self.mesh.nodes.s_x * np.sqrt(w) >= feed * (1.0 - 3e-5))

    def _without_overshoot(self, v: Array, a: Array, met: npt.NDArray[np.bool_]) -> Array:
        """Beside a joint that meets the feed, no more acceleration than can end there: 2 dv / dt."""
        step = np.diff(self.mesh.joints.s)
        most = 2.0 * np.abs(np.diff(v)) * np.maximum(v[1:], v[:-1]) / step
        a = a.copy()
        into, out = met[1:] & ~met[:-1], met[:-1] & ~met[1:]
        a[:-1][into] = np.clip(a[:-1][into], -most[into], most[into])
        a[1:][out] = np.clip(a[1:][out], -most[out], most[out])
        return a

    # --- the check between nodes

    def _excess(self, times: Array, pieces: Array) -> Excess:
        """How far each limit is exceeded within the nodes' intervals: factors per node and joint."""
        most = [np.zeros((len(pieces), 5)) for _ in range(3)]
        for share in (0.0, 0.5, 1.0):
            s, v, a, j = at_share(times, pieces, share)
            d = self._derive(np.clip(s, 0.0, self.length))
            asked = (d.velocity(v), d.acceleration(v, a), d.jerk(v, a, j))
            for k, which in enumerate(("velocity", "acceleration", "jerk")):
                most[k] = np.maximum(most[k], np.abs(asked[k]) / self._by_node(s, which))
        # Two pieces to an interval, an interval to a node.
        return Excess(*(MARGIN * np.maximum(over[0::2], over[1::2]) for over in most))

    def _slowed(self, times: Array, pieces: Array) -> tuple[Array, Array]:
        """The last resort: everything slower, until velocity and acceleration fit, and jerk nearly does."""
        factor = self._excess(times, pieces).slowing(RESIDUAL_JERK)
        if factor <= 1.0:
            return times, pieces
        return times * factor, pieces / factor ** np.arange(6)[None, :]


def _tightened(rows: barrier.Rows, excess: Excess) -> barrier.Rows:
    """Limits lowered where they were exceeded, and at the neighbours, to which the excess would move."""

    def less(over: Array) -> Array:
        wide = np.maximum(over, 1.0)
        wide[1:] = np.maximum(wide[1:], over[:-1] ** 0.5)
        wide[:-1] = np.maximum(wide[:-1], over[1:] ** 0.5)
        return np.asarray(wide**TIGHTEN_POWER)

    return replace(
        rows,
        acceleration=rows.acceleration / less(excess.acceleration),
        jerk=rows.jerk / less(excess.jerk),
        cap=rows.cap / less(excess.velocity).max(axis=1) ** 2,
    )


def _narrow_places(s: Array, speed: Array) -> list[mesh.Bell]:
    """Bells at the deepest local minima of the speed limit, as wide as the limit stays within a fifth."""
    inner = np.flatnonzero((speed[1:-1] < speed[:-2]) & (speed[1:-1] <= speed[2:])) + 1
    deepest = inner[np.argsort(speed[inner])][:MOST_NARROW]
    bells = []
    for i in deepest:
        above = np.abs(s[speed > 1.2 * speed[i]] - s[i])
        width = float(above.min()) if len(above) else math.inf
        if width < SPACING * BELL_NODES:
            bells.append(mesh.Bell(float(s[i]), max(width, FINE_SPACING)))
    return bells


def _slowed_further_on(rows: barrier.Rows, w: Array) -> Array:
    """``w`` brought inside the limits by an even factor that sets in over the first nodes."""
    onset = np.clip(np.arange(len(w)) / min(ONSET_NODES, len(w) // 3), 0.0, 1.0)
    onset = onset**3 * (10.0 - 15.0 * onset + 6.0 * onset**2)
    even = float(barrier.feasible(rows, w, 0.97).min() / w.min())
    return np.asarray(w * (1.0 - onset * (1.0 - min(max(even, 0.3), 0.97))))


def _relaxed(rows: barrier.Rows, w: Array) -> barrier.Rows:
    """Limits no closer to ``w`` than ``RELAX`` allows."""
    acceleration, jerk = barrier.stencils(rows)
    a = RELAX * np.abs(barrier.apply(acceleration, w))
    j = RELAX * np.abs(barrier.apply(jerk, w)) * np.sqrt(w)[:, None]
    return replace(
        rows,
        acceleration=np.maximum(rows.acceleration, a),
        jerk=np.maximum(rows.jerk, j),
        cap=np.maximum(rows.cap, RELAX * w),
    )


def _quintic(row: Array) -> Quintic:
    a, b, c, d, e, f = (float(x) for x in row)
    return (a, b, c, d, e, f)
