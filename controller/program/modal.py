"""The modal state. It is replaced, never edited: a line that is refused leaves the old one as it was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

from controller.machine.model import TOOL_AT_POWER_ON, Machine, Tool
from controller.messages import Key, Message, message
from controller.program.codes import SURFACES, ParsedLine
from controller.program.origins import Origins
from controller.program.position import Coordinate
from controller.program.program import (
    Modal,
    Side,
    Tip,
)
from controller.program.words import Word

TIPS = MappingProxyType(
    {
        **dict.fromkeys(("G43", "G43.1", "G43.2", "G44"), Tip.OFF),
        "G43.4": Tip.ROTARIES,
        "G234": Tip.ROTARIES,
        "G43.5": Tip.VECTORS,
    }
)
INCHES = ("G20", "G70")
BLU_PER_MM = 100.0  # the paper's basic length unit is 0.01 mm (and 0.01 mm/min)
FEEDS = (1e-4, 1e7)  # units a minute: below, a millimetre takes a week; above, no drive follows
MAX_DWELL_S = 604_800.0


@dataclass(frozen=True, slots=True)
class Cycle:
    """What the words of a canned cycle leave to its next line; lengths in mm as written."""

    code: str
    bottom: float
    clearance: float
    level: float  # where the series began, along the cycle's axis in program coordinates
    depth: float | None = None  # Q
    seconds: float | None = None  # P
    shift: tuple[float, float] | None = None  # of boring: the way off the wall, in the plane
    mm_per_unit: float = 1.0  # in which its lengths were written

    def in_mode(self, absolute: bool) -> Cycle:
        """The same heights as words under G90 (``absolute``) or G91 say them, of words under the other."""
        if absolute:
            clearance = self.level + self.clearance
            return replace(self, clearance=clearance, bottom=clearance + self.bottom)
        return replace(self, clearance=self.clearance - self.level, bottom=self.bottom - self.clearance)


@dataclass(frozen=True, slots=True)
class Begun:
    """A tilted plane whose definition takes several lines, as far as they have been read."""

    code: str  # G68.2 or G68.4
    p: int
    line: int  # where it begins
    rows: Mapping[int, Mapping[str, float]]  # words (mm, degrees) by Q


NO_MOTION = message("cleared.none")


class State(NamedTuple):
    """Everything one line leaves to the next."""

    modal: Modal
    motion: str = ""  # G0 to G3, a cycle, or nothing
    beneath: str = ""  # of a cycle under fanuc: what was modal before, and is behind G80
    cleared: Message = NO_MOTION
    mm_per_unit: float = 1.0
    side: str = "G40"
    absolute: bool = True
    selected: int | None = None  # T
    speed_rev_min: float = 0.0  # S
    turning: int = 0  # M3: 1, M4: -1, M5: 0
    feed_deg_s: float | None = None  # the modal F as moves of rotaries alone read it; None as that of lengths
    inverse: bool = False  # G93: F is one over the minutes that its line takes
    per_turn: bool = False  # G95: F is for a turn of the spindle ...
    turn_feed: tuple[float, float] | None = None  # ... mm and degrees
    centres_absolute: bool = False  # G90.1
    to_clearance: bool = False  # G99: canned cycles end at R
    cycle: Cycle | None = None  # the canned cycle that is modal
    origins: Origins = Origins()
    tools: Mapping[int, Tool] = MappingProxyType({})  # as G10 changed them, their wear beside their size
    references: Mapping[str, tuple[Coordinate, ...]] = MappingProxyType({})
    offset_number: Word | None = None  # D of a line without G41 (Fanuc), for the next one without D
    noted: frozenset[str] = frozenset()  # codes that a remark has told of
    curve_goes: tuple[float, float] | None = None  # mm: where the G5 before leads on to
    begun: Begun | None = None  # a tilted plane that takes more lines
    polar: tuple[float, float, float, float] | None = None  # G16: its pole (mm), radius (mm), angle (rad)
    answer: float | None = None  # of the last M66: what its input is where the program goes on
    marks: int = 0  # stops between the steps of a tool changer, so far
    length_code: str = "G49"  # of the group that has G43
    length_number: Word | None = None  # H of a line without G43 (Fanuc), for the next one without H
    length_tool: int = 0  # H: the tool whose length G43 adds; 0 = none, or a length as written
    radius_tool: int = 0  # D: the tool by whose radius G41 and G42 keep off; 0 = the one in the spindle
    parameters: tuple[tuple[str, float], ...] = ()  # that lines by hand have left, by number or name

    def time(self, ask: ParsedLine, code: str, word: Word) -> float | None:
        """Seconds that a feed motion takes under G93, None under G94; ProgramError for G93 without F."""
        if not self.inverse:
            return None
        if "F" not in ask.words:
            raise ask.refusal(word, "feed.inverse_without", code=code)
        return 60.0 / ask.words["F"].value

    def table_tool(self, number: int, machine: Machine) -> Tool | None:
        """A tool of the table, as G10 has changed it, its wear beside its size."""
        return self.tools.get(number) or machine.table_tool(number)

    def with_table_tool(self, tool: Tool, machine: Machine) -> State:
        """The state with a tool of the table changed."""
        state = self._replace(tools=MappingProxyType({**self.tools, tool.number: tool}))
        if self.modal.tool != tool.number:
            return state
        return state._replace(modal=state.with_tool(tool.number, machine))

    def tool(self, number: int, machine: Machine) -> Tool | None:
        """The same as it is cut with: worn."""
        found = self.table_tool(number, machine)
        return None if found is None else found.worn

    def named(self, number: int, machine: Machine) -> Tool | None:
        """The tool that H or D means: the one in the spindle, where it has come in the place of that one."""
        comes = machine.comes(number)
        return self.tool(comes if comes == self.modal.tool else number, machine)

    def with_tool(self, number: int, machine: Machine) -> Modal:
        """The modal state with another tool in the spindle."""
        cutter = self.tool(number, machine) if number in self.tools else None
        return replace(self.modal, tool=number, cutter=cutter)

    def with_origins(self, origins: Origins, machine: Machine) -> State:
        """The state in which positions are read by ``origins``."""
        part = None if origins.untouched(machine) else origins.frame(machine)
        turned = origins.turned_rad(machine)
        tilted = origins.plane is not None
        modal = replace(self.modal, offset=origins.index, part=part, turned_rad=turned, tilted=tilted)
        return self._replace(origins=origins, modal=modal)

    def feed_of_pitch(self, pitch_mm: float) -> float:
        """Of a thread at S, mm/s."""
        return pitch_mm * self.speed_rev_min / 60.0

    def feed(self, ask: ParsedLine, code: str, word: Word) -> float:
        """The modal F for a motion, mm/s; ProgramError where there is none."""
        if self.inverse and code in SURFACES:
            raise ask.refusal(word, "feed.per_minute_only", code=code)
        feed = self.modal.feed_mm_s
        if feed is None and self.turn_feed is not None:
            raise ask.refusal(word, "feed.standing", code=code)
        if feed is None:
            raise ask.refusal(word, "feed.none", code=code)
        return feed


TURNS = {1: "M3", -1: "M4"}  # by the sense in which the spindle turns


def turning_refusal(machine: Machine, tool: int, sense: int, rev_min: float) -> Message | None:
    """Why the spindle must not turn so fast with this tool in it; None: it may. ``sense``: of ``TURNS``."""
    if not machine.may_turn(tool):
        return message("spindle.must_stand", code=TURNS[sense], tool=tool)
    if rev_min > (most := machine.max_rev_min(tool)):
        return message("spindle.too_fast_for_tool", speed=rev_min, tool=tool, most=most)
    return None


def power_on() -> State:
    """T1 in the spindle, G17 G21 G40 G49 G54 G61 G90 G94, spindle and coolant off (DESIGN 1)."""
    return State(Modal(TOOL_AT_POWER_ON, 0, Side.RIGHT, 0.0, True, 0.0, 0.0, None, 0.0, 0))


def begun(machine: Machine, left: State | None = None) -> State:
    """The state in which a program begins on a machine, under the offsets that it has by then.

    ``left``: what was in force before, as ``controller.program.carried`` has it; None: that at power-on.
    """
    if left is not None:
        return left.with_origins(left.origins, machine)
    state = power_on().with_origins(Origins.begun(machine), machine)
    if machine.changer is None:
        return state
    return state._replace(modal=state.with_tool(machine.in_spindle, machine))


def dwell_s(ask: ParsedLine, word: Word, machine: Machine) -> float:
    """The seconds of a dwell: P in seconds; under fanuc without a point in milliseconds."""
    seconds = ask.not_negative(word)
    if machine.dialect == "fanuc" and not word.point:
        seconds /= 1000.0
    if seconds > MAX_DWELL_S:
        raise ask.refusal(word, "dwell.too_long", hours=seconds / 3600.0, most=MAX_DWELL_S)
    return seconds


def tool_list(machine: Machine) -> str:
    """The tool table in a few words, for sentences."""
    return " ".join(f"T{tool.number}" for tool in machine.tools) or Key("tool.none")
