"""What tests of several commands stand on."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def runtime() -> Iterator[Path]:
    """A folder that is not there yet; its path is short, as that of a socket must be."""
    with tempfile.TemporaryDirectory(prefix="directrix-") as folder:
        yield Path(folder) / "run"
