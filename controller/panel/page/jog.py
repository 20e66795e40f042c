"""The view for moving by hand: jog with a dead-man, steps, and lines of program typed in."""

from __future__ import annotations

from nicegui import ui

from controller.panel.page.view import Page, act, card, live, row, tagged, text
from controller.panel.page.words import Words

NAME, ICON, SCRIPT = "jog", "control_camera", "jog.js"
WORDS: Words = {
    "view.jog": ("Jog, MDI", "Tippen, MDI"),
    "jog.frame": ("Directions of", "Richtungen"),
    "jog.joint": ("Axes", "Achsen"),
    "jog.part": ("Part", "Werkstück"),
    "jog.tool": ("Tool", "Werkzeug"),
    "jog.step": ("Step", "Schritt"),
    "jog.continuous": ("continuous", "fortlaufend"),
    "jog.speed": ("Speed", "Tempo"),
    "jog.keyboard": ("Keyboard", "Tastatur"),
    "jog.keyboard_ask": (
        "With the keyboard on, arrow keys and Page Up or Down move the machine while held. Switch on?",
        "Mit Tastatur bewegen Pfeiltasten und Bild auf/ab die Maschine, solange man drückt. Einschalten?",
    ),
    "jog.title": ("Jog", "Tippen"),
    "jog.hint": (
        "Moves only while a button is held; it stops when it is let go or this page loses sight of it.",
        "Bewegt nur, solange eine Taste gehalten wird; hält beim Loslassen oder verdeckter Seite.",
    ),
    "jog.stopped": ("Jog ended", "Tippen beendet"),
    "jog.mdi": ("MDI", "MDI"),
    "jog.run": ("Run", "Ausführen"),
    "jog.mdi_ask": ("Run this now?", "Jetzt ausführen?"),
    "jog.history": ("History", "Verlauf"),
    "jog.plus": ("plus", "plus"),
    "jog.minus": ("minus", "minus"),
    "jog.position": ("Work", "Werkstück"),
}
FRAMES = ("joint", "part", "tool")
STEPS = ("0", "0.001", "0.01", "0.1", "1", "10")
MODES = "READY HOLD JOG"


def build(page: Page) -> None:
    """Make the view."""
    with ui.element("div").classes("jog"):
        _jog(page)
        _mdi(page)


def _jog(page: Page) -> None:
    with card(page, "jog.title", "jog-card"):
        with row("jog-choices"):
            _choice(page, "frame", FRAMES, page.word("jog.frame"), "joint")
            _choice(page, "step", STEPS, page.word("jog.step"), "0")
            with ui.element("label").classes("jog-speed"):
                text(page.word("jog.speed"), "span", "dim")
                speed = tagged(ui.element("input").classes("slider"), type="range", id="jog-speed")
                tagged(speed, min="1", max="100", value="20")
                tagged(text("20 %", "span", "figures"), id="jog-speed-shown")
            keyboard = act(page, "jog.keyboard", icon="keyboard", classes="toggle")
            tagged(
                keyboard, id="jog-keyboard", aria_pressed="false", data_question=page.word("jog.keyboard_ask")
            )
        with tagged(ui.element("div").classes("jog-axes"), id="jog-axes"):
            for axis in page.facts.get("axes", ()):
                _axis(page, str(axis["name"]), str(axis["unit"]), axis["kind"] == "linear")
        text(page.word("jog.hint"), "p", "dim")


def _choice(page: Page, name: str, values: tuple[str, ...], label: str, chosen: str) -> None:
    with tagged(ui.element("div").classes("choice"), role="group", aria_label=label):
        text(label, "span", "dim")
        for value in values:
            button = tagged(ui.element("button").classes("act"), type="button", data_choice=name)
            tagged(button, data_value=value, aria_pressed="true" if value == chosen else "false")
            with button:
                shown = page.word(f"jog.{value}") if name == "frame" else value
                text(page.word("jog.continuous") if (name, value) == ("step", "0") else shown, "span")


def _axis(page: Page, name: str, unit: str, linear: bool) -> None:
    with tagged(ui.element("div").classes("jog-axis"), data_linear="1" if linear else ""):
        for sign, word in (("-", "minus"), ("+", "plus")):
            button = tagged(ui.element("button").classes("jog-button"), type="button", data_jog=name)
            tagged(button, data_sign=sign, data_needs="control", data_modes=MODES)
            with tagged(button, aria_label=f"{name} {page.word(f'jog.{word}')}"):
                text(f"{name}{'−' if sign == '-' else '+'}", "span")
            if sign == "-":
                with ui.element("div").classes("jog-figure"):
                    text(name, "span", "axis-name")
                    live(f"joints.{name}.work", unit, "big")


def _mdi(page: Page) -> None:
    with card(page, "jog.mdi", "mdi-card"):
        with tagged(ui.element("form").classes("mdi"), id="mdi", autocomplete="off"):
            field = tagged(
                ui.element("textarea"), id="mdi-text", rows="2", maxlength="1000", spellcheck="false"
            )
            tagged(field, aria_label=page.word("jog.mdi"), placeholder="G0 X10.")
            run = act(page, "jog.run", kind="go", modes="READY", icon="play_arrow")
            tagged(run, id="mdi-run", data_question=page.word("jog.mdi_ask"))
        text(page.word("jog.history"), "h2")
        tagged(ui.element("div").classes("mdi-history scroll"), id="mdi-history")
