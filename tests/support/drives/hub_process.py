"""A virtual bus with simulated drives, for tests: a process of its own, whose nodes have started up.

with served(tmp_path / "can", "--nodes", "1", "2", nodes=(1, 2)) as process:
    ...  # can.Bus(interface="directrix", channel=tmp_path / "can")
"""

from __future__ import annotations

import contextlib
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from drives import pdo

ROOT = Path(__file__).resolve().parents[3]
ANSWER_S = 20.0  # of an SDO server, before canopen's client asks again: no test is meant to come near
READ_DEVICE_TYPE = bytes.fromhex("4000100000000000")
DEVICE_TYPE = bytes.fromhex("43001000")


@contextlib.contextmanager
def running(path: Path, *command: str) -> Iterator[subprocess.Popen[bytes]]:
    """``python -m command``, which makes a hub at ``path``; it is killed if it has not ended itself."""
    process = subprocess.Popen([sys.executable, "-m", *command], cwd=ROOT)
    try:
        while not path.exists():
            assert process.poll() is None, "it ended"
            time.sleep(0.01)
        yield process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def served(path: Path, *options: str, nodes: Sequence[int] = ()) -> Iterator[subprocess.Popen[bytes]]:
    """``python -m drives.bench``; ``nodes`` have started up, and sent the last frame of it."""
    with running(path, "drives.bench", str(path), *options) as process:
        for node in nodes:
            profile(path, node)
        yield process


def profile(path: Path, node: int) -> int:
    """Number of a node's device profile, as soon as it answers; a node that starts up is deaf."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as joined:
        joined.connect(str(path))
        while True:
            joined.send(pdo.frame(0x600 + node, READ_DEVICE_TYPE))
            while select.select([joined], [], [], 0.1)[0]:
                can_id, data = pdo.unpack(joined.recv(pdo.FRAME_BYTES))
                if can_id == 0x580 + node and data[:4] == DEVICE_TYPE:
                    return int.from_bytes(data[4:6], "little")
