"""The panel's end of the door: what stops the machine waits for nothing that others ask."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine, Iterable, Iterator
from concurrent.futures import Future
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_socket import TABLE, FakeDoor
from support.fakes.panels import Scene

from controller.api import service_client
from controller.api.answers import Refusal
from controller.api.service_client import SocketServiceClient, Watch
from controller.commands.command import Lane
from controller.commands.table import ALL
from controller.ipc.control_socket import MAX_PEERS, Answer, Values
from controller.service.socket_server import Server

LOOKS, SLOW, STOPS = (
    frozenset(one.name for one in ALL if one.way is lane) for lane in (Lane.LOOK, Lane.SLOW, Lane.STOP)
)

CROWD = 50  # more than all lanes have places
TIMEOUT_S = 30.0  # before a request that hangs is told from a slow computer


@pytest.fixture(autouse=True)
def nobody_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise places would come free by time alone."""
    monkeypatch.setattr(service_client, "QUICK_S", service_client.SLOW_S)


class Stuck:
    """A service that answers some verbs at once, and the others not before it is let go."""

    def __init__(self, at_once: frozenset[str]) -> None:
        self._at_once = at_once
        self._waiting: list[Future[Values]] = []

    def __call__(self, verb: str, args: Values) -> Answer:
        if verb in self._at_once:
            return {"verb": verb}
        self._waiting.append(Future())
        return self._waiting[-1]

    def let_go(self) -> None:
        for answer in self._waiting:
            answer.set_result({})


@contextmanager
def stuck(folder: Path, at_once: frozenset[str]) -> Iterator[SocketServiceClient]:
    """The panel's door to such a service."""
    service = Stuck(at_once)
    server, door = Server(folder / "control.sock", service), SocketServiceClient(folder / "control.sock")
    try:
        yield door
    finally:
        service.let_go()
        door.close()
        server.close()


@asynccontextmanager
async def waiting(crowd: Iterable[Coroutine[Any, Any, Any]]) -> AsyncIterator[None]:
    """A crowd that asks while the block runs; nobody of it is answered. Raises AssertionError."""
    asking = [asyncio.create_task(one) for one in crowd]
    await asyncio.sleep(0)  # all of them are on their way
    yield
    assert not any(task.done() for task in asking)
    for task in asking:
        task.cancel()
    await asyncio.gather(*asking, return_exceptions=True)


def answered_behind(crowd: frozenset[str], wanted: frozenset[str], folder: Path) -> None:
    """Every verb of ``wanted`` is answered while none of a crowd's is. Raises AssertionError."""

    async def story() -> None:
        with stuck(folder, wanted) as door:
            async with waiting(door.ask(verb) for verb in sorted(crowd) for _ in range(CROWD)):
                for verb in sorted(wanted):
                    told = await asyncio.wait_for(door.ask(verb), TIMEOUT_S)
                    assert told == {"verb": verb}

    asyncio.run(story())


def test_what_stops_waits_for_nothing_else_that_is_asked(tmp_path: Path) -> None:
    answered_behind((frozenset(TABLE) | LOOKS) - STOPS, STOPS, tmp_path)


def test_what_moves_does_not_wait_for_those_who_only_look(tmp_path: Path) -> None:
    answered_behind(LOOKS, frozenset(TABLE) - LOOKS, tmp_path)


def test_a_start_does_not_wait_for_what_takes_long(tmp_path: Path) -> None:
    answered_behind(SLOW, frozenset({"start", "resume", "jog", "override", "status"}), tmp_path)


def test_an_operator_holds_and_stops_while_a_crowd_of_viewers_waits(tmp_path: Path) -> None:
    async def story() -> None:
        with stuck(tmp_path, STOPS) as door:
            scene = await Scene(tmp_path / "state", door).with_users()  # type: ignore[arg-type]
            async with scene.client("view") as viewer, scene.client("operate") as operator:
                looks = ("machine/buses", "restart", "facts", "drives", "offsets", "status")
                async with waiting(viewer.get(f"/api/v1/{path}") for path in looks for _ in range(CROWD)):
                    for verb in ("cycle/hold", "cycle/stop", "machine/estop"):
                        answer = await asyncio.wait_for(operator.post(f"/api/v1/{verb}"), TIMEOUT_S)
                        assert answer.status_code == 200, answer.text

    asyncio.run(story())


def test_the_panel_alone_does_not_fill_the_door(tmp_path: Path) -> None:
    door: Any = SocketServiceClient(tmp_path / "control.sock")
    assert sum(lane.at_once for lane in door._ways.values()) < MAX_PEERS


@pytest.mark.parametrize("verb", ["stop", "hold", "estop", "jog_stop"])
def test_a_stop_has_a_lane_of_its_own(verb: str) -> None:
    assert verb in STOPS and not STOPS & (LOOKS | SLOW)


class Held:
    """A service whose mode is what was asked of it; it tells how often its status was read."""

    def __init__(self) -> None:
        self.mode, self.reads = "HOLD", 0

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        if verb == "status":
            self.reads += 1
            told = {"mode": self.mode}
            await asyncio.sleep(0)
            return told
        self.mode = verb
        return {}


def test_whoever_was_answered_reads_a_status_of_after_that_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service_client, "FRESH_S", 1e9)

    async def story() -> None:
        door = Held()
        watch = Watch(door)
        assert [(await watch.status())["mode"] for _ in range(3)] == ["HOLD"] * 3 and door.reads == 1
        await watch.ask("resume")
        assert (await watch.status())["mode"] == "resume", "kept from before the answer"
        await watch.ask("rows")
        assert (await watch.status())["mode"] == "resume" and door.reads == 2, "a look changes nothing"
        asked_before = asyncio.create_task(watch.status())
        await watch.ask("hold")
        await asked_before
        assert (await watch.status())["mode"] == "hold", "asked for before the answer"

    asyncio.run(story())


def test_a_service_is_gone_for_no_longer_than_it_was_not_heard_whatever_the_clock_is_set_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s = 1000.0
    door = FakeDoor()
    monkeypatch.setattr(service_client.time, "monotonic", lambda: now_s)
    watch = Watch(door)
    assert watch.gone_s(5.0) == 5.0, "nothing is known here yet"

    async def look() -> None:
        with suppress(Refusal):
            await watch.status()

    asyncio.run(look())
    now_s, door.there = 1010.0, False
    asyncio.run(look())
    now_s = 1040.0
    asyncio.run(look())
    assert [watch.gone_s(by_clock_s) for by_clock_s in (-3600.0, 33.0, 3600.0)] == [30.0, 33.0, 40.0]
    door.there = True
    asyncio.run(look())
    now_s = 1041.0
    assert watch.gone_s(3600.0) == 1.0
