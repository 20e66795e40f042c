"""Stop and the end of a jog on a machine that moves, from the page, counted in its own ticks."""

from __future__ import annotations

import itertools
import signal
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from support.live import browser, live_page
from support.live.live_page import LiveMachine

pytestmark = [pytest.mark.slow, pytest.mark.live]
BROWSER = browser.WHOLE  # windows come before one another

STOP_S = 0.1  # from the press to the tick that has it
DEAD_MAN_S = 0.25  # from whatever ends a jog to the beginning of its stop
FAR_MM, FEED = 60.0, 300.0  # a move that lasts longer than any test looks at it
MANY = 8  # uploads at once; a browser has six connections to a server
BIG = 40e6
KEYS = ("ArrowLeft", "ArrowRight")
JOGS = (
    "'jog', {frame: 'joint', axis: 'X', speed: 0.5}",
    "'jog/step', {frame: 'joint', axis: 'X', distance: 1}",
)


@pytest.fixture(scope="module")
def machine(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveMachine]:
    with live_page.ready(tmp_path_factory.mktemp("shop")) as made:
        yield made


@pytest.fixture(scope="module")
def context(chromium: Any) -> Any:
    return chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")


# ---- stop

SIDES = itertools.cycle((FAR_MM, -FAR_MM))
UPLOADS = f"""() => {{
  const files = new DataTransfer();
  const text = new Uint8Array({BIG}).fill(10);
  text[0] = 46; // refused in its first line, so that no check is under way for long
  for (let i = 0; i < {MANY}; i++) files.items.add(new File([text], `big${{i}}.ngc`));
  document.dispatchEvent(new DragEvent("drop", {{ dataTransfer: files, bubbles: true, cancelable: true }}));
}}"""


def menu(page: Any) -> None:
    page.evaluate("dx.show('scope')")
    page.click("#scope-seconds")


def uploads(page: Any) -> None:
    page.evaluate("dx.show('programs')")
    page.wait_for_selector("#programs-uploads", state="attached")
    page.evaluate(UPLOADS)
    page.wait_for_selector(".upload-share:has-text('%')")


STATES: dict[str, Callable[[Any], object]] = {
    "nothing is open": lambda page: None,
    "a question is open": lambda page: page.evaluate("void dx.ask('Start the loaded program?')"),
    "a menu is open": menu,
    "text is being typed": lambda page: (page.evaluate("dx.show('jog')"), page.fill("#mdi-text", "G0 X")),
    "the view with the 3-D picture has just come": lambda page: page.evaluate("dx.show('scene')"),
    "many uploads run": uploads,
}
PRESSES: dict[str, Callable[[Any], object]] = {
    "button": lambda page: page.mouse.down(),
    "key": lambda page: page.keyboard.down("F9"),
}


@pytest.mark.parametrize("how", PRESSES)
@pytest.mark.parametrize("state", STATES)
def test_stop_is_with_the_tick_within_a_tenth_of_a_second_while(
    state: str, how: str, context: Any, machine: LiveMachine
) -> None:
    def measure() -> tuple[float, float]:
        with live_page.page(context, machine.shop) as page:
            moves_far(page)
            STATES[state](page)
            page.hover("#dx-stop", force=True)
            before = machine.tick()
            PRESSES[how](page)
            return machine.left_running_s(before), STOP_S

    took_s, allowed_s = live_page.shortest_s(machine, measure)
    assert took_s <= allowed_s


def moves_far(page: Any) -> None:
    page.evaluate(f"dx.call('POST', 'mdi', {{text: 'G1 X{next(SIDES)} F{FEED}'}})")
    live_page.wait(page, "dx.status.mode === 'RUNNING'")


# ---- jog


def press(page: Any) -> None:
    """A jog button is held, and the axis moves."""
    page.evaluate("dx.show('jog')")
    sign = "-" if page.evaluate("dx.status.joints.X.machine") > 0.0 else "+"
    page.hover(f"[data-jog=X][data-sign='{sign}']:not([aria-disabled=true])")
    page.mouse.down()
    live_page.wait(page, "dx.status.mode === 'JOG'")
    page.wait_for_timeout(300)


def press_key(page: Any) -> None:
    """The same by the keyboard."""
    page.evaluate("dx.show('jog')")
    if page.get_attribute("#jog-keyboard", "aria-pressed") != "true":
        page.click("#jog-keyboard:not([aria-disabled=true])")
        page.click(".dx-ask button[data-kind=go]")
        page.wait_for_selector("#jog-keyboard[aria-pressed=true]")
    page.keyboard.down(KEYS[int(page.evaluate("dx.status.joints.X.machine") < 0.0)])
    live_page.wait(page, "dx.status.mode === 'JOG'")
    page.wait_for_timeout(300)


HIDES = """() => {
  Object.defineProperty(document, 'hidden', {value: true, configurable: true});
  document.dispatchEvent(new Event('visibilitychange'));
}"""
# A browser without a screen shows each of its pages, so that none hides by itself.
ENDS: dict[str, Callable[[Any], object]] = {
    "the button goes up": lambda page: page.mouse.up(),
    "the pointer goes up elsewhere": lambda page: (page.mouse.move(-5, -5), page.mouse.up()),
    "the tab hides": lambda page: page.evaluate(HIDES),
    "the network is gone": lambda page: page.context.set_offline(True),
    "another page comes in its place": lambda page: page.goto("about:blank"),
    "the tab is closed": lambda page: page.close(),
}


@pytest.mark.parametrize("why", ENDS)
def test_a_jog_stops_in_time_when(why: str, context: Any, machine: LiveMachine) -> None:
    assert_stops(context, machine, press, ENDS[why])


def test_a_jog_by_a_key_stops_in_time_when_the_key_goes_up(context: Any, machine: LiveMachine) -> None:
    def let_go(page: Any) -> None:
        for key in KEYS:
            page.keyboard.up(key)

    assert_stops(context, machine, press_key, let_go)


def test_a_jog_by_a_key_stops_in_time_when_another_window_comes_and_the_key_goes_up_there(
    context: Any, machine: LiveMachine
) -> None:
    """This page never hears of it."""

    others: list[Any] = []

    def begin(page: Any) -> None:
        others.append(page.context.new_page())
        live_page.seen_as_it_is(page)
        press_key(page)

    assert_stops(context, machine, begin, lambda page: others[-1].bring_to_front())
    for other in others:
        other.close()


def test_a_jog_stops_in_time_when_the_socket_drops(context: Any, machine: LiveMachine) -> None:
    """The event socket alone: requests would still come through."""
    sockets: list[Any] = []

    def through(socket: Any) -> None:
        socket.connect_to_server()
        sockets.append(socket)

    def begin(page: Any) -> None:
        page.route_web_socket("**/api/v1/events*", through)
        page.reload()
        page.wait_for_selector("body[data-control=mine][data-mode=READY]")
        press(page)

    assert_stops(context, machine, begin, lambda page: sockets[-1].close())


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_jog_stops_in_time_when_the_panel_dies_or_hangs(
    number: signal.Signals, context: Any, machine: LiveMachine
) -> None:
    panel = machine.shop.processes["panel"]

    def hit(page: Any) -> None:
        machine.shop.processes["panel"].send_signal(number)

    try:
        assert_stops(context, machine, press, hit, tries=1)
    finally:
        if number == signal.SIGSTOP:
            panel.send_signal(signal.SIGCONT)  # what the page asked meanwhile comes now
        else:
            machine.shop.kill("panel")
    since = machine.tick()
    machine.shop.until(lambda now: now["mode"] == "READY", "the panel")
    assert machine.stood(since), "a late request moves nothing"


def assert_stops(
    context: Any,
    machine: LiveMachine,
    begin: Callable[[Any], object],
    ends: Callable[[Any], object],
    tries: int = 3,
) -> None:
    """The commands stand within the dead-man and a stop, and nothing comes late."""

    def measure() -> tuple[float, float]:
        with live_page.page(context, machine.shop, "jog") as page:
            page.wait_for_selector("[data-jog=X]:not([aria-disabled=true])")
            begin(page)
            before = machine.tick()
            ends(page)
            took_s, stop_s = machine.came_to_rest_s(before)
        context.set_offline(False)
        return took_s, DEAD_MAN_S + stop_s + machine.period_s

    took_s, allowed_s = live_page.shortest_s(machine, measure, tries)
    assert took_s <= allowed_s


def test_a_second_browser_cannot_jog_a_machine_that_another_has(
    chromium: Any, context: Any, machine: LiveMachine
) -> None:
    machine.until_ready()
    since = machine.tick()
    second = chromium.new_context()
    with live_page.page(context, machine.shop), live_page.page(second, machine.shop, "jog", False) as other:
        other.wait_for_selector("body[data-control=other]")
        other.wait_for_selector("[data-jog=X][data-sign='+'][aria-disabled=true]")
        for call in JOGS:
            said = other.evaluate(f"dx.call('POST', {call}, true)")
            assert said["status"] == 409 and said["body"]["error"]["code"] == "control", said
    assert machine.stood(since)
