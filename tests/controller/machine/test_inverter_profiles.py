"""Register maps of inverters: shipped ones, one of a builder's own, and what is wrong with one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.spindle_machine import text

from controller.machine import inverter_profiles, machine_file
from controller.machine.toml_table import ConfigError
from controller.messages import text as text_of
from controller.runtime.startup import SessionError
from controller.service import serial_inverter

SPINDLE = '[spindle]\nmax_rev_min = 12000\n\n[spindle.modbus]\nport = "/dev/ttyUSB0"\nprofile = "{}"\n'
OWN = """[inverter]
source = "its manual, page 7"
watchdog = "F9.03 = 1.0 s"
forward = [{ register = 1, value = 1 }]
reverse = [{ register = 1, value = 2 }]
stop = [{ register = 1, value = 5 }]
reset = [{ register = 1, value = 7 }]
set_point = { register = 2, per_hz = 10 }
actual = { register = 3, per_hz = 10 }
running = { register = 4, mask = 1 }
fault = { register = 4, mask = 2 }
"""


def test_shipped_profiles_have_their_sources_and_a_watchdog() -> None:
    assert len(inverter_profiles.shipped()) >= 2
    for name in inverter_profiles.shipped():
        found = inverter_profiles.load(name)
        assert "manual" in found.source and found.watchdog
        assert found.highest_hz() >= 400.0


def test_a_profile_of_ones_own_travels_with_its_machine(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN)
    machine = machine_file.read(text(SPINDLE.format("own.toml")), "m.toml", tmp_path)
    (tmp_path / "own.toml").unlink()
    spindle = machine_file.read(machine.text, "m.toml").spindle
    assert spindle is not None and spindle.modbus is not None
    assert inverter_profiles.load(spindle.modbus.profile).actual.register == 3


def test_all_that_is_wrong_with_one_is_refused_at_once() -> None:
    wrong = (
        OWN.replace("stop = [{ register = 1, value = 5 }]", "stop = []")
        .replace("{ register = 3, per_hz = 10 }", "{ register = 3 }")
        .replace("running = { register = 4, mask = 1 }", "running = { register = 4, coil = 4 }")
        .replace("reset = [{ register = 1, value = 7 }]", "reset = [{ coil = 1, value = 7 }]")
    )
    with pytest.raises(ConfigError) as refused:
        inverter_profiles.read(wrong, "own.toml")
    assert [(one.line, one.said["values"]["what"]["key"]) for one in refused.value.mistakes] == [
        (6, "file.no_order"),
        (7, "file.coil_value"),
        (9, "file.missing"),
        (10, "file.register_or_coil"),
    ]
    with pytest.raises(ConfigError) as refused:
        inverter_profiles.read(
            OWN.replace("[inverter]", "[inverter]\nfirst = 1").replace("= 4,", "= 0,"), "o"
        )
    assert {one.said["values"]["what"]["key"] for one in refused.value.mistakes} == {"file.below_first"}


def test_a_real_machine_without_the_extra_is_refused_with_the_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(serial_inverter.importlib.util, "find_spec", lambda _: None)
    machine = machine_file.read(text(SPINDLE.format("delta_c2000")), "m.toml")
    serial_inverter.check_packages(machine)
    real = replace(machine, buses=tuple(replace(bus, interface="socketcan") for bus in machine.buses))
    with pytest.raises(SessionError) as refused:
        serial_inverter.check_packages(real)
    for language in ("en", "de"):
        assert "pip install 'directrix[modbus]'" in text_of(refused.value.said, language)
