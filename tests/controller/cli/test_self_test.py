"""The lines of the self-test, on made-up computers."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from support.fakes import computers
from support.fakes.service_stand_ins import answering
from typer.testing import CliRunner

from controller.cli import host_findings, self_test, service
from controller.cli.host_lines import Line
from controller.cli.host_view import PUMP_NAME, TICK_NAME, Host, permitted_of
from controller.machine.model import Bus
from controller.runtime.wake_ups import Histogram

BUS = Bus("x", "socketcan", "can0", 1_000_000)


def computer(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return root


def histogram(*late_s: float) -> Histogram:
    found = Histogram()
    for one in late_s:
        found.add(one)
    return found


def test_a_tick_in_a_thousand_may_be_late_and_no_more() -> None:
    quick, late = (1e-5,) * 999, (1e-3,)
    assert self_test.latency_line(histogram(*quick, *late), 0.002).passed
    missed = self_test.latency_line(histogram(*quick, *late * 2), 0.002)
    assert not missed.passed and "PREEMPT_RT" in missed.remedy
    assert "1000 us late at worst" in missed.found


ISOLATED = "sys/devices/system/cpu/isolated"


CPUS = {"sys/devices/system/cpu/online": "0-7"}


def own_core(root: Path, permitted: Callable[[Sequence[int]], list[int]] = list) -> Line:
    (one,) = host_findings.own_core(Host(root, permitted))
    return one


def test_a_core_of_its_own_is_wanted(tmp_path: Path) -> None:
    found = own_core(computer(tmp_path, {**CPUS, ISOLATED: ""}))
    assert not found.passed and "isolcpus" in found.advice
    root = computer(tmp_path, {ISOLATED: "2-3,7"})
    assert own_core(root, lambda cpus: list(cpus[1:])).passed
    found = own_core(root, lambda _: [])
    assert not found.passed and "AllowedCPUs" in found.advice


@pytest.mark.parametrize(("where", "passed"), [("3", True), ("0-1", False), ("1,3", False)])
def test_of_a_running_tick_it_counts_where_it_runs(where: str, passed: bool, tmp_path: Path) -> None:
    root = computers.with_tick(computer(tmp_path, {**CPUS, ISOLATED: "3"}), where, 80, 1)
    assert own_core(root).passed is passed


def test_looking_for_a_permitted_core_leaves_this_process_where_it_was() -> None:
    before = os.sched_getaffinity(0)
    assert permitted_of([min(before), 10**6]) == [min(before)]
    assert os.sched_getaffinity(0) == before


def sleep_states(root: Path) -> Line:
    (one,) = host_findings.sleep_states(Host(root))
    return one


@pytest.mark.parametrize("held", [True, False])
def test_a_running_tick_is_asked_for_what_it_holds_against_deep_sleep(tmp_path: Path, held: bool) -> None:
    """Root may always open the device; that says nothing of the tick."""
    one = sleep_states(computers.with_tick(tmp_path, "3", 80, 1, awake=held))
    assert one.passed is held and ("restart" in one.remedy) is not held


@pytest.mark.parametrize(("mode", "passed"), [(0o660, True), (0o600, False)])
def test_before_it_runs_the_device_has_to_be_the_groups(
    mode: int, passed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = computer(tmp_path, {"dev/cpu_dma_latency": ""})
    (root / "dev/cpu_dma_latency").chmod(mode)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    line = sleep_states(root)
    assert line.passed is passed and ("systemd-tmpfiles" in line.remedy) is not passed


@pytest.mark.parametrize(("skips", "passed"), [(9, True), (11, False)])
def test_a_running_tick_tells_its_own_lateness(
    skips: int, passed: bool, tmp_path: Path, runtime: Path
) -> None:
    """To measure on the core that it has for itself would find the tick, and elsewhere something else."""
    tick = {"number": 10_000, "skips": skips, "late_max_ms": 0.25, "period_ms": 2.0}
    with answering(tmp_path, runtime, tick=tick):
        asked = self_test.running_tick(tmp_path)
    assert asked == tick
    line = self_test.running_latency_line(asked)
    assert line.passed is passed and "250 us late at worst" in line.found


@pytest.mark.parametrize(("kinds", "passed"), [([], True), (["performance"], True), (["powersave"], False)])
def test_the_governor_is_looked_at_where_there_is_one(tmp_path: Path, kinds: list[str], passed: bool) -> None:
    files = {f"sys/devices/system/cpu/cpu{n}/cpufreq/scaling_governor": kind for n, kind in enumerate(kinds)}
    (one,) = host_findings.governor(Host(computer(tmp_path, {**CPUS, **files})))
    assert one.passed is passed


def test_a_running_tick_is_found_by_its_name_and_its_memory_looked_at(tmp_path: Path) -> None:
    root = computer(tmp_path, {"proc/7/comm": "bash", "proc/99/comm": TICK_NAME})
    computer(root, {"proc/99/status": "Name:\tx\nVmLck:\t  2048 kB"})
    assert Host(root).tick == 99
    line = self_test.memory(Host(root))
    assert line.passed and "2048 kB" in line.found
    computer(root, {"proc/99/status": "VmLck:\t       0 kB"})
    assert not self_test.memory(Host(root)).passed


@pytest.mark.parametrize(("priority", "passed"), [(80, True), (0, False)])
def test_a_running_tick_is_asked_for_its_priority(priority: int, passed: bool, tmp_path: Path) -> None:
    line = self_test.priority(Host(computers.with_tick(tmp_path, "3", priority, 1)))
    assert line.passed is passed and str(priority) in line.found


@pytest.mark.parametrize(("above", "passed"), [(81, True), (80, False), (0, False)])
def test_a_running_pump_is_to_go_before_its_tick(above: int, passed: bool, tmp_path: Path) -> None:
    root = computers.with_tick(tmp_path, "3", 80, 1)
    columns = ["0"] * 50
    columns[37], columns[38] = str(above), "1" if above else "0"
    computer(root, {"proc/98/comm": PUMP_NAME, "proc/98/stat": f"98 ({PUMP_NAME}) {' '.join(columns)}"})
    line = self_test.priority(Host(root))
    assert line.passed is passed and f"80, its pump {above}" in line.found


def test_page_faults_of_a_running_tick_are_told(tmp_path: Path) -> None:
    assert Host(computers.with_tick(tmp_path, "3", 80, 1)).tick_faults() == (4096, 12)


def test_only_a_clock_that_is_read_quickly_passes(tmp_path: Path) -> None:
    folder = "sys/devices/system/clocksource/clocksource0"
    files = {f"{folder}/current_clocksource": "hpet", f"{folder}/available_clocksource": "tsc hpet"}
    (one,) = host_findings.clock_source(Host(computer(tmp_path, files)))
    assert not one.passed and "tsc hpet" in one.remedy


def link(**about: Any) -> dict[str, Any]:
    data = {"state": "ERROR-ACTIVE", "berr_counter": {"tx": 0, "rx": 0}, "bittiming": {"bitrate": 1_000_000}}
    return {"flags": ["NOARP", "UP"], "txqlen": 128, "linkinfo": {"info_data": data | about}}


FAILING = [
    (link() | {"flags": ["NOARP"]}, "x up"),
    (link() | {"txqlen": 10}, "x queue"),
    (link(bittiming={"bitrate": 500_000}), "x bit rate"),
    (link(state="ERROR-PASSIVE"), "x errors"),
    (link(berr_counter={"tx": 96, "rx": 0}), "x errors"),
    ({}, "x up"),
]


def test_a_healthy_interface_passes_in_all() -> None:
    assert all(line.passed for line in self_test.can(BUS, link()))


@pytest.mark.parametrize(("told", "name"), FAILING)
def test_what_is_wrong_with_an_interface_is_one_line_with_its_remedy(told: dict[str, Any], name: str) -> None:
    failed = [line for line in self_test.can(BUS, told) if not line.passed]
    assert [line.name for line in failed] == [name]
    assert failed[0].remedy


def test_a_folder_that_is_not_there_yet_is_judged_by_the_disk_it_will_be_on(tmp_path: Path) -> None:
    assert self_test.disk(tmp_path / "a" / "b").found.endswith("b")


def test_every_line_says_what_it_found_and_a_failed_one_what_to_do(tmp_path: Path) -> None:
    done = CliRunner().invoke(
        service.app,
        ["self-test", "--machine", "trunnion", "--seconds", "0.05", "--state", str(tmp_path), "--json"],
    )
    told = json.loads(done.stdout)
    assert done.exit_code == (0 if told["ok"] else 1)
    assert len(told["lines"]) >= 9
    for line in told["lines"]:
        assert line["name"] and line["found"]
        assert bool(line["remedy"]) is not line["passed"]
