"""A service in the middle of a cut, without tick and drives, as a process of its own that can be killed.

    python cutting_service.py FOLDER     # state and sockets in it

The first one in a folder cuts; one after it finds what was interrupted.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from support.fakes.fake_engine import FakeRecorder, engine_of, heard, served

from controller.geometry import arc_length
from controller.geometry.curves import Line
from controller.geometry.vectors import ZERO
from controller.ipc.control_socket import control_path
from controller.machine import machine_file
from controller.plan.report.passing import OWN
from controller.plan.restart.program_position import LinePart
from controller.runtime.plan_messages import MotionFacts
from controller.service import journal
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.service.socket_server import Server
from controller.service.whole_status import Kept
from controller.state.modes import Mode

NAME, LINE, BLOCK = "example1_ready.ngc", 8, 4
S_MM, END_MM, ELAPSED_S, DURATION_S = 20.0, 80.0, 29.0, 75.0
JOINTS = (1.838, 148.983, 61.173, -0.4636, -1.339)
LOOK_S = 0.02


class OneMoment(FakeRecorder):
    """Of a cut in which no time passes: there are no new ticks, in which its path clock would stand."""

    def drain(self) -> np.ndarray:
        return self.last(0)[:0]


def cut(service: Service) -> None:
    """A quarter of the block is done."""
    path = service.state / NAME
    path.write_bytes(machine_file.shipped_program(NAME).read_bytes())
    desk, engine = CommandHandlers(service), engine_of(service)
    engine.recorder = OneMoment(engine)
    for verb, args in (("load", {"path": str(path), "name": NAME}), ("start", {})):
        desk(verb, args)
        while service.sequencer.busy:
            time.sleep(LOOK_S)
    arc, lines = arc_length.of(Line(ZERO, (END_MM, 0.0, 0.0))), (LinePart(0.0, LINE, 0.0, 1 / END_MM),)
    way = MotionFacts(JOINTS, 10.0, "cut", end_s=END_MM, arc=arc, lines=lines)
    heard(service, finished=False, ways={BLOCK: way})
    assert service.run.job is not None
    service.run.job.take()
    marks = ((0, 0.0, OWN, 0.0), 10.0), ((0, 1.0, OWN, 0.0), 70.0)  # a quarter of it: 25 s
    service.run.job.time.check(DURATION_S, marks)
    there = {"line": LINE, "motion_id": BLOCK, "s": S_MM, "joints": JOINTS, "actual": JOINTS}
    engine.now = engine.now._replace(mode=Mode.RUNNING, at_rest=False, plan_time_s=ELAPSED_S, **there)


def main() -> None:
    folder = Path(sys.argv[1])
    service = served(folder)
    if not service.store.has(journal.DOCUMENT):
        cut(service)
    Kept(service).begin()
    with_door = Server(control_path(folder), CommandHandlers(service))
    while with_door:
        service.watch.look()
        time.sleep(LOOK_S)


if __name__ == "__main__":
    main()
