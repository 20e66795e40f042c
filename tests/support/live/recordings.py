"""The recorded runs of ``tests/data/runs``, made anew: short, of whatever an operator does and befalls a run.

    PYTHONPATH=.:tests python -m support.live.recordings FOLDER [NAME ...]

A change of setpoints that is meant needs new ones; those that are there were written by the version that
added them, and hold whatever is rebuilt.
"""

from __future__ import annotations

import json
import math
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from support.live.live_machines import until
from support.live.replayed_runs import records
from support.live.served_machine import Serving, serving
from support.machines.recording_bench import RecordedBench
from support.machines.spindle_machine import DOOR, mill
from support.machines.stepped_runs import program

from controller.ipc.handoff import Jog
from controller.machine import machine_file
from controller.runtime.bench.fault_file import MachineScript
from controller.state.modes import Mode, Request

PERIOD_MS = 5.0
TIPS = """G21 G90 G54 T2 M6
G43.4
G0 X0 Y0 Z60. A0 C0
G1 Z40. F3000.
G1 X30. Y8. A6.
G1 X-10. A2. F1500.
G49
G0 Z120.
M30
"""
TIPS_B = TIPS.replace(" A", " B")  # for machines with other rotaries
CONE = """G21 G90 G54 G61 T2 M6
S6000 M3
G51 x7.5 y0. z-14. i0. j0. k-14. h14. r3.75 d200. F1200.
M5
M30
"""
CHANGES = """G21 G90 G54 T1 M6
G0 X0 Y0 Z120.
G1 X20. F3000.
T3 M6
G1 X-20. Y5. A4.
M1
G1 X0. Y0. A0.
M30
"""
MILLED = """G21 G90 G55 T2 M6
S3000 M3 M8
G0 X20.
G1 X-20. F2000
S4500
G1 X20.
M5 M9
G1 A6.
M30
"""
RULED = "example2_ready.ngc"  # of the shipped programs


def ruled() -> str:
    """Two ruled surfaces, faster than the paper's, and with a cutter whose placement takes no search."""
    return program(RULED, "1500.")


# -- live: processes of their own, in real time


def cutting(service: Serving, line: int) -> None:
    service.until(lambda now: now["mode"] == "RUNNING" and now["job"]["line"] >= line)


def held(service: Serving) -> None:
    service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])


def spindle_switched(service: Serving) -> None:
    """The operator has switched it as the stop asks."""
    service.until(lambda now: now["spindle_change"])
    service.ask("resume")


def begun(service: Serving, text: str, tool: int) -> None:
    service.put_in(tool)
    service.load(text)
    service.done("start")


def ended(service: Serving, state: str = "completed") -> None:
    assert service.ended()["job"]["state"] == state


def override_before_the_start(service: Serving) -> None:
    service.ask("rapid_override", share=0.5)
    service.ask("override", share=1.0 / 3.0)
    begun(service, TIPS, 2)
    cutting(service, 5)
    service.ask("override", share=1.7)
    ended(service)


def hold_and_resume_on_ruled_surfaces(service: Serving) -> None:
    begun(service, ruled(), 2)
    spindle_switched(service)
    cutting(service, 10)
    service.ask("hold")
    held(service)
    service.ask("override", share=0.8)
    service.ask("resume")
    cutting(service, 19)
    service.ask("hold")
    service.ask("resume")
    ended(service)


def retract_and_return(service: Serving) -> None:
    begun(service, TIPS, 2)
    cutting(service, 6)
    service.ask("hold")
    held(service)
    service.done("retract", mm=12.0)
    values = {"name": "end mill 3 mm", "radius_mm": 1.5, "flute_mm": 15.0, "length_mm": 4.0}
    service.ask("set_tool", number=2, **values)
    service.done("return")
    service.ask("resume")
    ended(service)


def jog_aside(service: Serving) -> None:
    begun(service, TIPS, 2)
    cutting(service, 6)
    service.ask("hold")
    held(service)
    service.done("retract", mm=6.0)
    for _ in range(8):
        service.ask("jog", frame="joint", axis="X", speed=0.4, press="of the test")
        time.sleep(0.05)
    service.ask("jog_stop", press="of the test")
    held(service)
    service.ask("jog_step", frame="joint", axis="Y", distance=-3.0)
    service.until(lambda now: now["mode"] == "JOG")
    held(service)
    service.done("return")
    service.ask("resume")
    ended(service)


def killed_plan(service: Serving) -> None:
    long = TIPS.replace("M30\n", "G1 X10. Z60. F600.\nG1 X-30. A8.\n" * 8 + "M30\n")
    begun(service, long, 2)
    cutting(service, 6)
    service.kill("plan")
    service.until(lambda now: now["mode"] == "FAULT" and now["at_rest"])
    service.until(lambda now: now["plan_alive"])


def emergency_stop(service: Serving) -> None:
    begun(service, CONE, 2)
    spindle_switched(service)
    cutting(service, 3)
    service.until(lambda now: now["job"]["elapsed_s"] > 2.0)
    service.ask("estop")
    service.until(lambda now: now["mode"] == "FAULT" and now["at_rest"])


def after_homing_anew(service: Serving) -> None:
    """Homing is in no run; the next one begins where it has left the axes."""
    service.done("mdi", text="G0 X-7.3 Y11. A3.")
    service.ended()
    service.done("home", axes=["X", "C"])
    service.ask("set_offset", name="G54", values=[1.0, 90.0, 110.0])
    begun(service, TIPS, 2)
    ended(service)


def tool_changes(service: Serving) -> None:
    service.ask("optional_stop", on=True)
    begun(service, CHANGES, 1)
    service.until(lambda now: now["tool_change"])
    service.ask("resume")
    cutting(service, 5)
    held(service)
    service.ask("resume")
    ended(service)


def restart_behind_a_line(service: Serving) -> None:
    service.put_in(2)
    path = service.state / "part.ngc"
    path.write_text(TIPS)
    service.done("load", path=str(path), name="part.ngc", line=5, fraction=0.4)
    service.done("start")
    ended(service)


def single_block_and_stop(service: Serving) -> None:
    service.ask("single_block", on=True)
    begun(service, TIPS_B, 2)
    for _ in range(3):
        held(service)
        service.ask("resume")
    held(service)
    service.ask("single_block", on=False)
    service.ask("resume")
    cutting(service, 6)
    service.ask("stop")
    ended(service, "stopped")


# -- on the stepped clock: what befalls drives and devices at a tick


def lost_drive(bench: RecordedBench) -> None:
    """Y's torque is taken from it; the others stop on the path."""
    bench.started(TIPS_B)
    bench.until_line(5)
    script = MachineScript.read("at 0.05 s: sto Y", bench.machine)
    script.inject(bench.stepped.rig.buses)
    bench.until(Mode.FAULT)
    bench.ended("fault")


def door_and_waits(bench: RecordedBench) -> None:
    """The spindle's run-up, and a door that opens in the cut: a resume is refused, and another one taken."""
    rig = bench.stepped.rig
    bench.started(MILLED)
    bench.until_line(4)
    rig.io["io"].set_input(DOOR, False, rig.now_s)
    bench.until(Mode.HOLD)
    bench.request(Request.RESUME)
    rig.io["io"].set_input(DOOR, True, rig.now_s)
    bench.rows.append(bench.stepped.go(50))
    bench.jog(Jog((0.0, 0.0, 1.0, 0.0, 0.0), 20.0, math.inf))
    bench.request(Request.JOG_STOP)
    bench.until(Mode.HOLD)
    bench.led("return")
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    bench.ended()


LIVE: dict[str, tuple[Callable[[Serving], None], str]] = {
    "override_before_the_start": (override_before_the_start, "trunnion"),
    "hold_and_resume_on_ruled_surfaces": (hold_and_resume_on_ruled_surfaces, "trunnion"),
    "retract_and_return_with_a_longer_tool": (retract_and_return, "trunnion"),
    "jog_aside": (jog_aside, "trunnion"),
    "killed_plan": (killed_plan, "trunnion"),
    "emergency_stop": (emergency_stop, "trunnion"),
    "after_homing_anew": (after_homing_anew, "trunnion"),
    "tool_changes": (tool_changes, "trunnion"),
    "restart_behind_a_line": (restart_behind_a_line, "trunnion"),
    "single_block_and_stop": (single_block_and_stop, "table_head"),
    "ruled_surfaces_on_an_oblique_head": (hold_and_resume_on_ruled_surfaces, "oblique45"),
}
STEPPED: dict[str, tuple[Callable[[RecordedBench], None], Callable[[], object]]] = {
    "lost_drive": (
        lost_drive,
        lambda: machine_file.with_period(machine_file.load("head_head"), PERIOD_MS / 1e3),
    ),
    "door_and_waits": (door_and_waits, lambda: machine_file.with_period(mill(), PERIOD_MS / 1e3)),
}


def _live(name: str, scratch: Path) -> Path:
    act, machine = LIVE[name]
    with serving(scratch, "--machine", machine, "--period-ms", f"{PERIOD_MS:g}") as service:
        service.ready()
        act(service)
        before = len(records(service.state))
        until(lambda: len(records(service.state)) >= max(before, 1))
        time.sleep(0.5)  # of the last one the files are being written
        return max(records(service.state))


def _stepped(name: str, scratch: Path) -> Path:
    act, machine = STEPPED[name]
    bench = RecordedBench(scratch, machine())
    act(bench)
    return bench.record.folder


def make(name: str, folder: Path) -> None:
    """One of them, under its name."""
    with tempfile.TemporaryDirectory(prefix="recording-") as scratch:
        found = _live(name, Path(scratch)) if name in LIVE else _stepped(name, Path(scratch))
        shutil.rmtree(folder / name, ignore_errors=True)
        shutil.copytree(found, folder / name)
    told = json.loads((folder / name / "run.json").read_text())
    kept = sum(file.stat().st_size for file in (folder / name).iterdir())
    print(f"{name}: {told['result']}, {told['ticks']} ticks, {kept} bytes", flush=True)


if __name__ == "__main__":
    for wanted in sys.argv[2:] or [*LIVE, *STEPPED]:
        make(wanted, Path(sys.argv[1]))
