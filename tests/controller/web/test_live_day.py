"""An operator's day by the page alone: mouse, touch and keyboard in Chromium, before a machine in real time.

After each step the machine is asked by REST whether it is so: nothing is believed of the page itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.live import browser, live_page, shop

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

NAME = "cone.ngc"
# Example 1 of the paper, quicker, with one word that no reader takes.
WRONG = (
    "G21 G90 G54 G61\nT1 M6\nS8000 M3\nG42\n"
    "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D36.0. F240.\nG40\nM5\nM30\n"
)
SURFACE = 5  # its line
LONGER_MM = 1.25
RETRACT_MM = 7.5
READY = ("OFF", "READY")


class Day:
    """A page, and the machine that it stands before."""

    def __init__(self, page: Any, running: shop.Shop, folder: Path) -> None:
        self.page, self.shop, self.folder = page, running, folder
        self.held: dict[str, Any] = {}  # tip and axis, seen from the table, where it was held
        self.u = 0.0  # of the surface there
        self.place: dict[str, Any] = {}  # of the program where it was stopped

    def told(self, holds: Callable[[dict[str, Any]], Any], what: str) -> dict[str, Any]:
        """The machine's own status, once it is so."""
        return self.shop.until(holds, what)

    def view(self, name: str) -> None:
        self.page.click(f"[data-to={name}]")
        self.page.wait_for_selector(f"section[data-view={name}][data-shown]")

    def press(self, asks: str, view: str = "run") -> None:
        self.page.click(f"section[data-view={view}] [data-call='{asks}']:not([aria-disabled=true])")

    def check(self) -> dict[str, Any]:
        found: dict[str, Any] = self.shop.do("GET", f"/programs/{NAME}/check")
        return found


def along(now: dict[str, Any]) -> float:
    """The parameter u of the surface that is cut, 0 where none is."""
    return float((now["in_block"] or {}).get("u") or 0.0)


def test_an_operators_day_by_page_alone(chromium: Any, tmp_path: Path) -> None:
    context = chromium.new_context(
        viewport={"width": 1280, "height": 720}, locale="en-GB", has_touch=True, reduced_motion="reduce"
    )
    with shop.opened(tmp_path, machine=shop.driven()) as running:
        running.until(bool, "the panel")
        with live_page.page(context, running, "programs", control=False) as page:
            day = Day(page, running, tmp_path)
            for step in (
                *(uploads_with_an_error, mends_it, sees_the_verdict, homes, scrubs, starts, holds, retracts),
                *(changes_the_tool, returns, resumes, overrides, stops_at_once, resets),
                *(restarts_inside_the_block, finishes),
            ):
                print(step.__name__, flush=True)
                step(day)
    context.close()


def uploads_with_an_error(day: Day) -> None:
    file = day.folder / NAME
    file.write_text(WRONG)
    day.page.wait_for_selector("#programs-drop")
    live_page.drop(day.page, file)
    day.page.wait_for_selector(f"tr[data-program='{NAME}'] .p-check >> text=refused")
    found = day.check()
    assert (found["state"], found["result"]["line"]) == ("refused", SURFACE)


def mends_it(day: Day) -> None:
    """By finger to the line, by keyboard in it: the one point too many goes."""
    page = day.page
    page.tap(f"tr[data-program='{NAME}'] button")
    page.tap(f".programs-detail:has(.program-title:text-is('{NAME}')) [data-edit=open]")
    page.tap(f".editor-said button:has-text('Line {SURFACE}')")
    page.keyboard.press("End")
    for _ in range(len(" F240.")):
        page.keyboard.press("ArrowLeft")
    for _ in range(len(".0.")):
        page.keyboard.press("Backspace")
    page.keyboard.type("0.")
    page.wait_for_selector(".editor-said >> text=The reader finds no mistake.")
    page.click("[data-edit=compare]")
    page.wait_for_selector(".cm-deletedChunk:has-text('D36.0.')")
    page.click("[data-edit=keep]")
    page.wait_for_selector(f"tr[data-program='{NAME}'] .p-check >> text=passed")
    stored = day.shop.http.get(f"/programs/{NAME}/text").text
    assert stored == WRONG.replace("D36.0.", "D360.")


def sees_the_verdict(day: Day) -> None:
    found = day.check()
    assert found["state"] == "passed" and found["verdict"]["within"], found
    day.page.wait_for_selector(".verdict[data-tone=go]")
    assert day.page.inner_text(".verdict").removeprefix("✓").strip() == found["verdict"]["sentence"]


def homes(day: Day) -> None:
    browser.take_control(day.page)
    day.view("run")
    day.told(lambda now: (now["sequence"] or {}).get("state") == "done", "the commissioning")
    assert day.shop.status()["not_homed"] == ["X", "Y", "Z", "A", "C"]
    day.press("POST machine/home")
    browser.yes(day.page)
    day.told(lambda now: not now["not_homed"] and now["sequence"]["state"] != "running", "homed")
    if day.told(lambda now: now["mode"] in READY, "rest")["mode"] == "OFF":
        day.press("POST machine/enable")
    day.told(lambda now: now["mode"] == "READY", "ready")


def scrubs(day: Day) -> None:
    """Along the loaded program before anything moves: the tool on the picture goes, the machine does not."""
    page = day.page
    day.view("programs")
    page.click(".program-acts [data-kind=go]:not([aria-disabled=true])")
    job = day.told(lambda now: (now["job"] or {}).get("state") == "loaded", "the loading")["job"]
    assert job["name"] == NAME
    stood = {name: row["machine"] for name, row in day.shop.status()["joints"].items()}
    day.view("scene")
    page.wait_for_selector("#scene-scrub")
    page.focus("#scene-scrub")
    places = set()
    page.keyboard.press("Home")
    for _ in range(8):
        page.keyboard.press("PageUp")
        places.add(tuple(page.evaluate("dxScene.tool.position.toArray().map((v) => v.toFixed(3))")))
    assert len(places) > 4
    assert page.inner_text("#scene-line").startswith("planned, line ")
    now = day.shop.status()
    assert {name: row["machine"] for name, row in now["joints"].items()} == stood and now["mode"] == "READY"


def starts(day: Day) -> None:
    day.view("run")
    day.page.keyboard.press("F4")
    browser.yes(day.page)
    now = day.told(lambda now: along(now) > 0.03, "the cut")
    assert now["mode"] == "RUNNING" and now["job"]["line"] == SURFACE


def holds(day: Day) -> None:
    day.page.tap("#dx-hold")
    now = day.told(lambda now: now["mode"] == "HOLD" and now["at_rest"], "the hold")
    assert 0.0 < now["in_block"]["u"] < 1.0 and now["retract_room_mm"] > RETRACT_MM
    day.held, day.u = now["on_table"], along(now)


def retracts(day: Day) -> None:
    """So far along the tool axis, and nowhere else."""
    day.page.fill("#run-retract-mm", str(RETRACT_MM))
    day.page.tap("#run-retract")
    now = day.told(
        lambda now: now["aside"] and now["at_rest"] and now["sequence"]["state"] == "done", "aside"
    )
    held = day.held
    gone = [a - b for a, b in zip(now["on_table"]["tip"], held["tip"], strict=True)]
    for moved, along in zip(gone, held["axis"], strict=True):
        assert math.isclose(moved, RETRACT_MM * along, abs_tol=0.002), (gone, held)


def changes_the_tool(day: Day) -> None:
    """The cutter is ground anew, or another one is put in: it is longer now."""
    page = day.page
    day.view("setup")
    page.click("[data-setup=tools]")
    page.fill("#setup-tools tr[data-row='1'] [data-field=length_mm]", str(LONGER_MM))
    page.click("#setup-tools tr[data-row='1'] td:last-child button >> nth=0")
    browser.until(
        lambda: day.shop.do("GET", "/tools")["tools"]["1"]["length_mm"] == LONGER_MM, "the tool's new length"
    )
    day.view("run")


def returns(day: Day) -> None:
    """The longer tool waits beside the place of the hold, off the part: resumed, it goes in by a lead."""
    day.press("POST cycle/return")
    now = day.told(
        lambda now: not now["aside"] and now["at_rest"] and now["sequence"]["state"] == "done", "back"
    )
    held = day.held
    assert now["mode"] == "HOLD" and now["on_table"]["length_mm"] == LONGER_MM
    assert 0.5 < math.dist(now["on_table"]["tip"], held["tip"]) < RETRACT_MM, (now["on_table"], held)


def resumes(day: Day) -> None:
    """By its key, once the page offers it: it may see the way back end a little later than we do."""
    day.page.wait_for_selector("[data-call='POST cycle/resume']:not([aria-disabled=true])")
    day.page.keyboard.press("F6")
    day.told(lambda now: now["mode"] == "RUNNING" and along(now) > day.u + 0.01, "the cut going on")


def overrides(day: Day) -> None:
    """To the half by hand: the feed at the contact is the half of what is programmed."""
    for _ in range(5):
        day.page.click("[data-override='-10']")
    now = day.told(
        lambda now: now["override"] == 0.5 and abs(now["feed_mm_min"]["actual"] - 120.0) < 2.0,
        "half the feed",
    )
    assert now["mode"] == "RUNNING" and now["feed_mm_min"]["programmed"] == pytest.approx(240.0)
    day.page.wait_for_selector(".override-figure:has-text('50 %')")


def stops_at_once(day: Day) -> None:
    day.page.tap("#dx-estop")
    told = day.told(lambda now: now["mode"] == "FAULT" and now["job"]["state"] == "fault", "the fault")
    assert told["fault"]["name"] == "EMERGENCY_STOP"
    now = day.told(lambda now: now["job"]["line"] == SURFACE, "the place where it was")
    assert now["fault"]["name"] == "EMERGENCY_STOP"
    day.page.wait_for_selector(".line.alarm .strong:has-text('mergency stop')")
    day.place = now["job"]


def resets(day: Day) -> None:
    """As the line above says; then off the part along the tool axis."""
    page = day.page
    page.click(".line.alarm button:not([aria-disabled=true])")
    now = day.told(lambda now: now["mode"] == "OFF" and now["sequence"]["state"] == "done", "the reset")
    assert now["fault"] is None
    if now["not_homed"]:
        day.press("POST machine/home")
        browser.yes(page)
        day.told(lambda now: not now["not_homed"] and now["sequence"]["state"] != "running", "homed")
    if day.told(lambda now: now["mode"] in READY, "rest")["mode"] == "OFF":
        day.press("POST machine/enable")
    before = day.told(lambda now: now["mode"] == "READY" and now["retract_room_mm"], "ready")["on_table"]
    page.fill("#run-retract-mm", "20")
    page.click("#run-retract:not([aria-disabled=true])")
    day.told(
        lambda now: math.dist(now["on_table"]["tip"], before["tip"]) > 19.9 and now["mode"] == "READY", "off"
    )


def restarts_inside_the_block(day: Day) -> None:
    """From where it stood, and not from the block's beginning."""
    page, place = day.page, day.place
    offer = ".run-cycle .offer"
    page.wait_for_selector(f"{offer} >> text={NAME} was interrupted at line {SURFACE}")
    told = day.shop.do("GET", "/restart")
    assert told["line"] == place["line"] == SURFACE and 0.0 < told["fraction"] < 1.0
    page.tap(f"{offer} button:not([aria-disabled=true])")
    job = day.told(lambda now: now["job"]["state"] == "loaded", "the loading")["job"]
    shown = page.locator("section[data-view=run] .restart li")
    browser.until(
        lambda: job["restart"] and shown.all_inner_texts() == [one["sentence"] for one in job["restart"]],
        "the state there",
    )
    page.click(".run [data-call='POST cycle/start']:not([aria-disabled=true])")
    browser.yes(page)
    first = day.told(lambda now: now["mode"] == "RUNNING" and along(now) > 0.0, "the cut")
    assert along(first) >= told["fraction"] - 0.02, (first["in_block"], told)


def finishes(day: Day) -> None:
    day.page.set_viewport_size({"width": 1920, "height": 1080})  # where there is room for the slider
    day.page.focus("#run-override")
    day.page.keyboard.press("End")
    day.told(lambda now: now["override"] == 2.0, "twice the feed")
    day.told(lambda now: now["job"]["state"] == "completed" and now["mode"] == "READY", "the end")
    # The one that was stopped is in the list before: the record of this one is written meanwhile.
    browser.until(lambda: day.shop.run_record()["result"] == "completed", "the record")
    assert day.shop.run_record()["program"] == NAME
    day.view("runs")
    day.page.wait_for_selector(f"#runs-list tr:first-child:has-text('{NAME}') .chip[data-tone=go]")
