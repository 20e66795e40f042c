"""Stand-ins for a running service, at the place where one would have its socket."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from controller.ipc import control_socket
from controller.service.socket_server import Server


@contextlib.contextmanager
def answering(state: Path, runtime: Path, **status: Any) -> Iterator[None]:
    """One that runs on a state folder, and says that of itself."""
    state.mkdir(parents=True, exist_ok=True)
    server = Server(control_socket.control_path(runtime), lambda verb, _: status if verb == "status" else {})
    control_socket.note_runtime(state, runtime)
    try:
        yield
    finally:
        server.close()


@contextlib.contextmanager
def hanging(state: Path, runtime: Path) -> Iterator[None]:
    """One that takes nobody's word."""
    state.mkdir(parents=True, exist_ok=True)
    runtime.mkdir()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as own:
        own.bind(str(control_socket.control_path(runtime)))
        own.listen()
        control_socket.note_runtime(state, runtime)
        yield
