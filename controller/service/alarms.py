"""Alarms: what went wrong, when, and whether somebody has seen it. Kept over restarts.

One file of JSON lines in the state folder, newest last; an alarm that was acknowledged is
written again with the same id, and the last line of an id counts. A reserve beside it is given up where the
disk is full, so that what ends a run on a full disk, an emergency stop above all, is still written.
"""

from __future__ import annotations

import contextlib
import errno
import os
import threading
import time
from pathlib import Path
from typing import Any

from controller import atomic_file, own_files, sealed_file
from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.messages import Message, message
from controller.service import kept_file
from controller.service.refusals import refused
from controller.state.fault_table import NOBODY, Sender
from controller.state.modes import FAULTS, Fault, fault_message

FILE = "alarms.jsonl"
RESERVE = "reserve"
RESERVE_BYTES = 1 << 20  # some thousand alarms
KEPT = 1000
SHOWN = 100  # in one answer
FULL = (errno.ENOSPC, errno.EDQUOT)


class Alarms:
    """The list; any thread may use it."""

    def __init__(self, state: Path) -> None:
        self._file = state / FILE
        self._lock = threading.Lock()
        self._known: dict[int, dict[str, Any]] = {}
        found, self.damaged = _read(self._file)
        for alarm in found:
            self._known[alarm["id"]] = alarm
        self._write_all()
        self._put_by()

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
            return alarm

    def change(self, number: int, **more: Any) -> None:
        """What became known of an alarm later."""
        with self._lock:
            self._keep({**self._known[number], **more})

    def acknowledge(self, number: int | None) -> int:
        """One alarm, or all; how many that were. Raises CommandRefused."""
        with self._lock:
            if number is not None and number not in self._known:
                raise refused("no_alarm", code="bad", number=number)
            wanted = [number] if number is not None else list(self._known)
            fresh = [self._known[one] for one in wanted if self._known[one]["acknowledged_s"] is None]
            for alarm in fresh:
                self._keep({**alarm, "acknowledged_s": time.time()})
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
        line = sealed_file.line(alarm).encode()
        try:
            self._append(line)
        except OSError as error:
            if error.errno not in FULL:
                return
            with contextlib.suppress(OSError):
                own_files.remove(self._file.with_name(RESERVE))
                self._append(b"\n" + line)  # half of a line may have been written

    def _append(self, line: bytes) -> None:
        """Raises OSError."""
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
        with own_files.opened(self._file, flags) as file:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())

    def _put_by(self) -> None:
        """The reserve, at the start; a full disk has none to put by."""
        reserve = self._file.with_name(RESERVE)
        with contextlib.suppress(OSError):
            if not reserve.exists():
                with own_files.new(reserve) as file:
                    file.write(bytes(RESERVE_BYTES))
                    os.fsync(file.fileno())

    def _write_all(self) -> None:
        """Each alarm once; at the start only."""
        with contextlib.suppress(OSError):
            own_files.make_folder(self._file.parent)
            lines = (sealed_file.line(self._known[number]) for number in sorted(self._known)[-KEPT:])
            atomic_file.write(self._file, "".join(lines))


def _read(file: Path) -> tuple[list[dict[str, Any]], Message | None]:
    """What is sound of the file, and what an alarm says of the rest; the last line may be cut short."""
    try:
        lines = own_files.read_bytes(file).splitlines(keepends=True)
    except FileNotFoundError:
        return [], None
    except OSError as error:
        return [], kept_file.put_aside(file, error)
    found, bad = [], None
    for line in lines:
        if not line.strip():
            continue
        try:
            alarm = sealed_file.of_line(line, file)
            whole = {**alarm, "id": int(alarm["id"]), "acknowledged_s": alarm["acknowledged_s"]}
            found.append({**whole, "time_s": float(alarm["time_s"]), "name": str(alarm["name"])})
        except kept_file.WRONG as error:
            bad = bad or (error if line.endswith(b"\n") else None)
    return found, kept_file.put_aside(file, bad) if bad else None


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
