"""The rows of five-axis lines in a CL file (APT, ISO 4343) or a program: tips of the tool with its axes.

A row is a run of lines at feed whose axis turns: rapids, dwells, arcs and sharp corners end one. Of
MOVNRB/5AXIS (PTC Creo's "CL Output for NURBS Interpolation": the curve of the tip and one LENGTH above it,
each with its control points) a row has both curves, and the lines between NEXT and OFF to be compared with.
Lines of a CL file keep the last axis where they name none.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from controller.cad.curve import Nurbs
from controller.geometry.arrays import Array
from controller.geometry.vectors import Vector, unit
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.machine.tool_profile import flank_mm
from controller.messages import TextError, message
from controller.program import blocks, linked
from controller.program.program import JointMotion, TipLine

MIN_POINTS = 4
STANDS_RAD = 1e-5  # an axis that turns by less on a line stands: there no surface is ruled anew
CORNER_COSINE = 0.85  # of the turn between two lines, 32 degrees: the row ends there
PLUNGE_COSINE = 0.7  # of the angle between travel and axis: the tool goes along its axis
SAME_MM = 1e-6
INCH_MM = 25.4
MAX_ORDER = 24  # of MOVNRB; more than any CAM system writes


class BadPath(TextError):
    """What is wrong in a file of lines, with its place."""


@dataclass(frozen=True, eq=False)
class Row:
    """Tips (N, 3) in mm and unit axes (N, 3) of lines that follow each other, in the part frame.

    ``curves``: of MOVNRB, those of the tip and of a place above it. Radius and flank are of the file's tool;
    None where it does not say.
    """

    number: int
    lines: tuple[int, ...]  # of the file, of each tip; of MOVNRB that of ON before them
    tips: Array
    axes: Array
    radius_mm: float | None
    flank_mm: float | None
    curves: tuple[Nurbs, Nurbs] | None = None
    tool: int | None = None  # by its number

    @property
    def line(self) -> int:
        """Where it begins in the file."""
        return self.lines[0]

    @property
    def kind(self) -> str:
        return "lines" if self.curves is None else "nurbs"


def read(file: Path, machine: Machine, is_program: bool) -> list[Row]:
    """The rows of a CL file, or of a program. Raises BadPath, ProgramError."""
    rows = _of_program(file, machine) if is_program else _ClReader(file).rows()
    found = [part for row in rows for part in _parts(row)]
    return [replace(row, number=i + 1) for i, row in enumerate(found)]


def _parts(row: Row) -> Iterator[Row]:
    """A row between its corners, without leads, plunges along the tool and what does not turn."""
    if row.curves is not None:
        yield row
        return
    moves = np.linalg.norm(np.diff(row.tips, axis=0), axis=1) > SAME_MM
    keeps = np.concatenate([[True], moves])
    tips, axes, lines = row.tips[keeps], row.axes[keeps], np.array(row.lines)[keeps]
    if len(tips) < MIN_POINTS:
        return
    ways = np.diff(tips, axis=0)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    along = np.abs((ways * axes[1:]).sum(axis=1)) > PLUNGE_COSINE
    turns = (ways[1:] * ways[:-1]).sum(axis=1) < CORNER_COSINE
    breaks = {int(k) + 1 for k in np.flatnonzero(turns)} | {0, len(ways)}
    breaks |= {int(k) + d for k in np.flatnonzero(along) for d in (0, 1)}
    ends = sorted(breaks)
    for a, b in pairwise(ends):
        turning = np.flatnonzero((axes[a + 1 : b + 1] * axes[a:b]).sum(axis=1) < np.cos(STANDS_RAD))
        if len(turning) + 1 >= MIN_POINTS:  # leads, on which the axis stands, are none of it
            of = slice(a + int(turning[0]), a + int(turning[-1]) + 2)
            yield replace(row, lines=tuple(lines[of].tolist()), tips=tips[of], axes=axes[of])


def _of_program(file: Path, machine: Machine) -> Iterator[Row]:
    """Of lines under G43.4 and G43.5."""
    kinematics, rotaries = kinematics_of(machine), [0.0, 0.0]
    tip: list[float | None] = [None, None, None]
    text = linked.linked(file.read_bytes(), linked.beside(file), machine)
    tips: list[Vector] = []
    axes: list[Vector] = []
    lines: list[int] = []
    begun: TipLine | None = None
    axis: Vector = (0.0, 0.0, 1.0)

    def row() -> Iterator[Row]:
        if begun is not None and len(tips) >= MIN_POINTS:
            tool = begun.modal.tool_in(machine)
            radius, flank = (None, None) if tool is None else (tool.radius_mm, flank_mm(tool))
            number = begun.modal.tool
            yield Row(0, tuple(lines), np.array(tips), np.array(axes), radius, flank, None, number)

    for block in blocks.stream(text, machine, str(file)):
        if isinstance(block, TipLine):
            tip = [_gone(q, word, block.relative) for q, word in zip(tip, block.tip, strict=True)]
            if block.axis is not None:
                axis = unit(block.axis)
            else:
                for k, word in enumerate(block.rotaries):
                    rotaries[k] = _gone(rotaries[k], word, block.relative) or 0.0
                turned = kinematics.tool_axis((rotaries[0], rotaries[1]))
                axis = block.modal.frame(machine).turn_back(turned)
        elif isinstance(block, JointMotion):
            tip = [None, None, None]
        x, y, z = tip
        feeds = isinstance(block, TipLine) and block.feed_mm_s is not None
        if not feeds:
            yield from row()
            tips, axes, lines, begun = [], [], [], None
        if isinstance(block, TipLine) and x is not None and y is not None and z is not None:
            begun = (begun or block) if feeds else None
            tips.append((x, y, z))
            axes.append(axis)
            lines.append(block.place.line)
    yield from row()


def _gone(now: float | None, word: float | None, relative: bool) -> float | None:
    if word is None:
        return now
    return word if not relative else None if now is None else now + word


# ---- CL files


_COMMENT = re.compile(r"\$\$.*")


class _ClReader:
    """Statements of a CL file to rows."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._unit = 1.0
        self._radius: float | None = None
        self._flank: float | None = None
        self._tool: int | None = None
        self._axis: Vector = (0.0, 0.0, 1.0)
        self._points: list[tuple[int, Vector, Vector]] = []  # line, tip, axis
        self._rapid = False
        self._nurbs: dict[str, list[float]] | None = None  # of the MOVNRB that is on, by its statements
        self._length: float | None = None  # of 5AXIS

    def rows(self) -> Iterator[Row]:
        found = False
        for line, name, values in self._statements():
            if name in ("GOTO", "MOVNRB"):
                found = True
            yield from self._taken(line, name, values)
        yield from self._ended()
        if not found:
            raise BadPath(message("cad.path.nothing", file=self._file))

    def _statements(self) -> Iterator[tuple[int, str, list[str]]]:
        """Line, major word and what follows its slash; $ at the end of a line goes on in the next."""
        whole, begins = "", 0
        for number, raw in enumerate(
            self._file.read_text(encoding="utf-8", errors="replace").splitlines(), 1
        ):
            text = _COMMENT.sub("", raw).rstrip()
            begins = begins or number
            if text.endswith("$"):
                whole += text[:-1]
                continue
            name, _, values = (whole + text).partition("/")
            if name.strip():
                yield begins, name.strip().upper(), [v.strip().upper() for v in values.split(",")]
            whole, begins = "", 0

    def _taken(self, line: int, name: str, values: list[str]) -> Iterator[Row]:
        if name == "UNITS":
            self._unit = INCH_MM if values[0].startswith("INCH") else 1.0
        elif name == "RAPID":
            self._rapid = True
        elif name in ("CUTTER", "TLDATA"):
            numbers = self._numbers(line, [v for v in values if v != "MILL"])
            self._radius = 0.5 * numbers[0] * self._unit if numbers[0] > 0.0 else None
            heights = numbers[6:7] if name == "CUTTER" else numbers[2:3]
            self._flank = heights[0] * self._unit if heights else None
            if any(numbers[4:6] if name == "CUTTER" else numbers[3:5]):
                raise self._wrong(line, "cad.path.taper")
        elif name == "LOADTL":
            self._tool = int(values[0]) if values[0].isascii() and values[0].isdigit() else None
            yield from self._ended()
        elif name == "GOTO":
            yield from self._to(line, self._numbers(line, values))
        elif name == "MOVNRB":
            yield from self._movnrb(line, values)
        elif name in ("FROM", "CIRCLE", "ARC", "GODLTA", "GOFWD", "CYCLE", "DELAY", "GOHOME"):
            yield from self._ended()

    def _to(self, line: int, numbers: Sequence[float]) -> Iterator[Row]:
        if len(numbers) not in (3, 6):
            raise self._wrong(line, "cad.path.goto", count=len(numbers))
        x, y, z = (q * self._unit for q in numbers[:3])
        if len(numbers) == 6:
            if not any(numbers[3:]):
                raise self._wrong(line, "cad.path.no_axis")
            self._axis = unit((numbers[3], numbers[4], numbers[5]))
        if self._rapid:
            yield from self._ended()
            self._rapid = False
        self._points.append((line, (x, y, z), self._axis))

    def _ended(self) -> Iterator[Row]:
        points, self._points = self._points, []
        if len(points) >= MIN_POINTS:
            yield self._row([one[0] for one in points], points, None)

    def _row(
        self, lines: list[int], points: list[tuple[int, Vector, Vector]], curves: tuple[Nurbs, Nurbs] | None
    ) -> Row:
        tips, axes = (np.array([one[k] for one in points]).reshape(-1, 3) for k in (1, 2))
        return Row(0, tuple(lines), tips, axes, self._radius, self._flank, curves, self._tool)

    def _movnrb(self, line: int, values: list[str]) -> Iterator[Row]:
        what = values[0]
        if what == "5AXIS":
            lengths = self._numbers(line, [v for v in values[1:] if v != "LENGTH"])
            self._length = lengths[0] * self._unit if lengths else None
            if not self._length or self._length < 0.0:
                raise self._wrong(line, "cad.path.no_length")
        elif what == "M3AXIS":
            self._length = None
        elif what == "ON" and self._length is not None:
            yield from self._ended()
            self._nurbs = {"line": [line], "ON": self._numbers(line, values[1:])}
        elif what == "OFF" and self._nurbs is not None:
            yield self._nurbs_row(self._nurbs)
            self._nurbs, self._points = None, []
        elif what in ("1", "2", "3") and self._nurbs is not None:
            self._nurbs.setdefault(what, []).extend(self._numbers(line, values[1:]))

    def _nurbs_row(self, said: dict[str, list[float]]) -> Row:
        line, head = int(said["line"][0]), said["ON"]
        order, count = int(head[0]), int(head[3]) if len(head) > 3 else 0
        if len(head) < 4 or not 2 <= order <= MAX_ORDER:
            raise self._wrong(line, "cad.path.nurbs_head")
        knots, low, high = (said.get(what, []) for what in "123")
        if len(knots) != count + order or len(low) != 3 * count or len(high) != 3 * count:
            sizes = {"knots": len(knots), "low": len(low) / 3.0, "high": len(high) / 3.0}
            raise self._wrong(line, "cad.path.nurbs_counts", order=order, count=count, **sizes)
        if any(b < a for a, b in pairwise(knots)) or knots[0] == knots[-1]:
            raise self._wrong(line, "cad.path.nurbs_knots")
        curves = [
            Nurbs(order, np.array(knots), np.array(one).reshape(-1, 3) * self._unit, np.ones(count)).written()
            for one in (low, high)
        ]
        return self._row([line, *(one[0] for one in self._points)], self._points, (curves[0], curves[1]))

    def _numbers(self, line: int, values: Iterable[str]) -> list[float]:
        found = []
        for value in values:
            try:
                found.append(float(value))
            except ValueError:
                raise self._wrong(line, "cad.path.no_number", found=value) from None
        if not found or not np.isfinite(found).all():
            raise self._wrong(line, "cad.path.no_number", found=", ".join(values))
        return found

    def _wrong(self, line: int, key: str, **values: object) -> BadPath:
        return BadPath(message(key, file=self._file, line=line, **values))
