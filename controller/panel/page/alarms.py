"""The view of what went wrong: now, and before, with cause, remedy and recording."""

from __future__ import annotations

from nicegui import ui

from controller import catalogue
from controller.faults import Fault
from controller.panel.page.view import Page, card, row, tagged, text
from controller.panel.page.words import Words

NAME, ICON, SCRIPT, STYLE = "alarms", "notification_important", "alarms.js", "looks.css"


def _catalogue() -> Words:
    """Cause and remedy of every fault, as the catalogue has them: an alarm keeps the English ones."""
    english, german = catalogue.of("en").faults, catalogue.of("de").faults
    found: dict[str, tuple[str, str]] = {}
    for fault in Fault:
        if fault in english:
            found[f"alarms.cause.{fault.name}"] = (english[fault].cause, german[fault].cause)
            found[f"alarms.remedy.{fault.name}"] = (english[fault].remedy, german[fault].remedy)
    return found


WORDS: Words = {
    "view.alarms": ("Alarms", "Meldungen"),
    "alarms.now": ("Now", "Jetzt"),
    "alarms.quiet": ("Nothing is wrong.", "Es liegt nichts an."),
    "alarms.history": ("History", "Verlauf"),
    "alarms.none": ("No alarms.", "Keine Meldungen."),
    "alarms.only_open": ("Only those not acknowledged", "Nur nicht quittierte"),
    "alarms.more": ("Older", "Ältere"),
    "alarms.cause": ("Cause", "Ursache"),
    "alarms.remedy": ("Remedy", "Abhilfe"),
    "alarms.line": ("Line", "Zeile"),
    "alarms.recording": ("Recording", "Aufzeichnung"),
    "alarms.scope": ("Open in scope", "Im Oszilloskop"),
    "alarms.trusted": ("position trusted", "Position gültig"),
    "alarms.not_trusted": ("position not trusted", "Position ungültig"),
    "alarms.acknowledge": ("Acknowledge", "Quittieren"),
    **_catalogue(),
}


def build(page: Page) -> None:
    """Make the view."""
    with ui.element("div").classes("looks alarms"):
        with card(page, "alarms.now", "alarms-present"):
            ui.element("div").props["id"] = "alarms-now"
        with card(page, "", "alarms-history"):
            with row("spread"):
                text(page.word("alarms.history"), "h2")
                only = tagged(ui.element("button").classes("act"), id="alarms-open", type="button")
                with tagged(only, aria_pressed="false"):
                    text(page.word("alarms.only_open"), "span")
            tagged(ui.element("p").classes("wrong"), id="alarms-said")
            ui.element("div").props["id"] = "alarms-list"
            more = tagged(ui.element("button").classes("act"), id="alarms-more", type="button", hidden="")
            with more:
                text(page.word("alarms.more"), "span")
    ui.run_javascript("dx.tell('built', 'alarms')")
