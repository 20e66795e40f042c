"""Programs of the store as REST has them, while others change what is asked for."""

from __future__ import annotations

import asyncio
import os
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import Scene, sentence

from controller.api import service_client
from controller.api.checker import Checker
from controller.api.routes import programs, records
from controller.api.store import Store, StoreError
from controller.ipc.control_socket import CommandRefused

TEXT = b"G1 X10 F100\nM2\n"
NAME = "é.ngc"
ELSEWHERE = unicodedata.normalize("NFD", NAME)  # as other computers write the same letters


def put(store: Store, name: str, text: bytes = TEXT) -> None:
    with store.uploads.begin(name) as upload:
        upload.write(text)
        upload.commit()


class Silent(FakeDoor):
    """A service that hangs, as its socket tells it."""

    code = "silent"

    def answer(self, verb: str, args: dict[str, Any]) -> dict[str, Any]:
        raise CommandRefused(self.code, "No answer.")


async def changes(client: httpx.AsyncClient) -> list[httpx.Response]:
    """Everything that could take the content of part.ngc away."""
    file = {"files": {"file": ("part.ngc", b"M30\n")}}
    return [
        await client.post("/api/v1/programs", **file),  # type: ignore[arg-type]
        await client.post("/api/files/local", **file),  # type: ignore[arg-type]
        await client.patch("/api/v1/programs/part.ngc", json={"name": "other.ngc"}),
        await client.delete("/api/v1/programs/part.ngc"),
    ]


@pytest.mark.parametrize("code", ["silent", "refused", "busy"])
def test_nothing_is_changed_while_a_service_does_not_say_what_it_uses(tmp_path: Path, code: str) -> None:
    async def story() -> None:
        scene = Scene(tmp_path, Silent())
        scene.door.code = code  # type: ignore[attr-defined]
        put(scene.store, "part.ngc")
        async with scene.client() as client:
            for answer in await changes(client):
                assert answer.status_code in (409, 503), answer.text
                assert "No answer." in sentence(answer)
        assert [program.name for program in scene.store.programs.list()] == ["part.ngc"]
        assert not list(scene.store.programs.incoming.iterdir())

    asyncio.run(story())


def test_an_upload_is_refused_while_what_is_used_cannot_be_asked_behind_a_crowd(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def never() -> frozenset[str]:
        await asyncio.Event().wait()
        return frozenset()

    async def story() -> None:
        scene = Scene(tmp_path)
        monkeypatch.setattr(scene.panel.watch, "in_use", never)
        async with scene.client() as client:
            answer = await client.post("/api/v1/programs", files={"file": ("part.ngc", b"M30\n")})
        assert answer.status_code == 503 and "gives no answer" in sentence(answer)
        assert not scene.store.programs.list() and not list(scene.store.programs.incoming.iterdir())

    monkeypatch.setattr(programs, "IN_USE_S", 0.01)
    asyncio.run(story())


def test_a_service_that_is_gone_uses_nothing(tmp_path: Path) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        scene.door.there = False
        put(scene.store, "part.ngc")
        async with scene.client() as client:
            assert [answer.status_code for answer in await changes(client)] == [201, 201, 200, 404]

    asyncio.run(story())


def test_a_renamed_program_is_named_as_an_uploaded_one_would_be(tmp_path: Path) -> None:
    store = Store(tmp_path)
    put(store, "a.ngc")
    assert store.programs.rename("a.ngc", ELSEWHERE).name == NAME
    put(store, "b.ngc", b"M2\n")
    with pytest.raises(StoreError) as refused:
        store.programs.rename("b.ngc", ELSEWHERE)
    assert refused.value.code == "exists"
    assert store.programs.rename(NAME, ELSEWHERE).name == NAME


@pytest.mark.parametrize(
    "change", [lambda store: store.programs.delete("a"), lambda store: put(store, "a", b"M30\n")]
)
def test_an_opened_program_is_read_to_its_end_whatever_becomes_of_its_name(
    tmp_path: Path, change: Callable[[Store], None]
) -> None:
    store = Store(tmp_path)
    put(store, "a")
    program, file = store.programs.opened("a")
    change(store)
    assert not store.programs.path(program.sha256).exists()
    with file:
        assert file.read() == TEXT


def test_a_text_that_is_deleted_while_it_is_sent_arrives_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene(tmp_path)
    put(scene.store, "a")

    async def deleted(self: records.Opened, *args: Any) -> None:
        scene.store.programs.delete("a")
        await send(self, *args)

    async def story() -> None:
        async with scene.client() as client:
            answer = await client.get("/api/v1/programs/a/text", headers={"Range": "bytes=3-"})
            assert (answer.status_code, answer.content) == (206, TEXT[3:])
            assert (await client.get("/api/v1/programs/a/text")).status_code == 404

    send = records.Opened.__call__
    monkeypatch.setattr(records.Opened, "__call__", deleted)
    asyncio.run(story())


def test_a_recording_that_goes_with_the_oldest_is_missing_and_no_mistake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene(tmp_path)
    folder = scene.panel.recordings / "one"
    folder.mkdir(parents=True)
    (folder / "fault.json").write_text("{}")
    listed = records.files_of(scene.panel.recordings, "one")
    (folder / "fault.json").unlink()
    monkeypatch.setattr(records, "files_of", lambda *_: listed)

    async def story() -> None:
        async with scene.client() as client:
            answer = await client.get("/api/v1/recordings")
            assert answer.json()["recordings"] == [{"name": "one", "files": ["fault.json"], "bytes": 0}]
            assert (await client.get("/api/v1/recordings/one/fault.json")).status_code == 404

    asyncio.run(story())


def test_a_half_upload_of_a_dead_process_of_root_is_swept_by_the_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("controller.api.uploads.JUST_MADE_S", -1.0)
    store = Store(tmp_path)
    with store.uploads.begin("a") as upload:
        upload.write(TEXT)
        (half,) = store.programs.incoming.iterdir()
        assert half.stat().st_mode & 0o777 == 0o640
    half.write_bytes(TEXT)
    opened = os.open

    def of_the_group(path: Any, flags: int, *more: Any, **named: Any) -> int:
        if flags & (os.O_RDWR | os.O_WRONLY) and Path(path) == half:
            raise PermissionError(13, "Permission denied")
        return opened(path, flags, *more, **named)

    monkeypatch.setattr(os, "open", of_the_group)
    assert store.sweep() == 1 and not half.exists()


def test_a_program_that_is_not_as_it_was_uploaded_is_given_to_nobody(tmp_path: Path) -> None:
    """Neither to be read, nor to be checked, nor as a sub of another; uploaded again it is whole."""

    async def story() -> None:
        scene = Scene(tmp_path)
        store = scene.store
        put(store, "main.ngc", b"O<hole> CALL\nM2\n")
        put(store, "hole.ngc", b"O<hole> SUB\nG1 X10 F100\nO<hole> ENDSUB\n")
        main, hole = store.programs.get("main.ngc"), store.programs.get("hole.ngc")
        assert store.programs.called(main) == {"hole.ngc": str(store.programs.path(hole.sha256))}
        file = store.programs.path(hole.sha256)
        text = file.read_bytes()
        file.write_bytes(text.replace(b"X10", b"X90"))
        async with scene.client() as client:
            got = await client.get("/api/v1/programs/hole.ngc/text")
            assert got.status_code == 503 and "not as it was uploaded" in sentence(got)
        with pytest.raises(StoreError, match=hole.sha256):
            await service_client.load(store, scene.door, "main.ngc")
        assert not [args for verb, args in scene.door.asked if verb == "load"]
        for program in (main, hole):
            state, result = Checker(store)._checked(program, "0" * 64)
            assert state == "failed" and result["key"] == "program_damaged"
        put(store, "hole.ngc", text)
        assert store.programs.read(hole.sha256) == text

    asyncio.run(story())
