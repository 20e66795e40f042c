"""The queue, folders and block skip on the page: put in, counted, moved, loaded; found again by name."""

from __future__ import annotations

from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site, until

pytestmark = pytest.mark.slow

UPLOAD = """async (name) => {
  const form = new FormData();
  form.append("name", name);
  form.append("file", new File([`(${name})\\nM2\\n`], "part.ngc"));
  const sent = {method: "POST", body: form, headers: dx.headers()};
  return (await fetch("/api/v1/programs", sent)).status;
}"""


def upload(page: Any, *names: str) -> None:
    for name in names:
        assert page.evaluate(UPLOAD, name) == 201
    page.evaluate("dx.show('programs')")


def choose(page: Any, name: str) -> None:
    page.click(f"tr[data-program='{name}'] button")
    page.wait_for_selector(f".program-title:text-is('{name}')")


def enqueue(page: Any, name: str, count: str) -> None:
    choose(page, name)
    page.click(f"[data-enqueue='{name}']")
    page.fill(".dx-ask input", count)
    browser.yes(page)
    page.wait_for_selector(f".queue li:has-text('{name}')")


def shown(page: Any) -> list[str]:
    """Names and counts, in their order."""
    names = page.locator(".queue .queue-name").all_inner_texts()
    return [f"{a} {b}" for a, b in zip(names, page.locator(".queue .figures").all_inner_texts(), strict=True)]


def test_programs_are_queued_moved_counted_and_loaded(page: Any, site: Site) -> None:
    site.tell(mode="READY", job=None)
    upload(page, "a.ngc", "b.ngc")
    enqueue(page, "a.ngc", "2")
    enqueue(page, "b.ngc", "5")
    until(lambda: shown(page) == ["a.ngc 0 / 2", "b.ngc 0 / 5"], "the queue")
    page.click(".queue li:has-text('b.ngc') [aria-label^='Earlier']")
    page.click(".queue li:has-text('a.ngc') .figures")
    page.fill(".dx-ask input", "7")
    browser.yes(page)
    until(lambda: shown(page) == ["b.ngc 0 / 5", "a.ngc 0 / 7"], "the other order and count")
    page.evaluate("dx.show('run')")
    page.wait_for_selector(".queue-next >> text=Next in the queue: b.ngc, 1 of 5")
    page.click(".queue-next .queue-load:not([aria-disabled])")
    until(lambda: [args["name"] for _, _, args in site.commands("load")] == ["b.ngc"], "the loading")
    page.evaluate("dx.show('programs')")
    page.click(".queue-on:not([aria-disabled])")
    page.wait_for_selector(".queue-on[aria-pressed=true]")
    assert site.ask("queue")["go_on"] is True
    page.click("#dx-stop")
    page.wait_for_selector(".queue .wrong >> text=hold, stop")
    page.wait_for_selector(".queue-on[aria-pressed=false]")
    for _ in range(2):
        page.click(".queue li >> nth=0 >> [aria-label^='Take out']")
        page.wait_for_timeout(200)
    page.wait_for_selector(".queue", state="detached")


def test_folders_are_entered_moved_and_searched(page: Any, site: Site) -> None:
    upload(page, "fix/left/one.ngc", "fix/two.ngc", "three.ngc")
    page.wait_for_selector("tr[data-program='three.ngc']")
    assert page.locator("tr[data-program='fix/two.ngc']").count() == 0
    page.click("tr[data-folder=fix] button")
    page.wait_for_selector("tr[data-program='fix/two.ngc'] button:text-is('two.ngc')")
    page.click("tr[data-folder=left] button")
    page.wait_for_selector("tr[data-program='fix/left/one.ngc']")
    page.set_input_files("#programs-file", [{"name": "new.ngc", "mimeType": "", "buffer": b"M2\\n"}])
    page.wait_for_selector("tr[data-program='fix/left/new.ngc']")
    page.click("[data-trail=fix]")
    page.click("[data-move=fix]")
    page.fill(".dx-ask input", "shop/fix")
    browser.yes(page)
    page.wait_for_selector("tr[data-program='shop/fix/two.ngc']")
    choose(page, "shop/fix/two.ngc")
    with page.expect_download() as download:
        page.click(".program-acts a")
    assert download.value.suggested_filename == "two.ngc"
    page.click("[data-trail='']")
    upload(page, "four.ngc", "five.ngc", "six.ngc")
    page.fill("#programs-filter", "ONE")
    page.wait_for_selector("tr[data-program='shop/fix/left/one.ngc'] button:text-is('shop/fix/left/one.ngc')")
    assert page.locator("tr[data-program]").count() == 1
    page.fill("#programs-filter", "")
    page.click("tr[data-folder=shop] button")
    page.click("tr[data-folder=fix] button")
    choose(page, "shop/fix/two.ngc")
    page.click("[data-rename]")
    page.fill(".dx-ask input", "../two.ngc")
    browser.yes(page)
    page.wait_for_selector("#dx-said >> text=begins with")


def test_block_skip_loads_the_program_anew_and_shows_how_it_is_loaded(page: Any, site: Site) -> None:
    site.tell(mode="READY")
    upload(page, "skip.ngc")
    page.evaluate("dx.call('DELETE', 'job')")
    page.evaluate("dx.show('run')")
    page.wait_for_selector("#run-skip[aria-disabled=true][title^='Load a whole program first']")
    page.evaluate("dx.call('POST', 'job', {program: 'skip.ngc'})")
    for on in (True, False):
        page.click(f"#run-skip:not([aria-disabled])[aria-pressed={str(not on).lower()}]")
        page.wait_for_selector(f"#run-skip[aria-pressed={str(on).lower()}]")
        assert bool(site.commands("load")[-1][2].get("block_delete")) is on
    page.evaluate("dx.call('DELETE', 'job')")
