"""A port for a server that another process opens."""

from __future__ import annotations

import contextlib
import random
import socket

BELOW = 32768  # from here on Linux draws the ports of who connects (ip_local_port_range)
DRAWN = random.SystemRandom()  # hypothesis seeds the usual one, in two workers alike


def free_port() -> int:
    """Of this computer's own address; nobody who only connects takes it until it is opened."""
    while True:
        port = DRAWN.randrange(20_000, BELOW)
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port
