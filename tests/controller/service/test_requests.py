"""Every request to the machine is noted with who is behind it, and none goes beyond his role."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import os
import socket
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import engine_of, served
from support.fakes.panels import Scene, take_control

from controller import own_database
from controller.api.service_client import SocketServiceClient
from controller.commands.command import Access
from controller.commands.table import ALL
from controller.ipc import asker
from controller.ipc.asker import Asker
from controller.ipc.control_socket import Client, CommandRefused
from controller.messages import message
from controller.program import linked
from controller.service import requests, socket_server
from controller.service.command_handlers import CommandHandlers
from controller.service.requests import Requests
from controller.service.service import Service
from controller.service.socket_server import Server
from controller.state.modes import Mode, Request
from controller.store import service_store

MAY = {
    "view": {Access.LOOK, Access.STOP},
    "operate": {Access.LOOK, Access.STOP, Access.OPERATE, Access.MOVE},
    "set_up": set(Access),
}


class Desk:
    """A service with its door; ``rows`` are what is noted by now."""

    def __init__(self, service: Service, path: Path) -> None:
        self.service, self.path = service, path
        self.requests, self.handlers = Requests(service.store), CommandHandlers(service)
        self.server = Server(path, self.handlers, noted=self.requests.noted)
        self.client = Client(path, 20.0)

    def rows(self) -> list[dict[str, Any]]:
        self.requests._writer.submit(int).result()
        with own_database.reading(self.service.state / service_store.FILE) as sql:
            return [*requests.listed(sql, 1000)][::-1]

    def close(self) -> None:
        self.client.close()
        self.server.close()
        self.requests.close()
        self.handlers.close()
        self.service.close()


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with contextlib.closing(Desk(served(tmp_path), tmp_path / "run" / "control.sock")) as made:
        yield made


@pytest.mark.parametrize("role", MAY)
def test_a_role_may_give_the_commands_that_are_declared_for_it_and_no_others(desk: Desk, role: str) -> None:
    for command in ALL:
        code = ""
        try:
            desk.client.ask_for(Asker("anna", role, "10.0.0.7"), command.name, {"no": "such argument"})
        except CommandRefused as error:
            code = error.code
        assert (code == "role") is (command.access not in MAY[role]), command.name
    noted = {row["verb"]: row for row in desk.rows()}
    assert noted.keys() == {command.name for command in ALL if command.access is not Access.LOOK}
    for command in ALL:
        if command.access is not Access.LOOK:
            row = noted[command.name]
            assert (row["user"], row["role"], row["address"]) == ("anna", role, "10.0.0.7")
            assert row["peer"] == asker.name_of(os.geteuid())
            assert (row["refused"] == "role") is (command.access not in MAY[role])


def test_what_the_panel_asks_for_is_noted_with_user_role_and_address(desk: Desk, tmp_path: Path) -> None:
    async def story() -> None:
        door = SocketServiceClient(desk.path)
        scene = await Scene(tmp_path / "panel", door=door).with_users()  # type: ignore[arg-type]
        async with scene.client("operate", peer="10.0.0.7") as client:
            await take_control(client)
            await client.post("/api/v1/cycle/stop")
            await client.put("/api/v1/overrides/feed", json={"share": 0.5})
        async with scene.client("view", peer="10.0.0.8") as client:
            assert (await client.post("/api/v1/cycle/stop")).status_code == 403
            assert (await client.get("/api/v1/status")).status_code == 200
        door.close()

    asyncio.run(story())
    found = [(row["user"], row["role"], row["address"], row["verb"]) for row in desk.rows()]
    assert ("token script-operate", "operate", "10.0.0.7", "stop") in found
    assert any(verb == "override" for *_, verb in found)
    assert all(user == "token script-operate" for user, *_ in found)


def test_alarms_are_acknowledged_by_whom_the_panel_names_and_files_loaded_for_the_user_at_the_socket(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.service.alarms.add("TEST", message("stopped"))
    desk.client.ask_for(Asker("anna", "operate"), "acknowledge", {"id": 1})
    assert desk.service.alarms.list()[0]["acknowledged_by"] == "anna"
    lost = message("users_lost_some", were=3, are=1)
    for _ in range(2):
        desk.client.ask("panel_damaged", **lost)
    newest, _ = desk.service.alarms.list()
    assert (newest["name"], newest["key"], newest["values"]) == ("STORE_DAMAGED", *lost.values())
    (tmp_path / "a.ngc").write_text("M2\n")
    desk.client.ask("load", path=str(tmp_path / "a.ngc"))
    monkeypatch.setattr(socket_server, "of_socket", lambda own: (64002, os.getegid()))
    with contextlib.closing(Client(desk.path, 20.0)) as other, pytest.raises(CommandRefused) as refused:
        other.ask("load", path=str(tmp_path / "a.ngc"))
    assert refused.value.said["key"] == "unreadable"


def test_who_names_nobody_is_the_user_at_the_socket_and_who_names_him_wrongly_is_refused(desk: Desk) -> None:
    with contextlib.suppress(CommandRefused):
        desk.client.ask("stop")
    assert desk.rows()[-1]["user"] == asker.name_of(os.geteuid())
    for by in ({}, [], "anna", {"user": "anna", "role": "king"}, {"user": "", "role": "view"}, {"user": 1}):
        with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)) as own:
            own.connect(str(desk.path))
            own.send(json.dumps({"id": 1, "verb": "estop", "by": by}).encode())
            assert json.loads(own.recv(1 << 16))["error"]["key"] == "no_asker"


def test_the_name_of_a_peer_is_asked_once_for_it_may_be_slow(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(socket_server, "name_of", lambda uid: asked.append(uid) or "anna")
    with contextlib.closing(Client(desk.path, 20.0)) as client:
        for _ in range(3):
            with contextlib.suppress(CommandRefused):
                client.ask("stop")
    assert asked == [os.geteuid()] and desk.rows()[-1]["user"] == "anna"


def test_what_is_sent_while_a_key_is_held_is_noted_once_and_no_flood_is_kept(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests, "MAX_ROWS", 50)
    monkeypatch.setattr(requests, "AGAIN_S", 1e9)
    jog = {"frame": "joint", "axis": "X", "speed": 0.5, "press": "a"}
    for _ in range(20):
        with contextlib.suppress(CommandRefused):
            desk.client.ask_for(Asker("anna"), "jog", jog)
    assert sum(row["verb"] == "jog" for row in desk.rows()) <= 2  # taken, then refused
    for number in range(120):
        with contextlib.suppress(CommandRefused):
            desk.client.ask_for(Asker(f"user{number}"), "hold", {})
    desk.rows()
    assert len(desk.rows()) <= 50 and desk.rows()[-1]["user"] == "user119"


def test_a_disk_that_takes_its_time_keeps_nobody_from_looking_or_from_a_stop(desk: Desk) -> None:
    """What is noted of it is written afterwards."""
    taken, engine = (Request.HOLD, Request.STOP, Request.ESTOP), engine_of(desk.service)
    engine.now = engine.now._replace(mode=Mode.RUNNING)
    with desk.service.store.write():
        for verb in ("status", "facts", "hold", "stop", "estop", "status"):
            desk.client.ask(verb)
    assert [one for one in engine.requests if one in taken] == [*taken]
    assert [row["verb"] for row in desk.rows()] == ["hold", "stop", "estop"]


def test_what_is_refused_after_its_answer_was_promised_is_noted_so(desk: Desk) -> None:
    for error, code in ((CommandRefused("refused", "No."), "refused"), (KeyError("x"), "error"), (None, "")):
        promise: Future[dict[str, Any]] = Future()
        with desk.requests.noted("hold", {}, Asker("anna"), "panel") as hear:
            hear(promise)
        before = desk.rows()
        assert before[-1]["refused"] == ""
        if error is None:
            promise.set_result({})
        else:
            promise.set_exception(error)
        assert [row["refused"] for row in desk.rows()[len(before) :]] == ([code] if code else [])


ENDLESS = "/proc/self/pagemap"  # a regular file of no size
WORDS = (
    "",
    "X",
    "G54",
    "G1 X1 F100",
    "9" * 5000,
    "a\0b",
    "\ud800",
    "G1 (\udfff)",
    "/",
    "/etc",
    "set_up",
    "joint",
)
NUMBERS = (0, 1, -1, 0.5, 2**70, 1e308, float("inf"), float("nan"))
HOSTILE = (*WORDS, *NUMBERS, None, True, [], {}, [1, 2], ["X"], {"X": 1}, {"sub.ngc": "/etc/passwd"}, [[[]]])


def test_whatever_a_panel_sends_is_no_error_of_the_services_own(desk: Desk) -> None:
    """Every argument of every command with every value; its door answers on."""
    for command in ALL:
        for name, value in itertools.product([one.name for one in command.arguments], HOSTILE):
            with contextlib.suppress(CommandRefused):
                try:
                    desk.client.ask_for(Asker("anna"), command.name, {name: value})
                except CommandRefused as error:
                    assert error.said["key"] != "own_error", (command.name, name, value, error)
                    raise
    assert desk.client.ask("status")["mode"]


def test_a_program_of_no_name_without_end_or_nobodys_is_refused_in_a_sentence(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(linked, "MAX_BYTES", 1 << 16)
    program, large = tmp_path / "calls.ngc", tmp_path / "large.ngc"
    program.write_text("o<sub> call\nM30\n")
    os.truncate(os.open(large, os.O_CREAT | os.O_RDWR), 1 << 40)
    paths = ("a\0b", "\ud800", ENDLESS, str(large), "/dev/zero", str(tmp_path))
    loads: list[dict[str, Any]] = [{"path": path} for path in paths]
    loads += [{"path": str(program), "files": {"sub.ngc": path}} for path in (ENDLESS, str(large))]
    for args in loads:
        with pytest.raises(CommandRefused) as refused:
            desk.client.ask("load", **args)
        assert refused.value.said["key"] in ("unreadable", "too_large"), args


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that every user comes to."""
    with tempfile.TemporaryDirectory(dir="/tmp") as made:
        yield Path(made)


@pytest.mark.skipif(os.geteuid() != 0, reason="a second user takes root to make")
def test_nobody_is_asked_who_has_put_a_socket_where_anybody_may(place: Path) -> None:
    """As in /tmp, before the service's own is there."""
    place.chmod(0o1777)
    heard, hears = os.pipe()
    if (child := os.fork()) == 0:
        try:
            os.setgid(64001)
            os.setuid(64001)
            (place / "run").mkdir(mode=0o755)
            own = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            own.bind(str(place / "run" / "control.sock"))
            os.chmod(place / "run" / "control.sock", 0o777)
            own.listen()
            os.write(hears, b"x")
            came, _ = own.accept()
            os.write(hears, came.recv(1000) or b"-")
        finally:  # or the tests after this one would go on in the child, too
            os._exit(0)
    os.close(hears)
    assert os.read(heard, 1) == b"x"
    client = Client(place / "run" / "control.sock", 20.0)
    with contextlib.closing(client), pytest.raises(CommandRefused) as refused:
        client.ask("status")
    assert refused.value.said["key"] == "stranger_serves" and os.read(heard, 1000) == b"-"
    os.waitpid(child, 0)
    place.chmod(0o755)  # as /run: then it is the service's own user
    assert asker.may_serve(64001, place / "run" / "control.sock")
    (place / "run").chmod(0o775)
    assert not asker.may_serve(64001, place / "run" / "control.sock")
