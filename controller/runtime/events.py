"""What happened in a run by ticks, one JSON object a line.

An operator writes the ``--events`` file of ``simulate``: requests at ticks. The record of a live run is
such a file, too, with more kinds of lines, so that every setpoint comes again:

    begin               first: where the machine stood, what was fitted
    plan                before this tick the planner acted, with ``value`` seconds for itself
    retract, return     likewise, for a way off the path by ``value`` mm, or back (with what was fitted then)
    pieces              with this tick its message was taken
    stand               after a long gap the path was stood still before this tick
    wait                from this tick on motion waited for spindle, coolant or clamps (1), or no more (0)
    thread              from this tick on the spindle led the axes so far (mm) beyond the law of their thread,
                        and whether it had settled
    adaptive            from this tick on the load of the spindle left so much (share) of the feed
    fault               in this tick drives or devices had the fault ``value``
    stock               from this tick on each was late and found its period played out of the stock (1), or
                        after its end, braking or at rest (2), or no more (0)
    taken_back          before this tick the step of the one before was taken back: the stock was played
                        instead, as with ``stock``
    off_path            from this tick on the setpoints are where the drives were, and are not made again

Tick -1 is before the start. ``at`` is the machine's own count of ticks, which orders the lines, and ``late``
says that its tick sent no SYNC: ``tick`` is the next one that did.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from controller import sealed_file
from controller.commands.table import MAX_OVERRIDE, SWITCHED
from controller.ipc.handoff import Jog
from controller.messages import Key, Message, TextError, message
from controller.runtime import summed_lines
from controller.runtime.starts import Start
from controller.state import record_files
from controller.state.modes import Fault, Request

REQUESTS = {
    "hold": Request.HOLD,
    "resume": Request.RESUME,
    "stop": Request.STOP,
    "override": Request.OVERRIDE,
    "rapid_override": Request.RAPID_OVERRIDE,
    **{switch.name: request for request, switch in SWITCHED.items()},
}
RECORDED = {  # by a live run alone
    "estop": Request.ESTOP,
    "plan_lost": Request.PLAN_LOST,
    "jog": Request.JOG,
    "jog_stop": Request.JOG_STOP,
    "spindle_override": Request.SPINDLE_OVERRIDE,
    "spindle": Request.SPINDLE,
    "coolant": Request.COOLANT,
    "clamps": Request.CLAMPS,
    "prepare": Request.PREPARE,
}
FILE, PROGRAM, MACHINE = record_files.EVENTS, record_files.PROGRAM, record_files.MACHINE
OVERRIDES = ("override", "rapid_override")
BY_HAND = ("spindle_override", "spindle", "coolant", "clamps", "prepare")  # nothing of them moves an axis
SWITCHES = tuple([switch.name for switch in SWITCHED.values()])
STAND, PLAN, RETRACT, RETURN, ASIDE = "stand", "plan", "retract", "return", "aside"
WAIT, FAULT, OFF_PATH, PIECES, BEGIN = "wait", "fault", "off_path", "pieces", "begin"
THREAD, ADAPTIVE, STOCK, TAKEN_BACK = "thread", "adaptive", "stock", "taken_back"
TURNS = (PLAN, RETRACT, RETURN)
_RANKS = {STAND: 0, PLAN: 1, RETRACT: 1, RETURN: 1, PIECES: 3}  # within a tick; all others between
_KEYS = frozenset({"tick", "request", "value"})
_RECORDED_KEYS = _KEYS | {"share", "at", "late"}


class EventError(TextError):
    """What is wrong in an events file, with file and line."""


@dataclass(frozen=True, slots=True)
class Event:
    """``request`` reaches the tick of trace row ``tick``; ``value`` is a share (1.0 = 100 %) or a switch."""

    tick: int
    request: Request
    value: float = 0.0
    jog: Jog | None = None


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a record: ``event`` of an operator, or what else happened."""

    tick: int
    kind: str
    at: int | None = None  # the machine's own count; None in a record of an older version
    late: bool = False  # in a tick that sent no SYNC
    event: Event | None = None
    value: Any = None


@dataclass(frozen=True, slots=True)
class Begin:
    """How a recorded run began."""

    start: Start
    fitted: dict[str, Any]  # offsets and tools, as ``fitting`` keeps them
    program_sha256: str
    machine_sha256: str
    period_s: float | None = None  # None: an old record, at the machine file's


class SpoiltLine(NamedTuple):
    """A line of a record that is not as it was written; it came in or after ``tick``."""

    number: int
    tick: int
    why: Message
    is_mended: bool  # by its sum: one bit of it was other, or it only stood elsewhere


@dataclass(frozen=True, slots=True)
class Recorded:
    """All of a record's events, in the order in which they came to the machine."""

    begin: Begin
    lines: tuple[Line, ...]
    spoilt: tuple[SpoiltLine, ...] = ()

    @property
    def lost(self) -> list[SpoiltLine]:
        """Lines that are not known any more."""
        return [one for one in self.spoilt if not one.is_mended]


def read(path: Path) -> tuple[Event, ...]:
    """An operator's events of a file in the order of their ticks. Raises EventError."""
    found = [one.event for one in _lines(path) if isinstance(one, Line) and one.event is not None]
    return tuple(sorted(found, key=lambda event: event.tick))


def recorded(path: Path, count: int | None = None) -> Recorded | None:
    """The record of a live run; None where an operator wrote the file. ``count``: of its lines, where the end
    of the run says so. Raises EventError, also where the beginning itself is spoilt.
    """
    data = _read(path)
    if count is None and not sealed_file.has_sum(data):  # of an older version
        found, spoilt = _lines(path), list[SpoiltLine]()
    else:
        summed, spoilt = _sound(path, data, count)
        found = [_line(f"{path}:{n}", summed[n], _RECORDED_KEYS) for n in sorted(summed)]
    begin = next((one for one in found if isinstance(one, Begin)), None)
    if begin is None:
        if spoilt:
            raise EventError(message("events.damaged", where=f"{path}:1", why=spoilt[0].why))
        return None
    lines = [one for one in found if isinstance(one, Line)]
    return Recorded(begin, tuple(sorted(lines, key=_order)), tuple(spoilt))


def _sound(path: Path, data: bytes, count: int | None) -> tuple[dict[int, dict[str, Any]], list[SpoiltLine]]:
    """The lines of a record by their numbers, and those that are spoilt."""
    found, spoilt = summed_lines.read(data, count)
    lines, tick = list[SpoiltLine](), -1
    for number in range(1, max((*found, *spoilt), default=0) + 1):
        if number in found:
            tick = max(tick, int(found[number].get("tick", tick)))
        if number in spoilt:
            lines.append(SpoiltLine(number, tick, spoilt[number], number in found))
    return found, lines


def has_sums(path: Path) -> bool:
    """Whether a record's lines have sums; those of older versions have none. Raises OSError."""
    return sealed_file.has_sum(path.read_bytes())


def _order(line: Line) -> tuple[int, int, int, int]:
    """A record of an older version is in order within a tick."""
    if line.at is None:
        return line.tick, 0, 0, 0
    return line.tick, 0 if line.late or line.tick < 0 else 1, line.at, _RANKS.get(line.kind, 2)


def _read(path: Path) -> bytes:
    """Raises EventError."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise EventError(message("events.unreadable", path=path, why=error)) from error


def _lines(path: Path) -> list[Line | Begin]:
    """Of an operator, or of a record of an older version. Raises EventError."""
    try:
        text = _read(path).decode()
    except UnicodeDecodeError as error:
        raise EventError(message("events.no_text", path=path, start=error.start)) from error
    lines = text.splitlines()
    is_record = bool(lines) and '"request": "begin"' in lines[0]
    if is_record and not text.endswith("\n"):
        del lines[-1]  # its writer did not live to write it to its end
    keys = _RECORDED_KEYS if is_record else _KEYS
    numbered = ((f"{path}:{n}", line) for n, line in enumerate(lines, 1) if line.strip())
    return [_line(where, _unpacked(where, line), keys) for where, line in numbered]


def _unpacked(where: str, line: str) -> Any:
    """Raises EventError."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits
        why = error.msg if isinstance(error, json.JSONDecodeError) else Key("events.too_long")
        raise EventError(message("events.no_json", where=where, why=why)) from error


def _line(where: str, data: Any, keys: frozenset[str]) -> Line | Begin:
    if not isinstance(data, dict) or (unknown := set(data) - keys):
        key = "events.unknown_key" if isinstance(data, dict) else "events.no_object"
        found = sorted(unknown)[0] if isinstance(data, dict) else ""
        raise EventError(message(key, where=where, name=found))
    request = data.get("request")
    if request == BEGIN:
        return _begin(where, data.get("value"))
    if request == ASIDE:
        raise EventError(message("events.led_aside", where=where))
    if request in (STAND, PIECES, WAIT, FAULT, OFF_PATH, THREAD, ADAPTIVE, STOCK, TAKEN_BACK, *TURNS):
        return _happened(where, data)
    return _parsed_request(where, data)


def _parsed_request(where: str, data: dict[str, Any]) -> Line:
    """A request of the operator. Raises EventError."""
    tick, request, is_recorded = data.get("tick"), data.get("request"), "at" in data
    if not isinstance(tick, int) or isinstance(tick, bool) or tick < (-1 if is_recorded else 0):
        raise EventError(message("events.tick", where=where, tick=tick))
    known = {**REQUESTS, **RECORDED} if is_recorded else REQUESTS
    if not isinstance(request, str) or request not in known:
        raise EventError(message("events.request", where=where, request=request, names=", ".join(REQUESTS)))
    jog = _jog(where, data.get("value")) if request == "jog" else None
    event = Event(tick, known[request], _value(where, request, data), jog)
    return Line(tick, request, *_when(where, data), event)


def _happened(where: str, data: dict[str, Any]) -> Line:
    """What else happened; it is only in a record, which nobody writes by hand."""
    tick, kind, value = data.get("tick"), str(data["request"]), data.get("value", 0.0)
    number = type(value) in (int, float) and 0.0 <= value < math.inf
    sound = {
        RETURN: number or isinstance(value, dict),
        FAULT: isinstance(value, str) and value in Fault.__members__,
        PLAN: number and value < 60.0,
        STOCK: value in (0, 1, 2),
        TAKEN_BACK: value in (1, 2),
        THREAD: isinstance(value, list) and [type(x) for x in value] == [float, bool],
    }.get(kind, number)
    if type(tick) is not int or tick < -1 or not sound:
        raise EventError(message("events.recorded", where=where, kind=kind))
    return Line(tick, kind, *_when(where, data), value=value)


def _when(where: str, data: dict[str, Any]) -> tuple[int | None, bool]:
    at, late = data.get("at"), data.get("late", False)
    if not (at is None or type(at) is int) or not isinstance(late, bool):
        raise EventError(message("events.when", where=where))
    return at, late


def _begin(where: str, value: Any) -> Begin:
    try:
        sums = (str(value["program_sha256"]), str(value["machine_sha256"]))
        period_s = float(value["period_s"]) if "period_s" in value else None
        return Begin(Start.from_dict(value), dict(value["fitted"]), *sums, period_s)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise EventError(message("events.begin", where=where)) from error


def _jog(where: str, value: Any) -> Jog:
    """Speed, length (null: none) and the direction of the axes."""
    try:
        speed, length, one, *others = (math.inf if x is None else float(x) for x in value)
    except (ValueError, TypeError) as error:
        raise EventError(message("events.jog", where=where)) from error
    return Jog((one, *others), speed, length)


def _value(where: str, request: str, data: dict[str, Any]) -> float:
    value = data.get("value", "missing")
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if request in OVERRIDES:
        most = MAX_OVERRIDE * 100.0
        if not number or not 0.0 <= value <= most:
            raise EventError(message("events.percent", where=where, found=value, request=request, most=most))
        return float(data["share"]) if isinstance(data.get("share"), float) else float(value) / 100.0
    if request in SWITCHES:
        if not number or value not in (0, 1):
            raise EventError(message("events.switch", where=where, found=value, request=request))
        return float(value)
    return float(value) if request in BY_HAND and number else 0.0


def line_of(kind: str, value: Any = None) -> dict[str, Any]:
    """An event as its line has it, but for when it was; an override (share) in percent, and exact."""
    if kind not in OVERRIDES:
        return {"request": kind} if value is None else {"request": kind, "value": value}
    percent = round(100.0 * value, 9)
    exact = {} if percent / 100.0 == value else {"share": value}
    return {"request": kind, "value": percent, **exact}
