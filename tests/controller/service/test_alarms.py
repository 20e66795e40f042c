"""Alarms in the store: what ends a run on a full disk is still written, and who waits to be seen is found."""

from __future__ import annotations

import contextlib
import errno
from pathlib import Path

import pytest

from controller.ipc.control_socket import CommandRefused
from controller.messages import message
from controller.service import alarms
from controller.service.alarms import Alarms
from controller.store.service_store import RESERVE, RESERVE_BYTES, ServiceStore


def test_on_a_full_disk_the_reserve_takes_the_alarm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known, real = Alarms(ServiceStore(tmp_path)), ServiceStore.write
    assert (tmp_path / RESERVE).stat().st_size == RESERVE_BYTES

    def full(store: ServiceStore) -> object:
        if (tmp_path / RESERVE).exists():
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(store)

    monkeypatch.setattr(ServiceStore, "write", full)
    known.add("ESTOP", message("stopped"))
    assert not (tmp_path / RESERVE).exists()
    monkeypatch.undo()
    assert [one["name"] for one in Alarms(ServiceStore(tmp_path)).list()] == ["ESTOP"]
    assert (tmp_path / RESERVE).exists()


def test_alarms_are_there_after_a_restart_as_they_were_last_and_no_more_than_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alarms, "KEPT", 5)
    known = Alarms(ServiceStore(tmp_path))
    for n in range(9):
        known.add("OTHER", message("stopped"), axis="X", n=n)
    known.change(9, recording="x")
    assert known.acknowledge(8) == 1 and known.acknowledge(8) == 0
    with pytest.raises(CommandRefused):
        known.acknowledge(4)
    again = Alarms(ServiceStore(tmp_path))
    assert again.list() == known.list() and [one["n"] for one in again.list()] == [8, 7, 6, 5, 4]
    assert again.list()[0]["recording"] == "x" and again.list()[1]["acknowledged_s"] is not None
    assert again.add("NEXT", message("stopped"))["id"] == 10


def test_an_alarm_that_waits_to_be_confirmed_is_found_after_many_others(tmp_path: Path) -> None:
    known = Alarms(ServiceStore(tmp_path))
    first = known.add("FILE_DAMAGED", message("stopped"))
    for _ in range(alarms.SHOWN + 10):
        known.add("OTHER", message("stopped"))
    assert known.unconfirmed("FILE_DAMAGED") == first
    known.acknowledge(first["id"])
    assert known.unconfirmed("FILE_DAMAGED") is None


def test_what_a_disk_did_not_take_goes_with_the_next_that_it_takes(tmp_path: Path) -> None:
    with contextlib.closing(ServiceStore(tmp_path)) as store:
        known = Alarms(store)
        store.rows("PRAGMA query_only = 1")
        lost = known.add("ESTOP", message("stopped"))
        store.rows("PRAGMA query_only = 0")
        assert store.rows("SELECT id FROM alarms") == []
        known.add("TEST", message("stopped"))
        assert Alarms(store).list()[1] == lost
