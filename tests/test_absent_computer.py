"""A live test fails, but where the computer's host says that it was not there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# The host's figures are a file here, which the tests themselves write.
HEAD = """
import pytest
from support.suite.absent_computer import STAT

def passes_by(worked, kept):
    columns = [int(x) for x in STAT.read_text().split()[1:]]
    STAT.write_text(f"cpu {columns[0] + worked} 0 0 0 0 0 0 {columns[7] + kept}")
"""
TESTS = {
    "there": """
@pytest.mark.live
def test_there():
    passes_by(100, 8)
    assert False, "its own fault"
""",
    "away": """
@pytest.mark.live
def test_away():
    passes_by(100, 10)
    assert False, "the host's doing"
""",
    "passes": """
@pytest.mark.live
def test_passes():
    passes_by(100, 100)
""",
    "behind_it": """
@pytest.mark.live
def test_behind_it():
    assert False, "on the same machine"
""",
    "not_live": """
def test_not_live():
    passes_by(100, 100)
    assert False, "its own fault, too"
""",
}


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What pytest tells of each of these tests in a file of its own, and of all in one."""
    folder = tmp_path_factory.mktemp("live")
    (folder / "stat").write_text("cpu 100 0 0 0 0 0 0 0")
    (folder / "conftest.py").write_text((ROOT / "tests/conftest.py").read_text())
    for name, text in {**TESTS, "all_of_them": "".join(TESTS.values())}.items():
        (folder / f"test_{name}.py").write_text(HEAD + text)
    # Of the plugins that are installed that one alone which pyproject.toml has an option of.
    plugins = ["-p", "no:cacheprovider", "-p", "xdist.plugin"]
    words = [sys.executable, "-m", "pytest", "-v", "-rs", *plugins, str(folder)]
    settings = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(folder)]
    env = {"DIRECTRIX_HOST_STAT": str(folder / "stat"), "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    env["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    return subprocess.run([*words, *settings], env=env, capture_output=True, text=True).stdout


@pytest.mark.parametrize("name", ["there", "away", "not_live"])
def test_a_live_test_that_fails_is_skipped_only_where_the_host_kept_the_time_from_it(
    name: str, told: str
) -> None:
    came = "SKIPPED" if name == "away" else "FAILED"
    assert f"test_{name}.py::test_{name} {came}" in told, told
    why = "kept 9 % of the processors' time from it; AssertionError: the host's"
    assert name != "away" or re.search(rf"test_{name}\.py:.*{why}", told), told


def test_what_fails_behind_it_in_the_same_file_is_skipped_too_and_what_passes_has_passed(told: str) -> None:
    came = re.findall(r"test_all_of_them\.py::test_(\w+) ([A-Z]+)", told.partition("short test summary")[0])
    outcomes = {"there": "FAILED", "away": "SKIPPED", "passes": "PASSED", "behind_it": "SKIPPED"}
    assert dict(came) == {**outcomes, "not_live": "FAILED"}, told
