"""Motion laws: how far along each stretch at which time, as fast as every limit allows.

A straight move with constant limits has the classic closed form (``straight``).
Everything else goes through ``plan``: limits from exact derivatives on a mesh,
the fastest w(x) on it, a law s(t) of constant jerks through the nodes, and then a
dense check of that law. Where a limit is exceeded between nodes it is tightened
there and the search runs again; what is left in the end is removed by slowing the
whole law evenly, which scales velocity, acceleration and jerk by 1, 2 and 3 powers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.handoff import Law
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.motions import JointMove
from controller.plan import barrier, mesh
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
TINY = 1e-30


def plan(chain: Chain, machine: Machine, kinematics: Kinematics, override: float = 1.0) -> list[Law]:
    """One law for each stretch of a chain, from rest to rest.

    ``override`` scales the feeds (1.0 = as programmed), not the limits.
    """
    laws: list[Law] = []
    for run in _runs(chain, machine, kinematics, override):
        straight_law = _straight_run(run, machine, override)
        laws += [straight_law] if straight_law else _Run(run, machine, kinematics, override).laws()
    return laws


def _feed(stretch: Stretch, override: float) -> float:
    return math.inf if stretch.feed_mm_s is None else stretch.feed_mm_s * override


def _limits(stretch: Stretch, machine: Machine) -> JointLimits:
    return JointLimits.of(machine, MARGIN * (machine.rapid_share if stretch.feed_mm_s is None else 1.0))


# --- straight moves ---------------------------------------------------------


def _straight_run(run: Sequence[Stretch], machine: Machine, override: float) -> Law | None:
    """The closed form, where the run is one move with constant q' and nothing else."""
    move = run[0].motion
    if len(run) > 1 or not isinstance(move, JointMove):
        return None
    ends = np.array([0.0, 1.0])
    if any(np.any(np.asarray(c) != 0.0) for c in move.curve.derivative(ends, 2, np)):
        return None
    rate = np.abs(np.subtract(run[0].end, run[0].start)) / move.end + TINY
    limits = _limits(run[0], machine)
    return straight(
        move.end,
        min(_feed(run[0], override), float((limits.velocity / rate).min())),
        float((limits.acceleration / rate).min()),
        float((limits.jerk / rate).min()),
    )


def straight(length: float, velocity: float, acceleration: float, jerk: float) -> Law:
    """The fastest law over ``length`` from rest to rest with constant limits: up to seven phases.

              ______________
             /              \\          v
        ____/                \\____
        +j  0  -j     0     -j  0  +j   jerk
    """
    # Ramp to v: either the acceleration limit is met (a trapezoid of a) or not (a triangle).
    v = velocity
    if v * jerk < acceleration**2:
        ramp = math.sqrt(v / jerk) * 2.0
    else:
        ramp = v / acceleration + acceleration / jerk
    if v * ramp > length:
        v = _peak_speed(length, acceleration, jerk)
    t_j = math.sqrt(v / jerk) if v * jerk < acceleration**2 else acceleration / jerk
    t_a = max(0.0, v / (jerk * t_j) - t_j)
    t_v = max(0.0, length / v - (2.0 * t_j + t_a))
    phases = [(t_j, jerk), (t_a, 0.0), (t_j, -jerk), (t_v, 0.0), (t_j, -jerk), (t_a, 0.0), (t_j, jerk)]
    return _phases(length, phases)


def _peak_speed(length: float, a: float, j: float) -> float:
    """Speed reached when there is no room for an even part: v (2 t_j + t_a) = length."""
    v = (length * math.sqrt(j) / 2.0) ** (2 / 3)
    if v * j <= a * a:
        return v
    b = a * a / j
    return 0.5 * (math.sqrt(b * b + 4.0 * a * length) - b)


def _phases(length: float, phases: Sequence[tuple[float, float]]) -> Law:
    knots, coefficients = [0.0], []
    s = v = a = 0.0
    for t, j in phases:
        if t <= 0.0:
            continue
        coefficients.append((s, v, a / 2.0, j / 6.0, 0.0, 0.0))
        knots.append(knots[-1] + t)
        s, v, a = s + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j
    # Rounding of a few 1e-16: the last place must be the end itself.
    stretch = length / s
    return Law(tuple(knots), tuple(tuple(c * stretch for c in row) for row in coefficients))


# --- runs of a chain ----------------------------------------------------------


def _runs(
    chain: Chain, machine: Machine, kinematics: Kinematics, override: float
) -> list[tuple[Stretch, ...]]:
    """The chain cut at junctions so sharp that passing them is no faster than stopping."""
    runs: list[list[Stretch]] = [[chain.stretches[0]]]
    for before, after in zip(chain.stretches, chain.stretches[1:], strict=False):
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

    index: Array
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
            _junction_speed(before, after, machine, kinematics)
            for before, after in zip(run, run[1:], strict=False)
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
        speed = np.minimum(limits.path_speed(d), self.feeds[self._nodes(samples).index.astype(int)])
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
        return np.array([getattr(limit, which) for limit in self.limits])[self._nodes(s).index]

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
        return np.minimum(feed, np.minimum(self.feeds[before], self.feeds[after]))

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
        rows: list[tuple[float, ...]] = []
        k, base = 0, 0.0
        for i in range(len(pieces)):
            row, t0, t1 = tuple(pieces[i]), float(times[i]), float(times[i + 1])
            while k < len(self.run) - 1 and value(row, t1 - t0) > self.starts[k + 1]:
                cut = _time_of(row, float(self.starts[k + 1]), t1 - t0)
                if cut > 0.0:
                    rows.append(_shifted(row, 0.0, float(self.starts[k])))
                    knots.append(t0 + cut - base)
                laws.append(_law(knots, rows, self.run[k].motion.end))
                row, t0 = _shifted(row, cut, 0.0), t0 + cut
                k, base, knots, rows = k + 1, t0, [0.0], []
            rows.append(_shifted(row, 0.0, float(self.starts[k])))
            knots.append(t1 - base)
        laws.append(_law(knots, rows, self.run[k].motion.end))
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


# --- pieces of law ------------------------------------------------------------


def through(s: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Times (2n + 1,) and coefficients (2n, 6) of the C2 law through s, v, a at n + 1 nodes.

    Between two nodes the jerk is j1 for half of the time and j2 for the other half; that
    and the duration 2h are just what s, v and a at the far node determine:

        ds = (v0 + v1) h - (a1 - a0) h^2 / 3
        j1 = (v1 - v0 - 2 a0 h - (a1 - a0) h / 2) / h^2,   j2 = (a1 - a0) / h - j1

    A polynomial through the same values would overshoot where the jerk changes sign.
    """
    ds, mean, da = np.diff(s), v[1:] + v[:-1], np.diff(a)
    h = 2.0 * ds / (mean + np.sqrt(np.maximum(mean * mean - 4.0 / 3.0 * da * ds, 0.0)))
    v0, a0 = v[:-1], a[:-1]
    j1 = (np.diff(v) - 2.0 * a0 * h - 0.5 * da * h) / h**2
    j2 = da / h - j1
    # An even piece is even to the last bit, not to rounding.
    even = (v0 == v[1:]) & (a0 == 0.0) & (a[1:] == 0.0)
    j1[even], j2[even] = 0.0, 0.0
    s1, v1, a1 = s[:-1] + h * (v0 + h * (a0 / 2 + h * j1 / 6)), v0 + h * (a0 + h * j1 / 2), a0 + h * j1
    none = np.zeros_like(h)
    first = np.stack([s[:-1], v0, 0.5 * a0, j1 / 6, none, none], axis=1)
    second = np.stack([s1, v1, 0.5 * a1, j2 / 6, none, none], axis=1)
    pieces = np.stack([first, second], axis=1).reshape(-1, 6)
    return np.concatenate([[0.0], np.cumsum(np.repeat(h, 2))]), pieces


def at_share(times: Array, pieces: Array, share: float) -> tuple[Array, Array, Array, Array]:
    """s, v, a and jerk at a share of every piece."""
    t = share * np.diff(times)
    c = pieces.T
    s = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
    v = c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5])))
    a = 2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5]))
    return s, v, a, 6 * c[3] + t * (24 * c[4] + t * 60 * c[5])


def value(row: Sequence[float], t: float) -> float:
    return row[0] + t * (row[1] + t * (row[2] + t * (row[3] + t * (row[4] + t * row[5]))))


def _time_of(row: Sequence[float], s: float, longest: float) -> float:
    """The time within a piece at which it passes ``s``; s grows, so bisection cannot fail."""
    low, high = 0.0, longest
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if value(row, middle) < s else (low, middle)
    return high


def _shifted(row: Sequence[float], t: float, s: float) -> tuple[float, ...]:
    """The same cubic with its clock ``t`` later and ``s`` taken off."""
    c0, c1, c2, c3 = (float(c) for c in row[:4])
    start = c0 + t * (c1 + t * (c2 + t * c3)) - s
    return (start, c1 + t * (2.0 * c2 + t * 3.0 * c3), c2 + 3.0 * t * c3, c3, 0.0, 0.0)


def _law(knots: Sequence[float], rows: Sequence[tuple[float, ...]], end: float) -> Law:
    """A law with neighbouring pieces of the same even speed made one."""
    kept_knots, kept = [knots[0]], []
    for i, row in enumerate(rows):
        last = kept[-1] if kept else None
        if last and not any(row[2:]) and not any(last[2:]) and row[1] == last[1]:
            kept_knots[-1] = knots[i + 1]
            continue
        kept.append(row)
        kept_knots.append(knots[i + 1])
    return Law(tuple(kept_knots), tuple(kept))
