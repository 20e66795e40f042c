"""Arrays of ``.npz`` files; what is damaged is one error, whatever zip, zlib and numpy say of it.

``numpy.load`` reads as far as an array's head says, so a head that lost rows is taken for true: here each
part is read to its end, where its sum is.
"""

from __future__ import annotations

import contextlib
import zipfile
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

PART = ".npy"  # after the name of an array


def read(file: str | Path, wanted: Collection[str] = ()) -> dict[str, npt.NDArray[Any]]:
    """Arrays by name: those that are wanted, as far as there are, or all.

    Raises OSError where it cannot be opened, and ValueError for what is none or was damaged.
    """
    with _opened(file) as packed:
        chosen = [part for part in packed.namelist() if not wanted or part.removesuffix(PART) in wanted]
        return {part.removesuffix(PART): _array(packed, part) for part in chosen}


def names(file: str | Path) -> set[str]:
    """Names of its arrays. Raises as ``read``."""
    with _opened(file) as packed:
        return {part.removesuffix(PART) for part in packed.namelist()}


def _array(packed: zipfile.ZipFile, part: str) -> npt.NDArray[Any]:
    with packed.open(part) as data:
        found: npt.NDArray[Any] = np.lib.format.read_array(data, allow_pickle=False)
        if data.read(1):
            raise ValueError(f"{part} has more than its array")
        return found


def check(data: BinaryIO) -> None:
    """Reads all parts of an open file to their sums. Raises ValueError where one is damaged."""
    with _unpacked(data) as packed:
        if (bad := packed.testzip()) is not None:
            raise zipfile.BadZipFile(bad)


@contextlib.contextmanager
def _opened(file: str | Path) -> Iterator[zipfile.ZipFile]:
    with open(file, "rb") as data, _unpacked(data) as packed:
        yield packed


@contextlib.contextmanager
def _unpacked(data: BinaryIO) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(data) as packed:
            yield packed
    except Exception as error:  # BadZipFile, zlib.error, EOFError, MemoryError, SyntaxError of a head ...
        raise ValueError(f"{type(error).__name__}: {error}") from error
