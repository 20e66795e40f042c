"""Tests of a machine in real time, on a computer that may not have been there at the time.

A virtual computer says how long it was ready to run and its host ran something else: the column
"steal" of /proc/stat (Linux, proc(5)). A live test that failed in such a time has shown nothing, and is
skipped with the figure; so is what fails behind it in the same file, on a machine that may be the same.
Where the computer was there it fails as any other test, and none is begun anew.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

STAT = Path(os.environ.get("DIRECTRIX_HOST_STAT", "/proc/stat"))  # a guest's own kernel knows nothing of it
USER, NICE, SYSTEM, STEAL = 0, 1, 2, 7  # columns of the line "cpu"
MOST = 0.08  # of the time that was wanted; 0.01 to 0.02 is what a quiet host takes
BEGAN = pytest.StashKey[tuple[int, int]]()  # of a test: the times when it was set up
KEPT = pytest.StashKey[float]()  # of a file: the share that was kept from a test of it that failed


def times() -> tuple[int, int]:
    """What the computer has worked since it was started, and what its host has kept from it."""
    if not STAT.exists():
        return 0, 0
    columns = [int(word) for word in STAT.read_text().partition("\n")[0].split()[1:]]
    return columns[USER] + columns[NICE] + columns[SYSTEM], columns[STEAL]


def share(before: tuple[int, int], after: tuple[int, int]) -> float:
    """Of the time that was wanted in between, what the host kept: 0 to 1."""
    worked, kept = after[0] - before[0], after[1] - before[1]
    return kept / max(1, worked + kept)


def judged(report: pytest.TestReport, item: pytest.Item) -> pytest.TestReport:
    """What came of a step of a live test; a failure is skipped where the computer was not there."""
    if not report.failed:
        return report
    file, kept = item.getparent(pytest.Module) or item, share(item.stash[BEGAN], times())
    if kept > MOST:
        file.stash[KEPT] = kept
    if KEPT in file.stash:
        path, line, _ = item.location
        told = f"the computer's host kept {100 * file.stash[KEPT]:.0f} % of the processors' time from it"
        report.outcome = "skipped"
        report.longrepr = (path, line or 0, f"Skipped: {told}; {_first(report)}")
    return report


def _first(report: pytest.TestReport) -> str:
    """What had failed, in a line."""
    crash = getattr(report.longrepr, "reprcrash", None)
    return str(crash.message).partition("\n")[0] if crash else "?"
