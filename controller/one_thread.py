"""numpy's libraries with one thread: set before they are loaded.

They start a thread per processor, wanted or not, which costs a start time and other processes their core; and
where they use them, they sum in another order, so that results would depend on the computer's load.
"""

from __future__ import annotations

import os

ENVIRONMENT = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def set_default() -> None:
    """For this process, unless somebody has chosen otherwise, and for those that it starts."""
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
