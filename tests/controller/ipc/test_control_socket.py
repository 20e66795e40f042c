"""The door: one answer per request, late ones overtaken, and nothing that a peer sends closes it."""

from __future__ import annotations

import json
import os
import socket
import stat
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from controller.ipc import control_socket
from controller.ipc.control_socket import Answer, Client, CommandRefused, Values
from controller.messages import LANGUAGES, of_error, plain, text
from controller.service import socket_server
from controller.service.socket_server import Server

NO_ANSWERS: dict[str, Values] = {"no json": {"where": Path()}, "endless": {"words": "x" * 500_000}}
TOLD = {"no json": "own_error", "endless": "long_answer"}  # instead of them


class Handler:
    """Echoes, refuses, and answers late when it is told to."""

    def __init__(self) -> None:
        self.late: list[Future[Values]] = []
        self.asked: list[str] = []

    def __call__(self, verb: str, args: Values) -> Answer:
        self.asked.append(verb)
        if verb == "late":
            self.late.append(Future())
            return self.late[-1]
        if verb == "refuse":
            raise CommandRefused("refused", "No.", "RUNNING", "HOME")
        if verb == "break":
            raise KeyError("of ours")
        if verb in NO_ANSWERS:
            return NO_ANSWERS[verb]
        return {"verb": verb, "args": args}


Opened = tuple[Handler, Client, Path]


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Opened]:
    handler, path = Handler(), tmp_path / "run" / "control.sock"
    server, client = Server(path, handler), Client(path, longest_s=20.0)
    yield handler, client, path
    client.close()
    server.close()


def raw(path: Path) -> socket.socket:
    own = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    own.settimeout(20.0)
    own.connect(str(path))
    return own


def error_of(act: Callable[[], Any]) -> CommandRefused:
    with pytest.raises(CommandRefused) as caught:
        act()
    return caught.value


def test_a_verb_and_its_arguments_arrive_and_are_answered(opened: Opened) -> None:
    _, client, _ = opened
    for share in (0.5, 1.0):
        assert client.ask("override", share=share) == {"verb": "override", "args": {"share": share}}


def test_a_refusal_keeps_code_mode_request_and_sentence(opened: Opened) -> None:
    error = error_of(lambda: opened[1].ask("refuse"))
    said = {"code": "refused", "mode": "RUNNING", "request": "HOME", **plain("No.")}
    assert error.to_dict() == said


def test_an_error_of_the_handlers_own_is_told_and_the_door_stays_open(opened: Opened) -> None:
    assert "KeyError" in error_of(lambda: opened[1].ask("break")).sentence
    assert opened[1].ask("status")["verb"] == "status"


@pytest.mark.parametrize("verb", NO_ANSWERS)
@pytest.mark.parametrize("late", [False, True])
def test_of_an_answer_that_no_packet_can_hold_that_is_told(opened: Opened, verb: str, late: bool) -> None:
    handler, client, path = opened
    own = raw(path)
    own.send(json.dumps({"id": 1, "verb": "late" if late else verb}).encode())
    if late:
        client.ask("status")
        handler.late[0].set_result(NO_ANSWERS[verb])
    answer = json.loads(own.recv(1 << 20))
    assert answer["id"] == 1 and answer["error"]["key"] == TOLD[verb]
    own.close()
    assert client.ask("status")


def test_a_number_that_is_none_does_not_close_the_door(opened: Opened) -> None:
    own = raw(opened[2])
    own.send(b'{"id": ' + b"[" * 900 + b"]" * 900 + b', "verb": "status"}')
    assert json.loads(own.recv(1 << 18))["id"] is None
    own.close()
    assert opened[1].ask("status")


def test_a_late_answer_is_overtaken_by_the_next_request(opened: Opened) -> None:
    handler, client, _ = opened
    late: list[Values] = []
    waiting = threading.Thread(target=lambda: late.append(client.ask("late")))
    waiting.start()
    while not handler.late:
        client.ask("status")
    assert client.ask("hold")["verb"] == "hold" and not late
    handler.late[0].set_result({"at": "last"})
    waiting.join(20.0)
    assert late == [{"at": "last"}]


def test_answers_on_one_connection_carry_the_numbers_of_their_requests(opened: Opened) -> None:
    handler, _, path = opened
    own = raw(path)
    own.send(json.dumps({"id": 1, "verb": "late"}).encode())
    own.send(json.dumps({"id": 2, "verb": "hold"}).encode())
    assert json.loads(own.recv(1 << 18))["id"] == 2
    handler.late[0].set_exception(CommandRefused("busy", "Later."))
    answer = json.loads(own.recv(1 << 18))
    assert answer["id"] == 1 and answer["error"]["code"] == "busy"
    own.close()


BAD = [
    b"{",
    b"[]",
    b"\xff\xfe",
    b'{"id": 1}',
    b'{"verb": 3}',
    b'{"verb": "x", "args": []}',
    b"[" * 9000,
    b"1",
]


@pytest.mark.parametrize("packet", BAD)
def test_what_is_no_request_is_answered_with_a_sentence(opened: Opened, packet: bytes) -> None:
    handler, client, path = opened
    own = raw(path)
    own.send(packet)
    answer = json.loads(own.recv(1 << 18))
    assert not answer["ok"] and answer["error"]["code"] == "bad" and text(answer["error"]).endswith(".")
    own.close()
    assert client.ask("status") and handler.asked == ["status"]


def test_a_number_that_json_does_not_know_is_bad_and_goes_out_as_null(opened: Opened) -> None:
    own = raw(opened[2])
    own.send(b'{"id": 1, "verb": "override", "args": {"share": NaN}}')
    assert json.loads(own.recv(1 << 18))["error"]["code"] == "bad"
    own.close()
    assert opened[1].ask("status", far=float("inf"))["args"] == {"far": None}


def test_too_long_a_packet_is_refused_on_either_side(opened: Opened) -> None:
    assert error_of(lambda: opened[1].ask("mdi", text="x" * 300_000)).code == "bad"
    own = raw(opened[2])
    own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
    own.send(b'{"verb": "' + b"x" * 250_000 + b'"}')
    assert json.loads(own.recv(1 << 18))["error"]["code"] == "bad"
    own.close()


def test_a_peer_that_goes_without_its_answer_harms_nobody(opened: Opened) -> None:
    handler, client, path = opened
    for _ in range(50):
        own = raw(path)
        own.send(json.dumps({"id": 1, "verb": "late"}).encode())
        own.close()
    client.ask("status")
    for late in handler.late:
        late.set_result({})
    assert client.ask("status")


def test_a_client_outlives_a_restart_of_the_service(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    client = Client(path, longest_s=20.0)
    assert error_of(lambda: client.ask("status")).code == "gone"
    for _ in range(2):
        server = Server(path, Handler())
        assert client.ask("status")["verb"] == "status"
        server.close()
    assert error_of(lambda: client.ask("status")).code == "gone"
    client.close()


@pytest.mark.parametrize(("anew", "code"), [(True, "silent"), (False, "gone")])
def test_what_a_service_was_asked_before_it_died_is_not_asked_of_the_next_one(
    tmp_path: Path, anew: bool, code: str
) -> None:
    path, servers, handler = tmp_path / "control.sock", list[Server](), Handler()

    def dies(verb: str, args: Values) -> Answer:
        if verb != "start":
            return {}
        path.unlink()
        if anew:
            servers.append(Server(path, handler))
        for peer in servers[0]._peers.values():
            peer.close()
        return {}

    servers.append(Server(path, dies))
    client = Client(path, longest_s=20.0)
    client.ask("status")
    assert error_of(lambda: client.ask("start")).code == code
    assert handler.asked == []
    client.close()
    for one in servers:
        one.close()


def test_a_service_that_hangs_is_told_from_one_that_is_gone(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    client = Client(path, longest_s=0.05)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listening:
        listening.bind(str(path))
        listening.listen(1)
        error = error_of(lambda: client.ask("status"))
        assert error.code == "silent" and "gives no answer" in error.sentence
    assert error_of(lambda: client.ask("status")).code == "gone"
    client.close()


def test_only_user_and_group_may_open_it_and_what_was_left_behind_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    left = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    left.bind(str(path))
    left.close()
    server = Server(path, Handler())
    assert stat.S_IMODE(path.stat().st_mode) == 0o660
    with pytest.raises(FileExistsError) as refused:
        Server(path, Handler())
    assert text(of_error(refused.value), "de") == LANGUAGES["de"].texts["another_service"]
    server.close()
    assert not path.exists()


def test_a_stranger_is_sent_away_with_a_sentence(opened: Opened, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket_server, "_let_in", lambda own, gid: False)
    own = raw(opened[2])
    answer = json.loads(own.recv(1 << 18))
    assert answer["error"]["code"] == "refused" and own.recv(10) == b""
    own.close()


def test_a_client_that_is_sent_away_is_told_why_whatever_comes_first(
    opened: Opened, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its request may find the connection closed already, or lie there unread when it is."""
    monkeypatch.setattr(socket_server, "_let_in", lambda own, gid: False)
    assert {error_of(lambda: opened[1].ask("hold")).code for _ in range(100)} == {"refused"}


def test_who_may_not_even_open_the_socket_is_told_so(opened: Opened, monkeypatch: pytest.MonkeyPatch) -> None:
    def barred(own: socket.socket, path: str) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(socket.socket, "connect", barred)
    error = error_of(lambda: opened[1].ask("status"))
    assert error.code == "silent" and "add it to the group" in error.sentence


def test_one_too_many_is_told_so(opened: Opened) -> None:
    others = [raw(opened[2]) for _ in range(control_socket.MAX_PEERS)]
    error = error_of(lambda: opened[1].ask("status"))
    assert error.code == "busy" and str(control_socket.MAX_PEERS) in error.sentence
    for own in others:
        own.close()


def test_who_is_let_in_is_the_kernels_word(opened: Opened) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    assert socket_server._let_in(ours, 12345)  # the same user
    assert os.getgid() in set(socket_server._groups(os.getuid(), os.getgid()))
    ours.close()
    theirs.close()


# ---- where a service is


def test_the_runtime_folder_is_found_by_the_state_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Root's usual place is not where systemd's service has its sockets."""
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path / "usual"))
    assert control_socket.runtime_of(tmp_path) == tmp_path / "usual"  # no service has run on it
    monkeypatch.chdir(tmp_path)
    control_socket.note_runtime(tmp_path, Path("run"))
    assert control_socket.runtime_of(tmp_path) == tmp_path / "run"


def test_a_service_is_there_whether_it_answers_or_hangs_and_gone_when_its_socket_is_all_that_is_left(
    tmp_path: Path,
) -> None:
    path = tmp_path / "control.sock"
    assert not control_socket.is_served(path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as own:
        own.bind(str(path))
        assert not control_socket.is_served(path)  # not yet
        own.listen(1)
        assert all(
            control_socket.is_served(path) for _ in range(5)
        )  # more than wait at once, and nobody accepts
    assert path.exists() and not control_socket.is_served(path)


def test_no_service_is_where_none_can_have_its_socket(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert not control_socket.is_served(tmp_path / "file" / "control.sock")
    assert not control_socket.is_served(tmp_path / ("long" * 40) / "control.sock")
