"""The listener: every frame of every bus, with the time at which it came."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from support.live.live_machines import until

from controller.runtime.listener import Listener
from drives import bus, pdo
from drives.bench.virtual.hub import Hub
from drives.ports.port import BusError
from drives.settings import BusSettings


@dataclass
class Served:
    """A hub that is turned by the test."""

    hub: Hub
    settings: BusSettings

    def turn(self) -> bool:
        self.hub.turn(time.monotonic() + 0.002)
        return False


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    path = str(tmp_path / "hub")
    hub = Hub(path)
    yield Served(hub, BusSettings("can0", "virtual", path, 1_000_000))
    hub.close()


def test_every_frame_is_kept_with_its_time_and_identifier(served: Served) -> None:
    listener = Listener([served.settings])
    port = bus.open(served.settings)
    before_s = time.time()
    for n in range(50):
        assert port.send(pdo.frame(0x180 + n, bytes([n])))
    until(lambda: served.turn() or len(listener.logs["can0"]) == 50)
    listener.close()
    kept = list(listener.logs["can0"].frames())
    assert [pdo.unpack(frame)[0] for _, frame in kept] == [0x180 + n for n in range(50)]
    stamps = [at_s for at_s, _ in kept]
    assert stamps == sorted(stamps) and before_s - 1.0 < stamps[0] <= stamps[-1] < time.time() + 1.0
    port.close()


def test_a_hub_that_goes_is_no_trouble_and_what_was_heard_stays(served: Served) -> None:
    listener = Listener([served.settings])
    port = bus.open(served.settings)
    port.send(pdo.frame(0x181, b"\x01"))
    until(lambda: served.turn() or len(listener.logs["can0"]) == 1)
    served.hub.close()
    listener.close()
    assert len(listener.logs["can0"]) == 1
    port.close()


def test_a_bus_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BusError, match="no virtual bus at"):
        Listener([BusSettings("can0", "virtual", str(tmp_path / "none"), 1_000_000)])
