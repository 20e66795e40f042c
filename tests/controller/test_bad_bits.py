"""One bad bit opens nothing, and loses nothing in silence: a state folder with a bit turned over, or cut off.

The service starts on it or refuses with a sentence, never by an internal error; the panel answers nobody who
is not logged in. What was damaged is put aside and reported.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import random
import shutil
import sqlite3
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import pytest
from support import older_state
from support.fakes import cutting_service
from support.fakes.fake_engine import done, engine_of, served
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import QUICK, URL
from support.faults.harm import exchanged, harmed, times, write
from support.machines import changer_bench
from support.machines.stored_tools import StoredTools
from support.suite.seed import SEED

from controller import own_database
from controller.api import backup, http, log_in_marker, own_folder
from controller.api.app_state import Panel
from controller.api.database import StoreError
from controller.api.store import Store
from controller.api.users import Users, new_token
from controller.commands.table import COMMANDS
from controller.ipc import control_socket
from controller.ipc.control_socket import CommandRefused
from controller.machine import setup_data
from controller.machine.toml_table import ConfigError
from controller.messages import message
from controller.plan.planner import Touch
from controller.program.program import Probed
from controller.runtime.startup import SessionError
from controller.service import alarms, journal, runs
from controller.service.command_handlers import CommandHandlers
from controller.service.preconditions import NEEDS
from controller.service.whole_status import Kept
from controller.store import service_store, set_up_store
from controller.store.set_up_store import FITTING, SPINDLE

SENTENCES = (ConfigError, SessionError, OSError, CommandRefused)  # what ``serve`` ends with; others: code 70
TOKEN, SHA256 = new_token()
USER = "anna"
MACHINE = changer_bench.machine()
TOUCHED = Probed(True, (0.0,) * len(MACHINE.axes), (0.0,) * len(MACHINE.axes))
DATABASES = ("panel/store.sqlite", service_store.FILE)
ASKED = ("status", "facts", "alarms", "usage", "probed", "restart", "changer")


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A state folder with all that is ever in it, as a kill of service and panel in a run leaves it."""
    folder = tmp_path_factory.mktemp("used")
    service = served(folder, MACHINE)
    state = service.state
    service.store.put(FITTING, {"offsets": {"G55": {"origin_mm": [1, 2, 3]}}, "parameters": {"500": 12.5}})
    service.store.put(SPINDLE, 2)
    control_socket.note_runtime(state, folder)
    assert service.changer is not None
    service.changer.store.confirm({1: 1, 2: 0})
    cutting_service.cut(service)
    service.watch.look()
    service.alarms.add("TEST", message("stopped"))
    service.usage.set_item("oil", "motion", 10.0)
    service.usage.save(at_once=True)
    service.probed.add("a.ngc", [{"cycle": "bore", "values": {"x_mm": 1.0}}])
    service.probed.save()
    service.probed.touch([Touch(5, TOUCHED, (0.0, 0.0, -1.0), 2, 5.0)], MACHINE)
    service.probed.save_touches()
    found = service.engine.snapshot()
    assert found is not None
    Kept(service).look(found)
    record = runs.RunRecord(state, MACHINE, {"name": "lost.ngc", "sha256": "0" * 64})
    runs._write_facts(record.folder / runs.BEGUN, record._facts())
    runs.RunRecord(state, MACHINE, {"name": "over.ngc", "sha256": "0" * 64}).end("stopped")
    with contextlib.closing(Store(state)) as store:
        store.settings.set("upload_mb", 8, "anna")
    store = Store(state)
    for name in ("a.ngc", "b.ngc"):
        with store.uploads.begin(name) as upload:
            upload.write(f"({name})\nM2\n".encode())
            upload.commit()
    store.users.set(USER, QUICK.hash("correct horse"), "set_up")
    store.verdicts.set("record1", {"gouges": 0}, USER)
    store.queue.add("b.ngc", 3, USER)
    store.users.set("bert", QUICK.hash("battery staple"), "view")
    store.users.add_token(SHA256, "script", "set_up", USER)
    killed = folder / "killed"
    shutil.copytree(state, killed)  # what is written ahead with it, as nobody has closed them
    assert (killed / "panel/store.sqlite-wal").stat().st_size and (
        killed / f"{service_store.FILE}-wal"
    ).stat().st_size
    store.close()
    service.close()
    return killed


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The panel's application; what stands behind it is exchanged."""
    return http.make_app(Panel(Store(tmp_path_factory.mktemp("app")), FakeDoor()))


@pytest.fixture
def folder(used: Path, tmp_path: Path) -> Path:
    shutil.copytree(used, tmp_path / "state")
    return tmp_path


class Found(NamedTuple):
    """What service or panel answers, by what it was asked, and the words that it has for damage."""

    answers: dict[str, Any]
    words: list[Any]


def started(folder: Path) -> Found:
    """The service on the folder, asked for all it tells. Raises ``SENTENCES``."""
    service = served(folder, MACHINE)
    try:
        control_socket.note_runtime(service.state, folder)
        desk = CommandHandlers(service)
        engine_of(service).tell_tool(service.set_up.tool)
        answers: dict[str, Any] = {"fitted": service.set_up.fitted, "tool": service.set_up.tool}
        for verb in ASKED:
            with contextlib.suppress(CommandRefused):
                answers[verb] = done(desk, verb)
        if service.changer is not None:
            answers["log"] = service.changer.store.log()
        service.watch.look()
        found = service.engine.snapshot()
        assert found is not None
        Kept(service).look(found)
        service.usage.save(at_once=True)
        desk.close()
        return Found(answers, [one for one in service.alarms.list() if one["name"] != "TEST"])
    finally:
        service.close()


async def answered(app: Any, state: Path) -> tuple[Panel, list[str], Found]:
    """The panel on the folder: the pages that are open without log-in, and what it answers with. Raises
    StoreError.
    """
    store = Store(state)
    try:
        store.sweep()
        panel = Panel(store, FakeDoor())
        panel.users = Users(store.users, hasher=QUICK)
        app.state.panel = panel
        strangers = [path for path, got in (await pages(app)).items() if got[0] not in (401, 503)]
        got = await pages(app, Authorization=f"Bearer {TOKEN}")
        words: list[Any] = store.losses
        words += [panel.users.lost] if panel.users.lost is not None else []
        facts = {path: text for path, (code, text) in got.items() if code == 200 and path not in VOLATILE}
        return panel, strangers, Found(facts, words)
    finally:
        store.close()


async def pages(app: Any, **headers: str) -> dict[str, tuple[int, str]]:
    """Code and text of each."""
    transport = httpx.ASGITransport(app, client=("127.0.0.1", 50000))
    async with httpx.AsyncClient(transport=transport, base_url=URL, headers=headers) as client:
        answers = [(path, await client.get(path)) for path in PAGES]
    return {path: (answer.status_code, answer.text) for path, answer in answers}


VOLATILE = ("/metrics", "/api/files", "/api/files/local")  # times, room on the disk
PAGES = [
    path
    for path, route in http.routes()
    if "GET" in getattr(route, "methods", ()) and "{" not in path and ("GET", path) not in http.PUBLIC
]


def as_it_was(app: Any, folder: Path, known: tuple[Found, Found] | None = None) -> tuple[Found, Found]:
    """What comes of a damaged folder, from the start of service and panel on: ``known``, or a word.

    A page that is refused has one in its answer.
    """
    state, mute = folder / "state", Found({}, ["a sentence"])
    service = panel = mute
    with contextlib.suppress(*SENTENCES):
        service = started(folder)
    with contextlib.suppress(StoreError):
        _, strangers, panel = asyncio.run(answered(app, state))
        assert not strangers
    with contextlib.suppress(ValueError, OSError, ConfigError):
        set_up_store.machine(state)
    with contextlib.suppress(StoreError, ConfigError, OSError), contextlib.closing(Store(state)) as store:
        backup.save(store, MACHINE, folder / "saved.zip")
    control_socket.runtime_of(state)
    control_socket.last_known(state, "status")
    both = [*service.words, *panel.words]
    for now, before, words in zip((service, panel), known or (), (service.words, both), strict=False):
        others = {key: value for key, value in now.answers.items() if before.answers[key] != value}
        if others and not words:
            raise AssertionError({key: (before.answers[key], value) for key, value in others.items()})
    return service, panel


def damaged(state: Path, rng: random.Random) -> str:
    """Harm one file, or put another of its kind in its place."""
    files = sorted(path for path in state.rglob("*") if path.is_file() and path.stat().st_size)
    files = [one for one in files if one.name != service_store.RESERVE]  # which nobody reads
    if rng.random() < 0.1 and (file := exchanged(files, rng)) is not None:
        return f"{file.relative_to(state)}: another"
    file = rng.choice(files if rng.random() < 0.6 else [state / name for name in DATABASES])
    write(file, harmed(file.read_bytes(), rng))
    return str(file.relative_to(state))


def many(used: Path, tmp_path: Path, app: Any, monkeypatch: pytest.MonkeyPatch, numbers: range) -> None:
    """At one moment, since what ends a run notes the time."""
    folder = tmp_path / "shop"  # its name is in some answers
    shutil.copytree(used, folder / "state")
    now_s = time.time()
    monkeypatch.setattr(time, "time", lambda: now_s)
    known = as_it_was(app, folder)
    for number in numbers:
        rng = random.Random(f"{SEED}-{number}")
        shutil.rmtree(folder)
        shutil.copytree(used, folder / "state")
        if number % 2:  # they were closed; else they were killed
            for name in DATABASES:
                own_database.opened(folder / "state" / name).close()
        what = damaged(folder / "state", rng)
        try:
            as_it_was(app, folder, known)
        except BaseException:
            print(f"DIRECTRIX_TEST_SEED={SEED}: {number}, {what}")
            raise


def test_a_bad_bit_opens_nothing_and_ends_in_a_sentence(
    used: Path, tmp_path: Path, app: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    many(used, tmp_path, app, monkeypatch, range(10))


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_a_thousand_bad_bits_open_nothing_and_end_in_a_sentence(
    used: Path, tmp_path: Path, app: Any, monkeypatch: pytest.MonkeyPatch, part: int
) -> None:
    many(used, tmp_path, app, monkeypatch, range(1000 + part * times(100), 1000 + (part + 1) * times(100)))


def test_without_a_bad_bit_all_is_there(folder: Path, app: Any) -> None:
    service = started(folder)
    _, strangers, panel = asyncio.run(answered(app, folder / "state"))
    assert not strangers and not service.words and not panel.words and len(service.answers) > len(ASKED)
    assert len(panel.answers) > 30
    assert not list((folder / "state").rglob("*.damaged*"))


# -- what is written ahead of the store


def frames(wal: Path) -> int:
    return (wal.stat().st_size - 32) // (4096 + 24)


@pytest.mark.parametrize("name", [f"{name}-wal" for name in DATABASES])
def test_a_bad_bit_in_any_frame_that_is_written_ahead_is_noticed(
    used: Path, tmp_path: Path, name: str
) -> None:
    """In the header, in a frame's sums and in its page; nothing is said of one that is whole."""
    file = name.removesuffix("-wal")
    (tmp_path / file).parent.mkdir(exist_ok=True)
    places = [5, 9, 20, 25, *(32 + i * 4120 + at for i in range(frames(used / name)) for at in (9, 17, 2000))]
    for at in (None, *places):
        for end in ("", "-wal"):
            shutil.copyfile(used / f"{file}{end}", tmp_path / f"{file}{end}")
        (tmp_path / f"{file}-shm").unlink(missing_ok=True)
        if at is not None:
            data = bytearray((tmp_path / name).read_bytes())
            data[at] ^= 4
            (tmp_path / name).write_bytes(data)
        with contextlib.closing(own_database.opened(tmp_path / file)) as sql:
            assert own_database.has_lost(sql, tmp_path / file) is (at is not None), at


@pytest.mark.parametrize("name", DATABASES)
def test_what_is_cut_off_of_what_was_written_ahead_is_noticed(used: Path, tmp_path: Path, name: str) -> None:
    """Wherever that is, by what the killed process left beside it, once; nothing is said of what is whole."""
    file, wal = tmp_path / Path(name).name, (used / f"{name}-wal").read_bytes()
    for length in (None, 0, 20, 32, *(32 + i * 4120 for i in range(1, frames(used / f"{name}-wal"))), -1):
        for end in ("", "-shm"):
            shutil.copyfile(used / f"{name}{end}", f"{file}{end}")
        Path(f"{file}-wal").write_bytes(wal[:length])
        for again in (False, True):
            known = own_database.ahead(file)
            with contextlib.closing(own_database.opened(file)) as sql:
                assert own_database.has_lost(sql, file, known) is (length is not None and not again), length


@pytest.mark.parametrize("name", DATABASES)
def test_a_cut_of_what_is_in_the_database_already_is_noticed(used: Path, tmp_path: Path, name: str) -> None:
    """What is left of it is older than the database, and would count before that."""
    for end in ("", "-wal"):
        shutil.copyfile(used / f"{name}{end}", tmp_path / f"a{end}")
    with contextlib.closing(own_database.opened(tmp_path / "a")) as sql:
        sql.execute("PRAGMA wal_checkpoint(PASSIVE)")
        for end in ("", "-wal", "-shm"):
            shutil.copyfile(tmp_path / f"a{end}", tmp_path / f"b{end}")
    file = tmp_path / "b"
    known = own_database.ahead(file)
    assert known is not None and known[0] == frames(tmp_path / "b-wal")
    os.truncate(tmp_path / "b-wal", 32 + 2 * 4120)
    with contextlib.closing(own_database.opened(file)) as sql:
        assert own_database.has_lost(sql, file, known)


@pytest.mark.parametrize("name", DATABASES)
def test_what_was_written_ahead_and_is_gone_with_all_beside_it_is_noticed(
    used: Path, tmp_path: Path, name: str
) -> None:
    """Once, and never where it was closed or is open."""
    file = tmp_path / Path(name).name
    for end in ("", *own_database.BESIDE):
        shutil.copyfile(used / f"{name}{end}", f"{file}{end}")
    for end in ("-wal", "-shm"):
        Path(f"{file}{end}").unlink()
    for is_lost in (True, False, False):
        known = own_database.ahead(file)
        with contextlib.closing(own_database.opened(file)) as sql:
            assert own_database.has_lost(sql, file, known) is is_lost
            assert own_database.ahead(file) is None and Path(f"{file}-open").exists()
        assert sorted(tmp_path.iterdir()) == [file]


def test_a_database_that_cannot_be_opened_is_refused_and_that_is_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python prints what goes wrong as an object is cleared away: nobody asked for that one."""
    printed = list[object]()
    monkeypatch.setattr(sys, "unraisablehook", printed.append)
    (tmp_path / "store.sqlite").mkdir()
    for opened in (own_database.opened, lambda file: sqlite3.connect(file, factory=own_database.Connection)):
        with pytest.raises((OSError, sqlite3.Error)):
            opened(tmp_path / "store.sqlite")
    gc.collect()
    assert not printed


def test_who_only_reads_leaves_what_was_written_ahead_to_the_service(used: Path, tmp_path: Path) -> None:
    """Also what is damaged of it, of which he reads nothing."""
    state = Path(shutil.copytree(used, tmp_path / "state"))
    wal = state / f"{service_store.FILE}-wal"
    for data in (whole := wal.read_bytes(), whole[:-5000], b""):
        wal.write_bytes(data)
        sound = data == whole
        with contextlib.nullcontext() if sound else pytest.raises(OSError, match="written ahead"):
            assert service_store.document_of(state, SPINDLE) == 2
        assert wal.read_bytes() == data
        service = served(Path(shutil.copytree(state, tmp_path / f"of {len(data)}" / "state")).parent, MACHINE)
        assert bool(service.store.losses) is not sound
        service.close()


def test_what_was_never_committed_is_no_loss(tmp_path: Path) -> None:
    file = tmp_path / "a"
    with contextlib.closing(own_database.opened(file)) as sql:
        sql.execute("CREATE TABLE t (x)")
        sql.execute("PRAGMA cache_size = 2")
        sql.execute("BEGIN")
        sql.executemany("INSERT INTO t VALUES (randomblob(3000))", [()] * 30)
        for end in ("", "-wal"):
            shutil.copyfile(f"{file}{end}", tmp_path / f"b{end}")
    assert frames(tmp_path / "b-wal") > 10
    data = (tmp_path / "b-wal").read_bytes()
    for length in (len(data), len(data) - 1000, len(data) - 4110):
        (tmp_path / "b-wal").write_bytes(data[:length])
        with contextlib.closing(own_database.opened(tmp_path / "b")) as sql:
            assert not own_database.has_lost(sql, tmp_path / "b"), length


def without_users(state: Path) -> None:
    """A bad bit in the first frame that is written ahead: all that came since is dropped."""
    wal = own_folder.of(state) / "store.sqlite-wal"
    data = bytearray(wal.read_bytes())
    data[32 + 24 + 100] ^= 1
    wal.write_bytes(data)


def test_users_that_a_bad_bit_has_cost_open_nothing_and_the_loss_is_reported(folder: Path, app: Any) -> None:
    state = folder / "state"
    without_users(state)
    panel, strangers, found = asyncio.run(answered(app, state))
    assert not strangers and not found.answers and panel.users.any
    assert panel.users.lost is not None and panel.users.lost["key"] == "users_lost"
    with contextlib.closing(Store(state)) as store:
        assert store.users.all() == []
        (lost,) = store.losses
        assert lost["key"] == "store_lost" and (store.own / "store.sqlite-wal.damaged1").exists()
        names = sorted(program.name for program in store.programs.list())
        assert len(names) == 2 and all(name.startswith("recovered/") for name in names)
        assert store.sweep() == 0
        store.users.set("carl", "hash", "set_up")
        assert store.users.lost is None and log_in_marker.users(store.own) == 1


@pytest.mark.parametrize("damage", ["", "nobodz\n", "nobody", "users 0\n", "\xff", None])
def test_a_note_of_the_users_that_is_damaged_or_gone_opens_nothing(
    folder: Path, app: Any, damage: str | None
) -> None:
    state = folder / "state"
    note = own_folder.of(state) / log_in_marker.FILE
    note.unlink()
    if damage is not None:
        note.write_bytes(damage.encode("latin-1"))
    without_users(state)
    assert not asyncio.run(answered(app, state))[1]


def test_a_store_that_is_emptied_beside_its_note_opens_nothing(folder: Path, app: Any) -> None:
    for name in ("store.sqlite", "store.sqlite-wal", "store.sqlite-shm"):
        (folder / "state" / "panel" / name).unlink()
    assert not asyncio.run(answered(app, folder / "state"))[1]


def test_a_part_of_the_users_that_is_lost_is_told_and_the_others_log_in(folder: Path, app: Any) -> None:
    with contextlib.closing(sqlite3.connect(folder / "state" / "panel" / "store.sqlite")) as sql:
        sql.execute("DELETE FROM users WHERE name = 'bert'")
        sql.commit()
    panel, strangers, found = asyncio.run(answered(app, folder / "state"))
    assert not strangers and found.answers
    assert panel.users.lost == message("users_lost_some", were=2, are=1)


def test_a_store_of_before_there_were_notes_is_as_open_as_it_was(tmp_path: Path, app: Any) -> None:
    for users in (0, 1):
        state = tmp_path / str(users)
        anna = "INSERT INTO users VALUES ('anna', 'hash', 'set_up', 1.0)"
        older_state.panel_store(own_folder.of(state), 3, *[anna] * users)
        panel, strangers, _ = asyncio.run(answered(app, state))
        assert panel.users.any is bool(users) and bool(strangers) is not bool(users)
        assert log_in_marker.users(own_folder.of(state)) == users


def test_the_last_user_that_is_removed_opens_it_again_and_none_that_was_lost(tmp_path: Path) -> None:
    with contextlib.closing(Store(tmp_path)) as store:
        assert store.users.lost is None and log_in_marker.users(store.own) == 0
        for name in (USER, "bert"):
            store.users.set(name, "hash", "set_up")
        store.users.remove(USER)
        assert log_in_marker.users(store.own) == 1
        log_in_marker.write(store.own, 3)  # two were lost
        store.users.remove("bert")
        assert store.users.lost is not None, "who is removed was not the last"
        store.users.set(USER, "hash", "set_up")
        store.users.remove(USER)
        assert store.users.lost is None and log_in_marker.users(store.own) == 0


# -- what the service notes


@pytest.mark.parametrize("name", [setup_data.MACHINE, control_socket.RUNTIME, control_socket.LAST])
def test_a_note_that_can_be_had_anew_is_written_anew(
    folder: Path, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    file = folder / "state" / name
    sound = file.read_bytes()
    file.write_bytes(b"\xff" + sound[1:])
    assert not started(folder).words
    if name != control_socket.LAST:
        assert f"{file} " in caplog.text and "is written anew" in caplog.text
        assert file.read_bytes()[:1] == sound[:1]
    assert setup_data.noted(folder / "state").name == MACHINE.name


def damage(state: Path, name: str) -> None:
    """The newest of a document, by who keeps no sums."""
    with contextlib.closing(own_database.opened(state / service_store.FILE)) as sql:
        newest = f"SELECT max(generation) FROM documents WHERE name = '{name}'"
        sql.execute(f"UPDATE documents SET value = '7' WHERE name = '{name}' AND generation = ({newest})")


def test_a_journal_that_cannot_be_read_is_put_aside_and_reported(folder: Path) -> None:
    state = folder / "state"
    damage(state, journal.DOCUMENT)
    (alarm,) = started(folder).words
    assert alarm["values"]["what"] == "documents 1" and (state / alarm["values"]["aside"]).exists()


def test_an_alarm_that_is_damaged_costs_no_other_and_holds_every_start_back(folder: Path) -> None:
    state = folder / "state"
    with contextlib.closing(own_database.opened(state / service_store.FILE)) as sql:  # which keeps no sums
        sql.execute("INSERT INTO alarms VALUES (7, '{}')")
    (alarm,) = started(folder).words
    assert alarm["name"] == alarms.DAMAGE and alarm["values"]["what"] == "alarms 1"
    assert (state / alarm["values"]["aside"]).exists()


def test_counters_of_wear_in_a_store_that_is_no_store_any_more_are_those_of_its_copy(folder: Path) -> None:
    state = folder / "state"
    for end in own_database.BESIDE:
        (state / f"{service_store.FILE}{end}").unlink()
    (state / service_store.FILE).write_bytes(b"\xff" * 5000)
    service = served(folder, MACHINE)
    (alarm,) = (one for one in service.alarms.list() if one["name"] == alarms.DAMAGE)
    assert alarm["key"] == "file_before" and alarm["values"]["aside"] == f"{service_store.FILE}.damaged1"
    service.close()


@pytest.mark.parametrize("name", [FITTING, SPINDLE])
def test_nothing_starts_with_damaged_offsets_or_an_unknown_tool_before_somebody_has_confirmed_it(
    folder: Path, name: str
) -> None:
    """With others than those that were set it would cut elsewhere."""
    state = folder / "state"
    service_store.put(state, FITTING, {"offsets": {"G55": {"origin_mm": [7, 8, 9]}}})
    damage(state, name)
    service = served(folder, MACHINE)
    desk = CommandHandlers(service)
    alarm = next(one for one in service.alarms.list() if one["name"] == alarms.DAMAGE)
    assert alarm["values"]["file"] == str(state / service_store.FILE)
    if name == FITTING:
        assert service.set_up.fitted["offsets"] == {"G55": {"origin_mm": [1, 2, 3]}}
    for verb, args in (("mdi", {"text": "G1 X1 F100"}), ("mdi", {"text": "M5"})):
        with pytest.raises(CommandRefused, match="onfirm alarm"):
            done(desk, verb, **args)
    done(desk, "acknowledge", id=alarm["id"])
    with contextlib.suppress(CommandRefused):  # whatever else holds it back
        done(desk, "mdi", text="M5")
    NEEDS["damage"](service, COMMANDS["start"], {})
    desk.close()


def test_nothing_starts_once_the_whole_store_is_gone_before_somebody_has_confirmed_it(folder: Path) -> None:
    for file in (folder / "state").glob(f"{service_store.FILE}*"):
        file.unlink()
    service = served(folder, MACHINE)
    (alarm,) = service.alarms.list()
    assert (alarm["name"], alarm["key"]) == (alarms.DAMAGE, "file_gone")
    assert service.changer is not None and not service.changer.store.known and service.set_up.tool == 0
    with pytest.raises(CommandRefused, match="onfirm alarm"):
        NEEDS["damage"](service, COMMANDS["start"], {})
    service.alarms.acknowledge(alarm["id"])
    NEEDS["damage"](service, COMMANDS["start"], {})
    service.close()


def test_tools_of_which_a_bad_bit_has_cost_the_last_step_must_be_confirmed(folder: Path) -> None:
    state, name = folder / "state", service_store.FILE
    with contextlib.closing(StoredTools(state)) as tools:
        assert tools.spindle == 2
        tools.confirm({1: 0, 2: 2})
        for end in ("", "-wal"):
            shutil.copyfile(state / f"{name}{end}", folder / f"{name}{end}")
    data = bytearray((folder / f"{name}-wal").read_bytes())
    data[32 + 24 + 100] ^= 1  # in the page of the first frame
    (folder / f"{name}-wal").write_bytes(data)
    for _ in range(2):
        with contextlib.closing(StoredTools(folder)) as tools:
            assert tools.spindle is None and not tools.known


def test_a_back_up_beside_a_note_that_cannot_be_read_says_so(folder: Path) -> None:
    (folder / "state" / setup_data.MACHINE).write_bytes(b'{"name": 7}')
    with pytest.raises(ValueError, match="no note of a machine file"):
        setup_data.noted(folder / "state")
