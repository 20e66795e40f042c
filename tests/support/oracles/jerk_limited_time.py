"""The jerk-limited optimum of a path, by linear programs: nothing of the planner is used but the motions.

The path coordinate is x in 0 .. 1 with s(x) = end (10 x^3 - 15 x^4 + 6 x^5): s goes with the third power
of x at both ends as it does with that of time in a start from rest, so that b = (dx/dt)^2 is smooth and
positive up to the rests. Joints are sampled and splined, and on even nodes of x

    velocity      | q' | b^(1/2)                                  <=  V
    acceleration  | q'' b + q' b' / 2 |                           <=  A
    jerk          | q''' b + 3/2 q'' b' + q' b'' / 2 | b^(1/2)    <=  J      (derivatives by x)

are differences of b. The jerk limit over b^(1/2) is convex and lies above its tangent, so with the
tangent in its place what a linear program finds keeps the limit, and one program follows the other from
where the last one ended, each within a region of trust that shrinks as the gain does.

Where segments join, q'' may jump: a step of acceleration, which may take all of the jerk of one tick.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.interpolate import make_interp_spline
from scipy.optimize import linprog

from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment

NODES = 400
SAMPLES = 600  # of each segment
MAX_TRUST, MIN_TRUST = 1.0, 2e-3  # change of ln b in one program
ENOUGH = 2e-5  # gain of time in one program that is none
MAX_PROGRAMS = 120
ROUNDING = 1e-5  # of a derivative at the end of a spline

Derivatives = tuple[np.ndarray, np.ndarray, np.ndarray]


class Optimum(NamedTuple):
    seconds: float
    passed_s: np.ndarray  # (n + 1,) when each of the n segments begins, and the end of the last


def optimum(segments: Sequence[Segment], machine: Machine, nodes: int = NODES) -> Optimum:
    """The shortest time from rest to rest over ``segments``, run through at their feeds at most."""
    path = _Path.of(segments, kinematics_of(machine))
    programs = _Programs(path, machine, nodes)
    b = programs.solved()
    times = programs.times(b)
    begins = np.concatenate([[0.0], np.cumsum([s.motion.end for s in segments])])
    return Optimum(float(times[-1]), np.interp(begins / path.end, _way(programs.x)[0], times))


@dataclass(frozen=True)
class _Path:
    """The joints of smooth parts one behind the other, each at one feed."""

    splines: Sequence[Callable[..., np.ndarray]]
    starts: np.ndarray
    feeds: np.ndarray

    @staticmethod
    def of(segments: Sequence[Segment], kinematics: Kinematics) -> _Path:
        splines, lengths, feeds = [], [], []
        for segment in segments:
            for begin, end in _smooth_parts(segment):
                s = np.linspace(begin, end, SAMPLES)
                joints = np.asarray(joints_along(segment, s, kinematics))
                splines.append(make_interp_spline(s - begin, joints, k=5))
                lengths.append(end - begin)
                feeds.append(float(segment.feed_at(np.array([0.5 * (begin + end)]))[0]))
        return _Path(splines, np.concatenate([[0.0], np.cumsum(lengths)]), np.array(feeds))

    @property
    def end(self) -> float:
        return float(self.starts[-1])

    def which(self, s: np.ndarray) -> np.ndarray:
        return np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.splines) - 1)

    def by_s(self, s: np.ndarray) -> Derivatives:
        found = [np.empty((len(s), 5)) for _ in range(3)]
        which = self.which(s)
        for k in np.unique(which):
            here = which == k
            for order in range(3):
                found[order][here] = self.splines[k](s[here] - self.starts[k], nu=order + 1)
        return found[0], found[1], found[2]

    def by_x(self, x: np.ndarray) -> Derivatives:
        s, s1, s2, s3 = (self.end * c[:, None] for c in _way(x))
        first, second, third = self.by_s(np.clip(s[:, 0], 0.0, self.end))
        bend = second * s1**2 + first * s2
        return first * s1, bend, third * s1**3 + 3.0 * second * s1 * s2 + first * s3

    def jumps(self, order: int) -> np.ndarray:
        """Of a derivative by s at the inner boundaries, (n - 1, 5), but for the splines' rounding."""
        pairs = zip(self.splines[:-1], self.splines[1:], np.diff(self.starts)[:-1], strict=True)
        sides = np.array([(a(end, nu=order), b(0.0, nu=order)) for a, b, end in pairs]).reshape(-1, 2, 5)
        jump = np.abs(sides[:, 1] - sides[:, 0])
        return np.where(jump > ROUNDING * np.abs(sides).max(axis=1), jump, 0.0)


def _smooth_parts(segment: Segment) -> list[tuple[float, float]]:
    """A lead is a spline, whose third derivative jumps at its knots, and has feeds of its own."""
    end = segment.motion.end
    marks = [0.0, end, *(at for at, _ in segment.feed_steps), *getattr(segment.motion, "knots", ())]
    found = np.unique(np.clip(marks, 0.0, end))
    found = found[np.concatenate([[True], np.diff(found) > 1e-9])]
    return list(itertools.pairwise([*found[:-1].tolist(), end]))


def _way(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """s / end and its derivatives by x."""
    return (
        x**3 * (10.0 - 15.0 * x + 6.0 * x * x),
        30.0 * x**2 * (1.0 - x) ** 2,
        60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
        60.0 * (1.0 - 6.0 * x + 6.0 * x * x),
    )


class _Programs:
    """The limits on the nodes, and one program after another."""

    def __init__(self, path: _Path, machine: Machine, nodes: int) -> None:
        self.n, self.h, self.x = nodes, 1.0 / nodes, np.linspace(0.0, 1.0, nodes + 1)
        velocity, acceleration, jerk = (
            np.array([getattr(axis.limits, which) for axis in machine.axes])
            for which in ("velocity", "acceleration", "jerk")
        )
        first, second, third = path.by_x(self.x)
        s, rate = (path.end * c for c in _way(self.x)[:2])
        speed = np.minimum(
            (velocity / (np.abs(path.by_s(s)[0]) + 1e-30)).min(axis=1), path.feeds[path.which(s)]
        )
        self._at_joints(path, s, speed, machine)
        self.most = (speed / (rate + 1e-30)) ** 2
        middle_first, middle_second, _ = path.by_x(self.x[1:] - 0.5 * self.h)
        mean, step = self._differences(0.5, 0.5), self._differences(-1.0 / self.h, 1.0 / self.h)
        slope, bend = self._inner(-0.5 / self.h, 0.0, 0.5 / self.h), self._inner(1.0, -2.0, 1.0) / self.h**2
        at = sp.identity(nodes + 1, format="csr")
        self.drive = _form((middle_second / acceleration, mean), (0.5 * middle_first / acceleration, step))
        self.jerk = _form((third / jerk, at), (1.5 * second / jerk, slope), (0.5 * first / jerk, bend))
        self.at_nodes = sp.vstack([at] * 5).tocsr()

    def _at_joints(self, path: _Path, s: np.ndarray, speed: np.ndarray, machine: Machine) -> None:
        """A jump of q'' is a step of acceleration, one of q' a step of velocity: in one tick."""
        limits, period = [axis.limits for axis in machine.axes], machine.period_s
        jerk = np.array([limit.jerk for limit in limits])
        step = np.minimum(np.array([limit.acceleration for limit in limits]) * period, jerk * period**2)
        for at, rates, bends in zip(path.starts[1:-1], path.jumps(1), path.jumps(2), strict=True):
            most = min(
                (step / (np.abs(rates) + 1e-30)).min(),
                np.sqrt((jerk * period / (np.abs(bends) + 1e-30)).min()),
            )
            near = int(np.searchsorted(s, at))
            speed[near - 1 : near + 1] = np.minimum(speed[near - 1 : near + 1], most)

    def _differences(self, *values: float) -> sp.csr_matrix:
        """Between neighbouring nodes."""
        return sp.diags(values, [0, 1], shape=(self.n, self.n + 1)).tocsr()

    def _inner(self, *values: float) -> sp.csr_matrix:
        """Over three nodes; nothing at the first and last, where q' and q'' by x are none."""
        rows = sp.diags(values, [0, 1, 2], shape=(self.n - 1, self.n + 1))
        none = sp.csr_matrix((1, self.n + 1))
        return sp.vstack([none, rows, none]).tocsr()

    def use(self, b: np.ndarray) -> float:
        """The factor on b that is too much."""
        jerk = np.abs(self.jerk @ b) * np.sqrt(self.at_nodes @ b)
        return max((b / self.most).max(), np.abs(self.drive @ b).max(), jerk.max() ** (2.0 / 3.0))

    def times(self, b: np.ndarray) -> np.ndarray:
        """Time at each node."""
        w = np.sqrt(b)
        return np.concatenate([[0.0], np.cumsum(2.0 * self.h / (w[1:] + w[:-1]))])

    def solved(self) -> np.ndarray:
        b = np.ones(self.n + 1)
        b *= 0.98 / self.use(b)
        trust, best = MAX_TRUST, self.times(b)[-1]
        for _ in range(MAX_PROGRAMS):
            found = self.next(b, trust)
            now = self.times(found)[-1] if found is not None else np.inf
            if now >= best:
                trust *= 0.4
                if trust < MIN_TRUST:
                    break
                continue
            gain, b, best = 1.0 - now / best, found, now
            if gain < ENOUGH and trust < 0.1:
                break
            trust *= 0.6 if gain < 0.02 * trust else 1.0
        return b

    def next(self, b: np.ndarray, trust: float) -> np.ndarray | None:
        """The best within ``trust`` of b, by the tangents there; the variables are shares of what b is."""
        weight = np.full(self.n + 1, self.h)
        weight[[0, -1]] *= 0.5
        drive = self.drive @ sp.diags(b)
        jerk = sp.diags(np.sqrt(self.at_nodes @ b)) @ self.jerk @ sp.diags(b)
        # |jerk(b)| <= J b0^(-1/2) (3/2 - b / b0 / 2), each row over J b0^(-1/2).
        rows = sp.vstack([drive, -drive, jerk + 0.5 * self.at_nodes, -jerk + 0.5 * self.at_nodes])
        right = np.concatenate([np.ones(2 * drive.shape[0]), np.full(2 * jerk.shape[0], 1.5)])
        high = np.minimum(np.exp(trust), self.most / b)
        low = np.minimum(np.exp(-trust), high)
        found = linprog(
            -weight / np.sqrt(b), rows, right, bounds=np.stack([low, high], axis=1), method="highs"
        )
        return b * found.x if found.status == 0 else None


def _form(*terms: tuple[np.ndarray, sp.csr_matrix]) -> sp.csr_matrix:
    """The sum of forms of b, each times its factor of each joint, joint below joint."""
    return sum(
        sp.vstack([sp.diags(column) @ form for column in factors.T]) for factors, form in terms
    ).tocsr()
