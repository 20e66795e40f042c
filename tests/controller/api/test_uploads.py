"""Uploads that mean harm or had bad luck: nothing outside of the store, no half file, a sentence each."""

from __future__ import annotations

import asyncio
import hashlib
import os
import random
import resource
import subprocess
import sys
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.fakes.hostile_requests import (
    HOSTILE_NAMES,
    SOUND_NAMES,
    TEXT,
    Sent,
    an_upload,
    assert_whole,
    form,
)
from support.suite.seed import SEED

from controller.api import multipart, names
from controller.api.multipart import Received
from controller.api.store import Store, StoreError, UploadLimits

# Patient: on a busy computer nothing is refused as too slow that is not about that.
LIMITS = UploadLimits(most_bytes=20_000, free_bytes=0, at_once=4)
CODES = {"name", "size", "cut", "sha256", "empty", "form", "slow", "many", "space", "running"}


class Gone(Exception):
    """The sender is gone."""


async def stream(sent: Sent) -> AsyncIterator[bytes]:
    for at in range(0, len(sent.body), sent.chunk):
        if sent.cut is not None and at >= sent.cut:
            raise Gone
        if sent.pause_s:
            await asyncio.sleep(sent.pause_s)
        yield sent.body[at : at + sent.chunk]
    if sent.cut is not None and sent.cut >= len(sent.body):
        raise Gone


async def receive(store: Store, sent: Sent, in_use: tuple[str, ...] = ()) -> Received:
    return await multipart.receive(stream(sent), sent.content_type, store.uploads, "test", lambda: in_use)


def send(store: Store, sent: Sent, in_use: tuple[str, ...] = ()) -> Received:
    return asyncio.run(receive(store, sent, in_use))


def refused(store: Store, sent: Sent, in_use: tuple[str, ...] = ()) -> str:
    """The code of the refusal, after a look that nothing was kept by it."""
    before = tree(store.folder)
    with pytest.raises(StoreError) as error:
        send(store, sent, in_use)
    assert tree(store.folder) == before
    assert len(str(error.value)) < 500
    assert str(error.value).isascii() or names.check(str(error.value).split(":")[0])
    return error.value.code


def tree(folder: Path) -> set[str]:
    return {p.as_posix() for p in folder.rglob("*") if "store.sqlite-" not in p.name}


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "inside" / "state", LIMITS)


@pytest.mark.parametrize("name", HOSTILE_NAMES, ids=lambda name: ascii(name)[:30])
def test_a_hostile_name_is_refused_with_a_sentence(store: Store, name: str) -> None:
    with pytest.raises(StoreError, match="allowed: up to 120") as error:
        names.check(name)
    assert error.value.code == "name"
    assert str(error.value).isascii() and str(error.value).isprintable()
    assert refused(store, Sent(form(name))) in ("name", "form")
    assert refused(store, Sent(form("part.ngc", name=name[:500] or "."))) == "name"
    assert_whole(store)


@pytest.mark.parametrize("name", SOUND_NAMES)
def test_a_sound_name_stays_as_it_is(store: Store, name: str) -> None:
    assert send(store, Sent(form(name))).program.name == name
    assert store.programs.get(name).size == len(TEXT)
    assert_whole(store)


def test_two_spellings_of_one_letter_are_one_name(store: Store) -> None:
    assert names.check("u\u0308") == names.check("\u00fc") == "\u00fc"


def test_a_file_comes_with_its_sum_before_or_behind_it(store: Store) -> None:
    right = hashlib.sha256(TEXT).hexdigest()
    assert send(store, Sent(form("a", sha256=right.upper()))).program.sha256 == right
    assert send(store, Sent(form("b", checksum=right, print="true"))).fields["print"] == "true"
    behind = form("c")[: -len(b"--frontier--\r\n")] + form("x", sha256=right).split(b"--frontier\r\n", 1)[0]
    behind += b'--frontier\r\ncontent-disposition: form-data; name="sha256"\r\n\r\n' + b"0" * 64
    assert refused(store, Sent(behind + b"\r\n--frontier--\r\n")) == "sha256"
    assert_whole(store)


def test_a_wrong_sum_or_size_keeps_nothing(store: Store) -> None:
    assert refused(store, Sent(form("a", sha256="0" * 64))) == "sha256"
    assert refused(store, Sent(form("a", sha256="xyz"))) == "sha256"
    assert refused(store, Sent(form("a", size=str(len(TEXT) + 1)))) == "cut"
    assert refused(store, Sent(form("a", size="-1"))) == "form"
    assert refused(store, Sent(form("a", b""))) == "empty"
    assert send(store, Sent(form("a", size=str(len(TEXT))))).program.size == len(TEXT)


def test_a_file_beyond_the_cap_is_refused_while_it_comes(store: Store) -> None:
    assert refused(store, Sent(form("a", b"x" * 20_001))) == "size"
    assert refused(store, Sent(form("a", b"x" * 90_000))) == "size"
    assert send(store, Sent(form("a", b"x" * 20_000))).program.size == 20_000


@pytest.mark.parametrize("cut", [0, 1, 30, 100, 10_000, 19_990, 10**6])
def test_a_sender_that_goes_away_leaves_nothing(store: Store, cut: int) -> None:
    before = tree(store.folder)
    with pytest.raises(Gone):
        send(store, Sent(form("a", b"x" * 19_900), cut=cut, chunk=512))
    assert tree(store.folder) == before


@pytest.mark.parametrize("left", [0, 1, 12, 14, 20, 60, 100])
def test_a_body_that_is_cut_short_but_ended_leaves_nothing(store: Store, left: int) -> None:
    body = form("a")
    assert refused(store, Sent(body[: min(left, len(body) - 5)])) == "form"


@pytest.mark.parametrize(
    "content_type",
    [
        "",
        "text/plain",
        "multipart/form-data",
        "multipart/form-data; boundary=",
        "multipart/mixed; boundary=frontier",
        f"multipart/form-data; boundary={'x' * 5000}",
        "multipart/form-data; boundary=other",
    ],
    ids=lambda kind: kind[:40],
)
def test_what_is_not_a_form_is_refused(store: Store, content_type: str) -> None:
    assert refused(store, Sent(form("a"), content_type)) == "form"


def test_a_form_with_too_much_in_it_is_refused(store: Store) -> None:
    two = form("a")[: -len(b"--frontier--\r\n")] + form("b")
    assert refused(store, Sent(two)) == "form"
    assert refused(store, Sent(form("a", **{f"f{i}": "x" for i in range(40)}))) == "form"
    assert refused(store, Sent(form("a", note="x" * 5000))) == "form"
    assert refused(store, Sent(b"--frontier--\r\n")) == "form"


def test_a_sender_slower_than_the_slowest_pace_is_refused(tmp_path: Path) -> None:
    store = Store(tmp_path / "inside" / "state", replace(LIMITS, patience_s=0.2, slowest_bytes_s=1e6))
    assert refused(store, Sent(form("a"), pause_s=0.1, chunk=20)) == "slow"


def test_the_running_program_is_not_overwritten_and_goes_on(store: Store) -> None:
    first = send(store, Sent(form("a"))).program
    assert refused(store, Sent(form("a", b"M30\n")), in_use=("a",)) == "running"
    assert store.programs.get("a") == first
    assert send(store, Sent(form("b", b"M30\n")), in_use=("a",)).program.name == "b"
    assert_whole(store)


def test_more_uploads_at_once_than_allowed_are_refused_and_places_come_back(store: Store) -> None:
    async def all_at_once() -> list[Received | BaseException]:
        forms = [form(f"p{i}", TEXT * 40) for i in range(10)]  # none ends before the last has begun
        sent = [receive(store, Sent(body, pause_s=0.02, chunk=100)) for body in forms]
        return list(await asyncio.gather(*sent, return_exceptions=True))

    for _ in range(2):
        answers = asyncio.run(all_at_once())
        assert {a.code for a in answers if isinstance(a, StoreError)} == {"many"}
        assert sum(isinstance(a, Received) for a in answers) == LIMITS.at_once
    assert_whole(store)


def test_a_disk_that_is_nearly_full_is_said_before_the_file_is_taken(
    tmp_path: Path,
) -> None:
    store = Store(tmp_path / "inside" / "state", UploadLimits(free_bytes=1 << 60))
    assert refused(store, Sent(form("a"))) == "space"


FULL_DISK = """
import resource, sys
from pathlib import Path
from controller.api.store import Store, StoreError, UploadLimits
store = Store(Path(sys.argv[1]), UploadLimits(free_bytes=0))
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
try:
    with store.uploads.begin("big") as upload:
        for _ in range(100):
            upload.write(b"x" * 10_000)
        upload.commit()
except StoreError as error:
    print(error.code)
with store.uploads.begin("small") as upload:
    upload.write(b"M2\\n")
    upload.commit()
"""


def test_a_disk_that_refuses_in_the_midst_keeps_nothing_and_the_next_file_fits(tmp_path: Path) -> None:
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] in (-1, resource.RLIM_INFINITY)
    folder = tmp_path / "inside" / "state"
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(folder)],
        env={**os.environ, "PYTHONPATH": os.getcwd()},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout.split() == ["space"], done.stderr
    store = Store(folder)
    assert [program.name for program in store.programs.list()] == ["small"]
    assert_whole(store)


# ---- thousands of them


async def attack(store: Store, draw: random.Random, many: int) -> int:
    """Send them, four at once; how many were kept."""
    kept = 0
    for _ in range(0, many, LIMITS.at_once):
        batch = [receive(store, an_upload(draw), ("p1",)) for _ in range(LIMITS.at_once)]
        for answer in await asyncio.gather(*batch, return_exceptions=True):
            kept += isinstance(answer, Received)
            if isinstance(answer, StoreError):
                assert answer.code in CODES, answer
                assert str(answer).isprintable(), answer
            else:
                assert isinstance(answer, Received | Gone), repr(answer)
    return kept


def run_attack(folder: Path, seed: int, many: int) -> None:
    print(f"seed {seed}")
    store = Store(folder, LIMITS)
    with store.uploads.begin("p1") as upload:
        upload.write(b"M30\n")
        first = upload.commit()
    kept = asyncio.run(attack(store, random.Random(seed), many))
    assert 0.02 * many < kept < 0.6 * many, f"seed {seed}: {kept} of {many} kept"
    assert store.programs.get("p1") == first
    assert_whole(store)


def test_hundreds_of_hostile_uploads_leave_the_store_whole(tmp_path: Path) -> None:
    run_attack(tmp_path / "inside" / "state", 5, 200)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(5))
def test_thousands_of_hostile_uploads_leave_the_store_whole(part: int, tmp_path: Path) -> None:
    run_attack(tmp_path / "inside" / "state", SEED + 10 * part, 500)


@pytest.mark.soak
def test_ten_thousand_hostile_uploads_leave_the_store_whole(tmp_path: Path) -> None:
    run_attack(tmp_path / "inside" / "state", SEED + 1, 10_000)
