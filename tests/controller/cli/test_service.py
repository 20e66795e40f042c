"""`directrix service`: what an installation writes and takes away; the running system is the guest's."""

from __future__ import annotations

import itertools
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import typer
from support.machines.stepped_runs import shipped
from typer.testing import CliRunner

from controller.__main__ import app
from controller.cli import installation, service
from controller.machine.model import Bus

RUNNER = CliRunner()
ON_CAN = replace(shipped(), buses=(Bus("can0", "socketcan", "can3", 500_000),))
LIMITS = {installation.PANEL: 1.2, installation.SERVICE: 1.7, installation.LINES: 1.2}
DEBIANS_LINK = "73-usb-net-by-mac.link"  # matches every interface on USB, and so every adapter


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
        if file.path.suffix == ".service":
            assert "ExecStart=/srv/python -P -m controller " in file.text


def test_each_can_interface_gets_its_files_and_the_service_waits_for_it(tmp_path: Path) -> None:
    installed(tmp_path, "--machine", on_can(tmp_path))
    written = content(tmp_path)
    network = written["etc/systemd/network/70-directrix-can3.network"]
    assert "Name=can3" in network and "BitRate=500000" in network and "can0" not in network
    assert "OriginalName=can3" in written["etc/systemd/network/70-directrix-can3.link"]
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


def test_the_queue_of_an_adapter_on_usb_is_set_before_debians_own_file_is_met() -> None:
    """systemd takes the first file that matches, by name, and no other (systemd.link(5))."""
    (link,) = [file.path.name for file in installation.files(ON_CAN) if file.path.suffix == ".link"]
    assert link < DEBIANS_LINK


def test_what_an_older_version_wrote_under_another_name_goes(tmp_path: Path) -> None:
    folder = tmp_path / "etc/systemd/network"
    folder.mkdir(parents=True)
    for name in ("80-directrix-can3.link", "80-container-ve.network"):
        (folder / name).write_text("")
    installed(tmp_path)
    assert [path.name for path in folder.iterdir()] == ["80-container-ve.network"]


def test_a_serial_line_that_somebody_enabled_outlives_another_installation_and_not_its_end(
    tmp_path: Path,
) -> None:
    installed(tmp_path)
    unit = tmp_path / "etc/systemd/system" / installation.LINES
    line = tmp_path / "etc/systemd/system/directrix.target.wants/directrix-dnc@ttyUSB0.service"
    line.parent.mkdir()
    line.symlink_to(f"/etc/systemd/system/{installation.LINES}")
    installed(tmp_path)
    assert line.is_symlink() and unit.exists()
    assert RUNNER.invoke(service.app, ["uninstall", "--root", str(tmp_path)]).exit_code == 0
    assert not line.parent.exists() and not unit.exists()


def options(words: list[str]) -> set[str]:
    """Of a command."""
    name, *below = words
    command = typer.main.get_command(app).load(name)  # type: ignore[attr-defined]
    for word in below:
        command = command.get_command(None, word)
    return {name for parameter in command.params for name in parameter.opts}


@pytest.mark.parametrize("unit", LIMITS)
def test_a_unit_uses_no_option_that_its_command_does_not_have(unit: str) -> None:
    text = (installation.shipped() / unit).read_text()
    (line,) = [line for line in text.splitlines() if line.startswith("ExecStart=")]
    words = line.split(" controller ")[1].split()
    command = list(itertools.takewhile(lambda word: not word.startswith("-"), words))
    used = set(re.findall(r"--[a-z][a-z-]*", line)) | set(re.findall(r"DIRECTRIX_\w+=(--[a-z-]+)", text))
    assert used and used <= options(command)


HIDDEN_PLACES = [
    ("/home/anna/venv/bin/python", "trunnion", "/home/anna"),
    ("/tmp/venv/bin/python", "trunnion", "/tmp"),  # a service has a /tmp of its own
    ("/opt/python", "/root/machine.toml", "/root"),
]


@pytest.mark.parametrize(("python", "source", "named"), HIDDEN_PLACES)
def test_a_path_that_a_service_cannot_see_is_refused(
    python: str, source: str, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service.sys, "executable", python)
    with pytest.raises(service.Refused, match=f"{named}.*elsewhere"):
        service._seen_by_a_service(source)


def test_a_link_in_a_hidden_folder_is_hidden_wherever_it_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A virtual environment's Python is a link to the system's; the unit gets the link."""
    monkeypatch.setattr(service, "HIDDEN", (str(tmp_path / "home"), str(tmp_path / "root")))
    (tmp_path / "home").mkdir()
    (tmp_path / "root").mkdir()
    (tmp_path / "root/python").write_text("")
    (tmp_path / "opt").symlink_to(tmp_path / "root/python")
    (tmp_path / "home/python").symlink_to(sys.executable)
    for link in ("home/python", "opt"):
        monkeypatch.setattr(service.sys, "executable", str(tmp_path / link))
        with pytest.raises(service.Refused, match="elsewhere"):
            service._seen_by_a_service("trunnion")


def test_a_package_in_a_hidden_folder_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that was installed as editable lies where its checkout lies."""
    monkeypatch.setattr(service.sys, "executable", "/usr/bin/python3")
    monkeypatch.setattr(
        service.machine_file, "__file__", "/home/anna/directrix/controller/machine/machine_file.py"
    )
    with pytest.raises(service.Refused, match=r"/home/anna.*elsewhere"):
        service._seen_by_a_service("trunnion")


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
@pytest.mark.parametrize("unit", LIMITS)
def test_all_that_a_unit_does_not_close_stands_in_the_page_with_a_reason(unit: str) -> None:
    command = [
        "systemd-analyze",
        "security",
        "--offline=true",
        "--json=short",
        str(installation.shipped() / unit),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    left = {
        one["name"]
        for one in json.loads(done.stdout)
        if not one["set"] and float(one["exposure"] or 0.0) > 0.0
    }
    page = (installation.shipped() / "README.md").read_text()
    who = {installation.SERVICE: "controller", installation.PANEL: "panel", installation.LINES: "line"}[unit]
    rows = re.findall(r"^\| `(.+?)` \| ([\w, ]+) \| .+ \|$", page, re.MULTILINE)
    told = {name.replace("\\|", "|") for name, of in rows if of == "all" or who in of.split(", ")}
    assert left <= told, f"no reason for {left - told}"
    assert told <= left, f"closed by now: {told - left}"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_understands_every_word_of_the_units(tmp_path: Path) -> None:
    for file in installation.files(ON_CAN, python="/bin/true"):
        if file.path.suffix in (".service", ".target", ".conf") and "systemd" in file.path.parts:
            path = tmp_path / file.path.relative_to(installation.UNIT_FOLDER)
            path.parent.mkdir(exist_ok=True)
            path.write_text(file.text)
    names = (*installation.UNITS, installation.LINES.replace("@", "@ttyUSB0"))
    command = ["systemd-analyze", "verify", "--man=no", *(str(tmp_path / name) for name in names)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert not [line for line in done.stderr.splitlines() if str(tmp_path) in line], done.stderr
