"""Who asked the machine for what: checked against the role, and noted in the service's own store.

The panel names for whom it asks. What it says is as good as the panel is; but what it asked for is noted
where it cannot take it away, also what was refused. What only looks is not noted, and what is sent again and
again while a key is held once in a while.
"""

from __future__ import annotations

import contextlib
import json
import logging
import sqlite3
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from controller import journald
from controller.commands.command import Access
from controller.commands.table import COMMANDS
from controller.ipc.asker import ROLES, Asker
from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.service.refusals import refused
from controller.store.service_store import ServiceStore

_log = logging.getLogger(__name__)
NEEDS = {Access.LOOK: "view", Access.STOP: "view", Access.SET_UP: "set_up"}  # others: operate
MAX_ROWS = 10_000
MAX_WAITING = 1000
MAX_ARGS = 300  # characters
AGAIN_S = 1.0  # of the same that is sent again
COLUMNS = ("time_s", "user", "role", "address", "peer", "verb", "args", "refused")
Row = tuple[Any, ...]
Hears = Callable[[Answer], None]


def listed(sql: sqlite3.Connection, most: int) -> Iterator[dict[str, Any]]:
    """The latest that a store has, newest first. Raises sqlite3.Error."""
    latest = f"SELECT id, {', '.join(COLUMNS)} FROM requests ORDER BY id DESC LIMIT ?"
    for row in sql.execute(latest, (most,)):
        yield dict(zip(("id", *COLUMNS), row, strict=True))


class Requests:
    """Of one service; the door's thread asks, and a thread of its own writes."""

    def __init__(self, store: ServiceStore) -> None:
        self._store = store
        self._writer = ThreadPoolExecutor(1, "requests")
        self._waiting: list[Row] = []
        self._last: tuple[Row, float] = ((), -1e9)

    @contextlib.contextmanager
    def noted(self, verb: str, args: Values, asker: Asker, peer: str) -> Iterator[Hears]:
        """Around what a request does, whose answer is heard; ``peer``: the user at the socket. What is
        refused later, by the tick or a plan, is noted once more. Raises CommandRefused.
        """

        def note(error: BaseException | None) -> None:
            if verb not in COMMANDS or COMMANDS[verb].access is not Access.LOOK:
                self._note(verb, args, asker, peer, _code(error))

        def hear(answer: Answer) -> None:
            note(None)
            if isinstance(answer, Future):
                answer.add_done_callback(lambda done: note(done.exception()) if done.exception() else None)

        try:
            _check_role(verb, asker)
            yield hear
        except BaseException as error:
            note(error)
            raise

    def close(self) -> None:
        """What is not written yet is written first."""
        self._writer.shutdown(wait=True)

    def _note(self, verb: str, args: Values, asker: Asker, peer: str, why: str) -> None:
        shown = json.dumps(args, default=str)[:MAX_ARGS]
        who = asker.user, asker.role, asker.address, peer, verb[:MAX_ARGS]
        same, now_s = (*who, why) if _repeats(verb) or why else (), time.monotonic()
        if same and same == self._last[0] and now_s - self._last[1] < AGAIN_S:
            return
        self._last = same, now_s
        if len(self._waiting) < MAX_WAITING:  # the machine goes before what is noted of it
            self._waiting.append((time.time(), *who, shown, why))
            with contextlib.suppress(RuntimeError):  # it has come to its end
                self._writer.submit(self._write)

    def _write(self) -> None:
        rows = self._waiting[:]
        if not rows:
            return
        with contextlib.suppress(OSError), self._store.write() as sql:  # a full disk keeps nobody from a stop
            marks = ", ".join("?" * len(COLUMNS))
            sql.executemany(f"INSERT INTO requests ({', '.join(COLUMNS)}) VALUES ({marks})", rows)
            sql.execute("DELETE FROM requests WHERE id <= (SELECT max(id) FROM requests) - ?", (MAX_ROWS,))
        for _, user, role, address, peer, verb, args, why in rows:
            priority = journald.NOTICE if why else journald.INFO
            known = journald.fields(priority, user=user, role=role, address=address, peer=peer, request=verb)
            _log.info("%s %s: %s %s %s", user, address, verb, args, why, extra=known)
        del self._waiting[: len(rows)]


def _code(error: BaseException | None) -> str:
    """What is noted of an outcome; empty where nothing is wrong."""
    if error is None:
        return ""
    return error.code if isinstance(error, CommandRefused) else "error"


def _repeats(verb: str) -> bool:
    command = COMMANDS.get(verb)
    return command is not None and command.rest is not None and command.rest.seen_s is not None


def _check_role(verb: str, asker: Asker) -> None:
    """Raises CommandRefused for what the role may not."""
    command = COMMANDS.get(verb)
    if command is None:
        return  # which the handler says
    needs = NEEDS.get(command.access, "operate")
    if ROLES.index(asker.role) < ROLES.index(needs):
        raise refused("role", code="role", name=asker.user, has=asker.role, needs=needs)
