"""An example of every body that is sent, and of the commonest answers, by its model's name in OpenAPI."""

from __future__ import annotations

from typing import Any

EXAMPLES: dict[str, dict[str, Any]] = {
    # ---- programs and runs
    "Load": {"program": "part.ngc", "line": 120},
    "Start": {"unrecorded": False, "worn": False},
    "Mdi": {"text": "G54 G0 X0. Y0."},
    "Cycle": {"cycle": "edge", "values": {"towards": "X-", "most": 20.0}, "offset": "G54"},
    "Draft": {"name": "part.ngc", "text": "G21 G90 G54\nT1 M6\nS6000 M3\nG0 X0. Y0. Z20.\nM30\n"},
    "Rename": {"name": "fixtures/part.ngc"},
    "NewEntry": {"program": "part.ngc", "count": 5},
    "EntryChange": {"place": 0},
    "JobCommand": {"command": "pause", "action": "toggle"},
    # ---- the machine
    "StepStart": {"part": "part.ngc"},
    "StepAnswer": {"number": 1, "answer": 9.98},
    "StepSkip": {"reason": "No brake is fitted yet."},
    "Switch": {"on": True},
    "Share": {"share": 0.8},
    "RapidShare": {"share": 0.25},
    "SpindleShare": {"share": 0.9},
    "Spindle": {"rev_min": 3000.0},
    "Coolant": {"mist": False, "flood": True},
    "Clamps": {"open": ["A"]},
    "Home": {"axes": ["Z"]},
    "Retract": {"mm": 20.0},
    "Withdraw": {"mm": 12.0, "is_out": False},
    "Jog": {"frame": "joint", "axis": "X", "speed": 0.5, "press": "3f9c"},
    "JogStep": {"frame": "joint", "axis": "X", "distance": -0.1, "feed": 500.0},
    "JogStop": {"press": "3f9c"},
    "Macro": {"still": True},
    # ---- offsets, tools, the changer
    "OffsetValues": {"origin_mm": [10.0, 20.0, -35.5], "turned_deg": [0.0, 0.0, 30.0]},
    "TouchOff": {"X": 0.0, "Z": "5/2", "tool": 3},
    "Touched": {"Z": 0.0},
    "ToolValues": {"name": "cutter", "radius_mm": 3.0, "length_mm": 55.0, "flute_mm": 20.0},
    "ToolFile": {"file": "tool.tbl", "text": "T2 P2 D6.0 Z55.0 ;cutter\n", "flute_mm": 20.0},
    "ToolLife": {"cut_min": 90.0, "parts": 200, "sister": 12},
    "ToolPlaces": {"spindle": 0, "away": [4], "clear": True},
    "Pocket": {"tool": 4},
    "Maintenance": {"name": "grease", "counter": "X", "every": 50.0},
    "Maintained": {"name": "grease"},
    "Measured": {"values": {"axis": "X"}, "table": "target,sense,measured\n0,1,0.001\n100,1,100.004\n"},
    # ---- access
    "LogIn": {"name": "anna", "password": "correct horse"},
    "Confirm": {"password": "correct horse"},
    "OwnPassword": {"old": "correct horse", "password": "battery staple"},
    "TakeControl": {"take_over": False},
    "NewUser": {"name": "anna", "password": "correct horse", "role": "operate"},
    "UserChange": {"role": "set_up"},
    "NewToken": {"name": "dashboard", "role": "view", "days": 365.0},
    "NoticeChange": {"alarms": True, "language": "en", "webhook": "https://example.org/hook"},
    # ---- answers
    "Done": {"request": "start", "result": {"done": True, "mode": "RUNNING", "run": "2026-11-21T083120.042"}},
    "ErrorAnswer": {
        "error": {
            **{"key": "no_control", "values": {"holder": "anna"}},
            "sentence": "anna holds control; take it by POST /api/v1/control and send its token as "
            "X-Control-Token.",
            **{"code": "control", "mode": None, "request": None},
        }
    },
    "RunOutcome": {
        **{"id": "2026-11-21T083120.042-part.ngc", "program": "part.ngc", "result": "completed"},
        **{"line": 240, "key": None, "values": None, "sentence": None},
    },
}
