"""Probing cycles on the page: a picture of each, their values, and what is asked of the machine."""

from __future__ import annotations

from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site, until

from controller.program.probing_cycles import CYCLES, SET_NONE

pytestmark = pytest.mark.slow


@pytest.fixture
def probing(page: Any, site: Site) -> Any:
    site.tell(mode="READY")
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=probing]")
    page.wait_for_selector("[data-part=probing] [name=most]")
    return page


def run(page: Any) -> None:
    page.click("#probing-run:not([aria-disabled])")
    page.wait_for_selector(".dx-ask >> text=Probe from where the probe stands?")
    browser.yes(page)


def test_every_cycle_has_its_picture_and_its_values(probing: Any) -> None:
    seen = set()
    drawn = (
        "() => { const {naturalWidth: drawn, width} = document.querySelector('img.probing-picture');"
        " return drawn > 0 && 200 < width && width < 400; }"  # beside the values, not over the page
    )
    for cycle, values in CYCLES.items():
        probing.select_option("[name=cycle]", cycle)
        probing.wait_for_selector(f"img.probing-picture[src$='/probing/{cycle}.svg']")
        probing.wait_for_function(drawn)
        fields = probing.eval_on_selector_all(".probing [name]", "all => all.map((one) => one.name)")
        assert fields == ["cycle", *values, *([] if cycle in SET_NONE else ["offset"])]
        seen.add(probing.get_attribute("img.probing-picture", "alt"))
    assert len(seen) == len(CYCLES)


def test_a_cycle_is_run_with_what_was_typed(probing: Any, site: Site) -> None:
    before = len(site.commands("probe"))
    probing.select_option("[name=cycle]", "edge")
    probing.select_option("[name=towards]", "Y-")
    probing.fill("[name=most]", "7,5")
    probing.select_option("[name=offset]", "G55")
    run(probing)
    made = until(lambda: site.commands("probe")[before:], "the cycle")[0][2]
    assert made == {"cycle": "edge", "values": {"towards": "Y-", "most": 7.5}, "offset": "G55"}


def test_a_cycle_on_the_setter_sets_the_tool_and_no_offset(probing: Any, site: Site) -> None:
    before = len(site.commands("probe"))
    probing.select_option("[name=offset]", "G55")
    probing.select_option("[name=cycle]", "tool_length")
    probing.select_option("[name=keep]", "yes")
    run(probing)
    made = until(lambda: site.commands("probe")[before:], "the cycle")[0][2]
    values = {"most": 20.0, "turning": 0.0, "keep": "yes"}
    assert made == {"cycle": "tool_length", "values": values, "offset": "none"}


def test_what_is_no_number_moves_nothing(probing: Any, site: Site) -> None:
    before = len(site.commands("probe"))
    probing.select_option("[name=cycle]", "bore")
    probing.fill("[name=most]", "far")
    run(probing)
    probing.wait_for_selector("#dx-said:not([hidden])")
    assert site.commands("probe")[before:] == []


def test_what_was_found_is_shown_as_a_table(probing: Any) -> None:
    rows = probing.wait_for_selector("#probing-found tbody").query_selector_all("tr")
    told = [" ".join(row.inner_text().split()) for row in rows]
    assert told[0].endswith("part.ngc Bore, from inside X 12.5000 mm Y −3.2500 mm diameter 20.0100 mm")
    assert told[1].endswith("MDI mine way 1.0000 mm turned by −0.5000 °")
    assert probing.get_attribute("[data-part=probing] a[download]", "href") == "/api/v1/probing/found.csv"
