"""What wears: how far each axis has gone, how long spindle and axes have run, how much each tool has cut.

Counted from the recorder's rows, so while programs run as while somebody jogs, and kept over restarts. A tool
may have a life (minutes and metres of cutting, parts), a job of maintenance an interval (of one of the
counters): what comes to its end is an alarm, once, a program is not started with a worn tool unless that is
confirmed, and a change to one waits for Resume.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Collection
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from controller.ipc.control_socket import Values
from controller.ipc.handoff import COLUMN, of_axes
from controller.machine.model import Machine
from controller.messages import Message, message, several
from controller.service.refusals import refused
from controller.state.modes import Mode
from controller.store.service_store import ServiceStore

DOCUMENT = "usage"  # in the store
SAVE_S = 5.0  # a loss of power costs so much of the counters
FASTER = 1.5  # than an axis may go: its zero was found, or rows are missing; that is no travel
SPINDLE, MOTION = "spindle", "motion"
MM_PER_M, DEG_PER_TURN, S_PER_H = 1000.0, 360.0, 3600.0
MAX_ITEMS = 50
MAX_GAP = 50.0  # ticks that are missing between two rows

Rows = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ToolUse:
    """Since the tool, or its insert, was new."""

    cut_s: float = 0.0
    cut_m: float = 0.0  # along the path, at feed
    parts: int = 0
    since_s: float | None = None  # seconds since 1970; None: since it is counted
    most_cut_min: float | None = None
    most_cut_m: float | None = None
    most_parts: int | None = None
    sister: int | None = None  # the tool that comes in its place once it is worn
    told: bool = False  # that it is worn

    @property
    def worn(self) -> bool:
        lives = (
            (self.cut_s / 60.0, self.most_cut_min),
            (self.cut_m, self.most_cut_m),
            (self.parts, self.most_parts),
        )
        return any(most is not None and used >= most for used, most in lives)


@dataclass(frozen=True, slots=True)
class Item:
    """A job of maintenance, due every so many units of a counter."""

    counter: str
    every: float
    base: float = 0.0  # the counter when it was done last
    done_s: float | None = None
    done_by: str = ""
    told: bool = False  # that it is due


@dataclass(slots=True)
class Kept:
    """All that is kept."""

    travel: dict[str, float] = field(default_factory=dict)  # by axis: m, or turns
    hours: dict[str, float] = field(default_factory=dict)  # spindle, motion
    tools: dict[str, ToolUse] = field(default_factory=dict)  # by number
    items: dict[str, Item] = field(default_factory=dict)  # by name


class Usage:
    """``take`` rows as they come; any thread may ask and change; ``save`` waits for the disk."""

    def __init__(self, store: ServiceStore, machine: Machine) -> None:
        """Raises OSError."""
        self.store, self._machine = store, machine
        self._lock = threading.Lock()
        self._kept = store.document(DOCUMENT, taken, Kept())
        self._last: Rows | None = None
        self._used: set[str] = set()  # tools that have cut in this run
        self._changed, self._saved_s = False, 0.0
        axes = len(machine.axes)
        self._command = of_axes("joint_command", axes)
        shown = (abs(axis.shown_per_unit) for axis in machine.axes)
        per = [DEG_PER_TURN if axis.is_rotary else MM_PER_M for axis in machine.axes]
        self._units = np.array([k / one for k, one in zip(shown, per, strict=True)])
        self._most = np.array([FASTER * axis.limits.velocity * machine.period_s for axis in machine.axes])

    # -- counted

    def take(self, rows: Rows, tool: int, turning: bool, fed: Collection[int] = ()) -> None:
        """The next rows; ``tool``: in the spindle, 0 = not known; ``turning``: the spindle; ``fed``: motions
        at feed, in the part. The rows' own "cutting" is of surfaces alone.
        """
        rows = rows[rows[:, COLUMN["mode"]] != Mode.OFF]
        if not len(rows):
            return
        before = self._last if self._last is not None else rows[:1]
        steps = np.abs(np.diff(np.vstack((before, rows))[:, self._command], axis=0))
        ticks = np.diff(np.append(before[-1, COLUMN["tick"]], rows[:, COLUMN["tick"]]))
        steps[steps > self._most * np.clip(ticks, 1.0, MAX_GAP)[:, None]] = 0.0
        self._last = rows[-1:]
        cutting = np.isin(rows[:, COLUMN["motion_id"]], list(fed)) & (rows[:, COLUMN["rate"]] > 0.0)
        with self._lock:
            self._add(steps, len(rows) if turning else 0)
            if tool and cutting.any():
                self._cut(str(tool), rows[cutting, COLUMN["feed_mm_s"]])

    def _cut(self, tool: str, feeds_mm_s: Rows) -> None:
        """A tool has cut: its feed in each tick."""
        use, period_s = self._kept.tools.get(tool, ToolUse()), self._machine.period_s
        cut_s = use.cut_s + len(feeds_mm_s) * period_s
        cut_m = use.cut_m + float(feeds_mm_s.sum()) * period_s / MM_PER_M
        self._kept.tools[tool] = replace(use, cut_s=cut_s, cut_m=cut_m)
        self._used.add(tool)
        self._changed = True

    def _add(self, steps: Rows, turned: int) -> None:
        period_s, kept = self._machine.period_s, self._kept
        moved = int(np.count_nonzero(steps.any(axis=1)))
        self._changed |= bool(moved or turned)
        for axis, gone in zip(self._machine.axes, steps.sum(axis=0) * self._units, strict=True):
            kept.travel[axis.name] = kept.travel.get(axis.name, 0.0) + float(gone)
        for name, ticks in ((MOTION, moved), (SPINDLE, turned)):
            kept.hours[name] = kept.hours.get(name, 0.0) + ticks * period_s / S_PER_H

    def ended(self, whole_part: bool) -> None:
        """A run ended; a whole one is a part of every tool that cut in it."""
        with self._lock:
            for tool in self._used if whole_part else ():
                use = self._kept.tools[tool]
                self._kept.tools[tool] = replace(use, parts=use.parts + 1)
            self._used.clear()
            self._changed = True

    # -- told

    def to_json(self) -> dict[str, Any]:
        """Tools, counters and items."""
        with self._lock:
            tools = [
                {"number": int(n), **asdict(use), "worn": use.worn} for n, use in self._kept.tools.items()
            ]
            for row in tools:  # a note of our own: an alarm of it is given once
                del row["told"]
            counters = [
                {"name": name, "value": self._value(name), "unit": unit}
                for name, unit in self._counters().items()
            ]
            items = [self._item(name, item) for name, item in self._kept.items.items()]
        return {"tools": sorted(tools, key=lambda one: one["number"]), "counters": counters, "items": items}

    def worn(self, tool: int) -> dict[str, Any]:
        """What a sentence about a worn tool has places for; nothing where it is not. Waits for nobody."""
        use = self._kept.tools.get(str(tool))
        if use is None or not use.worn:
            return {}
        return {"number": tool, "cut": use.cut_s / 60.0, "way": use.cut_m, "parts": use.parts}

    def worn_message(self, key: str, tool: int, known: Collection[int]) -> Message | None:
        """That a tool is worn, and what a start from here brings in its place; None where it is not worn."""
        if not (told := self.worn(tool)):
            return None
        worn, sister = message(key, **told), self.sisters(known).get(str(tool))
        return worn if sister is None else several(worn, message("change_sister", sister=sister))

    def sisters(self, known: Collection[int]) -> dict[str, int]:
        """Worn tools, each with what comes in its place: its sister, or that one's; ``known``: all tools."""
        with self._lock:
            found = {number: self._sister(use, known) for number, use in self._kept.tools.items() if use.worn}
        return {number: sister for number, sister in found.items() if sister is not None}

    def _sister(self, use: ToolUse | None, known: Collection[int]) -> int | None:
        """The first that is not worn itself."""
        passed: list[int] = []
        while use is not None and use.worn:
            if use.sister is None or use.sister not in known or use.sister in passed:
                return None
            passed.append(use.sister)
            use = self._kept.tools.get(str(use.sister))
        return passed[-1]

    def due(self) -> list[tuple[str, dict[str, Any]]]:
        """What has come to its end and was not reported yet, as keys of the refusals with their values."""
        found: list[tuple[str, dict[str, Any]]] = []
        with self._lock:
            tools, items = self._kept.tools, self._kept.items
            for number in [number for number, use in tools.items() if use.worn and not use.told]:
                tools[number] = replace(tools[number], told=True)
                found.append(("tool_worn", self.worn(int(number))))
            for name in [name for name, item in items.items() if not item.told]:
                told = self._item(name, items[name])
                if told["due"]:
                    items[name] = replace(items[name], told=True)
                    found.append(("maintenance_due", {key: told[key] for key in ("name", "every", "unit")}))
            self._changed |= bool(found)
        return found

    def _counters(self) -> dict[str, str]:
        """Names and units."""
        axes = {axis.name: "turns" if axis.is_rotary else "m" for axis in self._machine.axes}
        return {**axes, MOTION: "h", SPINDLE: "h"}

    def _value(self, counter: str) -> float:
        return self._kept.travel.get(counter, self._kept.hours.get(counter, 0.0))

    def _item(self, name: str, item: Item) -> dict[str, Any]:
        used = max(0.0, self._value(item.counter) - item.base)
        unit = self._counters().get(item.counter, "")
        told = {key: value for key, value in asdict(item).items() if key not in ("base", "told")}
        return {"name": name, **told, "used": used, "unit": unit, "due": used >= item.every}

    # -- changed

    def set_life(
        self,
        tool: int,
        most_cut_min: float | None,
        most_parts: int | None,
        most_cut_m: float | None = None,
        sister: int | None = None,
    ) -> None:
        """None: it has no such limit."""
        with self._lock:
            use = self._kept.tools.get(str(tool), ToolUse())
            use = replace(use, most_cut_min=most_cut_min, most_cut_m=most_cut_m, most_parts=most_parts)
            self._kept.tools[str(tool)] = replace(use, sister=sister, told=use.told and use.worn)
            self._changed = True

    def renew(self, tool: int) -> None:
        """It has a new edge: counted from nothing."""
        with self._lock:
            use = self._kept.tools.get(str(tool), ToolUse())
            use = replace(use, cut_s=0.0, cut_m=0.0, parts=0, told=False, since_s=time.time())
            self._kept.tools[str(tool)] = use
            self._changed = True

    def set_item(self, name: str, counter: str, every: float) -> None:
        """Make one, or give it another interval. Raises CommandRefused."""
        allowed = self._counters()
        if counter not in allowed:
            raise refused("no_counter", code="bad", counter=counter, allowed=", ".join(allowed))
        with self._lock:
            items = self._kept.items
            if name not in items and len(items) >= MAX_ITEMS:
                raise refused("many_items", code="bad", most=MAX_ITEMS)
            old = items.get(name)
            if old is None or old.counter != counter:
                old = Item(counter, every, base=self._value(counter))
            items[name] = replace(old, every=every, told=False)
            self._changed = True

    def remove_item(self, name: str) -> None:
        """Raises CommandRefused."""
        with self._lock:
            if self._kept.items.pop(name, None) is None:
                raise refused("no_item", code="bad", name=name)
            self._changed = True

    def done(self, name: str, by: str) -> None:
        """It was done just now. Raises CommandRefused."""
        with self._lock:
            if (item := self._kept.items.get(name)) is None:
                raise refused("no_item", code="bad", name=name)
            item = replace(item, base=self._value(item.counter), done_s=time.time(), done_by=by, told=False)
            self._kept.items[name] = item
            self._changed = True

    # -- kept

    def save(self, at_once: bool = False) -> None:
        """Keep what has changed, whole or not at all, now and then. Raises OSError."""
        now_s = time.monotonic()
        if not self._changed or not (at_once or now_s - self._saved_s >= SAVE_S):
            return
        self._saved_s = now_s
        with self._lock:
            values, self._changed = asdict(self._kept), False
        try:
            self.store.put(DOCUMENT, values)
        except OSError:
            self._changed = True
            raise


def taken(told: Any) -> Kept:
    """Raises ValueError, KeyError, TypeError or AttributeError for what is not sound."""
    numbers = {key: {str(n): float(v) for n, v in told[key].items()} for key in ("travel", "hours")}
    if not all(math.isfinite(v) for of in numbers.values() for v in of.values()):
        raise ValueError("a counter is no number")
    tools = {str(int(number)): ToolUse(**use) for number, use in told["tools"].items()}
    return Kept(**numbers, tools=tools, items={name: Item(**item) for name, item in told["items"].items()})


# Tool life and maintenance as the door has them: changed by their verbs, and asked before a start.

LONGEST_NAME = 60


def check_worn(usage: Usage, tool: int, program: str, known: Collection[int]) -> None:
    """Raises CommandRefused "worn" where the tool in the spindle is, and M6 brings no sister of it."""
    if (told := usage.worn(tool)) and str(tool) not in usage.sisters(known):
        raise refused("worn", "READY", "START", "worn", program=program, **told)


def tool_life(usage: Usage, values: Values) -> Values:
    """Limits of a tool; null: none. Raises CommandRefused."""
    tool, sister = values["tool"], values["sister"]
    if sister == tool:
        raise refused("no_sister", code="bad", tool=tool, value=sister)
    usage.set_life(tool, values["cut_min"], values["parts"], values["cut_m"], sister)
    return _saved(usage)


def tool_renewed(usage: Usage, values: Values) -> Values:
    """Raises CommandRefused."""
    usage.renew(values["tool"])
    return _saved(usage)


def maintenance(usage: Usage, values: Values) -> Values:
    """Make, change or (without an interval) take out a job of maintenance. Raises CommandRefused."""
    name = _name(values)
    if values["every"] is None:
        usage.remove_item(name)
    else:
        usage.set_item(name, values["counter"], values["every"])
    return _saved(usage)


def maintained(usage: Usage, values: Values) -> Values:
    """Raises CommandRefused."""
    usage.done(_name(values), values["by"][:LONGEST_NAME])
    return _saved(usage)


def _saved(usage: Usage) -> dict[str, Any]:
    """Save the usage before the answer is given. Raises CommandRefused."""
    try:
        usage.save(at_once=True)
    except OSError as error:
        raise refused("not_written", code="busy", path=usage.store.file, why=error) from error
    return usage.to_json()


def _name(values: Values) -> str:
    """Raises CommandRefused for one that nobody could see."""
    name = str(values["name"])
    if not name.strip() or not name.isprintable():
        raise refused("no_item_name", code="bad", most=LONGEST_NAME)
    return name.strip()
