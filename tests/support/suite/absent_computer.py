"""Tests of a machine in real time, on a computer that may not have been there at the time.

A virtual computer says how long it was ready to run and its host ran something else: the column
"steal" of /proc/stat (Linux, proc(5)). A live test that failed in such a time has shown nothing. It
is begun anew, and skipped with the figure when the computer does not come back; where the computer
was there it fails as any other test.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol

STAT = Path(os.environ.get("DIRECTRIX_HOST_STAT", "/proc/stat"))  # a guest's own kernel knows nothing of it
USER, NICE, SYSTEM, STEAL = 0, 1, 2, 7  # columns of the line "cpu"
MOST = 0.08  # of the time that was wanted; 0.01 to 0.02 is what a quiet host takes
TURNS = 3


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


def run(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """The whole protocol of one live test: at most ``TURNS`` turns, the last one reported."""
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for turn in range(1, TURNS + 1):
        before = times()
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        kept = share(before, times())
        void = kept > MOST and any(report.failed for report in reports)
        if not void or turn == TURNS:
            break
        # Whatever the machine of this test has become, the next turn has another one.
        item.session._setupstate.teardown_exact(None)
        item._initrequest()  # type: ignore[attr-defined]
    for report in reports:
        if void and report.failed:
            _skip(
                report, item, f"the computer's host kept {100 * kept:.0f} % of the processors' time from it"
            )
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)


def _skip(report: pytest.TestReport, item: pytest.Item, reason: str) -> None:
    path, line, _ = item.location
    report.outcome = "skipped"
    report.longrepr = (path, line or 0, f"Skipped: {reason}, {TURNS} times; last: {_first(report)}")


def _first(report: pytest.TestReport) -> str:
    """What had failed, in a line."""
    crash = getattr(report.longrepr, "reprcrash", None)
    return str(crash.message).partition("\n")[0] if crash else "?"
