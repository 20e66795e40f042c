"""What is logged goes to systemd's journal with its level and its facts as fields, where systemd started us.

    journald.use()                                        # first thing of a service's process
    log.info("A.", extra=fields(priority=ERROR, alarm="ESTOP"))   # journalctl DIRECTRIX_ALARM=ESTOP, -p err

The native protocol (systemd.io/JOURNAL_NATIVE_PROTOCOL): a datagram of FIELD=value lines; nothing waits for
it, and where nobody takes it the line is lost, as the machine goes before its log.
"""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import struct
from typing import Any

SOCKET = "/run/systemd/journal/socket"
ERROR, WARNING, NOTICE, INFO = 3, 4, 5, 6  # of syslog(3)
LEVELS = ((logging.ERROR, ERROR), (logging.WARNING, WARNING), (logging.INFO, INFO), (0, 7))
MAX_BYTES = 60_000  # of a value
_FIELDS = "journal_fields"


def has_stderr() -> bool:
    """Whether stderr leads there; a terminal of a desktop hands the variable down, too."""
    with contextlib.suppress(OSError):
        facts = os.fstat(2)
        return os.environ.get("JOURNAL_STREAM") == f"{facts.st_dev}:{facts.st_ino}"
    return False


def use(address: str = SOCKET) -> bool:
    """Have all logging go there; False where systemd has not started this process."""
    if not has_stderr():
        return False
    logging.basicConfig(level=logging.INFO, handlers=[Journal(address)], force=True)
    return True


def in_use() -> bool:
    """Whether what is logged goes there."""
    return any(isinstance(one, Journal) for one in logging.getLogger().handlers)


def fields(priority: int, **facts: object) -> dict[str, Any]:
    """As ``extra`` of a line: its level for the journal, and facts that it can be found by."""
    named = {f"DIRECTRIX_{name.upper()}": str(value) for name, value in facts.items()}
    return {_FIELDS: {"PRIORITY": str(priority), **named}}


class Journal(logging.Handler):
    """Sends each line as an entry of its own."""

    def __init__(self, address: str) -> None:
        super().__init__()
        self._address = address
        self._own = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._own.setblocking(False)
        self.setFormatter(logging.Formatter("%(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._send(record)
        except Exception:  # as of any handler: no line of a log ends what was logged
            self.handleError(record)

    def _send(self, record: logging.LogRecord) -> None:
        level = next(priority for least, priority in LEVELS if record.levelno >= least)
        found = {
            "MESSAGE": self.format(record),
            "PRIORITY": str(level),
            "SYSLOG_IDENTIFIER": "directrix",
            "LOGGER": record.name,
            **getattr(record, _FIELDS, {}),
        }
        with contextlib.suppress(OSError):
            self._own.sendto(entry(found), self._address)

    def close(self) -> None:
        self._own.close()
        super().close()


def entry(found: dict[str, str]) -> bytes:
    """A value of several lines has its length before it."""
    parts = []
    for name, value in found.items():
        data = value.encode("utf-8", "backslashreplace")[:MAX_BYTES]
        if b"\n" in data:
            parts.append(name.encode() + b"\n" + struct.pack("<Q", len(data)) + data)
        else:
            parts.append(name.encode() + b"=" + data)
    return b"\n".join(parts) + b"\n"
