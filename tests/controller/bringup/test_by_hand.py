"""What an operator works by hand is named by what the control sees of it: it, another one, or none."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from controller.bringup import protocol
from controller.bringup.conduct import conduct
from controller.bringup.protocol import Outcome
from controller.bringup.simulated import SPHERE, SimulatedBench
from controller.bringup.site import Site
from controller.bringup.steps import steps
from controller.bringup.ticks import NotDone, Stop
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import Message, message
from controller.runtime import simulation
from controller.runtime.stepped import SteppedMachine

SHOP = machine_file.load("shop")
LEVELS = {name: name == "clamp_A_closed" for name, _ in (SHOP.io.inputs if SHOP.io is not None else ())}


TRUNNION = Path(__file__).parents[3] / "config" / "trunnion.toml"
NO_CHANGER = replace(SHOP, changer=None)
SLOW = machine_file.with_period(SHOP, 0.008)  # what a touch tells is latched, whatever the period


@dataclass
class Bench:
    """A machine whose wires are as ``crossed`` has them: what is worked -> what is seen; "" = nothing."""

    machine: Machine = SHOP
    crossed: dict[str, str] = field(default_factory=dict)
    clamp_s: float = 0.1
    stop: Stop | None = None
    now_s: float = 0.0
    powered: list[bool] = field(default_factory=list)
    _levels: dict[str, bool] = field(default_factory=LEVELS.copy)
    _word: int = 0
    _clamped_s: tuple[float, bool] = (0.0, True)

    def by_hand(self, action: str) -> bool:
        what, _, of = action.partition(".")
        if what == "turn" and (seen := self.crossed.get(of, of)):
            self._levels[seen] = not self._levels[seen]
        if what == "switch" and (seen := self.crossed.get(of, of)):
            self._word ^= {"X.negative": 1, "X.positive": 2, "X.home": 4}[seen]
        return True

    def power(self, on: bool) -> None:
        self.powered.append(on)

    def wait(self, seconds: float) -> None:
        self.now_s += seconds

    def inputs(self) -> dict[str, bool]:
        at_s, closed = self._clamped_s
        if 0.0 < at_s <= self.now_s:
            self._levels["clamp_A_closed"] = closed
        return dict(self._levels)

    def switches(self, axis: str) -> int:
        return self._word

    def clamp(self, axis: str, is_open: bool) -> None:
        self._clamped_s = self.now_s + self.clamp_s, not is_open

    def stopped_by(self) -> Stop | None:
        return self.stop

    def recover(self) -> None:
        pass

    def tool(self) -> int:
        return 1


class Operator:
    """Answers a sphere's radius, and leaves what he is to do himself."""

    def value(self, question: Message) -> float:
        return 12.5

    def does(self, request: Message) -> None:
        raise NotDone(message("bringup.left"))


def done(bench: object, name: str, folder: Path) -> Outcome:
    machine: Machine = bench.machine  # type: ignore[attr-defined]
    step = next(one for one in steps(machine) if one.name == name)
    made = protocol.opened(folder, machine, simulated=True)
    return conduct(step, Site(bench, Operator(), made))  # type: ignore[arg-type]


def keys(found: list[Message]) -> list[str]:
    return [one["key"] for one in found]


def test_every_input_is_seen_with_the_drives_off_and_the_emergency_stop_has_a_step_of_its_own(
    tmp_path: Path,
) -> None:
    bench = Bench()
    found = done(bench, "inputs", tmp_path)
    assert found.good and bench.powered == [False, True]
    assert len(found.figures) == len(bench.inputs()) - 1


@pytest.mark.parametrize("name", ["inputs", "switches.X"])
def test_drives_go_on_only_when_the_operator_says_that_nobody_is_at_the_machine(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench()
    worked = bench.by_hand
    monkeypatch.setattr(bench, "by_hand", lambda action: action != "stand_clear" and worked(action))
    with pytest.raises(NotDone, match="left"):
        done(bench, name, tmp_path)
    assert bench.powered == [False]


@pytest.mark.parametrize(
    ("seen", "finding"),
    [("part_there", "bringup.other_edge"), ("", "bringup.no_edge"), ("estop", "bringup.other_edge")],
)
def test_an_input_that_is_another_one_or_none_is_told_by_name(
    seen: str, finding: str, tmp_path: Path
) -> None:
    found = done(Bench(crossed={"probe": seen}), "inputs", tmp_path)
    assert not found.good and keys(found.findings) == [finding]
    assert found.findings[0]["values"] == ({"what": "probe", "found": seen} if seen else {"what": "probe"})


def test_switches_are_known_apart_and_one_that_homing_needs_may_not_be_missing(tmp_path: Path) -> None:
    assert done(Bench(), "switches.X", tmp_path).good
    exchanged = done(Bench(crossed={"X.negative": "X.positive"}), "switches.X", tmp_path)
    assert keys(exchanged.findings) == ["bringup.other_edge"]
    x = SHOP.axes[0]
    for method, good in ((17, False), (2, True), (37, True)):
        own = replace(SHOP, axes=(replace(x, homing=replace(x.homing, method=method)), *SHOP.axes[1:]))
        assert done(Bench(own, {"X.negative": ""}), "switches.X", tmp_path).good is good


@pytest.mark.parametrize(
    ("method", "word", "good"), [(24, 4, True), (24, 1, False), (17, 1, True), (37, 4, True)]
)
def test_an_axis_that_stands_on_a_switch_was_homed_by_it_or_has_to_leave_it(
    method: int, word: int, good: bool, tmp_path: Path
) -> None:
    x = SHOP.axes[0]
    own = replace(SHOP, axes=(replace(x, homing=replace(x.homing, method=method)), *SHOP.axes[1:]))
    found = done(Bench(own, _word=word), "switches.X", tmp_path)
    assert found.good is good and len(found.figures) == (3 if good else 2)
    assert keys(found.findings) == ([] if good else ["bringup.stands_on"])


@pytest.mark.parametrize(("clamp_s", "good"), [(0.05, True), (5.0, False), (100.0, False)])
def test_a_clamp_is_timed_by_its_input(clamp_s: float, good: bool, tmp_path: Path) -> None:
    found = done(Bench(clamp_s=clamp_s), "clamp.A", tmp_path)
    assert found.good is good
    assert found.measured["open_s"] == pytest.approx(min(clamp_s, 30.0), abs=0.021)


def test_a_stop_is_of_its_own_input_and_of_the_drive_that_was_interrupted(tmp_path: Path) -> None:
    """Nothing is seen of the emergency stop's input here, though the machine stops."""
    stopped = Stop("Y", message("text", text="torque"))
    assert done(Bench(stop=stopped), "sto.Y", tmp_path).good
    assert keys(done(Bench(stop=stopped), "sto.X", tmp_path).findings) == ["bringup.other_drive"] * 2
    assert keys(done(Bench(stop=stopped), "estop", tmp_path).findings) == ["bringup.no_edge"]
    assert keys(done(Bench(), "estop", tmp_path).findings) == ["bringup.not_stopped"]


@pytest.mark.slow
def test_inputs_switches_clamp_and_every_step_of_the_changer_on_the_machine_of_a_shop(tmp_path: Path) -> None:
    bench = SimulatedBench(SHOP)
    for name in ("inputs", "switches.X", "clamp.A"):
        assert done(bench, name, tmp_path).good, name
    changed = done(bench, "changer", tmp_path)
    assert changed.good and SHOP.changer is not None
    tools = [tool for tool in SHOP.changer.pockets if tool not in (0, 99)]
    steps_of_one = len(SHOP.changer.put_away) + len(SHOP.changer.take)
    assert len(changed.figures) == len(tools) * steps_of_one
    late = replace(SHOP.changer.take[1], within_s=0.2)
    slow = replace(SHOP, changer=replace(SHOP.changer, take=(SHOP.changer.take[0], late)))
    bench.machine = slow
    with pytest.raises(NotDone, match="did not come in time"):
        done(bench, "changer", tmp_path)


@pytest.mark.slow
def test_the_centre_of_a_rotary_is_found_by_probe_where_it_is(tmp_path: Path) -> None:
    """What the machine file says of C is off, and what it says of A is not."""
    off_mm, c = 0.2, SLOW.axes[-1]
    x, y, z = c.point_mm
    wrong = replace(SLOW, axes=(*SLOW.axes[:-1], replace(c, point_mm=(x + off_mm, y, z))))
    stepped = SteppedMachine(SLOW, bench=simulation.bench_of(SPHERE, SLOW))
    found = done(SimulatedBench(wrong, stepped), "rotaries", tmp_path)
    (row,) = [one["values"] for one in found.figures if one["values"]["axis"] == "C"]
    assert row["moved_um"] == pytest.approx(1e3 * off_mm, abs=15.0)
    assert [one["values"]["axis"] for one in found.findings] == ["C"]


@pytest.mark.slow
def test_the_contact_of_the_motor_supply_is_seen_and_the_machine_is_up_again(tmp_path: Path) -> None:
    """It is a fault with the drives off, too, and takes commissioning and homing to come out of."""
    file = tmp_path / "powered.toml"
    own = TRUNNION.read_text().replace('"tools.toml"', f'"{TRUNNION.parent / "tools.toml"}"')
    file.write_text(f"{own}\n[io]\nnode = 11\ninputs = {{ estop = 0, power = 1 }}\n")
    bench = SimulatedBench(machine_file.load(str(file)))
    found = done(bench, "inputs", tmp_path)
    assert found.good and [one["values"]["what"] for one in found.figures] == ["power"]
    assert bench.stopped_by() is None and done(bench, "brake.Z", tmp_path).good


@pytest.mark.slow
def test_without_a_changer_the_probe_is_put_in_by_hand(tmp_path: Path) -> None:
    bench = SimulatedBench(replace(SLOW, changer=None))
    assert done(bench, "rotaries", tmp_path).good
    assert SHOP.probe is not None and bench.tool() == SHOP.probe.tool


def test_rotaries_are_not_probed_with_another_tool_than_the_probe(tmp_path: Path) -> None:
    with pytest.raises(NotDone, match="T99, is not in the spindle"):
        done(Bench(NO_CHANGER), "rotaries", tmp_path)
