"""A release is taken whole and as its sum says, or nothing is changed; the version before stays."""

from __future__ import annotations

import hashlib
import json
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from typer.testing import CliRunner

from controller.cli import installation, locked, service, update
from controller.verify.console import Refused

ROOT = Path(__file__).parents[3]
RUNNER = CliRunner()


class Host:
    """What an update does to a computer: files below a folder, and the commands that were given."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.commands, self.fails = folder, list[tuple[str, ...]](), ""
        self.here = folder / "opt" / "directrix"
        (self.here / "bin").mkdir(parents=True)
        (self.here / "bin" / "python").write_text("")
        (folder / "etc").mkdir()
        self.link = folder / "bin" / "directrix"
        self.link.parent.mkdir()
        self.link.symlink_to(self.here / "bin" / "directrix")
        monkeypatch.setattr(sys, "prefix", str(self.here))
        monkeypatch.setattr(update, "ENVIRONMENTS", folder / "etc" / "environments")
        monkeypatch.setattr(update, "LINK", self.link)
        monkeypatch.setattr(update, "as_root", lambda _: None)
        monkeypatch.setattr(update, "run", self.run)

    def run(self, *command: str) -> str:
        self.commands.append(command)
        if "venv" in command:
            (Path(command[-1]) / "bin").mkdir(parents=True)
            (Path(command[-1]) / "bin" / "python").write_text("")
        if self.fails and self.fails in command and self.here not in Path(command[0]).parents:
            raise Refused("no network")
        return ""

    def release(self, version: str, lock: str | None = None, name: str = "") -> Path:
        file = self.folder / (name or f"directrix-{version}-py3-none-any.whl")
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("controller/version.py", version)
            if lock != "":
                archive.writestr("config/systemd/requirements.lock", lock or locked.shipped().read_text())
        sums = hashlib.sha256(file.read_bytes()).hexdigest()
        file.with_name(f"{file.name}.sha256").write_text(f"{sums}  {file.name}\n")
        return file

    def ask(self, *words: str) -> Any:
        return RUNNER.invoke(service.app, list(words))

    def state(self) -> tuple[object, ...]:
        known = self.folder / "etc" / "environments"
        there = sorted(path.name for path in (self.folder / "opt").iterdir())
        return known.read_text() if known.exists() else "", there, self.link.readlink()


def units_of(environment: Path, *more: str) -> tuple[str, ...]:
    """The command that writes them."""
    return (str(environment / "bin" / "python"), "-P", "-m", "controller", "service", "install", *more)


@pytest.fixture
def host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Host:
    return Host(tmp_path, monkeypatch)


def test_an_update_installs_by_the_lock_beside_the_version_that_stays(host: Host) -> None:
    before = {path: path.read_bytes() for path in host.here.rglob("*") if path.is_file()}
    done = host.ask("update", str(host.release("0.2.0")))
    assert done.exit_code == 0, done.output
    new = host.here.with_name("directrix-0.2.0")
    venv, packages, own, units = host.commands
    assert venv[-3:] == ("-m", "venv", str(new))
    assert packages[0] == own[0] == str(new / "bin" / "python")
    assert "--require-hashes" in packages and packages[-1].endswith("requirements.lock")
    assert "--no-deps" in own and "--no-index" in own and own[-1].endswith(".whl")
    assert units == units_of(new)
    assert update.environments() == [host.here, new]
    assert host.link.readlink() == new / "bin" / "directrix"
    assert {path: path.read_bytes() for path in before} == before


def test_a_rollback_goes_back_and_another_forth_and_nothing_is_deleted(host: Host) -> None:
    host.ask("update", str(host.release("0.2.0")))
    new = host.here.with_name("directrix-0.2.0")
    for to, from_ in ((host.here, new), (new, host.here)):
        done = host.ask("rollback")
        assert done.exit_code == 0, done.output
        assert host.commands[-1] == units_of(to, "--unlocked"), "whatever its packages are, it ran"
        assert update.environments() == [from_, to]
        assert host.link.readlink() == to / "bin" / "directrix"
        assert (from_ / "bin" / "python").exists() and (to / "bin" / "python").exists()


def test_without_a_version_before_there_is_nothing_to_go_back_to(host: Host) -> None:
    before = host.state()
    refused = host.ask("rollback")
    assert refused.exit_code == 1 and "No version is known" in " ".join(refused.output.split())
    assert host.state() == before and not host.commands


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        ("bit", "fetch it again"),
        ("cut", "fetch it again"),
        ("no sum", "SHA-256 is not known"),
        ("wrong sum", "fetch it again"),
        ("no lock", "holds no lock"),
        ("empty lock", "holds no lock"),
        ("no zip", "holds no lock"),
        ("name", "is no release"),
    ],
)
def test_a_release_that_is_not_as_its_sum_says_or_not_whole_changes_nothing(
    host: Host, spoil: str, why: str
) -> None:
    locks = {"no lock": "", "empty lock": "# nothing\n"}
    name = "other-1.0-py3-none-any.whl" if spoil == "name" else ""
    file = host.release("0.2.0", locks.get(spoil), name)
    beside = file.with_name(f"{file.name}.sha256")
    data, more = bytearray(file.read_bytes()), []
    if spoil == "bit":
        data[len(data) // 2] ^= 1
    elif spoil == "cut":
        data = data[:-20]
    elif spoil == "no sum":
        beside.unlink()
    elif spoil == "wrong sum":
        more = ["--sha256", "0" * 64]
    elif spoil == "no zip":
        data = bytearray(b"no zip at all")
        beside.write_text(hashlib.sha256(data).hexdigest())
    file.write_bytes(data)
    before = host.state()
    refused = host.ask("update", str(file), *more)
    assert refused.exit_code == 1 and why in " ".join(refused.output.split()), refused.output
    assert host.state() == before and not host.commands


@pytest.mark.parametrize("step", ["venv", "--require-hashes", "--no-index", "service"])
def test_an_update_that_fails_half_way_leaves_the_version_that_runs(host: Host, step: str) -> None:
    before, host.fails = host.state(), step
    assert host.ask("update", str(host.release("0.2.0"))).exit_code == 1
    assert host.state() == before and host.commands
    if step == "service":  # the units may name the new version by then
        assert host.commands[-1] == units_of(host.here, "--unlocked")


def test_a_version_that_is_there_is_not_written_over(host: Host) -> None:
    assert host.ask("update", str(host.release("0.2.0"))).exit_code == 0
    again = host.ask("update", str(host.release("0.2.0")))
    assert again.exit_code == 1 and "is there already" in " ".join(again.output.split())


def test_an_installation_with_other_packages_than_the_lock_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (
        "numpy==0.0.1 \\\n    --hash=sha256:" + "0" * 64 + "\nnowhere==1.0 \\\n    --hash=sha256:" + "0" * 64
    )
    (tmp_path / locked.LOCK).write_text(text)
    monkeypatch.setattr(locked, "shipped", lambda: tmp_path / locked.LOCK)
    monkeypatch.setattr(service, "as_root", lambda _: None)
    refused = RUNNER.invoke(service.app, ["install"])
    said = " ".join(refused.output.split())
    assert refused.exit_code == 1 and "(0.0.1)" in said and "nowhere" in said and "--require-hashes" in said


# -- the lock, and what is made of it


def test_the_lock_has_all_that_the_services_need_with_sums_in_versions_that_they_take() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    packages = locked.locked(locked.shipped().read_text())
    for line in (*project["dependencies"], *extras["panel"], *extras["modbus"]):
        need = Requirement(line)
        found = packages[locked.plain_name(need.name)]
        assert need.specifier.contains(found.version), line
    assert all(one.sums for one in packages.values())
    for one in locked.shipped().read_text().splitlines():
        assert not one.startswith(("-", "http:", "https:", "git")), "no other place than the registry"


def test_the_bill_lists_what_is_installed_and_names_nothing_twice() -> None:
    bill = json.loads(RUNNER.invoke(service.app, ["sbom"]).stdout)
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    refs = [one["bom-ref"] for one in bill["components"]]
    assert len(refs) == len(set(refs))
    own = bill["metadata"]["component"]["bom-ref"]
    links = {one["ref"]: one["dependsOn"] for one in bill["dependencies"]}
    assert {one for needs in links.values() for one in needs} | {own} <= {*refs, own}
    names = {one["name"] for one in bill["components"]}
    assert {"numpy", "fastapi", "python", "preact"} <= names
    numpy = next(one for one in bill["components"] if one["name"] == "numpy")
    assert numpy["licenses"] and numpy["purl"] == f"pkg:pypi/numpy@{numpy['version']}"


def test_the_bill_is_written_to_a_file(tmp_path: Path) -> None:
    assert RUNNER.invoke(service.app, ["sbom", str(tmp_path / "sbom.json")]).exit_code == 0
    assert json.loads((tmp_path / "sbom.json").read_text())["components"]
    assert installation.COMMAND == "directrix"
