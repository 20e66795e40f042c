"""Half-open and slow connections over real sockets: they end, they are few, and a stop is heard meanwhile."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import os
import re
import resource
import select
import socket
import ssl
import statistics
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import Scene
from support.live.browser import ROOT
from support.live.ports import free_port

from controller.api.connections import (
    BODY_S,
    HEADER_S,
    MAX_FILES,
    SLACK,
    SLOWEST_BYTES_S,
    Connections,
    Limits,
)
from controller.ipc.control_socket import control_path
from controller.service.socket_server import Server

HANGS_S = 90.0  # no test is meant to come near
HALF = b"POST /api/v1/cycle/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Some: h"
SLOW = b"POST /api/v1/session HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 90\r\n\r\n{"
SENT = (b"", HALF, SLOW)
HELLO = b"\x16\x03\x01\x02\x00\x01\x00"  # a handshake of TLS that announces more than comes
FLOOD = 2000  # connections
GOES_ON = """
import collections, contextlib, socket, ssl, sys
port, sent, tls = sys.argv[1:]
wrap = ssl._create_unverified_context().wrap_socket if tls else lambda one: one
kept, opened = collections.deque(maxlen=200), 0  # those that fall out are closed
while True:
    with contextlib.suppress(OSError):
        one = wrap(socket.create_connection(("127.0.0.1", int(port)), timeout=5.0))
        one.sendall(sent.encode())
        kept.append(one)
        opened += 1
        if opened == 200:
            print("begun", flush=True)
"""
PART = round(10.0 * SLOWEST_BYTES_S)  # of a body
LIMITS = Limits(most=24, most_per_address=8, at_once=64, grace_s=0.05)


class Clock:
    """A loop's clock that can be put forward."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.ahead_s, real = 0.0, self.loop.time
        self.loop.time = lambda: real() + self.ahead_s  # type: ignore[method-assign]

    def forward(self, seconds: float) -> None:
        self.ahead_s += seconds
        self.loop.call_soon_threadsafe(lambda: None)  # it may sleep by the old time


class Counting(Connections):
    """It knows how much it has read from whom."""

    def __init__(self, limits: Limits) -> None:
        super().__init__(limits)
        self.read = Counter[int]()  # bytes, by the port of the other end

    def protocol(self, **wiring: Any) -> asyncio.Protocol:
        one: Any = super().protocol(**wiring)
        take = one.data_received

        def counted(data: bytes) -> None:
            take(data)
            self.read[one.transport.get_extra_info("peername")[1]] += len(data)

        one.data_received = counted
        return one  # type: ignore[no-any-return]


class Site:
    """A server in a thread, and its clock."""

    def __init__(self, app: Any, limits: Limits = LIMITS) -> None:
        self.clock, self.connections = Clock(), Counting(limits)
        self.server = self.connections.server(app, port=0, log_level="warning")
        self.thread = threading.Thread(target=self.clock.loop.run_until_complete, args=(self.server.serve(),))
        self.thread.start()
        until(lambda: self.server.started, "the server")
        self.port = self.server.listening.getsockname()[1]

    def connected(self, address: str = "127.0.0.1") -> socket.socket:
        return socket.create_connection(
            ("127.0.0.1", self.port), timeout=HANGS_S, source_address=(address, 0)
        )

    def open_ones(self) -> int:
        return len(self.server.server_state.connections)

    def has_read(self, one: socket.socket, count: int) -> None:
        """Wait for it."""
        until(lambda: self.connections.read[one.getsockname()[1]] >= count, f"{count} bytes to be read")

    def end(self) -> None:
        self.server.should_exit = True
        self.thread.join(HANGS_S)


def until(done: Any, what: str) -> None:
    give_up_s = time.monotonic() + HANGS_S
    while not done():
        assert time.monotonic() < give_up_s, f"waited for {what} in vain"
        time.sleep(0.01)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    made = Scene(tmp_path)
    asyncio.run(made.with_users())
    made.door.mode = "RUNNING"
    return made


@pytest.fixture
def site(scene: Scene) -> Iterator[Site]:
    made = Site(scene.app)
    yield made
    made.end()


def stop(port: int, token: str, tls: ssl.SSLContext | None = None) -> int:
    """Status of the answer to a stop by somebody who is logged in."""
    if tls is None:
        asked = http.client.HTTPConnection("127.0.0.1", port, timeout=HANGS_S)
    else:
        asked = http.client.HTTPSConnection("127.0.0.1", port, timeout=HANGS_S, context=tls)
    with contextlib.closing(asked):
        asked.request("POST", "/api/v1/cycle/stop", headers={"Authorization": f"Bearer {token}"})
        return asked.getresponse().status


def stop_s(port: int, token: str, door: FakeDoor, tls: ssl.SSLContext | None = None) -> float:
    """How long it takes."""
    door.mode, began_s = "RUNNING", time.monotonic()
    assert stop(port, token, tls) == 200
    return time.monotonic() - began_s


def resident_mb(pid: int) -> float:
    """Memory of a process."""
    told = Path(f"/proc/{pid}/status").read_text()
    return int(re.findall(r"VmRSS:\s*(\d+)", told)[0]) / 1024.0


def closed(one: socket.socket) -> bool:
    """Whether the other end has closed it; what it may have said before does not count."""
    with contextlib.suppress(ConnectionError):
        while select.select([one], [], [], 0.0)[0]:
            if not one.recv(4096):
                return True
        return False
    return True


def said_at_the_end(one: socket.socket) -> bytes:
    said = b""
    with contextlib.suppress(ConnectionError):
        while more := one.recv(4096):
            said += more
    return said


@pytest.mark.parametrize(
    "rest", [b"", b": y\r\nContent-Type: application/json\r\nContent-Length: 40\r\n\r\n{"]
)
def test_a_sender_that_falls_silent_is_told_so_and_one_that_said_nothing_is_not(
    site: Site, scene: Scene, rest: bytes
) -> None:
    token = f"Authorization: Bearer {scene.tokens['operate']}\r\nX-Some"
    silent, idle = site.connected(), site.connected()
    sent = HALF.replace(b"cycle/stop", b"control").replace(b"X-Some: h", token.encode()) + rest
    silent.sendall(sent)
    until(lambda: site.open_ones() == 2, "both")
    site.has_read(silent, len(sent))
    site.clock.forward(BODY_S + 1.0)
    said = said_at_the_end(silent)
    assert said.startswith(b"HTTP/1.1 408 ") and b"Connection: close" in said
    told = json.loads(said.partition(b"\r\n\r\n")[2])["error"]
    assert "fell silent" in told["sentence"] and told["key"] == "request_silent"
    assert said_at_the_end(idle) == b""
    until(lambda: site.open_ones() == 0, "the end")


@pytest.mark.parametrize("sent", [b"", HALF, b"GET / HTTP/1.1\r\n"])
def test_a_request_whose_header_does_not_come_is_ended(site: Site, sent: bytes) -> None:
    one = site.connected()
    one.sendall(sent)
    until(lambda: site.open_ones() == 1, "it")
    site.clock.forward(HEADER_S - 5.0)
    time.sleep(0.1)
    assert not closed(one), "it has its time"
    with contextlib.suppress(ConnectionError):
        one.sendall(b"e" if sent else b"")  # a header that drips earns none
    site.clock.forward(5.1)
    until(lambda: closed(one), "the end")
    until(lambda: site.open_ones() == 0, "the end")


def test_a_second_request_on_a_connection_that_was_answered_has_no_more_time(
    site: Site, scene: Scene
) -> None:
    one = site.connected()
    one.sendall(b"GET /api/v1/status HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    assert one.recv(4096).startswith(b"HTTP/1.1 401")
    one.sendall(HALF)
    site.clock.forward(HEADER_S + 0.1)
    until(lambda: closed(one), "the end")


def test_a_body_that_does_not_come_is_ended_and_one_that_comes_slowly_is_taken(
    site: Site, scene: Scene
) -> None:
    lines = (
        "POST /api/v1/control HTTP/1.1",
        "Host: 127.0.0.1",
        f"Authorization: Bearer {scene.tokens['operate']}",
        "Content-Type: application/json",
        f"Content-Length: {9 * PART}",
    )
    head = "\r\n".join((*lines, "", "")).encode()
    stalled, dripping, slow = site.connected(), site.connected(), site.connected()
    body = b'{"take_over": true}'.ljust(9 * PART)
    for one in (stalled, dripping, slow):
        one.sendall(head)
    for one in (stalled, dripping, slow):
        site.has_read(one, len(head))
    for k in range(9):  # each part earns 10 s, and comes after 8
        slow.sendall(body[PART * k : PART * (k + 1)])
        with contextlib.suppress(ConnectionError):
            dripping.sendall(b"x")
        site.has_read(slow, len(head) + PART * (k + 1))
        site.clock.forward(0.1 if k == 8 else BODY_S / 5.0)
    until(lambda: closed(dripping) and closed(stalled), "the ends")
    answer = b""
    while b"\r\n\r\n" not in answer:
        more = slow.recv(4096)
        assert more, "it was ended"
        answer += more
    assert answer.startswith(b"HTTP/1.1 200"), answer


def test_of_too_many_the_busiest_address_loses_its_oldest_half_open_ones(site: Site, scene: Scene) -> None:
    quiet = [site.connected("127.0.0.3") for _ in range(3)]
    flood = [site.connected("127.0.0.2") for _ in range(60)]
    for one in (*quiet, *flood):
        with contextlib.suppress(ConnectionError):
            one.sendall(HALF)
    until(lambda: site.open_ones() <= 3 + LIMITS.most_per_address, "the bound of an address")
    assert stop(site.port, scene.tokens["operate"]) == 200
    assert scene.door.moved == ["stop"]
    assert not any(map(closed, quiet)), "who is few loses nothing"
    until(lambda: sum(map(closed, flood)) == 60 - LIMITS.most_per_address, "their ends")
    assert all(map(closed, flood[: 60 - LIMITS.most_per_address])), "the oldest went first"


def test_from_many_addresses_there_are_no_more_than_all_together_may_be(site: Site, scene: Scene) -> None:
    many = [site.connected(f"127.0.1.{k + 1}") for k in range(70)]
    for one in many:
        with contextlib.suppress(ConnectionError):
            one.sendall(HALF)
    until(lambda: site.open_ones() <= LIMITS.most, "the bound of all")
    assert stop(site.port, scene.tokens["operate"]) == 200
    for one in many:
        one.close()


def test_who_listens_is_not_closed_for_those_who_come_half_open(site: Site, scene: Scene) -> None:
    from websockets.sync.client import connect

    token = {"Authorization": f"Bearer {scene.tokens['view']}"}
    with connect(f"ws://127.0.0.1:{site.port}/api/v1/events", additional_headers=token, proxy=None) as heard:
        heard.recv(HANGS_S)
        flood = [site.connected() for _ in range(40)]
        for one in flood:
            with contextlib.suppress(ConnectionError):
                one.sendall(HALF)
        until(lambda: site.open_ones() <= LIMITS.most_per_address, "the bound of an address")
        site.clock.forward(3.0 * BODY_S)
        until(lambda: site.open_ones() == 1, "the end of all the others")
        assert json.loads(heard.recv(HANGS_S))


@pytest.mark.parametrize("files", [128, 1024, 4096, MAX_FILES, 1_000_000])
def test_the_bounds_leave_files_for_everything_else(files: int) -> None:
    limits = Limits.within(files)
    assert limits.most_per_address < limits.most <= files // 2
    assert SLACK * limits.most + 1.5 * limits.at_once < 0.9 * files, "and those on their way in"


def test_the_unit_has_as_many_files_as_the_panel_wants() -> None:
    unit = (ROOT / "systemd" / "directrix-panel.service").read_text().splitlines()
    assert f"LimitNOFILE={MAX_FILES}" in unit


def secured(folder: Path) -> tuple[ssl.SSLContext, tuple[str, ...]]:
    """A certificate of this computer's own: who trusts it alone, and the options of the panel."""
    files = [str(folder / name) for name in ("own.pem", "key.pem")]
    made = ("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2")
    more = (
        "-subj",
        "/CN=panel",
        "-addext",
        "subjectAltName=IP:127.0.0.1",
        "-out",
        files[0],
        "-keyout",
        files[1],
    )
    subprocess.run(["openssl", *made, *more], check=True, capture_output=True)
    return ssl.create_default_context(cafile=files[0]), ("--tls-certificate", files[0], "--tls-key", files[1])


@contextlib.contextmanager
def panel_with_few_files(folder: Path, options: tuple[str, ...] = ()) -> Iterator[tuple[int, FakeDoor]]:
    """The command itself, as its unit starts it, with a limit of files that cannot be raised."""
    port, runtime, log = free_port(), folder / "run", folder / "panel.log"
    runtime.mkdir()
    door = FakeDoor()
    door.mode = "RUNNING"
    where = ("--state", str(folder), "--runtime", str(runtime), "--port", str(port), *options)
    with contextlib.closing(Server(control_path(runtime), door.answer)), open(log, "wb") as told:
        panel = subprocess.Popen(
            [sys.executable, "-m", "controller", "panel", "--no-page", *where],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=told,
            stderr=told,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (512, 512)),
        )
        try:
            until(lambda: answers(port, panel, log), "the panel")
            quiet_mb = resident_mb(panel.pid)
            yield port, door
            assert resident_mb(panel.pid) < quiet_mb + 100.0
        finally:
            panel.kill()
            panel.wait(HANGS_S)
    assert "rror" not in log.read_text() and "Traceback" not in log.read_text()


def assert_stops_are_heard(port: int, token: str, door: FakeDoor, tls: ssl.SSLContext | None) -> None:
    assert stop(port, token, tls) == 200, "right behind them"
    took_s = [stop_s(port, token, door, tls) for _ in range(20)]
    assert statistics.median(took_s) < 0.5, took_s
    assert set(door.moved) == {"stop"} and len(door.moved) == 21


@pytest.mark.slow
@pytest.mark.parametrize("with_tls", [False, True])
def test_a_logged_in_stop_is_heard_through_two_thousand_half_open_connections(
    with_tls: bool, tmp_path: Path, scene: Scene
) -> None:
    tls, options = secured(tmp_path) if with_tls else (None, ())
    sent = (b"", HELLO) if with_tls else SENT
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard < FLOOD + 500:
        pytest.skip(f"needs {FLOOD + 500} files for its own ends")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, FLOOD + 500), hard))
    flood = [socket.socket() for _ in range(FLOOD)]
    with panel_with_few_files(tmp_path, options) as (port, door):
        for one in flood:
            one.setblocking(False)
            one.connect_ex(("127.0.0.1", port))
        for kind, one in enumerate(flood):
            with contextlib.suppress(OSError):
                one.send(sent[kind % len(sent)])
        assert_stops_are_heard(port, scene.tokens["operate"], door, tls)
        for one in flood:
            one.close()


@pytest.mark.slow
@pytest.mark.parametrize("with_tls", [False, True])
def test_a_logged_in_stop_is_heard_while_half_requests_go_on_coming_from_its_own_address(
    with_tls: bool, tmp_path: Path, scene: Scene
) -> None:
    """As fast as a process can open them; with TLS their handshakes are finished."""
    tls, options = secured(tmp_path) if with_tls else (None, ())
    with panel_with_few_files(tmp_path, options) as (port, door):
        told = [str(port), HALF.decode(), "tls" * with_tls]
        flood = subprocess.Popen([sys.executable, "-c", GOES_ON, *told], stdout=subprocess.PIPE)
        try:
            assert flood.stdout is not None and flood.stdout.readline() == b"begun\n"
            assert_stops_are_heard(port, scene.tokens["operate"], door, tls)
            assert flood.poll() is None
        finally:
            flood.kill()
            flood.wait(HANGS_S)


def answers(port: int, panel: subprocess.Popen[bytes], log: Path) -> bool:
    assert panel.poll() is None, log.read_text()
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
        return True
    return False


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/api/v1/events", {}),
        ("/api/v1/events", {"Authorization": "Bearer wrong"}),
        ("/api/v1/events?topics=nothing", None),
        ("/api/v1/nothing", {}),
        ("/api/v1/status", {}),
    ],
)
def test_a_websocket_that_is_refused_writes_no_line(
    path: str, headers: dict[str, str] | None, site: Site, scene: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    token = {"Authorization": f"Bearer {scene.tokens['view']}"} if headers is None else headers
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{site.port}{path}", additional_headers=token, proxy=None).close()
    assert refused.value.response.status_code in (401, 403, 404, 422)
    until(lambda: site.open_ones() == 0, "its end")
    assert caplog.text == ""
