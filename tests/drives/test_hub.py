"""The hub in wall clock: two processes, python-can and canopen as they come. No time is asserted."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import can
import canopen
import numpy as np
import pytest
from stepped_drives import EDS, nodes

from drives import bus, commission, pdo
from drives.hub_bus import HubBus
from drives.settings import BusSettings, MasterSettings

ROOT = Path(__file__).parents[2]


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes], Path]]:
    path, log = str(tmp_path / "can"), tmp_path / "sync.npy"
    arguments = [path, "--nodes", "1", "2", "--sync-log", str(log)]
    process = subprocess.Popen([sys.executable, "-m", "drives.simulated", *arguments], cwd=ROOT)
    while not Path(path).exists():
        assert process.poll() is None
        time.sleep(0.01)
    yield path, process, log
    process.kill()
    process.wait()


def test_canopens_own_client_reads_and_writes_a_simulated_drive(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    network = canopen.Network(bus=HubBus(served[0]))
    network.connect()
    try:
        node = canopen.RemoteNode(1, EDS)
        network.add_node(node)
        node.sdo.MAX_RETRIES = 5
        node.sdo.RESPONSE_TIMEOUT = 2.0
        assert node.sdo[0x1000].raw == 0x20192
        assert node.sdo[0x1008].raw == "Directrix simulated drive, one axis, CiA 402"
        node.sdo[0x6065].raw = 4711
        assert node.sdo[0x6065].raw == 4711
        node.sdo[0x60C2][2].raw = -4
        assert node.sdo[0x60C2][2].raw == -4
        node.sdo.download(0x6065, 0, (99).to_bytes(4, "little"), force_segment=True)
        assert node.sdo[0x6065].raw == 99
        with pytest.raises(canopen.SdoAbortedError) as refused:
            node.sdo[0x605A].raw = 17
        assert refused.value.code == 0x06090031
    finally:
        network.disconnect()


def test_drives_behind_the_hub_are_commissioned_without_a_thread(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    port = bus.open(BusSettings("can", "virtual", served[0], 1_000_000), pdo.SERVICE_FILTERS)
    network = commission.Network(port, commission.wall_pump(port.fileno()), patience_s=5.0)
    commission.commission(network, nodes("XY"), MasterSettings())
    port.close()


def test_the_hubs_own_sync_reaches_its_owner_and_the_log_is_written_at_sigterm(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    path, process, log = served
    port = bus.open(BusSettings("can", "virtual", path, 1_000_000))
    port.start_cyclic_sync(0.005)
    buffer, echoes = bytearray(16), 0
    while echoes < 20:
        commission.wall_pump(port.fileno())()
        while port.receive_into(buffer):
            echoes += pdo.unpack(buffer)[0] == pdo.SYNC
    port.close()
    process.send_signal(signal.SIGTERM)
    process.wait(20)
    times_s = np.load(log)
    assert len(times_s) >= 20
    assert np.diff(times_s) == pytest.approx(0.005, abs=1e-9), "the wire model's times, not the wake-ups'"


def test_python_can_frames_go_through_the_hub_unchanged(
    served: tuple[str, subprocess.Popen[bytes], Path],
) -> None:
    one, two = HubBus(served[0]), HubBus(served[0])
    try:
        sent = [
            can.Message(arbitration_id=0x333, data=b"\x01\x02\x03", is_extended_id=False),
            can.Message(arbitration_id=0x1ABCDEF0, data=bytes(8), is_extended_id=True),
            can.Message(arbitration_id=0x444, is_remote_frame=True, dlc=4, is_extended_id=False),
        ]
        for message in sent:
            one.send(message)
        got: list[can.Message] = []
        while len(got) < 3:
            message = two.recv(5.0)
            assert message is not None
            if message.arbitration_id < 0x700 or message.is_extended_id:
                got.append(message)
        assert all(any(a.equals(b, timestamp_delta=None) for b in got) for a in sent)
    finally:
        one.shutdown()
        two.shutdown()
