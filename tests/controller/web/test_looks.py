"""Every view in five sizes, both themes and languages, below an alarm: nothing clipped, all can read it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site

from controller.machine import machine_file
from controller.service import status
from controller.state.modes import Fault, fault_message

pytestmark = pytest.mark.slow

SIZES = {
    **{"wide": (1920, 1080), "touch": (1280, 720), "square": (1024, 768)},
    **{"upright": (800, 1280), "phone": (390, 844)},
}
ALARM = {
    "name": "FOLLOWING_ERROR",
    "axis": "Y",
    **fault_message(Fault.FOLLOWING_ERROR, "Y"),
    "position_trusted": True,
}
CHANGER = {
    **{"spindle": 1, "doubt": None, "step": None, "preparing": None, "ready": 3, "away": []},
    "pockets": [{"pocket": 1, "tool": 12, "here": True}, {"pocket": 2, "tool": 3, "here": False}],
}
# What reaches over the right edge of page or card, or is cut off within its own box, where nothing scrolls.
CLIPPED = """() => {
  const bad = [];
  const scrolls = ".scroll, .listing, .mdi-history, :has(> canvas), svg, input, textarea";
  for (const one of document.querySelectorAll(".shell *")) {
    const box = one.getBoundingClientRect();
    if (!box.width || one.closest(scrolls)) continue;
    const text = one.childElementCount === 0 && one.textContent.trim();
    const hides = getComputedStyle(one).overflowX !== "visible";
    const named = one.classList.contains("program-name"); // long names end in dots
    const cut = text && hides && !named && one.scrollWidth > one.clientWidth + 1;
    const card = one.closest(".card")?.getBoundingClientRect();
    const edge = Math.min(innerWidth, card?.width ? card.right : innerWidth);
    const stays = card?.width && getComputedStyle(one.closest(".card")).overflowY === "visible";
    const low = stays && text && box.bottom > card.bottom + 1;
    if (box.right > edge + 1 || cut || low) bad.push(`${one.tagName}.${one.className} ${text || ""}`);
  }
  for (const one of document.querySelectorAll("section[data-shown] input[type=number]"))
    if (one.checkVisibility() && one.scrollWidth > one.clientWidth + 1) bad.push(`${one.id} ${one.value}`);
  const scene = document.querySelector("section[data-shown] .scene-said")?.getBoundingClientRect();
  if (scene && innerWidth > 900 && scene.bottom > innerHeight) bad.push("the legend is below the fold");
  return [...new Set(bad)];
}"""
OVERLAPS = """() => {
  const bad = [];
  const all = [...document.querySelectorAll("header button, nav button, section[data-shown] button")];
  const seen = all.filter((one) => one.getBoundingClientRect().width);
  for (const a of seen) for (const b of seen) {
    if (a === b || a.contains(b) || b.contains(a)) continue;
    const inside = (one) => one.closest("header, nav, section");
    if (inside(a) !== inside(b)) continue;
    const p = a.getBoundingClientRect(), q = b.getBoundingClientRect();
    if (p.left < q.right - 1 && q.left < p.right - 1 && p.top < q.bottom - 1 && q.top < p.bottom - 1)
      bad.push(`${a.textContent} over ${b.textContent}`);
  }
  return bad;
}"""
# What reaches out of its part of the header, over whatever stands beside it.
CROWDED = """() => [...document.querySelectorAll("header > *")].flatMap((part) => {
  const end = part.getBoundingClientRect().right + 1;
  const over = [...part.querySelectorAll("*")].filter((one) => one.getBoundingClientRect().right > end);
  return over.map((one) => `${one.className} ${one.textContent}`);
})"""
WIDTHS = """() => [".program-name", ".program-left .strong"].map(
  (one) => document.querySelector(one).getBoundingClientRect().width)"""
# A glove on a machine's screen, a thumb on a phone.
SMALL = """() => {
  const all = document.querySelectorAll("header button, nav button, section[data-shown] button:not(.plain)");
  const least = innerWidth > 900 ? 59.5 : 43.5;
  const small = (one, box) => box.height < least || box.width < (one.closest("nav") ? 43.5 : least);
  const seen = [...all].filter((one) => one.checkVisibility());
  return seen.filter((one) => small(one, one.getBoundingClientRect())).map((one) => one.textContent);
}"""


AGED = """() => {
  window.aged = false;
  const watcher = new MutationObserver(() => { window.aged ||= dx.stale; });
  watcher.observe(document.body, { attributes: true, attributeFilter: ["data-stale"] });
}"""
MAX_LOOKS = 20
LEAST_NAME_PX = 80  # of a program's name: a beginning that tells it from others

PARTS = {
    "setup": (
        "homing",
        "offsets",
        "tools",
        "changer",
        "probing",
        "calibration",
        "file",
        "backup",
        "drives",
        "users",
        "notices",
        "usage",
    )
}
RUNNING = [("wide", "light", "en"), ("touch", "dark", "de"), ("phone", "light", "de")]


@contextlib.contextmanager
def looked_at(chromium: Any, site: Site, size: str, theme: str, language: str) -> Iterator[Any]:
    """The page with control of the machine; its scripts must not have failed."""
    width, height = SIZES[size]
    context = chromium.new_context(viewport={"width": width, "height": height}, reduced_motion="reduce")
    cookies = {"directrix_theme": theme, "directrix_language": language}
    context.add_cookies([{"name": name, "value": value, "url": site.url} for name, value in cookies.items()])
    page = browser.opened(context, site)
    page.evaluate("dx.call('POST', 'control', {take_over: true}).then((s) => { dx.token = s.body.token; })")
    browser.fill(page)
    yield page
    assert not page.errors, page.errors
    context.close()


def everywhere(page: Any) -> Iterator[str]:
    """Every view, with its parts; the editor, empty."""
    for view in browser.VIEWS:
        page.evaluate("(name) => dx.show(name)", view)
        page.wait_for_selector(f"section[data-view={view}] .card")
        if view == "programs":
            page.evaluate("dx.tell('kept', 'fixtures/queued.ngc')")
            page.wait_for_selector(".program-title:has-text('queued.ngc')")
        for part in PARTS.get(view, ("",)):
            if part:
                page.click(f"[data-setup={part}]")
            yield f"{view}{part and '-' + part}"
    page.evaluate("dx.show('programs')")
    page.click("[data-edit=new]")
    page.fill(".dx-ask input", "looked_at.ngc")
    browser.yes(page)
    page.wait_for_selector(".cm-content")
    yield "editor"
    page.click("[data-edit=leave]")


def findings(page: Any, name: str, tmp_path: Path) -> list[str]:
    """What is wrong in any view, with its name."""
    axe = browser.needed("axe_playwright_python.sync_playwright", "needs axe-playwright-python")
    found: list[str] = []
    for view in everywhere(page):
        page.wait_for_timeout(200)
        where = f"{view} {name}"
        picture = page.screenshot(path=str(tmp_path / f"{where}.png"))
        assert len(picture) > 5000, "an empty picture"
        for what, script in (("clipped", CLIPPED), ("overlapping", OVERLAPS), ("small", SMALL)):
            found += [f"{where}: {what}: {one}" for one in page.evaluate(script)]
        found += [f"{where}: {one}" for one in read_by(axe, page)]
    return found


def read_by(axe: Any, page: Any) -> list[str]:
    """What axe finds while the figures are young: old ones are pale on purpose, and a look takes a second."""
    for _ in range(MAX_LOOKS):
        page.wait_for_function("() => !dx.stale")
        page.evaluate(AGED)
        found = told_by(axe.Axe().run(page).response)
        if not page.evaluate("() => window.aged"):
            return found
    pytest.fail(f"the page's figures grew old in each of {MAX_LOOKS} looks")


@pytest.mark.parametrize("language", ("en", "de"))
@pytest.mark.parametrize("theme", ("dark", "light"))
@pytest.mark.parametrize("size", SIZES)
def test_nothing_is_clipped_and_axe_finds_nothing(
    size: str, theme: str, language: str, chromium: Any, site: Site, tmp_path: Path
) -> None:
    site.tell(
        fault=ALARM, changer=CHANGER
    )  # and the mode as it is, so that what can be pressed is in its colours
    with looked_at(chromium, site, size, theme, language) as page:
        page.wait_for_selector(".line.alarm .strong:not(:empty)")
        found = findings(page, f"{size}-{theme}-{language}", tmp_path)
    site.tell()
    assert not found, "\n".join(found)


@pytest.mark.parametrize(("size", "theme", "language"), RUNNING)
def test_nothing_is_clipped_either_while_a_program_runs(
    size: str, theme: str, language: str, chromium: Any, stepped: Site, tmp_path: Path
) -> None:
    with looked_at(chromium, stepped, size, theme, language) as page:
        page.evaluate("dx.show('runs')")
        page.click("#runs-list tr:nth-child(2) button")
        page.evaluate("dx.show('programs')")
        page.click("section[data-view=programs] tr[data-program] button")
        page.wait_for_selector(".program-title")
        found = findings(page, f"{size}-{theme}-{language}", tmp_path)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("language", ("en", "de"))
@pytest.mark.parametrize("size", SIZES)
def test_a_hold_that_asks_for_a_tool_leaves_the_rest_of_the_header_readable(
    size: str, language: str, chromium: Any, site: Site, tmp_path: Path
) -> None:
    job = {"name": "housing_left_2.ngc", "state": "held", "left_s": 3905.0, "fraction": 0.2}
    site.tell(mode="HOLD", job=job, tool_change=status.tool_change(machine_file.load("trunnion"), 4))
    with looked_at(chromium, site, size, "dark", language) as page:
        page.wait_for_selector(".mode-more:not(:empty)")
        page.screenshot(path=str(tmp_path / f"{size}-{language}.png"))
        crowded = page.evaluate(CROWDED)
        name_px, left_px = page.evaluate(WIDTHS)
    site.tell()
    assert not crowded, "\n".join(crowded)
    assert name_px >= LEAST_NAME_PX and left_px > 0


def told_by(said: dict[str, Any]) -> list[str]:
    """Findings of whatever weight, with the elements."""
    return [
        f"{one['impact']} {one['id']}: {one['help']}: {[node['target'] for node in one['nodes']][:4]}"
        for one in said["violations"]
    ]
