"""Motion laws: how far along each stretch at which time, as fast as every limit allows.

A straight move with constant limits has the classic closed form (``straight``).
Everything else goes through ``plan``: limits from exact derivatives on a mesh,
the fastest w(x) on it, a law s(t) of constant jerks through the nodes, and then a
dense check of that law. Where a limit is exceeded between nodes it is tightened
there and the search runs again; what is left in the end is removed by slowing the
whole law evenly, which scales velocity, acceleration and jerk by 1, 2 and 3 powers.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.handoff import Law, Quintic
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.motions import JointMove
from controller.plan import barrier, mesh
from controller.plan.law import at_share, joined, shifted, straight, through, time_of, value
from controller.plan.limits import Derivatives, JointLimits, derivatives, ramp_length
from controller.plan.path import Chain, Stretch

Array = npt.NDArray[np.float64]

MARGIN = 0.998  # of each limit, for what differences on nodes do not see
TIGHTEN_ROUNDS = 8
TIGHTEN_POWER = 1.2
WARM_GAP = 0.05  # of the time, where a search starts from the last one
FINE_ACCELERATION, FINE_JERK = 1.0005, 1.015  # of the limits: good enough between nodes
STOP_SHARE = 0.03  # a junction that must be passed slower than this share of the feed is a stop
SPACING = 0.2  # of the even nodes, mm; ramps have their own
NODES_EVEN = (60, 400)  # at least and at most
EVEN_SHARE = 0.8  # of each limit left for the ramps of a curved stretch at even feed
EVEN_SAMPLES = 400
TINY = 1e-30


def plan(chain: Chain, machine: Machine, kinematics: Kinematics, override: float = 1.0) -> list[Law]:
    """One law for each stretch of a chain, from rest to rest.

    ``override`` scales the feeds (1.0 = as programmed), not the limits.
    """
    laws: list[Law] = []
    for run in _runs(chain, machine, kinematics, override):
        closed = None
        if len(run) == 1:
            closed = _straight_run(run[0], machine, override) or _even_run(
                run[0], machine, kinematics, override
            )
        laws += [closed] if closed else _Run(run, machine, kinematics, override).laws()
    return laws


def _feed(stretch: Stretch, override: float) -> float:
    return math.inf if stretch.feed_mm_s is None else stretch.feed_mm_s * override


def _limits(stretch: Stretch, machine: Machine) -> JointLimits:
    return JointLimits.of(machine, MARGIN * (machine.rapid_share if stretch.feed_mm_s is None else 1.0))


# --- closed forms ---------------------------------------------------------


def _straight_run(stretch: Stretch, machine: Machine, override: float) -> Law | None:
    """The closed form, where q' is constant over the whole stretch."""
    move = stretch.motion
    if not isinstance(move, JointMove):
        return None
    ends = np.array([0.0, 1.0])
    if any(np.any(np.asarray(c) != 0.0) for c in move.curve.derivative(ends, 2, np)):
        return None
    rate = np.abs(np.subtract(stretch.end, stretch.start)) / move.end + TINY
    limits = _limits(stretch, machine)
    return straight(
        move.end,
        min(_feed(stretch, override), float((limits.velocity / rate).min())),
        float((limits.acceleration / rate).min()),
        float((limits.jerk / rate).min()),
    )


def _even_run(stretch: Stretch, machine: Machine, kinematics: Kinematics, override: float) -> Law | None:
    """The closed form for a curved stretch on which the feed alone costs little of any limit.

    With v = F throughout and the largest derivatives of the stretch, what is left of A and
    J is a constant path acceleration and jerk for both ramps. None where less than
    ``EVEN_SHARE`` of a limit is left: there the search gains time.
    """
    feed, limits = _feed(stretch, override), _limits(stretch, machine)
    if not math.isfinite(feed):
        return None
    d = derivatives(stretch, np.linspace(0.0, stretch.motion.end, EVEN_SAMPLES), kinematics)
    m1, m2, m3 = (np.abs(q).max(axis=0) + TINY for q in (d.first, d.second, d.third))
    room_a = limits.acceleration - m2 * feed**2
    acceleration = float((room_a / m1).min())
    room_j = limits.jerk - m3 * feed**3 - 3.0 * m2 * feed * acceleration
    tight = (m1 * feed > limits.velocity).any() or (room_a < EVEN_SHARE * limits.acceleration).any()
    if tight or (room_j < EVEN_SHARE * limits.jerk).any():
        return None
    return straight(stretch.motion.end, feed, acceleration, float((room_j / m1).min()))


# --- runs of a chain ----------------------------------------------------------


def _runs(
    chain: Chain, machine: Machine, kinematics: Kinematics, override: float
) -> list[tuple[Stretch, ...]]:
    """The chain cut at junctions so sharp that passing them is no faster than stopping."""
    runs: list[list[Stretch]] = [[chain.stretches[0]]]
    for before, after in itertools.pairwise(chain.stretches):
        speed = _junction_speed(before, after, machine, kinematics)
        if speed < STOP_SHARE * min(_feed(before, override), _feed(after, override), 1e6):
            runs.append([after])
        else:
            runs[-1].append(after)
    return [tuple(run) for run in runs]


def _junction_speed(before: Stretch, after: Stretch, machine: Machine, kinematics: Kinematics) -> float:
    left = derivatives(before, np.array([before.motion.end]), kinematics)
    right = derivatives(after, np.array([0.0]), kinematics)
    return _limits(before, machine).junction_speed(left, right, machine.period_s)


@dataclass(slots=True)
class _Node:
    """Which stretch each node of the mesh lies in, and how far along it."""

    index: npt.NDArray[np.intp]
    local: Array


class _Run:
    """The search for the fastest law over stretches that run through."""

    def __init__(
        self, run: tuple[Stretch, ...], machine: Machine, kinematics: Kinematics, override: float
    ) -> None:
        self.run, self.machine, self.kinematics = run, machine, kinematics
        self.limits = [_limits(stretch, machine) for stretch in run]
        self.feeds = np.array([_feed(stretch, override) for stretch in run])
        self.starts = np.concatenate([[0.0], np.cumsum([stretch.motion.end for stretch in run])])
        self.length = float(self.starts[-1])
        self.junctions = [
            _junction_speed(before, after, machine, kinematics) for before, after in itertools.pairwise(run)
        ]
        self.mesh = self._make_mesh()
        self.at_nodes = self._derive(self.mesh.s)

    def laws(self) -> list[Law]:
        rows = self._rows()
        w = barrier.solve(rows, barrier.start(rows))
        times, pieces = through(self.mesh.s, *self._speeds(w))
        for _ in range(TIGHTEN_ROUNDS):
            over_a, over_j = self._excess(times, pieces)
            if float(over_a.max()) <= FINE_ACCELERATION and float(over_j.max()) <= FINE_JERK:
                break
            rows = _tightened(rows, over_a, over_j)
            w = barrier.solve(rows, barrier.feasible(rows, w, 0.9), WARM_GAP)
            times, pieces = through(self.mesh.s, *self._speeds(w))
        times, pieces = self._slowed(times, pieces)
        return self._split(times, pieces)

    # --- mesh and limits on it

    def _make_mesh(self) -> mesh.Mesh:
        samples = np.linspace(0.0, self.length, 200)
        d = self._derive(samples)
        limits = self.limits[0]
        speed = np.minimum(limits.path_speed(d), self.feeds[self._nodes(samples).index])
        jerk = limits.path_jerk(d)
        typical = float(np.median(speed))

        def ramp(at: int) -> float:
            return max(ramp_length(float(speed[at]), float(jerk[at])), 1e-6 * self.length)

        bells = [
            bell
            for at, low in zip(self.starts[1:-1], self.junctions, strict=True)
            if low < 3.0 * typical
            for bell in self._bells(float(at), low, typical, float(jerk.min()))
        ]
        even = min(max(self.length / SPACING, NODES_EVEN[0]), NODES_EVEN[1])
        return mesh.make(self.length, self.length / even, ramp(0), ramp(-1), bells)

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
        m, d = self.mesh, self.at_nodes
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
        return barrier.Rows(q_x, q_xx, q_xxx, acceleration, jerk, cap)

    def _feed_at_nodes(self) -> Array:
        """The feed at each node; a node beside a junction keeps to the lower of both feeds."""
        index = self._nodes(self.mesh.s).index
        feed = self.feeds[index]
        before, after = np.concatenate([index[:1], index[:-1]]), np.concatenate([index[1:], index[-1:]])
        return np.asarray(np.minimum(feed, np.minimum(self.feeds[before], self.feeds[after])))

    def _speeds(self, w: Array) -> tuple[Array, Array]:
        """v and a at the nodes; where the feed is reached it is met exactly."""
        m = self.mesh
        w_x = np.zeros_like(w)
        w_x[1:-1] = 0.5 * (w[2:] - w[:-2])
        v, a = m.s_x * np.sqrt(w), m.s_xx * w + 0.5 * m.s_x * w_x
        feed = self._feed_at_nodes()
        with np.errstate(invalid="ignore"):
            met = v >= feed * (1.0 - 3e-5)
        v = np.where(met, feed, v)
        even = met.copy()
        even[1:-1] = met[1:-1] & met[:-2] & met[2:]
        a = np.where(even & (m.s_x > 0.0), 0.0, a)
        return v, a

    # --- the check between nodes

    def _excess(self, times: Array, pieces: Array) -> tuple[Array, Array]:
        """How far acceleration and jerk exceed their limits between the nodes: factor per node and joint."""
        over = [np.zeros((len(pieces), 5)) for _ in range(2)]
        for share in (0.0, 0.5, 1.0):
            s, v, a, j = at_share(times, pieces, share)
            d = self._derive(np.clip(s, 0.0, self.length))
            ratio_a = np.abs(d.acceleration(v, a)) / self._by_node(s, "acceleration")
            ratio_j = np.abs(d.jerk(v, a, j)) / self._by_node(s, "jerk")
            over = [np.maximum(over[0], ratio_a), np.maximum(over[1], ratio_j)]
        at_nodes = []
        for o in over:
            between = np.maximum(o[0::2], o[1::2])
            rim = np.zeros((1, 5))
            at_nodes.append(MARGIN * np.maximum(np.vstack([between, rim]), np.vstack([rim, between])))
        return at_nodes[0], at_nodes[1]

    def _slowed(self, times: Array, pieces: Array) -> tuple[Array, Array]:
        over_a, over_j = self._excess(times, pieces)
        worst_a, worst_j = float(over_a.max()) / FINE_ACCELERATION, float(over_j.max()) / FINE_JERK
        factor = max(math.sqrt(worst_a), float(np.cbrt(worst_j)))
        if factor <= 1.0:
            return times, pieces
        return times * factor, pieces / factor ** np.arange(6)[None, :]

    # --- laws of the stretches

    def _split(self, times: Array, pieces: Array) -> list[Law]:
        laws = []
        knots = [0.0]
        rows: list[Quintic] = []
        k, base = 0, 0.0
        for i in range(len(pieces)):
            row, t0, t1 = _quintic(pieces[i]), float(times[i]), float(times[i + 1])
            while k < len(self.run) - 1 and value(row, t1 - t0) > self.starts[k + 1]:
                cut = time_of(row, float(self.starts[k + 1]), t1 - t0)
                if cut > 0.0:
                    rows.append(shifted(row, 0.0, float(self.starts[k])))
                    knots.append(t0 + cut - base)
                laws.append(joined(knots, rows))
                row, t0 = shifted(row, cut, 0.0), t0 + cut
                k, base, knots, rows = k + 1, t0, [0.0], []
            rows.append(shifted(row, 0.0, float(self.starts[k])))
            knots.append(t1 - base)
        laws.append(joined(knots, rows))
        return laws


def _tightened(rows: barrier.Rows, over_a: Array, over_j: Array) -> barrier.Rows:
    """Limits lowered where they were exceeded, and at the neighbours, to which the excess would move."""

    def less(over: Array) -> Array:
        wide = np.maximum(over, 1.0)
        wide[1:] = np.maximum(wide[1:], over[:-1] ** 0.5)
        wide[:-1] = np.maximum(wide[:-1], over[1:] ** 0.5)
        return np.asarray(wide**TIGHTEN_POWER)

    a, j = rows.acceleration / less(over_a), rows.jerk / less(over_j)
    return barrier.Rows(rows.q_x, rows.q_xx, rows.q_xxx, a, j, rows.cap)


def _quintic(row: Array) -> Quintic:
    a, b, c, d, e, f = (float(x) for x in row)
    return (a, b, c, d, e, f)
