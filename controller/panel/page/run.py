"""The view while cutting: where the axes are, how fast it goes and why not faster, and the cycle."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from controller.panel.page import programs
from controller.panel.page.view import Page, act, bar, card, live, row, tagged, text
from controller.panel.page.words import Words

NAME, ICON, SCRIPT = "run", "play_circle", "run.js"
WORDS: Words = {
    "view.run": ("Run", "Fahren"),
    "run.axes": ("Axes", "Achsen"),
    "run.axis": ("Axis", "Achse"),
    "run.work": ("Work", "Werkstück"),
    "run.machine": ("Machine", "Maschine"),
    "run.to_go": ("To go", "Restweg"),
    "run.actual": ("Actual", "Ist"),
    "run.error": ("Following error µm, m°", "Schleppfehler µm, m°"),
    "run.homed": ("ref ✓", "Ref ✓"),
    "run.not_homed": ("no ref", "o. Ref"),
    "run.limit": ("end", "Ende"),
    "run.tool": ("Tool in the part", "Werkzeug im Werkstück"),
    "run.tip": ("Tip", "Spitze"),
    "run.vector": ("Axis", "Achse"),
    "run.feed": ("Feed mm/min", "Vorschub mm/min"),
    "run.programmed": ("programmed", "programmiert"),
    "run.limited": ("limited by", "begrenzt durch"),
    "run.spindle": ("spindle 1/min", "Spindel 1/min"),
    "run.coolant": ("coolant", "Kühlung"),
    "run.mist": ("mist", "Nebel"),
    "run.flood": ("flood", "Flut"),
    "run.overrides": ("Overrides", "Override"),
    "run.feed_override": ("Feed", "Vorschub"),
    "run.rapid_override": ("Rapid", "Eilgang"),
    "run.cycle": ("Cycle", "Ablauf"),
    "run.start": ("Start", "Start"),
    "run.unrecorded_ask": ("Run it without a record?", "Ohne Aufzeichnung laufen lassen?"),
    "run.start_ask": ("Start the loaded program?", "Das geladene Programm starten?"),
    "run.hold": ("Hold", "Halt"),
    "run.resume": ("Resume", "Weiter"),
    "run.stop": ("Stop", "Stopp"),
    "run.retract": ("Retract", "Abheben"),
    "run.retract_mm": ("Retract by, mm", "Abheben um, mm"),
    "run.return": ("Return", "Zurück"),
    "run.single": ("Single block", "Einzelsatz"),
    "run.optional": ("Optional stop", "Wahlhalt"),
    "run.elapsed": ("elapsed", "vergangen"),
    "run.left": ("left", "Rest"),
    "run.duration": ("in all", "gesamt"),
    "run.machine_card": ("Drives", "Antriebe"),
    "run.enable": ("On", "Ein"),
    "run.disable": ("Off", "Aus"),
    "run.home": ("Home all", "Alle referenzieren"),
    "run.home_ask": ("Home all axes? They will move.", "Alle Achsen referenzieren? Sie bewegen sich."),
    "run.program": ("Program", "Programm"),
    "run.block": ("Block", "Satz"),
    "run.line": ("Line", "Zeile"),
    "run.choose": ("Choose a program", "Programm wählen"),
    "what.cut": ("cut", "Schnitt"),
    "what.line": ("line", "Gerade"),
    "what.arc": ("arc", "Bogen"),
    "what.rapid": ("rapid", "Eilgang"),
    "what.retract": ("retract", "Rückzug"),
    "what.lift": ("lift", "Abheben"),
    "what.position": ("position", "Positionieren"),
    "what.swivel": ("swivel", "Schwenken"),
    "what.pivot": ("pivot", "Schwenken am Stoß"),
    "what.down": ("down", "Zustellen"),
    "what.plunge": ("plunge", "Eintauchen"),
    "what.lead in": ("lead in", "Einlauf"),
    "what.lead out": ("lead out", "Auslauf"),
    "what.link": ("link", "Übergang"),
    "run.reset_override": ("back to 100 %", "zurück auf 100 %"),
}
RAPIDS = (0, 25, 50, 100)
CUTTING = "RUNNING HOLD STOPPING"


def build(page: Page) -> None:
    """Make the view."""
    with ui.element("div").classes("run"):
        _axes(page)
        _feed(page)
        _cycle(page)
        _program(page)
        _tool(page)


def _axes(page: Page) -> None:
    columns = ("axis", "work", "machine", "to_go", "actual", "error")
    with card(page, "run.axes", "run-axes"):
        with ui.element("table").classes("dro"):
            with ui.element("thead"), ui.element("tr"):
                for column in columns:
                    _column(page, column)
            with ui.element("tbody"):
                for axis in page.facts.get("axes", ()):
                    _axis(page, axis)
        live("shown.warning", "plain", "warning", "p")
    if not page.facts:
        text(page.word("frame.no_machine"), "p", "dim")


def _column(page: Page, name: str) -> None:
    with tagged(text(page.word(f"run.{name}"), "th", f"c-{name}"), scope="col"):
        if name == "work":  # in which offset
            text(" ", "span")
            live("work_offset", "plain", "strong")


def _axis(page: Page, axis: dict[str, Any]) -> None:
    name, form = str(axis["name"]), str(axis["unit"])
    of = f"joints.{name}"
    with tagged(ui.element("tr"), data_axis=name):
        with tagged(ui.element("th"), scope="row"):
            text(name, "span", "axis-name")
            with ui.element("span").classes("marks"):
                tagged(ui.element("span").classes("mark-home"), data_homed=name)
                tagged(ui.element("span").classes("mark-limit"), data_limit=name)
        live(f"{of}.work", form, "big", "td")
        for column in ("machine", "to_go", "actual"):
            live(f"{of}.{column}", form, f"c-{column}", "td")
        with ui.element("td").classes("c-error"), ui.element("div").classes("error"):
            # The bar is full at the following error that ends the run.
            tagged(ui.element("div").classes("error-bar"), data_error=name)
            live(f"{of}.error", "um", "error-figure")


def _tool(page: Page) -> None:
    with card(page, "run.tool", "run-tool"):
        for word, key, letters, form in (("tip", "tip", "XYZ", "mm"), ("vector", "axis", "IJK", "unit")):
            with ui.element("div").classes("triple"):
                text(page.word(f"run.{word}"), "span", "dim")
                for letter in letters:
                    with ui.element("span").classes("pair"):
                        text(letter, "span", "dim")
                        live(f"{key}.{letter}", form)


def _feed(page: Page) -> None:
    with card(page, "run.feed", "run-feed"):
        live("feed_mm_min.actual", "feed", "huge", "div")
        with ui.element("dl").classes("facts"):
            text(page.word("run.programmed"), "dt")
            live("feed_mm_min.programmed", "feed", tag="dd")
            text(page.word("run.limited"), "dt")
            live("limited_by", "bound", "chip", "dd")
            _spindle(page)
        text(page.word("run.overrides"), "h2")
        _override(page)
        _rapid(page)


def _spindle(page: Page) -> None:
    """As it turns, and as it is to turn; nothing where the machine has none."""
    if page.facts.get("spindle"):
        text(page.word("run.spindle"), "dt")
        with ui.element("dd"):
            live("spindle.actual_rev_min", "int", "strong")
            text(" / ", "span", "dim")
            live("spindle.rev_min", "int")
    if page.facts.get("outputs"):
        text(page.word("run.coolant"), "dt")
        live("coolant", "coolant", tag="dd")


def _override(page: Page) -> None:
    with ui.element("div").classes("override"):
        text(page.word("run.feed_override"), "span", "dim")
        _step("−", -10)
        live("override", "percent", "override-figure")
        _step("+", 10)
        reset = tagged(ui.element("button").classes("act"), type="button", data_needs="control")
        with tagged(reset, data_call="PUT overrides/feed", data_body='{"share": 1.0}'):
            text("100 %", "span")
        tagged(reset, title=page.word("run.reset_override"))
        slider = ui.element("input").classes("slider")
        tagged(slider, type="range", id="run-override", min="0", max="200", step="5", data_needs="control")
        tagged(slider, aria_label=page.word("run.feed_override"))


def _step(sign: str, percent: int) -> None:
    button = tagged(ui.element("button").classes("act"), type="button", data_needs="control")
    with tagged(button, data_override=str(percent), aria_label=f"{percent:+d} %"):
        text(f"{sign}10", "span")


def _rapid(page: Page) -> None:
    with ui.element("div").classes("override"):
        text(page.word("run.rapid_override"), "span", "dim")
        for percent in RAPIDS:
            button = tagged(ui.element("button").classes("act"), type="button", data_needs="control")
            share = f'{{"share": {percent / 100}}}'
            with tagged(button, data_call="PUT overrides/rapid", data_body=share, data_rapid=str(percent)):
                text(f"{percent} %", "span")


def _cycle(page: Page) -> None:
    with card(page, "run.cycle", "run-cycle"):
        with ui.element("div").classes("cycle"):
            act(
                page,
                "run.start",
                "POST cycle/start",
                kind="go",
                ask="run.start_ask",
                modes="READY",
                icon="play_arrow",
                classes="tall",
            )
            act(
                page,
                "run.hold",
                "POST cycle/hold",
                needs="role",
                kind="hold",
                modes="RUNNING JOG",
                icon="pause",
                classes="tall",
            )
            act(
                page,
                "run.resume",
                "POST cycle/resume",
                kind="go",
                modes="HOLD",
                icon="replay",
                classes="tall",
            )
            stop = "POST cycle/stop"
            act(page, "run.stop", stop, needs="role", kind="stop", modes=CUTTING, icon="stop", classes="tall")
            _aside(page)
            for key, path in (("single", "single_block"), ("optional", "optional_stop")):
                button = act(page, f"run.{key}", classes="toggle")
                tagged(button, data_toggle=f"PUT cycle/{path}", data_on=path)
        with row("times"):
            for key in ("elapsed", "left", "duration"):
                with ui.element("div").classes("time"):
                    text(page.word(f"run.{key}"), "span", "dim")
                    live(f"job.{key}_s", "time", "strong")
        text(page.word("run.machine_card"), "h2")
        with row("drives-row"):
            act(page, "run.enable", "POST machine/enable", modes="OFF", icon="power")
            act(page, "run.disable", "POST machine/disable", modes="READY", icon="power_off")
            act(page, "run.home", "POST machine/home", {}, ask="run.home_ask", modes="OFF READY", icon="home")


def _aside(page: Page) -> None:
    """Off along the tool axis by what is given, preset to what is possible here; and back to the path."""
    with ui.element("div").classes("aside"):
        field = tagged(ui.element("input"), type="number", id="run-retract-mm", min="0.001", step="any")
        tagged(field, aria_label=page.word("run.retract_mm"), title=page.word("run.retract_mm"))
        tagged(field, data_needs="control", data_if="retract_room_mm")
        off = act(page, "run.retract", "POST cycle/retract", modes="HOLD READY", icon="north_west")
        tagged(off, id="run-retract", data_if="retract_room_mm")
        back = act(page, "run.return", "POST cycle/return", modes="HOLD", icon="south_east")
        tagged(back, data_if="aside")


def _program(page: Page) -> None:
    with card(page, "", "run-program"):
        with row("program-head"):
            text(page.word("run.program"), "h2")
            text(page.word("run.line"), "span", "dim")
            live("job.line", "text", "strong")
            text(page.word("run.block"), "span", "dim")
            live("job.block", "text", "strong")
            live("in_block.what", "what", "dim")
            live("in_block.fraction", "percent", "strong")
            with ui.element("span").classes("u"):
                text("u ", "span", "dim")
                live("in_block.u", "u", "strong")
        tagged(live("job.message", "text", "strong"), data_if="job.message")
        tagged(bar("in_block.fraction", "block-bar"), title=page.word("run.block"))
        programs.restart(page)
        tagged(ui.element("pre").classes("listing"), id="run-listing", tabindex="0")
        with tagged(ui.element("div").classes("empty"), id="run-empty"):
            text(page.word("frame.no_program"), "p", "dim")
            tagged(act(page, "run.choose", needs="", icon="description"), data_to="programs")
            programs.offer()
