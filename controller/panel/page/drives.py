"""The view of the drives and their buses: states, words, errors, heartbeats, room in a tick."""

from __future__ import annotations

from nicegui import ui

from controller.panel.page.view import Page, card, live, tagged, text
from controller.panel.page.words import Words

NAME, ICON, SCRIPT, STYLE = "drives", "precision_manufacturing", "drives.js", "looks.css"
WORDS: Words = {
    "view.drives": ("Drives", "Antriebe"),
    "drives.axis": ("Axis", "Achse"),
    "drives.node": ("Bus · node", "Bus · Knoten"),
    "drives.state": ("State", "Zustand"),
    "drives.mode": ("Mode", "Betriebsart"),
    "drives.target": ("Target", "Soll"),
    "drives.actual": ("Actual", "Ist"),
    "drives.error": ("Following error µm, m°", "Schleppfehler µm, m°"),
    "drives.warmth": ("Temperature", "Temperatur"),
    "drives.age": ("Heartbeat", "Heartbeat"),
    "drives.said": ("Emergency", "Meldung"),
    "drives.bits": ("Statusword", "Statuswort"),
    "drives.nothing": ("none", "keine"),
    "drives.cyclic.CSP": ("cyclic position", "zyklische Position"),
    "drives.cyclic.IP": ("interpolated position", "interpolierte Position"),
    "drives.homing": ("homing", "Referenzfahrt"),
    "drives.buses": ("Buses", "Busse"),
    "drives.budget": ("Budget, fullest tick", "Budget, vollster Takt"),
    "drives.fullest": ("Heard, fullest tick", "Gehört, vollster Takt"),
    "drives.measured": ("Heard, mean", "Gehört, Mittel"),
    "drives.frames": ("frames/s", "Telegramme/s"),
    "drives.error_frames": ("error frames", "Fehlertelegramme"),
    "drives.untimed": ("no bit timing", "ohne Bitzeiten"),
    "drives.late": ("Late ticks", "Späte Takte"),
    "drives.late_of": ("of the last {0} s", "der letzten {0} s"),
    "drives.tick": ("Tick", "Takt"),
    "drives.period": ("Period ms", "Periode ms"),
    "drives.late_max": ("Latest ms", "Spätester ms"),
    "drives.skips": ("Skipped", "Ausgelassen"),
    "drives.state.UNKNOWN": ("not heard", "nicht gehört"),
    "drives.state.NOT_READY_TO_SWITCH_ON": ("not ready", "nicht bereit"),
    "drives.state.SWITCH_ON_DISABLED": ("switch-on disabled", "Einschaltsperre"),
    "drives.state.READY_TO_SWITCH_ON": ("ready to switch on", "einschaltbereit"),
    "drives.state.SWITCHED_ON": ("switched on", "eingeschaltet"),
    "drives.state.OPERATION_ENABLED": ("operation enabled", "Betrieb frei"),
    "drives.state.QUICK_STOP_ACTIVE": ("quick stop", "Schnellhalt"),
    "drives.state.FAULT_REACTION_ACTIVE": ("fault reaction", "Fehlerreaktion"),
    "drives.state.FAULT": ("fault", "Störung"),
    "drives.bit.ready": ("ready to switch on", "einschaltbereit"),
    "drives.bit.on": ("switched on", "eingeschaltet"),
    "drives.bit.enabled": ("operation enabled", "Betrieb frei"),
    "drives.bit.fault": ("fault", "Störung"),
    "drives.bit.voltage": ("voltage", "Spannung"),
    "drives.bit.no_quick_stop": ("no quick stop", "kein Schnellhalt"),
    "drives.bit.disabled": ("switch-on disabled", "Einschaltsperre"),
    "drives.bit.warning": ("warning", "Warnung"),
    "drives.bit.remote": ("remote", "Fernbetrieb"),
    "drives.bit.reached": ("target reached", "Ziel erreicht"),
    "drives.bit.limit": ("internal limit", "interne Grenze"),
    "drives.bit.follows": ("follows target", "folgt dem Soll"),
    "drives.bit.following_error": ("following error", "Schleppfehler"),
    "drives.bit.8": ("bit 8", "Bit 8"),
    "drives.bit.14": ("bit 14", "Bit 14"),
    "drives.bit.15": ("bit 15", "Bit 15"),
}
COLUMNS = (
    *(("axis", ""), ("node", "d-node"), ("state", ""), ("mode", "d-mode"), ("target", "figures d-target")),
    *(
        ("actual", "figures"),
        ("error", "figures"),
        ("warmth", "figures d-warmth"),
        ("age", "figures d-age"),
        ("said", ""),
        ("bits", "d-bits"),
    ),
)
TICK = (
    ("period", "tick.period_ms", "ms"),
    ("late_max", "tick.late_max_ms", "ms"),
    ("skips", "tick.skips", "int"),
)


def build(page: Page) -> None:
    """Make the view."""
    with ui.element("div").classes("looks drives"):
        with card(page, "view.drives", "drives-all") as made, ui.element("table").classes("list"):
            tagged(made, tabindex="0")  # it scrolls where the table is too wide
            with ui.element("thead"), ui.element("tr"):
                for key, classes in COLUMNS:
                    tagged(text(page.word(f"drives.{key}"), "th", classes), scope="col")
            ui.element("tbody").props["id"] = "drives-list"
        with card(page, "drives.buses", "drives-bus"):
            tagged(ui.element("p").classes("wrong"), id="drives-said")
            ui.element("div").classes("stack").props["id"] = "drives-buses"
        with card(page, "drives.late", "drives-lateness"):
            tagged(ui.element("p").classes("dim"), id="drives-late-of")
            ui.element("div").classes("meters").props["id"] = "drives-late"
        with card(page, "drives.tick", "drives-tick"), ui.element("dl").classes("facts"):
            for key, path, form in TICK:
                text(page.word(f"drives.{key}"), "dt")
                live(path, form, tag="dd")
    ui.run_javascript("dx.tell('built', 'drives')")
