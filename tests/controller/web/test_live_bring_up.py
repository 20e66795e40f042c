"""A bring-up by its page alone: begun when it is said, answered, left, gone on with, and a step skipped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from support.live import browser, live_page, shop
from support.live.browser import until

from controller.api import own_folder
from controller.bringup import protocol as protocols

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]
SIZES = ((1920, 1080), (1280, 720), (1024, 768))
OVER = "() => document.querySelector('section[data-shown]').scrollWidth - innerWidth"


def shown(page: Any, step: str) -> None:
    page.click(f"[data-step='{step}']")
    page.wait_for_selector(f"[data-shown-step='{step}']")


def begun(page: Any, step: str) -> None:
    shown(page, step)
    page.click("#step-begin:not([aria-disabled])")
    page.wait_for_selector(".dx-ask")
    browser.yes(page)


def verdict(page: Any, step: str) -> str:
    return str(page.inner_text(f"[data-step='{step}'] .chip"))


def before(chromium: Any, running: shop.Shop) -> Any:
    """A page of nobody's control yet; a computer with other work takes its time for a step."""
    running.ready()
    running.do("DELETE", "/control")
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")
    context.set_default_timeout(1e3 * shop.HANGS_S)
    page = context.new_page()
    opened_at(page, running.url)
    return page


def opened_at(page: Any, url: str) -> None:
    page.goto(f"{url}/#setup")
    live_page.wait(page, "window.dx?.all_views")
    page.click("[data-setup=bring_up]")
    page.wait_for_selector(".step-shown")


def test_a_scale_is_measured_told_left_and_done_again_by_the_page(tmp_path: Path, chromium: Any) -> None:
    with shop.opened(tmp_path) as running:
        page = before(chromium, running)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate(OVER) <= 0, width
        stood = running.status()["joints"]["X"]["actual"]

        shown(page, "scale.X")  # asked and not agreed to: nothing begins
        page.click("#step-begin:not([aria-disabled])")
        page.click(".dx-ask button[type=button]")
        assert httpx.get(f"{running.url}/api/v1/bring-up").json()["under_way"] is None

        begun(page, "scale.X")  # left while it asks
        page.wait_for_selector("[data-question=value]")
        assert running.status()["joints"]["X"]["actual"] == pytest.approx(stood + 10.0, abs=0.05)
        page.click("#step-leave")
        page.wait_for_selector("#step-not-done:has-text('left')")
        assert verdict(page, "scale.X") == "open"

        begun(page, "scale.X")
        page.wait_for_selector("[data-question=value]")
        page.reload()  # whoever comes back goes on with the same question
        opened_at(page, running.url)
        page.wait_for_selector("[data-question=value]")
        page.fill("[name=gauge]", "9,98")
        page.click("#step-value:not([aria-disabled])")
        page.wait_for_selector("[data-shown-step='scale.X'] .findings:has-text('counts_per_mm')")
        assert verdict(page, "scale.X") == "not good"

        shown(page, "brake.Z")
        page.click("#step-skip:not([aria-disabled])")
        page.fill(".dx-ask input", "No brake is fitted.")
        browser.yes(page)
        page.wait_for_selector("[data-shown-step='brake.Z'] .findings:has-text('No brake is fitted.')")
        assert verdict(page, "brake.Z") == "skipped"

        report = httpx.get(f"{running.url}{page.get_attribute('#bring-up-report', 'href')}").text
        assert "counts_per_mm" in report and "No brake is fitted." in report
        file = own_folder.of(running.state) / protocols.FOLDER / protocols.FILE
        kept = json.loads(file.read_text())["done"]
        assert {step: row["verdict"] for step, row in kept.items()} == {
            "scale.X": "bad",
            "brake.Z": "skipped",
        }


def test_a_step_that_moves_ends_with_a_stop(tmp_path: Path, chromium: Any) -> None:
    with shop.opened(tmp_path) as running:
        page = before(chromium, running)
        begun(page, "response.X")
        running.until(lambda now: now["mode"] == "RUNNING", "the axis moves")
        page.click("#dx-stop")
        until(lambda: page.query_selector("#step-not-done"), "the step's end")
        assert running.status()["mode"] == "READY" and verdict(page, "response.X") == "open"
