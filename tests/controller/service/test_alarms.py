"""Alarms on the disk: what ends a run on a full disk is still written, and no bit changes what one says."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from controller import own_files, sealed_file
from controller.messages import message
from controller.service import alarms
from controller.service.alarms import RESERVE, Alarms


def test_on_a_full_disk_the_reserve_takes_the_alarm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Alarms(tmp_path)
    assert (tmp_path / RESERVE).stat().st_size == alarms.RESERVE_BYTES
    real = own_files.opened

    def full(file: Path, *more: object, **named: object) -> object:
        if file.name == alarms.FILE and (tmp_path / RESERVE).exists():
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(file, *more, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(own_files, "opened", full)
    kept.add("ESTOP", message("stopped"))
    assert not (tmp_path / RESERVE).exists()
    monkeypatch.undo()
    assert [one["name"] for one in Alarms(tmp_path).list()] == ["ESTOP"]
    assert (tmp_path / RESERVE).exists()


def test_no_flip_of_a_bit_changes_what_an_alarm_says(tmp_path: Path) -> None:
    Alarms(tmp_path).add("ESTOP", message("stopped"), axis="X")
    sealed_file.adopt(tmp_path, [alarms.FILE])
    file = tmp_path / alarms.FILE
    whole = file.read_bytes()
    known = alarms._read(file)
    assert known[1] is None
    for at in range(8 * len(whole)):
        flipped = bytearray(whole)
        flipped[at // 8] ^= 1 << at % 8
        file.write_bytes(flipped)
        found, damaged = alarms._read(file)
        assert damaged is not None or found == known[0], bytes(flipped)


def test_an_alarm_that_waits_to_be_confirmed_is_found_after_many_others(tmp_path: Path) -> None:
    known = Alarms(tmp_path)
    first = known.add("FILE_DAMAGED", message("stopped"))
    for _ in range(alarms.SHOWN + 10):
        known.add("OTHER", message("stopped"))
    assert known.unconfirmed("FILE_DAMAGED") == first
    known.acknowledge(first["id"])
    assert known.unconfirmed("FILE_DAMAGED") is None
