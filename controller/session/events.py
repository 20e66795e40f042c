"""An operator's requests at given ticks: the ``--events`` file of ``simulate``, one JSON object a line.

The record of a live run has two more kinds of lines, for what an override makes depends on when
the planner looked: "plan" (before this tick it acted, with ``value`` seconds for itself) and
"pieces" (with this tick its message was taken); at tick -1 both were before the start. Its first
line, "begin", has for its ``value`` where the machine stood, and what was fitted.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller.session.starts import Start
from controller.state import Request
from controller.tick.mode import MOST_OVERRIDE

REQUESTS = {
    "hold": Request.HOLD,
    "resume": Request.RESUME,
    "stop": Request.STOP,
    "override": Request.OVERRIDE,
    "rapid_override": Request.RAPID_OVERRIDE,
    "single_block": Request.SINGLE_BLOCK,
    "optional_stop": Request.OPTIONAL_STOP,
}
TURNS = ("stand", "plan", "pieces")
OVERRIDES = ("override", "rapid_override")
SWITCHES = ("single_block", "optional_stop")


ASIDE = "aside"


class EventError(Exception):
    """One sentence on what is wrong in an events file, with file and line."""


@dataclass(frozen=True, slots=True)
class Event:
    """``request`` reaches the tick of trace row ``tick``; ``value`` is a share (1.0 = 100 %) or a switch."""

    tick: int
    request: Request
    value: float = 0.0


@dataclass(frozen=True, slots=True)
class Turn:
    """The planner acted before a tick, or its message was taken in it, or a long gap was before it."""

    tick: int
    pieces: bool  # a message was taken
    lead_s: float = 0.0
    stand: bool = False  # the path stood still; else, and without ``pieces``, the planner acted


@dataclass(frozen=True, slots=True)
class Begin:
    """How a recorded run began."""

    start: Start
    fitted: dict[str, Any]  # offsets and tools, as ``fitting`` keeps them
    program_sha256: str
    machine_sha256: str


def begin(path: Path) -> Begin | None:
    """How the run of a record began; None where an operator wrote the file. Raises EventError."""
    return next((one for one in _lines(path) if isinstance(one, Begin)), None)


def read(path: Path) -> tuple[Event, ...]:
    """The operator's events of a file in the order of their ticks. Raises EventError."""
    found = [one for one in _lines(path) if isinstance(one, Event)]
    return tuple(sorted(found, key=lambda event: event.tick))


def turns(path: Path) -> tuple[Turn, ...]:
    """The planner's turns of a file, in its order; none where an operator wrote it. Raises EventError."""
    return tuple(one for one in _lines(path) if isinstance(one, Turn))


def _lines(path: Path) -> list[Event | Turn | Begin]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise EventError(f"{path}: byte {error.start} is not UTF-8; give a file of JSON lines.") from error
    except OSError as error:
        raise EventError(f"{path}: {error.strerror}; give a file of JSON lines.") from error
    return [_event(f"{path}:{n}", line) for n, line in enumerate(lines, 1) if line.strip()]


def _event(where: str, line: str) -> Event | Turn | Begin:
    try:
        data = json.loads(line)
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits
        said = error.msg if isinstance(error, json.JSONDecodeError) else "too long"
        raise EventError(f"{where}: this is not JSON ({said}); write one object per line.") from error
    if not isinstance(data, dict) or (unknown := set(data) - {"tick", "request", "value"}):
        named = f"unknown key {sorted(unknown)[0]!r}" if isinstance(data, dict) else "no object"
        raise EventError(f'{where}: {named}; allowed are "tick", "request" and "value".')
    if data.get("request") in TURNS:
        return _turn(where, data)
    if data.get("request") == "begin":
        return _begin(where, data.get("value"))
    if data.get("request") == ASIDE:
        raise EventError(
            f"{where}: in this run the tool was led off the path by hand, which is in no record; "
            "only a run without a retract can be run again."
        )
    tick = data.get("tick")
    if not isinstance(tick, int) or isinstance(tick, bool) or tick < 0:
        raise EventError(
            f'{where}: "tick" is {tick!r}; it must be a whole number from 0, counted from cycle start.'
        )
    request = data.get("request")
    if not isinstance(request, str) or request not in REQUESTS:
        raise EventError(f'{where}: "request" is {request!r}; allowed are {", ".join(REQUESTS)}.')
    return Event(tick, REQUESTS[request], _value(where, request, data))


def _begin(where: str, value: Any) -> Begin:
    try:
        sums = (str(value["program_sha256"]), str(value["machine_sha256"]))
        return Begin(Start.from_dict(value), dict(value["fitted"]), *sums)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise EventError(
            f"{where}: this is no beginning of a recorded run; give the file as the run's record has it."
        ) from error


def _turn(where: str, data: dict[str, Any]) -> Turn:
    tick, lead_s = data.get("tick"), data.get("value", 0.0)
    sound = type(lead_s) in (int, float) and 0.0 <= lead_s < 60.0
    if type(tick) is not int or tick < -1 or not sound:
        raise EventError(
            f'{where}: a turn of the planner has a whole "tick" from -1 and a "value" from 0 to 60 (s); '
            "give the file as the run's record has it."
        )
    return Turn(tick, data["request"] == "pieces", float(lead_s), data["request"] == "stand")


def _value(where: str, request: str, data: dict[str, Any]) -> float:
    value = data.get("value", "missing")
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if request in OVERRIDES:
        most = MOST_OVERRIDE * 100.0
        if not number or not 0.0 <= value <= most:
            raise EventError(f'{where}: "value" is {value!r}; {request} takes 0 to {most:.0f} (percent).')
        return float(value) / 100.0
    if request in SWITCHES:
        if not number or value not in (0, 1):
            raise EventError(f'{where}: "value" is {value!r}; {request} takes 0 (off) or 1 (on).')
        return float(value)
    return 0.0
