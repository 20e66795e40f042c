"""What was, on the page: alarms and runs, also while older ones are being read."""

from __future__ import annotations

from typing import Any

import pytest
from support.live.browser import Site, until

from controller.api.store import Store

pytestmark = pytest.mark.slow
PAGE = 50  # that are listed at first
CHANGER = {
    **{"spindle": 1, "doubt": None, "step": None, "preparing": None, "ready": 0, "away": []},
    "pockets": [{"pocket": 1, "tool": 2, "here": True}],
}


@pytest.fixture(scope="module")
def store(site: Site) -> Store:
    """The panel's own, as the service's records come into it."""
    return Store(site.folder)


def show(page: Any, name: str) -> None:
    page.evaluate("(name) => dx.show(name)", name)
    page.wait_for_selector(f"section[data-view={name}] .card")


def test_an_alarm_is_acknowledged_also_among_older_ones_and_new_ones_still_come(
    page: Any, store: Store
) -> None:
    first = store.alarms.add("ESTOP", "The first of all.", "", number=4711)
    for n in range(PAGE + 9):
        store.alarms.add("ESTOP", f"Sentence {n}.")
    show(page, "alarms")
    cards = "document.querySelectorAll('#alarms-list .alarm-card').length"
    page.wait_for_function(f"() => {cards} === {PAGE}")
    page.click("#alarms-more")
    page.wait_for_function(f"() => {cards} === {PAGE + 10}")
    card = ".alarm-card:has-text('The first of all.')"
    assert "#4711" in page.inner_text(card), "the number that the machine gave it"
    page.click(f"{card} >> text=Acknowledge")
    page.wait_for_selector(f"{card} button:has-text('Acknowledge')", state="detached")
    found = store.alarms.get(first)
    assert found is not None and found.acknowledged_s is not None
    assert str(found.acknowledged_by) in page.inner_text(card)
    store.alarms.add("LIMIT", "It came later.", "Y")
    page.wait_for_selector(".alarm-card:first-child:has-text('It came later.')")
    assert page.is_visible("#alarms-more") is False


def test_what_is_wrong_now_has_its_number_and_its_time(page: Any, site: Site) -> None:
    show(page, "alarms")
    fault = {"name": "FOLLOWING_ERROR", "axis": "Z", "sentence": "Too far.", "number": 12, "time_s": 1.7e9}
    site.tell(fault=fault)
    page.wait_for_selector("#alarms-now >> text=Too far.")
    told = page.inner_text("#alarms-now .alarm-head")
    assert "#12" in told and "Z" in told
    assert page.evaluate("dx.forms.date(1.7e9)") in told
    site.tell()
    page.wait_for_selector("#alarms-now >> text=Nothing is wrong.")


def test_what_is_nothing_leaves_no_figure_0(page: Any, site: Site, store: Store) -> None:
    """An alarm of no line, a fault without number or time, a changer in which nothing stands ready."""
    store.alarms.add("ESTOP", "Of no program.", "", line=0)
    site.tell(fault={"name": "ESTOP", "sentence": "Now.", "number": 0, "time_s": 0}, changer=CHANGER)
    show(page, "alarms")
    page.wait_for_selector(".alarm-card:has-text('Of no program.')")
    bare = """(place) => [...document.querySelectorAll(`${place}, ${place} *`)]
      .flatMap(({ childNodes }) => [...childNodes])
      .filter(({ nodeType, data }) => nodeType === 3 && data.trim() === "0").length"""
    for place in ("#alarms-list", "#alarms-now"):
        assert page.evaluate(bare, place) == 0, place
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=changer]")
    page.wait_for_selector("#changer-spindle")
    assert page.evaluate(bare, "section[data-view=setup] .part") == 0


def test_new_runs_come_while_older_ones_are_read_and_their_worst_errors_are_told_by_unit(
    page: Any, store: Store
) -> None:
    errors = {"X": 0.0211, "Y": 0.0042, "A": 0.0123, "C": 0.0313}
    for n in range(PAGE + 1):
        store.runs.end(store.runs.begin(f"{n}.ngc", "0" * 64, following_error=errors), "completed")
    show(page, "runs")
    rows = "document.querySelectorAll('#runs-list tr').length"
    page.wait_for_function(f"() => {rows} === {PAGE}")
    page.click("#runs-more")
    page.wait_for_function(f"() => {rows} === {PAGE + 1}")
    assert "X 21.1 µm, C 31.3 m°" in page.inner_text("#runs-list tr:first-child .r-error")
    store.runs.end(store.runs.begin("later.ngc", "0" * 64), "stopped")
    page.wait_for_selector("#runs-list tr:first-child:has-text('later.ngc')")
    assert until(lambda: page.evaluate(rows) == PAGE + 2, "all of the runs")
    until(lambda: not page.is_visible("#runs-more"), "no more")


def test_the_record_of_a_run_is_kept_and_let_go_by_one_button(page: Any, site: Site, store: Store) -> None:
    record = "2026-11-21T080000.000-part.ngc"
    (store.folder / "runs" / record).mkdir(parents=True)
    store.runs.end(store.runs.begin("part.ngc", "0" * 64, record=record), "completed")
    show(page, "runs")
    page.click("#runs-list tr:has-text('part.ngc')")
    page.click("#run-keep:has-text('Keep record')")
    page.click("#run-keep:has-text('Keep no longer')")
    page.wait_for_selector("#run-keep:has-text('Keep record')")
    asked = [values for _, verb, values in site.commands("keep_run")]
    assert asked == [{"record": record, "on": True}, {"record": record, "on": False}]
