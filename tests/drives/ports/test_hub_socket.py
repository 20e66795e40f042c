"""The virtual bus' client whose hub ends, and comes back."""

from __future__ import annotations

import socket
from pathlib import Path

from drives import bus, pdo
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
