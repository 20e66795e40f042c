"""Run is read at two metres: all of it above the fold, in one type scale, whatever is wrong."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from support.fakes.fake_socket import AXES
from support.live import browser
from support.live.browser import Site

from controller.state.modes import Fault, fault_message
from controller.web import files

pytestmark = pytest.mark.slow

ALARM = {
    "name": "FOLLOWING_ERROR",
    "axis": "Y",
    **fault_message(Fault.FOLLOWING_ERROR, "Y"),
    "position_trusted": False,
}
# Of those with the longest text of what to do.
LONG_ALARM = {
    "name": "SYNC_DOUBLED",
    "axis": "C",
    **fault_message(Fault.SYNC_DOUBLED, "C"),
    "position_trusted": False,
}
CODES = [  # of each group the longest
    *("G38.2", "G17", "G21", "G90", "G94", "G42.1", "G43.4", "G54.1 P48", "G64 P0.0125", "G98", "G68.2"),
    *("M3", "M7 M8", "M48", "T10045", "H10045", "D10045", "F12500.5", "S24000"),
]
MIRRORED = [  # what changes the meaning of positions, as much of it as there may be at once
    *("G3", "G17", "G20", "G90", "G94", "G42.1", "G43", "G54.1 P48", "G64 P0.0125", "G98", "G16"),
    *("G51.1 X-123.456 Y-123.456 Z-123.456", "G54.2 P8", "G68", *CODES[11:]),
]
TOOL = {
    **{"name": "Schaftfräser VHM Z4 D12 R0,5 lang, beschichtet", "length_mm": 155.25, "radius_mm": 6.0},
    **{"flute_mm": 26.0, "corner_mm": 0.5},
}
LIFE = {"number": 10045, "cut_s": 3000.0, "most_cut_min": 60.0}
FIGURE = -1234.567  # as long as they come
JOINT = dict.fromkeys(("work", "machine", "to_go", "actual"), FIGURE) | {"error": 0.0123, "homed": False}
RUNNING = {
    "mode": "RUNNING",
    "fault": ALARM,
    "interlock": "DOOR_OPEN",
    "notices": [{"name": "DOOR_OPEN", "sentence": "The door is open."}],
    "codes": CODES,
    "tool": 10045,
    "limited_by": "Y acceleration",
    "feed_mm_min": {"programmed": 12500.0, "actual": 11593.0},
    "spindle": {"rev_min": 24000.0, "actual_rev_min": 23998.0, "load": 54.4, "override": 1.0},
    "coolant": {"mist": True, "flood": True},
    "joints": {axis: {**JOINT, "limit": "+"} for axis in AXES},
    "job": {
        **{"name": "housing_left_2.ngc", "sha256": "0" * 64, "state": "running", "line": 30, "block": 4},
        **{"fraction": 0.25, "elapsed_s": 61.0, "left_s": 3723.0, "duration_s": 3784.0},
        "text": "\n".join(f"G1 X{i} Y{2 * i} Z-3.25" for i in range(60)),
    },
    "next": {
        **{"verb": "reset", "args": {}, "place": "", "waits": False},
        "sentence": "The cause is gone: reset the fault, then home the axes that are not trusted.",
    },
    "in_block": {"what": "cut", "fraction": 0.4, "u": 0.3721},
}
CHOOSE = {
    "verb": "",
    "args": {},
    "place": "programs",
    "waits": False,
    "sentence": "Choose and load a program.",
}
READY = {"mode": "OFF", "codes": CODES, "tool": 10045, "job": None, "not_homed": ["Y"], "next": CHOOSE}
# The longest figures of time: 99:59:59, or 9:59:5x where the next tool and the next stop are told, too.
HOURS = dict.fromkeys(("elapsed_s", "left_s", "duration_s"), 359999.0)
COMING = {"elapsed_s": 35997.0, "left_s": 35998.0, "next_tool_s": 35996.0, "next_stop_s": 35997.0}
STATES = {
    "running": RUNNING,
    "hours": RUNNING | {"job": RUNNING["job"] | HOURS},
    "words": RUNNING
    | {"mode": "FAULT", "fault": LONG_ALARM, "job": RUNNING["job"] | {"line": 123456, "block": 123}},
    "coming": RUNNING | {"job": RUNNING["job"] | COMING},
    "mirrored": RUNNING | {"codes": MIRRORED},
    "off": READY,
}
FOLD = {"touch": (1280, 720), "square": (1024, 768), "wide": (1920, 1080)}

# What lies outside of the window, or of its card.
OUTSIDE = """() => {
  const parts = "header button, nav button, .lines button, section[data-shown] :is(button, input, .card, td,"
    + " .tfs, .tfs > *, .notes dd, .listing, .codes, .codes > *, .scene-place, canvas, .next, .times)";
  const bad = [];
  for (const one of document.querySelectorAll(parts)) {
    if (!one.checkVisibility() || one.closest(".listing") !== one.closest("pre")) continue;
    const box = one.getBoundingClientRect();
    const card = one.parentElement.closest(".card")?.getBoundingClientRect();
    const within = (room) => box.left > room.left - 1 && box.top > room.top - 1
      && box.right < room.right + 1 && box.bottom < room.bottom + 1;
    if (box.width && !within({ left: 0, top: 0, right: innerWidth, bottom: innerHeight }))
      bad.push(`${one.tagName}.${one.className} ${one.textContent.slice(0, 20)}: not in the window`);
    else if (box.width && card && !within(card))
      bad.push(`${one.tagName}.${one.className} ${one.textContent.slice(0, 20)}: not in its card`);
  }
  for (const one of document.querySelectorAll(".run > .card"))
    if (one.scrollHeight > one.clientHeight + 2) bad.push(`${one.className} scrolls`);
  return bad;
}"""
# What holds more than it has room for; of large figures, higher than their line, the boxes are measured.
CONTENTS = """() => [...document.querySelectorAll(".run, .run > .card, .notes, .notes dd, .codes, .next,"
    + " .times, .cycle, .cycle > *, .program-head, .lines, .line, .alarm-words, header, nav, .tab")]
  .filter((one) => one.checkVisibility() && one.clientHeight > 0 && !one.matches(".tool-name"))
  .filter((one) => one.scrollHeight > one.clientHeight + 1 || one.scrollWidth > one.clientWidth + 1)
  .map((one) => `${one.tagName}.${one.className} ${one.textContent.slice(0, 30)}:`
    + ` ${one.scrollWidth} x ${one.scrollHeight} in ${one.clientWidth} x ${one.clientHeight}`)"""
# Two texts of a row of figures that touch each other.
TOUCHING = """() => [...document.querySelectorAll(".dro tbody tr, .run-tfs")].flatMap((row) => {
  const kinds = ".axis-name, .mark-home, .mark-limit, td.figures, .c-unit, .error-figure, .letter,"
    + " .tfs > .figures, .notes dd:not(.tool-name)"; // whose end is cut off
  const seen = (one) => one.checkVisibility() && one.textContent.trim();
  const texts = [...row.querySelectorAll(kinds)].filter(seen);
  const box = (one) => { const range = document.createRange(); range.selectNodeContents(one);
    return range.getBoundingClientRect(); };
  const pairs = texts.flatMap((one, i) => texts.slice(i + 1).map((other) => [one, other]));
  const over = (p, q) => p.left < q.right - 1 && p.top + 4 < q.bottom - 4;
  return pairs.filter(([a, b]) => over(box(a), box(b)) && over(box(b), box(a)))
    .map(([a, b]) => `${a.textContent} ${b.textContent}`);
})"""
SIZES_PX = """() => {
  const all = [...document.querySelectorAll("header *, nav *, .lines *, .run *")];
  const written = all.filter((one) => one.checkVisibility()
    && [...one.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim()));
  return [...new Set(written.map((one) => getComputedStyle(one).fontSize))].sort();
}"""
# The picture follows its card with the next frame that is drawn.
DRAWN = """() => { const picture = document.querySelector(".run-scene canvas");
  const [inner, outer] = [picture, picture.closest(".card")].map((one) => one.getBoundingClientRect());
  return inner.bottom <= outer.bottom + 1 && inner.right <= outer.right + 1; }"""
TAKE_CONTROL = "dx.call('POST', 'control', {take_over: true}).then((s) => { dx.token = s.body.token; })"
ARRIVED = """([mode, left]) => document.body.dataset.mode === mode
  && (left == null || dx.status?.job?.left_s === left)"""
# The share of the view that its cards cover.
COVERED = """() => {
  const view = document.querySelector(".views").getBoundingClientRect();
  const boxes = [...document.querySelectorAll(".run > .card")].map((one) => one.getBoundingClientRect());
  return boxes.reduce((sum, one) => sum + one.width * one.height, 0) / (view.width * view.height);
}"""


def answered(known: dict[str, Any]) -> Any:
    return lambda route: route.fulfill(json=known)


def unfold(page: Any, wanted: bool) -> None:
    """The messages, where there are any to be folded."""
    button = page.locator("#dx-messages")
    if button.count() and (button.get_attribute("aria-expanded") == "true") != wanted:
        button.click()


@pytest.mark.parametrize("language", ("en", "de"))
@pytest.mark.parametrize("theme", ("dark", "light"))
def test_with_two_alarms_all_of_run_lies_inside_the_window(
    theme: str, language: str, chromium: Any, site: Site
) -> None:
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    cookies = {"directrix_theme": theme, "directrix_language": language}
    context.add_cookies([{"name": name, "value": value, "url": site.url} for name, value in cookies.items()])
    for path, known in (("tools", {"tools": {"10045": TOOL}}), ("usage", {"tools": [LIFE]})):
        context.route(f"**/api/v1/{path}", answered(known))
    picture = (files.STATIC / "icon.svg").read_text()
    drawn = {"body": picture, "content_type": "image/svg+xml"}
    context.route("**/api/v1/tools/10045/**", lambda route: route.fulfill(**drawn))
    page = browser.opened(context, site)
    found = []
    for controlled, (state, values) in itertools.product((False, True), STATES.items()):
        if controlled and not page.evaluate("Boolean(dx.token)"):
            page.evaluate(TAKE_CONTROL)
        site.tell(**values)
        page.wait_for_function(ARRIVED, arg=[values["mode"], (values["job"] or {}).get("left_s")])
        for (name, (width, height)), unfolded in itertools.product(FOLD.items(), (False, True)):
            if unfolded and "fault" not in values:
                continue
            if state == "words" and not unfolded:
                continue  # folded its text is cut off, and opens
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_selector(".run-scene canvas")
            page.wait_for_selector(".tool-name")
            unfold(page, unfolded)
            page.wait_for_function("() => !dx.stale")
            page.wait_for_function(DRAWN)
            where = f"{state} {name}{' unfolded' * unfolded} {theme} {language}"
            where += f"{', no control' * (not controlled)}: "
            for measured in (OUTSIDE, TOUCHING, CONTENTS):
                found += [where + one for one in page.evaluate(measured)]
            sizes = page.evaluate(SIZES_PX)
            assert set(sizes) <= {"15px", "20px", "32px", "64px"}, where
            assert page.evaluate(COVERED) > 0.95, f"{where}something is empty"
    site.tell()
    errors = page.errors
    context.close()
    assert not found, "\n".join(found)
    assert not errors


def test_figures_and_feed_are_read_at_two_metres(page: Any, site: Site) -> None:
    """A sign of 1/200 of the distance is read: 10 mm, on a screen of 24 inches 36 pixels of capitals."""
    site.tell(**RUNNING)
    page.wait_for_selector("body[data-mode=RUNNING]")
    for width, height in FOLD.values():
        page.set_viewport_size({"width": width, "height": height})
        for place in ("[data-axis=X] .c-work", ".run-feed .huge"):
            assert page.eval_on_selector(place, "(e) => parseFloat(getComputedStyle(e).fontSize)") >= 50.0


def test_alarms_fold_to_a_line_and_open_with_what_to_do(page: Any, site: Site) -> None:
    site.tell(**RUNNING)
    page.wait_for_selector(".line.alarm:visible")
    assert page.is_hidden(".line.barred") and page.inner_text("#dx-messages") == "2"
    folded = page.locator(".lines").bounding_box()["height"]
    assert folded <= 64
    page.click("#dx-messages")
    page.wait_for_selector(".line.barred:visible >> text=The door is open.")
    words = page.inner_text(".line.alarm .alarm-words")
    assert "A collision, a stiff or braked axis" in words and words.count("Look for") == 1
    assert page.get_attribute("#dx-messages", "aria-expanded") == "true"
    page.click("#dx-messages")
    page.wait_for_selector(".line.barred", state="hidden")
    site.tell(interlock="DOOR_OPEN", notices=RUNNING["notices"])
    page.wait_for_selector(".line.barred:visible")
    assert page.locator("#dx-messages").count() == 0, "one line is all there is"


def test_at_twice_the_size_most_of_the_height_is_left_for_what_is_looked_at(page: Any, site: Site) -> None:
    """1280 x 720 at 200 %, with two alarms; what is lower is scrolled to."""
    site.tell(**RUNNING)
    page.set_viewport_size({"width": 640, "height": 360})
    page.wait_for_selector(".line.alarm:visible")
    assert page.locator(".views").bounding_box()["height"] >= 0.6 * 360
    assert page.eval_on_selector(".views", "(e) => e.scrollWidth <= e.clientWidth")
    for place in ("#dx-hold", "#dx-stop", "#dx-estop", "#dx-messages", ".line.alarm button", "nav button"):
        box = page.locator(place).first.bounding_box()
        assert box["x"] + box["width"] <= 641 and box["y"] + box["height"] <= 361, place
    page.locator(".run-cycle .tall").first.scroll_into_view_if_needed()


@pytest.mark.parametrize("language", ("en", "de"))
@pytest.mark.parametrize("size", FOLD)
def test_at_twice_the_size_each_view_has_most_of_the_height(
    size: str, language: str, chromium: Any, site: Site
) -> None:
    """Every window at 200 %, with two alarms: nothing reaches over its right edge, all can be scrolled to."""
    width, height = (pixels // 2 for pixels in FOLD[size])
    context = chromium.new_context(viewport={"width": width, "height": height}, device_scale_factor=2)
    context.add_cookies([{"name": "directrix_language", "value": language, "url": site.url}])
    site.tell(**RUNNING)
    page = browser.opened(context, site)
    page.wait_for_selector(".line.alarm:visible")
    for view in browser.VIEWS:
        page.evaluate("(view) => dx.show(view)", view)
        page.wait_for_selector(f"section[data-view={view}] .card")
        page.wait_for_function("() => !dx.stale")  # whose line is another one
        assert page.locator(".views").bounding_box()["height"] >= 0.6 * height, view
        assert page.eval_on_selector(".views", "(e) => e.scrollWidth <= e.clientWidth + 1"), view
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), view
    errors = page.errors
    context.close()
    site.tell()
    assert not errors


def test_a_tool_says_what_is_left_of_its_life(page: Any, site: Site) -> None:
    site.tell(tool=1, codes=[code.replace("10045", "1") for code in CODES])
    page.evaluate("dx.call('PUT', 'usage/tools/1', {cut_min: 10, cut_m: null, parts: null, sister: null})")
    page.evaluate("dx.tell('job', null)")  # asked for again
    page.wait_for_selector("#run-life >> text=100 %")
    tool = page.inner_text(".run-tool")
    assert "1" in tool and "H1 D1" in tool and "end mill" in tool
    page.wait_for_function("() => document.querySelector('.run-tool img')?.naturalWidth > 0")
