"""A jog ends whatever takes the finger, the page or the connection away."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site, until

pytestmark = pytest.mark.slow
MM_MIN, DEG_MIN = 12000.0, 10800.0  # the trunnion's slowest slide and rotary
DEAD_MAN_S = 0.2  # the service's own; the page only has to send nothing more


def press(page: Any, site: Site) -> None:
    """Hold a jog button until the machine has been asked twice."""
    page.evaluate("dx.show('jog')")
    before = len(site.commands("jog"))
    page.hover("[data-jog=X][data-sign='+']")
    page.mouse.down()
    until(lambda: len(site.commands("jog")) > before + 1, "a jog")


def elsewhere(page: Any, path: str, body: str = "null") -> None:
    """As another page asks it; the finger stays where it is."""
    page.evaluate(
        f"fetch('/api/v1/{path}', {{method: 'POST', headers: {{'Content-Type': 'application/json'}},"
        f" body: {body} === null ? undefined : '{body}'}})"
    )


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
    "somebody else stops it": lambda page: elsewhere(page, "jog/stop", "{}"),
    "somebody else presses stop": lambda page: elsewhere(page, "cycle/stop"),
    "somebody else holds": lambda page: elsewhere(page, "cycle/hold"),
    "control is given": lambda page: page.evaluate("dx.give()"),
    "the page goes": lambda page: page.goto("about:blank"),
    "the page is loaded anew": lambda page: page.reload(),
}


@pytest.mark.parametrize("why", ENDS)
def test_a_jog_ends_when(why: str, page: Any, site: Site) -> None:
    press(page, site)
    ENDS[why](page)
    name = site.commands("jog")[-1][2]["press"]
    until(lambda: {"press": name} in [args for _, _, args in site.commands("jog_stop")], "the end of the jog")
    jogs = len(site.commands("jog"))
    time.sleep(DEAD_MAN_S)
    where = site.ask("status")["joints"]["X"]["machine"]
    time.sleep(4 * DEAD_MAN_S)  # nothing may come late
    assert len(site.commands("jog")) == jogs
    now = site.ask("status")
    assert (now["mode"], now["joints"]["X"]["machine"]) == ("READY", where)
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
    assert until(lambda: site.commands("jog_step"), "a step")[-1][2] == {
        "frame": "joint",
        "axis": "Y",
        "distance": -0.1,
        "feed": pytest.approx(0.2 * MM_MIN),
    }


@pytest.mark.parametrize(
    ("arrow", "axis", "sign"), [("↗", "X+Y", 1), ("↖", "X-Y", -1), ("↙", "X+Y", -1), ("↘", "X-Y", 1)]
)
def test_a_diagonal_moves_both_axes_each_by_the_step(
    arrow: str, axis: str, sign: int, page: Any, site: Site
) -> None:
    page.evaluate("dx.show('jog')")
    page.click("[data-choice=step][data-value='0']")
    before = len(site.commands("jog"))
    page.hover(f".jog-cross button:text-is('{arrow}')")
    page.mouse.down()
    asked = until(lambda: site.commands("jog")[before:], "a jog")[0][2]
    page.mouse.up()
    assert (asked["axis"], asked["speed"]) == (axis, sign)
    page.click("[data-choice=step][data-value='1']")
    before = len(site.commands("jog_step"))
    page.click(f".jog-cross button:text-is('{arrow}')")
    asked = until(lambda: site.commands("jog_step")[before:], "a step")[0][2]
    assert asked["axis"] == axis and asked["distance"] == pytest.approx(sign * 2.0**0.5)
    page.click("[data-choice=step][data-value='0']")


@pytest.mark.parametrize(("codes", "more"), [(["G90"], ""), (["G91"], "\nG91")])
def test_zero_is_gone_to_by_a_line_that_leaves_the_distance_mode(
    codes: list[str], more: str, page: Any, site: Site
) -> None:
    site.tell(codes=codes)
    page.evaluate("dx.show('jog')")
    page.wait_for_function("(code) => dx.status.codes?.[0] === code", arg=codes[0])
    before = len(site.commands("mdi"))
    page.click("[data-zero=XY]:not([aria-disabled=true])")
    page.wait_for_selector(".dx-ask >> text=X0 Y0 of G54")
    assert len(site.commands("mdi")) == before
    browser.yes(page)
    asked = until(lambda: site.commands("mdi")[before:], "the line")[0][2]
    assert asked == {"text": f"G90 G0 X0 Y0{more}", "still": False}


def test_keys_move_nothing_until_they_are_switched_on(page: Any, site: Site) -> None:
    page.evaluate("dx.show('jog')")
    page.wait_for_selector("#jog-keyboard:not([aria-disabled=true])")
    before = len(site.commands("jog"))
    page.keyboard.down("ArrowRight")
    page.wait_for_timeout(300)
    page.keyboard.up("ArrowRight")
    assert len(site.commands("jog")) == before
    page.click("#jog-keyboard")
    browser.yes(page)
    page.keyboard.down("ArrowRight")
    until(lambda: len(site.commands("jog")) > before + 1, "a jog")
    page.keyboard.up("ArrowRight")
    until(lambda: site.commands()[-1][1] == "jog_stop", "the end of the jog")


def test_a_second_browser_cannot_jog(page: Any, site: Site, chromium: Any) -> None:
    context = chromium.new_context()
    other = browser.opened(context, site, "jog")
    other.wait_for_selector("[data-jog=X][data-sign='+'][aria-disabled=true]")
    said = other.evaluate("dx.call('POST', 'jog', {frame: 'joint', axis: 'X', speed: 0.5}, true)")
    assert said["status"] == 409
    assert "holds control" in said["body"]["error"]["sentence"]
    context.close()


def test_who_loses_control_is_told_and_cannot_jog_any_more(page: Any, site: Site, chromium: Any) -> None:
    context = chromium.new_context()
    other = browser.opened(context, site)
    other.click("#dx-control")
    browser.yes(other)
    other.wait_for_selector("body[data-control=mine]")
    page.wait_for_selector("body[data-control=other]")
    page.evaluate("dx.show('jog')")
    page.wait_for_selector("[data-jog=X][data-sign='+'][aria-disabled=true]")
    other.evaluate("dx.give()")
    other.wait_for_selector("body[data-control=free]")
    context.close()


# ---- what is chosen


def test_a_jog_goes_in_the_frame_and_at_the_speed_that_are_chosen(page: Any, site: Site) -> None:
    page.evaluate("dx.show('jog')")
    for frame in ("tool", "part"):
        page.click(f"[data-choice=frame][data-value={frame}]")
        assert page.is_hidden("[data-jog=A][data-sign='+']"), "rotaries have no direction there"
        page.fill("#jog-speed", "35")
        assert (
            page.inner_text("#jog-speed-shown") == f"{0.35 * MM_MIN:.0f} mm/min, {0.35 * DEG_MIN:.0f} °/min"
        )
        press(page, site)
        page.mouse.up()
        asked = site.commands("jog")[-1][2]
        assert (asked["frame"], asked["axis"], asked["speed"]) == (frame, "X", 1.0)
        assert asked["feed"] == pytest.approx(0.35 * MM_MIN)
    page.click("[data-choice=frame][data-value=joint]")
    page.wait_for_selector("[data-jog=A][data-sign='+']")


@pytest.mark.parametrize("mode", ["FAULT", "RUNNING", "OFF"])
def test_a_jog_ends_when_the_machine_is_in_another_mode(mode: str, page: Any, site: Site) -> None:
    press(page, site)
    name = site.commands("jog")[-1][2]["press"]
    site.tell(mode=mode)
    until(lambda: {"press": name} in [args for _, _, args in site.commands("jog_stop")], "the end")


def test_a_change_of_the_step_ends_a_jog(page: Any, site: Site) -> None:
    press(page, site)
    name = site.commands("jog")[-1][2]["press"]
    page.eval_on_selector("[data-choice=step][data-value='1']", "(button) => button.click()")
    until(lambda: {"press": name} in [args for _, _, args in site.commands("jog_stop")], "the end")
    page.mouse.up()
    page.click("[data-choice=step][data-value='0']")


# ---- MDI


def test_a_line_that_moves_is_run_after_its_question_and_kept_for_the_next_time(
    page: Any, site: Site
) -> None:
    page.evaluate("dx.show('jog')")
    page.wait_for_selector("#mdi-run:not([aria-disabled=true])")
    for line in ("G0 X1", "G0 Y2"):
        page.fill("#mdi-text", line)
        page.focus("#mdi-text")
        before = len(site.commands("mdi"))
        page.keyboard.press("Enter")
        page.wait_for_selector(f".dx-ask >> text={line} This moves an axis")
        assert [args["still"] for _, _, args in site.commands("mdi")[before:]] == [True]
        browser.yes(page)
        asked = until(lambda n=before: site.commands("mdi")[n + 1 :], "the line")
        assert asked[0][2] == {"text": line, "still": False}
        page.wait_for_function("() => document.getElementById('mdi-text').value === ''")
    page.wait_for_function(
        "() => [...document.querySelectorAll('#mdi-history button')].map((b) => b.textContent).join()"
        " === 'G0 Y2,G0 X1'"
    )
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowUp")
    assert page.input_value("#mdi-text") == "G0 X1"
    page.keyboard.press("ArrowDown")
    assert page.input_value("#mdi-text") == "G0 Y2"
    page.click("#mdi-history button >> text=G0 X1")
    assert page.input_value("#mdi-text") == "G0 X1"


@pytest.mark.parametrize("line", ["G91", "G21", "T2", "M8", "F500 G1"])
def test_a_line_that_moves_nothing_is_run_at_once(line: str, page: Any, site: Site) -> None:
    page.evaluate("dx.show('jog')")
    page.wait_for_selector("#mdi-run:not([aria-disabled=true])")
    before = len(site.commands("mdi"))
    page.fill("#mdi-text", line)
    page.press("#mdi-text", "Enter")
    page.wait_for_function("() => document.getElementById('mdi-text').value === ''")
    assert [args for _, _, args in site.commands("mdi")[before:]] == [{"text": line, "still": True}]
    assert page.locator(".dx-ask").count() == 0


def test_a_line_whose_question_is_answered_with_no_is_not_run_and_stays(page: Any, site: Site) -> None:
    page.evaluate("dx.show('jog')")
    page.wait_for_selector("#mdi-run:not([aria-disabled=true])")
    page.fill("#mdi-text", "G0 Z3")
    before = len(site.commands("mdi"))
    page.click("#mdi-run")
    page.click(".dx-ask button >> nth=1")
    page.wait_for_selector(".dx-ask", state="detached")
    assert page.input_value("#mdi-text") == "G0 Z3"
    assert [args["still"] for _, _, args in site.commands("mdi")[before:]] == [True]
    assert page.is_hidden("#dx-said"), "whoever says no need not be told so"


def test_a_macro_is_a_button_that_asks_with_its_lines_and_is_grey_where_mdi_is_refused(
    page: Any, site: Site
) -> None:
    page.evaluate("dx.show('jog')")
    park = page.locator("[data-macro=Park]")
    page.wait_for_selector("[data-macro=Park]:not([aria-disabled])")
    before = len(site.commands("macro"))
    park.click()
    page.wait_for_selector(".dx-ask >> text=Run it now?")
    assert page.inner_text(".dx-ask p").splitlines()[:2] == ["G53 G0 Z260", "G53 G0 X0 Y200"]
    assert [args["still"] for _, _, args in site.commands("macro")[before:]] == [True]
    browser.yes(page)
    asked = until(lambda: site.commands("macro")[before + 1 :], "the macro")
    assert asked[0][2] == {"name": "Park", "still": False, "role": "set_up"}
    site.tell(mode="RUNNING")
    page.wait_for_selector("[data-macro=Park][aria-disabled=true][title*='Possible in']")
    park.click(force=True)
    page.wait_for_selector("#dx-said:has-text('Possible in')")
    assert len(site.commands("macro")) == before + 2
