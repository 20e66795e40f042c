"""Example 2 from a file dragged onto the page to its finish, on a machine that runs in real time.

The page is loaded anew and its panel killed in mid-cut: the record of the run is made again on the
stepped clock, and has the same setpoints.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.live import browser, live_page, replayed_runs, shop

from controller.machine import machine_file

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

NAME = "example2_ready.ngc"
WRONG = b"G21 G90\nG1 X10 F100\nG1 X1..5\nM30\n"


@pytest.fixture
def context(chromium: Any) -> Any:
    return chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")


def test_a_part_is_brought_run_held_and_finished_by_the_page_whatever_becomes_of_page_and_panel(
    context: Any, tmp_path: Path
) -> None:
    cut_by_the_page(context, tmp_path)
    (record,) = replayed_runs.records(tmp_path / "state")
    machine = machine_file.load(str(tmp_path / "machine.toml"))
    again = replayed_runs.again(record, machine_file.shipped_program(NAME).read_text(), machine)
    assert again.run.result == "completed", again.run.fault_text
    replayed_runs.assert_same_setpoints(again)


def cut_by_the_page(context: Any, folder: Path) -> None:
    with shop.opened(folder, machine="shop") as running:
        running.until(bool, "the panel")
        with live_page.page(context, running, "programs", control=False) as page:
            brings_programs(page, folder)
            comes_up(page)
            starts(page)
            holds(page)
            goes_on(page)
            disturbs(page, running)
            browser.take_control(page)
            live_page.wait(page, "dx.status.mode === 'READY'")
        run = running.run_record()
        assert (run["program"], run["result"]) == (NAME, "completed")


def brings_programs(page: Any, folder: Path) -> None:
    """Two files at once; the one that is wrong is shown with a caret."""
    wrong = folder / "wrong.ngc"
    wrong.write_bytes(WRONG)
    page.wait_for_selector("#programs-drop")
    live_page.drop(page, machine_file.shipped_program(NAME), wrong)
    chosen(page, wrong.name)
    page.wait_for_selector("#programs-wrong:not(:empty)")
    shown = page.inner_text("#programs-wrong").splitlines()
    line, caret = shown[-2], shown[-1]
    assert line.endswith("3  G1 X1..5"), shown
    assert caret.index("^") >= line.index("X1..5"), shown
    page.wait_for_selector(f"tr[data-program='{NAME}'] .p-check:has-text('passed')")


def chosen(page: Any, name: str) -> None:
    page.click(f"tr[data-program='{name}'] button")
    page.wait_for_selector(f".program-title:has-text('{name}')")
    page.wait_for_selector(f"tr[data-program='{name}'] .p-check :is(:text('passed'), :text('refused'))")


def comes_up(page: Any) -> None:
    browser.take_control(page)
    page.click("[data-to=run]")
    live_page.wait(page, "dx.status.sequence?.state === 'done'")  # the drives' commissioning
    page.click("[data-call='POST machine/home']:not([aria-disabled=true])")
    browser.yes(page)
    live_page.wait(page, "!dx.status.not_homed.length && ['OFF', 'READY'].includes(dx.status.mode)")
    live_page.wait(page, "dx.status.sequence?.state !== 'running'")
    if page.evaluate("dx.status.mode") == "OFF":
        page.click("[data-call='POST machine/enable']:not([aria-disabled=true])")
    live_page.wait(page, "dx.status.mode === 'READY'")


def starts(page: Any) -> None:
    page.click("[data-to=programs]")
    chosen(page, NAME)
    page.click(".program-acts [data-kind=go]:not([aria-disabled=true])")
    live_page.wait(page, "dx.status.job?.state === 'loaded'")
    page.click("[data-to=run]")
    page.click("[data-call='POST cycle/start']:not([aria-disabled=true])")
    browser.yes(page)
    live_page.wait(page, "dx.status.in_block?.u > 0.05")


def holds(page: Any) -> None:
    page.click("#dx-hold")
    live_page.wait(page, "dx.status.mode === 'HOLD' && dx.status.at_rest")
    assert 0.0 < page.evaluate("dx.status.job.left_s") < page.evaluate("dx.status.job.duration_s")


def goes_on(page: Any) -> None:
    """At twice the feed."""
    page.set_viewport_size({"width": 1920, "height": 1080})  # where there is room for the slider
    page.focus("#run-override")
    page.keyboard.press("End")
    live_page.wait(page, "dx.status.override === 2")
    page.wait_for_selector(".override-figure:has-text('200 %')")
    page.click("[data-call='POST cycle/resume']:not([aria-disabled=true])")
    live_page.wait(page, "dx.status.mode === 'RUNNING'")
    page.wait_for_selector("#run-listing .now:has-text('N50')")


def disturbs(page: Any, running: shop.Shop) -> None:
    """The page is loaded anew, and the panel dies and comes back: the cut goes on."""
    page.reload()
    page.wait_for_selector("body[data-control=mine]")
    live_page.wait(page, "dx.status.mode === 'RUNNING'")
    before = running.status()["tick"]["number"]
    running.kill("panel")
    page.wait_for_selector("body[data-stale='1']")
    assert page.is_visible(".line.stale")
    later = running.until(lambda now: now["tick"]["number"] > before, "the new panel")
    assert later["job"]["name"] == NAME
    page.wait_for_function("() => window.dx && !dx.stale && document.querySelector('.dro')")
    page.wait_for_selector("body[data-control=free]")  # the token went with the panel
    live_page.wait(page, "dx.status.mode === 'RUNNING'")
