"""The view of what was run: history, sums, and each run's record."""

from __future__ import annotations

from nicegui import ui

from controller.panel.page.view import Page, card, tagged, text
from controller.panel.page.words import Words

NAME, ICON, SCRIPT, STYLE = "runs", "history", "runs.js", "looks.css"
WORDS: Words = {
    "view.runs": ("Runs", "Läufe"),
    "runs.sums": ("All runs", "Alle Läufe"),
    "runs.all": ("runs", "Läufe"),
    "runs.completed": ("completed", "fertig"),
    "runs.stopped": ("stopped", "gestoppt"),
    "runs.failed": ("with faults", "mit Störung"),
    "runs.cut": ("in the cut", "im Schnitt"),
    "runs.time": ("in motion", "in Fahrt"),
    "runs.none": ("Nothing was run yet.", "Noch ist nichts gelaufen."),
    "runs.program": ("Program", "Programm"),
    "runs.result": ("Result", "Ergebnis"),
    "runs.began": ("Began", "Beginn"),
    "runs.ended": ("Ended", "Ende"),
    "runs.took": ("Took", "Dauer"),
    "runs.planned": ("Planned", "Geplant"),
    "runs.error": ("Largest following error", "Größter Schleppfehler"),
    "runs.ticks": ("Ticks", "Takte"),
    "runs.skips": ("Skipped ticks", "Ausgelassene Takte"),
    "runs.from_line": ("From line", "Ab Zeile"),
    "runs.sha": ("SHA-256", "SHA-256"),
    "runs.scope": ("Open in scope", "Im Oszilloskop"),
    "runs.report": ("Report", "Bericht"),
    "runs.more": ("Older", "Ältere"),
    "runs.select": ("Choose a run to see its record.", "Einen Lauf wählen, um seine Aufzeichnung zu sehen."),
}
SUMS = ("all", "completed", "stopped", "failed", "cut", "time")
COLUMNS = (
    ("program", ""),
    ("result", ""),
    ("began", "figures"),
    ("took", "figures"),
    ("cut", "figures r-cut"),
    ("error", "figures r-error"),
)


def build(page: Page) -> None:
    """Make the view."""
    with ui.element("div").classes("looks runs"):
        with card(page, "runs.sums", "runs-sums"), ui.element("div").classes("sums"):
            for key in SUMS:
                with ui.element("div").classes("sum"):
                    tagged(ui.element("span").classes("figures big"), id=f"runs-{key}")
                    text(page.word(f"runs.{key}"), "span", "dim")
        with card(page, "", "runs-history") as made:
            tagged(made, tabindex="0")  # it scrolls where the table is too wide
            tagged(ui.element("p").classes("wrong"), id="runs-said")
            with ui.element("table").classes("list"):
                with ui.element("thead"), ui.element("tr"):
                    for key, classes in COLUMNS:
                        tagged(text(page.word(f"runs.{key}"), "th", classes), scope="col")
                ui.element("tbody").props["id"] = "runs-list"
            tagged(text(page.word("runs.none"), "p", "dim"), id="runs-empty")
            with tagged(ui.element("button").classes("act"), id="runs-more", type="button", hidden=""):
                text(page.word("runs.more"), "span")
        with card(page, "", "runs-record"):
            ui.element("div").classes("stack").props["id"] = "runs-detail"
            text(page.word("runs.select"), "p", "dim runs-select")
    ui.run_javascript("dx.tell('built', 'runs')")
