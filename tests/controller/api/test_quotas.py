"""One asker's crowd of uploads, checks or drafts keeps nobody else from his turn."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes.panels import Scene, sentence

from controller.api import quotas
from controller.api.answers import Refusal
from controller.api.checker import Checker, Errand
from controller.api.quotas import MAX_CHECKS, MAX_UPLOADS, Quota, Turns
from controller.machine import machine_file, setup_data

HANGS = (sys.executable, "-c", "import time; time.sleep(600)")


def test_uploads_of_one_are_bounded_and_another_uploads_meanwhile(tmp_path: Path) -> None:
    async def story() -> None:
        scene, go = await Scene(tmp_path).with_users(), asyncio.Event()
        head = b'--x\r\ncontent-disposition: form-data; name="file"; filename="%d.ngc"\r\n\r\n'

        async def slow(number: int) -> AsyncIterator[bytes]:
            yield head % number + b"G0 X1\n"
            await go.wait()
            yield b"M2\n\r\n--x--\r\n"

        async def upload(client: Any, number: int, body: Any) -> Any:
            sent = {"Content-Type": "multipart/form-data; boundary=x"}
            return await client.post("/api/v1/programs", content=body, headers=sent)

        async with (
            scene.client("operate", peer="10.0.0.7") as one,
            scene.client("operate", peer="10.0.0.8") as elsewhere,
            scene.client("set_up", peer="10.0.0.7") as other,
        ):
            begun = [asyncio.create_task(upload(one, n, slow(n))) for n in range(MAX_UPLOADS)]
            await asyncio.sleep(0.05)
            refused = await upload(one, 90, head % 90 + b"M2\n\r\n--x--\r\n")
            assert refused.status_code == 429 and str(MAX_UPLOADS) in sentence(refused)
            assert refused.headers["Retry-After"] == "1"
            for number, client in ((91, elsewhere), (92, other)):
                assert (await upload(client, number, head % number + b"M2\n\r\n--x--\r\n")).status_code == 201
            go.set()
            assert [task.status_code for task in await asyncio.gather(*begun)] == [201] * MAX_UPLOADS
            assert (await upload(one, 93, head % 93 + b"M2\n\r\n--x--\r\n")).status_code == 201

    asyncio.run(story())


def test_checks_of_one_are_bounded_and_another_is_next(tmp_path: Path) -> None:
    setup_data.note(tmp_path, machine_file.load("trunnion"))

    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        scene.panel.checker = checker = Checker(scene.store, HANGS)
        names = [f"{n}.ngc" for n in range(MAX_CHECKS + 3)]
        for name in names:
            with scene.store.uploads.begin(name) as upload:
                upload.write(f"({name})\nM2\n".encode())
                upload.commit()
        try:
            async with (
                scene.client("operate") as crowd,
                scene.client("set_up") as other,
            ):
                said = [await crowd.post(f"/api/v1/programs/{name}/check") for name in names[:-1]]
                assert [one.status_code for one in said[:MAX_CHECKS]] == [202] * MAX_CHECKS
                assert said[-1].status_code == 429 and str(MAX_CHECKS) in sentence(said[-1])
                assert (await other.post(f"/api/v1/programs/{names[-1]}/check")).status_code == 202
        finally:
            checker.close()

    asyncio.run(story())


def test_askers_take_turns() -> None:
    turns = Turns[str]()
    for n in range(3):
        turns.put(("a", "1"), f"a{n}")
    for owner, one in ((("b", "1"), "b0"), (("a", "2"), "c0"), (("b", "1"), "b1")):
        turns.put(owner, one)
    assert turns.count(("a", "1")) == 3
    assert [turns.take() for _ in range(6)] == ["a0", "b0", "c0", "a1", "b1", "a2"]
    turns.end()
    assert turns.take() is None


def test_a_quota_is_given_back_whatever_ends_it() -> None:
    quota = Quota("upload_many_of_one", 1)
    for _ in range(3):
        with pytest.raises(KeyError), quota.held(("a", "1")):
            with pytest.raises(Refusal), quota.held(("a", "1")):
                raise AssertionError
            with quota.held(("a", "2")):
                raise KeyError
    assert not quota._held


def test_what_is_worked_out_for_one_keeps_no_other_waiting(tmp_path: Path) -> None:
    async def story() -> None:
        errand = Errand(HANGS, 600.0)
        one, two = ("anna", "1"), ("bert", "1")
        busy, failed = KeyError("busy"), OSError("failed")
        first = asyncio.create_task(errand.run({}, busy, failed, one))
        await asyncio.sleep(0.05)
        with pytest.raises(KeyError):
            await errand.run({}, busy, failed, one)
        second = asyncio.create_task(errand.run({}, busy, failed, two))
        await asyncio.sleep(0.05)
        assert not second.done()
        for task in (first, second):
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
        await asyncio.sleep(0.1)  # their pipes are closed by the loop
        assert quotas.NOBODY not in errand._busy and not errand._busy

    asyncio.run(story())
