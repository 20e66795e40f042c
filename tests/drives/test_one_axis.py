"""One axis for a script, on the stepped bus; and the example of drives/README.md as it stands there."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from drives import pdo
from drives.bench.simulated import Parameters, SimulatedDrive
from drives.bench.virtual.virtual_bus import Port, SteppedBus
from drives.commission import CommissionError, Pump, stepped_pump
from drives.one_axis import AxisError, OneAxis, trapezoid
from drives.settings import BusSettings

ROOT = Path(__file__).parents[2]
QUICK_STOP = 3_000_000
EDS = str(ROOT / "config" / "eds" / "simulated_drive.eds")


class SteppedClock:
    """Time of a stepped bus with one drive on it; ``sent`` has the drive's targets."""

    def __init__(self, parameters: Parameters | None = None) -> None:
        self.bus = SteppedBus()
        self.drive = SimulatedDrive(1, parameters or Parameters())
        self.bus.attach(self.drive)
        self.targets: list[int] = []
        self.bus.watch(0x201, lambda frame, _at_s: self.targets.append(_target(frame)))

    def open(self, settings: BusSettings, filters: object) -> Port:
        return self.bus.port(filters)  # type: ignore[arg-type]

    def pump(self, port: object) -> Pump:
        return stepped_pump(self.bus)

    def wait(self, until_s: float) -> float:
        self.bus.advance(max(self.bus.now_s, until_s))
        return self.bus.now_s


def _target(frame: bytes) -> int:
    return int.from_bytes(frame[10:14], "little", signed=True)


def axis(clock: SteppedClock) -> OneAxis:
    return OneAxis("virtual", "", node=1, eds=EDS, quick_stop=QUICK_STOP, clock=clock)


def test_no_drive_keeps_a_quick_stop_that_nobody_has_looked_at() -> None:
    clock = SteppedClock()
    with axis(clock) as one:
        one.enable()
        assert clock.drive.dictionary.get(0x6085) == QUICK_STOP
    with pytest.raises(CommissionError, match="nobody says how hard it brakes"):
        OneAxis("virtual", "", node=1, eds=EDS, clock=SteppedClock())


def test_it_moves_there_and_back_and_disables_at_the_end() -> None:
    clock = SteppedClock(Parameters(position_counts=-500))
    with axis(clock) as one:
        one.enable()
        assert clock.drive.axis.statusword & 0x6F == 0x27 and one.position == -500
        one.move_to(20_000, speed=40_000, acceleration=200_000)
        assert abs(one.position - 20_000) <= 2
        one.move_to(-3, speed=40_000, acceleration=200_000, window=0)
        assert one.position == -3
    assert clock.drive.axis.statusword & 0x6F != 0x27


def test_its_setpoints_keep_speed_and_acceleration() -> None:
    clock = SteppedClock()
    with axis(clock) as one:
        one.enable()
        first = len(clock.targets)
        one.move_to(10_000, speed=40_000, acceleration=400_000)
    steps = [b - a for a, b in pairwise(clock.targets[first:])]
    assert max(steps) <= 40_000 * 0.01 + 1
    assert max(abs(b - a) for a, b in pairwise(steps[:-20])) <= 400_000 * 0.01**2 + 2


@pytest.mark.parametrize("way", [0.0, 1.0, 3.7, 100.0, 12345.6, 1e6])
@pytest.mark.parametrize("acceleration", [1e3, 1e5, 1e9])
def test_a_trapezoid_ends_where_it_should_and_never_goes_back(way: float, acceleration: float) -> None:
    points = [0.0, *trapezoid(way, 5000.0, acceleration, 0.01)]
    steps = [b - a for a, b in pairwise(points)]
    assert points[-1] == way
    assert all(-1e-9 <= step <= 5000.0 * 0.01 * (1.0 + 1e-9) for step in steps)


def test_what_is_no_motion_is_refused() -> None:
    with axis(SteppedClock()) as one:
        with pytest.raises(AxisError, match="is not enabled; call enable"):
            one.move_to(1, 1.0, 1.0)
        one.enable()
        for target, speed, acceleration in ((2**31, 1.0, 1.0), (0, 0.0, 1.0), (0, 1.0, -1.0)):
            with pytest.raises(ValueError, match="no such motion"):
                one.move_to(target, speed, acceleration)


def test_a_fault_is_told_in_words() -> None:
    clock = SteppedClock()
    with axis(clock) as one:
        one.enable()
        clock.drive.inject(0x4310, clock.bus.now_s)
        with pytest.raises(AxisError, match=r"node 1: emergency \(4310h: drive too hot\)"):
            one.hold(0.1)


def test_a_silent_script_finds_its_drive_stopped() -> None:
    clock = SteppedClock()
    with pytest.raises(AxisError, match="the controller was silent"), axis(clock) as one:
        one.enable()
        clock.wait(clock.bus.now_s + 0.5)
        assert clock.drive.axis.statusword & 0x6F != 0x27
        one.hold(0.1)


def test_a_drive_that_has_fallen_silent_is_not_called_disabled() -> None:
    clock = SteppedClock()
    one = axis(clock)
    one.enable()
    clock.bus.port().send(pdo.frame(pdo.NMT, b"\x02\x01"))
    with pytest.raises(AxisError, match="is not disabled within 5 s: it sends no feedback any more"):
        one.close()


def test_holding_keeps_it_enabled() -> None:
    clock = SteppedClock()
    with axis(clock) as one:
        one.enable()
        one.hold(1.0)
        assert clock.drive.axis.statusword & 0x6F == 0x27


def test_a_drive_that_is_not_there_is_a_sentence() -> None:
    with pytest.raises(CommissionError, match="no answer to SDO"):
        OneAxis("virtual", "", node=2, eds=EDS, quick_stop=QUICK_STOP, clock=SteppedClock())


def block(name: str) -> str:
    """The code block of drives/README.md behind a mark."""
    text = (ROOT / "drives" / "README.md").read_text()
    found = re.search(rf"<!-- {name} -->\n```\w+\n(.*?)```", text, re.S)
    assert found, name
    return found[1]


@pytest.mark.slow
@pytest.mark.live
def test_the_pages_six_lines_move_one_axis(tmp_path: Path) -> None:
    path = str(tmp_path / "can")
    serve, script = (
        block(f"drives alone: {what}").replace("/tmp/directrix-can", path) for what in ("bus", "move")
    )
    assert sum(bool(line) for line in script.splitlines()) == 6
    command = [sys.executable, *shlex.split(serve)[1:]]
    served = subprocess.Popen(command, cwd=ROOT)
    try:
        while not os.path.exists(path):
            assert served.poll() is None
        done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert abs(int(done.stdout) - 20_000) <= 2
    finally:
        served.send_signal(signal.SIGTERM)
        served.wait()


def test_nothing_of_the_controller_is_needed(tmp_path: Path) -> None:
    code = "import sys, drives.one_axis; print([m for m in sys.modules if m.startswith('controller')])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
