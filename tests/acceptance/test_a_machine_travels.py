"""A machine travels as one text: what its file names beside itself goes with it, wherever it is needed.

Its folder is gone by then, as it is out of reach of the panel, of a record and of another computer.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest
from support.machines import edited_records
from support.machines.recording_bench import RecordedBench
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.api import backup
from controller.api.store import Store
from controller.cli import check_worker
from controller.machine import machine_file, setup_data
from controller.machine.model import Machine
from controller.machine.nodes import all_settings
from controller.machine.toml_table import ConfigError
from controller.runtime import events
from controller.state.modes import Mode
from controller.store import set_up_store
from drives.commissioning import sheet
from drives.text_file import TextFile

PROGRAM = "G21 G90 T2 M6\nG0 X5\nG1 X8 F600\nM30\n"
OWN_LINE = "; Überall \x85 'x' \"\"\" '''\\ 50 \xb5m\r\n"  # a sheet is Latin-1, and what a text can hold


def written(folder: Path) -> Path:
    """A machine file with a sheet in a folder below, and a profile with another sheet beside itself."""
    text = (machine_file.SHIPPED / "trunnion.toml").read_text()
    text = text.replace('profile = "simulated"', 'profile = "sheets/ours.toml"', 2)
    text = text.replace('profile = "simulated"', 'profile = "simulated"\neds = "sheets/z.eds"', 1)
    text = text.replace('file = "tools.toml"', 'file = "ours.toml"')
    profile = (machine_file.SHIPPED / "drives" / "simulated.toml").read_text()
    (folder / "sheets").mkdir(parents=True)
    (folder / "sheets" / "ours.toml").write_text(profile.replace("../eds/simulated_drive", "y"))
    shutil.copy(machine_file.SHIPPED / "tools.toml", folder / "ours.toml")
    maker = (machine_file.SHIPPED / "eds" / "simulated_drive.eds").read_bytes()
    for name in ("y.eds", "z.eds"):
        (folder / "sheets" / name).write_bytes(OWN_LINE.encode("latin-1") + maker)
    file = folder / "machine.toml"
    file.write_text(text)
    return file


@pytest.fixture
def moved(tmp_path: Path) -> Machine:
    """Read while all of it was there."""
    made = machine_file.load(written(tmp_path / "origin"))
    shutil.rmtree(tmp_path / "origin")
    return made


def assert_drives_are_known(machine: Machine) -> None:
    x, y, z, *_ = all_settings(machine)
    names = [str(one.eds) for one in (x, y, z)]
    assert names == ["sheets/y.eds", "sheets/y.eds", "sheets/z.eds"]
    for one in (x, z):
        assert isinstance(one.eds, TextFile)
        assert one.eds.text.startswith(OWN_LINE.replace("\r\n", "\n"))
        assert sheet.of(one).has(0x6040)


def test_a_text_has_all_that_its_file_names_and_says_it_again(moved: Machine) -> None:
    assert_drives_are_known(moved)
    again = machine_file.read(moved.text, moved.name)
    assert again == moved and machine_file.read(again.text, moved.name) == moved


def test_what_comes_with_directrix_does_not_travel() -> None:
    assert "[[file]]" not in machine_file.load("trunnion").text


def test_its_uploads_are_checked(moved: Machine, tmp_path: Path) -> None:
    setup_data.note(tmp_path, moved)
    program = tmp_path / "part.ngc"
    program.write_text(PROGRAM)
    job = {"name": "part.ngc", "program": str(program), "lines": 4, "state": str(tmp_path)}
    state, result = check_worker.check(job, lambda _: None)
    assert state == "passed", result
    assert_drives_are_known(set_up_store.machine(tmp_path))


@pytest.fixture
def record(moved: Machine, tmp_path: Path) -> Path:
    bench = RecordedBench(tmp_path, moved)
    bench.started(PROGRAM)
    bench.until(Mode.READY)
    return bench.ended()


def replayed(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(command_line.app, ["replay", *map(str, words), "--json"])
    return done.exit_code, json.loads(done.stdout).get("error", "")


def test_its_run_is_made_again_from_the_record_alone(record: Path) -> None:
    assert replayed(record) == (0, "")


def test_a_record_of_an_older_version_needs_the_files_beside_it_or_the_machine_file(
    record: Path, tmp_path: Path
) -> None:
    """Its text names files that it has not."""
    text, log = record / events.MACHINE, record / events.FILE
    old = machine_file.written(text.read_text())
    sums = [hashlib.sha256(words.encode()).hexdigest() for words in (text.read_text(), old)]
    assert "[[file]]" not in old and "sheets/z.eds" in old
    edited_records.rewrite(log, json.loads(json.dumps(edited_records.lines_of(log)).replace(*sums)))
    text.write_text(old)
    code, said = replayed(record)
    assert code == 1 and "there is no such file in" in said and str(record) in said
    file = written(tmp_path / "again")
    assert replayed(record, "--machine", file) == (0, "")
    shutil.copytree(file.parent / "sheets", record / "sheets")
    assert replayed(record) == (0, "")


def test_a_back_up_is_restored_in_another_folder(moved: Machine, tmp_path: Path) -> None:
    archive = backup.save(Store(tmp_path / "one"), moved, tmp_path / "saved.zip")
    other = Store(tmp_path / "two")
    file = tmp_path / "elsewhere" / "machine.toml"
    file.parent.mkdir()
    backup.restore(other, backup.check(archive), file, None)
    found = machine_file.load(file)
    assert (found.axes, found.tools) == (moved.axes, moved.tools)
    assert_drives_are_known(found)
    assert_drives_are_known(set_up_store.machine(other.folder))


def test_a_back_up_of_an_older_version_opens_and_its_machine_file_says_what_it_lacks(
    moved: Machine, tmp_path: Path
) -> None:
    old = machine_file.read(machine_file.written(moved.text), moved.name)
    archive = backup.save(Store(tmp_path / "one"), old, tmp_path / "saved.zip")
    backup.restore(Store(tmp_path / "two"), backup.check(archive), tmp_path / "m.toml", None)
    with pytest.raises(ConfigError, match=r"m\.toml:\d+: .*sheets/ours\.toml.*there is no such file in"):
        machine_file.load(tmp_path / "m.toml")


def test_a_file_that_nothing_names_is_refused_with_its_line() -> None:
    text = machine_file.load("trunnion").text + '\n[[file]]\nname = "left.eds"\ntext = ""\n'
    with pytest.raises(ConfigError, match=r"m:\d+: .*left\.eds.*no eds and no profile names it"):
        machine_file.read(text, "m")
