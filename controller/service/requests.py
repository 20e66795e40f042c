"""Who asked the machine for what: checked against the role, and noted in the service's own store.

The panel names for whom it asks. What it says is as good as the panel is; but what it asked for is noted
where it cannot take it away, also what was refused. What only looks is not noted, and what is sent again and
again while a key is held once in a while.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from controller.commands.command import Access
from controller.commands.table import COMMANDS
from controller.ipc.asker import ROLES, Asker
from controller.ipc.control_socket import CommandRefused, Values
from controller.service.refusals import refused
from controller.store.service_store import ServiceStore

NEEDS = {Access.LOOK: "view", Access.STOP: "view", Access.SET_UP: "set_up"}  # others: operate
MAX_ROWS = 10_000
MAX_WAITING = 1000
MAX_ARGS = 300  # characters
AGAIN_S = 1.0  # of the same that is sent again
COLUMNS = ("time_s", "user", "role", "address", "peer", "verb", "args", "refused")
Row = tuple[Any, ...]


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
    def noted(self, verb: str, args: Values, asker: Asker, peer: str) -> Iterator[None]:
        """Around what a request does; ``peer``: the user at the socket. Raises CommandRefused."""
        why = ""
        try:
            _check_role(verb, asker)
            yield
        except CommandRefused as error:
            why = error.code
            raise
        except BaseException:
            why = "error"
            raise
        finally:
            if verb not in COMMANDS or COMMANDS[verb].access is not Access.LOOK:
                self._note(verb, args, asker, peer, why)

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
            self._writer.submit(self._write)

    def _write(self) -> None:
        rows = self._waiting[:]
        if not rows:
            return
        with contextlib.suppress(OSError), self._store.write() as sql:  # a full disk keeps nobody from a stop
            marks = ", ".join("?" * len(COLUMNS))
            sql.executemany(f"INSERT INTO requests ({', '.join(COLUMNS)}) VALUES ({marks})", rows)
            sql.execute("DELETE FROM requests WHERE id <= (SELECT max(id) FROM requests) - ?", (MAX_ROWS,))
        del self._waiting[: len(rows)]


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
