"""A machine on the stepped clock that is prepared once and then goes on in many ways.

At any tick of a run the process can fork: the child is the same machine in the same state, to the
last bit, and what it does is not seen by the parent, which goes on as if nothing had been.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import socket
import traceback
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

from controller.machine.model import Machine
from controller.runtime.stepped import SteppedMachine

MAX_BYTES = 1 << 20  # of a message


class Forkable(SteppedMachine):
    """``at_tick`` is called behind every tick; there ``fork`` may be used."""

    def __init__(self, machine: Machine, **how: Any) -> None:
        """``how`` goes to the SteppedMachine."""
        self.at_tick: Callable[[], None] = lambda: None
        self._to_parent = -1  # of a child: where its report goes
        super().__init__(machine, **how)
        self.observer = self.observe()
        for shared in (self.board, self.recorder):  # memory that a child would share with its parent
            shared._memory = bytearray(shared._memory)  # type: ignore[assignment]
            shared._counter = memoryview(shared._memory)[:8].cast("Q")
        self._ends = (
            (self._plan_end, self.cycle._pieces._socket),
            (self._operator, self.cycle._requests._socket),
        )

    def tick(self) -> None:
        super().tick()
        self.at_tick()

    @property
    def quiet(self) -> bool:
        """Whether nothing is under way between planner, operator and tick."""
        return not any(_holds(tick_end) for _, tick_end in self._ends)

    def fork(self) -> Any:
        """In the parent what the child ``report``s, in the child None: it goes on from here.

        Raises RuntimeError with the child's traceback. Only inside of ``nursery``.
        """
        assert not self.is_child
        under_way = [_taken(tick_end) for _, tick_end in self._ends]
        reads, writes = os.pipe()
        child = os.fork()
        if child == 0:
            gc.disable()
            os.close(reads)
            self._to_parent = writes
            self._own_sockets()
            self._put_back(under_way)
            return None
        self._put_back(under_way)
        os.close(writes)
        with os.fdopen(reads, "rb") as pipe:
            data = pipe.read()
        os.waitpid(child, 0)
        ok, found = pickle.loads(data) if data else (False, "the child died")
        if not ok:
            raise RuntimeError(found)
        return found

    @property
    def is_child(self) -> bool:
        return self._to_parent >= 0

    def report(self, found: object) -> NoReturn:
        """The end of a child; what the parent's frames do on their way out is the parent's."""
        self._send_home(True, found)

    @contextlib.contextmanager
    def nursery(self) -> Iterator[None]:
        """No child leaves the block."""
        try:
            yield
        except BaseException:
            if self.is_child:
                self._send_home(False, traceback.format_exc())
            raise
        if self.is_child:
            self._send_home(False, "a child came to the end of the block")

    def _send_home(self, ok: bool, found: object) -> NoReturn:
        with os.fdopen(self._to_parent, "wb") as pipe:
            pickle.dump((ok, found), pipe)
        os._exit(0)

    def _put_back(self, under_way: list[list[bytes]]) -> None:
        for (sender, _), messages in zip(self._ends, under_way, strict=True):
            for message in messages:
                sender.send(message)

    def _own_sockets(self) -> None:
        """New ones behind the same descriptors: the parent's are not to be heard or spoken to."""
        for one, other in self._ends:
            for old, new in zip((one, other), socket.socketpair(socket.AF_UNIX, one.type), strict=True):
                for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
                    new.setsockopt(socket.SOL_SOCKET, option, old.getsockopt(socket.SOL_SOCKET, option))
                new.setblocking(False)
                os.dup2(new.fileno(), old.fileno())


def _taken(end: socket.socket) -> list[bytes]:
    """The messages that wait to be read."""
    found = []
    while _holds(end):
        found.append(end.recv(MAX_BYTES))
    return found


def _holds(end: socket.socket) -> bool:
    """Whether something is there to be read."""
    try:
        end.recv(1, socket.MSG_PEEK)
    except BlockingIOError:
        return False
    return True
