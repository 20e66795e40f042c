"""What is found of made-up computers, and what is to be written where."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from support.fakes import computers
from typer.testing import CliRunner

from controller import messages
from controller.__main__ import app
from controller.cli import host_findings, host_lines, self_test
from controller.cli.host_lines import Line
from controller.cli.host_view import Host, spans
from controller.machine import machine_file
from controller.verify.console import spoken

Build = Callable[[Path], Path]
ALL: tuple[Build, ...] = (
    *(computers.laptop, computers.industrial, computers.raspberry, computers.virtual, computers.container),
)
RT, CORE, KERNEL = "linux-image-rt-amd64", "isolcpus=managed_irq,domain,", "GRUB_CMDLINE_LINUX"


@pytest.fixture(autouse=True)
def as_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever runs the tests: what root may is no sign, the group's right on the device is."""
    monkeypatch.setattr(os, "geteuid", lambda: 0)


def look(root: Path) -> dict[str, Line]:
    return {one.name: one for one in host_findings.look(Host(root))}


def written(one: Line) -> list[str]:
    return [write.line for write in one.writes]


def verdicts(root: Path) -> dict[str, str]:
    return {name: one.verdict for name, one in look(root).items()}


FOUND = {
    computers.laptop: {
        **dict.fromkeys(("kernel", "own core", "interrupts", "can0 interrupt", "can0 adapter"), "fail"),
        **dict.fromkeys(("governor", "deep sleep", "privileges"), "fail"),
        **dict.fromkeys(("nohz_full", "threads", "throttling", "page faults", "huge pages", "swap"), "hint"),
        **dict.fromkeys(("computer", "clock source", "page scanners"), "pass"),
    },
    computers.industrial: dict.fromkeys(
        (
            *("kernel", "computer", "own core", "nohz_full", "threads", "interrupts", "can0 interrupt"),
            *("can0 adapter", "governor", "deep sleep", "clock source", "privileges", "throttling"),
            *("page faults", "huge pages", "page scanners", "swap"),
        ),
        "pass",
    ),
    computers.raspberry: {
        **dict.fromkeys(("kernel", "own core", "governor", "deep sleep", "privileges"), "fail"),
        **dict.fromkeys(("can0 adapter", "nohz_full", "throttling", "page faults", "swap"), "hint"),
        **dict.fromkeys(("computer", "threads", "interrupts", "can0 interrupt", "clock source"), "pass"),
        **dict.fromkeys(("huge pages", "page scanners"), "pass"),
    },
    computers.virtual: {
        **dict.fromkeys(("kernel", "computer", "own core", "interrupts", "deep sleep", "privileges"), "fail"),
        **dict.fromkeys(("nohz_full", "throttling", "page faults", "page scanners"), "hint"),
        **dict.fromkeys(("threads", "governor", "clock source", "huge pages", "swap"), "pass"),
    },
    computers.container: {
        **dict.fromkeys(("kernel", "deep sleep", "privileges"), "fail"),
        **dict.fromkeys(("own core", "interrupts", "governor", "clock source"), "unseen"),
        **dict.fromkeys(("nohz_full", "threads", "throttling", "page faults", "huge pages"), "unseen"),
        **dict.fromkeys(("page scanners", "swap"), "unseen"),
        "computer": "hint",
    },
}


@pytest.mark.parametrize("build", ALL)
def test_each_kind_of_computer_has_its_findings(build: Build, tmp_path: Path) -> None:
    assert verdicts(build(tmp_path)) == FOUND[build]


@pytest.mark.parametrize("build", ALL)
@pytest.mark.parametrize("language", messages.LANGUAGES)
def test_every_line_says_what_is_good_and_one_that_fails_what_to_do(
    build: Build, language: str, tmp_path: Path
) -> None:
    before = spoken.set(language)
    try:
        for one in look(build(tmp_path)).values():
            rows = list(host_lines.text_rows(one))
            assert one.found and one.good.endswith(".") and len(one.shown) <= 16, one
            assert one.advice or one.verdict in ("pass", "unseen"), one
            assert not one.advice or one.verdict != "pass"
            assert all(len(row) <= host_lines.WIDTH for row in rows), rows
            assert all(f"  {write.line}" in rows for write in one.writes), "a row to be copied is whole"
    finally:
        spoken.reset(before)


def test_a_line_for_the_kernel_names_the_core_that_the_tick_takes_and_its_sibling(tmp_path: Path) -> None:
    found = look(computers.laptop(tmp_path))
    assert written(found["own core"]) == [f'{KERNEL}="${KERNEL} {CORE}3,7"']
    assert written(found["nohz_full"]) == [f'{KERNEL}="${KERNEL} nohz_full=3,7"']
    assert written(found["interrupts"]) == [f'{KERNEL}="${KERNEL} irqaffinity=0-2,4-6"']
    assert found["own core"].writes[0].file == "/etc/default/grub.d/directrix.cfg"
    assert RT in found["kernel"].remedy


def test_a_raspberry_pi_has_one_line_for_the_kernel_and_its_own_image(tmp_path: Path) -> None:
    found = look(computers.raspberry(tmp_path))
    (write,) = found["own core"].writes
    assert (write.file, write.line) == ("/boot/firmware/cmdline.txt", f"{CORE}3")
    assert "linux-image-rt-arm64" in found["kernel"].remedy
    assert "mcp251x" in found["can0 adapter"].found and "SPI" in found["can0 adapter"].found


def test_a_tuned_computer_is_fit_and_each_thing_that_is_taken_back_is_found(tmp_path: Path) -> None:
    root = computers.industrial(tmp_path)
    back = {
        "proc/sys/vm/compact_unevictable_allowed": ("1", "page faults", "hint"),
        "proc/sys/kernel/sched_rt_runtime_us": ("950000", "throttling", "hint"),
        "sys/kernel/mm/transparent_hugepage/enabled": ("[always] madvise never", "huge pages", "hint"),
        "sys/kernel/mm/ksm/run": ("1", "page scanners", "hint"),
        "proc/swaps": ("Filename Type Size Used\n/dev/zram0 partition 1 0 100", "swap", "hint"),
        f"{computers.CPU}/nohz_full": ("2", "nohz_full", "hint"),
        f"{computers.CPU}/cpu3/topology/thread_siblings_list": ("1,3", "threads", "hint"),
        f"{computers.CPU}/cpu2/cpufreq/scaling_governor": ("schedutil", "governor", "fail"),
        f"{computers.CLOCK}/current_clocksource": ("hpet", "clock source", "fail"),
        "proc/irq/128/effective_affinity_list": ("3", "can0 interrupt", "fail"),
        "etc/systemd/system/directrix.service": ("[Service]\nLimitRTPRIO=20", "privileges", "fail"),
    }
    for file, (text, name, verdict) in back.items():
        was = (root / file).read_text() if (root / file).exists() else None
        computers.build(root, {file: text})
        assert {one: what for one, what in verdicts(root).items() if what != "pass"} == {name: verdict}, file
        if was is None:
            (root / file).unlink()
        else:
            (root / file).write_text(was)
    assert set(verdicts(root).values()) == {"pass"}


def test_a_drop_in_of_the_unit_has_the_last_word(tmp_path: Path) -> None:
    root = computers.industrial(tmp_path)
    folder = "etc/systemd/system/directrix.service.d"
    computers.build(root, {f"{folder}/low.conf": "[Service]\nLimitMEMLOCK=64K"})
    assert verdicts(root)["privileges"] == "fail" and "64K" in look(root)["privileges"].found


def test_an_interrupt_that_never_came_to_the_tick_core_is_none(tmp_path: Path) -> None:
    """Each core has a queue of a disk's, which calls it only for what it has asked for itself."""
    root = computers.industrial(tmp_path)
    assert "3: none" in look(root)["interrupts"].found
    computers.build(root, computers.interrupts((130, "PCI-MSI 1048577-edge      nvme0q3", (0, 0, 0, 7), "3")))
    assert "130 (nvme0q3)" in look(root)["interrupts"].found


USB = "sys/devices/pci0000:00/0000:00:14.0/usb1/1-2/speed"


@pytest.mark.parametrize(("speed", "verdict"), [("12", "fail"), ("480", "hint"), ("5000", "hint")])
def test_an_adapter_on_usb_gathers_frames_for_as_long_as_its_speed_has_it(
    speed: str, verdict: str, tmp_path: Path
) -> None:
    root = computers.laptop(tmp_path)
    computers.build(root, {USB: speed})
    found = look(root)["can0 adapter"]
    assert found.verdict == verdict and "gs_usb" in found.found and speed in found.found


def test_an_adapter_on_usb_calls_by_the_interrupt_of_its_controller(tmp_path: Path) -> None:
    assert "16 (xhci_hcd)" in look(computers.laptop(tmp_path))["can0 interrupt"].found


def test_a_running_tick_is_judged_by_what_it_has(tmp_path: Path) -> None:
    root = computers.with_tick(computers.industrial(tmp_path), "3", 80, 33_000)
    found = look(root)
    assert {one.verdict for one in found.values()} == {"pass"}
    assert "33000 kB" in found["locked memory"].found and "80" in found["privileges"].found


def test_a_running_tick_without_its_rights_is_found(tmp_path: Path) -> None:
    root = computers.with_tick(computers.industrial(tmp_path), "0-2", 0, 0, awake=False)
    failed = {name for name, verdict in verdicts(root).items() if verdict != "pass"}
    assert failed == {"own core", "privileges", "locked memory", "deep sleep"}


def test_what_is_measured_is_the_core_that_the_tick_would_take(tmp_path: Path) -> None:
    alone, shared = computers.industrial(tmp_path / "a"), computers.laptop(tmp_path / "b")
    assert Host(alone).core_for(real_time=False) == Host(alone).core_for(real_time=True) == 3
    assert Host(shared).core_for(real_time=True) == 7 and Host(shared).core_for(real_time=False) is None
    assert Host(alone, permitted=lambda _: []).core_for(real_time=True) is None


def test_on_the_only_core_there_is_none_for_the_tick(tmp_path: Path) -> None:
    root = computers.build(computers.virtual(tmp_path), {f"{computers.CPU}/online": "0"})
    found = look(root)
    assert found["own core"].verdict == found["interrupts"].verdict == "fail"
    assert found["own core"].remedy and not found["own core"].writes


def test_what_scans_pages_is_ended_each_in_its_own_way(tmp_path: Path) -> None:
    one = look(computers.virtual(tmp_path))["page scanners"]
    assert one.found == "ksmd, kdamond, damon_reclaim, numa_balancing"
    assert written(one) == [
        "w /sys/kernel/mm/ksm/run - - - - 0",
        f'{KERNEL}="${KERNEL} damon_reclaim.enabled=N"',
        "kernel.numa_balancing = 0",
    ]
    assert "kdamond" in one.remedy


def test_an_unseen_line_that_is_needed_is_not_fit(tmp_path: Path) -> None:
    found = look(computers.container(tmp_path))
    assert not found["governor"].is_fit and found["swap"].is_fit


@pytest.mark.parametrize(
    ("numbers", "text"),
    [([], ""), ([3], "3"), ([0, 1, 2], "0-2"), ([0, 2, 3, 7], "0,2-3,7"), ([0, 1], "0-1")],
)
def test_cores_are_written_as_the_kernel_reads_them(numbers: list[int], text: str) -> None:
    assert spans(numbers) == text


OF_BOTH = ("own core", "governor", "deep sleep", "clock source")


def test_the_self_test_has_its_lines_of_the_computer_from_the_same_declaration(tmp_path: Path) -> None:
    root = computers.laptop(tmp_path)
    shared = {name: one for name, one in look(root).items() if name in OF_BOTH}
    lines = self_test.run(machine_file.load("trunnion"), tmp_path, 0.01, root)
    assert {one.name: one for one in lines if one.name in OF_BOTH} == shared and len(shared) == len(OF_BOTH)


# ---- the verb ----------------------------------------------------------------------------


@pytest.mark.parametrize(("build", "code"), [(computers.laptop, 1), (computers.industrial, 0)])
def test_the_exit_code_is_whether_it_is_fit(build: Build, code: int, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["host", "check", "--root", str(build(tmp_path)), "--json"])
    told = json.loads(done.stdout)
    assert done.exit_code == code and told["ok"] is (code == 0)
    assert told["failed"] == sum(
        line["verdict"] in ("fail", "unseen") and line["needed"] for line in told["lines"]
    )
    for line in told["lines"]:
        assert line["name"] and line["found"] and line["good"]
        assert all(write["file"].startswith("/") and write["then"] for write in line["write"])


def test_a_person_reads_all_of_it_in_80_columns(tmp_path: Path) -> None:
    root = computers.laptop(tmp_path)
    for language, fails in (("en", "FAIL"), ("de", "NEIN")):
        done = CliRunner().invoke(app, ["host", "check", "--root", str(root), "--language", language])
        rows = done.stdout.splitlines()
        assert done.exit_code == 1 and max(map(len, rows)) <= 80
        assert f"{fails}  can0 adapter" in done.stdout.replace("Adapter", "adapter")


def test_a_finding_that_helps_and_is_missing_leaves_a_computer_fit(tmp_path: Path) -> None:
    root = computers.industrial(tmp_path)
    computers.build(root, {"proc/sys/kernel/sched_rt_runtime_us": "950000"})
    done = CliRunner().invoke(app, ["host", "check", "--root", str(root), "--json"])
    assert done.exit_code == 0 and json.loads(done.stdout)["hints"] == 1
