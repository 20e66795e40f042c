"""Which placement of the cutter a surface gets: found ahead, evaluated on every tick.

``double`` has two numbers, the ruling parameters of its two points: the pair with the least
largest deviation is taken. ``optimal`` adds three small functions of u (see ``Placed``), cubic
splines with knots that stand closer at the ends, where surfaces turn most; their control points are found
by minimising the largest deviation:

    deviation at point i  ~  y_i + J_i x        to the first order in the control points x,
                                                for a nearest position is nearest: its own
                                                shift along the path counts in the second.

Each step solves min over x of max |y + J x| by Lawson's weighted least squares (weights grow
where the deviation stays large) with a small price on bends of x, so that joints stay smooth; a
step counts only if the true deviation falls, so ``optimal`` is never worse than ``double``.

Where the normal turns by ``FREE_RAD`` and more along a ruling, the best axis leans against it by so
much that no small step from ``double`` leads there: a row of steps by least squares goes first, over
all of the surface. There the flank comes to the upper corner at an end of the block far off the
lower one; so a fourth function slides the lower point, too, and the cutter runs over both ends.

The outermost 2 % at either end count less: there the flank reaches over the end of the
block, and what it leaves or cuts there hangs on the neighbour or the lead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import distinct
from controller.geometry.defects import turned
from controller.geometry.placement import ENDS, Placed, Strategy
from controller.geometry.splines import BSpline
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Vector
from controller.machine.model import Tool
from controller.memory import remembered
from controller.plan.surfaces import deviation, placements

Array = npt.NDArray[np.float64]

ALONG, ACROSS = 97, 11  # points of the surface that are looked at
END = 0.02  # share of u at either end that counts less
SAME_MM = 2e-5  # a surface that ``single`` cuts as well as this needs no other
ORDER = 4
SPANS = 12  # of the corrections
END_WEIGHTS = (0.1, 0.25, 0.6, 1.0)  # tried in turn
STEPS = 14
LAWSON = 30
BEND_PRICE = 1e-7  # against squared deviations
MIN_GAIN = 2e-3
SLAB = 200_000  # multiplications of one product of matrices, at most
EDGE_POINTS = 161  # of the lower edge, to see what cuts it
CLEAR_MM = 1e-3  # so much flank is left below it
BELOW_UPPER = 0.02  # of the ruling: C0 may have a standstill or be a tip, where there is no normal
FREE_RAD = math.radians(60.0)
FREE_ACROSS, FREE_STEPS, FREE_GAIN = 17, 40, 2e-4
SQUARES = 30  # steps by least squares
RUN_PRICE = 1e-7  # against squared deviations per mm^2: the lower point stays where that costs nothing
GRID = (65, 11)  # as ``ALONG``, ``ACROSS``, where placements are chosen from
LEAST_COSINE = 0.3  # of the way from a point to the axis and its normal
CHOSEN_FROM = (Strategy.SINGLE, Strategy.DOUBLE, Strategy.OPTIMAL)  # by ``auto``, the plainest first


@dataclass(frozen=True, slots=True)
class Cutter:
    """What placing needs of a tool on one side of the surface: signed radius beside C1, mm and rad."""

    offset_mm: float
    taper_rad: float
    shift_mm: float  # of the tip below the foot of the contact
    flank_mm: float = 0.0  # above the tip, where the corner ends

    @staticmethod
    def of(tool: Tool, side: float, allowance_mm: float = 0.0, shift_mm: float = 0.0) -> Cutter:
        """The cutter with its tip so far below the contact that the flank cuts there, not the corner.

        ``shift_mm`` more than that; ``allowance_mm`` is what stays on the surface.
        """
        corner, taper = tool.corner_mm, tool.taper_rad
        begins = corner * (1.0 - math.sin(taper))
        low = begins + shift_mm
        flank = tool.radius_mm - corner + corner / math.cos(taper) + (low - corner) * math.tan(taper)
        return Cutter(math.copysign(flank + allowance_mm * math.cos(taper), side), taper, low, begins)


def place(surface: Surface, cutter: Cutter, strategy: Strategy) -> Surface:
    """``surface`` with the cutter placed (not ``AUTO``); itself where that is what Eq. 5 and 8 say."""
    assert strategy is not Strategy.AUTO  # which is chosen for a whole block: ``auto.build``
    better = _better(surface, cutter, strategy) if strategy is not Strategy.SINGLE else None
    if better is not None:
        return better
    return surface if cutter.taper_rad == 0.0 and cutter.shift_mm == 0.0 else as_the_paper(surface, cutter)


def place_all(parts: tuple[Surface, ...], cutter: Cutter, strategy: Strategy) -> tuple[Surface, ...]:
    """The smooth parts of one block, each as ``place`` has it."""
    return tuple(place(part, cutter, strategy) for part in parts)


@dataclass(frozen=True, slots=True)
class Wanted:
    """A placement that has to be searched: what ``place`` is asked."""

    surface: Surface
    cutter: Cutter
    strategy: Strategy  # not ``AUTO``: what that chooses from

    @property
    def name(self) -> str:
        """Under what it is known once it is found."""
        return placements.name_of(self.surface, self.cutter, self.strategy)


def searched(wanted: Wanted) -> placements.Recipe | None:
    """What ``place`` finds, to be learnt; None where it is the paper's placement, or there is none."""
    try:
        placed = place(wanted.surface, wanted.cutter, wanted.strategy)
    except ValueError:  # told by who reads the block
        return None
    return placements.Recipe.of(placed) if isinstance(placed, Placed) and placed.name else None


def off_mm(surface: Surface, cutter: Cutter, strategy: Strategy) -> float:
    """How far a placement (not ``AUTO``) leaves the surface off at most but for its ends, mm."""
    single = as_the_paper(surface, cutter)
    placed = place(surface, cutter, strategy)
    return _Judge(single).inner(placed if isinstance(placed, Placed) else single)


def as_the_paper(surface: Surface, cutter: Cutter) -> Placed:
    return Placed(surface, cutter.offset_mm, taper_rad=cutter.taper_rad, shift_mm=cutter.shift_mm)


@remembered(256)
def _better(surface: Surface, cutter: Cutter, strategy: Strategy) -> Placed | None:
    """The best of its kind, as a check has kept it, or found now; None where the paper's is exact."""
    name = placements.name_of(surface, cutter, strategy)
    kept = placements.known(name)
    return _found(surface, cutter, strategy, name) if kept is None else kept.on(surface, name)


def _found(surface: Surface, cutter: Cutter, strategy: Strategy, name: str) -> Placed | None:
    single = _Judge(as_the_paper(surface, cutter))
    if single.inner(single.placed) < SAME_MM:
        return None
    found = min(_doubles(single), key=single.inner)
    found = found if single.inner(found) < single.inner(single.placed) else single.placed
    if strategy is Strategy.OPTIMAL:
        free = turned(surface)[0] >= FREE_RAD
        judge = _Judge(single.placed, ALONG, FREE_ACROSS) if free else single
        high, low = found.points_v
        start = replace(found, normals_v=(max(high, BELOW_UPPER), low))
        found = min(found, _optimal(start, judge, free), key=judge.inner)
    if found == single.placed:
        return replace(found, name=name)
    return _lowered(replace(found, name=name), cutter)


def _lowered(placed: Placed, cutter: Cutter) -> Placed:
    """``placed`` so far down that its flank, not its corner, cuts all of the lower edge.

    As the axis leans against the ruling, what comes nearest to a point of C1 stands a little further
    along and may have its end above it. The tool slides along itself by micrometres; a tapered one
    is thicker there then, and makes room for it.
    """
    u = _cosine(EDGE_POINTS)
    seen = deviation.of(placed, deviation.points(placed, u, np.ones(u.shape)))
    short = cutter.flank_mm - float(seen.height.min())
    if short <= 0.0:
        return placed
    down = short + CLEAR_MM
    wider = math.copysign(down * math.tan(placed.taper_rad), placed.offset_mm)
    return replace(placed, offset_mm=placed.offset_mm + wider, shift_mm=placed.shift_mm + down)


class _Judge:
    """The points at which placements of one surface are compared."""

    def __init__(self, placed: Placed, along: int = ALONG, across: int = ACROSS) -> None:
        self.placed = placed
        u = np.sort(np.concatenate((_cosine(along), (END, 1.0 - END))))
        u, v = (a.ravel() for a in np.meshgrid(u, _cosine(across), indexing="ij"))
        self.at = deviation.points(placed, u, v)
        edge = np.minimum(u, 1.0 - u)
        self.share = edge / END  # < 1 in the ends
        self._inside = edge >= END * (1.0 - 1e-9)

    def inner(self, placed: Placed) -> float:
        """Largest deviation but for the ends, mm."""
        return float(np.abs(deviation.of(placed, self.at).left[self._inside]).max())

    def whole(self, placed: Placed) -> float:
        """Largest deviation with the ends, mm."""
        return float(np.abs(deviation.of(placed, self.at).left).max())

    def weights(self, least: float) -> Array:
        """1, falling to ``least`` at the ends."""
        return np.asarray(np.where(self._inside, 1.0, least + (1.0 - least) * self.share))


@dataclass(frozen=True, slots=True)
class Grid:
    """Points of a surface at which whole placements of it are compared, along its normals."""

    single: Placed
    u: Array  # (N,)
    at: Array  # (3, N)
    normals: Array  # (3, N) unit vectors to the cutter's side

    @staticmethod
    def of(placed: Placed) -> Grid:
        u, v = (a.ravel() for a in np.meshgrid(*map(_cosine, GRID), indexing="ij"))
        return Grid(placed, u, deviation.points(placed, u, v), deviation.normals(placed, u, v))

    def left(self, placed: Placed) -> Array:
        """What a cut leaves along the normals (mm, negative: overcut), (N,)."""
        seen = deviation.of(placed, self.at)
        return self._along(seen.left, seen.away)

    def left_by(self, tips: Array, axes: Array, flank: tuple[float, float], taper_rad: float) -> Array:
        """The same of poses (M, 3), inf where the flank is nowhere beside; see ``deviation.at_poses``."""
        left = deviation.at_poses(tips, axes, flank, taper_rad, self.at)
        k = np.argmin(left, axis=0)
        away = tips[k].T - self.at
        away -= axes[k].T * (axes[k].T * away).sum(axis=0)
        least = left[k, np.arange(left.shape[1])]
        return self._along(least, away / np.maximum(np.sqrt((away * away).sum(axis=0)), 1e-12))

    def _along(self, left: Array, away: Array) -> Array:
        cosine = np.abs((self.normals * away).sum(axis=0))
        return np.asarray(left / np.maximum(cosine, LEAST_COSINE))


def _cosine(n: int) -> Array:
    return np.asarray(0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, n)))


def _doubles(judge: _Judge) -> Iterator[Placed]:
    """``double`` with the pairs of a coarse grid, then of finer ones about the best."""
    rough = _Judge(judge.placed, 33, 7)
    pair, width = (0.2, 0.8), 0.15
    for _ in range(4):
        pairs = [
            (pair[0] + i * width, pair[1] + j * width) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)
        ]
        sound = [p for p in pairs if BELOW_UPPER <= p[0] <= p[1] - 0.2 and p[1] <= 1.0]
        made = [replace(judge.placed, points_v=p, normals_v=p) for p in sound]
        best = min(made, key=rough.inner)
        yield best
        pair, width = best.points_v, 0.5 * width


# ---- optimal -----------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Basis:
    """Splines over 0 <= u <= 1; control points are rows of one vector x: upper, lower, slide, run."""

    knots: Array

    @staticmethod
    def over(surface: Surface) -> _Basis:
        curves = (surface.lower, surface.upper)
        breaks = distinct(np.concatenate([getattr(curve, "breaks", ENDS) for curve in curves]))
        inner = _merged(_cosine(SPANS + 1), breaks)
        return _Basis(np.concatenate(([0.0] * (ORDER - 1), inner, [1.0] * (ORDER - 1))))

    @property
    def size(self) -> int:
        return len(self.knots) - ORDER

    def values(self, u: Array) -> Array:
        """(N, size), by Cox and de Boor."""
        knots = self.knots
        span = np.clip(np.searchsorted(knots, u, side="right") - 1, ORDER - 1, self.size - 1)
        table = np.zeros((len(u), len(knots) - 1))
        table[np.arange(len(u)), span] = 1.0
        for degree in range(1, ORDER):
            n = len(knots) - 1 - degree
            left, right = knots[degree : degree + n] - knots[:n], knots[degree + 1 :] - knots[1 : n + 1]
            rise = (u[:, None] - knots[:n]) / np.where(left > 0.0, left, 1.0) * (left > 0.0)
            fall = (knots[degree + 1 :] - u[:, None]) / np.where(right > 0.0, right, 1.0) * (right > 0.0)
            table = rise * table[:, :n] + fall * table[:, 1 : n + 1]
        return table

    def bends(self) -> Array:
        """Second differences of neighbouring control points, of the size of the middle of the block's."""
        places = np.array([self.knots[i + 1 : i + ORDER].mean() for i in range(self.size)])
        h0, h1 = np.diff(places)[:-1], np.diff(places)[1:]
        rows = np.zeros((self.size - 2, self.size))
        i = np.arange(self.size - 2)
        rows[i, i], rows[i, i + 2] = 2.0 / (h0 * (h0 + h1)), 2.0 / (h1 * (h0 + h1))
        rows[i, i + 1] = -rows[i, i] - rows[i, i + 2]
        return np.asarray(rows * float(np.diff(places).max()) ** 2)

    def on(self, placed: Placed, x: Array) -> Placed:
        """``placed`` with the control points (3 or 4 rows of ``size``, one after the other)."""
        rows = x.reshape(-1, self.size)
        run = self._curve(np.stack([rows[3], 0.0 * rows[3], 0.0 * rows[3]])) if len(rows) > 3 else None
        return replace(placed, corrections=self._curve(rows[:3]), run=run)

    def _curve(self, rows: Array) -> BSpline:
        points: list[Vector] = [(float(a), float(b), float(c)) for a, b, c in rows.T]
        return BSpline.of(ORDER, self.knots.tolist(), points)


def _merged(knots: Array, breaks: Array) -> Array:
    """Both, without knots that all but fall on a break."""
    gap = np.abs(knots[:, None] - breaks).min(axis=1)
    return distinct(np.concatenate((knots[gap > 0.01], breaks)))


def _optimal(start: Placed, judge: _Judge, free: bool) -> Placed:
    """``start`` corrected; with ends that count more where they would come out worse than at the start."""
    inner, whole = judge.inner(start), judge.whole(start)
    for least in END_WEIGHTS[-1:] if free else END_WEIGHTS:
        found = _Search(start, judge, judge.weights(least), free).found()
        if judge.inner(found) <= inner and judge.whole(found) <= whole:
            return found
    return start


class _Search:
    """For the corrections that make the largest weighted deviation least."""

    def __init__(self, start: Placed, judge: _Judge, weights: Array, free: bool) -> None:
        self._judge, self._weights, self._free = judge, weights, free
        self._basis, rows = _Basis.over(start), 4 if free else 3
        bends = np.kron(np.eye(rows), self._basis.bends())
        self._price = BEND_PRICE * (bends.T @ bends)
        if free:
            run = slice(3 * self._basis.size, None)
            self._price[run, run] += RUN_PRICE * np.eye(self._basis.size)
        self._x = np.zeros(rows * self._basis.size)
        self._best, self._now = start, deviation.of(start, judge.at)

    def found(self) -> Placed:
        if self._free:
            self._steps(_least_squares, _mean_square, SQUARES)
        self._steps(_least_largest, _largest, FREE_STEPS if self._free else STEPS)
        return self._best

    def _steps(self, solve: Callable[..., Array], size: Callable[[Array], float], most: int) -> None:
        """Steps that ``solve`` the linear problem, as long as the ``size`` of the deviation falls."""
        weights, damping = self._weights, 1e-7
        least = size(weights * self._now.left)
        for _ in range(most):
            rows = _slopes(self._best, self._now, self._basis, self._free) * weights[:, None]
            before = least
            while damping < 10.0:
                x = self._x + solve(rows, weights * self._now.left, self._x, self._price, damping)
                trial = self._basis.on(self._best, x)
                seen = deviation.of(trial, self._judge.at, self._now.at_u)
                reached = size(weights * seen.left)
                if reached < least:
                    self._best, self._now, self._x, least = trial, seen, x, reached
                    damping *= 0.2
                    break
                damping *= 10.0
            if before - least < (FREE_GAIN if self._free else MIN_GAIN) * before:
                break


def _largest(left: Array) -> float:
    return float(np.abs(left).max())


def _mean_square(left: Array) -> float:
    return float((left * left).mean())


def _slopes(placed: Placed, now: deviation.Deviation, basis: _Basis, free: bool) -> Array:
    """How the deviation of each point changes with the control points, (N, 3 or 4 size).

    The axis moves at the foot of the point by the share that its upper and its lower point
    have there; what of that leads away from the point is left on it.
    """
    upper, lower, slide, run = deviation.directions(placed, now.at_u)
    high = deviation.share_of_upper(placed, now)
    shares = [(upper, high), (lower, 1.0 - high), (slide, high), (run, 1.0 - high)]
    values = basis.values(now.at_u)
    parts = [-(now.away * d).sum(axis=0) * share for d, share in shares[: 4 if free else 3]]
    return np.asarray(-math.cos(placed.taper_rad) * np.hstack([values * part[:, None] for part in parts]))


def _least_squares(rows: Array, y: Array, x: Array, price: Array, damping: float) -> Array:
    """The step that makes the mean of (y + rows step)^2 least."""
    slabs, y = _slabs(rows, len(x)), _slabs(y, len(x))
    square = np.matmul(slabs.transpose(0, 2, 1), slabs).sum(axis=0) / len(rows)
    right = -(slabs * y[..., None]).sum(axis=(0, 1)) / len(rows) - price @ x
    return np.asarray(np.linalg.solve(square + price + damping * np.eye(len(x)), right))


def _least_largest(rows: Array, y: Array, x: Array, price: Array, damping: float) -> Array:
    """The step that makes the largest of |y + rows step| small, by Lawson's weights."""
    size = rows.shape[1]
    slabs, y = _slabs(rows, size), _slabs(y, size)
    share = _slabs(np.full(len(rows), 1.0 / len(rows)), size)
    best, least = np.zeros(size), math.inf
    steady, pull = price + damping * np.eye(size), price @ x
    for _ in range(LAWSON):
        weighted = slabs * share[..., None]
        square = np.matmul(weighted.transpose(0, 2, 1), slabs).sum(axis=0)
        step = np.linalg.solve(square + steady, -(weighted * y[..., None]).sum(axis=(0, 1)) - pull)
        rest = np.abs(y + np.matmul(slabs, step))
        if float(rest.max()) < least:
            best, least = step, float(rest.max())
        share = share * (rest + 1e-3 * rest.max())
        share /= share.sum()
    return best


def _slabs(values: Array, size: int) -> Array:
    """Rows (N, ...) of ``size`` unknowns in slabs (K, L, ...), the last one filled up with zeros.

    Products of slabs are so small that the library for them takes one thread: several would wait for
    each other on a busy computer ten times as long, and round otherwise on another number of cores.
    """
    length = max(1, min(len(values), SLAB // (size * size)))
    made = np.zeros((-(-len(values) // length), length, *values.shape[1:]))
    made.reshape(-1, *values.shape[1:])[: len(values)] = values
    return made
