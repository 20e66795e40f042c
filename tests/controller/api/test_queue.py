"""The queue counts what ran whole, goes on by itself only while it may, and forgets nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from support.fakes.panels import Scene, sentence, take_control

from controller.api import go_on


class Shop:
    """A panel with programs a and b, somebody who holds control, and a machine that is ready."""

    def __init__(self, folder: Path, client: Any, scene: Scene) -> None:
        self.scene, self.client = scene, client
        scene.door.mode = "READY"
        for name in ("a.ngc", "b.ngc"):
            with scene.store.uploads.begin(name) as upload:
                upload.write(f"({name})\nM2\n".encode())
                upload.commit()

    async def add(self, program: str, count: int) -> Any:
        return await self.client.post("/api/v1/queue", json={"program": program, "count": count})

    async def told(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.client.get("/api/v1/queue")).json()
        return found

    async def counts(self) -> list[tuple[str, int, int]]:
        return [(one["program"], one["done"], one["count"]) for one in (await self.told())["entries"]]

    async def choose(self) -> None:
        answer = await self.client.put("/api/v1/queue/go_on", json={"on": True})
        assert answer.json()["go_on"] is True

    async def load(self) -> None:
        assert (await self.client.post("/api/v1/queue/load")).status_code == 200

    async def going(self, *entries: tuple[str, int]) -> None:
        """These are in the queue, the first is loaded, and it is to go on by itself."""
        for program, count in entries:
            await self.add(program, count)
        await self.choose()
        await self.load()

    async def ran(self, result: str = "completed") -> None:
        """The program that is loaded was started, and ended like that."""
        job = self.scene.door.job
        assert job is not None
        self.scene.history.run(job["name"], result)
        job["state"], self.scene.door.mode = result, "FAULT" if result == "fault" else "READY"
        await self.scene.panel.go_on.look()

    @property
    def moved(self) -> list[str]:
        """What was loaded and started, in order."""
        taken = [(verb, args) for verb, args in self.scene.door.asked if verb in ("load", "start")]
        return [args.get("name", verb) for verb, args in taken]


def in_shop(folder: Path, story: Callable[[Shop], Awaitable[None]]) -> None:
    async def told() -> None:
        scene = Scene(folder)
        async with scene.client() as client:
            await take_control(client)
            shop = Shop(folder, client, scene)
            await scene.panel.go_on.look()
            await story(shop)

    asyncio.run(told())


def test_each_whole_run_of_the_front_counts_and_no_other(tmp_path: Path) -> None:
    async def story(shop: Shop) -> None:
        await shop.add("a.ngc", 2)
        await shop.add("b.ngc", 1)
        await shop.load()
        for result in ("completed", "stopped", "fault", "lost", "completed"):
            await shop.ran(result)
        shop.scene.door.mode = "READY"
        assert await shop.counts() == [("a.ngc", 2, 2), ("b.ngc", 0, 1)]
        await shop.ran()  # once more, though it is done
        assert await shop.counts() == [("a.ngc", 2, 2), ("b.ngc", 0, 1)]
        await shop.load()
        assert shop.moved == ["a.ngc", "b.ngc"]
        await shop.ran()
        answer = await shop.client.post("/api/v1/queue/load")
        assert answer.status_code == 409 and "Nothing in the queue" in sentence(answer)

    in_shop(tmp_path, story)


def test_nothing_is_started_that_nobody_chose_to(tmp_path: Path) -> None:
    async def story(shop: Shop) -> None:
        await shop.add("a.ngc", 3)
        await shop.load()
        await shop.ran()
        assert shop.moved == ["a.ngc"]

    in_shop(tmp_path, story)


def test_it_goes_on_through_all_of_it_and_then_says_so(tmp_path: Path) -> None:
    async def story(shop: Shop) -> None:
        await shop.going(("a.ngc", 2), ("b.ngc", 1))
        for _ in range(3):
            await shop.ran()
        assert shop.moved == ["a.ngc", "a.ngc", "start", "b.ngc", "start"]
        told = await shop.told()
        assert (told["go_on"], told["next"], told["sentence"]) == (False, None, "The queue is done.")

    in_shop(tmp_path, story)


async def _stop(shop: Shop) -> None:
    await shop.client.post("/api/v1/cycle/stop")


async def _stop_of_a_phone(shop: Shop) -> None:
    shop.scene.door.mode = "RUNNING"
    await shop.client.post("/api/job", json={"command": "cancel"})


async def _other_holder(shop: Shop) -> None:
    await take_control(shop.client)


async def _nobody_holds(shop: Shop) -> None:
    await shop.client.delete("/api/v1/control")


async def _silence(shop: Shop) -> None:
    shop.scene.panel.control.heard_s -= go_on.SILENT_S + 1.0


async def _drives_off(shop: Shop) -> None:
    shop.scene.door.mode = "OFF"


async def _other_program(shop: Shop) -> None:
    await shop.client.post("/api/v1/job", json={"program": "b.ngc"})
    assert shop.scene.door.job is not None
    shop.scene.door.job["name"] = "b.ngc"


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (_stop, "stop"),
        (_stop_of_a_phone, "stop"),
        (_other_holder, "holds control no more"),
        (_nobody_holds, "holds control no more"),
        (_silence, "not heard of"),
    ],
)
def test_it_ends_where_anything_is_not_as_it_was(
    tmp_path: Path, act: Callable[[Shop], Awaitable[None]], why: str
) -> None:
    async def story(shop: Shop) -> None:
        await shop.going(("a.ngc", 3))
        await act(shop)
        await shop.ran()
        assert shop.moved == ["a.ngc"]
        told = await shop.told()
        assert told["go_on"] is False and why in told["sentence"] and told["key"]
        assert told["entries"][0]["done"] == 1  # it was a whole run all the same

    in_shop(tmp_path, story)


@pytest.mark.parametrize("result", ["fault", "stopped", "refused", "interrupted", "lost"])
def test_a_run_that_is_not_whole_ends_it(tmp_path: Path, result: str) -> None:
    async def story(shop: Shop) -> None:
        await shop.going(("a.ngc", 3))
        await shop.ran(result)
        assert shop.moved == ["a.ngc"] and "a.ngc ended" in (await shop.told())["sentence"]
        shop.scene.door.mode = "READY"
        await shop.ran()
        assert shop.moved == ["a.ngc"]

    in_shop(tmp_path, story)


def test_what_the_machine_refuses_ends_it_with_its_sentence(tmp_path: Path) -> None:
    async def story(shop: Shop) -> None:
        await shop.going(("a.ngc", 1), ("b.ngc", 1))
        shop.scene.store.programs.delete("b.ngc")
        await shop.ran()
        assert shop.moved == ["a.ngc"] and "b.ngc" in (await shop.told())["sentence"]

    in_shop(tmp_path, story)


@pytest.mark.parametrize("act", [_stop, _other_holder, _silence, _drives_off, _other_program])
def test_what_happens_while_the_next_is_read_keeps_it_from_starting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, act: Callable[[Shop], Awaitable[None]]
) -> None:
    async def story(shop: Shop) -> None:
        await shop.going(("a.ngc", 2))
        keep, turns = shop.scene.door._keep, iter(range(3))

        def slowly(verb: str, args: dict[str, Any]) -> None:
            keep(verb, args)
            if verb == "load":
                assert shop.scene.door.job is not None
                shop.scene.door.job["state"] = "loading"

        async def pause(_: float) -> None:
            if (turn := next(turns)) == 1:
                await act(shop)
            elif turn == 2:
                assert shop.scene.door.job is not None
                shop.scene.door.job["state"] = "loaded"

        monkeypatch.setattr(shop.scene.door, "_keep", slowly)
        monkeypatch.setattr(go_on.asyncio, "sleep", pause)
        await shop.ran()
        assert "start" not in shop.moved
        assert (await shop.told())["go_on"] is False

    in_shop(tmp_path, story)


def test_a_panel_that_is_restarted_counts_what_ended_meanwhile_and_starts_nothing(tmp_path: Path) -> None:
    async def story(shop: Shop) -> None:
        await shop.going(("a.ngc", 3))
        shop.scene.history.run("a.ngc")
        other = Scene(tmp_path, shop.scene.door)
        await other.panel.go_on.look()
        async with other.client() as client:
            told = (await client.get("/api/v1/queue")).json()
        assert (told["go_on"], told["entries"][0]["done"]) == (False, 1)
        assert shop.moved == ["a.ngc"]

    in_shop(tmp_path, story)


def test_entries_are_moved_changed_taken_out_and_follow_a_name(tmp_path: Path) -> None:
    async def story(shop: Shop) -> None:
        await shop.add("a.ngc", 1)
        await shop.add("b.ngc", 2)
        first, second = (one["id"] for one in (await shop.told())["entries"])
        await shop.client.patch(f"/api/v1/queue/{second}", json={"place": 0})
        await shop.client.patch(f"/api/v1/queue/{first}", json={"count": 7})
        await shop.client.patch("/api/v1/programs/a.ngc", json={"name": "c.ngc"})
        assert await shop.counts() == [("b.ngc", 0, 2), ("c.ngc", 0, 7)]
        await shop.client.delete(f"/api/v1/queue/{second}")
        assert await shop.counts() == [("c.ngc", 0, 7)]
        for path in (f"/api/v1/queue/{second}", "/api/v1/queue/999"):
            assert (await shop.client.delete(path)).status_code == 404

    in_shop(tmp_path, story)


def test_what_cannot_be_queued_is_refused(tmp_path: Path) -> None:
    async def story(shop: Shop) -> None:
        assert (await shop.add("nobody.ngc", 1)).status_code == 404
        for count in (0, -1, 10_001, 1.5):
            assert (await shop.add("a.ngc", count)).status_code == 422
        for _ in range(100):
            assert (await shop.add("a.ngc", 1)).status_code == 201
        assert (await shop.add("a.ngc", 1)).status_code == 429

    in_shop(tmp_path, story)
