"""What a process keeps and gives back; arrays that come and go cost no pages once freed memory is kept."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

ARRAYS_COME_AND_GO = """
import resource
import numpy as np
from controller import memory
def pages() -> int:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(50):
        np.ones(200_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
memory.keep_freed()
pages()
print(pages())
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="another C library than glibc")
def test_an_array_of_the_size_of_the_last_one_takes_its_pages() -> None:
    told = subprocess.run([sys.executable, "-c", ARRAYS_COME_AND_GO], capture_output=True, check=True)
    one_array = 200_000 * 8 // 4096
    assert int(told.stdout) < one_array, "fifty arrays make the pages of less than one"


KEPT_IN_THOUSANDS = """
import gc
from controller import memory
def collections() -> int:
    return sum(generation["collections"] for generation in gc.get_stats())
memory.collect_rarely()
before = collections()
kept = [(float(n), [n]) for n in range(200_000)]
print(collections() - before)
"""


def test_what_is_kept_in_thousands_is_hardly_looked_through_and_rubbish_is_still_collected() -> None:
    told = subprocess.run([sys.executable, "-c", KEPT_IN_THOUSANDS], capture_output=True, check=True)
    assert 1 <= int(told.stdout) <= 8, "by default some 640 times"


GIVEN_BACK = """
from pathlib import Path
from controller import memory
def mb() -> float:
    rows = Path("/proc/self/status").read_text().splitlines()
    return next(int(row.split()[1]) / 1024.0 for row in rows if row.startswith("RssAnon"))
@memory.remembered(1)
def large(_: int) -> list[bytes]:
    return [bytes(1000) for _ in range(50_000)]
large(1)
kept = large(2)[-1]
full_mb = mb()
memory.forget()
memory.give_back()
print(full_mb - mb())
assert large.cache_info().currsize == 0
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="another C library than glibc")
def test_what_is_forgotten_is_given_back() -> None:
    told = subprocess.run([sys.executable, "-c", GIVEN_BACK], capture_output=True, check=True)
    assert float(told.stdout) > 40.0, "MB of 50"
