"""Components of the page, each alone, with made-up statuses: what they show, and what they ask for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from support.live.components import Stage, on_stage

from controller.messages import message, text
from controller.state.modes import Fault, fault_message

pytestmark = pytest.mark.slow

SPINDLE = {"max_rev_min": 24000.0, "driven": True, "tells_load": True, "adaptive": True}
MACROS = [
    {"name": "Park", "lines": ["G53 G0 Z260"], "role": "operate"},
    {"name": "Warm up", "lines": ["M3 S6000"], "role": "set_up"},
]
TOOL = {"name": "end mill, d 3", "radius_mm": 1.5, "length_mm": 55.0, "flute_mm": 15.0}


@pytest.fixture(scope="module")
def made(chromium: Any) -> Iterator[Stage]:
    with on_stage(chromium, spindle=SPINDLE, outputs=["mist", "coolant"], macros=MACROS) as stage:
        yield stage


@pytest.fixture
def stage(made: Stage) -> Stage:
    made.clear()
    return made


def sentence(key: str, **values: Any) -> dict[str, Any]:
    """As the panel tells a text of the catalogue."""
    one = message(key, **values)
    return {**one, "sentence": text(one)}


# ---- tool, feed and spindle


def test_the_card_of_tool_feed_and_spindle_says_all_of_them(stage: Stage) -> None:
    stage.answers |= {"GET tools": {"tools": {"3": TOOL}}}
    stage.tell(
        mode="RUNNING",
        tool=3,
        codes=["G1", "H3", "D3", "T3"],
        feed_mm_min={"programmed": 12500.0, "actual": 11593.0},
        limited_by="Y acceleration",
        spindle={"rev_min": 24000.0, "actual_rev_min": 23998.0, "load": 54.4},
        coolant={"mist": True, "flood": True},
    )
    stage.show("views/run.js", "ToolFeedSpindle")
    stage.page.wait_for_selector(".run-tool .tool-name >> text=end mill, d 3")
    tool, feed, spindle = (one.split() for one in stage.page.locator(".tfs").all_inner_texts())
    assert tool[:2] == ["T", "3"] and {"H3", "D3"} <= set(tool)
    assert feed[:2] == ["F", "11593"] and {"12500", "mm/min"} <= set(feed) and "acceleration" in feed
    assert spindle[:2] == ["S", "23998"] and {"54", "24000", "1/min"} <= set(spindle)
    assert " ".join(spindle).lower().endswith("mist, flood")


@pytest.mark.parametrize(
    ("use", "shown"),
    [
        ({"number": 1, "most_cut_min": 10.0, "cut_s": 150.0}, "75 %"),
        ({"number": 1, "most_cut_min": 10.0, "cut_s": 150.0, "most_parts": 10, "parts": 9}, "10 %"),
        ({"number": 1, "worn": True}, "worn"),
    ],
)
def test_of_a_tools_life_the_limit_that_is_nearest_counts(
    use: dict[str, Any], shown: str, stage: Stage
) -> None:
    stage.answers |= {"GET usage": {"tools": [use]}}
    stage.tell(tool=1)
    stage.show("views/run.js", "ToolFeedSpindle")
    stage.page.wait_for_selector(f"#run-life >> text={shown}")


def test_what_is_not_known_is_a_dash(stage: Stage) -> None:
    stage.tell(mode="OFF")
    stage.show("views/run.js", "ToolFeedSpindle")
    assert stage.page.locator(".tfs > .figures").all_inner_texts() == ["–", "–", "–"]


# ---- figures of the axes


def test_an_axis_shows_each_figure_in_its_column_and_unit(stage: Stage) -> None:
    joint = {"work": -1.5, "machine": 20.25, "to_go": 0.125, "actual": 20.249, "error": 0.004, "homed": True}
    stage.tell(work_offset="G55", joints={"X": joint, "A": {**joint, "homed": False, "limit": "-"}})
    stage.show("views/run.js", "Axes")
    row = {
        name: stage.page.inner_text(f"[data-axis=X] .c-{name}")
        for name in ("work", "unit", "to_go", "machine", "actual")
    }
    assert row == {
        **{"work": "−1.500", "unit": "mm", "to_go": "0.125", "machine": "20.250", "actual": "20.249"}
    }
    assert "4" in stage.page.inner_text("[data-axis=X] .error-figure")
    assert stage.page.inner_text("[data-axis=A] .c-unit") == "°"
    assert stage.page.get_attribute("[data-homed=A]", "data-state") == "no"
    assert "−" in stage.page.inner_text("[data-limit=A]") and not stage.page.inner_text("[data-limit=X]")
    assert "G55" in stage.page.inner_text("thead .c-work")
    assert stage.page.inner_text("[data-axis=Y] .c-work") == "–", "nothing is told of it"
    stage.page.evaluate("dx.inch = true; dx.draw()")
    assert stage.page.inner_text("[data-axis=X] .c-machine") == "0.7972"
    assert stage.page.inner_text("[data-axis=A] .c-work") == "−1.500", "degrees stay degrees"


@pytest.mark.parametrize(("share", "tone"), [(0.1, "go"), (0.6, "hold"), (-0.9, "stop")])
def test_a_following_error_has_the_tone_of_its_share(share: float, tone: str, stage: Stage) -> None:
    most = stage.page.evaluate("dx.axis('X').following_error")
    stage.tell(joints={"X": {"error": share * most}})
    stage.show("views/run.js", "Axes")
    bar = stage.page.locator("[data-error=X]")
    assert bar.get_attribute("data-tone") == tone
    assert f"--side: {1 if share < 0 else 0}" in str(bar.get_attribute("style"))


# ---- what to do next


NEXT = [
    ({"verb": "home"}, "Home all", "POST machine/home"),
    ({"verb": "enable"}, "", "POST machine/enable"),
    ({"verb": "resume"}, "", "POST cycle/resume"),
    ({"verb": "reset"}, "", "POST machine/reset"),
    ({"verb": "mdi", "args": {"text": "T2 M6"}}, "T2 M6", "POST mdi"),
]


@pytest.mark.parametrize(("step", "label", "call"), NEXT, ids=[one[0]["verb"] for one in NEXT])
def test_the_guide_has_the_button_of_what_it_says(
    step: dict[str, Any], label: str, call: str, stage: Stage
) -> None:
    stage.tell(next={"args": {}, "place": "", "waits": False, **step, **sentence("next.home")})
    stage.show("guide.js", "Guide")
    button = stage.page.locator(".next button")
    assert button.get_attribute("data-call") == call and label in button.inner_text()
    assert text(message("next.home")) in stage.page.inner_text(".next")


def test_the_guide_offers_control_before_what_needs_it_and_nothing_of_a_machine_that_is_silent(
    stage: Stage,
) -> None:
    stage.tell(next={"verb": "resume", **sentence("next.home")})
    stage.page.evaluate("Object.assign(dx, { token: '', holder: 'anna' })")
    stage.show("guide.js", "Guide")
    assert stage.page.inner_text(".next button") == stage.page.evaluate("dx.words['frame.take']")
    stage.page.evaluate("dx.silent = true; dx.draw()")
    assert stage.page.locator(".next").count() == 0


def test_what_is_only_waited_for_has_no_button(stage: Stage) -> None:
    stage.tell(next={"verb": "", "waits": True, **sentence("next.home")})
    stage.show("guide.js", "Guide")
    assert stage.page.locator(".next button").count() == 0


# ---- alarms


FOLLOWING = fault_message(Fault.FOLLOWING_ERROR, "Y")
ALARM = {"name": "FOLLOWING_ERROR", "axis": "Y", "position_trusted": False}
DOOR = [{"name": "DOOR_OPEN", "key": "", "values": {}, "sentence": "The door is open."}]


def alarm() -> dict[str, Any]:
    return {**ALARM, **FOLLOWING, "sentence": text(FOLLOWING)}


def test_of_two_alarms_the_first_is_a_line_and_both_are_there_when_it_is_opened(stage: Stage) -> None:
    stage.tell(mode="FAULT", fault=alarm(), interlock="DOOR_OPEN", notices=DOOR)
    stage.show("frame.js", "Lines")
    page = stage.page
    assert page.inner_text("#dx-messages") == "2" and page.is_hidden(".line.barred")
    assert page.locator(".line.alarm .remedy").count() == 0
    page.click("#dx-messages")
    assert page.is_visible(".line.barred >> text=The door is open.")
    assert page.get_attribute("#dx-messages", "aria-expanded") == "true"
    page.click("#dx-messages")
    assert page.is_hidden(".line.barred")


def test_one_alarm_that_explains_nothing_has_nothing_to_be_opened(stage: Stage) -> None:
    stage.tell(interlock="DOOR_OPEN", notices=DOOR)
    stage.show("frame.js", "Lines")
    assert stage.page.is_visible(".line.barred") and stage.page.locator("#dx-messages").count() == 0
    stage.tell()
    assert stage.page.is_hidden(".line.barred")


# ---- questions


def opened(stage: Stage, what: str) -> Any:
    """The page with a question that its button has opened."""
    stage.page.evaluate("import('/page/dialog.js').then((made) => void Object.assign(dx, made))")
    stage.tell()
    stage.show_page()
    stage.page.evaluate(
        f"() => {{ dx.opener = async () => (dx.said = await dx.{what}); dx.said = 'nothing'; }}"
    )
    stage.page.focus("#opener")
    stage.page.keyboard.press("Enter")
    stage.page.wait_for_selector("dialog[open]")
    return stage.page


FOCUSED = "document.activeElement.closest('dialog') !== null"


@pytest.mark.parametrize(
    ("what", "keys", "said"),
    [
        ("ask('Is it so?')", "Enter", True),
        ("ask('Is it so?')", "Escape", False),
        ("ask('Is it so?')", "Tab Enter", False),
        ("ask_for('How many?', 'frame.yes', '3')", "Enter", "3"),
        ("ask_for('How many?', 'frame.yes', '3')", "7 Enter", "7"),
        ("ask_for('How many?', 'frame.yes', '3')", "Escape", None),
    ],
)
def test_a_question_is_answered_by_keys_and_gives_the_focus_back(
    what: str, keys: str, said: object, stage: Stage
) -> None:
    page = opened(stage, what)
    assert page.evaluate(FOCUSED)
    for key in keys.split():
        page.keyboard.press(key)
    page.wait_for_selector("dialog", state="detached")
    assert page.evaluate("dx.said") == said
    assert page.evaluate("document.activeElement.id") == "opener"


def test_nothing_of_the_page_is_reached_while_it_asks_but_the_stops(stage: Stage) -> None:
    page = opened(stage, "ask('Is it so?')")
    places = [page.locator(f"#dx-{name}").bounding_box() for name in ("hold", "stop", "estop")]
    for key in ("Tab",) * 12 + ("Shift+Tab",) * 12:
        page.keyboard.press(key)
        assert page.evaluate(f"document.activeElement === document.body || {FOCUSED}")
    assert page.evaluate("document.elementFromPoint(640, 400).closest('dialog') !== null")
    page.keyboard.press("Escape")
    page.wait_for_selector("dialog", state="detached")
    after = [page.locator(f"#dx-{name}").bounding_box() for name in ("hold", "stop", "estop")]
    assert places == after, "they stay at their place"


@pytest.mark.parametrize("name", ["hold", "stop", "estop"])
def test_a_stop_is_taken_while_it_asks(name: str, stage: Stage) -> None:
    page = opened(stage, "ask('Is it so?')")
    page.evaluate("import('/page/stops.js').then(() => null)")
    page.wait_for_function("() => dx.question !== null")
    page.click(f"#dx-{name}")
    path = {"hold": "cycle/hold", "stop": "cycle/stop", "estop": "machine/estop"}[name]
    page.wait_for_timeout(0)
    assert path in [one.path for one in stage.asked]
    assert page.is_visible("dialog[open]"), "it is still to be answered"


def test_a_question_takes_the_place_of_another_which_is_answered_with_no(stage: Stage) -> None:
    page = opened(stage, "ask('The first?')")
    page.evaluate("() => void dx.ask('The second?')")
    page.wait_for_selector("dialog >> text=The second?")
    assert page.evaluate("dx.said") is False and page.locator("dialog").count() == 1
    page.keyboard.press("Escape")
    page.wait_for_selector("dialog", state="detached")
    assert page.evaluate("document.activeElement.id") == "opener"


# ---- jog and macros


def test_the_cross_moves_two_axes_and_says_so(stage: Stage) -> None:
    stage.tell()
    stage.show("views/jog.js", "Cross")
    buttons = stage.page.locator(".jog-button")
    labels = [str(one.get_attribute("aria-label")) for one in buttons.all()]
    assert labels == [
        *("X minus, Y plus", "Y plus", "X plus, Y plus", "X minus"),
        *("X plus", "X minus, Y minus", "Y minus", "X plus, Y minus"),
    ]
    assert stage.page.locator(".jog-button[aria-disabled]").count() == 0
    stage.tell(mode="RUNNING")
    assert stage.page.locator(".jog-button[aria-disabled=true][title*='Possible in']").count() == 8


@pytest.mark.parametrize(
    ("codes", "line"),
    [(["G91"], "G90 G0 X0 Y0\nG91"), (["G90", "G16"], "G90 G15 G0 X0 Y0\nG16")],
)
def test_the_way_to_zero_is_one_of_positions_and_keeps_the_mode(
    codes: list[str], line: str, stage: Stage
) -> None:
    stage.tell(codes=codes, work_offset="G55")
    stage.show("views/jog.js", "Cross")
    stage.page.click("[data-zero=XY]")
    stage.page.wait_for_function("() => dx.question !== null")
    assert "G55" in stage.page.evaluate("dx.question.sentence")
    stage.page.evaluate("dx.question.end(true)")
    stage.page.wait_for_function("() => dx.question === null")
    stage.page.wait_for_timeout(0)
    assert [one.body for one in stage.asked] == [{"text": line}]


@pytest.mark.parametrize(
    ("role", "off"), [("set_up", []), ("operate", ["Warm up"]), ("view", ["Park", "Warm up"])]
)
def test_a_macro_is_grey_for_who_has_not_its_role(role: str, off: list[str], stage: Stage) -> None:
    stage.tell()
    stage.page.evaluate("(role) => { dx.user = { ...dx.user, role }; }", role)
    stage.show("views/jog.js", "Macros")
    greyed = stage.page.locator("[data-macro][aria-disabled=true]").all()
    assert [one.get_attribute("data-macro") for one in greyed] == off
    assert stage.page.locator("[data-macro]").count() == len(MACROS)
    if role == "set_up":
        stage.page.click("[data-macro='Warm up']")
        stage.page.wait_for_timeout(0)
        assert [(one.path, one.body) for one in stage.asked] == [("macros/Warm%20up", {"still": True})]
