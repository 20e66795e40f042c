"""English and German: every text of the page has a key, and both languages side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

Language = Literal["en", "de"]
Words = Mapping[str, tuple[str, str]]
LANGUAGES: tuple[Language, ...] = ("en", "de")

FRAME: Words = {
    "frame.yes": ("Yes", "Ja"),
    "frame.no": ("No", "Nein"),
    "frame.stop": ("STOP", "STOPP"),
    "frame.stop_title": (
        "Slow down to rest on the path and end the program (F9)",
        "Auf der Bahn bis zum Stillstand bremsen und das Programm beenden (F9)",
    ),
    "frame.estop": ("E-STOP", "NOT-HALT"),
    "frame.estop_title": (
        "All drives stop by their own ramp. A software stop is no safety function.",
        "Alle Antriebe halten mit eigener Rampe. Ein Halt per Software ist keine Sicherheitsfunktion.",
    ),
    "frame.control": ("Control", "Steuerrecht"),
    "frame.mine": ("this page", "diese Seite"),
    "frame.free": ("free", "frei"),
    "frame.take": ("Take", "Nehmen"),
    "frame.give": ("Give", "Abgeben"),
    "frame.take_over": ("{0} holds control. Take it over?", "{0} hat das Steuerrecht. Übernehmen?"),
    "frame.no_program": ("no program loaded", "kein Programm geladen"),
    "frame.left": ("left", "Rest"),
    "frame.stale": ("Figures are old", "Werte sind alt"),
    "frame.no_panel": ("No connection to the panel", "Keine Verbindung zum Panel"),
    "frame.no_service": ("The controller does not answer", "Die Steuerung antwortet nicht"),
    "frame.no_tick": ("The machine's clock stands still", "Der Takt der Maschine steht still"),
    "frame.since": ("for", "seit"),
    "frame.theme": ("Dark or light", "Dunkel oder hell"),
    "frame.language": ("Deutsch", "English"),
    "frame.views": ("Views", "Ansichten"),
    "frame.reset": ("Reset", "Quittieren"),
    "frame.trusted": ("Position trusted", "Position gültig"),
    "frame.not_trusted": ("Position not trusted: home first", "Position ungültig: erst referenzieren"),
    "frame.log_out": ("Log out", "Abmelden"),
    "frame.no_machine": (
        "No controller answers; this view appears as soon as one does.",
        "Keine Steuerung antwortet; die Ansicht erscheint, sobald es eine tut.",
    ),
    "mode.OFF": ("Off", "Aus"),
    "mode.READY": ("Ready", "Bereit"),
    "mode.RUNNING": ("Running", "Läuft"),
    "mode.HOLD": ("Hold", "Halt"),
    "mode.STOPPING": ("Stopping", "Stoppt"),
    "mode.FAULT": ("Fault", "Störung"),
    "mode.HOMING": ("Homing", "Referenz"),
    "mode.JOG": ("Jog", "Tippen"),
    "waits.spindle": ("Waits for the spindle", "Wartet auf die Spindel"),
    "waits.others": ("Waits for coolant or clamps", "Wartet auf Kühlung oder Klemmung"),
    "state.loading": ("being checked", "wird geprüft"),
    "state.loaded": ("loaded", "geladen"),
    "state.starting": ("starting", "startet"),
    "state.running": ("running", "läuft"),
    "state.held": ("held", "angehalten"),
    "state.stopping": ("stopping", "stoppt"),
    "state.completed": ("completed", "fertig"),
    "state.stopped": ("stopped", "gestoppt"),
    "state.refused": ("refused", "abgelehnt"),
    "state.fault": ("fault", "Störung"),
    "sequence.enable": ("Switching on", "Einschalten"),
    "sequence.home": ("Homing", "Referenzfahrt"),
    "sequence.reset": ("Resetting", "Quittieren"),
    "sequence.load": ("Loading", "Laden"),
    "sequence.start": ("Starting", "Starten"),
    "sequence.mdi": ("MDI", "MDI"),
    "sequence.retract": ("Retracting", "Zurückziehen"),
    "sequence.return": ("Returning", "Zurückkehren"),
    "bound.nothing": ("nothing", "nichts"),
    "bound.feed": ("programmed feed", "programmierter Vorschub"),
    "bound.corner": ("corner", "Ecke"),
    "bound.tip acceleration": ("tip acceleration", "Beschleunigung der Spitze"),
    "bound.angular speed of the tool axis": ("tool axis speed", "Drehung der Werkzeugachse"),
    "bound.velocity": ("velocity", "Geschwindigkeit"),
    "bound.acceleration": ("acceleration", "Beschleunigung"),
    "bound.jerk": ("jerk", "Ruck"),
    "login.title": ("Log in", "Anmelden"),
    "login.name": ("Name", "Name"),
    "login.password": ("Password", "Passwort"),
}


def spoken(tables: Iterable[Words], language: Language) -> dict[str, str]:
    """All words in one language. Raises ValueError for a key that two tables have."""
    found: dict[str, str] = {}
    place = LANGUAGES.index(language)
    for table in tables:
        if twice := found.keys() & table.keys():
            raise ValueError(f"{sorted(twice)[0]}: stands in two tables of words; rename one.")
        found.update({key: texts[place] for key, texts in table.items()})
    return found


def chosen(cookie: str, accepted: str) -> Language:
    """The language of a page: what was chosen before, else what the browser prefers."""
    for wanted in (cookie, *(part.split(";")[0].strip()[:2].lower() for part in accepted.split(","))):
        for language in LANGUAGES:
            if wanted == language:
                return language
    return "en"
