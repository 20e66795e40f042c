"""Programs along walls, held anywhere; the tool led aside, changed, and brought back: judged from outside."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from support.machines.interrupted_runs import with_tool
from support.machines.planning_bench import Bench
from support.machines.stepped_runs import shipped
from support.oracles import aside_envelope

from controller import messages
from controller.ipc.handoff import COLUMN, Jog, of_axes, send_jog
from controller.machine import machine_file
from controller.machine.model import Joints, Machine, Tool
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.runtime.plan_messages import Program
from controller.state.modes import Mode, Request

PERIOD_S = 0.008
FEED = 1200.0  # mm/min
JOINTS = of_axes("joint_command", 5)
HEIGHT_MM = 20.0
LOOKED = 250  # rows of a way, at most
NEAR_ITS_END = 60  # ticks: who is held there has come to the end before it has stopped
HOME = "G21 G90 T2 M6\nG53 G0 Z260.\nG53 G0 X0. Y0. A0. C0.\nM2\n"
OLD = {"radius_mm": 1.5, "length_mm": 0.0}


Curve = tuple[np.ndarray, np.ndarray]  # control points of the upper and the lower directrix, (4, 3) each
HEAD = ("G21 G90 G54 G61", "T2 M6")
OVER = f"G0 Z{HEIGHT_MM + 5:.3f}"
CHORDS = 31


@dataclass(frozen=True, eq=False)
class Part:
    """A program, and the walls that it leaves."""

    text: str
    walls: tuple[aside_envelope.Wall, ...]
    floor_mm: float | None = None  # of upright walls, table frame: nothing is to be cut below

    @staticmethod
    def surfaces(curves: Sequence[Curve], side: float = 1.0) -> Part:
        """G52 blocks."""
        words = [*HEAD, "G42 P1 R0.05" if side > 0.0 else "G41 P1 R0.05"]
        for upper, lower in curves:
            first, *others = [*upper, *lower]
            words.append(f"G52 {_xyz(first)} F{FEED:g}.")
            words += [_xyz(point) for point in others]
        return Part(_text([*words, "M2"]), _walls(curves, side))

    @staticmethod
    def cam(curves: Sequence[Curve], follows_length: bool = True) -> Part:
        """Short lines beside upright walls, the old tool on their right."""
        tips = np.concatenate([_beside(curve)[0] for curve in curves])
        words = [*HEAD, "G43 H2" if follows_length else "", "G0 X-5. Y-8. Z25."]
        return Part(_text([*words, *_along(tips), "M2"]), _walls(curves, 1.0), _floor())

    @staticmethod
    def compensated(curves: Sequence[Curve]) -> Part:
        """The walls themselves as short lines, and G42 with the tool's radius."""
        base = np.concatenate([_beside(curve, 0.0)[0] for curve in curves])
        (ahead, out), (onward, aside) = (_ways(base[i + 1] - base[i]) for i in (0, -2))
        first, last = base[0] - 4.0 * ahead, base[-1] + 4.0 * onward
        before, after = first - 6.0 * ahead + 6.0 * out, last + 6.0 * onward + 6.0 * aside
        words = [*HEAD, "G43 H2", *_down(before), f"G42 D2 G1 {_xyz(first)}"]
        words += [f"G1 {_xyz(place)}" for place in (*base, last)]
        words += [f"G40 G1 {_xyz(after)}", OVER, "M2"]
        return Part(_text(words), _walls(curves, 1.0), _floor())

    @staticmethod
    def tilted(curves: Sequence[Curve]) -> Part:
        """Short lines along leaning walls with the tool axis along their rulings."""
        tips, axes = (np.concatenate(one) for one in zip(*map(_beside, curves), strict=True))
        first, last = tips[0] + [0.0, -4.0, 0.0], tips[-1] + [0.0, -4.0, 0.0]
        poses = [f"G1 {_xyz(tip)} {_ijk(axis)}" for tip, axis in zip(tips, axes, strict=True)]
        high = [
            f"{_xyz(one + 25.0 * axis)} {_ijk(axis)}" for one, axis in ((first, axes[0]), (last, axes[-1]))
        ]
        words = [*HEAD, "G43.5 H2", f"G0 {high[0]}", f"G1 {_xyz(first)} {_ijk(axes[0])} F{FEED:g}.", *poses]
        words += [f"G1 {_xyz(last)} {_ijk(axes[-1])}", f"G0 {high[1]}", "G49", "M2"]
        return Part(_text(words), _walls(curves, 1.0))

    @staticmethod
    def cone(radius_mm: float, lean_mm: float, sweep_deg: float) -> Part:
        """G51, the cutter outside."""
        size = f"H{HEIGHT_MM} R{radius_mm - lean_mm:.4f} D{sweep_deg:.4f}"
        words = [*HEAD, "G42 P1 R0.05", f"G51 X{radius_mm:.4f} Y0. Z0. I0. J0. K0. {size} F{FEED:g}."]
        along, up = aside_envelope.GRID
        angle, v = np.linspace(0.0, np.radians(sweep_deg), along), np.linspace(0.0, 1.0, up)
        rho, z = radius_mm - lean_mm * v, HEIGHT_MM * v
        round_ = [np.multiply.outer(turn(angle), rho) for turn in (np.cos, np.sin)]
        points = np.stack([*round_, np.broadcast_to(z, round_[0].shape)], axis=2)
        wall = aside_envelope.Wall.between(points, 1.0, shipped().offsets[0])
        return Part(_text([*words, "M2"]), (wall,))

    @staticmethod
    def pocket(length: float, width: float, compensated: bool) -> Part:
        """Four upright walls from within, once around to the left."""
        corners = [
            np.array(c) for c in ((0.0, 0.0, 0.0), (length, 0, 0), (length, width, 0), (0.0, width, 0))
        ]
        ends = [*zip(corners, [*corners[1:], corners[0]], strict=True)]
        middle = np.array([0.5 * length, 0.5 * width, 0.0])
        begin, off = np.array([0.5 * length, 0.0, 0.0]), np.zeros(3)
        if not compensated:
            off[:] = OLD["radius_mm"], OLD["radius_mm"], 0.0
        way = [begin, corners[1], corners[2], corners[3], corners[0], begin]
        if not compensated:
            way = [place + off * np.sign(middle - place) * [1.0, 1.0, 0.0] for place in way]
        words = [*HEAD, "G43 H2", *_down(middle), ("G41 D2 " if compensated else "") + f"G1 {_xyz(way[0])}"]
        words += [f"G1 {_xyz(place)}" for place in way[1:]]
        words += [("G40 " if compensated else "") + f"G1 {_xyz(middle)}", OVER, "M2"]
        return Part(_text(words), _walls([_upright(*pair) for pair in ends], -1.0), _floor())

    @staticmethod
    def slot(length: float, width: float) -> Part:
        """Two upright walls, open at both ends, each by a contour of its own under G41."""
        words, curves = [*HEAD, "G43 H2"], []
        for y, begin, end in ((0.0, 0.0, length), (width, length, 0.0)):
            along = np.sign(end - begin)
            out, onto, off = (
                np.array([x, y, 0.0]) for x in (begin - 9 * along, begin - 4 * along, end + 4 * along)
            )
            out[1] = 0.5 * width
            words += [*_down(out), f"G41 D2 G1 {_xyz(onto)}", f"G1 {_xyz(off)}", "G40", OVER]
            curves.append(_upright(np.array([begin, y, 0.0]), np.array([end, y, 0.0])))
        return Part(_text([*words, "M2"]), _walls(curves, -1.0), _floor())

    @staticmethod
    def random(rng: random.Random, kind: str = "ruled") -> Part:
        """A part of a kind (``KINDS``)."""
        if kind == "pocket":
            return Part.pocket(rng.uniform(20.0, 30.0), rng.uniform(11.0, 16.0), rng.random() < 0.5)
        if kind == "cone":
            return Part.cone(rng.uniform(8.0, 25.0), rng.uniform(-3.0, 3.0), rng.uniform(60.0, 180.0))
        if kind == "slot":
            return Part.slot(rng.uniform(18.0, 30.0), rng.uniform(3.3, 6.0))
        curves = _smooth(rng, upright=kind in ("contour", "compensated"))
        if kind == "contour":
            return Part.cam(curves, follows_length=rng.random() < 0.7)
        if kind == "compensated":
            return Part.compensated(curves)
        if kind == "tilted":
            return Part.tilted(curves)
        return Part.surfaces(curves, rng.choice((1.0, -1.0)))


KINDS = ("ruled", "contour", "compensated", "tilted", "pocket", "slot", "cone")


def _smooth(rng: random.Random, upright: bool) -> list[Curve]:
    """One to three walls that join smoothly, bent and, if not ``upright``, leaning and twisted a little."""
    lean = 0.0 if upright else rng.uniform(-3.0, 3.0)
    curves, at, slope = list[Curve](), np.zeros(3), rng.uniform(-0.15, 0.15)
    for _ in range(rng.randint(1, 3)):
        length, bend = rng.uniform(18.0, 36.0), rng.uniform(-0.2, 0.2)
        step, after = length / 3.0, slope + bend
        end = at + np.array([length, 0.5 * (slope + after) * length, 0.0])
        first, last = np.array([step, slope * step, 0.0]), np.array([step, after * step, 0.0])
        lower = np.array([at, at + first, end - last, end])
        upper = lower + np.array([0.0, lean, HEIGHT_MM])
        upper[1:3, 1] += 0.0 if upright else rng.uniform(-0.4, 0.4)
        curves.append((upper, lower))
        at, slope = end, after
    return curves


def _upright(begin: np.ndarray, end: np.ndarray) -> Curve:
    lower = np.array([begin + t * (end - begin) for t in np.linspace(0.0, 1.0, 4)])
    return lower + np.array([0.0, 0.0, HEIGHT_MM]), lower


def _beside(curve: Curve, off: float = OLD["radius_mm"]) -> tuple[np.ndarray, np.ndarray]:
    """Tips and axes (CHORDS, 3) of a tool on the right of a wall."""
    u = np.linspace(0.0, 1.0, CHORDS)
    upper, base = (aside_envelope.bezier(np.asarray(points, float), u) for points in curve)
    axis = (upper - base) / np.linalg.norm(upper - base, axis=1)[:, None]
    out = np.cross(np.gradient(base, axis=0), axis)
    return base + off * out / np.linalg.norm(out, axis=1)[:, None], axis


def _ways(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors along a way and to its right."""
    x, y, _ = along / np.linalg.norm(along)
    return np.array([x, y, 0.0]), np.array([y, -x, 0.0])


def _along(tips: np.ndarray) -> list[str]:
    """Down beside the first, along all of them and off."""
    aside = np.array([0.0, -4.0, 0.0])
    return [
        *_down(tips[0] + aside),
        *(f"G1 {_xyz(tip)}" for tip in tips),
        f"G1 {_xyz(tips[-1] + aside)}",
        OVER,
    ]


def _down(place: np.ndarray) -> list[str]:
    over = place + np.array([0.0, 0.0, HEIGHT_MM + 5.0])
    return [f"G0 {_xyz(over)}", f"G1 Z{place[2]:.4f} F{FEED:g}."]


def _ijk(axis: np.ndarray) -> str:
    return " ".join(f"{letter}{q:.6f}" for letter, q in zip("IJK", axis, strict=True))


def _text(words: Sequence[str]) -> str:
    return "\n".join([*words, ""])


def _floor() -> float:
    return float(shipped().offsets[0].origin[2])


def _xyz(point: np.ndarray) -> str:
    return " ".join(f"{letter}{q:.4f}" for letter, q in zip("XYZ", point, strict=True))


def _walls(curves: Sequence[tuple[np.ndarray, np.ndarray]], side: float) -> tuple[aside_envelope.Wall, ...]:
    part = shipped().offsets[0]
    return tuple(aside_envelope.Wall.of(upper, lower, side, part) for upper, lower in curves)


@cache
def machine() -> Machine:
    """One that refuses what a check finds: a holder in a wall is refused there, and not at the way back."""
    fitted = with_tool(machine_file.with_period(shipped(), PERIOD_S), 2, flute_mm=2.0 * HEIGHT_MM, **OLD)
    return replace(fitted, gouge="refuse")


@dataclass(frozen=True)
class Came:
    """``refused``: the sentence; else how deep the tool got on its way, where it waited, and in the rest."""

    refused: str = ""
    on_the_way: float = -np.inf
    waiting: float = -np.inf
    after: float = -np.inf


class Held(Bench):
    """Runs a part, holds it, and does what an operator does."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, machine())
        self._ticks: dict[str, list[int]] = {}

    @property
    def mode(self) -> Mode:
        return self.stepped.cycle.modes.mode

    def _armed(self, text: str, fitted: Machine, **more: object) -> str:
        """Why it is refused; "" where it has begun."""
        program = Program(text.encode(), "part.ngc", fitted, in_spindle=2, **more)  # type: ignore[arg-type]
        answer = self.order("arm", program=program)
        if answer.error is not None:
            return _sentence(answer.error)
        self.start = answer.facts["start"].joints
        self.request(Request.START)
        return ""

    def _begun(self, part: Part) -> None:
        """From the same place each time, so that its ticks are those of the undisturbed run."""
        for text in (HOME, part.text):
            self.rows.clear()
            assert not self._armed(text, self.machine)
            if text is HOME:
                self.until(Mode.READY)

    def cutting(self, part: Part) -> list[int]:
        """Ticks of an undisturbed run at which the tool is fed."""
        if part.text not in self._ticks:
            self._begun(part)
            self.until(Mode.READY)
            rows = np.concatenate(self.rows)
            fed = (rows[:, COLUMN["line"]] > 3) & (rows[:, COLUMN["feed_mm_s"]] > 0.0)
            fed &= rows[:, COLUMN["feed_mm_s"]] < 1.1 * FEED / 60.0
            fed[-NEAR_ITS_END:] = False
            self._ticks[part.text] = [int(k) for k in np.flatnonzero(fed)]
        return self._ticks[part.text]

    def held(self, part: Part, tick: int) -> None:
        self._begun(part)
        self.rows.append(self.stepped.go(max(1, tick - 10)))
        self.stepped.request(Request.HOLD)
        self.stepped.go(5)
        self.until(Mode.HOLD)

    def led(self, verb: str, **more: object) -> str:
        answer = self.order(verb, tool=2, **more)
        if answer.error is not None:
            return _sentence(answer.error)
        self.request(Request.RESUME)
        self.until(Mode.HOLD)
        return ""

    def jogged(self, by: Joints) -> None:
        length = float(np.linalg.norm(by))
        send_jog(self.stepped._operator, Jog(tuple(q / length for q in by), 20.0, length))  # type: ignore[arg-type]
        self.stepped.go(10)
        self.until(Mode.HOLD)
        self.rows.append(self.stepped.go(10))

    def stopped(self) -> None:
        self.stepped.request(Request.STOP)
        self.planner.drop()
        self.stepped.go(20)
        self.until(Mode.READY)

    def brought_back(self, part: Part, tool: Tool | None, restart: bool) -> Came:
        """By a return, or stopped and started again there; None: the tool is as it was."""
        fitted = self.machine if tool is None else replace(self.machine, tools=_tools(self.machine, tool))
        now, stood = tool or self.machine.tool(2), self.stepped.joints
        program = None if tool is None else self.program_of(part, tool)
        assert now is not None
        self.rows.clear()
        if restart:
            spot = self.planner.spot(self.snapshot())
            assert spot is not None
            self.stopped()
            why = self._armed(part.text, fitted, spot=Spot(spot.line, spot.fraction), start=self.start)
        else:
            why = self.led("return", program=program)
        if why:
            assert self.stepped.joints == stood, "nothing moves by what is refused"
            if not restart:
                self.stopped()
            return Came(why)
        if restart:
            self.until(Mode.READY)
            return Came("", self._deepest(part, now))
        way, waiting = self._deepest(part, now), self._deep(part, now, np.array([self.stepped.joints]))
        self.rows.clear()
        self.request(Request.RESUME)
        self.until(Mode.READY)
        return Came("", way, waiting, self._deepest(part, now))

    def program_of(self, part: Part, tool: Tool) -> Program:
        """What the service sends where another tool was fitted."""
        fitted = replace(self.machine, tools=_tools(self.machine, tool))
        return Program(part.text.encode(), "part.ngc", fitted, start=self.start)

    def moved_into_the_cut_by_a_lead(self, part: Part) -> bool:
        """Whether the first motion of the program was come to at speed, out of a way that is none of it."""
        rows = np.concatenate(self.rows)
        ids = rows[:, COLUMN["motion_id"]]
        first = int(np.flatnonzero((ids >= 0) & (ids < ENTRY_ID))[0])
        return bool(ids[first - 1] >= ENTRY_ID and rows[first, COLUMN["feed_mm_s"]] > 5.0)

    def _deepest(self, part: Part, tool: Tool) -> float:
        joints = np.concatenate(self.rows)[:, JOINTS]
        joints = joints[np.r_[True, np.abs(np.diff(joints, axis=0)).max(axis=1) > 1e-6]]
        return self._deep(part, tool, joints[:: max(1, len(joints) // LOOKED)])

    def _deep(self, part: Part, tool: Tool, joints: np.ndarray) -> float:
        deep = float(aside_envelope.depths(joints, tool, part.walls, self.stepped.kinematics).max())
        if part.floor_mm is None:
            return deep
        tips = self.stepped.kinematics.forward(tuple(joints.T), tool.length_mm, np).tip
        return max(deep, part.floor_mm - float(np.min(tips[2])))


def _tools(fitted: Machine, tool: Tool) -> tuple[Tool, ...]:
    return tuple(tool if one.number == tool.number else one for one in fitted.tools)


def _sentence(error: tuple[object, ...]) -> str:
    said = error[1]
    return said if isinstance(said, str) else messages.text(said)  # type: ignore[arg-type]
