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
from controller.service.planner_client import Program
from controller.state.modes import Mode, Request

PERIOD_S = 0.008
JOINTS = of_axes("joint_command", 5)
HEIGHT_MM = 20.0
LOOKED = 250  # rows of a way, at most
HOME = "G21 G90 T2 M6\nG53 G0 Z260.\nG53 G0 X0. Y0. A0. C0.\nM2\n"
OLD = {"radius_mm": 1.5, "length_mm": 0.0}


@dataclass(frozen=True, eq=False)
class Part:
    """A program, and the walls that it leaves."""

    text: str
    walls: tuple[aside_envelope.Wall, ...]
    lines: bool = False  # of a CAM system, made for the old tool

    @staticmethod
    def surfaces(curves: Sequence[tuple[np.ndarray, np.ndarray]], side: float = 1.0) -> Part:
        """G52 blocks: control points of the upper and the lower directrix, (4, 3) each."""
        words = ["G21 G90 G54 G61", "T2 M6", "G42 P1 R0.05" if side > 0.0 else "G41 P1 R0.05"]
        for upper, lower in curves:
            first, *others = [*upper, *lower]
            words.append(f"G52 {_xyz(first)} F600.")
            words += [_xyz(point) for point in others]
        return Part("\n".join([*words, "M2", ""]), _walls(curves, side))

    @staticmethod
    def cam(curves: Sequence[tuple[np.ndarray, np.ndarray]]) -> Part:
        """Short lines beside upright walls, the old tool on their right."""
        words = ["G21 G90 G54 G61", "T2 M6", f"G0 X-5. Y-8. Z{HEIGHT_MM + 5:.3f}"]
        u = np.linspace(0.0, 1.0, 41)
        tips: list[np.ndarray] = []
        for _, lower in curves:
            base = aside_envelope.bezier(np.asarray(lower, float), u)
            along = np.gradient(base, axis=0)
            out = np.stack([along[:, 1], -along[:, 0], 0.0 * u], axis=1)
            tips += list(base + OLD["radius_mm"] * out / np.linalg.norm(out, axis=1)[:, None])
        words += [f"G0 {_xyz(tips[0] + [0, -4, HEIGHT_MM + 5])}", f"G1 {_xyz(tips[0] + [0, -4, 0])} F600."]
        words += [f"G1 {_xyz(tip)}" for tip in tips]
        words += [f"G1 {_xyz(tips[-1] + [0, -4, 0])}", f"G0 Z{HEIGHT_MM + 5:.3f}", "M2", ""]
        return Part("\n".join(words), _walls(curves, 1.0), lines=True)

    @staticmethod
    def random(rng: random.Random, lines: bool = False) -> Part:
        """A wall of one to three blocks that join smoothly, bent and twisted a little."""
        lean = 0.0 if lines else rng.uniform(-3.0, 3.0)
        curves, at, slope = [], np.zeros(3), rng.uniform(-0.15, 0.15)
        for _ in range(rng.randint(1, 3)):
            length, bend = rng.uniform(18.0, 36.0), rng.uniform(-0.2, 0.2)
            step, after = length / 3.0, slope + bend
            end = at + np.array([length, 0.5 * (slope + after) * length, 0.0])
            first, last = np.array([step, slope * step, 0.0]), np.array([step, after * step, 0.0])
            lower = np.array([at, at + first, end - last, end])
            twist = 0.0 if lines else rng.uniform(-0.4, 0.4)
            upper = lower + np.array([0.0, lean, HEIGHT_MM])
            upper[1:3, 1] += twist
            curves.append((upper, lower))
            at, slope = end, after
        return Part.cam(curves) if lines else Part.surfaces(curves, rng.choice((1.0, -1.0)))


def _xyz(point: np.ndarray) -> str:
    return " ".join(f"{letter}{q:.4f}" for letter, q in zip("XYZ", point, strict=True))


def _walls(curves: Sequence[tuple[np.ndarray, np.ndarray]], side: float) -> tuple[aside_envelope.Wall, ...]:
    part = shipped().offsets[0]
    return tuple(aside_envelope.Wall.of(upper, lower, side, part) for upper, lower in curves)


@cache
def machine() -> Machine:
    return with_tool(machine_file.with_period(shipped(), PERIOD_S), 2, **OLD)


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
            fed = (rows[:, COLUMN["line"]] > (6 if part.lines else 3)) & (rows[:, COLUMN["feed_mm_s"]] > 0.0)
            fed &= rows[:, COLUMN["feed_mm_s"]] < 11.0
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
        return float(aside_envelope.depths(joints, tool, part.walls, self.stepped.kinematics).max())


def _tools(fitted: Machine, tool: Tool) -> tuple[Tool, ...]:
    return tuple(tool if one.number == tool.number else one for one in fitted.tools)


def _sentence(error: tuple[object, ...]) -> str:
    said = error[1]
    return said if isinstance(said, str) else messages.text(said)  # type: ignore[arg-type]
