"""Who holds the panel does not hold the machine: what he plants in the state folder changes nothing beyond.

Links, hard links, pipes, folders and files of a stranger take the place of everything that service and root's
verbs read and write there, and each of these is then done as it is after a start. Run by root, who could
change all of it; as anybody else the cases with a second user are skipped.
"""

from __future__ import annotations

import ast
import contextlib
import json
import os
import shutil
import sqlite3
import struct
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from support.fakes import cutting_service
from support.fakes.fake_engine import FakeEngine, served
from support.machines.stepped_runs import shipped
from support.machines.stored_tools import StoredTools
from support.suite.other_user import GROUP, PANEL, SERVICE, ends_well, needs_root
from typer.testing import CliRunner

from controller import atomic_file, own_database, own_files
from controller.__main__ import app as main
from controller.api import backup
from controller.api.store import Store
from controller.api.uploads import UploadLimits
from controller.cli import backup as backup_verbs
from controller.cli import dnc, panel_users
from controller.ipc import control_socket
from controller.ipc.handoff import ROW
from controller.machine import arrangement, setup_data
from controller.machine import machine_file as config
from controller.messages import message
from controller.plan.report import stored
from controller.runtime import recording
from controller.service import journal, room, runs
from controller.service.alarms import Alarms
from controller.service.folders import Folders
from controller.service.probed import Probed
from controller.service.service import Service
from controller.service.thread_guard import InThread, ThreadGuard
from controller.service.usage import Usage
from controller.state.modes import Fault
from controller.state.setpoints import SETPOINTS
from controller.store import service_store, set_up_store, tool_store
from controller.store.service_store import ServiceStore

Do = Callable[[Path, Path], object]


def upload(store: Store, name: str, text: bytes) -> None:
    with store.uploads.begin(name) as upload:
        upload.write(text)
        upload.commit()


@pytest.fixture(scope="module")
def used() -> Iterator[Path]:
    """A state folder in use, and an archive of it."""
    with tempfile.TemporaryDirectory() as made:
        service = served(Path(made))
        cutting_service.cut(service)
        service.watch.look()
        state = service.state
        service.close()
        with contextlib.closing(Store(state, UploadLimits(free_bytes=0))) as store:
            upload(store, "a.ngc", b"G0 X1\nM2\n")
            store.users.set("anna", "hash", "set_up")
            backup.save(store, config.load("trunnion"), state.parent / "saved.zip")
        for do in DONE.values():
            do(state, state.parent)
        yield Path(made)


@pytest.fixture
def tmp_path(used: Path) -> Iterator[Path]:
    """A copy of it that every user comes to, as to /var/lib."""
    with tempfile.TemporaryDirectory() as made:
        place = shutil.copytree(used, Path(made).resolve(), symlinks=True, dirs_exist_ok=True)
        place.chmod(0o755)  # which the copy has given it, too
        (place / "etc").mkdir()
        (place / "etc" / "new.toml").write_text(config.alone(config.load("trunnion")))
        (place / "outside").mkdir()
        yield place


@pytest.fixture
def state(tmp_path: Path) -> Path:
    """Each has his own folder, as it is installed. What is planted in the service's stands for a version
    before, whose folder both could write.
    """
    state = tmp_path / "state"
    for path in (state, *state.rglob("*")):
        if os.geteuid() == 0:
            os.chown(path, PANEL if path.is_relative_to(state / "panel") else SERVICE, GROUP)
        path.chmod(0o750 if path.is_dir() else 0o640)
    return state


# -- what is done


def _verb(app: object, *words: str) -> Do:
    """A verb as root gives it; STATE and OUT are folders."""

    def do(state: Path, outside: Path) -> None:
        given = [word.replace("STATE", str(state)).replace("OUT", str(outside.parent)) for word in words]
        CliRunner().invoke(app, given, input="correct horse\n", catch_exceptions=False)  # type: ignore[arg-type]

    return do


def _starts(state: Path, _: Path) -> None:
    """Service and plan, as far as they are the same without processes."""
    service = Service(shipped(), Folders.within(state), FakeEngine(shipped()))  # type: ignore[arg-type]
    service.close()


def _runs(state: Path, _: Path) -> None:
    record = runs.RunRecord(state, shipped(), {"name": "a.ngc", "sha256": "0" * 64})
    if record._file is not None:
        record._file.begin({"program.ngc": b"M2\n", "machine.toml": b"x"})
        record._file.rows(SETPOINTS, 0, np.zeros((2, 5), dtype=np.int32))
    record.end("stopped")
    room.Room(Folders.within(state), shipped()).make()


def _faults(state: Path, _: Path) -> None:
    facts = recording.Facts(Fault.EMERGENCY_STOP, "", 1, 0, ())
    recording.save(state / "recordings", shipped(), facts, np.zeros((2, len(ROW))), {})


def _tools(state: Path, _: Path) -> None:
    with contextlib.closing(StoredTools(state)) as tools:
        tools.confirm({1: 1, 2: 0})


def _usage(state: Path, _: Path) -> None:
    usage = Usage(ServiceStore(state), shipped())
    usage.set_item("oil", "motion", 10.0)
    usage.save(at_once=True)


def _probed(state: Path, _: Path) -> None:
    probed = Probed(ServiceStore(state))
    probed.add("a.ngc", [{"cycle": "bore", "values": {"x_mm": 1.0}}])
    probed.save()
    probed.save_touches()


def _thread(state: Path, _: Path) -> None:
    guard = ThreadGuard(ServiceStore(state))
    guard.found = InThread(3.0, 1.0, 5, "a.ngc")
    guard.save()


def _fitted(state: Path, _: Path) -> None:
    service_store.put(state, set_up_store.FITTING, {"parameters": {"500": 1.0}})
    service_store.put(state, set_up_store.SPINDLE, 3)
    setup_data.note(state, shipped())


def _journal(state: Path, _: Path) -> None:
    job = journal.Job.of("a.ngc", b"M2", shipped(), (0.0,) * 5)
    spot = journal.Spot(1, 0.0, 0, 0.0)
    journal.write(journal.Entry(job, spot, True, 1, "HOLD", "NONE", 31, 0.0), ServiceStore(state))


def _checked(state: Path, _: Path) -> None:
    stored.save(stored.Stored(1, 1.0, 1, {}), "0" * 64, state / "checks")
    stored.load("0" * 64, state / "checks")


def _stores(state: Path, _: Path) -> None:
    with contextlib.closing(Store(state, UploadLimits(free_bytes=0))) as store:
        upload(store, "b.ngc", b"G0 X2\nM2\n")
        store.programs.delete("b.ngc")
        store.sweep()


MACHINE = ("--machine", "OUT/etc/machine.toml")
BASE = ("--state", "STATE", "--runtime", "OUT/run")
DONE: dict[str, Do] = {
    "run": _runs,
    "fault": _faults,
    "tools": _tools,
    "usage": _usage,
    "probed": _probed,
    "thread": _thread,
    "fitted": _fitted,
    "journal": _journal,
    "check": _checked,
    "alarm": lambda state, _: Alarms(ServiceStore(state)).add("TEST", message("stopped")),
    "commissioned": lambda state, _: arrangement.save(state / "arranged", shipped(), []),
    "noted": lambda state, _: control_socket.note_runtime(state, Path("/run/directrix")),
}
VERBS: dict[str, Do] = {
    "start": _starts,
    "upload": _stores,
    "users add": _verb(panel_users.users, "add", "bob", "--state", "STATE"),
    "save": _verb(backup_verbs.app, "save", "OUT/saved2.zip", "--state", "STATE"),
    "restore": _verb(backup_verbs.app, "restore", "OUT/saved.zip", *MACHINE, *BASE),
    "update": _verb(backup_verbs.app, "update", "OUT/etc/new.toml", *MACHINE, *BASE),
    "rollback": _verb(backup_verbs.app, "rollback", *BASE),
    "support": _verb(main, "support", "OUT/case.zip", "--state", "STATE"),
    "check": _verb(main, "state", "check", "--state", "STATE"),
    "requests": _verb(main, "state", "requests", "--state", "STATE"),
    "send": _verb(dnc.app, "send", "a.ngc", "--port", "/dev/null", "--state", "STATE"),
}

# -- what is planted


def _link(victim: Path, at: Path) -> None:
    at.symlink_to(victim)


def _dangling(victim: Path, at: Path) -> None:
    at.symlink_to(victim.with_name("not there"))


def _second_name(victim: Path, at: Path) -> None:
    if victim.is_dir():
        at.symlink_to(victim)
    else:
        os.link(victim, at)


def _pipe(victim: Path, at: Path) -> None:
    os.mkfifo(at, 0o660)


def _folder(victim: Path, at: Path) -> None:
    at.mkdir()
    (at / "inside").symlink_to(victim)


def _strangers(victim: Path, at: Path) -> None:
    if victim.is_dir():
        at.mkdir()
        for one in victim.iterdir():
            (at / one.name).symlink_to(one)
    else:
        shutil.copyfile(victim, at)


PLANTS = {
    "link": _link,
    "dangling link": _dangling,
    "hard link": _second_name,
    "pipe": _pipe,
    "folder": _folder,
    "stranger's": _strangers,
}


def replaced(path: Path, outside: Path, plant: Callable[[Path, Path], None]) -> None:
    """What was there lies outside now, as a victim of root's; the panel has put something in its place."""
    victim = outside / f"{path.parent.name} {path.name}"
    if path.is_dir() and not path.is_symlink():
        shutil.copytree(path, victim, symlinks=True)
        shutil.rmtree(path)
    else:
        shutil.copyfile(path, victim)
        path.unlink()
    for one in (victim, *victim.rglob("*")):
        if os.geteuid() == 0:
            os.chown(one, 0, 0)
        one.chmod(0o755 if one.is_dir() else 0o644)
    plant(victim, path)
    if os.geteuid() == 0 and not os.path.samefile(path.parent, outside):
        with contextlib.suppress(FileNotFoundError):
            if path.is_symlink() or path.stat().st_nlink == 1 or path.is_dir():
                os.lchown(path, PANEL, GROUP)


def everything(folder: Path) -> dict[str, tuple[object, ...]]:
    """Every file with its owner, mode and content."""
    found = {}
    for path in sorted(folder.rglob("*")):
        facts = path.lstat()
        content = path.read_bytes() if path.is_file() and not path.is_symlink() else b""
        found[str(path)] = (facts.st_mode, facts.st_uid, facts.st_gid, content)
    return found


@contextlib.contextmanager
def unharmed(outside: Path) -> Iterator[None]:
    before = everything(outside)
    yield
    now = everything(outside)
    assert {path: now.get(path) for path in before} == before
    assert set(now) == set(before)


def _refused(do: Do, state: Path, outside: Path) -> None:
    """Done, or refused by what has a sentence."""
    from controller.api.store import StoreError
    from controller.machine.toml_table import ConfigError

    with contextlib.suppress(OSError, StoreError, ConfigError, ValueError, sqlite3.Error):
        do(state, outside)


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the victims are. The oldest of all that is kept are looked for, too."""
    for module, most in ((recording, "KEPT"), (room, "MOST"), (stored, "KEPT")):
        monkeypatch.setattr(module, most, 0)
    return tmp_path / "outside"


@pytest.mark.parametrize("plant", PLANTS)
def test_nothing_that_takes_the_place_of_a_file_of_the_service_is_written_through_or_waited_for(
    state: Path, outside: Path, plant: str
) -> None:
    for path in [one for folder in (state, state / "panel") for one in folder.iterdir() if one.is_file()]:
        replaced(path, outside, PLANTS[plant])
        replaced_new = path.with_name(f"{path.name}.new")
        replaced_new.write_bytes(b"")
        replaced(replaced_new, outside, PLANTS[plant])
    with unharmed(outside):
        for do in (*DONE.values(), *VERBS.values()):
            _refused(do, state, outside)


@pytest.mark.parametrize("plant", ["link", "pipe", "stranger's"])
def test_nothing_that_takes_the_place_of_a_folder_of_the_service_is_written_or_emptied(
    state: Path, outside: Path, plant: str
) -> None:
    of_panel = [one for one in (state / "panel").iterdir() if one.is_dir()]
    for path in [*of_panel, *(one for one in state.iterdir() if one.is_dir() and one.name != "panel")]:
        replaced(path, outside, PLANTS[plant])
    with unharmed(outside):
        for do in (*DONE.values(), *VERBS.values()):
            _refused(do, state, outside)


@pytest.mark.parametrize("plant", ["link", "hard link", "pipe", "folder"])
@pytest.mark.parametrize(
    "name",
    [
        *(f"panel/{name}" for name in ("store.sqlite", "store.sqlite-wal", "store.sqlite-shm", "log_in")),
        *("service.sqlite", "service.sqlite-wal", "service.sqlite.before", "tools.db"),
    ],
)
def test_nothing_beside_or_in_the_place_of_a_database_is_written_through(
    state: Path, outside: Path, plant: str, name: str
) -> None:
    if not (state / name).exists():
        (state / name).write_bytes(b"\0" * 32)
    replaced(state / name, outside, PLANTS[plant])
    with unharmed(outside):
        for do in (VERBS["users add"], VERBS["upload"], DONE["tools"], VERBS["save"]):
            _refused(do, state, outside)


@needs_root
@pytest.mark.parametrize("plant", ["link", "hard link"])
def test_no_archive_that_root_makes_has_what_nobody_but_root_may_read(
    state: Path, outside: Path, plant: str
) -> None:
    """By links and second names in the panel's folder, and by rows of its store that lead out of it."""
    victim, own = outside / "shadow", state / "panel"
    victim.write_text("root:$6$salt")
    victim.chmod(0o600)
    with contextlib.closing(Store(state, UploadLimits(free_bytes=0))) as store:
        for name in ("b.ngc", "c.ngc"):
            upload(store, name, f"({name})".encode())
        found = {program.name: program.sha256 for program in store.programs.list()}
        with store.database.write() as sql:
            sql.execute("UPDATE programs SET sha256 = '../../outside/shadow' WHERE name = 'c.ngc'")
    planted = own / "programs" / f"{found['b.ngc']}.ngc"
    planted.unlink()
    shutil.copyfile(victim, outside / "shadow.ngc")
    (own / "crashes").mkdir()
    for place in (planted, own / "crashes" / "1.txt"):
        PLANTS[plant](victim, place)
    for path in (own, *own.rglob("*")):
        if not path.is_symlink() and path.stat().st_nlink < 2 + path.is_dir():
            os.chown(path, PANEL, GROUP)
    for verb, archive in (("support", "case.zip"), ("save", "saved2.zip")):
        _refused(VERBS[verb], state, outside)
        if (outside.parent / archive).exists():
            with zipfile.ZipFile(outside.parent / archive) as parts:
                assert not [name for name in parts.namelist() if b"$6$" in parts.read(name)], verb
    assert (outside.parent / "case.zip").exists()


@needs_root
def test_the_panel_reads_a_file_of_the_service_and_leaves_nothing_beside_it(state: Path) -> None:
    """While the service has it open, was killed, or has closed it, and also where -shm is gone."""
    file, places = state / service_store.FILE, {1: 1, 2: 0}

    def write(until: int | None = None) -> None:
        with contextlib.closing(StoredTools(state)) as tools:
            tools.confirm(places)
            if until is not None:
                os.read(until, 1)

    def write_and_die() -> None:
        StoredTools(state).confirm(places)
        os._exit(9)

    def read() -> None:
        assert tool_store.saved_rows(state)["places"] == [list(row) for row in places.items()]

    for end in own_database.BESIDE:
        file.with_name(file.name + end).unlink(missing_ok=True)
    assert ends_well(SERVICE, write)
    assert ends_well(PANEL, read) and ends_well(SERVICE, write)
    told, tell = os.pipe()
    with ThreadPoolExecutor(1) as beside:
        written = beside.submit(ends_well, SERVICE, lambda: write(told))
        while not file.with_name(f"{file.name}-shm").exists():
            time.sleep(0.01)
        assert ends_well(PANEL, read)
        os.write(tell, b"x")
        assert written.result()
    assert not ends_well(SERVICE, write_and_die)
    assert ends_well(PANEL, read)
    file.with_name(f"{file.name}-shm").unlink()
    assert not ends_well(PANEL, read)
    assert {path.stat().st_uid for path in state.glob(f"{file.name}*")} == {SERVICE}
    assert ends_well(SERVICE, write)
    file.with_name(f"{file.name}-wal").touch()
    os.chown(file.with_name(f"{file.name}-wal"), PANEL, GROUP)
    assert ends_well(SERVICE, write), "what a reader of before has left is no reason not to start"


def hot_journal(database: Path, victim: Path) -> bytes:
    """A rollback journal whose super-journal is the victim: SQLite deletes it when it has rolled back."""
    magic, name = bytes.fromhex("d9d505f920a163d7"), str(victim).encode()
    head = magic + struct.pack(">IIIII", 0, 0, database.stat().st_size // 4096, 512, 4096)
    page = struct.pack(">I", 0x40000000 // 4096 + 1)
    return head.ljust(512, b"\0") + page + name + struct.pack(">II", len(name), sum(name)) + magic


@pytest.mark.parametrize(
    ("name", "do"), [("panel/store.sqlite", VERBS["users add"]), ("service.sqlite", DONE["tools"])]
)
def test_no_journal_that_is_planted_beside_a_database_deletes_what_it_names(
    state: Path, outside: Path, name: str, do: Do
) -> None:
    victim, journal_file = outside / "victim", state / f"{name}-journal"
    victim.write_text("x")
    journal_file.write_bytes(hot_journal(state / name, victim))
    with contextlib.closing(sqlite3.connect(shutil.copyfile(state / name, outside / "copy"))) as copy:
        (outside / "copy-journal").write_bytes(hot_journal(outside / "copy", victim))
        copy.execute("SELECT count(*) FROM sqlite_master").fetchone()
    assert not victim.exists(), "SQLite itself would"
    victim.write_text("x")
    do(state, outside)
    assert victim.exists()


@needs_root
def test_what_the_panel_notes_of_a_machine_file_is_in_no_archive_of_root_s(
    state: Path, outside: Path, tmp_path: Path
) -> None:
    planted = json.dumps({"name": "planted", "text": shipped().text.replace("velocity", "velocity", 1)})
    (state / "machine.json").unlink()
    (state / "machine.json").write_text(planted)
    os.chown(state / "machine.json", PANEL, GROUP)
    _refused(VERBS["save"], state, outside)
    assert not (tmp_path / "saved2.zip").exists()
    _starts(state, outside)
    assert (state / "machine.json").stat().st_uid in (0, SERVICE), "a start notes it anew"
    VERBS["save"](state, outside)
    assert backup.check(tmp_path / "saved2.zip").machine.name == shipped().name


@needs_root
def test_what_root_writes_belongs_to_whose_folder_it_is_in_and_nobody_else_may_write_it(
    state: Path, outside: Path
) -> None:
    for do in (*DONE.values(), *VERBS.values()):
        _refused(do, state, outside)
    for path in [one for one in state.rglob("*") if one.is_file()]:
        facts = path.stat()
        assert facts.st_uid == (PANEL if path.is_relative_to(state / "panel") else SERVICE), path
        assert not facts.st_mode & 0o022, path


def test_a_restore_replaces_the_machine_file_and_a_roll_back_puts_it_back_though_links_lie_in_wait(
    state: Path, outside: Path, tmp_path: Path
) -> None:
    """The names that are written beside first are known beforehand."""
    victim, machine_file = outside / "victim", tmp_path / "etc" / "machine.toml"
    victim.write_text("x")
    machine_file.write_text(config.alone(config.load("trunnion")).replace("0.002", "0.004"))
    for name in (
        "machine.json.new",
        "service.sqlite.old",
        "service.sqlite.new",
    ):
        (state / name).unlink(missing_ok=True)
        (state / name).symlink_to(victim)
    with unharmed(outside):
        VERBS["restore"](state, outside)
        assert config.load(machine_file).period_s == 0.002
        _verb(backup_verbs.app, "rollback", *MACHINE, *BASE)(state, outside)
        assert config.load(machine_file).period_s == 0.004


def test_a_folder_that_becomes_a_link_while_it_is_used_is_not_gone_through(outside: Path) -> None:
    state = outside.with_name("fresh")
    (state / "runs" / "one").mkdir(parents=True)
    (outside / "one").mkdir(parents=True)
    (outside / "one" / "kept").write_text("x")
    with own_files.folder(state / "runs", state):
        (state / "runs").rename(state / "gone")
        (state / "runs").symlink_to(outside)
        own_files.remove_tree(state / "runs" / "one", state)
        with pytest.raises(OSError, match="is a link or no folder"):
            atomic_file.write(state / "runs" / "one" / "run.json", "{}", state)
    assert (outside / "one" / "kept").read_text() == "x" and len(list((outside / "one").iterdir())) == 1


def test_a_name_leads_out_of_no_folder(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("x")
    with pytest.raises(OSError, match="leads out"):
        own_files.read_bytes(tmp_path / "state" / "runs" / ".." / ".." / "secret", tmp_path / "state")


# Rooms that work in the state folder, but for what is elsewhere: sockets, devices, what an operator names.
ROOM = Path(own_files.__file__).parent
OF_API = ("backup", "database", "own_folder", "programs", "uploads", "log_in_marker")
IN_STATE = [
    *(file for file in ROOM.glob("service/*.py") if file.stem not in ("pendant", "socket_server")),
    *(ROOM / "machine" / f"{name}.py" for name in ("setup_data", "arrangement")),
    *(ROOM / "store").glob("*.py"),
    *(ROOM / "api" / f"{name}.py" for name in OF_API),
    *(ROOM / name for name in ("runtime/recording.py", "plan/report/stored.py", "ipc/control_socket.py")),
]
WHOLE = ("open", "os.open", "os.replace", "sqlite3.connect")
BY_PATH = {"read_text", "read_bytes", "write_text", "write_bytes", "mkdir", "unlink", "rmtree", "copy2"}


def by_path(file: Path) -> Iterator[str]:
    """Calls that open something by its path."""
    for call in (node for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.Call)):
        words = ast.unparse(call.func)
        ours = words.startswith("own_") or (words == "sqlite3.connect" and "':memory:'" in ast.unparse(call))
        if not ours and (words in WHOLE or words.rpartition(".")[2] in BY_PATH):
            yield f"{file.name}:{call.lineno}: {words}"


def test_who_works_in_the_state_folder_opens_nothing_there_by_its_path() -> None:
    assert not [call for file in IN_STATE for call in by_path(file)]
