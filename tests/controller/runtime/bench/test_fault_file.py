"""Fault scripts of a whole machine: which bus a line is about, and from when its time counts."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.machines.stepped_runs import shipped

from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.stepped import SteppedMachine
from drives import pdo
from drives.bench.virtual.fault_script import Action, FaultScript, ScriptError


def read(text: str, name: str = "trunnion") -> list[tuple[str, str]]:
    return [(one.bus, one.injection.text()) for one in MachineScript.read(text, shipped(name)).faults]


def test_on_one_bus_a_line_means_what_it_means_to_drives_simulate() -> None:
    lines = ("at 2.5 s: drop 203 x 2", "at sync 1200: delay rpdo 3 by 500 us", "at 7 s: node_reset 2")
    text = "\n".join(("seed 7", "", "# nothing", *lines))
    script, alone = MachineScript.read(text, shipped()), FaultScript.read(text)
    assert tuple(one.injection for one in script.faults) == alone.injections
    assert script.seed == alone.seed == 7
    assert [one.number for one in script.faults] == [4, 5, 6]


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("at 1 s: drop rpdo 4", ("can1", "drop 204 x 1")),
        ("at 1 s: drop 204", ("can1", "drop 204 x 1")),
        ("at 1 s: silence 5 for 10 ms", ("can1", "silence 5 for 0.01 s")),
        ("at 1 s: drop rpdo A", ("can1", "drop 204 x 1")),
        ("at 1 s: drop rpdo2 Y", ("can0", "drop 302 x 1")),
        ("at 1 s: drop A", None),  # an identifier: 00Ah
        ("on can1: at 1 s: drop A", ("can1", "drop 00A x 1")),
        ("at 1 s: node_reset A", ("can1", "node_reset 4")),
        ("on can1: at 1 s: drop sync x 2", ("can1", "drop 080 x 2")),
        ("on can0 : at 1 s: bus_off master", ("can0", "bus_off master")),
    ],
)
def test_the_node_names_the_bus_where_it_can(line: str, wanted: tuple[str, str] | None) -> None:
    if wanted is None:
        with pytest.raises(ScriptError, match="several buses"):
            read(line, "trunnion_two_buses")
        return
    bus, said = wanted
    assert read(line, "trunnion_two_buses") == [(bus, f"at 1 s: {said}")]


def test_an_axis_names_its_bus_where_every_bus_has_a_node_1() -> None:
    found = read("at 1 s: drop rpdo X\nat 1 s: drop rpdo C\nat 1 s: silence Z", "trunnion_five_buses")
    assert [bus for bus, _ in found] == ["can0", "can4", "can2"]
    assert read("on can3: at 1 s: drop 201", "trunnion_five_buses") == [("can3", "at 1 s: drop 201 x 1")]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("at 1 s: drop rpdo 1", r"line 1: node 1 is on can0, can1, can2, can3, can4; name the axis \(X, Y"),
        ("\nat 1 s: drop sync", r"line 2: the machine has several buses; say which: 'on can0: at \.\.\.'"),
        ("at 1 s: bus_off master", "several buses"),
        ("on can9: at 1 s: drop sync", "line 1: 'can9' is no bus of this machine; there are can0, can1"),
        ("on can0: at 1 s: drop rpdo Y", "Y is on can1, not on can0"),
        ("on can0: at 1 s: silence 2", r"node 2 is not on can0; there are 1 \(X\)"),
        ("on: at 1 s: drop sync", "after 'on' stand a bus and a colon"),
        ("at 1 s: explode 3", "line 1: 'explode' is no fault"),
        ("seed x", "line 1: 'seed x': after 'seed'"),
    ],
)
def test_what_cannot_be_understood_is_told_with_its_line(text: str, said: str) -> None:
    with pytest.raises(ScriptError, match=said):
        read(text, "trunnion_five_buses")


def test_a_node_that_is_not_there_is_named(tmp_path: Path) -> None:
    file = tmp_path / "faults.txt"
    file.write_text("at 1 s: drop rpdo 1\nat 1 s: silence 9\n")
    with pytest.raises(
        ScriptError, match=r"faults\.txt: line 2: node 9 is not on this machine; there are 1 "
    ):
        MachineScript.load(file, shipped())
    file.write_bytes(b"\xff")
    with pytest.raises(ScriptError, match="byte 0 is not UTF-8"):
        MachineScript.load(file, shipped())


@pytest.mark.parametrize("name", ["trunnion", "trunnion_five_buses"])
def test_tick_0_sends_sync_1_at_0_s_and_every_bus_counts_for_itself(name: str) -> None:
    """Two lines, by time and by count, take the same two SYNCs, those of ticks 0 and 10."""
    stepped = SteppedMachine(shipped(name))
    stepped.come_up()
    T, bus = stepped.machine.period_s, stepped.machine.buses[-1].name
    times_s: list[float] = []
    stepped.rig.buses[bus].watch(pdo.SYNC, lambda _frame, at_s: times_s.append(at_s))
    text = f"on {bus}: at sync 1: drop sync\non {bus}: at {10 * T} s: drop sync"
    script = MachineScript.read(text, stepped.machine)
    injected = script.inject(stepped.rig.buses, T)
    origin_s = stepped.rig.now_s + T
    for _ in range(20):
        stepped.tick()
    ticks = [round((at_s - origin_s) / T) for at_s in times_s]
    assert ticks == [-1, *range(1, 10), *range(11, 19)]
    assert [round(done.time_s / T, 3) for done in injected.done()] == [0, 10]
    assert injected.left() == []
    assert [one.injection.action for one in script.faults] == [Action.DROP, Action.DROP]
