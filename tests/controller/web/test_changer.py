"""The tool changer on the page: what it knows of the tools, and the dialogue that confirms where they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site, until
from support.machines import changer_bench

from controller.machine.tool_store import AWAY, SPINDLE, Step, ToolStore, placed
from controller.service.tool_changer import ToolChanger

pytestmark = pytest.mark.slow


class NoTick:
    def request(self, request: object, value: float = 0.0, /) -> int:
        raise AssertionError("a page that is looked at moves nothing")


@pytest.fixture
def store(tmp_path: Path) -> Any:
    made = ToolStore(tmp_path / "tools.db")
    yield made
    made.close()


def told(store: ToolStore) -> dict[str, Any]:
    """As the service tells it of a store."""
    machine = changer_bench.machine()
    changer = machine.changer
    assert changer is not None
    made = ToolChanger(store, lambda: changer, NoTick(), lambda *_: None, 0.002, lambda _: None, machine.io)
    return made.to_json()


def shown(page: Any, site: Site, store: ToolStore) -> Any:
    """The Changer's part of Set-up, with what the store holds."""
    site.tell(changer=told(store))
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=changer]")
    page.wait_for_selector("#changer-pockets tr")
    return page


def answer(page: Any, asked: str, words: str | None = None) -> None:
    page.wait_for_selector(f".dx-ask >> text={asked}")
    if words is not None:
        page.fill(".dx-ask input", words)
    browser.yes(page)


def row(page: Any, pocket: int) -> str:
    return " ".join(page.inner_text(f"#changer-pockets tr[data-pocket='{pocket}']").split())


def test_a_machine_without_a_changer_says_so(page: Any) -> None:
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=changer]")
    page.wait_for_selector("[data-part=changer] >> text=tools are changed by hand")
    assert page.query_selector("#changer-confirm") is None


def test_where_every_tool_is(page: Any, site: Site, store: ToolStore) -> None:
    store.confirm({1: 1, 2: SPINDLE, 3: AWAY})
    shown(page, site, store)
    assert page.inner_text("#changer-spindle") == "T2"
    assert row(page, 1).startswith("1 T1 in its pocket")
    assert row(page, 2).startswith("2 T2 not in it") and row(page, 3).startswith("3 T3 not in it")
    assert page.query_selector("#changer-doubt") is None


def test_a_change_that_was_interrupted_is_told_and_confirmed(page: Any, site: Site, store: ToolStore) -> None:
    store.confirm(placed((1, 2, 3), 2, []))
    store.begin(Step(2, 3, 5, "Let it go", carries=2, goes_to=2))
    shown(page, site, store)
    doubt = page.inner_text("#changer-doubt")
    assert "T2" in doubt and "Let it go" in doubt
    assert page.inner_text("#changer-spindle") == "not known" and "not known" in row(page, 2)
    page.wait_for_selector("[data-part=changer] >> text=Step 6: Let it go")
    before = len(site.commands("changer_confirm"))
    page.click("#changer-confirm")
    answer(page, "Which tool is in the spindle?", "0")
    answer(page, "Which tools are out of the machine?", "3, 1")
    assert len(site.commands("changer_confirm")) == before, "nothing is told before all was answered"
    answer(page, "In the spindle: no tool")
    made = until(lambda: site.commands("changer_confirm")[before:], "what was confirmed")[0][2]
    assert made == {"spindle": 0, "away": [3, 1], "clear": True}


@pytest.mark.parametrize("given_up_at", [0, 1, 2])
def test_a_dialogue_that_is_given_up_confirms_nothing(
    page: Any, site: Site, store: ToolStore, given_up_at: int
) -> None:
    shown(page, site, store)
    before = len(site.commands("changer_confirm"))
    page.click("#changer-confirm")
    for asked in ("Which tool is in the spindle?", "Which tools are out of the machine?")[:given_up_at]:
        answer(page, asked, "1")
    page.wait_for_selector(".dx-ask")
    page.keyboard.press("Escape")
    page.wait_for_selector(".dx-ask", state="detached")
    page.wait_for_timeout(100)
    assert site.commands("changer_confirm")[before:] == []


def test_what_is_no_number_of_a_tool_confirms_nothing(page: Any, site: Site, store: ToolStore) -> None:
    shown(page, site, store)
    before = len(site.commands("changer_confirm"))
    page.click("#changer-confirm")
    answer(page, "Which tool is in the spindle?", "T2")
    page.wait_for_selector(".dx-ask", state="detached")
    assert site.commands("changer_confirm")[before:] == []


def test_what_was_last_known_stands_in_the_questions(page: Any, site: Site, store: ToolStore) -> None:
    """As after a back-up was brought back: somebody must look, but need not type it all."""
    store.confirm({1: 1, 2: AWAY, 3: AWAY})
    store.forget()
    shown(page, site, store)
    page.click("#changer-confirm")
    answer(page, "Which tool is in the spindle?", "1")
    page.wait_for_selector(".dx-ask >> text=out of the machine")
    assert page.input_value(".dx-ask input") == "2 3"
    page.keyboard.press("Escape")


def test_a_pocket_is_given_to_a_tool(page: Any, site: Site, store: ToolStore) -> None:
    store.confirm({1: 1, 2: 2, 3: SPINDLE})
    shown(page, site, store)
    page.click("#changer-pockets tr[data-pocket='2'] button")
    answer(page, "Whose is pocket 2?", "7")
    made = until(lambda: site.commands("changer_pocket"), "the pocket")[-1][2]
    assert made == {"pocket": 2, "tool": 7}
