"""Alarms: what went wrong, when, and whether somebody has seen it. Kept over restarts, in the store.

What ends a run on a full disk, an emergency stop above all, is still written (``ServiceStore.insist``).
"""

from __future__ import annotations

import contextlib
import json
import logging
import sqlite3
import threading
import time
from typing import Any

from controller import journald
from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.messages import Message, message, text
from controller.service.refusals import refused
from controller.state.fault_table import NOBODY, Sender
from controller.state.modes import FAULTS, Fault, fault_message
from controller.store.service_store import ServiceStore

_log = logging.getLogger(__name__)
DAMAGE = "FILE_DAMAGED"  # name of the alarm that something kept was damaged: before it is seen nothing starts
KEPT = 5000
SHOWN = 100  # in one answer


class Alarms:
    """The list; any thread may use it."""

    def __init__(self, store: ServiceStore) -> None:
        """Raises OSError."""
        self._store, self._lock = store, threading.Lock()
        rows = store.rows("SELECT id, facts FROM alarms ORDER BY id")
        self._unkept = set[int]()  # by a disk that took nothing
        self._known: dict[int, dict[str, Any]] = {number: json.loads(facts) for number, facts in rows}

    def add(self, name: str, what: Message, **more: Any) -> dict[str, Any]:
        """A new alarm; the disk being full does not stop the machine from telling it."""
        with self._lock:
            alarm = {
                "id": max(self._known, default=0) + 1,
                "time_s": time.time(),
                "name": name,
                **what,
                "acknowledged_s": None,
                **more,
            }
            self._keep(alarm)
        priority = journald.ERROR if name in Fault.__members__ else journald.WARNING
        known = journald.fields(priority, alarm=name, number=alarm["id"], axis=more.get("axis") or "")
        _log.info("%s: %s", name, text(what), extra=known)
        return alarm

    def change(self, number: int, **more: Any) -> None:
        """What became known of an alarm later."""
        with self._lock:
            self._keep({**self._known[number], **more})

    def acknowledge(self, number: int | None, by: str = "") -> int:
        """One alarm, or all, of which the first time counts; how many that were. Raises CommandRefused."""
        with self._lock:
            if number is not None and number not in self._known:
                raise refused("no_alarm", code="bad", number=number)
            wanted = [number] if number is not None else list(self._known)
            fresh = [self._known[one] for one in wanted if self._known[one]["acknowledged_s"] is None]
            for alarm in fresh:
                self._keep({**alarm, "acknowledged_s": time.time(), "acknowledged_by": by})
            return len(fresh)

    def list(self) -> list[dict[str, Any]]:
        """The newest first. It does not wait for the disk, as what changes the list does."""
        known = self._known.copy()
        return [known[number] for number in sorted(known, reverse=True)[:SHOWN]]

    def unconfirmed(self, name: str) -> dict[str, Any] | None:
        """The oldest alarm of a name that nobody has acknowledged, however many came after it."""
        known = self._known.copy()
        found = (known[number] for number in sorted(known))
        return next((one for one in found if one["name"] == name and one["acknowledged_s"] is None), None)

    def _keep(self, alarm: dict[str, Any]) -> None:
        self._known[alarm["id"]] = alarm
        while len(self._known) > KEPT:
            del self._known[min(self._known)]
        self._unkept.add(alarm["id"])
        rows = [(number, json.dumps(self._known[number])) for number in self._unkept & self._known.keys()]
        first = min(self._known)

        def write(sql: sqlite3.Connection) -> None:
            sql.executemany("INSERT OR REPLACE INTO alarms VALUES (?, ?)", rows)
            sql.execute("DELETE FROM alarms WHERE id < ?", (first,))

        with contextlib.suppress(OSError):  # it is reported all the same
            self._store.insist(write)
            self._unkept.clear()


def of(
    machine: Machine,
    fault: Fault,
    axis: int,
    also: Fault = Fault.NONE,
    off: float = 0.0,
    sender: Sender = NOBODY,
) -> dict[str, Any]:
    """A fault as it is shown; ``off``: of a following error, mm or rad; ``sender``: of too many frames."""
    name = machine.axis_off(axis, off)
    row = FAULTS[fault]
    return {
        "name": fault.name,
        "axis": machine.axis_off(axis) or None,
        **fault_message(fault, name, also, sender),
        "cause": message(f"cause.{fault.name}"),
        "remedy": message(f"remedy.{fault.name}"),
        "recovery": row.recovery.name.lower(),
        "position_trusted": row.position_trusted,
    }


def where(now: Snapshot) -> dict[str, Any]:
    """Where the machine was."""
    return {"mode": now.mode.name, "line": now.line, "tick": now.tick}
