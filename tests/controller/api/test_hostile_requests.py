"""Requests that mean harm, through the whole application: no error of its own, nothing outside of the store.

Truncated, slow, huge, parallel, with a full disk, with names that are paths: in uploads, in
addresses and in what others are renamed to.
"""

from __future__ import annotations

import asyncio
import errno
import json
import random
import shutil
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote_from_bytes

import pytest
from support.fakes.hostile_requests import SOUND_NAMES, TEXT, Sent, a_name, an_upload, assert_whole, form
from support.fakes.panels import Scene
from support.suite.seed import SEED

from controller.api import uploads
from controller.api.store import Store, UploadLimits

LIMITS = UploadLimits(most_bytes=20_000, free_bytes=0, at_once=4, patience_s=0.3, slowest_bytes_s=1e6)
AT_ONCE = 8  # requests
# 507: the disk is full. Everything else says what was wrong with the request.
ANSWERS = {200, 201, 202, 204, 404, 405, 408, 409, 413, 422, 429, 507}
NAMED = (
    "/programs/{}",
    "/programs/{}/text",
    "/programs/{}/check",
    "/recordings/{}/frames.log",
    "/recordings/x/{}",
)
UPLOADS = ("/api/v1/programs", "/api/files/local")


@dataclass
class Asked:
    """A request: its body in chunks, with pauses, and perhaps a sender that goes away."""

    method: str
    path: bytes  # as it stands in the request, percent-encoded or not
    body: Sent = field(default_factory=lambda: Sent(b"", ""))
    length: int | None = None  # announced, if at all


class Disk:
    """A disk that is full now and then."""

    def __init__(self, draw: random.Random) -> None:
        self._draw = draw
        self.share = 0.0  # of refused writes

    def full(self) -> bool:
        return self._draw.random() < self.share

    def usage(self, folder: Path) -> Any:
        found = shutil.disk_usage(folder)
        return found._replace(free=0) if self.full() else found

    def fsync(self, handle: int) -> None:
        if self.full():
            raise OSError(errno.ENOSPC, "No space left on device")


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    made = Disk(random.Random(SEED))
    monkeypatch.setattr(uploads, "shutil", _With(shutil, disk_usage=made.usage))
    monkeypatch.setattr(uploads, "os", _With(uploads.os, fsync=made.fsync))
    yield made


class _With:
    """A module with some functions replaced, for one who imports it."""

    def __init__(self, module: Any, **others: Any) -> None:
        self.__dict__.update(vars(module), **others)


async def ask(app: Any, asked: Asked) -> tuple[int, bytes]:
    """Status and body of the answer, whether or not the sender is there to read it."""
    headers = [
        (b"host", b"127.0.0.1:8080"),
        (b"content-type", asked.body.content_type.encode("latin-1", "replace")),
    ]
    if asked.length is not None:
        headers.append((b"content-length", str(asked.length).encode()))
    path = asked.path.decode("latin-1")
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": asked.method,
        "scheme": "http",
        "path": _unquoted(asked.path),
        "raw_path": path.encode("latin-1"),
        "query_string": b"",
        "headers": headers,
        "client": ("127.0.0.1", 50000),
        "server": ("127.0.0.1", 8080),
    }
    messages, told = _messages(asked.body), []

    async def receive() -> dict[str, Any]:
        return await anext(messages)

    async def send(message: dict[str, Any]) -> None:
        told.append(message)

    await app(scope, receive, send)
    return int(told[0]["status"]), b"".join(message.get("body", b"") for message in told[1:])


def _unquoted(path: bytes) -> str:
    from urllib.parse import unquote_to_bytes

    return unquote_to_bytes(path).decode("utf-8", "replace")


async def _messages(sent: Sent) -> AsyncIterator[dict[str, Any]]:
    for at in range(0, len(sent.body), sent.chunk):
        if sent.cut is not None and at >= sent.cut:
            break
        if sent.pause_s:
            await asyncio.sleep(sent.pause_s)
        yield {"type": "http.request", "body": sent.body[at : at + sent.chunk], "more_body": True}
    if sent.cut is None:
        yield {"type": "http.request", "body": b"", "more_body": False}
    while True:
        yield {"type": "http.disconnect"}


# ---- what is asked


def an_attack(draw: random.Random) -> Asked:
    kind = draw.random()
    if kind < 0.45:
        return _sent_to(draw, an_upload(draw))
    if kind < 0.55:  # nothing is wrong with it
        name, text = draw.choice([*SOUND_NAMES, "p1", "p2"]), b"G4 P1\n" * draw.randrange(1, 3000)
        return _sent_to(draw, Sent(form(name, text)))
    if kind < 0.65:
        return _sent_to(draw, _huge(draw))
    if kind < 0.655:
        return _sent_to(draw, Sent(form(a_name(draw), TEXT * 20), pause_s=0.1, chunk=20))
    if kind < 0.85:
        method = draw.choice(["GET", "DELETE", "POST", "PUT", "HEAD", "GET"])
        return Asked(method, b"/api/v1" + _in_path(draw, draw.choice(NAMED)))
    renamed = {"name": a_name(draw)}
    body = json.dumps(renamed, ensure_ascii=draw.random() < 0.5).encode("utf-8", "surrogatepass")
    return Asked(
        "PATCH", b"/api/v1/programs/" + draw.choice([b"p1", b"p2", b"p3"]), Sent(body, "application/json")
    )


def _sent_to(draw: random.Random, sent: Sent) -> Asked:
    true = len(sent.body)
    length = draw.choice([None, true, true, 10**12, 0, 1])
    return Asked("POST", draw.choice(UPLOADS).encode(), sent, length)


def _huge(draw: random.Random) -> Sent:
    """A file, a field or a header that never ends."""
    big = b"x" * draw.choice([20_001, 200_000])
    whole = form("p2", big)
    field_of_it = form("p3", TEXT, note="x" * 30_000)
    head = b'--frontier\r\ncontent-disposition: form-data; name="file"; filename="' + big + b'"\r\n\r\n'
    return Sent(draw.choice([whole, field_of_it, head]), chunk=draw.choice([4096, 65536]))


def _in_path(draw: random.Random, pattern: str) -> bytes:
    """A name in an address: encoded as it should be, half, or not at all."""
    name = a_name(draw).encode("utf-8", "surrogateescape")
    safe = draw.choice(["", "/", "/.%\\", "/.%\\:?#*|<>'\""])
    return pattern.format(quote_from_bytes(name, safe)).encode("latin-1")


# ---- and what must hold


async def attack(scene: Scene, draw: random.Random, disk: Disk, many: int) -> Counter[int]:
    """Send them, some at once; how often each status came."""
    found: Counter[int] = Counter()
    for _ in range(0, many, AT_ONCE):
        disk.share = draw.choice([0.0, 0.0, 0.0, 0.5])
        batch = [an_attack(draw) for _ in range(AT_ONCE)]
        for asked, (status, body) in zip(
            batch, await asyncio.gather(*(ask(scene.app, one) for one in batch)), strict=True
        ):
            assert status in ANSWERS, (status, asked.method, asked.path[:200], body[:500])
            assert status < 400 or asked.method == "HEAD" or b'"sentence"' in body, (status, body[:200])
            found[status] += 1
    disk.share = 0.0
    return found


def run_attack(folder: Path, disk: Disk, seed: int, many: int) -> None:
    print(f"seed {seed}")
    scene = Scene(folder / "inside" / "state")
    scene.store.uploads = uploads.Uploads(scene.store.programs, LIMITS)
    outside = {path: path.read_bytes() for path in _outside(folder)}
    found = asyncio.run(_story(scene, random.Random(seed), disk, many))
    print(dict(found))
    assert found[201] and found[422], found
    assert not scene.door.moved, "nothing that is sent starts anything"
    assert_whole(scene.store)
    assert {path: path.read_bytes() for path in _outside(folder)} == outside


async def _story(scene: Scene, draw: random.Random, disk: Disk, many: int) -> Counter[int]:
    found = await attack(scene, draw, disk, many)
    for name in ("p1", "p2", "p3"):  # and it still takes what is sound
        status, body = await ask(scene.app, Asked("POST", b"/api/v1/programs", Sent(form(name, TEXT))))
        assert status == 201, body
    return found


def _outside(folder: Path) -> list[Path]:
    inside = folder / "inside" / "state"
    return sorted(path for path in folder.rglob("*") if path.is_file() and inside not in path.parents)


def test_some_hostile_requests_are_answered_and_leave_the_store_whole(tmp_path: Path, disk: Disk) -> None:
    run_attack(tmp_path, disk, SEED, 400)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_thousands_of_hostile_requests_are_answered_and_leave_the_store_whole(
    part: int, tmp_path: Path, disk: Disk
) -> None:
    run_attack(tmp_path, disk, SEED + 1 + 10 * part, 625)


@pytest.mark.soak
def test_ten_thousand_hostile_requests_are_answered_and_leave_the_store_whole(
    tmp_path: Path, disk: Disk
) -> None:
    run_attack(tmp_path, disk, SEED + 2, 10_000)


def test_a_store_is_found_not_whole_when_something_lies_beside_it(tmp_path: Path) -> None:
    """The look itself looks."""
    store = Store(tmp_path / "inside" / "state")
    assert_whole(store)
    (store.programs.folder / "half.ngc").write_bytes(b"G1")
    with pytest.raises(AssertionError):
        assert_whole(store)
