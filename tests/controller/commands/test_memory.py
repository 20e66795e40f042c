"""Arrays that come and go cost no pages once freed memory is kept."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

ARRAYS_COME_AND_GO = """
import resource
import numpy as np
from controller.commands import memory
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
