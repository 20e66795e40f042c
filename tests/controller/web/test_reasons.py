"""What cannot be pressed says why: to the hand, to the pointer and to a screen reader, in every mode."""

from __future__ import annotations

from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site

from controller.state.modes import Mode

pytestmark = pytest.mark.slow

PARTS = (
    *("homing", "offsets", "tools", "changer", "probing", "calibration"),
    *("file", "backup", "drives", "users", "notices", "usage"),
)
# Of every control that is off: its name, the reason as pointer and screen reader have it, what a press says.
OFF = """() => [...document.querySelectorAll("[aria-disabled=true], :disabled")]
  .filter((one) => one.checkVisibility() && one.tagName !== "OPTION")
  .map((one) => {
    dx.say("");
    one.dispatchEvent(new PointerEvent("pointerdown", { bubbles: true, button: 0 }));
    one.click();
    return [one.getAttribute("aria-label") || one.innerText || one.id, one.title, dx.notice?.sentence];
  })"""


def everywhere(page: Any) -> Any:
    """Every view, and every part of the set-up."""
    for view in browser.VIEWS:
        page.evaluate("(view) => dx.show(view)", view)
        page.wait_for_selector(f"section[data-view={view}] .card")
        for part in PARTS if view == "setup" else ("",):
            if part:
                page.click(f"[data-setup={part}]")
            yield f"{view} {part}"


def told(page: Any) -> list[tuple[str, str, str, str]]:
    """(view, control, its reason, what a press on it says) of all that is off."""
    return [(where, *one) for where in everywhere(page) for one in page.evaluate(OFF)]


def silent(found: list[tuple[str, str, str, str]]) -> list[tuple[str, str, str, str]]:
    """Those that do not say why."""
    return [one for one in found if not one[2].endswith(".") or one[3] != one[2]]


@pytest.mark.parametrize("mode", [mode.name for mode in Mode])
def test_whatever_is_off_says_why_in_every_mode(mode: str, page: Any, site: Site) -> None:
    browser.fill(page)
    site.tell(mode=mode)
    page.wait_for_selector(f"body[data-mode={mode}]")
    found = told(page)
    assert found and silent(found) == []


def test_without_control_it_is_said_who_has_it(page: Any, site: Site) -> None:
    page.evaluate("dx.give()")
    page.wait_for_selector("body[data-control=free]")
    assert silent(told(page)) == []
    page.evaluate("dx.show('run')")
    page.wait_for_selector("[data-call='POST machine/disable'][title*='Take control first']")
    page.evaluate("dx.holder = 'anna'; dx.draw()")
    assert "anna holds control" in page.get_attribute("[data-call='POST cycle/start']", "title")


def test_who_may_only_look_is_told_so(page: Any, site: Site) -> None:
    page.evaluate("dx.user = {...dx.user, role: 'view'}")
    assert silent(told(page)) == []
    page.evaluate("dx.show('run')")
    assert "may only look" in page.get_attribute("[data-call='POST cycle/start']", "title")


def test_a_mode_is_named_in_words(page: Any, site: Site) -> None:
    site.tell(mode="HOLD")
    page.wait_for_selector("body[data-mode=HOLD]")
    said = "Possible in: Ready. The machine's state is: Hold."
    page.wait_for_selector(f"[data-call='POST cycle/start'][title=\"{said}\"]")
    before = len(site.commands("start"))
    page.click("[data-call='POST cycle/start']", force=True)
    page.wait_for_selector(f'#dx-said:has-text("{said}")')
    assert len(site.commands("start")) == before


LONG = ("POST machine/home", "POST machine/enable")


def test_nothing_that_takes_long_is_offered_while_another_such_thing_is_done(page: Any, site: Site) -> None:
    offered = [f"section[data-view=run] .cycle [data-call='{one}']" for one in LONG]
    site.tell(mode="OFF", sequence={"name": "reset", "state": "running"})
    for one in offered:
        page.wait_for_selector(f"{one}[aria-disabled=true][title='Resetting: wait until that is done.']")
    before = len(site.commands("home"))
    page.click(offered[0], force=True)
    page.wait_for_selector("#dx-said:has-text('Resetting: wait')")
    assert page.locator(".dx-ask").count() == 0 and len(site.commands("home")) == before
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=homing]")
    homes = "section[data-view=setup] [data-call='POST machine/home']"
    assert page.locator(homes).count() == page.locator(f"{homes}[aria-disabled=true]").count() == 6
    site.tell(mode="OFF", sequence={"name": "reset", "state": "done"})
    page.evaluate("dx.show('run')")
    for one in offered:
        page.wait_for_selector(f"{one}:not([aria-disabled])")


def test_an_operator_is_led_from_cold_to_the_start(page: Any, site: Site) -> None:
    page.evaluate("dx.give()")
    site.tell(mode="OFF", not_homed=[])
    page.wait_for_selector(".next >> text=take control")
    browser.take_control(page)
    for told, words in (
        ({"mode": "OFF", "not_homed": ["X"]}, "Home all axes."),
        ({"mode": "OFF", "not_homed": []}, "Switch the drives on."),
        ({"mode": "READY", "not_homed": [], "job": None}, "Choose and load a program."),
        ({"mode": "READY", "not_homed": [], "job": LOADED}, "Start first.ngc."),
    ):
        site.tell(**told)
        page.wait_for_selector(f".next strong:text-is('{words}')")


GUIDE = "section[data-view=run] .next"
LOADED = {"name": "first.ngc", "sha256": "0", "state": "loaded"}
UPLOAD = """() => { const form = new FormData();
  form.append("file", new File(["G21\\nG1 X1 F100\\nM2\\n"], "first.ngc"));
  const sent = {method: "POST", body: form, headers: dx.headers()};
  return fetch("/api/v1/programs", sent).then((answer) => answer.status); }"""


def test_from_cold_to_motion_it_takes_five_clicks(page: Any, site: Site) -> None:
    """By the guide alone. Nobody has control, no axis is homed; a program was sent before, none is loaded."""
    assert page.evaluate(UPLOAD) in (201, 409)
    page.evaluate("dx.give()")
    site.tell(mode="OFF", not_homed=["X", "Y"], job=None)
    page.wait_for_selector(".next strong:text-is('Home all axes.')")
    page.wait_for_selector("body[data-control=free]")
    begun = len(site.commands())
    page.click(f"{GUIDE} [data-call='POST machine/home']")
    page.wait_for_selector(".dx-ask >> text=The same yes takes control.")
    browser.yes(page)
    browser.until(lambda: "home" in [one[1] for one in site.commands()[begun:]], "the homing")
    site.tell(mode="READY", not_homed=[], job=None)
    page.click(f"{GUIDE} [data-call='POST job']")
    browser.until(lambda: "load" in [one[1] for one in site.commands()[begun:]], "the loading")
    site.tell(mode="READY", not_homed=[], job=LOADED)
    page.click(f"{GUIDE} [data-call='POST cycle/start']")
    browser.yes(page)
    browser.until(lambda: "start" in [one[1] for one in site.commands()[begun:]], "the start")


def answered(told: dict[str, Any]) -> Any:
    return lambda route: route.fulfill(json=told)


def test_a_holder_who_is_gone_is_offered_as_such_and_one_who_is_there_is_not(
    chromium: Any, page: Any, site: Site
) -> None:
    context = chromium.new_context(locale="en-GB")
    other = browser.opened(context, site)
    other.wait_for_selector("#dx-holder:text-is('local')")
    for silent_s, shown, question in (
        (3.0, "local", "holds control. Take it over?"),
        (42.0, "local, silent for 42 s", "was not heard of for 42 s. Take it over?"),
    ):
        told = {"holder": "local", "since_s": 0.0, "silent_s": silent_s, "mine": False}
        other.unroute("**/api/v1/control")
        other.route("**/api/v1/control", answered(told))
        other.click("#dx-control")
        other.wait_for_selector(f".dx-ask >> text={question}")
        other.keyboard.press("Escape")
        assert other.inner_text("#dx-holder") == shown
    assert not other.errors
    context.close()
