"""What a service logs is in systemd's journal with its level and its facts, and nothing waits for it."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.machines.stepped_runs import shipped

from controller import journald
from controller.ipc.asker import Asker
from controller.messages import message
from controller.service import node_status, runs
from controller.service.alarms import Alarms
from controller.service.requests import Requests
from controller.store.service_store import ServiceStore
from drives import pdo


@pytest.fixture
def journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """The journal's own end."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    stderr = os.fstat(2)
    monkeypatch.setenv("JOURNAL_STREAM", f"{stderr.st_dev}:{stderr.st_ino}")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.bind(str(tmp_path / "socket"))
        end.settimeout(20.0)
        assert journald.use(str(tmp_path / "socket")) and journald.in_use()
        yield end
    root.handlers[:], root.level = handlers, level


def found(data: bytes) -> dict[str, str]:
    """An entry as the journal reads it."""
    fields = {}
    while data:
        line, _, rest = data.partition(b"\n")
        name, is_short, value = line.partition(b"=")
        if not is_short:
            (length,) = struct.unpack_from("<Q", rest)
            value, rest = rest[8 : 8 + length], rest[8 + length + 1 :]
        fields[name.decode()], data = value.decode(), rest
    return fields


def test_a_line_has_its_level_and_one_of_several_lines_stays_whole(journal: socket.socket) -> None:
    for log, priority in ((logging.error, "3"), (logging.warning, "4"), (logging.info, "6")):
        log("first\nPRIORITY=0\nsecond = %s", "ä")
        entry = found(journal.recv(100_000))
        assert entry["PRIORITY"] == priority and entry["MESSAGE"] == "first\nPRIORITY=0\nsecond = ä"


def test_an_alarm_and_a_request_are_found_by_their_fields(journal: socket.socket, tmp_path: Path) -> None:
    store = ServiceStore(tmp_path / "state")
    Alarms(store).add("EMERGENCY_STOP", message("stopped"), axis="X")
    entry = found(journal.recv(100_000))
    assert (entry["DIRECTRIX_ALARM"], entry["DIRECTRIX_AXIS"]) == ("EMERGENCY_STOP", "X")
    assert entry["PRIORITY"] == "3"
    Alarms(store).add("FILE_DAMAGED", message("stopped"))
    assert found(journal.recv(100_000))["PRIORITY"] == "4"
    requests = Requests(store)
    with requests.noted("stop", {}, Asker("anna\nPRIORITY=0", "operate", "10.0.0.7"), "panel") as hear:
        hear({})
    requests.close()
    entry = found(journal.recv(100_000))
    assert entry["DIRECTRIX_USER"] == "anna\nPRIORITY=0" and entry["PRIORITY"] == "6"
    assert (entry["DIRECTRIX_REQUEST"], entry["DIRECTRIX_PEER"]) == ("stop", "panel")
    store.close()


def test_a_journal_that_is_full_or_gone_keeps_nobody_waiting(journal: socket.socket) -> None:
    for number in range(5000):
        logging.error("%d %s", number, "x" * 1000)
    journal.close()
    logging.error("nobody hears it")


def test_a_line_that_cannot_be_made_ends_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with contextlib.closing(journald.Journal(str(tmp_path / "socket"))) as handler:
        handler.handle(logging.LogRecord("a", logging.ERROR, "a.py", 1, "%d of them", ("many",), None))
    assert "many" in capsys.readouterr().err


@pytest.mark.parametrize("inherited", [None, "8:1"])
def test_a_log_of_a_terminal_stays_there(inherited: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also of a desktop's, which has the variable of whatever has started it."""
    monkeypatch.delenv("JOURNAL_STREAM", raising=False)
    if inherited is not None:
        monkeypatch.setenv("JOURNAL_STREAM", inherited)
    assert not journald.use("/nowhere") and not journald.in_use()


def test_a_clock_that_is_set_changes_no_age_and_no_duration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = {"wall": 1_000_000.0, "since": 100.0}
    monkeypatch.setattr(node_status.time, "time", lambda: clock["wall"])
    monkeypatch.setattr(node_status.time, "monotonic", lambda: clock["since"])
    log = node_status.LastFrames()
    frame = bytes(pdo.frame(pdo.HEARTBEAT + 1, b"\x05"))
    for one_by_one in (True, False):
        at_s = clock["wall"] - 0.25
        if one_by_one:
            log(frame, at_s)
        else:
            log.extend([(at_s, frame)])
        for jump in (-7200.0, 0.0, 7200.0):
            clock["wall"] += jump
            alive = log.of(pdo.HEARTBEAT + 1)
            assert alive is not None and clock["since"] - alive[0] == pytest.approx(0.25)
    record = runs.RunRecord(tmp_path, shipped(), {"name": "a.ngc", "sha256": "0" * 64})
    clock["wall"], clock["since"] = clock["wall"] - 86400.0, clock["since"] + 12.5
    facts = record.end("completed")
    assert facts["ended_s"] - facts["started_s"] == pytest.approx(12.5)
