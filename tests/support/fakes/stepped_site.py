"""A panel with its page before a machine on the stepped clock, which goes on as often as it is looked at.

    python stepped_site.py FOLDER PORT

Every status lets so many ticks pass: pictures and scopes have real figures, and no test waits for a clock.
What a test writes to FOLDER/told.json is laid over the status; FOLDER/picture names the picture.
"""

from __future__ import annotations

import hashlib
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import uvicorn
from support.fakes.page_server import PASSED, MovingDoor, ToldChecker
from support.fakes.written_history import WrittenHistory

from controller.api.app_state import Panel
from controller.api.http import make_app
from controller.api.programs import Program, ProgramCheck
from controller.api.store import Store
from controller.ipc.handoff import Snapshot
from controller.machine import machine_file, setup_data
from controller.machine.model import Machine, Temperature
from controller.plan.report.picture import Picture
from controller.program import modal
from controller.runtime import checked
from controller.runtime.recording import Facts, save
from controller.runtime.stepped import SteppedMachine
from controller.service import diagnostics, node_status, status
from controller.state.modes import Fault, Mode, Request
from controller.web.server import add_page
from drives import pdo

PER_STATUS = 10  # ticks
NAME = "example2_ready.ngc"
KEY = "picture-of-the-test"
TOOL = 4  # of the program
FIRST_TICKS = 1500  # of the recording
SHOWN = "picture"
STATUSWORD = 0x1237
WARM_C = 41.5  # the drive of A
FOLLOWING_ERROR = 0x8611  # said by the drive of Y
HEARD_TICKS = 300  # in the last second, of 500
COUNTERS = 96, 12  # transmit and receive errors
ALWAYS_S = 1e12  # of a frame that is never too old


class SteppedDoor(MovingDoor):
    """Example 2, being cut."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.folder, self.machine = folder, replace(machine_file.load("shop"), in_spindle=TOOL)
        self.warm = _warm(self.machine)
        axes_bus, other_bus = (bus.name for bus in self.machine.buses)
        self.logs = {axes_bus: _heard(self.machine), other_bus: node_status.LastFrames()}
        setup_data.note(folder, self.machine)
        self.text = machine_file.shipped_program(NAME).read_bytes()
        self.sha256 = hashlib.sha256(self.text).hexdigest()
        self.bench = SteppedMachine(self.machine)
        self.bench.come_up()
        task = checked.standing(checked.task(self.text, NAME, self.machine), self.bench.joints)
        self.recorder = self.bench.recorder
        picture = Picture(self.machine, task.kinematics)
        walk = checked.walk_of(task, None, False)
        for _ in picture.watched(checked.path_of(task, walk.choices).items):
            pass
        picture.shape().save(folder / "panel" / "pictures" / f"{KEY}.npz")
        self.bench.begin(walk)
        while self._gone_on().spindle_rev_min == 0.0:
            pass  # the tool is there, and the next that moves are the axes

    def _gone_on(self) -> Snapshot:
        """A few ticks later; what the changer has been asked is done at once."""
        self.bench.go(PER_STATUS)
        now = self.bench.board.read()
        assert now is not None
        if now.mode is Mode.HOLD and now.at_rest:
            self.bench.request(Request.RESUME)
        return now

    def status(self) -> dict[str, Any]:
        now = self._gone_on()
        job = {"name": NAME, "state": "running", "block": now.motion_id, "line": now.line, "left_s": 60.0}
        drives = node_status.drives(self.warm, now, self.logs)
        return {
            **super().status(),
            **status.machine_values(self.machine, now, None, modal.begun(self.machine), TOOL),
            "time_s": now.tick * self.machine.period_s,
            "fault": None,
            "job": {**job, "sha256": self.sha256, "fraction": 0.3, "duration_s": 67.0},
            "drives": [{**drive, "heartbeat_age_s": 0.012} for drive in drives],
            "commissioned": True,
            "sequence": None,
            "tool": TOOL,
            **self.laid_over(),
        }

    def keep(self, base: Path) -> Path:
        """A recording of the first ticks, as a fault of Z leaves it."""
        self.bench.go(FIRST_TICKS)
        now = self.bench.board.read()
        assert now is not None
        told = Facts.of(self.machine, now._replace(fault=Fault.FOLLOWING_ERROR, fault_axis=2), {})
        return save(base, self.machine, told, self.bench.recorder.last(FIRST_TICKS), {})

    def facts(self) -> dict[str, Any]:
        made = self.machine
        return status.facts(made, setup_data.to_json(made, {}))

    def buses(self) -> dict[str, Any]:
        return diagnostics.buses(self.machine, self.logs, self.bench.recorder)


def _warm(machine: Machine) -> Machine:
    """A's drive tells how warm it is."""
    tells = Temperature(0x2035, 0, 16, 4, 10.0)
    axes = (replace(axis, temperature=tells) if axis.name == "A" else axis for axis in machine.axes)
    return replace(machine, axes=tuple(axes))


def _heard(machine: Machine) -> node_status.LastFrames:
    """Of the bus: commands of some ticks, what each drive said last, and an error frame."""
    log = node_status.LastFrames()
    log.seconds = 2.0 * ALWAYS_S
    for axis in machine.axes:
        log(pdo.frame(pdo.tpdo(1, axis.node), pdo.FEEDBACK.pack(STATUSWORD, 0)), 0.0)
        if axis.name == "A":
            log(pdo.frame(pdo.tpdo(4, axis.node), round(10 * WARM_C).to_bytes(2, "little")), 0.0)
        if axis.name == "Y":
            log(pdo.frame(pdo.EMCY + axis.node, pdo.EMERGENCY.pack(FOLLOWING_ERROR, 0x20, b"")), 0.0)
    log(pdo.frame(pdo.ERROR_FLAG | 4, bytes((0, 0, 0, 0, 0, 0, *COUNTERS))), 0.0)
    for _ in range(HEARD_TICKS):
        log(pdo.frame(pdo.SYNC), ALWAYS_S)
        for axis in machine.axes:
            log(pdo.command_frame(axis.node), ALWAYS_S)
    return log


class PicturedChecker(ToldChecker):
    """Its check has left a picture."""

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self._shown = store.folder / SHOWN

    def of(self, program: Program) -> ProgramCheck:
        key = self._shown.read_text() if self._shown.exists() else KEY
        return ProgramCheck(program.sha256, "", "passed", 1.0, {**PASSED, "stored": key}, 0.0)


def _add(history: WrittenHistory, recording: Path) -> None:
    """Alarms and runs, as a service leaves them."""
    for i, result in enumerate(("completed", "stopped", "fault", "completed")):
        errors = {"X": 0.0123, "Y": 0.0211, "Z": 0.0099, "A": 0.0042, "C": 0.0313}
        facts = {"duration_s": 67.7 + i, "cut_time_s": 52.4, "planned_s": 67.7, "following_error": errors}
        history.run(NAME, result, **facts, ticks=33850, skips=0)
    sentence = "Z: The actual position is too far from the commanded one. Look for a collision."
    more = {"position_trusted": True, "line": 10, "recording": str(recording)}
    first = history.alarm("FOLLOWING_ERROR", sentence, "Z", **more)
    history.alarm("ESTOP", "The emergency stop was asked for. Release it and reset.")
    history.acknowledge(first, "anna")


def main(folder: Path, port: int) -> None:
    """Serve until killed."""
    store = Store(folder)
    door = SteppedDoor(folder)
    with store.uploads.begin(NAME, by="test") as upload:
        upload.write(door.text)
        upload.commit()
    panel = Panel(store, door, PicturedChecker(store))
    _add(WrittenHistory(folder), door.keep(panel.recordings))
    app = make_app(panel)
    add_page(app)
    uvicorn.run(app, host="127.0.0.1", port=port, log_level="warning", timeout_graceful_shutdown=1)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
