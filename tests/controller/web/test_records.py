"""What was, on the page: alarms and runs, also while older ones are being read."""

from __future__ import annotations

from typing import Any

import pytest
from support.fakes.written_history import WrittenHistory
from support.live.browser import Site, until

pytestmark = pytest.mark.slow
PAGE = 50  # that are listed at first
CHANGER = {
    **{"spindle": 1, "doubt": None, "step": None, "preparing": None, "ready": 0, "away": []},
    "pockets": [{"pocket": 1, "tool": 2, "here": True}],
}


@pytest.fixture(scope="module")
def history(site: Site) -> WrittenHistory:
    return WrittenHistory(site.folder)


def show(page: Any, name: str) -> None:
    page.evaluate("(name) => dx.show(name)", name)
    page.wait_for_selector(f"section[data-view={name}] .card")


def test_an_alarm_is_acknowledged_also_among_older_ones_and_new_ones_still_come(
    page: Any, history: WrittenHistory
) -> None:
    first = history.alarm("ESTOP", "The first of all.")
    for n in range(PAGE + 9):
        history.alarm("ESTOP", f"Sentence {n}.")
    show(page, "alarms")
    cards = "document.querySelectorAll('#alarms-list .alarm-card').length"
    page.wait_for_function(f"() => {cards} === {PAGE}")
    page.click("#alarms-more")
    page.wait_for_function(f"() => {cards} === {PAGE + 10}")
    card = ".alarm-card:has-text('The first of all.')"
    assert f"#{first}" in page.inner_text(card), "the number that the machine gave it"
    page.click(f"{card} >> text=Acknowledge")
    page.wait_for_selector(f"{card} button:has-text('Acknowledge')", state="detached")
    (found,) = (one for one in history.alarms() if one.id == first)
    assert found.acknowledged_s is not None
    assert str(found.acknowledged_by) in page.inner_text(card)
    history.alarm("LIMIT", "It came later.", "Y")
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


def test_what_is_nothing_leaves_no_figure_0(page: Any, site: Site, history: WrittenHistory) -> None:
    """An alarm of no line, a fault without number or time, a changer in which nothing stands ready."""
    history.alarm("ESTOP", "Of no program.", "", line=0)
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
    page: Any, history: WrittenHistory
) -> None:
    errors = {"X": 0.0211, "Y": 0.0042, "A": 0.0123, "C": 0.0313}
    for n in range(PAGE + 1):
        history.run(f"{n}.ngc", "completed", following_error=errors)
    show(page, "runs")
    rows = "document.querySelectorAll('#runs-list tr').length"
    page.wait_for_function(f"() => {rows} === {PAGE}")
    page.click("#runs-more")
    page.wait_for_function(f"() => {rows} === {PAGE + 1}")
    assert "X 21.1 µm, C 31.3 m°" in page.inner_text("#runs-list tr:first-child .r-error")
    history.run("later.ngc", "stopped")
    page.wait_for_selector("#runs-list tr:first-child:has-text('later.ngc')")
    assert until(lambda: page.evaluate(rows) == PAGE + 2, "all of the runs")
    until(lambda: not page.is_visible("#runs-more"), "no more")


def test_the_record_of_a_run_is_kept_and_let_go_by_one_button(
    page: Any, site: Site, history: WrittenHistory
) -> None:
    record = "2026-11-21T080000.000-part.ngc"
    (history.state / "runs" / record).mkdir(parents=True)
    history.run("part.ngc", "completed", record=record)
    show(page, "runs")
    page.click("#runs-list tr:has-text('part.ngc')")
    page.click("#run-keep:has-text('Keep record')")
    page.click("#run-keep:has-text('Keep no longer')")
    page.wait_for_selector("#run-keep:has-text('Keep record')")
    asked = [values for _, verb, values in site.commands("keep_run")]
    assert asked == [{"record": record, "on": True}, {"record": record, "on": False}]
