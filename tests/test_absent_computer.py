"""A live test fails, but where the computer's host says that it was not there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# The host's figures are a file here, which the tests themselves write.
TESTS = """
import pytest
from support.suite.absent_computer import STAT

def passes_by(worked, kept):
    columns = [int(x) for x in STAT.read_text().split()[1:]]
    STAT.write_text(f"cpu {columns[0] + worked} 0 0 0 0 0 0 {columns[7] + kept}")

@pytest.mark.live
def test_there():
    passes_by(100, 8)
    assert False, "its own fault"

@pytest.mark.live
def test_away():
    passes_by(100, 10)
    assert False, "the host's doing"

@pytest.mark.live
def test_passes():
    passes_by(100, 100)

@pytest.mark.live
def test_behind_it():
    assert False, "on the same machine"

def test_not_live():
    passes_by(100, 100)
    assert False, "its own fault, too"
"""


@pytest.mark.parametrize("name", ["there", "away", "not_live"])
def test_a_live_test_that_fails_is_skipped_only_where_the_host_kept_the_time_from_it(
    name: str, tmp_path: Path
) -> None:
    said = _run(tmp_path, "-k", f"test_{name}")
    assert ("1 skipped" in said) is (name == "away") and ("1 failed" in said) is (name != "away"), said
    assert name != "away" or "kept 9 % of the processors' time from it; AssertionError: the host's" in said


def test_what_fails_behind_it_in_the_same_file_is_skipped_too_and_what_passes_has_passed(
    tmp_path: Path,
) -> None:
    said = _run(tmp_path)
    assert "2 failed, 1 passed, 2 skipped" in said, said


def _run(folder: Path, *words: str) -> str:
    (folder / "stat").write_text("cpu 100 0 0 0 0 0 0 0")
    (folder / "conftest.py").write_text((ROOT / "tests/conftest.py").read_text())
    (folder / "test_these.py").write_text(TESTS)
    told = [sys.executable, "-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider", *words, str(folder)]
    settings = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(folder)]
    env = {"DIRECTRIX_HOST_STAT": str(folder / "stat"), "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    return subprocess.run([*told, *settings], env=env, capture_output=True, text=True).stdout
