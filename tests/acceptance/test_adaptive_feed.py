"""Adaptive feed from the program to the chip: the simulated cut grows with the feed, and jumps along the way.

The load is what the spindle's drive tells of its torque; what the tip cuts is found from the motors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.live.replayed_runs import again, assert_same_setpoints
from support.machines.interrupted_runs import assert_in_limits, distance, segments
from support.machines.recording_bench import RecordedBench
from support.machines.spindle_machine import SLOWER, SPINDLE, mill

from controller.ipc.handoff import COLUMN, Snapshot, of_axes
from controller.machine.model import Machine
from controller.machine.toml_table import parse
from controller.program.program import ProgramError
from controller.runtime import checked
from controller.runtime.bench import probe
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.bench.probe import Bench
from controller.runtime.events import Event
from controller.runtime.stepped import Run, SteppedMachine
from controller.state.modes import Fault, Mode, Request
from controller.tick.adaptive import BAND, DEAF_SYNCS

TARGET, LEAST, FALL_S = 0.5, 0.2, 0.3
ANSWER_S = 0.3  # of the planner, and of the ramps to another feed
LAW = "load_percent = 50.0, overload_percent = {}, overload_s = 0.1, rise_s = 0.5"
PART = """
frame = "table"
[[solid]]
kind = "block"
low_mm = [0.0, -1000.0, -1000.0]
high_mm = [80.0, 1000.0, 1000.0]

[cut]
force_n_mm2 = 1800.0
rated_nm = 1.0
"""
STOCK = """
[[stock]]
low_mm = [{}, -1000.0, -1000.0]
high_mm = [{}, 1000.0, 1000.0]
section_mm2 = {}
"""
LIGHT, HEAVY = 5.0, 13.0  # mm2: 29 % and 75 % of the rated torque at F
X0 = 8.0  # of G54
# Straight on, round a corner and with a rotary: the stock is a wall across X.
TEXT = """G21 G90 G54 G61
S3000 M3
{}
G0 X0 Y0
G1 X24 Y4 F600
G1 X40 Y0
G3 X48 Y8 I0 J8
G1 X70 Y12 A2
M30
"""


def machine(overload: float = 140.0, more: str = "") -> Machine:
    law = f"position = {{ load = true }}\nadaptive = {{ {LAW.format(overload)}{more} }}"
    spindle = SPINDLE.replace("counts_per_rev = 4096", f"counts_per_rev = 4096\n{law}")
    return mill(spindle, "", "", changes=(SLOWER,))


def stock(made: Machine, rows: Sequence[tuple[float, float, float]]) -> Bench:
    """Boxes along X of the part: from, to, and the section of the chip."""
    text = PART + "".join(STOCK.format(a + X0, b + X0, section) for a, b, section in rows)
    return probe.read(parse(text, "stock.toml"), made, Path())


PROFILE = ((4.0, 15.0, LIGHT), (15.0, 36.0, HEAVY), (36.0, 60.0, LIGHT))


class Cutter:
    """Runs programs in the stock, and sees every tick."""

    def __init__(
        self, made: Machine | None = None, rows: Sequence[tuple[float, float, float]] = PROFILE
    ) -> None:
        self.machine = made or machine()
        self.bench = SteppedMachine(self.machine, bench=stock(self.machine, rows))
        self.bench.come_up()
        self.seen: list[Snapshot] = []
        self.at: dict[int, Callable[[], object]] = {}  # what happens, by tick of the run
        self._tick = self.bench.tick
        self.bench.tick = self._noted  # type: ignore[method-assign]

    def _noted(self) -> None:
        if (act := self.at.get(len(self.seen))) is not None:
            act()
        self._tick()
        now = self.bench.board.read()
        assert now is not None
        self.seen.append(now)

    def run(self, text: str, *events: Event) -> Run:
        self.seen.clear()
        task = replace(checked.task(text.encode(), "part.ngc", self.machine), start=self.bench.joints)
        return self.bench.run(checked.walk_of(task, None, False), events)


class Found:
    """A run by columns."""

    def __init__(self, run: Run, made: Machine) -> None:
        self.rows = run.rows
        self.load, self.share = (run.rows[:, COLUMN[n]] for n in ("spindle_load", "adaptive_share"))
        self.feed = run.rows[:, COLUMN["feed_mm_s"]]
        self.x = run.rows[:, COLUMN["joint_command_0"]] - X0
        self._settles = round((5.0 * FALL_S + ANSWER_S) / made.period_s)

    def between(self, low: float, high: float, settled: bool = False) -> np.ndarray:
        """The rows of the cut with X there, or the settled ones of them."""
        at = np.flatnonzero((self.x > low + 0.2) & (self.x < high - 0.2) & (self.feed > 0.0))
        return at[self._settles :] if settled else at


def test_the_load_is_kept_at_its_target_the_feed_falls_and_returns() -> None:
    with_it, without = Cutter(), Cutter()
    text = TEXT.format("M52 P1")
    led = Found(with_it.run(text), with_it.machine)
    free = Found(without.run(TEXT.format("")), without.machine)
    heavy = free.between(15.0, 36.0)
    assert free.load[heavy].max() > 1.4 * TARGET and (free.share == 1.0).all()
    settled = led.between(15.0, 36.0, settled=True)
    assert len(settled) > 100
    assert np.abs(led.load[settled] / TARGET - 1.0).max() <= BAND
    assert led.feed[settled].max() < 7.5 < 9.9 < led.feed[led.between(4.0, 15.0)].max()
    assert led.share[led.between(60.0, 69.0)][-1] == 1.0 and led.feed[led.between(65.0, 69.0)][-1] > 9.9
    # The path is the same, and within every limit.
    wanted = segments(text, with_it.machine)
    assert distance(led.rows, wanted, with_it.bench.kinematics) < 1e-9
    assert_in_limits(led.rows[:, of_axes("joint_command", 5)], with_it.machine, "adaptive")
    assert with_it.seen[-1].joints == without.seen[-1].joints


def test_the_switch_of_the_operator_does_it_without_m52_and_ends_it() -> None:
    cutter = Cutter(rows=((4.0, 60.0, HEAVY),))
    on, off = Event(10, Request.ADAPTIVE_FEED, 1.0), Event(1250, Request.ADAPTIVE_FEED, 0.0)
    found = Found(cutter.run(TEXT.format(""), on, off), cutter.machine)
    assert np.abs(found.load[1150:1245] / TARGET - 1.0).max() <= BAND
    assert found.load[found.between(50.0, 60.0)].min() > 1.4 * TARGET
    assert cutter.seen[1200].adaptive_on and not cutter.seen[1350].adaptive_on


@pytest.mark.parametrize("locked", ["M49", "M50 P0"])
def test_a_feed_that_the_program_has_locked_is_as_f_says(locked: str) -> None:
    cutter = Cutter(rows=((4.0, 30.0, HEAVY),))
    text = TEXT.format(f"M52 P1\n{locked}")
    found = Found(cutter.run(text), cutter.machine)
    assert found.feed[found.between(10.0, 23.0)].min() > 9.9 and (found.share == 1.0).all()
    assert not any(now.adaptive_on for now in cutter.seen)


def test_rapids_and_threads_are_not_led() -> None:
    cutter = Cutter(rows=((12.0, 40.0, HEAVY),))
    text = (
        "G21 G90 G54 G61\nS3000 M3\nM52 P1\nG0 X10 Y0\nG1 X40 F600\nG0 X60\nS300 M3\nG0 Z100\n"
        "G33.1 Z95 K1\nM30\n"
    )
    assert cutter.run(text).result == "completed"
    of = {now.line: now for now in cutter.seen if now.feed_mm_s > 0.0}
    assert of[5].adaptive_on and of[5].adaptive_share < 0.75
    assert not of[6].adaptive_on and not of[9].adaptive_on
    assert of[6].adaptive_share == of[9].adaptive_share == of[5].adaptive_share


def test_an_overload_holds_on_the_path_in_its_own_words() -> None:
    cutter = Cutter(machine(overload=70.0), ((4.0, 20.0, LIGHT), (20.0, 60.0, 20.0)))
    text = TEXT.format("M52 P1")
    run = cutter.run(text)
    assert (run.result, run.fault) == ("held", Fault.SPINDLE_OVERLOADED)
    assert "load of the spindle" in run.fault_text and "tool" in run.fault_text
    now = cutter.seen[-1]
    assert now.mode is Mode.HOLD and now.at_rest and 20.0 < now.joints[0] - X0 < 24.0
    assert distance(run.rows, segments(text, cutter.machine), cutter.bench.kinematics) < 1e-9
    assert_in_limits(run.rows[:, of_axes("joint_command", 5)], cutter.machine, "overload")


def test_after_an_overload_it_goes_on_where_it_stood() -> None:
    cutter = Cutter(machine(overload=70.0), ((4.0, 20.0, LIGHT), (20.0, 30.0, 13.0)))
    run = cutter.run(TEXT.format("M52 P1"), Event(1100, Request.RESUME), Event(1500, Request.RESUME))
    assert Mode.HOLD in {now.mode for now in cutter.seen} and run.result == "completed"


@pytest.mark.slow
def test_a_drive_that_tells_no_load_any_more_leaves_the_least_feed_and_a_warning() -> None:
    cutter = Cutter(rows=((4.0, 60.0, LIGHT),))
    lost = MachineScript.read("on can1: at 0 s: drop 28A for 5 s", cutter.machine)
    cutter.at = {500: lambda: lost.inject(cutter.bench.rig.buses, 0.0)}
    assert cutter.run(TEXT.format("M52 P1")).result == "completed"
    assert cutter.seen[495].adaptive_share == 1.0 and cutter.seen[495].warning is Fault.NONE
    assert cutter.seen[500 + DEAF_SYNCS + 3].warning is Fault.LOAD_UNKNOWN
    slow = cutter.seen[500 + round(2.5 / cutter.machine.period_s)]
    assert slow.adaptive_share == LEAST and slow.feed_mm_s == pytest.approx(10.0 * LEAST, rel=1e-3)
    assert cutter.seen[-2].adaptive_share > 0.5, "it is told again"


def test_a_machine_without_it_refuses_m52_in_the_check() -> None:
    with pytest.raises(ProgramError, match=r"no adaptive in \[spindle\]"):
        checked.walk_of(checked.task(TEXT.format("M52 P1").encode(), "p.ngc", mill()), None, False)


@pytest.mark.slow
def test_a_record_comes_again_bit_for_bit_whatever_the_spindle_feels(tmp_path: Path) -> None:
    """The repetition has no stock at all: how much of the feed was left comes out of the record."""
    made = machine()
    text = TEXT.format("M52 P1")
    bench = RecordedBench(tmp_path, made, None, stock(made, PROFILE))
    bench.started(text, in_spindle=1)
    bench.until_line(6)
    bench.request(Request.HOLD)
    bench.until(Mode.HOLD)
    bench.request(Request.ADAPTIVE_FEED, 1.0)
    bench.request(Request.RESUME)
    bench.until(Mode.READY)
    folder = bench.ended()
    rows = np.concatenate(bench.rows)
    assert rows[:, COLUMN["adaptive_share"]].min() < 0.75 and rows[:, COLUMN["spindle_load"]].max() > 0.4
    assert '"adaptive"' in (folder / "events.jsonl").read_text()
    done = again(folder, text, made)
    assert done.run.result == "completed"
    assert_same_setpoints(done, True)
    assert done.run.rows[:, COLUMN["adaptive_share"]].min() < 0.75
    assert np.abs(done.run.rows[500:, COLUMN["spindle_load"]]).max() < 0.2
