"""What was interrupted is offered, and its state there is shown before anything starts."""

from __future__ import annotations

from typing import Any

import pytest
from support.live.browser import Site, until

pytestmark = pytest.mark.slow

INTERRUPTED = {
    **{"offered": True, "sentence": None, "program": "part.ngc", "name": "part.ngc", "sha256": "0" * 64},
    **{"line": 2, "fraction": 0.25, "exact": True, "tool": 1, "mode": "HOLD", "interrupted_s": 1000.0},
}
UPLOAD = """() => { const form = new FormData();
  form.append("file", new File(["G21\\nG1 X1 F100\\nM2\\n"], "part.ngc"));
  const sent = {method: "POST", body: form, headers: dx.headers()};
  return fetch("/api/v1/programs", sent).then((answer) => answer.status); }"""


def interrupted(page: Any, **other: Any) -> None:
    page.route("**/api/v1/restart", lambda route: route.fulfill(json={**INTERRUPTED, **other}))


@pytest.mark.parametrize("view", ["run", "programs"])
def test_what_was_interrupted_is_loaded_from_there_and_its_state_shown(
    view: str, page: Any, site: Site
) -> None:
    assert page.evaluate(UPLOAD) in (201, 409)
    interrupted(page)
    page.evaluate("(view) => dx.show(view)", view)
    offer = f"section[data-view={view}] .offer"
    page.wait_for_selector(f"{offer} >> text=part.ngc was interrupted at line 2, 25 % of its block")
    before = len(site.asked("load"))
    page.click(f"{offer} button")
    asked = until(lambda: site.asked("load")[before:], "the loading")[0][2]
    assert asked["restart"] is True and "line" not in asked
    page.wait_for_selector(f"section[data-view={view}] .restart >> text=work offset G54")
    page.wait_for_selector(offer, state="hidden")
    assert not site.asked("start")
    page.evaluate("dx.call('DELETE', 'job')")
    page.wait_for_selector(offer)


def test_what_cannot_be_gone_on_with_says_why(page: Any, site: Site) -> None:
    interrupted(page, offered=False, sentence="Y must be homed first.")
    page.evaluate("dx.show('programs')")
    page.wait_for_selector("section[data-view=programs] .offer >> text=Y must be homed first.")
    assert page.locator("section[data-view=programs] .offer button").count() == 0
