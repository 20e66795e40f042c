"""A panel with its page before a machine that only keeps its mode, as a process of its own.

    python page_server.py FOLDER PORT      # what was asked of the machine: FOLDER/asked.jsonl

It has the numbers of the shipped trunnion, and a spindle. Its axes move while they are jogged, so that
a jog that goes on shows. What FOLDER/told.json has of the
status is told in place of its own (``browser.Site.tell``).
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import uvicorn
from support.fakes.fake_socket import AXES, WEARS, FakeDoor
from support.fakes.written_history import WrittenHistory

from controller.api.app_state import Panel
from controller.api.checker import Checker
from controller.api.http import make_app
from controller.api.programs import Program, ProgramCheck
from controller.api.quotas import Owner
from controller.api.store import Store
from controller.ipc.handoff import blank
from controller.machine import machine_file, setup_data
from controller.messages import Key, message
from controller.plan.report.picture import Shape
from controller.plan.report.verdict import Verdict
from controller.program import blocks
from controller.service import runs, status, usage
from controller.service.next_step import next_step
from controller.service.preconditions import moves
from controller.service.refusals import refused
from controller.service.usage import Usage
from controller.state.modes import ALL_AXES, Fault, Mode, fault_message
from controller.verify import wording
from controller.web.server import add_page

DEAD_MAN_S = 0.2
SPEED_S = 50.0  # mm or degrees a second at full jog
MACHINE = machine_file.load("trunnion")
PERIOD_S = MACHINE.period_s
TOLD = "told.json"


class MovingDoor(FakeDoor):
    """Notes what it is asked in a file, with the time, and has all that the page shows."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.mode = "READY"
        self._told = folder / TOLD
        self._usage = Usage(WrittenHistory(folder).store, MACHINE)
        self._folder = folder
        self.acknowledge = lambda number, by: WrittenHistory(folder).acknowledge(number, by)
        self._asked = open(folder / "asked.jsonl", "a", buffering=1)  # noqa: SIM115
        self._where = dict.fromkeys(AXES, 0.0)
        self._jog: tuple[str, float, float, float] | None = None  # axis, speed, last look, until
        self._overrides = {"override": 1.0, "rapid_override": 1.0}
        self._switches = {"single_block": False, "optional_stop": False, "adaptive_feed": False}
        self._aside = False

    def answer(self, verb: str, args: dict[str, Any]) -> dict[str, Any]:
        if verb != "status":
            self._asked.write(json.dumps([time.time(), verb, args]) + "\n")
        if verb == "keep_run":
            runs.keep(self._folder, args["record"], args["on"])
        if verb in WEARS:
            return getattr(usage, verb)(self._usage, args)
        if verb == "usage":
            return self._usage.to_json()
        if verb in self._overrides:
            self._overrides[verb] = args["share"]
        if verb in self._switches:
            self._switches[verb] = args["on"]
        if verb in ("jog_stop", "stop", "hold", "estop"):
            self._jogged()
            self._jog = None
        if args.get("still") and moves(blocks.stream(_lines(verb, args).encode(), MACHINE, "MDI")):
            raise refused("line_moves", self.mode, verb.upper(), "moves", lines=_lines(verb, args))
        if verb == "retract" and not args["mm"] <= (room := self._room_mm() or 0.0):
            raise refused("retract_room", self.mode, "RETRACT", mm=args["mm"], room=room)
        answer = super().answer(verb, args)
        if verb in ("retract", "return", "stop"):
            self._aside = verb == "retract" and self.mode == "HOLD"
        if verb == "jog":
            self._jogged()
            now = time.monotonic()
            self._jog = (args["axis"], args["speed"] * SPEED_S, now, now + DEAD_MAN_S)
        return answer

    def _keep(self, verb: str, args: dict[str, Any]) -> None:
        super()._keep(verb, args)
        if verb == "load" and self.job and {"line", "restart"} & args.keys():
            self.job |= {"restart": STATE_THERE}

    def _jogged(self) -> None:
        """Let the axis have moved until now, or until the dead-man has ended it."""
        if self._jog is None:
            return
        axis, speed, last, until = self._jog
        now = time.monotonic()
        for one in axis.replace("+", "").replace("-", ""):
            self._where[one] += speed * max(0.0, min(now, until) - last)
        self._jog = (axis, speed, now, until) if now < until else None

    def _room_mm(self) -> float | None:
        """As a machine tells that has found all its axes and stands."""
        shown = [_joint(where, i)["machine"] for i, where in enumerate(self._where.values())]
        joints = [q / axis.shown_per_unit for q, axis in zip(shown, MACHINE.axes, strict=True)]
        if self.mode not in Mode.__members__ or self._aside:
            return None
        known = {"mode": Mode[self.mode], "homed": ALL_AXES, "at_rest": True}
        return status.retract_room_mm(MACHINE, blank()._replace(joints=joints, **known))

    def status(self) -> dict[str, Any]:
        self._jogged()
        told = super().status()
        fault = FAULT if self.mode == "FAULT" else None
        told.update(
            mode="JOG" if self._jog and self.mode == "READY" else self.mode,
            time_s=time.monotonic(),
            joints={name: _joint(where, i) for i, (name, where) in enumerate(self._where.items())},
            work_offset="G54",
            spindle={"rev_min": 12000.0, "actual_rev_min": 11998.0, "at_speed": True, "override": 1.0},
            coolant={"mist": False, "flood": True},
            notices=[],
            tip={"X": 12.5, "Y": -3.25, "Z": 0.0},
            axis={"I": 0.0, "J": 0.70711, "K": 0.70711},
            feed_mm_min={"programmed": 1000.0, "actual": 593.2},
            limited_by="Y velocity" if self.mode == "RUNNING" else None,
            in_block={"what": "cut", "fraction": 0.4, "u": 0.3721} if told.get("job") else None,
            fault=fault,
            sequence=None,
            aside=self._aside,
            retract_room_mm=self._room_mm(),
            tick={**told["tick"], "number": int(time.monotonic() / PERIOD_S)},
            **self._overrides,
            **self._switches,
        )
        if told.get("job"):
            told["job"] = {**JOB, **told["job"]}
        told |= self.laid_over()
        return {**told, "next": told.get("next") or next_step({**UNTOLD, **told}).to_json()}

    def laid_over(self) -> dict[str, Any]:
        """What a test has told."""
        told: dict[str, Any] = json.loads(self._told.read_text()) if self._told.exists() else {}
        return told

    def facts(self) -> dict[str, Any]:
        """The shipped machine's, with what it has not: a spindle, coolant, drives that are not all alike."""
        spindle = {"max_rev_min": 24000.0, "driven": True, "tells_load": True, "adaptive": True}
        more = {"spindle": spindle, "outputs": ["mist", "coolant", "a_open"]}
        told = status.facts(MACHINE, more)
        for axis in told["axes"]:
            axis["absolute"] = axis["name"] == "Z"
            axis["clamp"] = "a_open" if axis["name"] == "A" else None
            axis["supervision"] = "guarding" if axis["unit"] == "deg" else "heartbeat"
        return {**super().facts(), **told, "macros": MACROS}


MACROS = [
    {"name": "Park", "lines": ["G53 G0 Z260", "G53 G0 X0 Y200"], "role": "operate"},
    {"name": "Rotaries to zero", "lines": ["G90 G0 A0 C0"], "role": "operate"},
    {"name": "Warm up", "lines": ["M3 S6000", "G4 P60", "M5"], "role": "set_up"},
]


def _lines(verb: str, args: dict[str, Any]) -> str:
    """What is typed, or the macro has."""
    if verb == "mdi":
        return str(args["text"])
    return "\n".join(next(one["lines"] for one in MACROS if one["name"] == args["name"]))


# Of a status what the guide looks at and no test here tells.
UNTOLD: dict[str, Any] = {
    **{"tick_alive": True, "plan_alive": True, "commissioned": True, "not_homed": [], "interlock": None},
    **{"change": None, "tool_change": None, "spindle_change": None, "changer": None},
    **{"feed_stopped": False, "waiting": False},
    **{"no_resume": None, "stands_at_stop": False, "restart": {"offered": False}, "notices": []},
}
STATE_THERE = [
    message("at.tool", tool=1, offset="G54", length="0.000"),
    message("at.spindle", rev_min="12000", coolant=Key("at.off"), feed=Key("at.none")),
]
FAULT = {
    "name": "ESTOP",
    "axis": None,
    **fault_message(Fault.EMERGENCY_STOP),
    "recovery": "reset",
    "position_trusted": True,
    "recording": None,
}
JOB = {
    "state": "running",
    "line": 3,
    "block": 2,
    "blocks": 6,
    "fraction": 0.62,
    "elapsed_s": 42.0,
    "left_s": 26.0,
    "duration_s": 68.0,
    "restart": [],
}


def _joint(where: float, i: int) -> dict[str, Any]:
    """No two figures of it are the same, nor any of two axes."""
    return {
        "machine": where + 10.0 * i,
        "work": where + 10.0 * i - 8.0,
        "to_go": -123.456 + i,
        "actual": where + 10.0 * i - 0.0123 * (i + 1),
        "error": 0.0123 * (i + 1),
        "homed": i != 1,
        "limit": (None, None, "+", "-", None)[i],
    }


class ToldChecker(Checker):
    """Says at once what the text itself says of it: WRONG stands where it is refused."""

    def __init__(self, store: Store) -> None:
        self._store, self._share = store, 0.0

    def ask(self, program: Program, owner: Owner | None = None) -> None:
        """Nothing is left to be done."""

    def waiting(self, owner: Owner) -> int:
        return 0

    def look(self) -> None:
        """Nothing comes by other ways."""

    def close(self) -> None:
        """Nothing runs."""

    def of(self, program: Program) -> ProgramCheck:
        text = self._store.programs.path(program.sha256).read_text(errors="replace")
        if "SLOWLY" in text:  # a little further at each look
            self._share = (self._share + 0.01) % 1.0
            return ProgramCheck(program.sha256, "", "running", self._share, {}, 0.0)
        before, found, _ = text.partition("WRONG")
        state, result = ("refused", {**_wrong(before), **REFUSED}) if found else ("passed", PASSED)
        if "o5 call" in text:  # a place in the file of the sub
            called_at = text[: text.index("o5 call")].count("\n") + 1
            result = {**_wrong("o5 sub\nG1 "), "file": "5.ngc", "called_at": called_at}
            state, result = "refused", {**result, **REFUSED, "guilty_lines": [called_at]}
        if "TOO DEEP" in text:
            result = {**PASSED, "verdict": EXCEEDING, "joints": HARD}
        if "TOO FAST" in text:
            result = {**PASSED, "joints": HARD}
        return ProgramCheck(program.sha256, "", state, 1.0, result, 0.0)


def _wrong(before: str) -> dict[str, Any]:
    line, column = before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1
    sentence = f"line {line}: WRONG is no word of a program; take it out."
    return {"sentence": sentence, "line": line, "column": column}


DRAWN = "a-square"  # the picture of every program
REFUSED = {"pictured": DRAWN, "guilty_lines": [2]}


def draw(folder: Path) -> None:
    """A square that is milled, a line of it on each line from the second on."""
    places = [(0, 0, 60), (0, 0, 0), (40, 0, 0), (40, 30, 0), (0, 30, 0), (0, 0, 0), (0, 0, 60)]
    tips, n = np.array(places, dtype=float), len(places)
    kinds, rows = np.array([0, 0, 1, 1, 1, 1, 0]), np.arange(n)
    axes, walls = np.tile([0.0, 0.0, 1.0], (n, 1)), np.empty((0, 6))
    shape = Shape(tips, kinds, rows, rows, walls, np.empty(0, dtype=int), 0.0, axes)
    shape.save(folder / "panel" / "pictures" / f"{DRAWN}.npz")


PASSED = {
    "stored": DRAWN,
    "duration_s": 67.7,
    "cut_time_s": 52.4,
    "cut_length_mm": 87.27,
    "work": [
        {"what": "surface", "length_mm": 87.27, "time_s": 52.4},
        {"what": "mill", "length_mm": 210.0, "time_s": 12.6},
        {"what": "drill", "length_mm": 36.0, "time_s": 21.6},
    ],
    "blocks": 6,
    "tools": [
        {
            "tool": 4,
            "cut_s": 52.4,
            "rapid_s": 2.5,
            "cut_mm": 87.27,
            "spindle_rev_min": [9000.0, 12000.0],
            "feed_mm_min": [100.0, 100.0],
            "deepest_mm": -0.25,
        },
        {
            "tool": 5,
            "cut_s": 0.0,
            "rapid_s": 1.5,
            "cut_mm": 0.0,
            "spindle_rev_min": None,
            "feed_mm_min": None,
            "deepest_mm": None,
        },
    ],
    "holes": [
        {
            "line": 7,
            "tool": 4,
            "cycle": "G83",
            "offset": "G55",
            "plane": "G18",
            "x": 1.0,
            "y": 2.5,
            "z": 3.0,
            "from": 2.5,
            "to": -7.0,
        }
    ],
    "hole_count": 1,
    "cut_binds": [{"what": "feed", "share": 0.93}, {"what": "Y velocity", "share": 0.07}],
    "joints": [
        {
            "name": name,
            "lowest": -27.6,
            "highest": 150.0,
            "velocity_share": 0.42,
            "acceleration_share": 0.3,
            "jerk_share": 0.9,
        }
        for name in AXES
    ],
    "verified": {
        "overcut_mm": 0.2502,
        "undercut_mm": 0.0,
        "surfaces": [
            {
                "line": line,
                "overcut_mm": deepest_mm,
                "undercut_mm": 0.0,
                "along_mm": [0.0, 12.1, 24.9, 38.0, 50.5],
                "height_mm": 10.4,
                "overcut_at": [0.98, 0.0],
                "rulings_mm": [[k, line, 10.0, 1.5 * k, line, 0.0] for k in range(17)],
                "map_um": [[-1e3 * deepest_mm * k / 16.0 * v for k in range(17)] for v in (1.0, 0.5, 0.0)],
            }
            for line, deepest_mm in ((10, 0.018), (19, 0.2502))
        ],
        "left_out": 0,
    },
    "notes": [{"line": 19, **message("join.agrees", name=message("join.block", line=10))}],
}


HARD = [
    {**row, **({"jerk_share": 1.023, "over": ["jerk"]} if row["name"] == "X" else {"jerk_share": 1.009})}
    for row in PASSED["joints"]  # type: ignore[attr-defined]
]
EXCEEDING = wording.to_json(
    [Verdict(19, 2, 0.05, 0.4831, 0.0, 1.0, 0.0, 10.0, (38.0, 22.0, 10.0), "lead out", 19, ("double",), 0.0)]
)


def main(folder: Path, port: int) -> None:
    """Serve until killed."""
    setup_data.note(folder, MACHINE)
    draw(folder)
    store = Store(folder)
    panel = Panel(store, MovingDoor(folder), ToldChecker(store))
    app = make_app(panel)
    add_page(app)
    uvicorn.run(app, host="127.0.0.1", port=port, log_level="warning", timeout_graceful_shutdown=1)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
