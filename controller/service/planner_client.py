"""The service's end of what it and its plan's process say to each other (``runtime/plan_messages``).

A plan that dies leaves its orders unanswered: they end with the sentence of its death.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from typing import Any

from controller.ipc.control_socket import CommandRefused
from controller.runtime.plan_messages import Answer, News, Order, Program
from controller.service.refusals import refused


class Line:
    """The service's end: orders out, answers and news in.

    One thread listens. Another sends: a program of many megabytes goes as slowly as the plan reads it,
    and whoever gives it up meanwhile must neither wait for that nor come in between. The one that listens
    lets go of the socket, once the other has ended: its number is somebody else's by then.
    """

    def __init__(self, own: socket.socket, hear: Callable[[News], None]) -> None:
        self._socket, self._connection = own, Connection(own.fileno())
        self._hear = hear
        self._lock = threading.Lock()
        self._last = 0
        self._waiting: dict[int, Future[dict[str, Any]]] = {}
        self._sender = ThreadPoolExecutor(1, "to the plan")
        self._listener = threading.Thread(target=self._listen, name="plan", daemon=True)
        self._listener.start()

    def order(
        self,
        verb: str,
        axes: tuple[int, ...] = (),
        program: Program | None = None,
        distance_mm: float = 0.0,
        tool: int = 0,
    ) -> dict[str, Any]:
        """Have something done and wait for it. Raises CommandRefused."""
        answer: Future[dict[str, Any]] = Future()
        with self._lock:
            self._last += 1
            self._waiting[self._last] = answer
            order = Order(self._last, verb, axes, program, distance_mm, tool)
        try:
            self._sender.submit(self._connection.send, order).result()
        except (OSError, RuntimeError):  # the latter: closed
            self._waiting.pop(order.number, None)
            raise refused("no_plan", code="gone") from None
        return answer.result()

    def give_up(self) -> None:
        """Have the order under way given up where that is possible: a check. It waits for nothing."""
        with contextlib.suppress(RuntimeError):
            self._sender.submit(self._connection.send, Order(0, "give up"))

    def close(self) -> None:
        """Nothing goes out or comes in any more; whoever waits for either is woken."""
        with self._lock, contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def _listen(self) -> None:
        """To the end of the plan. An error of ours is its end, too: another one follows it."""
        try:
            while (said := self._heard()) is not None:
                self._answered(said) if isinstance(said, Answer) else self._hear(said)
        finally:
            self.close()
            self._sender.shutdown()
            with self._lock:
                self._socket.detach()
                self._connection.close()
            for answer in list(self._waiting.values()):
                answer.set_exception(refused("no_plan", code="gone"))
            self._waiting.clear()

    def _heard(self) -> Answer | News | None:
        try:
            said: Answer | News = self._connection.recv()
        except (EOFError, OSError, TypeError):  # the last: closed while it waited
            return None
        return said

    def _answered(self, said: Answer) -> None:
        answer = self._waiting.pop(said.number, None)
        if answer is None:
            return
        if said.error is not None:
            answer.set_exception(CommandRefused(*said.error))
        else:
            answer.set_result(said.facts)
