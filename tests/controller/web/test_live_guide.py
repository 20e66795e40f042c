"""From cold to the first motion of the shop's machine, by pressing what the guide says and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.live import browser, live_page, shop

from controller.machine import machine_file
from controller.store.service_store import FILE

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

NAME = "example2_ready.ngc"
BUTTON = "section[data-view=run] .next button.act:not([aria-disabled])"
QUESTION = ".dx-ask"
MOVES = ("RUNNING", "TOOL_CHANGE")
CLICKS, CONFIRMING = 5, 4  # at most; the second: where the changer's tools are


@pytest.fixture
def context(chromium: Any) -> Any:
    return chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")


class Led:
    """Who presses the guide's first button, and answers what is asked."""

    def __init__(self, page: Any) -> None:
        self.page, self.clicks, self.asked = page, 0, list[str]()

    def answers(self) -> None:
        """All questions, with yes; an empty field gets the number of no tool."""
        while self.page.query_selector(QUESTION):
            words = self.page.inner_text(f"{QUESTION} p")
            field = self.page.query_selector(f"{QUESTION} input")
            if field is not None and words.startswith("Which tool is in the spindle"):
                field.fill("0")
            browser.yes(self.page)
            self.clicks += 1
            self.asked.append(words)
            self.page.wait_for_function("(words) => dx.question?.sentence !== words", arg=words)

    def goes_on(self) -> None:
        """One step of the guide, done."""
        before = self.page.evaluate("dx.status.next.key")
        self.page.click(BUTTON)
        self.clicks += 1
        if self.page.evaluate("dx.status.next.verb") in ("changer_confirm", "home", "start"):
            self.page.wait_for_selector(QUESTION)
            self.page.wait_for_timeout(0)
        while self.page.query_selector(QUESTION):
            self.answers()
            self.page.evaluate(
                "() => new Promise((next) => setTimeout(next, 50))"
            )  # the next one of a dialogue
        self.page.wait_for_function(
            "(key) => dx.status.next.key !== key && !dx.status.next.waits || " + moves(), arg=before
        )


def moves() -> str:
    return f"{list(MOVES)!r}.includes(dx.status.mode)"


@pytest.mark.parametrize("confirmed", [True, False], ids=["confirmed", "not confirmed"])
def test_cold_to_motion_by_the_guide_alone(context: Any, tmp_path: Path, confirmed: bool) -> None:
    machine = "shop" if confirmed else shop.text_of("shop")
    with shop.opened(tmp_path, machine=machine) as running:
        running.until(lambda now: (now.get("sequence") or {}).get("state") == "done", "power up")
        assert (tmp_path / "state" / FILE).exists()
        running.upload(NAME, machine_file.shipped_program(NAME).read_bytes())
        with live_page.page(context, running, control=False) as page:
            led = Led(page)
            page.wait_for_selector(BUTTON)
            while page.evaluate(f"!{moves()}"):
                led.goes_on()
            print(led.clicks, led.asked)
            assert led.clicks <= CLICKS + (0 if confirmed else CONFIRMING), led.asked
            # What guards a person or a tool was asked: arm and magazine, axes that move, the start.
            guards = ["Home all axes?", "Start the loaded program?"]
            guards += [] if confirmed else ["arm and magazine stand clear"]
            assert all(any(words in asked for asked in led.asked) for words in guards), led.asked
            assert any("with T" in asked or "empty spindle" in asked for asked in led.asked)
            live_page.wait(page, "['RUNNING', 'TOOL_CHANGE'].includes(dx.status.mode)")
