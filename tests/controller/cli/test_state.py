"""``directrix state``: check names what is damaged, and nothing else; requests who asked for what."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fakes.fake_engine import served
from support.faults.harm import PARTS, harmed, times
from support.machines import changer_bench
from support.suite.seed import SEED
from typer.testing import CliRunner

from controller import sealed_file
from controller.__main__ import app
from controller.api.store import Store
from controller.cli import recorded_runs, state
from controller.ipc.asker import Asker
from controller.machine import arrangement
from controller.machine.toml_table import ConfigError
from controller.messages import TextError, message
from controller.plan.report import stored
from controller.runtime import events
from controller.runtime.starts import Start
from controller.service import runs
from controller.service.journal import sha256
from controller.service.requests import Requests
from controller.state.setpoints import SETPOINTS
from controller.store import service_store
from controller.store.service_store import ServiceStore
from controller.store.set_up_store import FITTING
from controller.verify import console
from controller.verify.console import Refused
from drives.arranged import Arranged

MACHINE = changer_bench.machine()
NOBODY = 65534
NET = Path(__file__).parents[2] / "data" / "net"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The state folder of a service and a panel that have ended."""
    folder = tmp_path_factory.mktemp("whole")
    service = served(folder, MACHINE)
    state = service.state
    for number in (1.0, 2.0):
        service_store.put(state, FITTING, {"parameters": {"500": number}})
    service.alarms.add("TEST", message("stopped"))
    assert service.changer is not None
    service.changer.store.confirm({1: 1, 2: 0})
    record = runs.RunRecord(state, MACHINE, {"name": "over.ngc", "sha256": "0" * 64})
    start = Start((0.0, 1.0, 2.0), 0.5).to_dict()
    sums = {"program_sha256": sha256(b"M2\n"), "machine_sha256": sha256(b"")}
    begin = {"tick": -1, "request": events.BEGIN, "value": {**start, **sums, "fitted": {}}}
    record.end("stopped")
    (record.folder / events.FILE).write_text(sealed_file.line(begin, 1))
    facts = sealed_file.read(record.folder / runs.RUN)
    (record.folder / runs.RUN).write_text(sealed_file.text({**facts, "events": 1}, runs.RUN))
    (record.folder / events.PROGRAM).write_bytes(b"M2\n")
    arrangement.save(state / arrangement.FOLDER, MACHINE, [Arranged("X", 1)])
    stored.save(stored.Stored(700, 1.4, 3, {}), "a" * 64, state / "checks")
    service.close()
    store = Store(state)
    with store.uploads.begin("a.ngc") as upload:
        upload.write(b"(a)\nM2\n")
        upload.commit()
    store.users.set("anna", "hash", "view")
    store.close()
    return state


@pytest.fixture
def copied(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "state"))


def asked(folder: Path, code: int) -> list[dict[str, Any]]:
    done = CliRunner().invoke(app, ["state", "check", "--state", str(folder), "--json"])
    told = json.loads(done.stdout)
    assert done.exit_code == code and told["ok"] is (code == 0), done.output
    return list(told["files"])


def test_what_is_whole_is_ok_and_nothing_is_changed(copied: Path) -> None:
    kept = {file: file.read_bytes() for file in copied.rglob("*") if file.is_file()}
    found = {one["file"]: one["condition"] for one in asked(copied, 0)}
    wanted = {
        "machine.json",
        "service.sqlite",
        "panel/store.sqlite",
    }
    assert wanted <= found.keys() and set(found.values()) == {"ok"}
    for start in ("runs/", "arranged/", "checks/", "panel/programs/"):
        assert any(name.startswith(start) for name in found), start
    assert {file: file.read_bytes() for file in copied.rglob("*") if file.is_file()} == kept


def test_every_file_that_it_lists_is_damaged_by_a_bit_and_then_alone(copied: Path) -> None:
    for one in asked(copied, 0):
        if ".sqlite" in one["file"] or one["file"].endswith(".db") or one["file"].endswith("log_in"):
            continue
        file = copied / one["file"]
        data = bytearray(sound := file.read_bytes())
        if file.suffix == ".npz":  # which has sums of what it packs alone
            del data[-30:]
        else:
            data[len(data) // 2] ^= 0x40  # no digit that a number could do without
        file.write_bytes(data)
        assert [other["file"] for other in asked(copied, 1) if other["condition"] == "damaged"] == [
            one["file"]
        ]
        file.write_bytes(sound)
    (program,) = copied.glob("runs/*/program.ngc")
    program.write_bytes(b"M3\n")
    (damaged,) = (one for one in asked(copied, 1) if one["condition"] == "damaged")
    assert damaged["file"].endswith("events.jsonl")  # which has its sum
    program.write_bytes(b"M2\n")
    program.with_name("events.jsonl").write_bytes(b"")  # cut short where no line shows it
    (damaged,) = (one for one in asked(copied, 1) if one["condition"] == "damaged")
    assert damaged["file"].endswith("events.jsonl") and "events.jsonl:1" in damaged["why"]


def test_a_file_that_is_gone_beside_the_one_before_it_is_damaged(copied: Path) -> None:
    shutil.move(copied / "service.sqlite", copied / "service.sqlite.before")
    assert "service.sqlite" in {one["file"] for one in asked(copied, 1) if one["condition"] == "damaged"}
    shutil.move(copied / "service.sqlite.before", copied / "service.sqlite")
    assert asked(copied, 0)


def test_a_row_and_what_was_written_ahead_are_looked_at(copied: Path) -> None:
    for name, wanted in {
        "panel/store.sqlite": b"anna",
        "service.sqlite": b"confirmed",
    }.items():
        file = copied / name
        data = file.read_bytes()
        assert wanted in data or (copied / f"{name}-wal").exists(), name
        file.write_bytes(data.replace(wanted, wanted[:-1] + b"x"))
        (damaged,) = (one for one in asked(copied, 1) if one["condition"] == "damaged")
        assert damaged["file"] == name and damaged["why"]
        file.write_bytes(data)


@pytest.mark.parametrize("harm", [lambda data: data[:-1], lambda data: data[:-90] + b"x" + data[-89:]])
def test_what_was_written_ahead_and_is_damaged_is_so_after_a_look_too(
    copied: Path, tmp_path: Path, harm: Any
) -> None:
    with contextlib.closing(ServiceStore(copied)) as killed:
        killed.put("probed", [])
        other = Path(shutil.copytree(copied, tmp_path / "killed"))
    ahead = other / f"{service_store.FILE}-wal"
    ahead.write_bytes(harm(ahead.read_bytes()))
    for _ in range(2):
        assert [one["file"] for one in asked(other, 1) if one["condition"] == "damaged"] == ["service.sqlite"]


def test_older_files_are_said_to_be_older_in_words_too(copied: Path) -> None:
    (copied / "fitting.json").write_text('{"parameters": {"500": 1.0}}')
    check = f"checks/{'b' * 64}.json"
    (copied / check).write_text('{"key": "b", "ticks": 2}')
    assert {one["file"] for one in asked(copied, 0) if one["condition"] == "older"} == {"fitting.json", check}
    (copied / "usage.json").write_text("{")
    done = CliRunner().invoke(app, ["state", "check", "--state", str(copied)])
    assert done.exit_code == 1 and "usage.json: DAMAGED" in done.output
    assert "fitting.json: of an older version" in done.output


@pytest.fixture(scope="module")
def older(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a version without checksums, with an interrupted run."""
    folder = tmp_path_factory.mktemp("older")
    with tarfile.open(NET / "state.tar.xz") as packed:
        packed.extractall(folder, filter="data")
    return folder / "state"


def hurt(source: Path, folder: Path, count: int, part: int = 0) -> int:
    """Damages one file of a folder after the other, and has all looked at; how often that was noticed."""
    rng, noticed = random.Random(f"{SEED}-{source.parent.name[:5]}-{part}"), 0
    shutil.copytree(source, folder)
    for number in range(count):
        file = rng.choice([one for one in sorted(folder.rglob("*")) if one.is_file() and one.stat().st_size])
        file.write_bytes(harmed(sound := file.read_bytes(), rng))
        print(SEED, number, file)
        noticed += any(one.condition == "damaged" and console.in_words(one.why) for one in state.look(folder))
        for run in sorted((folder / "runs").glob("*")):
            with contextlib.suppress(TextError, ConfigError, Refused, OSError):
                recorded_runs.whole(run, None, None)
        file.write_bytes(sound)
    return noticed


def test_whatever_is_damaged_is_a_sentence(whole: Path, older: Path, tmp_path: Path) -> None:
    """Also of a record that is to be made again."""
    assert hurt(whole, tmp_path / "a", 30) > 5 and hurt(older, tmp_path / "b", 30) > 0


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_whatever_of_thousands_is_damaged_is_a_sentence(
    part: int, whole: Path, older: Path, tmp_path: Path
) -> None:
    assert hurt(whole, tmp_path / "a", times(70), part) > times(14)
    assert hurt(older, tmp_path / "b", times(70), part) > times(14)


def test_without_a_state_folder_it_is_refused(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["state", "check", "--state", str(tmp_path / "none")])
    assert done.exit_code == 1 and "--state" in done.output


def test_a_segment_of_a_record_is_named_that_is_damaged_or_gone(copied: Path) -> None:
    (folder,) = (copied / "runs").iterdir()
    for first in (0, 4, 8):
        with (folder / SETPOINTS.name(first)).open("wb") as file:
            SETPOINTS.pack(file, first, np.full((4, 5), first, dtype=np.int32), folder.name)
    assert all(one["condition"] == "ok" for one in asked(copied, 0) if "setpoints" in one["file"])
    (folder / SETPOINTS.name(4)).unlink()
    last = folder / SETPOINTS.name(8)
    last.write_bytes(last.read_bytes()[:-9])
    found = [one for one in asked(copied, 1) if one["condition"] == "damaged"]
    names = [f"runs/{folder.name}/{SETPOINTS.name(first)}" for first in (4, 8)]
    assert [one["file"] for one in found] == names and found[0]["why"] == "it is missing"


def test_a_store_that_is_gone_with_its_copy_is_damaged(copied: Path) -> None:
    for file in copied.glob("service.sqlite*"):
        file.unlink()
    assert [one["file"] for one in asked(copied, 1) if one["condition"] == "damaged"] == ["service.sqlite"]


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root, to become another user")
def test_who_may_only_read_a_store_is_told_what_is_true_of_it(whole: Path) -> None:
    """As another user: nothing of root is left in a child."""
    with tempfile.TemporaryDirectory(dir="/tmp") as made:
        os.chmod(made, 0o755)
        folder = Path(shutil.copytree(whole, Path(made) / "state"))
        killed = ServiceStore(folder)
        killed.put("probed", [])  # what is written ahead stays
        for path in (folder, *folder.rglob("*")):
            path.chmod(0o755 if path.is_dir() else 0o644)
        before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
        assert conditions(folder)["service.sqlite"] == "ok"
        (folder / "service.sqlite").chmod(0o600)
        assert conditions(folder)["service.sqlite"] == "unread"
        assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
        killed.close()


def conditions(folder: Path) -> dict[str, str]:
    """What one finds who is neither root nor the owner."""
    ours, theirs = os.pipe()
    if (child := os.fork()) == 0:
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            found = {one.file: one.condition for one in state.look(folder)}
            os.write(theirs, json.dumps(found).encode())
        finally:  # or the tests after this one would go on in the child, too
            os._exit(0)
    os.close(theirs)
    assert os.waitpid(child, 0)[1] == 0
    with os.fdopen(ours) as found:
        return dict(json.loads(found.read()))


def test_requests_are_listed_newest_first(copied: Path) -> None:
    with contextlib.closing(ServiceStore(copied)) as store:
        noted = Requests(store)
        for user in ("anna", "[red]"):
            with noted.noted("hold", {"press": "a"}, Asker(user, "operate", "10.0.0.7"), "panel") as hear:
                hear({})
        noted.close()
    words = ["state", "requests", "--state", str(copied)]
    told = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    assert [row["user"] for row in told["requests"]] == ["[red]", "anna"]
    assert told["requests"][0]["peer"] == "panel"
    shown = CliRunner().invoke(app, words).stdout
    assert "anna" in shown and "[red]" in shown and "10.0.0.7" in shown
    assert CliRunner().invoke(app, [*words[:-1], str(copied / "none")]).exit_code == 1
