"""`directrix drives stop`: told to every bus that can be reached, and honest about the others."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from support.drives.stepped_drives import Bench
from support.machines.stepped_runs import shipped
from typer.testing import CliRunner, Result

from controller.cli import drives, stop_drives
from controller.machine import machine_file
from controller.machine.model import Bus, Machine
from drives import commission, pdo
from drives.ports.port import BusError


def stopped(monkeypatch: pytest.MonkeyPatch, machine: Machine) -> Result:
    monkeypatch.setattr(machine_file, "load", lambda _: machine)
    return CliRunner().invoke(drives.app, ["stop", "--json"])


def on(interface: str, *names: str) -> Machine:
    buses = tuple(Bus(name, interface, name, 1_000_000) for name in names)
    axes = [replace(axis, bus=names[i % len(names)]) for i, axis in enumerate(shipped().axes)]
    return replace(shipped(), buses=buses, axes=tuple(axes))


def test_every_drive_of_the_machine_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench("XYZAC")
    bench.enable()
    monkeypatch.setattr(stop_drives.buses, "open", lambda *_: _Kept(bench))
    monkeypatch.setattr(commission, "wall_pump", lambda _: commission.stepped_pump(bench.rig))
    done = stopped(monkeypatch, on("socketcan", "can0"))
    assert json.loads(done.stdout) == {"ok": True, "told": ["can0"], "silent": []}
    bench.rig.advance(bench.rig.now_s + 1.0)
    assert all(drive.nmt == pdo.NMT_STOPPED for drive in bench.rig.drives.values())


class _Kept:
    """The bench's port; it stays open."""

    def __init__(self, bench: Bench) -> None:
        self.send, self.receive_into = bench.service.send, bench.service.receive_into

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        """Not ours."""


def test_a_bus_that_cannot_be_opened_keeps_no_other_from_being_told(monkeypatch: pytest.MonkeyPatch) -> None:
    told = []

    def open_one(settings: object, _: object) -> _Kept:
        told.append(settings.name)  # type: ignore[attr-defined]
        raise BusError(f"bus {told[-1]}: it is down")

    monkeypatch.setattr(stop_drives.buses, "open", open_one)
    done = stopped(monkeypatch, on("socketcan", "can0", "can1"))
    assert done.exit_code == 1
    assert told == ["can0", "can1"]
    assert "can0: it is down" in done.stdout and "can1: it is down" in done.stdout


def test_simulated_drives_end_with_their_hub_and_need_no_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    done = stopped(monkeypatch, shipped())
    assert json.loads(done.stdout) == {"ok": True, "told": [], "silent": []}
