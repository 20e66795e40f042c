"""What is on every view: the stop, the connection, who has control."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any

import pytest
from support.live.browser import HANGS_S, VIEWS, Site, until

pytestmark = pytest.mark.slow

SLOW_UPLOAD = """
const asking = new XMLHttpRequest();
asking.open("POST", "/api/v1/programs");
const form = new FormData();
form.append("file", new Blob([new Uint8Array(60e6).fill(10)]), "big.ngc");
asking.send(form);
"""
STATES: dict[str, Callable[[Any], object]] = {
    "nothing is open": lambda page: None,
    "a question is open": lambda page: page.evaluate("void dx.ask('Start the loaded program?')"),
    "a menu is open": lambda page: page.evaluate(
        "const menu = document.createElement('div'); menu.className = 'q-menu';"
        "menu.style = 'position:fixed;inset:0;z-index:6000'; document.body.append(menu)"
    ),
    "a dialog lies over the page": lambda page: page.evaluate(
        "const box = document.createElement('div'); box.className = 'q-dialog__backdrop';"
        "box.style = 'position:fixed;inset:0;z-index:6000'; document.body.append(box)"
    ),
    "an upload runs": lambda page: page.evaluate(SLOW_UPLOAD),
    "the socket of the events is gone": lambda page: page.evaluate("dx.socket.close()"),
    "text is being typed": lambda page: (page.evaluate("dx.show('jog')"), page.fill("#mdi-text", "G0 X")),
}


@pytest.mark.parametrize("state", STATES)
def test_stop_acts_while(state: str, page: Any, site: Site) -> None:
    STATES[state](page)
    before = len(site.commands("stop"))
    page.click("#dx-stop")
    until(lambda: len(site.commands("stop")) > before, "the stop")


def test_stop_has_a_key_and_the_e_stop_asks_nothing(page: Any, site: Site) -> None:
    before = len(site.commands("stop"))
    page.keyboard.press("F9")
    until(lambda: len(site.commands("stop")) > before, "the stop")
    page.click("#dx-estop")
    until(lambda: site.commands("estop"), "the e-stop")
    page.wait_for_selector("body[data-mode=FAULT]")
    page.wait_for_selector(".line.alarm >> text=emergency stop")
    page.click(".line.alarm button")
    page.wait_for_selector("body[data-mode=OFF]")
    page.evaluate("dx.call('POST', 'machine/enable')")
    page.wait_for_selector("body[data-mode=READY]")


LOADED = {"name": "part.ngc", "sha256": "0" * 64, "state": "loaded"}
START = "[data-call='POST cycle/start']:not([aria-disabled=true])"


def test_a_start_asks_first(page: Any, site: Site) -> None:
    site.tell(job=LOADED)
    before = len(site.commands("start"))
    page.click(START)
    page.wait_for_selector(".dx-ask")
    page.keyboard.press("Escape")
    page.wait_for_selector(".dx-ask", state="detached")
    assert len(site.commands("start")) == before


def test_what_is_refused_is_told_in_the_machines_own_sentence(page: Any, site: Site) -> None:
    page.evaluate("void dx.call('POST', 'cycle/resume')")
    page.wait_for_selector("#dx-said:not([hidden])")
    assert page.inner_text("#dx-said") == "resume is refused in READY."


def test_figures_are_greyed_while_the_panel_is_away_and_the_page_comes_back(page: Any, site: Site) -> None:
    site.end()
    page.wait_for_selector("body[data-stale='1']")
    assert page.is_visible(".line.stale")
    assert float(page.eval_on_selector(".dro .figures", "(e) => getComputedStyle(e).opacity")) < 1.0
    site.start()
    page.wait_for_function("() => !dx.stale && document.querySelector('.dro')")
    assert not page.is_visible(".line.stale")
    page.wait_for_selector("body[data-control=free]")  # a panel that was started anew knows of nobody


def test_a_panel_that_goes_away_while_its_page_is_loaded_is_waited_for(chromium: Any, site: Site) -> None:
    def goes(route: Any) -> None:
        site.end()
        route.abort()

    page = chromium.new_page()
    page.set_default_timeout(HANGS_S * 1000)
    page.route("**/views/runs.js", goes, times=1)  # the last of all
    with page.expect_event("requestfailed", lambda asked: asked.url == site.url):
        page.goto(site.url)
    page.wait_for_timeout(200)
    assert page.is_visible("#dx-stop"), "it is the page, and not what the browser says of it"
    site.start()
    page.wait_for_function("() => window.dx?.all_views && !dx.stale")
    page.close()


def test_figures_are_old_within_a_second_by_the_pages_own_clock(page: Any, site: Site) -> None:
    page.clock.install()
    page.reload()
    page.wait_for_function("() => window.dx && !dx.stale")
    site.process.send_signal(signal.SIGSTOP)  # the connection stands, and nothing comes any more
    try:
        page.wait_for_timeout(100)  # for what was on its way
        page.clock.run_for(1000)
        assert page.get_attribute("body", "data-stale") == "1"
    finally:
        site.process.send_signal(signal.SIGCONT)
    page.wait_for_selector("body[data-stale='']")


STANDS = {"number": 500, "period_ms": 2.0}
GREYED = ".mode-word, .figures, .marks, .error-bar, .bar, section[data-shown] .chip"


def test_figures_of_a_machine_whose_clock_hangs_are_old_but_it_can_be_reset(page: Any, site: Site) -> None:
    """The service still answers, with the last that it has seen."""
    site.tell(tick=STANDS, mode="RUNNING")
    page.wait_for_selector(".line.stale >> text=clock stands still")
    faint = "(all) => all.every((one) => one.checkVisibility() && getComputedStyle(one).opacity < 0.5)"
    assert page.locator(GREYED).filter(visible=True).evaluate_all(faint)
    green = page.eval_on_selector(".mode", "(e) => getComputedStyle(e).backgroundColor")
    site.tell(mode="RUNNING")
    page.wait_for_selector("body[data-stale='']")
    assert page.eval_on_selector(".mode", "(e) => getComputedStyle(e).backgroundColor") != green
    site.tell(tick=STANDS, mode="FAULT", fault={"name": "CONTROLLER_GONE", "sentence": "Gone."})
    page.wait_for_selector("body[data-stale='1'] .line.alarm button:not([aria-disabled=true])")


def test_a_line_above_the_view_pushes_nothing_of_it_off_the_screen(page: Any, site: Site) -> None:
    site.tell(tick=STANDS, interlock="DOOR_OPEN", notices=[{"name": "DOOR_OPEN", "sentence": "Open."}])
    page.wait_for_selector("body[data-stale='1'][data-barred='1']")
    assert page.eval_on_selector(".run-tool", "(e) => e.getBoundingClientRect().bottom <= innerHeight")


def test_a_key_that_is_held_answers_no_question_and_starts_nothing(page: Any, site: Site) -> None:
    site.tell(job=LOADED)
    before = len(site.commands("start"))
    page.wait_for_selector(START)
    page.focus(START)
    for _ in range(4):  # without an up between them: the first is the press, the others its repeats
        page.keyboard.down("Enter")
    page.wait_for_selector(".dx-ask")
    page.keyboard.up("Enter")
    assert len(site.commands("start")) == before
    page.keyboard.press("Enter")
    until(lambda: len(site.commands("start")) > before, "the start")
    site.tell()
    page.evaluate("dx.stop()")
    page.wait_for_selector("body[data-mode=READY]")


REACHABLE = "header button, nav button, section[data-shown] :is(button, input, textarea, select)"


@pytest.mark.parametrize("view", VIEWS)
def test_all_that_can_be_pressed_is_reached_by_the_tab_key(view: str, page: Any) -> None:
    page.evaluate("(name) => dx.show(name)", view)
    page.wait_for_selector(f"section[data-view={view}] .card")
    pressable = "(one) => one.checkVisibility() && !one.disabled && one.tabIndex >= 0"
    wanted = page.evaluate(f"""() => {{
      window.all = [...document.querySelectorAll("{REACHABLE}")].filter({pressable});
      document.activeElement.blur();
      return window.all.length;
    }}""")
    reached = set()
    for _ in range(wanted + 20):  # what scrolls is reached as well
        page.keyboard.press("Tab")
        reached.add(page.evaluate("window.all.indexOf(document.activeElement)"))
    assert set(range(wanted)) - reached == set()


def test_what_is_said_hides_no_button_of_a_phones_navigation(page: Any) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.evaluate(
        "dx.say('A sentence that is long enough for more than one line of a small screen. '.repeat(2))"
    )
    said, nav = (page.locator(place).bounding_box() for place in ("#dx-said", "nav"))
    assert said["y"] + said["height"] <= nav["y"]


@pytest.mark.parametrize(
    "change",
    [lambda facts: facts["axes"][0].update(travel=[-1.0, 1.0]), lambda facts: facts.update(retract_mm=1.0)],
    ids=["travel", "retract_mm"],
)
def test_a_page_of_another_machine_than_the_one_that_answers_is_built_anew(
    change: Callable[[dict[str, Any]], None], page: Any, site: Site
) -> None:
    facts = site.ask("facts")
    change(facts)
    page.route("**/api/v1/facts*", lambda route: route.fulfill(json=facts), times=1)
    page.evaluate("window.old = true; dx.tell('service', {answers: true})")
    page.wait_for_function("() => window.dx && !window.old")
    page.wait_for_selector("body[data-control=mine]")


def test_control_is_kept_over_a_reload_of_the_page_and_given_by_hand(page: Any, site: Site) -> None:
    page.reload()
    page.wait_for_selector("body[data-control=mine]")
    page.click("#dx-control")
    page.wait_for_selector("body[data-control=free]")
    page.click("#dx-control")
    page.wait_for_selector("body[data-control=mine]")


def test_a_page_that_is_opened_beside_it_has_no_control_of_its_own(page: Any, site: Site) -> None:
    """A tab that is duplicated takes its storage along; the token is not in it."""
    assert page.evaluate("sessionStorage.length && sessionStorage.getItem('directrix.control')") in (0, None)


def test_overrides_show_what_the_machine_has(page: Any, site: Site) -> None:
    page.click("[data-override='-10']")
    page.wait_for_selector("text=90 %")
    assert site.commands("override")[-1][2] == {"share": 0.9}
    page.click("[data-rapid='25']")
    page.wait_for_selector("[data-rapid='25'][aria-pressed=true]")
    page.click("[data-call='PUT overrides/feed']")
    page.wait_for_function("() => dx.status.override === 1")
    page.click("[data-toggle='PUT cycle/single_block']")
    page.wait_for_selector("[data-toggle='PUT cycle/single_block'][aria-pressed=true]")


def test_nothing_is_loaded_from_other_computers(page: Any, site: Site) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.reload()
    page.wait_for_function("() => !dx.stale")
    assert asked
    assert [url for url in asked if not url.startswith((site.url, "data:", "blob:"))] == []


@pytest.mark.parametrize("press", ["#dx-stop", "#dx-hold", "#dx-estop"])
def test_a_stop_that_is_not_sent_is_said_at_once_with_what_to_press_instead(
    press: str, page: Any, site: Site
) -> None:
    page.context.set_offline(True)
    page.click(press)
    page.wait_for_selector("#dx-said:has-text('NOT SENT'):has-text('emergency stop on the machine')")
    page.wait_for_timeout(500)
    assert page.is_visible("#dx-said"), "it stays until it is closed"
    page.click("#dx-said button")
    assert page.is_hidden("#dx-said")
    page.context.set_offline(False)
    page.wait_for_function("() => !dx.stale")


def test_a_stop_that_hangs_is_said_by_the_pages_own_clock(page: Any, site: Site) -> None:
    site.process.send_signal(signal.SIGSTOP)
    try:
        page.click("#dx-stop")
        page.wait_for_selector("#dx-said:has-text('NOT SENT')")
    finally:
        site.process.send_signal(signal.SIGCONT)
    page.wait_for_selector("body[data-stale='']")


def test_hold_is_on_every_view_and_has_a_key(page: Any, site: Site) -> None:
    for view in VIEWS:
        page.evaluate("(view) => dx.show(view)", view)
        assert page.is_visible("#dx-hold") and page.is_visible("#dx-stop") and page.is_visible("#dx-estop")
    before = len(site.commands("hold"))
    page.click("#dx-hold")
    until(lambda: len(site.commands("hold")) == before + 1, "the hold")
    page.keyboard.press("F8")
    until(lambda: len(site.commands("hold")) == before + 2, "the hold")


def test_keys_start_and_resume_as_their_buttons_do(page: Any, site: Site) -> None:
    before = len(site.commands("start")), len(site.commands("resume"))
    page.keyboard.press("F4")
    page.wait_for_selector(".dx-ask")
    assert len(site.commands("start")) == before[0]
    page.keyboard.press("Enter")
    until(lambda: len(site.commands("start")) > before[0], "the start")
    page.wait_for_selector("body[data-mode=RUNNING]")
    page.keyboard.press("F6")
    page.wait_for_selector("#dx-said:has-text('Possible in: Hold.')")
    page.keyboard.press("F8")
    page.wait_for_selector("body[data-mode=HOLD]")
    page.keyboard.press("F6")
    until(lambda: len(site.commands("resume")) > before[1], "going on")
    page.keyboard.press("F9")
    page.wait_for_selector("body[data-mode=READY]")


OUTSIDE = """() => {
  const one = document.activeElement;
  const out = one && one !== document.body && !one.closest(".dx-ask, .stops, .said");
  return out ? one.outerHTML.slice(0, 80) : "";
}"""


@pytest.mark.parametrize("press", ["#dx-hold", "the dimmed page"])
def test_from_a_stop_or_a_press_beside_a_question_the_focus_comes_back_to_it(press: str, page: Any) -> None:
    page.evaluate("() => void dx.ask('Is it so?')")
    page.wait_for_selector(".dx-ask [data-kind=go]:focus")
    if press.startswith("#"):
        page.click(press)
        page.focus(press)
    else:
        page.mouse.click(500, 650)
    reached = set()
    for key in ("Tab", "Shift+Tab"):
        for _ in range(8):
            page.keyboard.press(key)
            assert page.evaluate(OUTSIDE) == ""
            reached.add(page.evaluate("document.activeElement.closest('.dx-ask') !== null"))
    assert True in reached
    page.focus(".dx-ask [data-kind=go]")
    page.keyboard.press("Escape")
    page.wait_for_selector(".dx-ask", state="detached")
    page.click("nav button[data-to=jog]")
    page.wait_for_selector("section[data-view=jog][data-shown]")


def test_a_press_beside_a_question_leaves_its_keys_in_force(page: Any) -> None:
    page.evaluate("() => void dx.ask('Is it so?')")
    page.wait_for_selector(".dx-ask [data-kind=go]:focus")
    page.mouse.click(500, 650)
    page.keyboard.press("Escape")
    page.wait_for_selector(".dx-ask", state="detached")


def test_who_may_only_look_sees_that_no_stop_is_taken_from_him(page: Any, site: Site) -> None:
    page.evaluate("dx.user = {...dx.user, role: 'view', may_stop: false}; dx.draw()")
    verbs = ("hold", "stop", "estop")
    before = len(site.commands(*verbs))
    for verb in verbs:
        stop = page.locator(f"#dx-{verb}")
        assert stop.get_attribute("aria-disabled") == "true"
        assert "emergency stop on the machine" in str(stop.get_attribute("title"))
        page.evaluate("dx.say('')")
        stop.click(force=True)
        page.wait_for_selector("#dx-said:has-text('use the emergency stop on the machine')")
    page.evaluate("dx.say('')")
    page.keyboard.press("F9")
    page.wait_for_selector("#dx-said:has-text('use the emergency stop on the machine')")
    assert len(site.commands(*verbs)) == before
    page.evaluate("dx.user = {...dx.user, may_stop: true}; dx.draw()")
    assert page.locator(".stops [aria-disabled]").count() == 0, "where the panel lets anybody stop"


def test_a_notice_is_closed_by_hand(page: Any, site: Site) -> None:
    page.evaluate("dx.say('Something was done.')")
    page.click("#dx-said button")
    assert page.is_hidden("#dx-said")


def test_every_view_has_one_heading_of_the_first_rank(page: Any) -> None:
    for view in VIEWS:
        page.evaluate("(view) => dx.show(view)", view)
        heads = page.locator("h1").filter(visible=True).all_inner_texts()
        assert len(heads) == 1 and heads[0], view
