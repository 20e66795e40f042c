"""A hub in a thread of the test, with an adapter that leads to it, and how python-can comes in."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
from support.drives.slcan_terminal import SlcanTerminal

from drives.bench.virtual.hub import Hub
from drives.bench.virtual.hub_bus import HubBus

TIMEOUT_S = 20.0


def let_in(hub: Hub) -> HubBus:
    """A client that hears all that is sent from now on: one who has only knocked hears nothing."""
    others = len(hub._clients)
    made = HubBus(hub.path)
    until(lambda: len(hub._clients) > others)
    return made


class Served:
    """A hub in a thread, and a serial adapter on its bus."""

    def __init__(self, folder: Path, bit_rate: int = 1_000_000) -> None:
        self.path, self.link = str(folder / "hub"), str(folder / "tty")
        self.hub = Hub(self.path, bit_rate)
        self.terminal = SlcanTerminal(self.hub, self.link)
        self.hub.open_gateway(self.terminal)
        self._ends = False
        self._thread = threading.Thread(target=self.hub.run, args=(lambda: self._ends,))
        self._thread.start()

    def end(self) -> None:
        self._ends = True
        self._thread.join()
        self.hub.close()

    def native(self) -> HubBus:
        return let_in(self.hub)


@contextmanager
def serving(folder: Path, bit_rate: int = 1_000_000) -> Iterator[Served]:
    made = Served(folder, bit_rate)
    try:
        yield made
    finally:
        made.end()


def until(done: Callable[[], bool]) -> None:
    give_up_s = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < give_up_s
        time.sleep(0.001)


def by_hub(hub: Hub, act: Callable[[], object]) -> None:
    """Have the hub's own thread do something to its bus, which no other may touch, between two turns.

    When it is done everybody has been given what came before it.
    """
    done = threading.Event()

    def once(_now_s: float) -> None:
        hub.watchers.remove(once)
        act()
        done.set()

    hub.watchers.append(once)
    assert done.wait(TIMEOUT_S)


def heard(listener: can.BusABC, count: int) -> list[can.Message]:
    got: list[can.Message] = []
    until_s = time.monotonic() + TIMEOUT_S
    while len(got) < count and time.monotonic() < until_s:
        message = listener.recv(0.1)
        if message is not None:
            got.append(message)
    return got


def heard_at_once(listener: can.BusABC, talker: can.BusABC, message: can.Message) -> list[can.Message]:
    talker.send(message)
    got = listener.recv(0.1)
    return [] if got is None else [got]


def same(a: list[can.Message], b: list[can.Message]) -> bool:
    return len(a) == len(b) and all(
        x.equals(y, timestamp_delta=None, check_channel=False, check_direction=False)
        for x, y in zip(a, b, strict=True)
    )
