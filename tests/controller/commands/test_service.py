"""`directrix service`: what an installation writes and takes away; the running system is the guest's."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from cutting import shipped
from typer.testing import CliRunner

from controller.commands import installation, service
from controller.machine import Bus

RUNNER = CliRunner()
ON_CAN = replace(shipped(), buses=(Bus("can0", "socketcan", "can3", 500_000),))
LIMITS = {installation.PANEL: 2.5, installation.SERVICE: 5.0}


def installed(root: Path, *options: str) -> dict[str, object]:
    done = RUNNER.invoke(service.app, ["install", "--root", str(root), "--json", *options])
    assert done.exit_code == 0, done.output
    return dict(json.loads(done.stdout))


def content(root: Path) -> dict[str, str]:
    paths = [path for path in root.rglob("*") if path.is_symlink() or path.is_file()]
    return {
        str(path.relative_to(root)): str(path.readlink()) if path.is_symlink() else path.read_text()
        for path in paths
    }


def on_can(folder: Path, interface: str = "can3") -> str:
    """A machine file with a CAN interface."""
    text = shipped().text.replace(
        'interface = "virtual"', f'interface = "socketcan"\nchannel = "{interface}"'
    )
    file = folder / "machine.toml"
    file.write_text(
        text.replace("bit_rate = 1_000_000", "bit_rate = 500_000").replace('file = "tools.toml"', "")
    )
    return str(file)


def test_everything_it_says_it_writes_is_there_and_nothing_else(tmp_path: Path) -> None:
    told = installed(tmp_path)["written"]
    assert isinstance(told, list)
    assert sorted(told) == sorted(f"/{name}" for name in content(tmp_path))


def test_the_units_run_the_python_that_installs_them(tmp_path: Path) -> None:
    for file in installation.files(ON_CAN, python="/srv/python"):
        assert installation.SHIPPED_PYTHON not in file.text.replace("in the place of /opt", "")
        if file.path.name in (installation.SERVICE, installation.PANEL):
            assert "ExecStart=/srv/python -P -m controller " in file.text


def test_each_can_interface_gets_its_files_and_the_service_waits_for_it(tmp_path: Path) -> None:
    installed(tmp_path, "--machine", on_can(tmp_path))
    written = content(tmp_path)
    network = written["etc/systemd/network/80-directrix-can3.network"]
    assert "Name=can3" in network and "BitRate=500000" in network and "can0" not in network
    assert "OriginalName=can3" in written["etc/systemd/network/80-directrix-can3.link"]
    drop_in = written["etc/systemd/system/directrix.service.d/can.conf"]
    assert "BindsTo=sys-subsystem-net-devices-can3.device" in drop_in
    wants = "etc/systemd/system/sys-subsystem-net-devices-can3.device.wants/directrix.service"
    assert written[wants] == "/etc/systemd/system/directrix.service"


def test_a_machine_without_can_is_bound_to_no_interface(tmp_path: Path) -> None:
    installed(tmp_path)
    assert not [name for name in content(tmp_path) if "can" in name]


def test_another_machine_leaves_nothing_of_the_one_before(tmp_path: Path) -> None:
    installed(tmp_path, "--machine", on_can(tmp_path, "can3"))
    installed(tmp_path, "--machine", on_can(tmp_path, "can5"))
    assert not [name for name, text in content(tmp_path / "etc").items() if "can3" in name + text]


def test_what_stands_in_the_environment_file_stays(tmp_path: Path) -> None:
    file = tmp_path / "etc/directrix/directrix.env"
    installed(tmp_path, "--simulate")
    assert "DIRECTRIX_SERVE=--simulate\n" in file.read_text()
    file.write_text(file.read_text() + "MY_OWN=1\n")
    installed(tmp_path, "--machine", "head_head", "--panel", "--port 9000")
    text = file.read_text()
    assert "MY_OWN=1" in text and "DIRECTRIX_SERVE=--simulate\n" in text
    assert "DIRECTRIX_MACHINE=head_head\n" in text and 'DIRECTRIX_PANEL="--port 9000"\n' in text
    assert installation.machine_named_in(text) == "head_head"


def test_uninstall_takes_away_all_of_it_but_what_is_the_users(tmp_path: Path) -> None:
    machine = on_can(tmp_path)
    installed(tmp_path, "--machine", machine)
    for _ in range(2):  # the second time there is nothing to do
        assert RUNNER.invoke(service.app, ["uninstall", "--root", str(tmp_path)]).exit_code == 0
    assert set(content(tmp_path)) == {"etc/directrix/directrix.env", "machine.toml"}


def test_a_machine_file_that_is_wrong_leaves_an_installation_as_it_is(tmp_path: Path) -> None:
    installed(tmp_path)
    before = content(tmp_path)
    done = RUNNER.invoke(service.app, ["install", "--root", str(tmp_path), "--machine", "no_such_machine"])
    assert done.exit_code == 1
    assert content(tmp_path) == before


def test_a_path_that_a_service_cannot_see_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service, "_as_root", lambda what: None)
    monkeypatch.setattr(service.Path, "is_dir", lambda path: True)
    monkeypatch.setattr(service.sys, "executable", "/home/anna/venv/bin/python")
    with pytest.raises(service.Refused, match=r"/home/anna.*elsewhere"):
        service._may_install(shipped(), None)


def test_an_interface_is_named_as_systemd_escapes_it() -> None:
    assert installation.device("can-left") == r"sys-subsystem-net-devices-can\x2dleft.device"


SHOWN = """Id=directrix.service
LoadState=loaded
ActiveState=failed
SubState=failed
Result=watchdog
NRestarts=2
StatusText=

Id=directrix-panel.service
LoadState=not-found
ActiveState=inactive
SubState=dead
"""


def test_status_says_how_a_unit_ended_and_what_to_do() -> None:
    failed, absent = service._shown(SHOWN)
    assert "watchdog" in service._sentence(failed) and "restarted 2 times" in service._sentence(failed)
    assert "journalctl -u directrix.service" in service._sentence(failed)
    assert "service install" in service._sentence(absent)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
@pytest.mark.parametrize("unit", LIMITS)
def test_a_unit_exposes_no_more_than_it_may(unit: str) -> None:
    command = ["systemd-analyze", "security", "--offline=true", f"--threshold={10 * LIMITS[unit]:.0f}"]
    done = subprocess.run([*command, str(installation.shipped() / unit)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_understands_every_word_of_the_units(tmp_path: Path) -> None:
    for file in installation.files(ON_CAN, python="/bin/true"):
        if file.path.suffix in (".service", ".target", ".conf") and "systemd" in file.path.parts:
            path = tmp_path / file.path.relative_to(installation.UNIT_FOLDER)
            path.parent.mkdir(exist_ok=True)
            path.write_text(file.text)
    command = [
        "systemd-analyze",
        "verify",
        "--man=no",
        *(str(tmp_path / name) for name in installation.UNITS),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert not [line for line in done.stderr.splitlines() if str(tmp_path) in line], done.stderr
