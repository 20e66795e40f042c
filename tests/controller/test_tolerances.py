"""The page of tolerances says what the code compares with."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

README = Path(__file__).parents[2] / "controller" / "README.md"
ROW = re.compile(r"^\| `([a-z_.]+)\.([A-Z_]+)` \| ([0-9.e-]+) \|", re.M)
ROWS = ROW.findall(README.read_text(encoding="utf-8"))


def test_the_page_has_them() -> None:
    assert len(ROWS) > 15


@pytest.mark.parametrize(("module", "name", "value"), ROWS)
def test_a_constant_is_what_the_page_says(module: str, name: str, value: str) -> None:
    assert getattr(import_module(f"controller.{module}"), name) == float(value)
