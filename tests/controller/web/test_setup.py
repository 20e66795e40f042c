"""Set-up on the page: homing, work offsets, touching off, tools."""

from __future__ import annotations

from typing import Any

import pytest
from support.live import browser
from support.live.browser import Site, until

pytestmark = pytest.mark.slow


@pytest.fixture
def setup(page: Any) -> Any:
    page.evaluate("dx.show('setup')")
    page.wait_for_selector("section[data-view=setup] .part[data-shown]")
    return page


def part(page: Any, name: str) -> None:
    page.click(f"[data-setup={name}]")
    page.wait_for_selector(f".part[data-part={name}][data-shown]")


def test_one_axis_is_homed_after_a_question(setup: Any, site: Site) -> None:
    part(setup, "homing")
    before = len(site.commands("home"))
    setup.click("#setup-homing tr:nth-child(2) button")
    setup.wait_for_selector(".dx-ask >> text=Home Y? It will move.")
    assert len(site.commands("home")) == before
    browser.yes(setup)
    assert until(lambda: site.commands("home")[before:], "homing")[0][2] == {"axes": ["Y"]}


def test_an_offset_is_typed_and_saved_also_with_a_decimal_comma(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    row = "#setup-offsets tr[data-row=G54]"
    setup.fill(f"{row} [data-field=X]", "12,5")
    setup.fill(f"{row} [data-field=rZ]", "-30")
    setup.click(f"{row} td:last-child button")
    asked = until(lambda: site.commands("set_offset"), "the offset")[-1][2]
    assert asked["name"] == "G54"
    assert asked["values"]["origin_mm"][0] == 12.5
    assert asked["values"]["turned_deg"] == [0.0, 0.0, -30.0]


def test_an_offset_that_nobody_has_set_says_so(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    mark = "#setup-offsets tr[data-row={}] [data-unset]"
    setup.wait_for_selector(mark.format("G55") + " >> text=not set")
    assert not setup.is_visible(mark.format("G54"))


def test_what_is_no_number_is_not_saved(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    before = len(site.commands("set_offset"))
    row = "#setup-offsets tr[data-row=G54]"
    setup.fill(f"{row} [data-field=X]", "abc")
    setup.click(f"{row} td:last-child button")
    setup.wait_for_selector("#dx-said:has-text('A number is needed.')")
    assert len(site.commands("set_offset")) == before


def test_an_offset_and_a_length_are_set_by_what_a_figure_is_to_read(setup: Any, site: Site) -> None:
    """As it is typed: the service does the arithmetic."""
    part(setup, "offsets")
    before = len(site.commands("set_offset"))
    setup.click("#setup-offsets tr[data-row=G54] button >> nth=0")
    setup.fill(".dx-ask input", "+0.1")
    browser.yes(setup)
    asked = until(lambda: site.commands("set_offset")[before:], "the offset")[0][2]
    assert asked == {"name": "G54", "reads": {"X": "+0.1"}, "tool": None}
    part(setup, "tools")
    before = len(site.commands("set_tool"))
    setup.click("[data-touch-length='1']")
    setup.fill(".dx-ask input", "5/2")
    browser.yes(setup)
    asked = until(lambda: site.commands("set_tool")[before:], "the length")[0][2]
    assert asked == {"number": 1, "reads": {"Z": "5/2"}}


def touch_asked(setup: Any, axis: int) -> str:
    """Press "from position" of an axis of G54; what is asked then."""
    setup.click(f"#setup-offsets tr[data-row=G54] .row button >> nth={axis}")
    setup.wait_for_selector(".dx-ask input")
    return str(setup.inner_text(".dx-ask p"))


def test_the_tool_in_the_spindle_touches_off_again_after_a_change_whatever_was_picked(
    setup: Any, site: Site
) -> None:
    tool = "{name: 'long', radius_mm: 3, length_mm: 50, flute_mm: 15}"
    setup.evaluate(f"dx.call('PUT', 'tools/7', {tool})")
    site.tell(tool=1)
    part(setup, "offsets")
    setup.wait_for_function("() => document.querySelectorAll('#setup-tool option').length === 2")
    setup.wait_for_function("() => document.querySelector('#setup-tip').textContent.startsWith('T1:')")
    setup.select_option("#setup-tool", "7")
    asked = touch_asked(setup, 2)
    assert "G43 with T7" in asked and "in the spindle is T1" in asked
    before = len(site.commands("set_offset"))
    browser.yes(setup)
    made = until(lambda: site.commands("set_offset")[before:], "the offset")[0][2]
    assert made == {"name": "G54", "reads": {"Z": "0"}, "tool": 7}
    for number in (7, 1):
        site.tell(tool=number)
        setup.wait_for_function("(n) => document.querySelector('#setup-tool').value === n", arg=str(number))
        assert "G43" not in touch_asked(setup, 2)
        before = len(site.commands("set_offset"))
        browser.yes(setup)
        made = until(lambda at=before: site.commands("set_offset")[at:], "the offset")[0][2]
        assert made["tool"] is None
    setup.select_option("#setup-tool", "7")
    setup.evaluate("dx.show('run'); dx.show('setup')")
    assert setup.input_value("#setup-tool") == "1"
    setup.evaluate("dx.call('DELETE', 'tools/7')")


def test_only_what_was_typed_is_saved_and_what_is_typed_elsewhere_stays(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    setup.evaluate("dx.call('PUT', 'offsets/G55', {origin_mm: [1, 2, 3], turned_deg: [0, 0, 0]})")
    one, other = (f"#setup-offsets tr[data-row={name}]" for name in ("G54", "G55"))
    setup.wait_for_selector(other)
    setup.fill(f"{other} [data-field=X]", "7")
    setup.fill(f"{one} [data-field=X]", "11")
    setup.evaluate("dx.call('PUT', 'offsets/G55', {origin_mm: [1, 2.5, 3], turned_deg: [0, 0, 0]})")
    setup.wait_for_function(f"() => document.querySelector('{other} [data-field=Y]').value === '2.5'")
    setup.click(f"{one} td:last-child button")
    setup.wait_for_selector("#dx-said:has-text('G54 is saved.')")
    setup.wait_for_selector(f"{one} [data-field=X]:not([data-typed])")
    assert setup.input_value(f"{other} [data-field=X]") == "7"
    setup.evaluate("dx.call('PUT', 'offsets/G55', {origin_mm: [1, 4.5, 3], turned_deg: [0, 0, 0]})")
    before = len(site.commands("set_offset"))
    setup.click(f"{other} td:last-child button")
    made = until(lambda: site.commands("set_offset")[before:], "the offset")[0][2]
    assert made["values"]["origin_mm"] == [7.0, 4.5, 3.0]
    setup.fill(f"{one} [data-field=Z]", "99")
    setup.keyboard.press("Escape")
    assert setup.input_value(f"{one} [data-field=Z]") != "99"


def test_what_is_typed_stays_when_saving_was_refused(setup: Any, site: Site) -> None:
    part(setup, "tools")
    field = "#setup-tools tr[data-row='1'] [data-field=radius_mm]"
    setup.fill(field, "-3")
    setup.click("#setup-tools tr[data-row='1'] td:last-child button >> nth=0")
    setup.wait_for_selector("#dx-said[data-tone=warn]")
    setup.evaluate("dx.call('PUT', 'tools/9', {radius_mm: 3, length_mm: 0, flute_mm: 15})")
    setup.wait_for_selector("#setup-tools tr[data-row='9']")  # the table was made with another row
    assert setup.input_value(field) == "-3"
    setup.focus(field)
    setup.keyboard.press("Escape")
    assert setup.input_value(field) == "3"
    setup.evaluate("dx.call('DELETE', 'tools/9')")


def test_a_tool_that_is_there_is_not_written_over_by_one_that_is_added(setup: Any, site: Site) -> None:
    part(setup, "tools")
    for number, said in (("1", "T1 is in the table already"), ("2.5", "A whole number from 1 to 99999")):
        before = len(site.commands("set_tool"))
        setup.click("#setup-add")
        setup.fill(".dx-ask input", number)
        browser.yes(setup)
        setup.wait_for_selector(f"#dx-said:has-text('{said}')")
        assert len(site.commands("set_tool")) == before


def test_the_drives_are_shown_as_the_service_tells_that_they_are_set_up(setup: Any, site: Site) -> None:
    drives = [
        {"axis": "X", "bus": "can0", "node": 1, "state": "OPERATION_ENABLED", "heard": True},
        {"axis": "Z", "bus": "can1", "node": 3, "state": "FAULT", "heard": False, "heartbeat_age_s": 0.01},
        {"axis": "C", "bus": "can1", "node": 5, "state": "SWITCHED_ON", "heard": True},
    ]
    part(setup, "drives")
    for done, words in ((True, "commissioned"), (False, "not commissioned")):
        site.tell(drives=drives, commissioned=done)
        setup.wait_for_selector(f"#setup-commissioned .chip:text-is('{words}')")
    rows = [setup.inner_text(f"#setup-drives tr:nth-child({n})").split("\t") for n in (1, 2, 3)]
    assert [[cell.strip() for cell in row] for row in rows] == [
        ["X", "can0 · 1", "heard", "operation enabled", "simulated", "method 37", "heartbeat"],
        ["Z", "can1 · 3", "silent", "fault", "simulated", "absolute encoder", "heartbeat"],
        ["C", "can1 · 5", "heard", "switched on", "simulated", "method 37", "node guarding"],
    ]


def test_a_tool_is_added_changed_and_taken_away(setup: Any, site: Site) -> None:
    part(setup, "tools")
    setup.click("#setup-add")
    setup.wait_for_selector(".dx-ask input")
    browser.yes(setup)
    row = "#setup-tools tr[data-row='2']"
    setup.wait_for_selector(row)
    for name, value in (("name", "ball"), ("radius_mm", "2.5"), ("corner_mm", "2.5"), ("taper_deg", "3")):
        setup.fill(f"{row} [data-field={name}]", value)
    before = len(site.commands("set_tool"))
    setup.click(f"{row} td:last-child button >> nth=0")
    asked = until(lambda: site.commands("set_tool")[before:], "the tool")[0][2]
    assert asked == {
        **{"number": 2, "name": "ball", "radius_mm": 2.5, "length_mm": 0.0, "flute_mm": 15.0},
        **{"corner_mm": 2.5, "taper_deg": 3.0},
    }
    setup.wait_for_selector("#dx-said:has-text('T2 is saved.')")
    before = len(site.commands("set_tool"))
    setup.uncheck(f"{row} [data-field=centre_cutting]")
    asked = until(lambda: site.commands("set_tool")[before:], "the centre")[0][2]
    assert (asked["number"], asked["radius_mm"], asked["centre_cutting"]) == (2, 2.5, False)
    setup.click(f"{row} td:last-child button >> nth=1")
    browser.yes(setup)
    setup.wait_for_selector(row, state="detached")


USERS = [{"name": name, "role": role} for name, role in (("anna", "set_up"), ("ben", "operate"))]
# Change each box and list that is shown, and see after some statuses whether it shows what was chosen. By
# #scope-add something is added: it shows nothing again.
TURNED_BACK = """async () => {
  const statuses = () => new Promise((go) => {
    let left = 3;
    const drawn = () => requestAnimationFrame(() => requestAnimationFrame(go));
    const off = dx.on("status", () => --left || (off(), drawn()));
  });
  const all = () => [...document.querySelectorAll("section[data-shown] :is(select, input[type=checkbox])")]
    .filter((one) => one.checkVisibility() && !one.disabled && !one.matches("#scope-add"));
  const shown = (one) => (one.type === "checkbox" ? one.checked : one.value);
  const seen = [], back = [];
  for (let i = 0; i < all().length; i += 1) {
    const one = all()[i];
    const name = one.getAttribute("aria-label") || one.name || one.id;
    const other = [...(one.options ?? [])].find((option) => option.value !== one.value);
    if (one.type === "checkbox") one.click();
    else if (other) {
      one.value = other.value;
      one.dispatchEvent(new Event("change", { bubbles: true }));
    } else continue;
    const wanted = one.type === "checkbox" ? one.checked : other.value;
    await statuses();
    seen.push(name);
    if (one.isConnected && shown(one) !== wanted) back.push(name);
  }
  return [seen, back];
}"""


def test_what_is_ticked_or_chosen_stays_shown_until_the_service_has_answered(setup: Any, site: Site) -> None:
    """Every box and list of every view, while no change is answered."""
    waiting: list[Any] = []
    setup.route("**/api/v1/users", lambda route: route.fulfill(json={"users": USERS}))
    setup.route(
        "**/api/v1/**",
        lambda route: route.fallback() if route.request.method == "GET" else waiting.append(route),
    )
    seen: set[str] = set()
    for view in browser.VIEWS:
        setup.evaluate("(name) => dx.show(name)", view)
        setup.wait_for_selector(f"section[data-view={view}] .card")
        for name in setup.eval_on_selector_all("section[data-shown] [data-setup]", NAMES) or [""]:
            if name:
                part(setup, name)
            setup.wait_for_selector(FETCHED.get(name, "section[data-shown] .card"))
            names, back = setup.evaluate(TURNED_BACK)
            assert not back, f"{view} {name}"
            seen |= set(names)
    assert {"T1 Cuts its centre", "Role anna", "Role ben", "alarms", "security", "scope-edge"} <= seen, seen
    assert len(waiting) == 3, "the centre, and two roles"
    for route in waiting:
        route.abort()


FETCHED = {"users": "#users-list select", "notices": "#notices", "tools": "#setup-tools tr"}
NAMES = "(all) => all.map((one) => one.dataset.setup)"


@pytest.mark.parametrize(
    ("name", "place", "was"),
    [
        ("tools", "[data-row='1'] [data-field=centre_cutting]", True),
        ("users", "[data-user=ben] select", "operate"),
    ],
)
def test_what_was_ticked_or_chosen_and_is_refused_goes_back_with_a_sentence(
    name: str, place: str, was: object, setup: Any, site: Site
) -> None:
    refusal = {"error": {"code": "refused", "sentence": "It is refused."}}
    answers: list[Any] = []
    setup.route("**/api/v1/users", lambda route: route.fulfill(json={"users": USERS}))
    setup.route(
        "**/api/v1/**",
        lambda route: route.fallback() if route.request.method == "GET" else answers.append(route),
    )
    part(setup, name)
    setup.wait_for_selector(place)
    with setup.expect_request(lambda request: request.method != "GET"):
        if was is True:
            setup.uncheck(place)
        else:
            setup.select_option(place, "view")
    shown = f"(one) => {'one.checked' if was is True else 'one.value'}"
    assert setup.eval_on_selector(place, shown) != was
    answers[0].fulfill(status=409, json=refusal)
    setup.wait_for_selector("#dx-said[data-tone=warn]:has-text('It is refused.')")
    setup.wait_for_function(
        f"([place, was]) => ({shown})(document.querySelector(place)) === was", arg=[place, was]
    )


def test_where_another_holds_control_nothing_of_it_can_be_pressed(setup: Any, site: Site) -> None:
    taken = setup.context.request.post(f"{site.url}api/v1/control", data={"take_over": True})
    assert taken.ok
    setup.wait_for_selector("body[data-control=other]")
    for name in ("homing", "offsets", "tools"):
        part(setup, name)
        setup.wait_for_function(
            "(part) => [...document.querySelectorAll(part + ' :is(button:not([data-picture]), input)')]"
            ".every((one) => one.ariaDisabled === 'true' || one.disabled || one.type === 'text')",
            arg=f".part[data-part={name}]",
        )


def test_a_figure_can_be_typed_sign_by_sign_whatever_is_told_meanwhile(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    field = "#setup-offsets tr[data-row=G54] [data-field=X]"
    setup.click(field)
    setup.keyboard.press("ControlOrMeta+a")
    for sign in "0.50":
        setup.keyboard.type(sign)
        number = setup.evaluate("dx.status.tick.number")
        setup.wait_for_function("(n) => dx.status.tick.number > n + 60", arg=number)
    assert setup.input_value(field) == "0.50"
    setup.keyboard.press("Escape")


def test_a_webhook_is_saved_not_shown_again_and_its_failure_is(setup: Any, site: Site) -> None:
    part(setup, "notices")
    setup.wait_for_selector("#notices-test[aria-disabled=true]")
    setup.fill("#notices [name=webhook]", "http://127.0.0.1:9/T0Psecret")
    setup.click("#notices-save")
    setup.wait_for_selector("#notices [name=webhook][placeholder='http://127.0.0.1']")
    assert setup.input_value("#notices [name=webhook]") == ""
    setup.click("#notices-test:not([aria-disabled])")
    setup.wait_for_selector("[data-way=webhook] >> text=was not sent")
    assert "T0Psecret" not in setup.content()
    setup.click("#notices-off")
    setup.wait_for_selector("#notices-test[aria-disabled=true]")


def test_what_is_typed_of_notices_stays_until_it_is_saved_and_is_alone_sent(setup: Any, site: Site) -> None:
    part(setup, "notices")
    for name, value in (("host", "mail.shop"), ("sender", "mill@shop.de"), ("to", "a@shop.de, b@shop.de")):
        setup.fill(f"#notices [name={name}]", value)
    setup.fill("#notices [name=port]", "")
    setup.fill("#notices [name=port]", "465")
    setup.fill("#notices [name=password]", "open the gate ")
    setup.select_option("#notices [name=language]", "de")
    setup.uncheck("#notices [name=program_end]")
    number = setup.evaluate("dx.status.tick.number")
    setup.wait_for_function("(n) => dx.status.tick.number > n + 60", arg=number)
    assert setup.input_value("#notices [name=host]") == "mail.shop"
    with setup.expect_request(lambda asked: asked.method == "PATCH") as asked:
        setup.click("#notices-save")
    assert asked.value.post_data_json == {
        **{"host": "mail.shop", "sender": "mill@shop.de", "to": "a@shop.de, b@shop.de"},
        **{"port": 465, "password": "open the gate"},
        **{"language": "de", "program_end": False},
    }
    setup.wait_for_function("() => document.querySelector('#notices [name=password]').value === ''")
    kept = setup.evaluate("dx.call('GET', 'notices')")["body"]
    assert [kept[name] for name in ("host", "port", "language", "program_end")] == [
        "mail.shop",
        465,
        "de",
        False,
    ]
    setup.evaluate("dx.call('PATCH', 'notices', {host: '', port: 587, language: 'en', program_end: true})")


def test_a_tool_is_shown_as_it_looks_and_its_wear_is_typed(setup: Any, site: Site) -> None:
    part(setup, "tools")
    drawn = "() => document.querySelector('figure img.tool-picture')?.naturalWidth > 0"
    setup.wait_for_function(drawn)
    setup.fill("#setup-tools tr[data-row='1'] [data-field=wear_length_mm]", "-0,02")
    setup.click("#setup-tools tr[data-row='1'] td:last-child button")
    asked = until(
        lambda: [args for _, _, args in site.commands("set_tool") if args.get("wear_length_mm")], "wear"
    )
    assert asked[-1]["wear_length_mm"] == -0.02 and "wear_radius_mm" not in asked[-1]
    links = setup.eval_on_selector_all("[data-part=tools] a[download]", "all => all.map((a) => a.pathname)")
    assert links == ["/api/v1/tools.tbl", "/api/v1/tools.json"]


def test_a_table_of_tools_is_taken_in_and_what_is_missing_of_it_is_asked_for(setup: Any, site: Site) -> None:
    part(setup, "tools")
    table = {"name": "tool.tbl", "mimeType": "text/plain", "buffer": b"T77 P77 D6 Z50 ;mill\n"}
    setup.set_input_files("[data-part=tools] input[type=file]", files=[table])
    setup.fill(".dx-ask input", "12,5")
    browser.yes(setup)
    setup.wait_for_selector("#setup-tools tr[data-row='77']")
    (taken,) = [args for _, _, args in site.commands("set_tool") if args["number"] == 77]
    assert (taken["radius_mm"], taken["flute_mm"], taken["name"]) == (3.0, 12.5, "mill")
    bad = {**table, "buffer": b"T77 foo"}
    setup.set_input_files("[data-part=tools] input[type=file]", files=[bad])
    setup.wait_for_selector("#dx-said:has-text('no row of a tool table')")


def test_the_tool_that_a_program_waits_for_is_shown_where_it_is_awaited(page: Any, site: Site) -> None:
    asks = {"number": 1, "key": "tool_change", "values": {"number": 1, "name": " (end mill 6 mm)"}}
    site.tell(mode="HOLD", tool_change=asks)
    page.wait_for_function("() => document.querySelector('#run-wanted img')?.naturalWidth > 0")
    assert "end mill 6 mm" in page.inner_text("#run-wanted")


def test_an_offset_that_was_set_here_can_be_as_the_machine_file_says_again(setup: Any, site: Site) -> None:
    part(setup, "offsets")
    setup.evaluate("dx.call('PUT', 'offsets/G54', {origin_mm: [1, 0, 0], turned_deg: [0, 0, 0]})")
    setup.click("[data-forget=G54]")
    setup.wait_for_selector(".dx-ask >> text=G54 is to be as the machine file says again?")
    browser.yes(setup)
    assert until(lambda: site.commands("forget"), "the offset")[-1][2] == {"name": "G54"}
    setup.evaluate("dx.call('PUT', 'offsets/G54', {origin_mm: [0, 0, 0], turned_deg: [0, 0, 0]})")


def test_a_tool_in_a_thread_is_withdrawn_or_said_to_be_out(page: Any, site: Site) -> None:
    facts = {"depth": 5.0, "pitch": 1.0, "line": 4}
    site.tell(mode="READY", notices=[{"name": "IN_THREAD", "key": "in_thread", "values": facts}])
    for button, sent in (
        ("withdraw", {"mm": None, "is_out": False}),
        ("is_out", {"mm": None, "is_out": True}),
    ):
        page.click(f"#run-{button}")
        browser.yes(page)
        assert until(lambda: [a for _, _, a in site.commands("withdraw") if a == sent], "out of it")  # noqa: B023
