"""What was interrupted is offered, and its state there is shown before anything starts."""

from __future__ import annotations

from typing import Any

import pytest
from support.live.browser import Site, until

pytestmark = pytest.mark.slow

INTERRUPTED = {
    **{"offered": True, "sentence": None, "program": "part.ngc", "name": "part.ngc", "sha256": "0" * 64},
    **{
        "line": 2,
        "fraction": 0.808,
        "done": 0.4321,
        "left_s": 3723.0,
        "exact": True,
        "tool": 1,
        "mode": "HOLD",
        "interrupted_s": 1000.0,
    },
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
    page.wait_for_selector(f"{offer} >> text=part.ngc was interrupted at line 2, 80.8 % of its block")
    page.wait_for_selector(f"{offer} >> text=43.2 % of the program is done, 1:02:03 is left; tool 1 was in")
    before = len(site.commands("load"))
    page.click(f"{offer} button")
    asked = until(lambda: site.commands("load")[before:], "the loading")[0][2]
    assert asked["restart"] is True and "line" not in asked
    page.wait_for_selector(f"section[data-view={view}] .restart >> text=work offset G54")
    page.wait_for_selector(offer, state="hidden")
    assert not site.commands("start")
    page.evaluate("dx.call('DELETE', 'job')")
    page.wait_for_selector(offer)


def test_what_cannot_be_gone_on_with_says_why(page: Any, site: Site) -> None:
    interrupted(page, offered=False, sentence="Y must be homed first.")
    page.evaluate("dx.show('programs')")
    page.wait_for_selector("section[data-view=programs] .offer >> text=Y must be homed first.")
    assert page.locator("section[data-view=programs] .offer button").count() == 0


@pytest.mark.parametrize("by", ["button", "F4"])
def test_an_interrupted_program_is_started_from_its_beginning_only_by_name(
    by: str, page: Any, site: Site
) -> None:
    interrupted(page, sha256="5" * 64)
    told = {"name": "part.ngc", "sha256": "5" * 64, "state": "stopped", "restart": []}
    site.tell(mode="READY", job=told)
    offer = "section[data-view=run] .run-cycle .offer"
    page.wait_for_selector(f"{offer} >> text=80.8 %")
    before = len(site.commands("start"))
    for question, restart in (
        ("part.ngc was interrupted at line 2. Start part.ngc from line 1 again", []),
        ("Start the loaded program?", ["tool 1"]),
    ):
        site.tell(mode="READY", job={**told, "state": "loaded", "restart": restart})
        page.wait_for_selector(offer, state="hidden")
        page.wait_for_function("(n) => dx.status.job.restart.length === n", arg=len(restart))
        page.keyboard.press("F4") if by == "F4" else page.click("[data-call='POST cycle/start']")
        page.wait_for_selector(f".dx-ask >> text={question}")
        page.keyboard.press("Escape")
        page.wait_for_selector(".dx-ask", state="detached")
    assert len(site.commands("start")) == before
