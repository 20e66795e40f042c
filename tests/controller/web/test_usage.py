"""Tool life and maintenance on the page: limits, new edges, what is due and what was done about it."""

from __future__ import annotations

from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site, until

pytestmark = pytest.mark.slow


def answer(page: Any, words: str | None = None) -> None:
    """The page's question: what is typed, or yes."""
    if words is not None:
        page.fill(".dx-ask input", words)
    browser.yes(page)
    page.wait_for_selector(".dx-ask", state="detached")


def test_a_tool_gets_a_life_and_a_new_edge(page: Any, site: Site) -> None:
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=usage]")
    page.click("tr[data-tool='1'] [aria-label^='T1 Cut']")
    answer(page, "12,5")
    page.wait_for_selector("tr[data-tool='1'] >> text=0.00 / 12.5 min")
    page.click("tr[data-tool='1'] [aria-label^='T1 Parts']")
    answer(page, "40")
    page.wait_for_selector("tr[data-tool='1'] >> text=0 / 40")
    page.click("tr[data-tool='1'] [aria-label^='T1 Cut']")
    answer(page, "")
    page.wait_for_selector("tr[data-tool='1'] >> text=0.00 / ∞ min")
    page.click("tr[data-tool='1'] [aria-label^='T1 Parts']")
    page.fill(".dx-ask input", "none")
    browser.yes(page)
    page.wait_for_selector("#dx-said:not([hidden])")
    page.click("tr[data-tool='1'] [aria-label='T1: New edge']")
    answer(page)
    (tool,) = until(lambda: site.ask("usage")["tools"], "the tool")
    until(lambda: site.ask("usage")["tools"][0]["since_s"], "the new edge")
    assert (tool["most_cut_min"], tool["most_parts"]) == (None, 40)


def test_maintenance_is_made_done_and_taken_out(page: Any, site: Site) -> None:
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=usage]")
    page.select_option("[data-part=usage] select", "Z")
    page.click("#usage-add")
    page.fill(".dx-ask input", "grease the guides")
    browser.yes(page)
    page.wait_for_selector(".dx-ask >> text=every how many m?")
    answer(page, "500")
    row = "tr[data-item='grease the guides']"
    page.wait_for_selector(f"{row} >> text=0.00 / 500 m")
    page.click(f"{row} [aria-label$='Done']")
    answer(page)
    until(lambda: site.ask("usage")["items"][0]["done_s"], "that it is done")
    page.click(f"{row} [aria-label$='Take out']")
    answer(page)
    page.wait_for_selector(row, state="detached")
    assert site.ask("usage")["items"] == []


def test_a_start_with_a_worn_tool_is_asked_for_and_then_confirmed(page: Any, site: Site) -> None:
    site.tell(mode="READY", job={"name": "a", "sha256": "0", "state": "loaded"})
    page.evaluate("dx.show('run')")
    refused = {"error": {"code": "worn", "sentence": "T1 is worn."}}
    sent: list[Any] = []

    def start(route: Any) -> None:
        sent.append(route.request.post_data_json)
        if len(sent) == 1:
            route.fulfill(status=409, json=refused)
        else:
            route.fulfill(json={"request": "start", "result": {}})

    page.route("**/api/v1/cycle/start", start)
    page.click("[data-call='POST cycle/start']:not([aria-disabled])")
    browser.yes(page)
    page.wait_for_selector(".dx-ask >> text=T1 is worn. Cut on with it?")
    browser.yes(page)
    until(lambda: len(sent) == 2, "the other start")
    assert sent[1] == {"worn": True}
