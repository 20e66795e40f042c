"""The views that look: drives, scope, alarms, runs, machine file, 3-D, while Example 2 is being cut."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from support.live import browser
from support.live.browser import Site

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def looker(chromium: Any, stepped: Site) -> Iterator[Any]:
    """One page for all tests, as an operator has it; without control: looking needs none."""
    with browser.looker(chromium, stepped, 1280, 720) as made:
        yield made


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


def told(page: Any, cell: str) -> str:
    return str(page.text_content(f"[data-drive='{cell}']"))


def test_an_emergency_is_told_once_with_its_code_and_only_of_its_drive(looker: Any) -> None:
    show(looker, "drives")
    looker.wait_for_selector("[data-drive='Y.said'] .wrong")
    assert told(looker, "Y.said") == "8611h: following error"
    assert told(looker, "X.said") == "none"


def test_a_temperature_is_shown_of_the_drive_that_tells_it(looker: Any) -> None:
    show(looker, "drives")
    looker.wait_for_selector("[data-drive='A.warmth']:has-text('41.5 °C')")
    assert told(looker, "X.warmth") == "–"
    assert looker.is_visible("th.d-warmth")


def test_a_value_that_the_tick_newly_tells_is_shown_under_its_name(looker: Any, stepped: Site) -> None:
    show(looker, "drives")
    stepped.tell(tick={**stepped.ask("status")["tick"], "syncs": 4711})
    looker.wait_for_selector(".drives-tick dt:text-is('syncs') + dd:text-is('4711')")
    stepped.tell()
    looker.wait_for_selector(".drives-tick dt:text-is('syncs')", state="detached")
    assert looker.locator(".drives-tick dt").count() == 7


def test_only_the_drives_that_home_are_said_to_be_homing(looker: Any, stepped: Site) -> None:
    show(looker, "drives")
    drives = [{**one, "homing": one["axis"] == "Z"} for one in stepped.ask("status")["drives"]]
    stepped.tell(mode="HOMING", drives=drives)
    looker.wait_for_selector("[data-drive='Z.mode']:has-text('homing')")
    assert {told(looker, f"{axis}.mode") for axis in "XYAC"} == {"cyclic position"}
    stepped.tell()
    looker.wait_for_selector("[data-drive='Z.mode']:has-text('cyclic position')")


def test_the_bus_shows_its_budget_what_was_heard_and_its_errors(looker: Any) -> None:
    """Heard: a SYNC and five commands in each of 300 ticks of 2 ms."""
    show(looker, "drives")
    looker.wait_for_selector("#drives-buses >> text=can0")
    figures = looker.locator("#drives-buses .meters .figures").all_text_contents()
    assert figures[:3] == ["60.3 %", "31.5 %", "18.9 %"] and len(figures) == 6  # and as much of can1
    tones = looker.eval_on_selector_all("#drives-buses .meter", "(all) => all.map((one) => one.dataset.tone)")
    assert tones[:3] == ["go"] * 3
    assert "TEC 96 REC 12" in " ".join(looker.inner_text("#drives-buses").split())


def test_late_ticks_are_counted_and_those_that_were_skipped_are_red(looker: Any) -> None:
    show(looker, "drives")
    body = {"from_us": [0, 500, 1000], "ticks": [90, 9, 0], "skipped_from_us": 500, "seconds": 60.2}
    with looker.expect_response("**/machine/buses") as waiting:
        pass
    answer = {**waiting.value.json(), "lateness": body}
    looker.route("**/machine/buses", lambda route: route.fulfill(json=answer))
    looker.wait_for_selector("#drives-late-of:has-text('60 s')")
    tones = looker.eval_on_selector_all("#drives-late .meter", "(all) => all.map((one) => one.dataset.tone)")
    assert tones == ["info", "stop", "info"]
    found = looker.locator("#drives-late > .figures").all_text_contents()
    assert found == ["0 – 500 µs", "90", "500 – 1000 µs", "9", "≥ 1000 µs", "0"]
    looker.unroute("**/machine/buses")


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
    stand_still(looker)
    click_at(looker, 0.4, 0.8)
    looker.wait_for_selector("#scope-cursors:has-text('Hz')")
    (one, two), apart = cursors(looker), looker.inner_text("#scope-cursors").split("Δ ")[1]
    assert apart.split()[0] == str(two - one)
    assert float(apart.split()[2]) == pytest.approx(0.002 * (two - one), rel=1e-4)


def stand_still(page: Any) -> None:
    if page.get_attribute("#scope-run", "aria-pressed") == "true":
        page.click("#scope-run")
    page.wait_for_selector("#scope-run[aria-pressed=false]")


def narrow(page: Any) -> None:
    """Standing still, without cursors, with every tick in a column of its own."""
    page.select_option("#scope-seconds", "0.1")
    stand_still(page)
    page.wait_for_selector("#scope-canvas[data-per-column='1']")
    page.click("#scope-none")


def click_at(page: Any, *shares: float) -> None:
    box = page.locator("#scope-canvas").bounding_box()
    for share in shares:
        page.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])


def cursors(page: Any) -> list[int]:
    """The ticks of the two cursors, as they are read."""
    return [int(tick) for tick in re.findall(r"\d: tick (\d+)", page.inner_text("#scope-cursors"))]


def test_a_cursor_reads_each_signal_as_its_tick_has_it(looker: Any, stepped: Site) -> None:
    show(looker, "scope")
    looker.select_option("#scope-source", "now")
    choose_signals(looker, "X.command", "C.actual")
    narrow(looker)
    click_at(looker, 0.3, 0.7)
    looker.wait_for_selector("#scope-cursors:has-text('Hz')")
    for place, tick in enumerate(cursors(looker)):
        row = stepped.ask(f"ticks?names=X.command,C.actual&first={tick}&last={tick}")["low"]
        for name in ("X.command", "C.actual"):
            shown = looker.inner_text(f"[data-signal='{name}']").splitlines()[place]
            assert float(shown.replace("−", "-")) == pytest.approx(row[name][0], rel=1e-5), name


def test_cursors_are_led_by_keys(looker: Any) -> None:
    show(looker, "scope")
    narrow(looker)
    looker.focus("#scope-canvas")
    looker.wait_for_selector("#scope-cursors:has-text('by keys')")
    looker.keyboard.press("2")
    one, two = cursors(looker)
    for key, wanted in (
        ("ArrowRight", [one, two + 1]),
        ("Shift+ArrowLeft", [one, two - 9]),
        ("1", [one, two - 9]),
        ("ArrowLeft", [one - 1, two - 9]),
        ("Escape", []),
    ):
        looker.keyboard.press(key)
        assert cursors(looker) == wanted, key


def test_a_press_that_comes_while_a_picture_is_on_its_way_is_not_lost(looker: Any) -> None:
    """2 s do not have a column for each tick, nor has the half of it; the last of four presses has."""
    show(looker, "scope")
    looker.select_option("#scope-source", "now")
    looker.select_option("#scope-seconds", "2")
    looker.wait_for_selector("#scope-canvas[data-per-column]:not([data-per-column='1'])")
    stand_still(looker)
    looker.evaluate("for (let i = 0; i < 4; i += 1) document.getElementById('scope-in').click()")
    looker.wait_for_selector("#scope-canvas[data-per-column='1']")
    looker.click("#scope-run")


def test_a_single_shot_waits_for_its_trigger_and_shows_what_was_before_it(looker: Any, stepped: Site) -> None:
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
    fired = stepped.ask(f"ticks/trigger?name=path_time&level={level}&edge=rising")["tick"]
    first, last = exported(looker)
    assert last - first == 100
    assert fired - first == 25


def exported(page: Any) -> tuple[int, int]:
    """The first and the last tick that are shown, and would be in a file."""
    found = parse_qs(urlsplit(page.get_attribute("#scope-csv", "href")).query)
    return int(found["first"][0]), int(found["last"][0])


@pytest.mark.parametrize("source", ["now", "recording"])
@pytest.mark.parametrize("kind", ["csv", "npz"])
def test_what_the_scope_shows_is_exported(kind: str, source: str, looker: Any) -> None:
    show(looker, "scope")
    choose_source(looker, source)
    choose_signals(looker, "X.command", "X.error")
    with looker.expect_download() as waiting:
        looker.click(f"#scope-{kind}")
    data = waiting.value.path().read_bytes()
    if kind == "csv":
        names, *rows = data.decode().splitlines()
        assert names == "tick,time_s,X.command [mm],X.error [mm]"
        ticks = [int(row.split(",")[0]) for row in rows]
    else:
        found = np.load(io.BytesIO(data))
        assert set(found) >= {"X.command", "X.error"}
        ticks = found["tick"].tolist()
    assert len(ticks) > 100 and ticks == list(range(ticks[0], ticks[0] + len(ticks)))
    choose_source(looker, "now")


def choose_source(page: Any, kind: str) -> None:
    """The machine now, or the first recording."""
    option = page.wait_for_selector(f"#scope-source option[value^='{kind}']", state="attached")
    page.select_option("#scope-source", option.get_attribute("value"))
    page.wait_for_selector("[data-signal]:not(:empty)")


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
    looker.wait_for_function("() => document.querySelector('#scope-source')?.value.startsWith('recording:')")
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
