"""The virtual bus' client whose hub ends, and comes back."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from drives import bus, pdo
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.line import Line
from drives.ports import hub_protocol
from drives.settings import BusSettings


def hub(path: Path) -> socket.socket:
    path.unlink(missing_ok=True)
    server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    server.bind(str(path))
    server.listen()
    return server


def test_a_port_whose_hub_has_ended_joins_the_next_one_when_it_is_asked_to(tmp_path: Path) -> None:
    path, buffer, sync = tmp_path / "can0", bytearray(pdo.FRAME_BYTES), bytes(pdo.frame(pdo.SYNC))
    server = hub(path)
    port = bus.open(BusSettings("can0", "virtual", str(path), 1_000_000))
    joined, _ = server.accept()
    wishes = joined.recv(256)
    joined.send(sync)
    assert port.receive_into(buffer) and not port.gone
    joined.close()
    server.close()
    assert not port.receive_into(buffer) and port.gone and not port.send(sync)
    path.unlink()
    port.restart()
    assert port.gone, "there is none yet"
    server = hub(path)
    port.restart()
    joined, _ = server.accept()
    assert wishes and joined.recv(256) == wishes, "the next hub has to know them, too"
    assert not port.gone and port.send(sync) and joined.recv(16) == sync
    joined.send(sync)
    assert port.receive_into(buffer) and bytes(buffer) == sync
    port.close()
    joined.close()
    server.close()


def test_frames_lost_at_the_next_hub_are_added_to_those_lost_before(tmp_path: Path) -> None:
    path, buffer = tmp_path / "can0", bytearray(pdo.FRAME_BYTES)
    server = hub(path)
    port = bus.open(BusSettings("can0", "virtual", str(path), 1_000_000))
    for before in (0, 7):
        joined, _ = server.accept()
        joined.recv(256)
        joined.send(hub_protocol.lost_frame(7) + bytes(pdo.frame(0x181)))
        assert port.receive_into(buffer) and port.overflows == before + 7
        joined.close()
        assert not port.receive_into(buffer) and port.gone
        server.close()
        server = hub(path)
        port.restart()
    port.close()
    server.close()


@pytest.mark.parametrize("interface", ["virtual", "directrix"], ids=["hub", "python-can"])
def test_what_a_hub_s_client_has_lost_is_raised_on_every_way_to_it(tmp_path: Path, interface: str) -> None:
    path = tmp_path / "can0"
    server = hub(path)
    port = bus.open(BusSettings("can0", interface, str(path), 1_000_000))
    line = Line(port, [], -1)
    joined, _ = server.accept()
    joined.send(bytes(pdo.frame(0x181)))
    line.drain(0.0)
    assert line.fault is DriveFault.NONE and port.overflows == 0
    joined.send(hub_protocol.lost_frame(7))
    joined.send(bytes(pdo.frame(0x181)))
    line.drain(0.0)
    assert line.fault is DriveFault.RX_OVERFLOW and port.overflows > 0
    assert line.lost == port.overflows
    line.forget()
    line.drain(0.0)
    assert line.fault is DriveFault.NONE, "each loss is raised once"
    port.close()
    joined.close()
    server.close()
