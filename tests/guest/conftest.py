"""These tests need a kernel with CAN and are run by ``run``; elsewhere they are not collected."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import pytest

HERE = "DIRECTRIX_GUEST" in os.environ
collect_ignore_glob = [] if HERE else ["test_*.py"]

if HERE:
    from guest import absence

    @pytest.fixture(scope="session", autouse=True)
    def _watched() -> Iterator[None]:
        with absence.watched():
            yield

    @pytest.fixture(autouse=True)
    def _absence(_watched: None) -> Iterator[None]:
        """What the computer says of the time of a test is shown where it fails."""
        began_s = time.monotonic()
        yield
        print(absence.since(began_s))
