"""Each step of a bring-up on a simulated machine: what is right passes, and what is wrong is told."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controller.bringup import protocol
from controller.bringup.conduct import conduct
from controller.bringup.protocol import Outcome
from controller.bringup.simulated import SimulatedBench
from controller.bringup.site import Site
from controller.bringup.steps import steps
from controller.bringup.ticks import NotDone, Ticks
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import Message
from controller.runtime.simulation import MotorParameters
from controller.runtime.stepped import SteppedMachine

PART = Path(__file__).parents[3] / "config" / "programs" / "example1_ready.ngc"


class Hand:
    """An operator who reads one value, and sees what he is asked for or not."""

    def __init__(self, reads: float = 0.0, sees: bool = True) -> None:
        self.reads, self.sees = reads, sees
        self.asked: list[str] = []

    def value(self, question: Message) -> float:
        self.asked.append(question["key"])
        return self.reads

    def confirms(self, question: Message) -> bool:
        self.asked.append(question["key"])
        return self.sees

    def works(self, request: Message) -> AbstractContextManager[Callable[[], bool]]:
        raise AssertionError(f"a simulated machine does it itself: {request}")

    def does(self, request: Message) -> None:
        raise AssertionError(f"a simulated machine does it itself: {request}")


def done(bench: SimulatedBench, name: str, folder: Path, hand: Hand | None = None) -> Outcome:
    step = next(one for one in steps(bench.machine) if one.name == name)
    made = protocol.opened(folder, bench.machine, simulated=True)
    return conduct(step, Site(bench, hand or Hand(), made, PART))


def keys(found: list[Message]) -> list[str]:
    return [one["key"] for one in found]


@pytest.mark.slow
def test_stops_scale_circle_spindle_and_a_part_on_the_machine_of_a_shop(tmp_path: Path) -> None:
    """In the order of the steps; after each stop the machine is up again."""
    machine = machine_file.load("shop")
    bench = SimulatedBench(machine, SteppedMachine(machine, motor=MotorParameters()))
    estop = done(bench, "estop", tmp_path)
    assert estop.good and len(estop.figures) == 1 and bench.stopped_by() is None
    sto = done(bench, "sto.Y", tmp_path)
    assert sto.good and len(sto.figures) == 2
    before = bench.positions()
    scale = done(bench, "scale.A", tmp_path, Hand(90.0))
    assert scale.good and bench.positions() == pytest.approx(before, abs=0.01)
    circle = done(bench, "circle.XZ", tmp_path)
    assert circle.good and 0.0 < circle.measured["off_mm"] < 2e-3
    spindle = done(bench, "spindle", tmp_path)
    own = machine.spindle
    assert own is not None
    run_up_s = own.max_rev_min / 60.0 / own.acceleration_rev_s2
    assert spindle.good and 0.95 * run_up_s <= spindle.measured["spin_up_s"] <= run_up_s + 0.2
    (proposed,) = spindle.proposals
    assert proposed["key"] == "spin_up_s" and run_up_s < proposed["new"] < own.spin_up_s
    part = done(bench, "dry_run", tmp_path)
    assert part.good and len(part.figures) == 1 + len(machine.axes)
    with pytest.raises(NotDone):
        step = next(one for one in steps(machine) if one.name == "dry_run")
        conduct(step, Site(bench, Hand(), protocol.opened(tmp_path, machine, simulated=True)))


class Switched:
    """A machine whose Z moves by so much while its drives are off."""

    def __init__(self, machine: Machine, moved_mm: float) -> None:
        self.machine, self._moved_mm = machine, moved_mm

    def switched_off(self, seconds: float) -> Ticks:
        n = round(seconds / self.machine.period_s)
        actual = np.zeros((n, len(self.machine.axes)))
        actual[:, 2] = 100.0 - self._moved_mm * np.minimum(1.0, np.linspace(0.0, 4.0, n))
        return Ticks(self.machine.period_s, 5, actual, actual, np.zeros(n, dtype=np.int64))


@pytest.mark.parametrize(("moved_mm", "told"), [(0.0, []), (0.3, []), (0.5, ["bringup.sags"])])
def test_a_brake_that_does_not_hold_is_told(moved_mm: float, told: list[str], tmp_path: Path) -> None:
    """The window at rest of Z is 0.4 mm."""
    machine = machine_file.load("shop")
    found = done(Switched(machine, moved_mm), "brake.Z", tmp_path)  # type: ignore[arg-type]
    assert found.good is (not told) and keys(found.findings) == told
    assert found.measured["moved"] == pytest.approx(moved_mm)


@pytest.mark.slow
def test_a_brake_that_holds_passes_and_the_machine_is_up_again(tmp_path: Path) -> None:
    bench = SimulatedBench(machine_file.load("shop"))
    held = done(bench, "brake.Z", tmp_path)
    assert held.good and held.measured["moved"] == 0.0
    assert done(bench, "scale.X", tmp_path, Hand(10.0)).good


@pytest.mark.slow
def test_a_circle_of_axes_that_lag_differently_is_not_round(tmp_path: Path) -> None:
    machine = machine_file.load("trunnion")
    soft = SimulatedBench(machine, SteppedMachine(machine, stiffness={"X": 0.3}))
    found = done(soft, "circle.XY", tmp_path)
    assert not found.good and keys(found.findings) == ["bringup.not_round"]


@pytest.mark.slow
def test_an_axis_without_room_is_not_moved(tmp_path: Path) -> None:
    machine = machine_file.load("trunnion")
    y = machine.axes[1]
    short = replace(y, travel_min=-4.0, travel_max=4.0)
    bench = SimulatedBench(replace(machine, axes=(machine.axes[0], short, *machine.axes[2:])))
    with pytest.raises(NotDone, match="no room"):
        done(bench, "scale.Y", tmp_path, Hand(10.0))
