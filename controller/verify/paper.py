"""The paper's comparison, computed: chords off line, the paper's step, and ours.

The test surface is Eq. 7 as it must read (the printed y of C0 lacks a u, and 8.051
stands for 8.015: only then is C1 = 3 C0 in x and y, as its C1 says). The cutter has no
radius here, so the tool tip is the contact. Three ways of moving along C1 at 20 mm/s:

* *off line*: 22 chords between points at even steps of u, the orientation linear
  along each (Eq. 6). Its samples are the ends of the chords.
* *first-order step*: u grows by V dT / abs(C1') per sample (Eq. 3), with the exact
  pose at each sample (Eq. 4 and 8).
* *arc length*: the n-th sample lies at n V dT along C1. This is what the tick does,
  and the tick's own function is called for it.

Between two samples every drive runs its joint linearly, so there the tool is only near
the surface. What it means to be "off" is said once, in ``Errors``, and it is said
separately for the samples and for what lies between them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from controller.geometry import arc_length
from controller.geometry.arrays import Array
from controller.geometry.curves import Bezier, Polynomial
from controller.geometry.surfaces import Cone, RuledSurface, Surface
from controller.geometry.vectors import Pose, Vector, angle_between, dot, norm, subtract
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.messages import message, text
from controller.motion.motions import SurfaceCut

FEED_MM_S = 20.0
PAPER_PERIOD_S = 0.010
OUR_PERIODS_S = (0.010, 0.002, 0.0005)
CHORDS = 22
SETPOINT_PERIOD_S = 0.002

# Rows per gap between two samples: the largest error of a parabola between its ends
# is in the middle, which an even number of steps hits.
STEPS = 32
CHORD_STEPS = 256


@dataclass(frozen=True, slots=True)
class Errors:
    """Largest errors over the samples, or over what lies between them.

    The ruling a tool axis should be parallel to can be taken at the point of C1 where
    the tool should be at that instant, or at the point of C1 nearest to the contact.
    The first is the interpolation error of the axis; the second adds that the contact
    is a little early or late along the path.
    """

    contour_mm: float  # distance of the contact to the curve C1
    axis_deg: float  # to the ruling due at that instant
    axis_at_contact_deg: float  # to the ruling through the nearest point of C1
    feed_share: float  # largest abs(speed of the contact along C1 / feed - 1)
    position_um: float  # X Y Z moved by the axis error alone: the paper's use of Eq. 11
    machine_um: float  # X Y Z to those due at that instant, contour and axis error together


@dataclass(frozen=True, slots=True)
class Printed:
    """What the paper prints for a method; None where it prints nothing."""

    contour_mm: float | None
    axis_deg: float | None
    position_um: float | None


@dataclass(frozen=True, slots=True)
class Method:
    """One way of interpolating Eq. 7 and how far it is off."""

    name: str
    between_samples: str  # what is linear between samples: "orientation" or "joints"
    period_s: float | None  # None: samples are ends of chords, not of periods
    samples: int
    at: Errors
    between: Errors
    drift_mm: float  # of the last sample from feed x time along C1
    printed: Printed | None


@dataclass(frozen=True, slots=True)
class PaperPart:
    """One of the paper's two parts at one reading of its programmed feed."""

    name: str
    feed_word: str
    lengths_mm: tuple[float, ...]  # of C1, per block
    feed_mm_min: float
    cut_time_s: float  # length / feed: no ramps, no approach
    setpoints: int  # per axis, one per 2 ms
    reported_s: float
    note: str


@dataclass(frozen=True, slots=True)
class PaperComparison:
    """Everything ``directrix paper`` says."""

    length_mm: float  # of C1 of Eq. 7
    feed_mm_s: float
    methods: tuple[Method, ...]
    parts: tuple[PaperPart, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, dicts and numbers, for JSON; in English, as names of what was computed."""
        found = asdict(self)
        for row in (*found["methods"], *found["parts"]):
            row |= {key: text(message(row[key])) for key in ("name", "note") if key in row}
        return found


@dataclass(frozen=True, slots=True)
class _Run:
    """Poses of a method: ``steps`` rows per gap between samples and one for the last sample."""

    pose: Pose  # components (N,), part frame
    due_mm: Array  # arc length of C1 that is due at each row
    time_s: Array
    steps: int


def eq7() -> RuledSurface:
    """The surface of Eq. 7, corrected."""
    upper = Polynomial(((5.0, 0.0, 20.0), (0.22, 8.015, 0.0), (-7.425, -0.81, 0.0), (2.205, -2.205, 0.0)))
    lower = Polynomial(((15.0, 0.0, 0.0), (0.66, 24.045, 0.0), (-22.275, -2.43, 0.0), (6.615, -6.615, 0.0)))
    return RuledSurface(upper, lower)


def example_1() -> tuple[Surface, ...]:
    """The cone of Fig. 8 (mm)."""
    return (Cone((0.0, 15.0, 0.0), (0.0, 0.0, 0.0), 10.0, 10.0, math.tau),)


def example_2() -> tuple[Surface, ...]:
    """The two ruled surfaces of Fig. 10 (mm)."""
    first = RuledSurface(
        Bezier(((38.0, 22.0, 10.0), (21.5, -5.5, 10.0), (5.0, 5.0, 10.0), (10.5, 11.0, 10.0))),
        Bezier(((38.0, 22.0, 0.0), (21.5, -11.0, 0.0), (-1.58, 3.3, 0.0), (3.6, 11.0, 0.0))),
    )
    second = RuledSurface(
        Bezier(((10.5, 11.0, 10.0), (16.0, 16.5, 10.0), (35.8, 18.42, 10.0), (38.0, 22.0, 10.0))),
        Bezier(((3.6, 11.0, 0.0), (8.78, 18.7, 0.0), (28.1, 18.7, 0.0), (38.0, 22.0, 0.0))),
    )
    return (first, second)


def compare(machine: Machine, progress: Callable[[float], None] = lambda _: None) -> PaperComparison:
    """The paper's comparison on ``machine``: the trunnion of Fig. 4a, its G54 at W + R.

    ``progress`` gets the share that is done.
    """
    bench = _Bench(machine)
    chords = bench.method("paper.chords", "orientation", None, bench.chords(), Printed(0.01, 0.016, 43.0))
    stepped = bench.first_order(PAPER_PERIOD_S)
    printed = Printed(None, 0.00018, 0.49)
    methods = [
        chords,
        bench.method("paper.step", "orientation", PAPER_PERIOD_S, bench.oriented(stepped), printed),
        bench.method("paper.step", "joints", PAPER_PERIOD_S, bench.jointed(stepped, PAPER_PERIOD_S), printed),
    ]
    for k, period_s in enumerate(OUR_PERIODS_S):
        progress((k + 1) / (len(OUR_PERIODS_S) + 2))
        run = bench.jointed(bench.even(period_s), period_s)
        methods.append(bench.method("paper.arc_length", "joints", period_s, run, None))
    return PaperComparison(bench.cut.end, FEED_MM_S, tuple(methods), _parts())


def at_period(machine: Machine, period_s: float) -> tuple[Method, Method]:
    """Ours and the paper's first-order step, with joints linear between the samples of one period."""
    bench = _Bench(machine)
    ours, theirs = (bench.jointed(s, period_s) for s in (bench.even(period_s), bench.first_order(period_s)))
    return (
        bench.method("paper.arc_length", "joints", period_s, ours, None),
        bench.method("paper.step", "joints", period_s, theirs, None),
    )


class _Bench:
    """Eq. 7 on one machine: makes runs and measures them."""

    def __init__(self, machine: Machine) -> None:
        surface = eq7()
        self.kinematics = kinematics_of(machine)
        self.rotary = machine.rotary()
        self.cut = SurfaceCut(surface, arc_length.of(surface.lower), 0.0, 0.0, machine.offsets[0])

    # -- where the samples lie: arc length of C1 (mm) at each
    def even(self, period_s: float) -> Array:
        """Equal arcs; the shorter rest at the end is left out."""
        step_mm = FEED_MM_S * period_s
        return np.asarray(np.arange(math.floor(self.cut.end / step_mm) + 1) * step_mm)

    def first_order(self, period_s: float) -> Array:
        """Eq. 3, sample after sample, as long as it stays on the curve."""
        parameters, u = [0.0], 0.0
        while (u := u + FEED_MM_S * period_s / norm(self.cut.surface.lower.derivative(u))) <= 1.0:
            parameters.append(u)
        return np.asarray(arc_length.s_at(self.cut.arc, np.array(parameters)))

    # -- what the tool does between them
    def jointed(self, samples_mm: Array, period_s: float) -> _Run:
        """Joints by the tick's own function at the samples, linear between."""
        near = self.kinematics.branches(self.cut.part.turn(self.cut.pose(0.0).axis))[0]
        first, second = self.rotary
        rows = []
        for s in samples_mm:
            joints = self.cut.joints(float(s), near, self.kinematics)
            if joints is None:
                raise ValueError(f"This machine cannot hold the ruling of Eq. 7 at {s:.3f} mm of its path.")
            rows.append(joints)
            near = joints[first], joints[second]
        dense = _fill(np.array(rows), STEPS)
        table = self.kinematics.forward(tuple(dense.T), 0.0, np)
        pose = Pose(self.cut.part.from_parent(table.tip), self.cut.part.turn_back(table.axis))
        return self._timed(pose, samples_mm, period_s)

    def oriented(self, samples_mm: Array, period_s: float = PAPER_PERIOD_S) -> _Run:
        """Contact and axis themselves linear between the samples."""
        due = self._due(samples_mm)
        return self._timed(Pose(_linear(due.tip, STEPS), _linear(due.axis, STEPS)), samples_mm, period_s)

    def chords(self) -> _Run:
        """Eq. 6: contact and axis linear in u along each chord, at the feed along the chord."""
        u: Array = np.arange(CHORDS + 1) / CHORDS
        ends = self._due(arc_length.s_at(self.cut.arc, u))
        tip = x, y, z = _linear(ends.tip, CHORD_STEPS)
        gone_mm = np.cumsum(
            norm((np.diff(x, prepend=x[0]), np.diff(y, prepend=y[0]), np.diff(z, prepend=z[0])), np)
        )
        due_mm = np.asarray(arc_length.s_at(self.cut.arc, _fill(u, CHORD_STEPS)))
        return _Run(Pose(tip, _linear(ends.axis, CHORD_STEPS)), due_mm, gone_mm / FEED_MM_S, CHORD_STEPS)

    def _timed(self, pose: Pose, samples_mm: Array, period_s: float) -> _Run:
        return _Run(
            pose,
            _fill(samples_mm, STEPS),
            _fill(np.asarray(np.arange(len(samples_mm)) * period_s), STEPS),
            STEPS,
        )

    # -- how far off that is
    def method(
        self, name: str, between: str, period_s: float | None, run: _Run, printed: Printed | None
    ) -> Method:
        at, midway = self._measure(run)
        drift_mm = float(run.due_mm[-1] - FEED_MM_S * run.time_s[-1])
        samples = (len(run.due_mm) - 1) // run.steps + 1
        return Method(name, between, period_s, samples, at, midway, drift_mm, printed)

    def _measure(self, run: _Run) -> tuple[Errors, Errors]:
        """(at the samples, between them)."""
        tip, axis = run.pose
        due = self._due(run.due_mm)
        u = nearest(self.cut.surface, tip, self.cut.arc.u_along(run.due_mm))
        ruling = self.cut.surface.axis(u, np)
        xyz_due = self._xyz(due)
        rows = {
            "contour_mm": norm(subtract(tip, _whole(self.cut.surface.contact(u, np), u)), np),
            "axis_deg": np.degrees(angle_between(axis, due.axis, np)),
            "axis_at_contact_deg": np.degrees(angle_between(axis, _whole(ruling, u), np)),
            "position_um": 1e3 * norm(subtract(self._xyz(Pose(due.tip, axis)), xyz_due), np),
            "machine_um": 1e3 * norm(subtract(self._xyz(run.pose), xyz_due), np),
        }
        arc_mm = self._arc(u)
        is_sample = np.arange(len(arc_mm)) % run.steps == 0
        at, between = (
            {name: float(np.max(row[which])) for name, row in rows.items()}
            for which in (is_sample, ~is_sample)
        )
        return (
            Errors(feed_share=_feed_share(arc_mm[is_sample], run.time_s[is_sample]), **at),
            Errors(feed_share=_feed_share(arc_mm, run.time_s), **between),
        )

    def _due(self, s_mm: Array) -> Pose:
        """Exact contact and axis at arc lengths of C1, part frame, arrays (N,)."""
        u = self.cut.arc.u_along(s_mm)
        surface = self.cut.surface
        return Pose(_whole(surface.contact(u, np), u), _whole(surface.axis(u, np), u))

    def _arc(self, u: Array) -> Array:
        """Arc length at ``u``, straight on where ``u`` lies a trace outside of the curve."""
        inside = np.clip(u, 0.0, 1.0)
        speed = norm(self.cut.surface.lower.derivative(inside, 1, np), np)
        return np.asarray(arc_length.s_at(self.cut.arc, inside) + (u - inside) * speed)

    def _xyz(self, pose: Pose) -> Vector:
        """Eq. 11: the linear joints of poses of the part frame, all on one branch."""
        axis = self.cut.part.turn(pose.axis)
        rotaries = self.kinematics.branches(axis, np)[0]
        return self.kinematics.linear(self.cut.part.to_parent(pose.tip), rotaries, 0.0, np)


def nearest(surface: Surface, point: Vector, u: Array) -> Array:
    """Parameters of the points of C1 nearest to ``point``, by Newton's method from ``u``.

    Needs a start within the curve's own scale; the foot of the perpendicular may lie a
    little outside of 0 <= u <= 1, on the curve's continuation.
    """
    curve = surface.lower
    for _ in range(5):
        gap, rate = subtract(curve.at(u, np), point), curve.derivative(u, 1, np)
        u = u - dot(gap, rate) / (dot(rate, rate) + dot(gap, curve.derivative(u, 2, np)))
    return u


def _feed_share(arc_mm: Array, time_s: Array) -> float:
    return float(np.max(np.abs(np.diff(arc_mm) / (FEED_MM_S * np.diff(time_s)) - 1.0)))


def _fill(samples: Array, steps: int) -> Array:
    """Rows (n) or (n, k) with ``steps - 1`` more between each two, linear: (n - 1) * steps + 1 rows."""
    place = np.arange((len(samples) - 1) * steps + 1)
    index = np.minimum(place // steps, len(samples) - 2)
    share = place / steps - index
    if samples.ndim == 2:
        share = share[:, None]
    return np.asarray(samples[index] + share * (samples[index + 1] - samples[index]))


def _linear(v: Vector, steps: int) -> Vector:
    return _fill(v[0], steps), _fill(v[1], steps), _fill(v[2], steps)


def _whole(v: Vector, like: Array) -> Vector:
    """Constant components of a vector as arrays of the length of ``like``."""
    x, y, z = (np.broadcast_to(c, like.shape) for c in v)
    return x, y, z


def _parts() -> tuple[PaperPart, ...]:
    slow, fast = "f10000", "f100000"
    return (
        _part("paper.example_1", example_1(), fast, 1000.0, 65.0, "paper.as_printed"),
        _part("paper.example_1", example_1(), slow, 100.0, 65.0, "paper.as_reported"),
        _part("paper.example_2", example_2(), slow, 100.0, 60.0, "paper.as_printed"),
    )


def _part(
    name: str, surfaces: tuple[Surface, ...], word: str, feed_mm_min: float, reported_s: float, note: str
) -> PaperPart:
    lengths = tuple(arc_length.of(surface.lower).length_mm for surface in surfaces)
    cut_time_s = sum(lengths) / (feed_mm_min / 60.0)
    setpoints = math.ceil(cut_time_s / SETPOINT_PERIOD_S)
    return PaperPart(name, word, lengths, feed_mm_min, cut_time_s, setpoints, reported_s, note)
