"""Files of arrays: whatever becomes of their bytes, they are as they were, or there is one kind of error."""

from __future__ import annotations

import io
import random
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support.suite.seed import SEED

from controller import npz

ROWS = np.arange(900, dtype="<i4").reshape(100, 9) ** 2
COLUMNS = np.array(["tick", "setpoint_0"])


def written(file: Path) -> bytes:
    np.savez_compressed(file, columns=COLUMNS, rows=ROWS, period_s=0.002)
    return file.read_bytes()


def damage(file: Path, times: int) -> int:
    """How many were noticed."""
    whole, rng, noticed = written(file), random.Random(f"{SEED}-npz"), 0
    for _ in range(times):
        data = bytearray(whole)
        if rng.random() < 0.8:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        else:
            del data[rng.randrange(len(data)) :]
        file.write_bytes(data)
        try:
            found = npz.read(file)
        except ValueError:
            noticed += 1
            continue
        assert "rows" not in found or np.array_equal(found["rows"], ROWS), SEED
        assert "columns" not in found or np.array_equal(found["columns"], COLUMNS), SEED
    return noticed


def test_what_was_written_is_read(tmp_path: Path) -> None:
    written(tmp_path / "a.npz")
    found = npz.read(tmp_path / "a.npz")
    assert np.array_equal(found["rows"], ROWS) and float(found["period_s"]) == 0.002
    assert npz.names(tmp_path / "a.npz") == {"columns", "rows", "period_s"}
    assert npz.read(tmp_path / "a.npz", ["period_s", "none"]).keys() == {"period_s"}


def test_no_damage_gives_other_rows_or_another_error(tmp_path: Path) -> None:
    assert damage(tmp_path / "a.npz", 150) > 100


@pytest.mark.slow
def test_no_damage_of_thousands_does(tmp_path: Path) -> None:
    assert damage(tmp_path / "a.npz", 10_000) > 7000


def test_a_head_that_has_lost_rows_is_noticed(tmp_path: Path) -> None:
    """numpy.load takes it for true: it never comes to the sum."""
    part = io.BytesIO()
    np.lib.format.write_array(part, np.zeros((20000, 9)))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as packed:
        packed.writestr("rows.npy", part.getvalue())
    data = (tmp_path / "a.npz").read_bytes().replace(b"(20000, 9)", b"(10, 9)   ")
    (tmp_path / "a.npz").write_bytes(data)
    with np.load(tmp_path / "a.npz") as file:
        assert file["rows"].shape == (10, 9)
    with pytest.raises(ValueError, match=r"rows\.npy"):
        npz.read(tmp_path / "a.npz")


def test_what_is_no_such_file_is_one_error_and_none_is_another(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", ROWS)
    (tmp_path / "b.npz").write_bytes(b"")
    for name in ("a.npy", "b.npz"):
        with pytest.raises(ValueError, match="BadZipFile"):
            npz.read(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        npz.read(tmp_path / "none.npz")
