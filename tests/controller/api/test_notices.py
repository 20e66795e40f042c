"""Notices reach whoever is not at the machine, whatever hangs; what is secret is told to nobody."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import socketserver
import ssl
import threading
import time
import zipfile
from collections.abc import Awaitable, Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
import trustme
from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult, Envelope
from support.fakes.panels import Scene, sentence
from support.live.ports import free_port

from controller import messages
from controller.api import backup, notices
from controller.api.notices import Notice
from controller.faults import Fault
from controller.machine import machine_file
from controller.messages import message
from controller.state import fault_table

KEY = "T0Psecret"
TIMEOUT_S = 20.0
TEST = Notice("test", 0.0, message("notice.test"))


class Hook:
    """A webhook that answers with these statuses, the last one for ever."""

    def __init__(self, *statuses: int) -> None:
        self.heard: list[dict[str, Any]] = []
        self.some = threading.Semaphore(0)
        hook, left = self, list(statuses)

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                hook.heard.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
                self.send_response(left.pop(0) if len(left) > 1 else left[0])
                self.send_header("Location", "http://127.0.0.1:1/")
                self.end_headers()
                hook.some.release()

            def log_message(self, *_: Any) -> None:
                pass

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.server_port}/{KEY}"


@pytest.fixture
def hook() -> Iterator[Hook]:
    made = Hook(200)
    yield made
    made.server.shutdown()
    made.server.server_close()


def asked(scene: Scene, story: Callable[[Any], Awaitable[Any]]) -> Any:
    async def told() -> Any:
        async with scene.client() as client:
            return await story(client)

    return asyncio.run(told())


def settle(scene: Scene, **values: Any) -> Any:
    return asked(scene, lambda client: client.patch("/api/v1/notices", json=values))


def look(scene: Scene) -> None:
    scene.panel.watch._fresh_to_s = -1e9  # a status that was asked for a moment ago is none any more
    asyncio.run(scene.panel.notices.look())


def test_alarm_end_of_program_and_tool_change_are_each_told_once(tmp_path: Path, hook: Hook) -> None:
    scene = Scene(tmp_path)
    scene.history.alarm("ESTOP", "An old one.")
    assert settle(scene, webhook=hook.url, language="de").status_code == 200
    look(scene)
    scene.history.alarm("ESTOP", fault_table.fault_message(Fault.ESTOP_INPUT))
    scene.history.run("part.ngc", "completed")
    scene.history.run("MDI", "completed")
    told, asks = scene.door.status, {"number": 4, **message("tool_change", number=4, name="")}
    scene.door.status = lambda: {**told(), "tool_change": asks}  # type: ignore[method-assign]
    look(scene)
    look(scene)
    for _ in range(3):
        assert hook.some.acquire(timeout=TIMEOUT_S)
    events = {one["event"]: one["text"] for one in hook.heard}
    ended = "Das Programm part.ngc ist zu Ende: fertig."
    stop, tool = scene.history.alarms()[0], "T4 in die Spindel einsetzen, dann das Programm fortsetzen."
    alarm = messages.text({"key": stop.key, "values": stop.values}, "de")
    assert events == {"alarm": " ".join(alarm.split()), "program_end": ended, "tool_change": tool}
    assert alarm.startswith("Der Not-Halt")
    scene.panel.notices.send(TEST)
    assert hook.some.acquire(timeout=TIMEOUT_S)
    assert len(hook.heard) == 4


def test_what_is_switched_off_is_not_told(tmp_path: Path) -> None:
    scene, sent = Scene(tmp_path), []
    scene.panel.notices.send = sent.append  # type: ignore[method-assign,assignment]
    settle(scene, webhook="http://127.0.0.1:9/", alarms=False)
    look(scene)
    scene.history.alarm("ESTOP", "Emergency stop.")
    scene.history.run("part.ngc", "fault")
    look(scene)
    assert [one.event for one in sent] == ["program_end"]


def test_a_failing_server_is_tried_thrice_and_then_it_is_shown_why(
    tmp_path: Path, hook: Hook, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notices, "PAUSES_S", (0.0, 0.0))
    scene, bad = Scene(tmp_path), Hook(500)
    settle(scene, webhook=bad.url)
    scene.panel.notices.send(TEST)
    for _ in range(notices.TRIES):
        assert bad.some.acquire(timeout=TIMEOUT_S)
    settle(scene, webhook=hook.url)
    scene.panel.notices.send(TEST)
    assert hook.some.acquire(timeout=TIMEOUT_S)
    assert len(bad.heard) == notices.TRIES
    bad.server.shutdown()
    bad.server.server_close()


@pytest.mark.parametrize("status", [301, 404, 500])
def test_the_test_button_says_what_came_of_it_without_the_key(tmp_path: Path, status: int) -> None:
    scene, bad = Scene(tmp_path), Hook(status)
    settle(scene, webhook=bad.url)
    answer = asked(scene, lambda client: client.post("/api/v1/notices/test"))
    last = answer.json()["last"]["webhook"]
    assert (last["sent"], f"HTTP {status}" in last["sentence"]) == (False, True)
    assert KEY not in answer.text and answer.json()["webhook"] == "http://127.0.0.1"
    bad.server.shutdown()
    bad.server.server_close()


def test_a_server_that_hangs_holds_nothing_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, hangs, began = Scene(tmp_path), threading.Event(), threading.Event()

    def hang(*_: Any) -> None:
        began.set()
        hangs.wait(TIMEOUT_S)

    monkeypatch.setitem(notices.SENDERS, "webhook", hang)
    settle(scene, webhook="http://127.0.0.1:9/")
    for _ in range(notices.MAX_WAITING + 5):
        scene.panel.notices.send(TEST)
    assert began.wait(TIMEOUT_S)
    assert asked(scene, lambda client: client.get("/api/v1/status")).status_code == 200
    told = scene.panel.notices.outcomes["webhook"].why
    assert "too many" in messages.text(told)
    scene.panel.notices.end()
    hangs.set()


class Letters:
    """What a mail server got."""

    def __init__(self) -> None:
        self.letters: list[str] = []
        self.users: list[str] = []

    async def handle_DATA(self, _server: Any, _session: Any, envelope: Envelope) -> str:
        assert isinstance(envelope.content, bytes)
        self.letters.append(f"{envelope.rcpt_tos}\n{envelope.content.decode()}")
        return "250 OK"

    def allowed(self, _server: Any, _session: Any, _envelope: Any, _kind: str, told: Any) -> AuthResult:
        self.users.append(told.login.decode())
        return AuthResult(success=told.password == KEY.encode(), handled=False)


MAIL = {"sender": "mill@example.org", "to": "a@example.org, b@example.org"}


@contextlib.contextmanager
def mail_server(handler: Letters, **how: Any) -> Iterator[dict[str, Any]]:
    """Where it is, as settings."""
    port = free_port()
    server = Controller(handler, hostname="127.0.0.1", port=port, ready_timeout=TIMEOUT_S, **how)
    server.start()
    try:
        yield {"host": "127.0.0.1", "port": port, **MAIL}
    finally:
        server.stop()


def tried(scene: Scene) -> dict[str, Any]:
    """What came of a test by mail."""
    last: dict[str, Any] = asked(scene, lambda client: client.post("/api/v1/notices/test")).json()["last"]
    return last["mail"]


def test_a_mail_goes_to_all_receivers_in_the_language_that_was_chosen(tmp_path: Path) -> None:
    scene, got = Scene(tmp_path), Letters()
    with mail_server(got) as where:
        settle(scene, **where, security="none", language="de")
        assert tried(scene)["sent"] is True
    (letter,) = got.letters
    assert letter.startswith("['a@example.org', 'b@example.org']")
    assert "Versuch" in letter and "This is a test" not in letter


@pytest.mark.parametrize(("security", "password"), [("starttls", KEY), ("tls", KEY), ("starttls", "wrong")])
def test_a_mail_is_encrypted_to_a_server_that_proves_who_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, security: str, password: str
) -> None:
    scene, got, authority = Scene(tmp_path), Letters(), trustme.CA()
    trusted = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    authority.issue_cert("127.0.0.1").configure_cert(trusted)
    how = {"tls_context": trusted, "require_starttls": True} if security == "starttls" else {}
    how |= {"ssl_context": trusted} if security == "tls" else {}
    more = {"auth_required": True, "authenticator": got.allowed, "auth_require_tls": security == "starttls"}
    with mail_server(got, **how, **more) as where:
        settle(scene, **where, security=security, user="mill", password=password)
        assert "certificate verify failed" in tried(scene)["sentence"] and not got.users
        authority.cert_pem.write_to_path(str(tmp_path / "ca.pem"))
        monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "ca.pem"))
        last = tried(scene)
    assert set(got.users) == {"mill"}
    assert (last["sent"], len(got.letters)) == ((True, 1) if password == KEY else (False, 0)), last
    assert last["sent"] or "SMTP 535" in last["sentence"]


def test_a_password_is_not_sent_where_the_server_has_no_encryption(tmp_path: Path) -> None:
    scene, got = Scene(tmp_path), Letters()
    with mail_server(got, authenticator=got.allowed, auth_require_tls=False) as where:
        settle(scene, **where, security="starttls", user="mill", password=KEY)
        last = tried(scene)
    assert last["sent"] is False and "encryption" in last["sentence"] and not got.users and not got.letters


@pytest.mark.parametrize("way", ["webhook", "mail"])
def test_a_server_that_drips_is_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    """Each byte comes well within the time-out of a read; all of them would never have come."""
    monkeypatch.setattr(notices, "WHOLE_S", 0.3)
    scene, cut = Scene(tmp_path), threading.Event()
    drips = {"webhook": b"HTTP/1.1 ", "mail": b"220-"}[way]

    class Drips(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            with contextlib.suppress(OSError):
                for sign in itertools.chain(drips, itertools.repeat(ord("x"), 1000)):
                    self.request.send(bytes([sign]))
                    time.sleep(0.02)
                return
            cut.set()

    with socketserver.TCPServer(("127.0.0.1", 0), Drips) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        port = server.server_address[1]
        mail = {"host": "127.0.0.1", "port": port, "security": "none", **MAIL}
        settle(scene, **(mail if way == "mail" else {"webhook": f"http://127.0.0.1:{port}/"}))
        answer = asked(scene, lambda client: client.post("/api/v1/notices/test"))
        assert cut.wait(TIMEOUT_S)
        server.shutdown()
    assert answer.json()["last"][way]["sent"] is False


def test_a_way_that_hangs_does_not_hold_up_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, got, hangs = Scene(tmp_path), Letters(), threading.Event()
    monkeypatch.setitem(notices.SENDERS, "webhook", lambda *_: hangs.wait(TIMEOUT_S))
    with mail_server(got) as where:
        settle(scene, **where, security="none", webhook="http://127.0.0.1:9/")
        scene.panel.notices.send(TEST)
        while not got.letters:
            time.sleep(0.01)
    assert not hangs.is_set() and "webhook" not in scene.panel.notices.outcomes
    hangs.set()


def test_what_came_while_the_panel_was_away_is_told_once_by_the_next(tmp_path: Path, hook: Hook) -> None:
    scene = Scene(tmp_path)
    settle(scene, webhook=hook.url)
    look(scene)
    scene.history.alarm("ESTOP", "While it was away.")
    look(Scene(tmp_path))
    assert hook.some.acquire(timeout=TIMEOUT_S)
    third = Scene(tmp_path)
    look(third)
    third.panel.notices.send(TEST)
    assert hook.some.acquire(timeout=TIMEOUT_S)
    assert [one["text"] for one in hook.heard] == ["While it was away.", messages.text(TEST.said)]


def test_settings_that_are_not_sound_are_off(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    settle(scene, webhook="http://127.0.0.1:9/")
    for name, value in (("port", "x"), ("port", 0), ("security", "no"), ("webhook", "file:///etc/passwd")):
        kept = scene.store.settings.get(f"notices.{name}")
        scene.store.settings.set(f"notices.{name}", value, "a back-up")
        answer = asked(scene, lambda client: client.get("/api/v1/notices"))
        assert (answer.status_code, answer.json()["webhook"]) == (200, ""), name
        scene.store.settings.set(f"notices.{name}", kept, "me")


def test_a_back_up_has_no_secret_and_its_restoring_sends_none_to_another_server(tmp_path: Path) -> None:
    here, there = Scene(tmp_path / "here"), Scene(tmp_path / "there")
    for scene, host in ((here, "mail.example.org"), (there, "other.example.org")):
        settle(scene, host=host, **MAIL, user="mill", password=KEY, webhook=f"http://{host}/{KEY}")
        look(scene)
    machine = machine_file.load("trunnion")
    file = backup.save(here.store, machine, tmp_path / "saved.zip")
    with zipfile.ZipFile(file) as archive:
        assert not any(KEY.encode() in archive.read(name) for name in archive.namelist())
    backup.restore(there.store, backup.check(file), tmp_path / "machine.toml", None)
    found = there.panel.notices.settings()
    assert (found.host, found.password) == ("mail.example.org", "")
    assert found.webhook == f"http://other.example.org/{KEY}"
    backup.restore(here.store, backup.check(file), tmp_path / "machine.toml", None)
    assert here.panel.notices.settings().password == KEY


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"webhook": "ftp://example.org/"}, "http"),
        ({"webhook": "file:///etc/passwd"}, "http"),
        ({"webhook": f"https://user:{KEY}@example.org/"}, "without a user"),
        ({"webhook": "http://example.org/a b"}, "spaces"),
        ({"webhook": "http://[::1/"}, "http"),
        ({"host": "mail.example.org:25"}, "without a port"),
        ({"host": "mail.example.org", "sender": "mill@example.org"}, "receiver"),
        ({"host": "mail.example.org", "sender": "a@b.org\r\nBcc: c@d.org", "to": "a@b.org"}, "sender"),
        ({"host": "h", "sender": "a@b.org", "to": "a@b.org", "user": "u", "security": "none"}, "unencrypted"),
    ],
)
def test_what_cannot_be_sent_to_is_refused_and_changes_nothing(
    tmp_path: Path, values: dict[str, Any], why: str
) -> None:
    scene = Scene(tmp_path)
    answer = settle(scene, **values)
    assert answer.status_code == 422 and why in sentence(answer) and KEY not in answer.text
    found = asked(scene, lambda client: client.get("/api/v1/notices")).json()
    assert (found["webhook"], found["host"]) == ("", "")


def test_a_password_is_told_to_nobody_and_goes_to_no_other_server(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    mail = {"host": "mail.example.org", "sender": "a@b.org", "to": "a@b.org", "user": "mill"}
    answer = settle(scene, **mail, password=KEY)
    assert answer.json()["password_set"] is True and KEY not in answer.text
    assert settle(scene, language="de").json()["password_set"] is True
    assert settle(scene, host="other.example.org").json()["password_set"] is False


def test_without_a_way_nothing_can_be_tried(tmp_path: Path) -> None:
    answer = asked(Scene(tmp_path), lambda client: client.post("/api/v1/notices/test"))
    assert answer.status_code == 409 and "webhook" in sentence(answer)
