"""A planned path as the text of a program of G1 lines.

Times are given with G93, so that each line takes what the same way takes at the feed of the
contact: F of lines would be the speed of the tip, or of the machine's axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.vectors import Frame, norm
from controller.machine.kinematics import Kinematics
from controller.machine.model import OFFSETS, Machine, Tool
from controller.motion.motions import SurfaceCut
from controller.plan.segment import PathItem, Pause, Segment
from controller.post.chords import Form, corners, poses
from controller.program.program import Act

PLACES = {Form.TIP: "G43.4", Form.JOINTS: "G49"}
DIGITS = 5  # of mm and degrees
SHORTEST_S = 1e-6  # of a line, where its feed is beyond words
COOLANT = {0: "M9", 1: "M7", 2: "M8", 3: "M7 M8"}


@dataclass(frozen=True, slots=True)
class PostOptions:
    """What to write, and for which machine."""

    machine: Machine
    kinematics: Kinematics
    form: Form
    chord_mm: float
    offset: int  # 0 = G54
    blend: bool  # G64 P as CAM programs say it; else G61

    @property
    def frame(self) -> Frame:
        return self.machine.offsets[self.offset]


def post(items: Sequence[PathItem], tools: Iterable[tuple[int, Tool]], asked: PostOptions) -> str:
    """The program of a path. ``tools``: from which order of its own blocks on which tool is in the "
    "spindle."""
    writer = _Writer(asked, list(tools))
    writer.lines.append(f"G21 G90 G17 {OFFSETS[asked.offset]} {_mode(items, asked)} G94")
    for item in items:
        if isinstance(item, Pause):
            writer.pause(item)
            continue
        for segment in item.segments:
            writer.segment(segment)
    return "\n".join([*writer.lines, ""])


def _mode(items: Sequence[PathItem], asked: PostOptions) -> str:
    """How corners are passed; the axis may be off by no more than the chord at the top of the flank."""
    if not asked.blend:
        return "G61"
    segments = (one for item in items for one in item.segments)
    tallest = max(
        (_ruling_mm(one.motion) for one in segments if isinstance(one.motion, SurfaceCut)), default=0.0
    )
    turn = f" Q{_number(math.degrees(asked.chord_mm / tallest))}" if tallest > 0.0 else ""
    return f"G64 P{_number(asked.chord_mm)}{turn}"


class _Writer:
    def __init__(self, asked: PostOptions, tools: list[tuple[int, Tool]]) -> None:
        self._asked, self._tools = asked, tools
        self.lines: list[str] = []
        self._timed = False  # G93 holds
        self._length_said = -1

    def pause(self, item: Pause) -> None:
        if words := _act(item):
            self.lines.append(words)
        if item.act is Act.TOOL:
            self._length_said = -1
        if item.seconds > 0.0:
            self.lines.append(f"G4 P{item.seconds:g}")

    def segment(self, one: Segment) -> None:
        tool = self._tool(one.place.order)
        if tool.number != self._length_said:
            self.lines.append(PLACES[self._asked.form])
            self._length_said = tool.number
        asked, height = self._asked, height_mm(one, tool)
        s, joints = corners(one, asked.kinematics, asked.form, tool.length_mm, height, asked.chord_mm)
        words = self._words(joints[1:], tool)
        times = self._times(one, s)
        for text, time_s in zip(words, times, strict=True):
            self._line(text, time_s)

    def _line(self, words: str, time_s: float | None) -> None:
        if time_s is None:
            self.lines.append(f"G0 {words}")
            return
        mode = "" if self._timed else "G93 "
        self._timed = True
        self.lines.append(f"{mode}G1 {words} F{_number(60.0 / max(time_s, SHORTEST_S))}")

    def _times(self, one: Segment, s: Array) -> list[float | None]:
        """Seconds of each line; none for rapids."""
        if one.feed_mm_s is None:
            return [None] * (len(s) - 1)
        feed = one.feed_at(0.5 * (s[1:] + s[:-1]))
        return [float(t) for t in np.diff(s) / feed]

    def _words(self, joints: Array, tool: Tool) -> Iterator[str]:
        """X Y Z and the two rotaries of each corner."""
        machine = self._asked.machine
        names = [axis.name for axis in machine.axes]
        linear, rotary = list(machine.linear()), list(machine.rotary())
        if self._asked.form is Form.TIP:
            places = poses(joints, tool.length_mm, self._asked.kinematics)[0]
        else:
            places = joints[:, linear]
        for place, row in zip(places.tolist(), joints, strict=True):
            here = self._asked.frame.from_parent((place[0], place[1], place[2]))
            shown = machine.shown(row.tolist())
            words = [f"{letter}{_number(value)}" for letter, value in zip("XYZ", here, strict=True)]
            yield " ".join([*words, *(f"{names[i]}{_number(shown[i])}" for i in rotary)])

    def _tool(self, order: int) -> Tool:
        return [tool for first, tool in self._tools if first <= order][-1]


def height_mm(one: Segment, tool: Tool) -> float:
    """How far above the tip the flank cuts: the longest ruling, or the flute where there is none."""
    return _ruling_mm(one.motion) if isinstance(one.motion, SurfaceCut) else tool.flute_mm


def _ruling_mm(motion: SurfaceCut) -> float:
    return max(float(norm(motion.surface.ruling(i / 32.0))) for i in range(33))


def _act(item: Pause) -> str:
    modal = item.modal
    if item.act is Act.TOOL:
        return f"T{modal.tool} M6"
    if item.act is Act.SPINDLE:
        speed = modal.spindle_rev_min
        return "M5" if speed == 0.0 else f"S{abs(speed):g} {'M3' if speed > 0.0 else 'M4'}"
    if item.act is Act.COOLANT:
        return COOLANT[modal.coolant]
    if item.changing is not None:
        return ""
    return item.act.value if item.act in (Act.STOP, Act.OPTIONAL_STOP, Act.END) else ""


def _number(value: float) -> str:
    text = f"{value:.{DIGITS}f}".rstrip("0")
    return "0." if text in ("-0.", "0.") else text
