"""What to do next, as the page shows it, and what stands there of a run that ended early."""

from __future__ import annotations

from typing import Any

import pytest
from support.live.browser import Site, until

from controller.messages import message

pytestmark = pytest.mark.slow

WHY = message("ended.why", program="MDI G38.2 Z-5", line=1, why=message("probe.not_touched", code="G38.2"))
CHANGE = message("changing", out=1, into=2, number=3, steps=7, step="Grip")


@pytest.mark.parametrize("view", ["run", "jog"])
def test_why_a_run_ended_early_stands_where_the_operator_does_until_it_was_seen(
    page: Any, site: Site, view: str
) -> None:
    site.tell(ended_early=WHY)
    page.evaluate(f"dx.show('{view}')")
    line = f"section[data-view={view}] .ended"
    page.wait_for_selector(f"{line} >> text=G38.2: the probe has come to the end of its way")
    before = len(site.commands("seen"))
    page.click(f"{line} button")
    until(lambda: len(site.commands("seen")) > before, "that it was seen")
    site.tell()
    page.wait_for_selector(line, state="detached")


def test_a_tool_change_is_told_in_the_chip_with_its_step(page: Any, site: Site) -> None:
    site.tell(mode="TOOL_CHANGE", change=CHANGE)
    page.wait_for_selector("body[data-mode=TOOL_CHANGE] .mode-word:has-text('Tool change')")
    page.wait_for_selector(".mode-more:has-text('T1 away, T2 in: step 3 of 7, Grip.')")


def test_start_is_green_only_where_it_starts_and_says_with_what(page: Any, site: Site) -> None:
    starts = message("starts", program="a.ngc", line=12, tool=4, offset="G55")
    job = {"name": "a.ngc", "sha256": "0", "state": "loaded", "starts": starts}
    start = "section[data-view=run] .cycle [data-call='POST cycle/start']"
    site.tell(mode="READY", job=job, can_start=True)
    page.wait_for_selector(f"{start}[data-kind=go]:not([aria-disabled])")
    page.wait_for_selector(".next strong:text-is('Start a.ngc from line 12, with T4 and G55.')")
    page.click(start)
    page.wait_for_selector(".dx-ask >> text=a.ngc from line 12, with T4 and G55")
    page.keyboard.press("Escape")
    site.tell(mode="READY", job=job, can_start=False, not_homed=["X"])
    page.wait_for_selector(f"{start}[aria-disabled][title='Home all axes.']:not([data-kind=go])")
