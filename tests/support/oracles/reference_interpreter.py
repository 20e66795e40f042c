"""LinuxCNC's stand-alone interpreter as a judge: what ``rs274 -g`` makes of a program.

It is found on the path, or where DIRECTRIX_RS274 says (then with LD_LIBRARY_PATH set, if it needs one).
Its canonical calls are turned into positions of the machine's axes, so that offsets, shifts and turns of
both interpreters are compared by what they do.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from support.machines.traced_programs import mill

from controller.geometry.vectors import Frame
from controller.machine.model import OFFSETS, Machine
from controller.plan.report import explained
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import ProgramError

SLOWEST = 0.1  # rs274 makes no feed of G93 slower
ROUND = 3e-3  # rs274 prints four decimals, of inches where the program is in them
_CALL = re.compile(r"N(?:\d+|\.+)\s*([A-Z][A-Z0-9_]*)\((.*)\)$")  # no gap behind numbers of six digits
_PLACES = ("STRAIGHT_TRAVERSE", "STRAIGHT_FEED")


def program() -> str | None:
    """Path of the interpreter; None where it is not installed."""
    return os.environ.get("DIRECTRIX_RS274") or shutil.which("rs274")


def machine(dialect: str = "rs274", kind: str = "fig4a", **changes: Any) -> Machine:
    """X Y Z A C, or the axes of another ``kind``; all work offsets at zero; ``changes``: of its fields."""
    tools = tuple(
        replace(tool, length_mm=length) for tool, length in zip(mill(kind).tools, (10.0, 25.4), strict=False)
    )
    nine = tuple(Frame() for _ in OFFSETS[:9])
    return replace(
        mill(kind), **{"offsets": nine, "unset": (), "tools": tools, "dialect": dialect, **changes}
    )


@dataclass(frozen=True, slots=True)
class Move:
    """One canonical motion: kind and the axes at its end (mm, deg); of arcs the centre in the plane, too."""

    kind: str
    axes: tuple[float, ...]  # of the machine, in its order
    feed: float | None = None

    def near(self, other: Move, within: float = ROUND) -> bool:
        feeds = (
            self.feed is None
            or other.feed is None
            or abs(self.feed - other.feed) < 1e-3 * max(1.0, self.feed)
        )
        apart = max(abs(a - b) for a, b in zip(self.axes, other.axes, strict=True))
        return self.kind == other.kind and apart < within and feeds


@dataclass(frozen=True, slots=True)
class Reading:
    """The moves of a program that lead somewhere, and whether it was refused behind them."""

    moves: list[Move]
    refused: str


def ours(text: str, on: Machine) -> Reading:
    """The same by our reader."""
    read = blocks.stream(text.encode(), on, "p.ngc")
    made: list[Move] = []
    here = (0.0,) * len(on.axes)
    try:
        for step in explained.steps(read, on, "p.ngc", homed(on)):
            if step.kind in ("rapid", *explained.LINES, "arc"):
                axes = tuple(math.nan if q is None else q for q in step.axes.values())
                made.append(Move(kind_of(step), axes, _a_minute(step, here, axes)))
                here = axes
    except ProgramError as error:
        return Reading(_moving(made), str(error))
    return Reading(_moving(made), "")


def kind_of(step: explained.Step) -> str:
    """As the reference has it, which does not tell a stroke into a hole from any other line."""
    return "line" if step.kind in explained.LINES else step.kind


def _a_minute(step: explained.Step, here: tuple[float, ...], there: tuple[float, ...]) -> float | None:
    """Feed; under G93 that of the line, and None of arcs and where X Y Z stand."""
    feed = step.facts.get("feed")
    if step.facts.get("unit") != "s":
        return feed
    way = math.dist(here[:3], there[:3])
    return None if step.kind == "arc" or way < ROUND else way / feed * 60.0


def run(text: str, folder: Path, *options: str, tools: str = "") -> subprocess.CompletedProcess[str]:
    """The interpreter over a program, in ``folder``."""
    found = program()
    assert found is not None
    (folder / "p.ngc").write_text(text)
    (folder / "p.var").write_text("5161 0.0\n5162 0.0\n5163 0.0\n5220 1\n")
    (folder / "p.tbl").write_text(tools)
    command = [found, "-v", "p.var", "-t", "p.tbl", *options, "-g", "p.ngc"]
    apart = {**os.environ, "HOME": str(folder)}  # it keeps its tool table there, and two runs would share it
    return subprocess.run(command, cwd=folder, env=apart, capture_output=True, text=True, timeout=60)


# What a line leaves in force, by the parameters in which the interpreter has it.
_ASKED = {
    "codes": "plane motion_mode coord_system ccomp absolute metric inverse_time units_per_rev",
    "more": "retract_r_plane spindle_on spindle_cw mist flood feed_override tool_offset rpm",
    "tool": "current_tool feed",
}
_PLACE = "(PRINT,@place #5420 #5421 #5422 #5423 #5425)\n"  # of X Y Z A C, in the unit in force
_ASK = _PLACE + "".join(
    f"(PRINT,@{row} {' '.join(f'#<_{name}>' for name in names.split())})\n" for row, names in _ASKED.items()
)


@dataclass(frozen=True, slots=True)
class Left:
    """What the reference has in force after a line; ``moves``: all up to there."""

    codes: frozenset[str]  # of the groups that both have
    feed: float | None  # mm (degrees) a minute; None: under G93, where it is of its line, and where none is
    speed: float
    tool: int
    places: tuple[float, ...]  # X Y Z A C as a program reads them, in the unit in force
    moves: list[Move]


def after_each(lines: Sequence[str], folder: Path, on: Machine) -> tuple[list[Left], str]:
    """After each line of a program; and why it was refused then."""
    text = "".join(f"{line}\n{_ASK}(PRINT,@end)\n" for line in lines)
    told = with_tools(text + "M2\n", folder, on)
    canon, moves, asked, left = _Canon(on), list[Move](), dict[str, float](), list[Left]()
    for line in told.stdout.splitlines():
        row, _, values = line.partition(" ")
        if row == "@end":
            left.append(_left(asked, canon.feed, _moving(moves)))
        elif row.startswith("@"):
            names = _ASKED[row[1:]].split() if row[1:] in _ASKED else "XYZAC"
            asked |= dict(zip(names, map(float, values.split()), strict=True))
        else:
            moves += canon.moves([line])
    refused = told.stderr.partition("executing")[2].strip()[-300:] if told.returncode else ""
    return left, refused


def _left(asked: Mapping[str, float], feed: float, moves: list[Move]) -> Left:
    def either(name: str, on: str, off: str) -> str:
        return on if asked[name] else off

    numbered = {f"G{asked[name] / 10.0:g}" for name in ("plane", "coord_system", "ccomp")}
    motion = asked["motion_mode"]
    switched = {
        "G80" if motion < 0.0 else f"G{motion / 10.0:g}",
        either("absolute", "G90", "G91"),
        either("metric", "G21", "G20"),
        "G93" if asked["inverse_time"] else either("units_per_rev", "G95", "G94"),
        either("retract_r_plane", "G99", "G98"),
        either("spindle_cw", "M3", "M4") if asked["spindle_on"] else "M5",
        ("M9", "M7", "M8", "M7 M8")[int(asked["mist"] + 2 * asked["flood"])],
        either("feed_override", "M48", "M49"),
        either("tool_offset", "G43", "G49"),
    }
    known = feed if asked["feed"] and not asked["inverse_time"] else None
    places = tuple(asked[letter] for letter in "XYZAC")
    return Left(
        frozenset(numbered | switched), known, asked["rpm"], int(asked["current_tool"]), places, moves
    )


def reference(text: str, folder: Path, on: Machine) -> Reading:
    """What the interpreter of LinuxCNC says of a program, run in ``folder``."""
    told = with_tools(text, folder, on)
    out = told.stdout.splitlines()
    refused = told.stderr.partition("executing")[2].strip()[-300:] if told.returncode else ""
    return Reading(_moving(list(_Canon(on).moves(out))), refused)


def with_tools(text: str, folder: Path, on: Machine) -> subprocess.CompletedProcess[str]:
    """As ``run``, with the tools of a machine."""
    rows = [
        f"T{t.number} P{t.number} D{t.radius_mm / 12.7:.8f} Z{t.length_mm / 25.4:.8f} ;\n" for t in on.tools
    ]
    return run(text, folder, tools="".join(rows))


def _moving(moves: list[Move]) -> list[Move]:
    """Without those that end where they begin; arcs may."""
    kept, here = [], (0.0,) * 5
    for move in moves:
        if move.kind == "arc" or max(abs(a - b) for a, b in zip(move.axes, here, strict=True)) > ROUND:
            kept.append(move)
        here = move.axes
    return kept


class _Canon:
    """The state of canonical calls, as far as positions need it."""

    def __init__(self, on: Machine) -> None:
        self._rotaries = ["ABC".index(on.axes[i].name) for i in on.rotary()]
        self.unit, self.turn, self.feed, self.slowest = 1.0, 0.0, 0.0, False
        self.offset, self.shift, self.length = [0.0] * 6, [0.0] * 6, 0.0
        self.plane = "CANON_PLANE_XY"
        self.place = [0.0] * 6  # program coordinates, canonical units

    def moves(self, lines: list[str]) -> Iterator[Move]:
        for line in lines:
            call = _CALL.search(line.strip())
            if call is None:
                continue
            name, told = call.groups()
            numbers = [float(x) for x in re.findall(r"-?\d+\.?\d*", told)]
            if name in _PLACES:
                before, self.place = self.axes(), numbers
                feed = self._feed(name, _stands(before, self.axes()))
                yield Move("line" if name == "STRAIGHT_FEED" else "rapid", self.axes(), feed)
            elif name == "ARC_FEED":
                self._arc(numbers)
                yield Move("arc", self.axes(), self._feed("STRAIGHT_FEED"))
            else:
                self._set(name, told, numbers)

    def _set(self, name: str, told: str, numbers: list[float]) -> None:
        if name == "USE_LENGTH_UNITS":
            self.unit = 25.4 if "INCH" in told else 1.0
        elif name == "SET_G5X_OFFSET":
            self.offset = [*(x * self.unit for x in numbers[1:4]), *numbers[4:]]
        elif name == "SET_G92_OFFSET":
            self.shift = [*(x * self.unit for x in numbers[:3]), *numbers[3:]]
        elif name == "SET_XY_ROTATION":
            self.turn = math.radians(numbers[0])
        elif name == "USE_TOOL_LENGTH_OFFSET":
            self.length = numbers[2] * self.unit
        elif name == "SET_FEED_RATE":
            self.feed, self.slowest = numbers[0] * self.unit, numbers[0] <= SLOWEST
        elif name == "SELECT_PLANE":
            self.plane = told

    def _feed(self, name: str, turns: bool = False) -> float | None:
        """A minute; None where X Y Z stand to four decimals: whether degrees count is not to be seen."""
        return None if name != "STRAIGHT_FEED" or turns or self.slowest else self.feed

    def _arc(self, numbers: list[float]) -> None:
        first, second, _, _, _, along = numbers[:6]
        i, j, k = {"CANON_PLANE_XY": (0, 1, 2), "CANON_PLANE_XZ": (2, 0, 1), "CANON_PLANE_YZ": (1, 2, 0)}[
            self.plane
        ]
        self.place[i], self.place[j], self.place[k] = first, second, along
        self.place[3:] = [*numbers[6:], 0.0, 0.0, 0.0][:3] if len(numbers) > 6 else self.place[3:]

    def axes(self) -> tuple[float, ...]:
        x, y, z = (p * self.unit + s for p, s in zip(self.place[:3], self.shift[:3], strict=True))
        c, s = math.cos(self.turn), math.sin(self.turn)
        x, y = x * c - y * s, x * s + y * c
        x, y, z = (p + o for p, o in zip((x, y, z), self.offset[:3], strict=True))
        turned = [p + s + o for p, s, o in zip(self.place[3:], self.shift[3:], self.offset[3:], strict=True)]
        return x, y, z + self.length, *(turned[i] for i in self._rotaries)


def _stands(before: tuple[float, ...], after: tuple[float, ...]) -> bool:
    """Whether X Y Z do, to what is printed of them."""
    return all(abs(a - b) < ROUND for a, b in zip(before[:3], after[:3], strict=True))


Counts = Mapping[str, int]
