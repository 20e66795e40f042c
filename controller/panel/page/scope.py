"""The view of single ticks: any signal, with trigger, cursors and files; also of what was recorded."""

from __future__ import annotations

from nicegui import ui

from controller.panel.page.view import Page, card, row, tagged, text
from controller.panel.page.words import Words

NAME, ICON, SCRIPT, STYLE = "scope", "show_chart", "scope.js", "looks.css"
WORDS: Words = {
    "view.scope": ("Scope", "Oszilloskop"),
    "scope.source": ("Source", "Quelle"),
    "scope.now": ("Machine, now", "Maschine, jetzt"),
    "scope.recordings": ("Recordings of faults", "Aufzeichnungen von Störungen"),
    "scope.runs": ("Runs", "Läufe"),
    "scope.run": ("Run", "Laufend"),
    "scope.single": ("Single", "Einzeln"),
    "scope.running": ("running", "läuft"),
    "scope.standing": ("standing", "steht"),
    "scope.waiting": ("waiting for the trigger", "wartet auf den Auslöser"),
    "scope.filling": ("triggered", "ausgelöst"),
    "scope.seconds": ("Width", "Breite"),
    "scope.signals": ("Signals", "Signale"),
    "scope.add": ("Add a signal", "Signal hinzufügen"),
    "scope.remove": ("Remove", "Entfernen"),
    "scope.trigger": ("Trigger", "Auslöser"),
    "scope.trigger_signal": ("Signal", "Signal"),
    "scope.edge": ("Edge", "Flanke"),
    "scope.rising": ("rising", "steigend"),
    "scope.falling": ("falling", "fallend"),
    "scope.either": ("either", "beide"),
    "scope.change": ("any change", "jede Änderung"),
    "scope.level": ("Level", "Pegel"),
    "scope.before": ("Before the trigger %", "Vor dem Auslöser %"),
    "scope.freeze": ("Stand still at a fault", "Bei Störung anhalten"),
    "scope.export": ("Files", "Dateien"),
    "scope.tick": ("tick", "Takt"),
    "scope.cursor_hint": (
        "Two presses on the screen set two cursors; by keys: 1 2, ← →, Shift, Esc.",
        "Zwei Klicks setzen zwei Marken; mit Tasten: 1 2, ← →, Umschalt, Esc.",
    ),
    "scope.screen": ("Traces", "Verläufe"),
    "scope.zoom_in": ("Closer", "Näher"),
    "scope.zoom_out": ("Wider", "Weiter"),
    "scope.left": ("Earlier", "Früher"),
    "scope.right": ("Later", "Später"),
    "scope.none": ("No cursors", "Ohne Marken"),
    "scope.signal.command": ("commanded", "Soll"),
    "scope.signal.actual": ("actual", "Ist"),
    "scope.signal.error": ("following error", "Schleppfehler"),
    "scope.signal.setpoint": ("setpoint", "Sollwert"),
    "scope.signal.velocity": ("velocity", "Geschwindigkeit"),
    "scope.signal.acceleration": ("acceleration", "Beschleunigung"),
    "scope.signal.jerk": ("jerk", "Ruck"),
    "scope.signal.feed": ("Feed", "Vorschub"),
    "scope.signal.lateness": ("Lateness", "Verspätung"),
    "scope.signal.override": ("Override", "Override"),
    "scope.signal.rapid_override": ("Rapid override", "Eilgang-Override"),
    "scope.signal.path_clock": ("Path clock", "Bahnuhr"),
    "scope.signal.path_time": ("Path time", "Bahnzeit"),
    "scope.signal.s": ("Length in the motion", "Länge in der Bewegung"),
    "scope.signal.line": ("Line", "Zeile"),
    "scope.signal.mode": ("Mode", "Zustand"),
    "scope.signal.fault": ("Fault", "Störung"),
    "scope.signal.cutting": ("Cutting", "Schnitt"),
    "scope.signal.limited_by": ("Limited by", "Begrenzt durch"),
    "scope.signal.bus_load": ("Bus load", "Buslast"),
    "scope.signal.sync_sent": ("SYNC sent", "SYNC gesendet"),
}
WIDTHS_S = (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20)
EDGES = ("rising", "falling", "either", "change")


def build(page: Page) -> None:
    """Make the view."""
    with ui.element("div").classes("looks scope"):
        with card(page, "", "scope-screen"):
            _bar(page)
            with ui.element("div").classes("scope-canvas"):
                screen = tagged(ui.element("canvas"), id="scope-canvas", role="application", tabindex="0")
                tagged(screen, aria_label=page.word("scope.screen"), aria_describedby="scope-cursors")
            with row("spread"):
                tagged(ui.element("span").classes("figures"), id="scope-cursors")
                tagged(ui.element("span").classes("wrong"), id="scope-said")
        with card(page, "scope.signals", "scope-side"):
            ui.element("div").classes("stack").props["id"] = "scope-signals"
            with ui.element("label"):
                text(page.word("scope.add"), "span")
                with tagged(ui.element("select"), id="scope-add"):
                    tagged(ui.element("option"), value="")
            _trigger(page)
            text(page.word("scope.export"), "h2")
            with row():
                for kind in ("csv", "npz"):
                    with tagged(ui.element("a").classes("act"), id=f"scope-{kind}", href="#", download=""):
                        text(kind.upper(), "span")
    ui.run_javascript("dx.tell('built', 'scope')")


def _bar(page: Page) -> None:
    with row("scope-bar"):
        for key, icon in (("run", "play_arrow"), ("single", "looks_one")):
            button = tagged(ui.element("button").classes("act"), id=f"scope-{key}", type="button")
            with tagged(button, aria_pressed="false"):
                tagged(ui.icon(icon), aria_hidden="true")
                text(page.word(f"scope.{key}"), "span")
        tagged(ui.element("span").classes("chip"), id="scope-state", role="status")
        with tagged(ui.element("select"), id="scope-source", aria_label=page.word("scope.source")):
            tagged(text(page.word("scope.now"), "option"), value="now")
        with tagged(ui.element("select"), id="scope-seconds", aria_label=page.word("scope.seconds")):
            for seconds in WIDTHS_S:
                tagged(text(f"{seconds:g} s", "option"), value=f"{seconds:g}")
        for key, name, icon in (
            ("left", "left", "chevron_left"),
            ("right", "right", "chevron_right"),
            ("in", "zoom_in", "zoom_in"),
            ("out", "zoom_out", "zoom_out"),
            ("none", "none", "flag"),
        ):
            button = tagged(ui.element("button").classes("act"), id=f"scope-{key}", type="button")
            label = page.word(f"scope.{name}")
            with tagged(button, title=label, aria_label=label):
                tagged(ui.icon(icon), aria_hidden="true")


def _trigger(page: Page) -> None:
    text(page.word("scope.trigger"), "h2")
    with ui.element("label"):
        text(page.word("scope.trigger_signal"), "span")
        tagged(ui.element("select"), id="scope-trigger-signal")
    with ui.element("div").classes("grid2"):
        with ui.element("label"):
            text(page.word("scope.edge"), "span")
            with tagged(ui.element("select"), id="scope-edge"):
                for edge in EDGES:
                    tagged(text(page.word(f"scope.{edge}"), "option"), value=edge)
        for key, start in (("level", "0"), ("before", "20")):
            with ui.element("label"):
                text(page.word(f"scope.{key}"), "span")
                tagged(ui.element("input"), id=f"scope-{key}", type="number", value=start, step="any")
    with ui.element("label").classes("row"):
        tagged(ui.element("input"), id="scope-freeze", type="checkbox", checked="")
        text(page.word("scope.freeze"), "span")
