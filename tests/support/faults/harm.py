"""What disks, copies and hands do to files: a bit turned over, pieces cut off, left out, doubled, exchanged.

DIRECTRIX_HARMS=10 python -m pytest -m slow ...     # ten times as many
"""

from __future__ import annotations

import os
import random
from pathlib import Path

MORE = float(os.environ.get("DIRECTRIX_HARMS", 1))
PAGE = 4096  # of a database
PARTS = range(30)  # of thousands, each drawn by itself: a share of the slow tests takes one


def times(number: int) -> int:
    return round(number * MORE)


def harmed(data: bytes, rng: random.Random) -> bytes:
    """Of a database half of the pieces are pages."""
    if (kind := rng.randrange(8)) < 4:
        return flipped(data, rng)
    unit = PAGE if len(data) > 2 * PAGE and rng.random() < 0.5 else 1
    a, b, c = sorted(min(len(data), unit * rng.randrange(len(data) // unit + 1)) for _ in range(3))
    if kind == 7 and unit == PAGE:
        c = b + min(b - a, len(data) - b)  # pages as large as those that they are exchanged with
    return (data[:a], data[:a] + data[b:], data[:b] + data[a:], data[:a] + data[b:c] + data[a:b] + data[c:])[
        kind - 4
    ]


def flipped(data: bytes, rng: random.Random) -> bytes:
    """One bit, where there is something: most of a database is zeros."""
    for _ in range(100):
        if data[at := rng.randrange(len(data))]:
            break
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def exchanged(files: list[Path], rng: random.Random) -> Path | None:
    """A file in the place of another of its kind, which is gone or in its place; None: there is no other."""
    file = rng.choice(files)
    others = [one for one in files if one != file and one.suffix == file.suffix]
    if not others:
        return None
    other = rng.choice(others)
    here, there = file.read_bytes(), other.read_bytes()
    write(file, there)
    if rng.random() < 0.5:
        write(other, here)
    return file


def write(file: Path, data: bytes) -> None:
    """Nobody has written it: it is as old as it was."""
    old = file.stat()
    file.write_bytes(data)
    os.utime(file, ns=(old.st_atime_ns, old.st_mtime_ns))
