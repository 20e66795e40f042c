"""A day at the shop's machine by its page alone: lengths, a vice askew, a magazine, a broken change.

From a file with a mistake to the finished part: two tool changes, an emergency stop in the second, the
program gone on with after it. Each step is judged by what REST says of the machine, times by the clock.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.live import browser, live_page, shop

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

NAME = "bracket.ngc"
PART = """G21 G90 G55 G64 P0.01
T1 M6
S6000 M3
M8
G43 H1
G0 X-20. Y-15.
Z5.
G1 Z-1. F300.
X20. F1200.
Y15.
X-20.
Y-15.
G0 Z30.
T2 M6
S9000 M3
G43 H2
G0 X0. Y0.
Z5.
G1 Z-0.5 F300.
X10. F900.
Y10.
X0.
Y0.
G0 Z30.
M30
"""
WRONG = PART.replace("X10. F900.", "X10. F900. U3")
GUILTY, CUT, CHANGE = 20, 9, 14  # lines: the mistake, the first cut, the second change
LENGTHS = {1: 92.4, 2: 81.75}
BOUND, BLINK_S = 0.03, 1.5  # of a time that is told on a machine with spindle and changer; of who looks at it
QUESTION = ".dx-ask"
NEXT = "section[data-view=run] .next button.act:not([aria-disabled=true])"


class Day:
    """A page, the machine before which it stands, and what was seen."""

    def __init__(self, page: Any, running: shop.Shop, folder: Path) -> None:
        self.page, self.shop, self.folder = page, running, folder
        self.told_s = self.began_s = 0.0

    def now(self, holds: Callable[[dict[str, Any]], Any], what: str) -> dict[str, Any]:
        return self.shop.until(holds, what)

    def view(self, name: str) -> None:
        self.page.click(f"[data-to={name}]")
        self.page.wait_for_selector(f"section[data-view={name}][data-shown]")

    def answers(self, *typed: str) -> list[str]:
        """All questions with yes, and their fields with what is ``typed``."""
        asked, left = list[str](), list(typed)
        self.page.wait_for_selector(QUESTION)
        while self.page.query_selector(QUESTION):
            words = self.page.inner_text(f"{QUESTION} p")
            if (field := self.page.query_selector(f"{QUESTION} input")) is not None and left:
                field.fill(left.pop(0))
            browser.yes(self.page)
            asked.append(words)
            self.page.wait_for_function("(words) => dx.question?.sentence !== words", arg=words)
            self.page.evaluate("() => new Promise((next) => setTimeout(next, 50))")  # the next one of a row
        return asked

    def follows(self, key: str, *typed: str) -> None:
        """What the guide says, by its own button."""
        self.now(lambda now: now["next"]["key"] == key, key)
        self.page.wait_for_function("(key) => dx.status.next.key === key", arg=key)
        self.page.click(NEXT)
        if key != "next.enable":
            self.answers(*typed)

    def comes_up(self) -> None:
        """Homed where it has to be, and on, as the guide leads."""
        if self.shop.status()["not_homed"]:
            self.follows("next.home")
            self.now(lambda now: not now["not_homed"] and now["sequence"]["state"] != "running", "homed")
        if self.now(lambda now: now["mode"] in ("OFF", "READY"), "rest")["mode"] == "OFF":
            self.follows("next.enable")
        self.now(lambda now: now["mode"] == "READY", "ready")

    def types(self, line: str, moves: bool = True) -> dict[str, Any]:
        """A line by hand, and the machine as it leaves it; it is asked for where it ``moves`` something."""
        before = self.shop.status()["run"]
        self.page.fill("#mdi-text", line)
        self.page.press("#mdi-text", "Enter")
        if moves:
            (asked,) = self.answers()
            assert asked.startswith(f"{line}\nThis moves") and asked.endswith("Run it now?")
        return self.now(
            lambda now: (
                now["run"] != before and now["run"]["result"] == "completed" and now["mode"] == "READY"
            ),
            line,
        )

    def work(self) -> dict[str, float]:
        return {name: row["work"] for name, row in self.shop.status()["joints"].items()}

    def starts(self, words: str) -> None:
        """F4, what is asked, and what is told of the time that is left as soon as it is planned."""
        self.view("run")
        self.page.wait_for_selector("[data-call='POST cycle/start']:not([aria-disabled=true])")
        self.page.keyboard.press("F4")
        (asked,) = self.answers()
        assert words in asked, asked
        now = self.now(lambda now: now["mode"] in ("RUNNING", "TOOL_CHANGE") and not now["at_rest"], "motion")
        self.told_s, self.began_s = now["job"]["left_s"], time.monotonic()

    def took_as_told(self) -> None:
        took_s = time.monotonic() - self.began_s
        assert took_s == pytest.approx(self.told_s, abs=BOUND * self.told_s + BLINK_S), (took_s, self.told_s)


def test_a_day_at_the_shops_machine(chromium: Any, tmp_path: Path) -> None:
    context = chromium.new_context(
        viewport={"width": 1280, "height": 720}, locale="en-GB", has_touch=True, reduced_motion="reduce"
    )
    with shop.opened(tmp_path, machine=shop.text_of("shop")) as running:
        running.until(lambda now: (now.get("sequence") or {}).get("state") == "done", "power up")
        with live_page.page(context, running, "programs", control=False) as page:
            day = Day(page, running, tmp_path)
            for step in (
                before_anything_moves,
                by_hand,
                the_first_tool,
                the_change_is_broken_off,
                to_the_end,
            ):
                print(step.__name__, flush=True)
                step(day)
    context.close()


def before_anything_moves(day: Day) -> None:
    page, file = day.page, day.folder / NAME
    file.write_text(WRONG)
    page.wait_for_selector("#programs-drop")
    live_page.drop(page, file)
    page.wait_for_selector(f"tr[data-program='{NAME}'] .p-check >> text=refused")
    found = day.shop.do("GET", f"/programs/{NAME}/check")
    assert (found["state"], found["result"]["line"]) == ("refused", GUILTY)

    page.tap(f"tr[data-program='{NAME}'] button")
    page.tap(f".programs-detail:has(.program-title:text-is('{NAME}')) [data-edit=open]")
    page.tap(f".editor-said button:has-text('Line {GUILTY}')")
    page.keyboard.press("End")
    for _ in " U3":
        page.keyboard.press("Backspace")
    page.wait_for_selector(".editor-said >> text=The reader finds no mistake.")
    page.click("[data-edit=keep]")
    page.wait_for_selector(f"tr[data-program='{NAME}'] .p-check >> text=passed")
    assert day.shop.http.get(f"/programs/{NAME}/text").text == PART

    browser.take_control(page)
    day.view("run")
    assert day.shop.status()["codes"][-5:] == ["T0", "H0", "D0", "F0", "S0"]
    day.follows("next.changer", "4", "")
    now = day.now(lambda now: now["changer"]["doubt"] is None, "the changer's tools")
    assert (now["tool"], now["changer"]["away"]) == (4, [])
    assert day.shop.status()["not_homed"] == ["X", "Y", "Z", "A", "C"]
    day.comes_up()


def by_hand(day: Day) -> None:
    """Lines go on with each other, and a figure reads what it was set to."""
    page = day.page
    day.view("jog")
    assert day.types("T1 M6")["tool"] == 1
    now = day.types("G55 G43 H1", moves=False)
    assert {"G55", "G43", "T1", "H1"} <= set(now["codes"])
    day.types("G0 X0 Y0 Z20 A0 C0")
    assert [round(v, 6) for v in day.work().values()][:3] == [0.0, 0.0, 20.0]
    assert now["on_table"]["length_mm"] == LENGTHS[1]
    day.types("Z10")
    day.types("G91", moves=False)
    day.types("X3")
    assert [round(v, 6) for v in day.work().values()][:3] == [3.0, 0.0, 10.0]
    assert day.types("G90 M3 S1000")["spindle"]["rev_min"] == 1000.0
    assert day.types("X0")["spindle"]["rev_min"] == 1000.0, "it outlives a line"
    assert day.types("M5", moves=False)["spindle"]["rev_min"] == 0.0

    day.view("setup")
    page.click("[data-setup=offsets]")
    page.click("section[data-view=setup] button[aria-label='G55: Z from position']")
    day.answers("19/2")
    day.now(lambda now: math.isclose(now["joints"]["Z"]["work"], 9.5, abs_tol=1e-9), "Z as it was typed")
    day.view("jog")
    day.types("G0 Z9.5")
    tip = day.shop.status()["tip"]
    assert [round(tip[letter], 6) for letter in "XYZ"] == [0.0, 0.0, 9.5]
    day.types("T4 M6")
    assert day.shop.status()["tool"] == 4


def the_first_tool(day: Day) -> None:
    page = day.page
    day.view("programs")
    page.click(f"tr[data-program='{NAME}'] button")
    page.click(".program-acts [data-kind=go]:not([aria-disabled=true])")
    day.now(lambda now: (now["job"] or {}).get("state") == "loaded", "the loading")
    before_s = day.shop.status()["job"]["left_s"]
    day.starts("from line 1, with T4 and G55")
    assert day.told_s == pytest.approx(before_s, rel=0.1), "what was told before the start"
    told = day.shop.status()
    assert told["mode"] == "TOOL_CHANGE" and told["change"]["sentence"].startswith("T4 away, T1 in: step ")
    page.wait_for_selector("#dx-mode:has-text('TOOL CHANGE'), .mode:has-text('CHANGE')")
    now = day.now(lambda now: now["tool"] == 1 and now["mode"] == "RUNNING", "the first change")
    day.now(lambda now: now["job"]["line"] >= CUT and now["mode"] == "RUNNING", "the cut")
    assert {"T1", "H1", "G55", "S6000", "M3", "M8"} <= set(day.shop.status()["codes"])

    page.click("[data-override='-10']")
    now = day.now(lambda now: now["override"] == pytest.approx(0.9), "less feed")
    page.click("[data-override='10']")
    day.now(lambda now: now["override"] == pytest.approx(1.0), "all of the feed")
    page.tap("#dx-hold")
    now = day.now(lambda now: now["mode"] == "HOLD" and now["at_rest"], "the hold")
    held = now["on_table"]["tip"]
    page.fill("#run-retract-mm", "8")
    page.tap("#run-retract")
    now = day.now(lambda now: now["aside"] and now["at_rest"] and now["sequence"]["state"] == "done", "aside")
    assert math.dist(now["on_table"]["tip"], held) == pytest.approx(8.0, abs=0.002)
    page.click("[data-call='POST cycle/return']:not([aria-disabled=true])")
    day.now(lambda now: not now["aside"] and now["at_rest"] and now["sequence"]["state"] == "done", "back")
    page.wait_for_selector("[data-call='POST cycle/resume']:not([aria-disabled=true])")
    page.keyboard.press("F6")
    day.now(lambda now: now["mode"] == "RUNNING" and now["job"]["line"] >= CUT, "it goes on")


def the_change_is_broken_off(day: Day) -> None:
    """By an emergency stop between two steps; where the tools are is looked at and confirmed."""
    page = day.page
    day.now(lambda now: now["mode"] == "TOOL_CHANGE" and now["job"]["line"] == CHANGE, "the second change")
    now = day.now(lambda now: "step 4" in ((now["change"] or {}).get("sentence") or ""), "its fourth step")
    page.tap("#dx-estop")
    now = day.now(lambda now: now["mode"] == "FAULT" and now["job"]["state"] == "fault", "the fault")
    assert now["fault"]["name"] == "EMERGENCY_STOP"
    page.wait_for_selector(".line.alarm .strong:has-text('mergency stop')")
    page.click(".line.alarm button:not([aria-disabled=true])")
    now = day.now(lambda now: now["mode"] == "OFF" and now["sequence"]["state"] == "done", "the reset")
    assert now["fault"] is None and now["tool"] is None and now["changer"]["doubt"] is not None
    day.view("run")
    day.follows("next.changer", "1", "")
    day.now(lambda now: now["tool"] == 1 and now["changer"]["doubt"] is None, "where the tools are")
    day.comes_up()


def to_the_end(day: Day) -> None:
    """With the tool that had to come, after the change, and no sooner than the offer says."""
    offer = day.shop.do("GET", "/restart")
    assert not offer["offered"] and (offer["line"], offer["change"], offer["fetch"]) == (CHANGE, True, 2)
    day.follows("next.restart_tool")
    day.now(lambda now: now["tool"] == 2 and now["mode"] == "READY", "T2")
    offer = day.shop.do("GET", "/restart")
    assert offer["offered"] and offer["tool"] == 2
    day.now(lambda now: now["next"]["key"] == "next.restart", "the offer")
    day.page.wait_for_function("() => dx.status.next.key === 'next.restart'")
    day.page.click(NEXT)
    job = day.now(lambda now: (now["job"] or {}).get("state") == "loaded", "the loading")["job"]
    assert (job["name"], job["line"]) == (NAME, CHANGE)
    day.starts(f"from line {CHANGE}, with T2 and G55")
    day.now(lambda now: now["job"]["state"] == "completed" and now["mode"] == "READY", "the end")
    day.took_as_told()
    day.now(lambda _: day.shop.run_record()["program"] == NAME, "the record, which comes after the run's end")
    assert day.shop.run_record()["result"] == "completed"
    day.view("runs")
    day.page.wait_for_selector(f"#runs-list tr:first-child:has-text('{NAME}') .chip[data-tone=go]")
    broken = day.page.inner_text("#runs-list tr:has-text('fault')")
    assert "Emergency stop" in broken
