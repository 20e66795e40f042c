"""Setpoints of a record in segments: whatever becomes of one, no other rows are read than were written."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.messages import text
from controller.service import run_file
from controller.service.run_file import RunFile
from controller.state import setpoints
from controller.state.setpoints import ACTUAL, SETPOINTS, TABLES, Counts, SpoiltSegment

SEED = 20
ROWS_EACH = 40  # of a segment
TICKS = 5 * ROWS_EACH + 7


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setpoints, "SEGMENT_BYTES", ROWS_EACH * SETPOINTS.row_bytes)


def counts(seed: int = SEED) -> Counts:
    """Of axes that go to and fro, and jump from one end of the numbers to the other."""
    rng = np.random.default_rng(seed)
    found = np.cumsum(rng.integers(-300, 300, (TICKS, 5)), axis=0).astype(np.int32)
    found[77], found[78] = np.iinfo(np.int32).max, np.iinfo(np.int32).min
    return found


def written(state: Path, name: str = "a", seed: int = SEED) -> RunFile:
    """A record whose service is still there; as it comes, a few rows at once."""
    folder = state / "runs" / name
    folder.mkdir(parents=True)
    file, rng, rows = RunFile(folder), random.Random(seed), counts(seed)
    at = 0
    while at < TICKS:
        more = rng.randrange(1, 3 * ROWS_EACH)
        for table in TABLES:
            file.rows(table, at, rows[at : at + more, : len(table.columns)])
        at += more
    assert not file.problem
    return file


def packed(state: Path, name: str = "a", seed: int = SEED) -> Path:
    file = written(state, name, seed)
    file.close()
    file.pack()
    return state / "runs" / name


def test_rows_are_read_as_they_were_written_while_they_come_and_once_they_are_packed(tmp_path: Path) -> None:
    file, folder = written(tmp_path), tmp_path / "runs" / "a"
    for step in (lambda: None, file.pack, file.close, file.pack):
        step()
        for table in TABLES:
            np.testing.assert_array_equal(table.read(folder), counts()[:, : len(table.columns)])
            assert table.ticks(folder) == TICKS
            most = setpoints.SEGMENT_BYTES // table.row_bytes
            assert all(len(piece.rows) <= most for piece in table.pieces(folder))
    assert len(SETPOINTS.segments(folder)) == 6 and not list(folder.glob("*.part"))


def test_a_killed_service_costs_the_frame_that_it_was_writing_and_no_segment(tmp_path: Path) -> None:
    written(tmp_path).pack()
    folder = tmp_path / "runs" / "a"
    last = SETPOINTS.segments(folder)[-1].file
    data = last.read_bytes()
    for torn in (1, 7, len(data) // 2, len(data) - 23, len(data) - 1, len(data)):
        last.write_bytes(data[:-torn])
        (*whole, piece) = SETPOINTS.pieces(folder)
        assert piece.spoilt is None and piece.end <= TICKS and whole[-1].end == 5 * ROWS_EACH
        np.testing.assert_array_equal(SETPOINTS.read(folder), counts()[: piece.end])


class Killed(BaseException):
    """Nothing is tidied up after it."""


@pytest.mark.parametrize("moment", ["while it is written", "before its rows go"])
def test_a_service_killed_as_it_packs_a_segment_leaves_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    file, folder = written(tmp_path), tmp_path / "runs" / "a"

    def killed(out: Any, *_: object, **__: object) -> None:
        if moment == "while it is written":
            out.write(b"PK\x03\x04")
        raise Killed

    where = (np, "savez_compressed") if moment == "while it is written" else (run_file.atomic_file, "sync")
    monkeypatch.setattr(*where, killed)
    with pytest.raises(Killed):
        file.pack()
    monkeypatch.undo()
    left = {one.name for one in folder.iterdir()}
    assert {"setpoints.part"} <= left and ({"setpoints.npz.new", "setpoints.npz"} & left)
    np.testing.assert_array_equal(SETPOINTS.read(folder), counts())


def spoil(name: str, change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def do(folder: Path) -> None:
        file = folder / name
        file.write_bytes(change(file.read_bytes()))

    return do


THIRD = SETPOINTS.name(2 * ROWS_EACH)
WRONG = {
    "empty": (spoil(THIRD, lambda data: b""), "zip file"),
    "cut": (spoil(THIRD, lambda data: data[:-30]), "zip file"),
    "gone": (lambda folder: (folder / THIRD).unlink(), "it is missing"),
    "of another place": (
        lambda folder: (folder / THIRD).write_bytes((folder / SETPOINTS.name(ROWS_EACH)).read_bytes()),
        "of another place or record",
    ),
    "of another table": (
        lambda folder: (folder / THIRD).write_bytes((folder / ACTUAL.name(2 * ROWS_EACH)).read_bytes()),
        "of another place or record",
    ),
    "of another run": (
        lambda folder: (folder / THIRD).write_bytes((folder.parent / "b" / THIRD).read_bytes()),
        "of another place or record",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_spoilt_segment_is_named_with_its_tick_and_costs_no_other(tmp_path: Path, what: str) -> None:
    folder = packed(tmp_path)
    packed(tmp_path, "b", SEED + 1)
    do, why = WRONG[what]
    do(folder)
    (spoilt,) = [piece for piece in SETPOINTS.pieces(folder) if piece.spoilt is not None]
    assert (spoilt.file.name, spoilt.end) == (THIRD, 2 * ROWS_EACH)
    assert why in text(spoilt.spoilt)
    for piece in SETPOINTS.pieces(folder):
        np.testing.assert_array_equal(piece.rows, counts()[piece.first : piece.end])
    assert sum(len(piece.rows) for piece in SETPOINTS.pieces(folder)) == TICKS - ROWS_EACH
    with pytest.raises(SpoiltSegment, match=f"The segment {THIRD} cannot be read from tick 80 on"):
        SETPOINTS.read(folder)
    assert ACTUAL.read(folder) is not None


@pytest.mark.parametrize("is_packed", [True, False])
def test_no_bit_of_a_segment_changes_its_rows_without_a_word(tmp_path: Path, is_packed: bool) -> None:
    """Nor does a bit take rows away, where its service was not killed as it wrote them."""
    if is_packed:
        folder, file = packed(tmp_path), THIRD
    else:
        written(tmp_path)
        folder, file = tmp_path / "runs" / "a", SETPOINTS.name(2 * ROWS_EACH, setpoints.PART)
    data, rng, seen = (folder / file).read_bytes(), random.Random(SEED), 0
    for _ in range(60):
        flipped = bytearray(data)
        flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        (folder / file).write_bytes(flipped)
        pieces = list(SETPOINTS.pieces(folder))
        for piece in pieces:
            np.testing.assert_array_equal(piece.rows, counts()[piece.first : piece.end], f"{SEED}")
        spoilt = [piece.file.name for piece in pieces if piece.spoilt is not None]
        assert spoilt in ([file], []), SEED
        assert spoilt or sum(len(piece.rows) for piece in pieces) == TICKS, SEED
        seen += bool(spoilt)
    assert seen > (20 if is_packed else 59)


def test_what_an_older_version_has_written_is_read(tmp_path: Path) -> None:
    rows = np.hstack([np.arange(TICKS)[:, np.newaxis], counts()]).astype("<i4")
    (tmp_path / "setpoints.part").write_bytes(rows.tobytes()[:-3])
    np.testing.assert_array_equal(SETPOINTS.read(tmp_path), counts()[:-1])
    np.savez_compressed(tmp_path / "setpoints.npz", columns=np.array(["tick", *SETPOINTS.columns]), rows=rows)
    np.testing.assert_array_equal(SETPOINTS.read(tmp_path), counts())
    assert ACTUAL.read(tmp_path) is None and SETPOINTS.ticks(tmp_path) == TICKS


def test_files_of_a_run_are_read_where_they_were_copied_alone(tmp_path: Path) -> None:
    """As a browser saves them: nothing beside them says of which run they are."""
    run = Path(__file__).resolve().parents[2] / "data" / "runs" / "jog_aside"
    shutil.copy(run / "setpoints.npz", tmp_path)
    found, whole = SETPOINTS.read(tmp_path), SETPOINTS.read(run)
    assert found is not None and whole is not None and np.array_equal(found, whole)
