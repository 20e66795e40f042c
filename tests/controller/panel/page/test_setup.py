"""Set-up on the page: homing, work offsets, touching off, tools."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import browsing
import pytest
from browsing import Site, until

pytestmark = pytest.mark.slow


@pytest.fixture
def setup(page: Any, site: Site) -> Iterator[Any]:
    page.evaluate("dx.show('setup')")
    page.wait_for_selector("section[data-view=setup] .part[data-shown]")
    yield page


def part(page: Any, name: str) -> None:
    page.click(f"[data-setup={name}]")
    page.wait_for_selector(f".part[data-part={name}][data-shown]")


def test_one_axis_is_homed_after_a_question(setup: Any, site: Site) -> None:
    part(setup, "homing")
    before = len(site.asked("home"))
    setup.click("#setup-homing tr:nth-child(2) button")
    setup.wait_for_selector(".dx-ask >> text=Home Y? It will move.")
    assert len(site.asked("home")) == before
    browsing.yes(setup)
    assert until(lambda: site.asked("home")[before:], "homing")[0][2] == {"axes": ["Y"]}


def test_an_offset_is_typed_and_saved_also_with_a_decimal_comma(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    row = "#setup-offsets tr[data-row=G54]"
    setup.fill(f"{row} [data-field=X]", "12,5")
    setup.fill(f"{row} [data-field=rZ]", "-30")
    setup.click(f"{row} td:last-child button")
    asked = until(lambda: site.asked("set_offset"), "the offset")[-1][2]
    assert asked["name"] == "G54"
    assert asked["values"]["origin_mm"][0] == 12.5
    assert asked["values"]["turned_deg"] == [0.0, 0.0, -30.0]


def test_what_is_no_number_is_not_saved(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    before = len(site.asked("set_offset"))
    row = "#setup-offsets tr[data-row=G54]"
    setup.fill(f"{row} [data-field=X]", "abc")
    setup.click(f"{row} td:last-child button")
    setup.wait_for_selector("#dx-said:has-text('A number is needed.')")
    assert len(site.asked("set_offset")) == before


def test_an_offset_is_set_from_where_the_tip_is(setup: Any, site: Site) -> None:
    """The tip is at X 10: to read 4 there, the offset is 6."""
    part(setup, "offsets")
    before = len(site.asked("set_offset"))
    setup.evaluate("dx.call('PUT', 'offsets/G54', {origin_mm: [0, 0, 0], turned_deg: [0, 0, 0]})")
    until(lambda: len(site.asked("set_offset")) > before, "the old offset")
    setup.click("#setup-offsets tr[data-row=G54] button >> nth=0")
    setup.fill(".dx-ask input", "4")
    browsing.yes(setup)
    asked = until(lambda: site.asked("set_offset")[before + 1 :], "the offset")[0][2]
    assert asked["values"]["origin_mm"] == [6.0, 0.0, 0.0]


def test_a_tool_is_added_changed_and_taken_away(setup: Any, site: Site) -> None:
    part(setup, "tools")
    setup.click("#setup-add")
    setup.wait_for_selector(".dx-ask input")
    browsing.yes(setup)
    row = "#setup-tools tr[data-row='2']"
    setup.wait_for_selector(row)
    for name, value in (("name", "ball"), ("radius_mm", "2.5"), ("corner_mm", "2.5"), ("taper_deg", "3")):
        setup.fill(f"{row} [data-field={name}]", value)
    before = len(site.asked("set_tool"))
    setup.click(f"{row} td:last-child button >> nth=0")
    asked = until(lambda: site.asked("set_tool")[before:], "the tool")[0][2]
    assert asked == {
        **{"number": 2, "name": "ball", "radius_mm": 2.5, "length_mm": 0.0, "flute_mm": 15.0},
        **{"corner_mm": 2.5, "taper_deg": 3.0},
    }
    setup.wait_for_selector("#dx-said:has-text('T2 is saved.')")
    setup.click(f"{row} td:last-child button >> nth=1")
    browsing.yes(setup)
    setup.wait_for_selector(row, state="detached")


def test_without_control_nothing_of_it_can_be_pressed(setup: Any, site: Site) -> None:
    setup.evaluate("dx.call('DELETE', 'control').then(() => { dx.token = ''; })")
    setup.wait_for_selector("body[data-control=free]")
    for name in ("homing", "offsets", "tools"):
        part(setup, name)
        setup.wait_for_function(
            "(part) => [...document.querySelectorAll(part + ' button')].every((one) => one.disabled)",
            arg=f".part[data-part={name}]",
        )
