"""A door with a machine behind it that only keeps its mode: for tests of what asks through doors.

door = FakeDoor()                     # ``await door.ask(...)`` in process
Server(path, door.answer)             # the same through the real socket
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from controller.api.service_client import refusal
from controller.commands.table import ENDS, SWITCHES
from controller.ipc.asker import asker
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Recorder
from controller.machine import machine_file
from controller.machine.setup_data import tools_of
from controller.messages import message
from controller.service import diagnostics
from controller.service.jogging import Presses

AXES = ("X", "Y", "Z", "A", "C")
WEARS = ("tool_life", "tool_renewed", "maintenance", "maintained")
# verb -> modes in which it is taken, and the mode after it (None: as it was)
TABLE: dict[str, tuple[set[str], str | None]] = {
    "load": ({"OFF", "READY"}, None),
    "unload": ({"OFF", "READY"}, None),
    "seen": (set(), None),
    "start": ({"READY"}, "RUNNING"),
    "hold": ({"RUNNING"}, "HOLD"),
    "resume": ({"HOLD"}, "RUNNING"),
    "stop": ({"RUNNING", "HOLD", "READY"}, "READY"),
    **{switch.name: (set(), None) for switch in SWITCHES},  # nothing named: in all modes
    "override": (set(), None),
    "rapid_override": (set(), None),
    "spindle_override": (set(), None),
    "spindle": ({"READY"}, None),
    "coolant": ({"READY", "RUNNING", "HOLD"}, None),
    "clamps": ({"READY"}, None),
    "enable": ({"OFF"}, "READY"),
    "disable": ({"OFF", "READY"}, "OFF"),
    "home": ({"OFF", "READY"}, None),
    "reset": ({"FAULT"}, "OFF"),
    "estop": (set(), "FAULT"),
    "jog": ({"READY"}, None),
    "jog_step": ({"READY"}, None),
    "jog_stop": (set(), None),
    "mdi": ({"READY"}, None),
    "macro": ({"READY"}, None),
    "retract": ({"HOLD", "READY"}, None),
    "withdraw": ({"READY"}, None),
    "return": ({"HOLD"}, None),
    "changer_confirm": ({"OFF", "READY", "FAULT"}, None),
    "changer_pocket": ({"OFF", "READY", "FAULT"}, None),
    "probe": ({"READY"}, None),
    "set_offset": ({"OFF", "READY"}, None),
    "forget": ({"OFF", "READY"}, None),
    "set_tool": ({"OFF", "READY", "HOLD"}, None),
    "acknowledge": (set(), None),
    "keep_run": (set(), None),
    "panel_damaged": (set(), None),
    **dict.fromkeys(WEARS, (set(), None)),
}

PROBED = [
    {
        **{"at_s": 1.8e9, "program": "part.ngc", "cycle": "bore"},
        "values": {"x_mm": 12.5, "y_mm": -3.25, "diameter_mm": 20.01},
    },
    {"at_s": 1.7e9, "program": "MDI", "cycle": "mine", "values": {"way_mm": 1.0, "angle_deg": -0.5}},
]
USAGE: dict[str, Any] = {"tools": [], "counters": [], "items": []}


class FakeDoor:
    """Takes every verb of the local protocol, and notes what it took."""

    def __init__(self) -> None:
        self.mode, self.at_rest = "OFF", False
        self.asked: list[tuple[str, dict[str, Any]]] = []
        self.there = True
        self.results: dict[str, dict[str, Any]] = {}  # of verbs that answer more than nothing
        self.acknowledge: Callable[[int | None, str], object] = lambda number, by: None
        self.recorder = Recorder(rows=4096)
        self.presses = Presses()
        self.job: dict[str, Any] | None = None
        zero = {"origin_mm": [0.0, 0.0, 0.0], "turned_deg": [0.0, 0.0, 0.0]}
        self.offsets: dict[str, Any] = {"G54": {**zero, "unset": False}, "G55": {**zero, "unset": True}}
        self.restart: dict[str, Any] = {"offered": False, "sentence": "Nothing was interrupted."}
        self.tools: dict[str, Any] = {
            "1": tools_of(machine_file.load("trunnion"))[0]
        }  # as the service tells them

    @property
    def moved(self) -> list[str]:
        """The verbs that were taken, but for looking."""
        return [verb for verb, _ in self.asked if verb in TABLE]

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        """As the panel's own end of the door."""
        try:
            return self.answer(verb, args)
        except CommandRefused as error:
            raise refusal(error) from error

    def answer(self, verb: str, args: dict[str, Any]) -> dict[str, Any]:
        """As the service's handler. Raises CommandRefused."""
        if not self.there:
            raise CommandRefused("gone", message("no_service"))
        if verb == "rows":
            return diagnostics.rows(self.recorder, args)
        looks_at = {
            "status": self.status,
            "facts": self.facts,
            "drives": self.drives,
            "alarms": dict,
            "buses": self.buses,
            "restart": lambda: self.restart,
            "usage": lambda: dict(USAGE),
            "changer": dict,
            "probed": lambda: {"found": PROBED},
            "terminals": lambda: {"word": 0},
        }
        if verb in looks_at:
            return dict(looks_at[verb]())
        modes, after = TABLE[verb]
        if verb in ENDS:
            self.presses.end(args.get("press", ""))
        if modes and self.mode not in modes:
            raise CommandRefused("refused", f"{verb} is refused in {self.mode}.", self.mode, verb.upper())
        if verb == "jog" and not self.presses.may_move(args.get("press", "")):
            raise CommandRefused("refused", "The jog was stopped; let go of the key and press it again.")
        self.asked.append((verb, args))
        self.mode = after or self.mode
        self._keep(verb, args)
        return self.results.get(verb, USAGE if verb in WEARS else {})

    def _keep(self, verb: str, args: dict[str, Any]) -> None:
        if verb == "load":
            self.job = {"name": args["name"], "sha256": args["sha256"], "state": "loaded", "left_s": 60.0}
            self.job["block_delete"] = args.get("block_delete") is True
        elif verb == "unload":
            self.job = None
        elif verb == "acknowledge":
            who = asker.get()
            self.acknowledge(args["id"], who.user if who else "")
        elif verb == "set_offset" and "values" in args:
            self.offsets[args["name"]] = {**args["values"], "unset": False, "source": "machine"}
        elif verb == "forget":
            self.offsets.pop(args["name"], None)
        elif verb == "set_tool" and "reads" not in args:
            self.tools[str(args["number"])] = {**tools_of(machine_file.load("trunnion"))[0], **args}
            if args.get("remove"):
                del self.tools[str(args["number"])]

    def status(self) -> dict[str, Any]:
        joint = {"machine": 0.0, "work": 0.0, "to_go": 0.0, "actual": 0.0, "error": 0.0, "homed": False}
        fault = {"name": "ESTOP", "axis": "", "sentence": "Emergency stop.", "position_trusted": True}
        return {
            "time_s": 1.0,
            "mode": self.mode,
            "tick_alive": True,
            "at_rest": self.at_rest,
            "fault": fault if self.mode == "FAULT" else None,
            "job": self.job,
            "joints": {axis: dict(joint) for axis in AXES},
            "feed_mm_min": {"programmed": 0.0, "actual": 0.0},
            "on_table": {"tip": [10.0, 20.0, 30.0], "axis": [0.0, 0.0, 1.0], "length_mm": 0.0},
            "limited_by": "nothing",
            "override": 1.0,
            "rapid_override": 1.0,
            "drives": self.drives()["drives"],
            "tick": {"number": 500, "skips": 0, "late_max_ms": 0.1, "period_ms": 2.0},
        }

    def buses(self) -> dict[str, Any]:
        bus = {
            **{"name": "can0", "interface": "virtual", "bit_rate": 1_000_000, "drives": 5},
            **{"budget_share": 0.6, "background_share": 0.01, "fullest_share": 0.55, "measured_share": 0.5},
            **{"frames_per_s": 5500, "error_frames": 0, "transmit_errors": None, "receive_errors": None},
        }
        late = {"from_us": [0.0, 500.0], "ticks": [499, 1], "skipped_from_us": 500.0, "seconds": 1.0}
        return {"buses": [bus], "max_share": 0.8, "near_share": 0.72, "lateness": late}

    def facts(self) -> dict[str, Any]:
        axes = [{"name": name, "unit": "deg" if name in "AC" else "mm"} for name in AXES]
        return {"axes": axes, "offsets": self.offsets, "tools": self.tools, "period_s": 0.002}

    def drives(self) -> dict[str, Any]:
        said = {
            **{"bus": "can0", "state": "OPERATION_ENABLED", "cyclic_mode": "CSP", "homing": False},
            **{"statusword": 0x1237, "error": None, "emcy": None, "heartbeat_age_s": 0.01},
        }
        return {"drives": [{"axis": axis, "node": i + 1, **said} for i, axis in enumerate(AXES)]}
