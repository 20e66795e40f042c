"""A jog ends whatever takes the finger, the page or the connection away."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import browsing
import pytest
from browsing import Site, until

pytestmark = pytest.mark.slow
DEAD_MAN_S = 0.2  # the service's own; the page only has to send nothing more


def press(page: Any, site: Site) -> None:
    """Hold a jog button until the machine has been asked twice."""
    page.evaluate("dx.show('jog')")
    before = len(site.asked("jog"))
    page.hover("[data-jog=X][data-sign='+']")
    page.mouse.down()
    until(lambda: len(site.asked("jog")) > before + 1, "a jog")


ENDS: dict[str, Callable[[Any], object]] = {
    "the button goes up": lambda page: page.mouse.up(),
    "the pointer slides off": lambda page: page.mouse.move(5, 500),
    "the window loses the focus": lambda page: page.evaluate("window.dispatchEvent(new Event('blur'))"),
    "the tab hides": lambda page: page.evaluate(
        "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
        "document.dispatchEvent(new Event('visibilitychange'))"
    ),
    "another view comes": lambda page: page.evaluate("dx.show('run')"),
    "stop is pressed": lambda page: page.evaluate("dx.stop()"),
    "control is given": lambda page: page.evaluate("dx.give()"),
    "the page goes": lambda page: page.goto("about:blank"),
    "the page is loaded anew": lambda page: page.reload(),
}


@pytest.mark.parametrize("why", ENDS)
def test_a_jog_ends_when(why: str, page: Any, site: Site) -> None:
    press(page, site)
    ENDS[why](page)
    until(lambda: site.asked()[-1][1] != "jog" and site.asked("jog_stop", "stop"), "the end of the jog")
    jogs = len(site.asked("jog"))
    time.sleep(5 * DEAD_MAN_S)  # nothing may come late
    assert len(site.asked("jog")) == jogs
    assert site.ask("status")["mode"] == "READY"
    if page.url == "about:blank":
        page.goto(site.url)


def test_a_jog_ends_when_the_network_is_gone(page: Any, site: Site) -> None:
    """Then the page can tell nobody: the machine's own dead-man has to be enough."""
    press(page, site)
    page.context.set_offline(True)
    until(lambda: site.ask("status")["mode"] == "READY", "the end of the jog")
    page.wait_for_selector("body[data-stale='1']")
    page.context.set_offline(False)
    page.wait_for_function("() => !dx.stale")
    page.mouse.up()
    assert site.ask("status")["mode"] == "READY"


def test_a_step_is_asked_once(page: Any, site: Site) -> None:
    page.evaluate("dx.show('jog')")
    page.click("[data-choice=step][data-value='0.1']")
    page.click("[data-jog=Y][data-sign='-']")
    assert until(lambda: site.asked("jog_step"), "a step")[-1][2] == {
        "frame": "joint",
        "axis": "Y",
        "distance": -0.1,
    }


def test_keys_move_nothing_until_they_are_switched_on(page: Any, site: Site) -> None:
    page.evaluate("dx.show('jog')")
    page.wait_for_selector("#jog-keyboard:not([disabled])")
    before = len(site.asked("jog"))
    page.keyboard.down("ArrowRight")
    page.wait_for_timeout(300)
    page.keyboard.up("ArrowRight")
    assert len(site.asked("jog")) == before
    page.click("#jog-keyboard")
    browsing.yes(page)
    page.keyboard.down("ArrowRight")
    until(lambda: len(site.asked("jog")) > before + 1, "a jog")
    page.keyboard.up("ArrowRight")
    until(lambda: site.asked()[-1][1] == "jog_stop", "the end of the jog")


def test_a_second_browser_cannot_jog(page: Any, site: Site, chromium: Any) -> None:
    context = chromium.new_context()
    other = browsing.opened(context, site, "jog")
    other.wait_for_selector("[data-jog=X][data-sign='+'][disabled]")
    said = other.evaluate("dx.call('POST', 'jog', {frame: 'joint', axis: 'X', speed: 0.5}, true)")
    assert said["status"] == 409
    assert "holds control" in said["body"]["error"]["sentence"]
    context.close()


def test_who_loses_control_is_told_and_cannot_jog_any_more(page: Any, site: Site, chromium: Any) -> None:
    context = chromium.new_context()
    other = browsing.opened(context, site)
    other.click("#dx-control")
    browsing.yes(other)
    other.wait_for_selector("body[data-control=mine]")
    page.wait_for_selector("body[data-control=other]")
    page.evaluate("dx.show('jog')")
    page.wait_for_selector("[data-jog=X][data-sign='+'][disabled]")
    other.evaluate("dx.give()")
    other.wait_for_selector("body[data-control=free]")
    context.close()
