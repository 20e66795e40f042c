"""Sealed files: whatever becomes of their bytes, no other values than those that were written come out."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path
from typing import Any

import pytest
from support.suite import seed

from controller import sealed_file
from controller.sealed_file import Damaged

FIRST: dict[str, Any] = {"tools": {"2": {"radius_mm": 1.5}}, "on": [True, None, -0.0, 1e-7], "text": "Fräser"}
SECOND = {**FIRST, "tools": {"2": {"radius_mm": 2.5}}}
HARMED = (Damaged, OSError)


def written(folder: Path, name: str = "fitting.json") -> Path:
    """In a folder where all of that name are sealed."""
    file = folder / name
    sealed_file.write(file, SECOND)
    sealed_file.mark(folder, [name])
    return file


@pytest.mark.parametrize("values", [FIRST, [1, "a"], 7, None, "", {"value": 3}, {}, 0.1 + 0.2])
def test_what_was_written_is_read(values: Any, tmp_path: Path) -> None:
    file = tmp_path / "any.json"
    sealed_file.write(file, values)
    assert sealed_file.read(file) == values
    sealed_file.write(file, SECOND)
    assert sealed_file.read(file) == SECOND and list(tmp_path.iterdir()) == [file]


def test_no_flip_of_a_bit_changes_what_is_read(tmp_path: Path) -> None:
    file = written(tmp_path)
    whole, found = file.read_bytes(), 0
    for at in range(8 * len(whole)):
        flipped = bytearray(whole)
        flipped[at // 8] ^= 1 << at % 8
        file.write_bytes(flipped)
        try:
            assert sealed_file.read(file) == SECOND
        except HARMED:
            found += 1
    assert found > 7 * len(whole)  # some only change the case of a hex digit in an escape, or a space


def test_no_cut_or_swapped_file_is_read(tmp_path: Path) -> None:
    file, other = written(tmp_path), written(tmp_path, "usage.json")
    whole = file.read_bytes()
    for length in range(len(whole)):
        file.write_bytes(whole[:length])
        with pytest.raises(HARMED):
            sealed_file.read(file)
    for data in (other.read_bytes(), b"{}", b"3", b"null", b"\xff"):
        file.write_bytes(data)
        with pytest.raises(HARMED):
            sealed_file.read(file)


def test_pieces_of_sealed_files_put_together_are_none(tmp_path: Path) -> None:
    rng = random.Random(seed.SEED)
    file, other = written(tmp_path), written(tmp_path, "usage.json")
    texts = [file.read_bytes(), other.read_bytes(), sealed_file.text(FIRST, file.name).encode()]
    for _ in range(500):
        first, last = rng.choice(texts), rng.choice(texts)
        file.write_bytes(first[: rng.randrange(len(first))] + last[rng.randrange(len(last)) :])
        with contextlib.suppress(HARMED):
            assert sealed_file.read(file) in (FIRST, SECOND)


def test_without_a_seal_only_a_file_of_a_version_before_is_read(tmp_path: Path) -> None:
    file = tmp_path / "usage.json"
    file.write_text('{"a": 1}')
    assert sealed_file.read(file) == {"a": 1}
    sealed_file.mark(tmp_path, ["usage.json", "none.json"])
    with pytest.raises(Damaged):
        sealed_file.read(file)
