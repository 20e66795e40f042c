"""Events: everybody hears what changes, nobody slows the machine down, nobody without a right hears."""

from __future__ import annotations

import asyncio
import copy
import json
import random
import time
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import Scene
from support.suite import seed
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from controller.api import events
from controller.api.access import LOCAL
from controller.api.answers import Refusal
from controller.api.events import FOR_OPERATORS, INTERVAL_S, MAX_LISTENERS, MAX_OF_ONE, MAX_WAITING, Listener
from controller.api.roles import Principal, Role
from controller.api.routes import listen

TIMEOUT_S = 20.0


@asynccontextmanager
async def listening(scene: Scene, topics: str = "", **headers: str) -> AsyncIterator[ClientConnection]:
    """A listener over a real connection, to a real server on a free port."""
    server = uvicorn.Server(uvicorn.Config(scene.app, port=0, log_level="error"))
    serving = asyncio.create_task(server.serve())
    try:
        while not server.started:
            await asyncio.sleep(0.01)
        port = server.servers[0].sockets[0].getsockname()[1]
        where = f"ws://127.0.0.1:{port}/api/v1/events" + (f"?topics={topics}" if topics else "")
        async with connect(
            where, additional_headers=headers, proxy=None, open_timeout=TIMEOUT_S
        ) as connection:
            yield connection
    finally:
        server.should_exit = True
        await serving


async def next_of(connection: ClientConnection, event: str) -> Any:
    """The next event of that kind, with what came before it left out."""
    async with asyncio.timeout(TIMEOUT_S):
        while True:
            told = json.loads(await connection.recv())
            if told["event"] == event:
                return told["data"]


def test_a_listener_hears_the_status_over_and_over_and_the_job_and_the_alarm_when_they_change(
    tmp_path: Path,
) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with listening(scene) as heard:
            assert await next_of(heard, "service") == {"answers": True}
            assert (await next_of(heard, "status"))["mode"] == "OFF"
            assert (await next_of(heard, "status"))["mode"] == "OFF"
            scene.door.job = {"name": "part.ngc", "sha256": "0" * 64, "state": "running", "left_s": 9.0}
            assert await next_of(heard, "job") == {"name": "part.ngc", "sha256": "0" * 64, "state": "running"}
            scene.door.mode = "FAULT"
            assert (await next_of(heard, "alarm"))["name"] == "ESTOP"
            scene.history.alarm("ESTOP", "Emergency stop.")
            assert await next_of(heard, "alarms") == {"newest": 1}
            scene.door.there = False
            assert (await next_of(heard, "service"))["answers"] is False
            scene.panel.events.tell("control", {"holder": "anna"})
            assert await next_of(heard, "control") == {"holder": "anna"}

    asyncio.run(story())


def test_only_the_topics_asked_for_are_told(tmp_path: Path) -> None:
    async def story() -> list[str]:
        scene = Scene(tmp_path)
        async with listening(scene, "job,alarm") as heard:
            first = [json.loads(await heard.recv())["event"] for _ in range(2)]
            scene.door.mode = "FAULT"
            return [*first, json.loads(await heard.recv())["event"]]

    assert asyncio.run(story()) == ["alarm", "job", "alarm"]


@pytest.mark.parametrize(
    ("topics", "headers"),
    [
        ("nonsense", {}),
        ("", {"Origin": "http://evil.example"}),
        ("", {"Sec-Fetch-Site": "cross-site"}),
        ("", {"X-Forwarded-For": "192.168.1.7"}),
    ],
)
def test_a_foreign_page_or_an_unknown_topic_is_not_let_in(
    tmp_path: Path, topics: str, headers: dict[str, str]
) -> None:
    async def story() -> None:
        with pytest.raises(InvalidStatus):
            async with listening(Scene(tmp_path), topics, **headers):
                pass

    asyncio.run(story())


def test_with_users_a_token_is_needed_and_its_removal_ends_the_listening(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listen, "CHECK_S", 0.05)

    async def story() -> int:
        scene = await Scene(tmp_path).with_users()
        with pytest.raises(InvalidStatus):
            async with listening(scene):
                pass
        async with listening(scene, Authorization=f"Bearer {scene.tokens['view']}") as heard:
            await next_of(heard, "status")
            scene.store.users.remove_token("script-view")
            scene.panel.users.refresh()
            with pytest.raises(ConnectionClosed) as ended:
                await next_of(heard, "nothing")
            assert ended.value.rcvd is not None
            return ended.value.rcvd.code

    assert asyncio.run(story()) == listen.POLICY


def test_nothing_is_asked_of_the_machine_while_nobody_listens_and_once_for_twenty_who_do(
    tmp_path: Path,
) -> None:
    class Counting(FakeDoor):
        count = 0

        async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
            self.count += verb == "status"
            return await super().ask(verb, **args)

    async def story() -> tuple[int, int, float, list[int]]:
        door = Counting()
        scene = Scene(tmp_path, door)
        async with scene.panel.running():
            await asyncio.sleep(0.2)
            before = door.count
            events = scene.panel.events
            contexts = [events.listening(frozenset({"status"}), LOCAL) for _ in range(20)]
            listeners = [context.__enter__() for context in contexts]
            began_s = time.monotonic()
            heard = [await listener.next() for listener in listeners]
            await asyncio.sleep(0.5)
            took_s = time.monotonic() - began_s
            for context in contexts:
                context.__exit__(None, None, None)
        return before, door.count, took_s, [len(texts) for texts in heard]

    before, asked, took_s, heard = asyncio.run(story())
    assert before == 0
    assert heard == [1] * 20
    assert asked <= 5 + took_s / INTERVAL_S


def test_who_may_only_look_cannot_keep_out_who_operates_and_one_has_so_many_at_an_address(
    tmp_path: Path,
) -> None:
    told = Scene(tmp_path).panel.events
    anna, viewers = Principal("anna", Role.OPERATE, "session"), range(MAX_LISTENERS // MAX_OF_ONE)
    crowd = [(Principal(f"view {n}", Role.VIEW, "token"), f"10.0.0.{n}") for n in viewers]
    topics = frozenset({"status"})
    with ExitStack() as there:
        came = 0
        for who, address in crowd:
            for _ in range(MAX_OF_ONE + 1):
                try:
                    there.enter_context(told.listening(topics, who, address))
                    came += 1
                except Refusal as refusal:
                    assert refusal.status == 429
        assert came == MAX_LISTENERS - FOR_OPERATORS
        for _ in range(FOR_OPERATORS):
            there.enter_context(told.listening(topics, anna, "10.0.0.99"))
        with pytest.raises(Refusal):
            there.enter_context(told.listening(topics, anna, "10.0.0.99"))
    assert told.listeners == 0


def test_one_who_does_not_read_misses_statuses_first_and_is_let_go_when_too_much_waits() -> None:
    async def story() -> None:
        slow = Listener(frozenset({"status", "job"}))
        for i in range(10):
            slow.tell("status", f"status {i}")
            slow.tell("job", f"job {i}")
        assert await slow.next() == [*(f"job {i}" for i in range(10)), "status 9"]
        for i in range(MAX_WAITING + 1):
            slow.tell("job", f"job {i}")
        assert slow.lost

    asyncio.run(story())


def test_a_machine_at_rest_is_told_less_often_until_somebody_asks_something_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(events, "REST_S", 1e6)  # for ever, so that no time is measured
    monkeypatch.setattr(events, "SPOKEN_S", 0.0)

    async def story() -> None:
        scene = Scene(tmp_path)
        scene.door.at_rest = True
        async with listening(scene, "status") as heard:
            assert (await next_of(heard, "status"))["mode"] == "OFF"
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(heard.recv(), 10.0 * INTERVAL_S)
            await scene.panel.door.ask("enable")
            assert (await next_of(heard, "status"))["mode"] == "READY"
            scene.door.at_rest = False
            await scene.panel.door.ask("jog_stop")
            for _ in range(5):
                assert not (await next_of(heard, "status"))["at_rest"]

    asyncio.run(story())


def values_put_in(whole: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """As the page does it."""
    whole = copy.deepcopy(whole)
    for path, value in found.items():
        *way, last = path.split("/")
        at = whole
        for key in way:
            at = at[key]
        at[last] = value
    return whole


def test_changes_of_a_status_put_together_are_the_status() -> None:
    rng = random.Random(seed.SEED)

    def drawn(depth: int) -> Any:
        kind = rng.randrange(6 if depth else 4)
        if kind == 4:
            return [drawn(0) for _ in range(rng.randrange(3))]
        if kind == 5:
            return {
                rng.choice("abcd") + rng.choice(("", "/")): drawn(depth - 1) for _ in range(rng.randrange(4))
            }
        return (None, rng.random(), rng.randrange(3), bool(rng.randrange(2)))[kind]

    for _ in range(2000):
        before, after = ({key: drawn(3) for key in "abc"} for _ in range(2))
        after |= {key: before[key] for key in "ab" if rng.random() < 0.5}
        found = events.changed(before, after)
        assert found is not None and values_put_in(before, found) == after
    assert events.changed({"a": 1}, {"b": 1}) is None
    assert events.changed({"a": {"b": 1}}, {"a": {"b": 2, "c": 3}}) == {"a": {"b": 2, "c": 3}}


def test_who_asks_for_changes_gets_the_status_once_and_then_what_is_new_since_he_was_told_last() -> None:
    async def story() -> None:
        listener = Listener(frozenset({"status"}), changes=True)

        def tell(**data: Any) -> None:
            listener.tell("status", json.dumps({"event": "status", "data": data}), data)

        tell(mode="OFF", joints={"X": 1, "Y": 2})
        assert [json.loads(text)["event"] for text in await listener.next()] == ["status"]
        tell(mode="READY", joints={"X": 1, "Y": 2})  # missed
        tell(mode="READY", joints={"X": 1, "Y": 3})
        (text,) = await listener.next()
        assert json.loads(text) == {"event": "changes", "data": {"mode": "READY", "joints/Y": 3}}
        tell(mode="READY", joints={"X": 1, "Y": 3})
        assert json.loads((await listener.next())[0])["data"] == {}, "that it still answers is told, too"
        tell(mode="READY")
        assert json.loads((await listener.next())[0]) == {"event": "status", "data": {"mode": "READY"}}

    asyncio.run(story())
