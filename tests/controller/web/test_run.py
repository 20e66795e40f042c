"""What the run view shows is what the machine tells, each figure in its own place."""

from __future__ import annotations

from typing import Any

import pytest
from support.fakes.fake_socket import AXES
from support.live.browser import Site, until, yes

pytestmark = pytest.mark.slow

COLUMNS = ("work", "to_go", "machine", "actual", "error")
JOINTS = {
    axis: {column: 100.0 * i + 10.0 * k + 0.125 for k, column in enumerate(COLUMNS[:4])}
    | {"error": (0.0, 1.0, -3.0, 3.5, -9.0)[i], "homed": i != 1, "limit": (None, None, "+", "-", None)[i]}
    for i, axis in enumerate(AXES)
}
JOB = {
    **{"name": "part.ngc", "sha256": "0" * 64, "state": "running", "line": 7, "block": 4, "fraction": 0.25},
    **{"elapsed_s": 61.0, "left_s": 3723.0, "duration_s": 3784.0},
}


def until_shown(page: Any, place: str, words: str) -> None:
    page.wait_for_function(
        "([place, words]) => document.querySelector(place)?.innerText === words", arg=[place, words]
    )


def test_each_cell_of_the_axes_has_its_own_figure(page: Any, site: Site) -> None:
    site.tell(joints=JOINTS, work_offset="G55")
    until_shown(page, ".dro .c-work .figures", "G55")
    for i, axis in enumerate(AXES):
        row = page.locator(f"tr[data-axis={axis}] td")
        shown = row.evaluate_all("(cells) => cells.map((one) => one.innerText.trim())")
        work, *others = (f"{100 * i + 10 * k}.125" for k in range(4))
        um = ("0.0 µm", "1000.0 µm", "−3000.0 µm", "3500.0 m°", "−9000.0 m°")[i]
        assert shown == [work, "mm" if axis in "XYZ" else "°", *others, um]
    heads = page.locator(".dro thead th").evaluate_all("(cells) => cells.map((one) => one.innerText)")
    assert heads == ["Axis", "Work G55", "Unit", "To go", "Machine", "Actual", "Following error"]


def test_axes_are_marked_where_they_have_no_zero_or_stand_at_their_end(page: Any, site: Site) -> None:
    site.tell(joints=JOINTS)
    until_shown(page, "[data-homed=Y]", "no ref")
    until_shown(page, "[data-homed=X]", "ref ✓")
    for axis, words in (("X", ""), ("Z", "end +"), ("A", "end −")):
        until_shown(page, f"[data-limit={axis}]", words)


def test_the_bar_of_a_following_error_is_full_where_the_run_ends(page: Any, site: Site) -> None:
    """4 mm and degrees in the machine's file, 8 of C; left where it is negative, colours from half on."""
    site.tell(joints=JOINTS)
    page.wait_for_selector("[data-error=Z][data-tone=hold]")
    bars = {axis: page.locator(f"[data-error={axis}]") for axis in AXES}
    read = "(e) => [e.style.getPropertyValue('--size'), e.style.getPropertyValue('--side'), e.dataset.tone]"
    assert {axis: one.evaluate(read) for axis, one in bars.items()} == {
        "X": ["0", "0", "go"],
        "Y": ["0.25", "0", "go"],
        "Z": ["0.75", "1", "hold"],
        "A": ["0.875", "0", "stop"],
        "C": ["1", "1", "stop"],
    }


def test_tool_feed_and_what_limits_it_are_shown(page: Any, site: Site) -> None:
    site.tell(
        mode="RUNNING",
        tip={"X": 1.5, "Y": -2.25, "Z": 3.0},
        axis={"I": 0.6, "J": 0.0, "K": -0.8},
        feed_mm_min={"programmed": 1200.0, "actual": 433.0},
        limited_by="Y velocity",
        spindle={"rev_min": 9000.0, "actual_rev_min": 8990.0, "at_speed": True, "load": 54.4},
        coolant={"mist": True, "flood": True},
    )
    until_shown(page, ".run-feed .huge", "433")
    facts = page.locator(".run-feed dd").evaluate_all("(all) => all.map((one) => one.innerText)")
    assert facts == ["1200 mm/min", "Y velocity"]
    assert page.inner_text(".run-spindle .middle") == "8990"
    facts = page.locator(".run-spindle dd").evaluate_all("(all) => all.map((one) => one.innerText)")
    assert facts == ["9000 1/min", "54 %", "mist, flood"]
    tool = page.locator(".run-state .pair").evaluate_all(
        "(all) => all.map((one) => [...one.children].map((e) => e.innerText).join(' '))"
    )
    assert tool == ["X 1.500", "Y −2.250", "Z 3.000", "I 0.60000", "J 0.00000", "K −0.80000"]


def test_the_program_under_way_shows_its_block_and_its_times(page: Any, site: Site) -> None:
    site.tell(mode="RUNNING", job=JOB, in_block={"what": "cut", "fraction": 0.4, "u": 0.3721})
    until_shown(page, ".run-program .program-head", "Program\nLine\n7\nBlock\n4\ncut\n40 %\nu 0.3721")
    share = "(e) => e.style.getPropertyValue('--share')"
    assert page.eval_on_selector(".block-bar", share) == "0.4"
    assert page.eval_on_selector(".program-bar", share) == "0.25"
    times = page.locator(".times .time").evaluate_all("(all) => all.map((one) => one.innerText)")
    assert times[:3] == ["elapsed\n1:01", "left\n1:02:03", "in all\n1:03:04"]
    assert page.inner_text(".program-left") == "left 1:02:03"


def test_lines_typed_by_hand_are_listed_though_they_are_in_no_store(page: Any, site: Site) -> None:
    site.tell(mode="RUNNING", job={**JOB, "name": "MDI", "line": 2, "text": "G0 X1\nG0 Y2"})
    until_shown(page, "#run-listing .now", "2G0 Y2")
    assert page.locator("#run-listing > div").count() == 2


@pytest.mark.parametrize(
    ("told", "place", "words"),
    [
        ({"waiting": True}, ".mode-more", "Waits for coolant or clamps"),
        ({"waiting": True, "spindle": {"at_speed": False}}, ".mode-more", "Waits for the spindle"),
        ({"interlock": "DOOR_OPEN"}, ".line.barred .figures", "The door is open."),
        ({"warning": "DOOR_OPEN"}, ".line.warning", "The door is open."),
    ],
)
def test_what_stands_in_the_way_is_shown(
    told: dict[str, Any], place: str, words: str, page: Any, site: Site
) -> None:
    assert not page.is_visible(place) or page.inner_text(place) == ""
    site.tell(notices=[{"name": "DOOR_OPEN", "sentence": "The door is open."}], **told)
    until_shown(page, place, words)
    assert page.is_visible(place)


OFF, BACK, BY = "#run-retract", "[data-call='POST cycle/return']", "#run-retract-mm"
ROOM_MM = 280.0  # up to 300 of the trunnion's Z, which stands at 20 here and is the tool's axis


def is_off(page: Any, place: str) -> bool:
    return page.get_attribute(place, "aria-disabled") == "true"  # type: ignore[no-any-return]


def last_retract(site: Site, so_many: int) -> dict[str, Any]:
    return until(lambda: site.commands("retract")[so_many - 1 :], "the way off")[0][2]  # type: ignore[no-any-return]


def test_a_held_tool_goes_off_the_path_by_what_is_given_and_back_only_once_it_is_away(
    page: Any, site: Site
) -> None:
    before = len(site.commands("retract"))
    page.evaluate("dx.call('POST', 'cycle/start')")
    page.wait_for_selector("body[data-mode=RUNNING]")
    page.wait_for_selector(f"{OFF}[aria-disabled=true]")
    assert page.is_disabled(BY) and page.input_value(BY) == "" and is_off(page, BACK)
    page.evaluate("dx.call('POST', 'cycle/hold')")
    page.wait_for_selector(f"{OFF}:not([aria-disabled=true])")
    assert is_off(page, BACK), "it is on the path"
    room_mm = float(page.input_value(BY))
    assert room_mm == pytest.approx(ROOM_MM, abs=2e-3) and room_mm <= ROOM_MM
    page.click(OFF)
    assert last_retract(site, before + 1) == {"mm": room_mm}
    page.wait_for_selector(f"{OFF}[aria-disabled=true]")
    page.click(f"{BACK}:not([aria-disabled=true])")
    until(lambda: site.commands("return"), "the way back")
    page.fill(f"{BY}:enabled", "12.5")
    page.click(OFF)
    assert last_retract(site, before + 2) == {"mm": 12.5}
    page.evaluate("dx.stop()")
    page.wait_for_selector("body[data-mode=READY]")


def test_from_ready_the_tool_goes_off_and_a_distance_that_is_too_long_is_refused_with_what_is_possible(
    page: Any, site: Site
) -> None:
    before = len(site.commands("retract"))
    page.fill(f"{BY}:enabled", "280.5")
    page.click(OFF)
    room_mm = site.ask("status")["retract_room_mm"]
    said = f"() => document.getElementById('dx-said').textContent.includes('{room_mm:.3f} mm')"
    page.wait_for_function(said)
    page.fill(BY, str(room_mm))
    page.click(OFF)
    assert until(lambda: site.commands("retract")[before + 1 :], "the way off")[0][2] == {"mm": room_mm}
    assert is_off(page, BACK), "no program is held"


def test_two_steps_of_the_override_count_twice_however_fast_they_come(page: Any, site: Site) -> None:
    page.evaluate(
        "document.querySelectorAll('[data-override=\"10\"]').forEach((b) => { b.click(); b.click(); })"
    )
    page.wait_for_function("() => dx.status.override === 1.2")
    assert [args["share"] for _, _, args in site.commands("override")][-2:] == [1.1, 1.2]
    page.click("[data-call='PUT overrides/feed']")
    page.wait_for_function("() => dx.status.override === 1")


def test_a_slider_that_was_dragged_back_to_where_it_was_follows_the_machine_again(
    page: Any, site: Site
) -> None:
    page.set_viewport_size({"width": 1920, "height": 1080})  # a smaller one has its buttons alone
    box = page.locator("#run-override").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 40, y)
    page.mouse.move(x, y)
    page.mouse.up()
    site.tell(override=0.5)
    page.wait_for_function("() => document.getElementById('run-override').value === '50'")


# ---- the place of a program that has ended


@pytest.mark.parametrize("state", ["stopped", "fault", "interrupted"])
def test_the_place_stays_on_the_screen_after_an_end_and_a_reload_until_another_program_is_loaded(
    state: str, page: Any, site: Site
) -> None:
    site.tell(mode="RUNNING", job=JOB, in_block={"what": "cut", "fraction": 0.4, "u": 0.3721})
    until_shown(page, ".run-program .u", "u 0.3721")
    site.tell(
        mode="READY", job={**JOB, "state": state}, in_block={"what": "cut", "fraction": 0.4, "u": 0.3721}
    )
    for _ in range(2):
        page.wait_for_selector("body[data-mode=READY]")
        until_shown(page, ".run-program .program-head", "Program\nLine\n7\nBlock\n4\ncut\n40 %\nu 0.3721")
        assert page.inner_text(".program-left") == "left 1:02:03"
        times = page.locator(".times .time").evaluate_all("(all) => all.map((one) => one.innerText)")
        assert times[:3] == ["elapsed\n1:01", "left\n1:02:03", "in all\n1:03:04"]
        page.reload()
    site.tell(
        mode="READY", job={**JOB, "name": "other.ngc", "state": "loading", "left_s": None}, in_block=None
    )
    until_shown(page, ".run-program .u", "u –")
    until_shown(page, ".program-left", "left –:––")


# ---- beside the figures


def test_lengths_are_shown_in_inches_where_that_is_wanted_and_angles_stay(page: Any, site: Site) -> None:
    joints = {**JOINTS, "X": {**JOINTS["X"], "work": 25.4, "machine": -1.27}}
    site.tell(joints=joints, feed_mm_min={"programmed": 254.0, "actual": 127.0}, work_offset="G54")
    page.click("#dx-unit")
    until_shown(page, "tr[data-axis=X] .c-work", "1.0000")
    until_shown(page, "tr[data-axis=X] .c-machine", "−0.0500")
    until_shown(page, "tr[data-axis=A] .c-work", "300.125")
    until_shown(page, ".run-feed .huge", "5.0")
    assert page.inner_text(".run-feed dd").endswith("in/min")
    assert page.inner_text("tr[data-axis=X] .c-unit") == "in"
    page.reload()
    until_shown(page, "tr[data-axis=X] .c-work", "1.0000")
    page.click("#dx-unit")
    until_shown(page, "tr[data-axis=X] .c-work", "25.400")


def test_an_axis_is_set_to_zero_or_to_a_value_in_the_offset_that_is_active(page: Any, site: Site) -> None:
    site.tell(mode="READY", not_homed=[], work_offset="G54")
    page.wait_for_selector("[data-set=X]:not([aria-disabled])")
    for axis, typed, reads in (("X", None, "0"), ("X", "12.5", "12.5"), ("C", "+360/8", "+360/8")):
        asked = set_by_page(page, site, axis, typed)
        assert asked == {"name": "G54", "reads": {axis: reads}, "tool": None}


def test_what_is_typed_is_of_the_unit_that_is_shown(page: Any, site: Site) -> None:
    site.tell(mode="READY", not_homed=[], work_offset="G54")
    page.click("#dx-unit")
    for axis, typed, reads in (("X", "1/2", "(1/2)*25.4"), ("X", "+0.1", "+(0.1)*25.4"), ("C", "9", "9")):
        assert set_by_page(page, site, axis, typed)["reads"] == {axis: reads}
    page.click("#dx-unit")


def set_by_page(page: Any, site: Site, axis: str, typed: str | None) -> dict[str, Any]:
    """What is asked for where an axis is pressed, and a value typed."""
    before = len(site.commands("set_offset"))
    page.click(f"[data-set={axis}]")
    page.wait_for_selector(".dx-ask >> text=G54")
    if typed:
        page.fill(".dx-ask input", typed)
    page.keyboard.press("Enter")
    return dict(until(lambda: site.commands("set_offset")[before:], "the new origin")[0][2])


def test_modal_codes_and_parts_made_are_shown(page: Any, site: Site) -> None:
    site.tell(codes=["G17", "G41", "G54", "T3", "S8000", "M3"])
    page.wait_for_selector(".codes .chip:text-is('G41')")
    assert page.locator(".codes .chip").all_inner_texts() == ["G17", "G41", "G54", "T3", "S8000", "M3"]
    for codes, shown in ((["H2", "D1"], "H2 D1"), (["G43.1 Z20.5", "D1"], "G43.1 Z20.5 D1")):
        site.tell(codes=codes)
        page.wait_for_selector(f".run-tool dd:text-is('{shown}')")
    site.tell(codes=[])
    page.wait_for_selector(".codes", state="detached")


def test_spindle_coolant_and_clamps_are_told_by_hand(page: Any, site: Site) -> None:
    page.click("[data-spindle='-10']:not([aria-disabled=true])")
    until(lambda: site.commands("spindle_override"), "the override")
    assert site.commands("spindle_override")[-1][2] == {"share": 0.9}
    page.click("[data-to=jog]")
    page.fill("#run-spindle", "1500")
    page.click("[data-hand=left]:not([aria-disabled=true])")
    page.wait_for_selector(".dx-ask >> text=1500")
    yes(page)
    until(lambda: site.commands("spindle"), "the spindle")
    assert site.commands("spindle")[-1][2] == {"rev_min": -1500.0}
    page.click("[data-hand=off]")
    until(lambda: site.commands("spindle")[-1][2] == {"rev_min": 0.0}, "the spindle off")
    site.tell(coolant={"mist": True, "flood": False}, outputs={"a_open": False})
    page.wait_for_selector("[data-hand=mist][aria-pressed=true]")
    page.click("[data-hand=flood]")
    until(lambda: site.commands("coolant"), "coolant")
    assert site.commands("coolant")[-1][2] == {"mist": True, "flood": True}
    page.click("[data-hand='clamp A']")
    until(lambda: site.commands("clamps"), "the clamp")
    assert site.commands("clamps")[-1][2] == {"open": ["A"]}


def test_load_and_share_stand_beside_the_feed_and_the_switch_is_there(page: Any, site: Site) -> None:
    spindle = {"rev_min": 8000.0, "actual_rev_min": 7985.0, "load": 62.4}
    site.tell(spindle=spindle, adaptive={"on": True, "share": 0.71}, adaptive_feed=True)
    until_shown(page, "#run-load", "62 %")
    until_shown(page, "#run-adaptive", "71 %")
    page.wait_for_selector("[data-toggle='PUT cycle/adaptive_feed'][aria-pressed=true]")
    site.tell(spindle=spindle, adaptive={"on": False, "share": 0.71})
    until_shown(page, "#run-adaptive", "–")


def test_the_switch_of_adaptive_feed_asks_the_machine(page: Any, site: Site) -> None:
    page.click("[data-toggle='PUT cycle/adaptive_feed']")
    page.wait_for_selector("[data-toggle='PUT cycle/adaptive_feed'][aria-pressed=true]")
    assert [args for _, _, args in site.commands("adaptive_feed")] == [{"on": True}]
