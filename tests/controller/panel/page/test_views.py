"""The views that look: drives, scope, alarms, runs, machine file, 3-D, while Example 2 is being cut."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import browsing
import numpy as np
import pytest
from browsing import Site

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with browsing.fake_site(tmp_path_factory.mktemp("stepped"), "stepped_site.py") as made:
        yield made


@pytest.fixture(scope="module")
def looker(chromium: Any, site: Site) -> Iterator[Any]:
    """One page for all tests, as an operator has it; without control: looking needs none."""
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")
    made = browsing.opened(context, site)
    yield made
    errors = made.errors
    context.close()
    assert not errors, errors


def show(page: Any, name: str) -> None:
    page.evaluate("(name) => dx.show(name)", name)
    page.wait_for_selector(f"section[data-view={name}] .card")


# ---- drives


def test_each_drive_is_told_in_words(looker: Any) -> None:
    show(looker, "drives")
    row = "#drives-list tr:nth-child(3)"
    looker.wait_for_selector(f"{row} >> text=operation enabled")
    for words in ("can0 · 3", "cyclic position", "12 ms", "voltage", "follows target"):
        assert words in looker.inner_text(row), looker.inner_text(row)


def test_the_target_of_a_drive_is_that_of_the_status(looker: Any) -> None:
    show(looker, "drives")
    looker.wait_for_function(
        "() => document.querySelector('[data-drive=\"X.target\"]').textContent !== ''"
        " && document.querySelector('[data-drive=\"X.target\"]').textContent"
        " === dx.forms.mm(dx.status.joints.X.machine)"
    )


def test_the_bus_shows_its_budget_and_the_ticks_their_lateness(looker: Any) -> None:
    show(looker, "drives")
    looker.wait_for_selector("#drives-buses >> text=60.3 %")
    looker.wait_for_selector("#drives-late .meter")
    assert "s" in looker.inner_text("#drives-late-of")


# ---- scope


def choose_signals(page: Any, *names: str) -> None:
    page.wait_for_function("() => document.querySelector('#scope-add').options.length > 10")
    page.wait_for_selector("#scope-signals .signal")  # some are there from the first
    while page.locator("#scope-signals .signal").count():
        page.click("#scope-signals .signal button >> nth=0")
    for name in names:
        page.select_option("#scope-add", name)
    page.wait_for_function(
        "(n) => document.querySelectorAll('#scope-signals .signal').length === n", arg=len(names)
    )


def test_the_scope_runs_stands_still_and_reads_out_at_its_cursors(looker: Any) -> None:
    show(looker, "scope")
    choose_signals(looker, "X.command", "X.velocity", "feed")
    looker.wait_for_selector("#scope-run[aria-pressed=true]")
    looker.wait_for_selector("[data-signal='feed']:not(:empty)")
    looker.click("#scope-run")
    looker.wait_for_selector("#scope-run[aria-pressed=false]")
    box = looker.locator("#scope-canvas").bounding_box()
    for share in (0.4, 0.8):
        looker.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
    looker.wait_for_selector("#scope-cursors:has-text('Hz')")
    assert looker.inner_text("#scope-cursors").startswith("1: ")


def test_a_single_shot_waits_for_its_trigger_and_shows_what_was_before_it(looker: Any) -> None:
    show(looker, "scope")
    choose_signals(looker, "path_time")
    looker.select_option("#scope-seconds", "0.2")
    looker.select_option("#scope-trigger-signal", "path_time")
    level = looker.evaluate("dx.status.time_s") + 0.5
    looker.fill("#scope-level", str(level))
    looker.fill("#scope-before", "25")
    looker.click("#scope-single")
    looker.wait_for_selector("#scope-single[aria-pressed=false]")
    looker.wait_for_selector("#scope-state:has-text('standing')")


@pytest.mark.parametrize("kind", ["csv", "npz"])
def test_what_the_scope_shows_is_exported(kind: str, looker: Any) -> None:
    show(looker, "scope")
    choose_signals(looker, "X.command", "X.error")
    with looker.expect_download() as waiting:
        looker.click(f"#scope-{kind}")
    data = waiting.value.path().read_bytes()
    if kind == "csv":
        assert data.splitlines()[0].startswith(b"tick,time_s,X.command")
    else:
        found = np.load(io.BytesIO(data))
        assert len(found["X.command"]) == len(found["tick"]) > 100


# ---- alarms


def test_an_alarm_is_told_with_cause_and_remedy_and_its_recording_opens_in_the_scope(looker: Any) -> None:
    show(looker, "alarms")
    card = ".alarm-card:has-text('FOLLOWING_ERROR')"
    looker.wait_for_selector(card)
    told = looker.inner_text(card)
    for words in ("Z", "position trusted", "Cause", "Remedy", "Line", "anna"):
        assert words in told, told
    looker.click(f"{card} >> text=Open in scope")
    looker.wait_for_selector("section[data-view=scope][data-shown]")
    looker.wait_for_function("() => document.querySelector('#scope-source').value.startsWith('recording:')")
    looker.wait_for_selector("[data-signal]:not(:empty)")
    looker.select_option("#scope-source", "now")


def test_only_the_alarms_that_nobody_saw_are_listed_where_that_is_asked_for(looker: Any) -> None:
    show(looker, "alarms")
    looker.wait_for_function("() => document.querySelectorAll('.alarm-card').length === 2")
    looker.click("#alarms-open")
    looker.wait_for_function("() => document.querySelectorAll('.alarm-card').length === 1")
    assert "ESTOP" in looker.inner_text(".alarm-card")
    looker.click("#alarms-open")
    looker.wait_for_function("() => document.querySelectorAll('.alarm-card').length === 2")


# ---- runs


def test_a_run_is_chosen_and_shows_how_it_went(looker: Any) -> None:
    show(looker, "runs")
    looker.wait_for_function("() => document.querySelector('#runs-all').textContent === '4'")
    looker.click("#runs-list tr:nth-child(2) button")
    looker.wait_for_selector("#runs-detail .chip:has-text('fault')")
    told = looker.inner_text("#runs-detail")
    for words in ("33850", "C 31.3", "1:08"):
        assert words in told, told
    with looker.expect_popup() as opened:
        looker.click("#runs-detail >> text=Report")
    assert "Largest following error" in opened.value.inner_text("body")
    opened.value.close()


# ---- machine file


def test_the_machine_file_is_searched_and_names_its_lines(looker: Any) -> None:
    show(looker, "setup")
    looker.click("[data-setup=file]")
    looker.wait_for_selector("#setup-file .key >> text=period_s")
    looker.fill("#setup-filter", "retract")
    looker.wait_for_function("() => document.querySelectorAll('#setup-file .key').length < 5")
    line = int(looker.inner_text("#setup-file tr:has(.key:text('retract_mm')) td >> nth=0"))
    text = looker.evaluate("fetch('/api/v1/machine/file').then((a) => a.json()).then((f) => f.text)")
    assert "retract_mm" in text.splitlines()[line - 1]
    looker.fill("#setup-filter", "")


# ---- 3-D


def picture(page: Any) -> None:
    page.set_viewport_size({"width": 640, "height": 480})  # drawn without a graphics card
    show(page, "scene")
    page.wait_for_function("() => window.dxScene && dxScene.shape && dxScene.tool_key")


def test_the_picture_has_the_path_done_and_to_do_and_the_surfaces(looker: Any) -> None:
    picture(looker)
    looker.wait_for_function("() => dxScene.at > 0")
    drawn = looker.evaluate(
        "[dxScene.shape.surfaces.length, dxScene.done.geometry.drawRange.count,"
        " dxScene.ahead.geometry.drawRange.count, dxScene.shape.tips.length, dxScene.at]"
    )
    surfaces, done, ahead, points, at = drawn
    assert surfaces == 2
    assert (done, ahead) == (at + 1, points - at)


def test_the_tool_in_the_spindle_is_drawn_where_the_status_tells(looker: Any) -> None:
    """T2 of the shipped table has a radius of 1.5 mm."""
    picture(looker)
    looker.wait_for_function("() => JSON.parse(dxScene.tool_key).number === 2")
    assert looker.evaluate("JSON.parse(dxScene.tool_key).radius_mm") == 1.5
    apart = looker.evaluate(
        "() => { dxScene.status(dx.status); const at = dxScene.tool.position.toArray();"
        " return Math.hypot(...dx.status.on_table.tip.map((v, i) => v - at[i])) }"
    )
    assert apart < 1e-6


def test_what_nobody_looks_at_is_not_drawn(looker: Any) -> None:
    """The scene would draw 25 pictures a second as long as the page is open."""
    picture(looker)
    looker.wait_for_function("() => dxScene.drawn > 0")
    show(looker, "runs")
    before = looker.evaluate("dxScene.drawn")
    looker.wait_for_timeout(500)
    assert looker.evaluate("dxScene.drawn") == before
    show(looker, "scene")
    looker.wait_for_function("(before) => dxScene.drawn > before", arg=before)


def test_the_machine_may_stand_instead_of_the_part(looker: Any) -> None:
    picture(looker)
    looker.click("[data-scene='frame machine']")
    looker.wait_for_function("() => dxScene.frame === 'machine'")
    assert looker.evaluate("dxScene.root.matrix.elements[0]") == 1.0
    looker.click("[data-scene='frame part']")
    looker.click("[data-scene='look top']")
    looker.click("[data-scene='clear']")
