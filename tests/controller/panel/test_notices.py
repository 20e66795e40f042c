"""Notices reach whoever is not at the machine, whatever hangs; what is secret is told to nobody."""

from __future__ import annotations

import asyncio
import json
import socketserver
import threading
from collections.abc import Awaitable, Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any, ClassVar

import pytest
from support.fakes.panels import Scene, sentence

from controller.panel import notices

KEY = "T0Psecret"
PATIENCE_S = 20.0


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
    asyncio.run(scene.panel.notices.look())


def test_alarm_end_of_program_and_tool_change_are_each_told_once(tmp_path: Path, hook: Hook) -> None:
    scene = Scene(tmp_path)
    scene.store.alarms.add("ESTOP", "An old one.")
    assert settle(scene, webhook=hook.url, language="de").status_code == 200
    look(scene)
    scene.store.alarms.add("ESTOP", "Emergency stop.", sentence_de="Not-Halt.")
    scene.store.runs.end(scene.store.runs.begin("part.ngc", "0" * 64), "completed")
    scene.store.runs.end(scene.store.runs.begin("MDI", "0" * 64), "completed")
    told, asks = scene.door.status, {"number": 4, "sentence": "Put in T4.", "sentence_de": "T4 einsetzen."}
    scene.door.status = lambda: {**told(), "tool_change": asks}  # type: ignore[method-assign]
    look(scene)
    look(scene)
    for _ in range(3):
        assert hook.some.acquire(timeout=PATIENCE_S)
    events = {one["event"]: one["text"] for one in hook.heard}
    ended = "Das Programm part.ngc ist zu Ende: fertig."
    assert events == {"alarm": "Not-Halt.", "program_end": ended, "tool_change": "T4 einsetzen."}
    scene.panel.notices.send(notices.test())
    assert hook.some.acquire(timeout=PATIENCE_S)
    assert len(hook.heard) == 4


def test_what_is_switched_off_is_not_told(tmp_path: Path) -> None:
    scene, sent = Scene(tmp_path), []
    scene.panel.notices.send = sent.append  # type: ignore[method-assign,assignment]
    settle(scene, webhook="http://127.0.0.1:9/", alarms=False)
    look(scene)
    scene.store.alarms.add("ESTOP", "Emergency stop.")
    scene.store.runs.end(scene.store.runs.begin("part.ngc", "0" * 64), "fault")
    look(scene)
    assert [one.event for one in sent] == ["program_end"]


def test_a_failing_server_is_tried_thrice_and_then_it_is_shown_why(
    tmp_path: Path, hook: Hook, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notices, "PAUSES_S", (0.0, 0.0))
    scene, bad = Scene(tmp_path), Hook(500)
    settle(scene, webhook=bad.url)
    scene.panel.notices.send(notices.test())
    for _ in range(notices.TRIES):
        assert bad.some.acquire(timeout=PATIENCE_S)
    settle(scene, webhook=hook.url)
    scene.panel.notices.send(notices.test())
    assert hook.some.acquire(timeout=PATIENCE_S)
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
        hangs.wait(PATIENCE_S)

    monkeypatch.setitem(notices.SENDERS, "webhook", hang)
    settle(scene, webhook="http://127.0.0.1:9/")
    for _ in range(notices.MOST_WAITING + 5):
        scene.panel.notices.send(notices.test())
    assert began.wait(PATIENCE_S)
    assert asked(scene, lambda client: client.get("/api/v1/status")).status_code == 200
    assert "too many" in scene.panel.notices.outcomes["webhook"].sentence
    scene.panel.notices.end()
    hangs.set()


class Mails(socketserver.StreamRequestHandler):
    """A mail server as far as one letter needs it."""

    letters: ClassVar[list[str]] = []

    def handle(self) -> None:
        self.wfile.write(b"220 here\r\n")
        while line := self.rfile.readline():
            verb = line[:4].upper()
            self.wfile.write({b"DATA": b"354 go on\r\n", b"QUIT": b"221 bye\r\n"}.get(verb, b"250 ok\r\n"))
            if verb == b"DATA":
                letter = iter(self.rfile.readline, b".\r\n")
                self.letters.append(b"".join(letter).decode())
                self.wfile.write(b"250 taken\r\n")
            if verb == b"QUIT":
                return


def test_a_mail_goes_to_all_receivers_in_both_languages(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    with socketserver.TCPServer(("127.0.0.1", 0), Mails) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        where = {"host": "127.0.0.1", "port": server.server_address[1], "security": "none"}
        settle(scene, **where, sender="mill@example.org", to="a@example.org, b@example.org")
        answer = asked(scene, lambda client: client.post("/api/v1/notices/test"))
        server.shutdown()
    assert answer.json()["last"]["mail"]["sent"] is True, answer.text
    (letter,) = Mails.letters
    assert "To: a@example.org, b@example.org" in letter and "This is a test" in letter and "Versuch" in letter


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
