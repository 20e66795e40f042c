"""The view of what is set up: homing, work offsets, tools, the machine file, the drives' commissioning."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from nicegui import ui

from controller.panel.page.view import Page, act, card, live, row, tagged, text
from controller.panel.page.words import Words

NAME, ICON, SCRIPT, STYLE = "setup", "tune", "setup.js", "looks.css"
WORDS: Words = {
    "view.setup": ("Set-up", "Einrichten"),
    "setup.homing": ("Homing", "Referenzfahrt"),
    "setup.offsets": ("Work offsets", "Nullpunkte"),
    "setup.tools": ("Tools", "Werkzeuge"),
    "setup.file": ("Machine file", "Maschinendatei"),
    "setup.drives": ("Commissioning", "Inbetriebnahme"),
    "setup.axis": ("Axis", "Achse"),
    "setup.state": ("State", "Zustand"),
    "setup.home_at": ("Homed at", "Referenz bei"),
    "setup.travel": ("Travel", "Verfahrweg"),
    "setup.limit": ("at limit", "am Ende"),
    "setup.homed": ("homed", "referenziert"),
    "setup.not_homed": ("not homed", "nicht referenziert"),
    "setup.home": ("Home", "Referenzieren"),
    "setup.home_all": ("Home all", "Alle referenzieren"),
    "setup.home_ask": ("Home {0}? It will move.", "{0} referenzieren? Die Achse bewegt sich."),
    "setup.home_all_ask": ("Home all axes? They will move.", "Alle Achsen referenzieren? Sie bewegen sich."),
    "setup.tip": ("Tip on the table", "Spitze über dem Tisch"),
    "setup.touch_by": ("Touch off with", "Antasten mit"),
    "setup.offset": ("Offset", "Nullpunkt"),
    "setup.unset": ("not set", "nicht gesetzt"),
    "setup.turned": ("turned about", "gedreht um"),
    "setup.save": ("Save", "Speichern"),
    "setup.saved": ("{0} is saved.", "{0} ist gespeichert."),
    "setup.set": ("Set", "Setzen"),
    "setup.touch": ("{0} from position", "{0} aus Position"),
    "setup.touch_ask": (
        "{0}: what is {1} to read here with T{2} (mm)?",
        "{0}: Was soll {1} hier mit T{2} zeigen (mm)?",
    ),
    "setup.touch_other": ("T{0} is in the spindle.", "In der Spindel ist T{0}."),
    "setup.tool_number": (
        "A whole number from 1 to 99999 is needed.",
        "Eine ganze Zahl von 1 bis 99999 ist nötig.",
    ),
    "setup.tool_there": (
        "T{0} is in the table already; change it in its row.",
        "T{0} steht schon in der Tabelle; dort ändern.",
    ),
    "setup.number": ("A number is needed.", "Eine Zahl ist nötig."),
    "setup.tool": ("Tool", "Werkzeug"),
    "setup.name": ("Name", "Name"),
    "setup.radius_mm": ("Radius mm", "Radius mm"),
    "setup.length_mm": ("Length mm", "Länge mm"),
    "setup.flute_mm": ("Flute mm", "Schneide mm"),
    "setup.corner_mm": ("Corner mm", "Ecke mm"),
    "setup.taper_deg": ("Taper °", "Konus °"),
    "setup.delete": ("Delete", "Löschen"),
    "setup.delete_ask": ("Delete {0}?", "{0} löschen?"),
    "setup.add": ("Add a tool", "Werkzeug hinzufügen"),
    "setup.add_ask": ("Number of the new tool?", "Nummer des neuen Werkzeugs?"),
    "setup.line": ("Line", "Zeile"),
    "setup.key": ("Key", "Schlüssel"),
    "setup.value": ("Value", "Wert"),
    "setup.comment": ("Comment", "Bemerkung"),
    "setup.filter": ("Search", "Suchen"),
    "setup.read_only": (
        "The file is changed in an editor, and read when the controller starts.",
        "Die Datei wird im Editor geändert und beim Start der Steuerung gelesen.",
    ),
    "setup.node": ("Bus · node", "Bus · Knoten"),
    "setup.heard": ("heard", "gehört"),
    "setup.silent": ("silent", "stumm"),
    "setup.heartbeat": ("Heartbeat", "Heartbeat"),
    "setup.profile": ("Profile", "Profil"),
    "setup.homing_how": ("Homing", "Referenzfahrt"),
    "setup.supervision": ("Supervision", "Überwachung"),
    "setup.method": ("method {0}", "Methode {0}"),
    "setup.absolute": ("absolute encoder", "Absolutgeber"),
    "setup.supervision.heartbeat": ("heartbeat", "Heartbeat"),
    "setup.supervision.guarding": ("node guarding", "Node Guarding"),
    "setup.supervision.none": ("none", "keine"),
    "setup.commissioned": ("commissioned", "in Betrieb genommen"),
    "setup.not_commissioned": ("not commissioned", "nicht in Betrieb genommen"),
    "setup.how": (
        "Every start of the controller commissions the drives; a reset after a fault does it again.",
        "Jeder Start der Steuerung nimmt die Antriebe in Betrieb; ein Quittieren nach Störung wiederholt es.",
    ),
}
PARTS = ("homing", "offsets", "tools", "file", "drives")
NARROW = "hide-narrow"


def build(page: Page) -> None:
    """Make the view."""
    with ui.element("div").classes("looks setup"):
        with ui.element("div").classes("pages"):
            for part in PARTS:
                button = tagged(ui.element("button").classes("act"), type="button", data_setup=part)
                with tagged(button, aria_pressed="false"):
                    text(page.word(f"setup.{part}"), "span")
        tagged(ui.element("p").classes("wrong"), id="setup-said")
        _homing(page)
        _offsets(page)
        _tools(page)
        _file(page)
        _drives(page)
    ui.run_javascript("dx.tell('built', 'setup')")


@contextmanager
def _part(page: Page, name: str) -> Iterator[None]:
    with tagged(ui.element("div").classes("part"), data_part=name), card(page, f"setup.{name}") as made:
        tagged(made, tabindex="0")  # it scrolls where a table is too wide
        yield


def _table(page: Page, body: str, heads: tuple[tuple[str, str], ...], classes: str = "") -> None:
    """A table whose rows the script writes; ``heads``: key and classes."""
    with ui.element("table").classes(f"list {classes}"):
        with ui.element("thead"), ui.element("tr"):
            for key, name in heads:
                tagged(
                    text(page.word(f"setup.{key}") if key else "", "th" if key else "td", name), scope="col"
                )
        ui.element("tbody").props["id"] = body


def _homing(page: Page) -> None:
    with _part(page, "homing"):
        heads = (
            ("axis", ""),
            ("state", ""),
            ("home_at", f"figures {NARROW}"),
            ("travel", f"figures {NARROW}"),
        )
        _table(page, "setup-homing", (*heads, ("", "")))
        with row():
            act(
                page,
                "setup.home_all",
                "POST machine/home",
                {},
                ask="setup.home_all_ask",
                modes="OFF READY",
                icon="home",
            )


def _offsets(page: Page) -> None:
    with _part(page, "offsets"):
        with row():
            text(page.word("setup.tip"), "span", "dim")
            tagged(ui.element("span").classes("figures strong"), id="setup-tip")
            with ui.element("label").classes("row dim"):
                text(page.word("setup.touch_by"), "span")
                tagged(ui.element("select"), id="setup-tool")
        with ui.element("table").classes("list"):
            with ui.element("thead"), ui.element("tr"):
                text(page.word("setup.offset"), "th")
                for axis in "XYZ":
                    text(f"{axis} mm", "th")
                for axis in "XYZ":
                    text(f"{page.word('setup.turned')} {axis} °", "th", NARROW)
                text("", "td")
            ui.element("tbody").props["id"] = "setup-offsets"


def _tools(page: Page) -> None:
    with _part(page, "tools"):
        heads = (
            ("tool", ""),
            ("name", ""),
            ("radius_mm", ""),
            ("length_mm", ""),
            ("flute_mm", ""),
            ("corner_mm", ""),
            ("taper_deg", ""),
            ("", ""),
        )
        _table(page, "setup-tools", heads)
        with row():
            button = tagged(ui.element("button").classes("act"), id="setup-add", type="button")
            with tagged(button, data_needs="control"):
                text(page.word("setup.add"), "span")


def _file(page: Page) -> None:
    with _part(page, "file"):
        with row("spread"):
            tagged(ui.element("span").classes("strong"), id="setup-file-name")
            label = page.word("setup.filter")
            search = tagged(ui.element("input").classes("wide"), id="setup-filter", type="search")
            tagged(search, placeholder=label, aria_label=label)
        text(page.word("setup.read_only"), "p", "dim")
        heads = (("line", "figures"), ("key", ""), ("value", ""), ("comment", NARROW))
        _table(page, "setup-file", heads, "file-table")


def _drives(page: Page) -> None:
    with _part(page, "drives"):
        with row():
            ui.element("span").props["id"] = "setup-commissioned"
            live("mode", "word:mode", "chip")
        text(page.word("setup.how"), "p", "dim")
        heads = (("axis", ""), ("node", "figures"), ("heartbeat", ""), ("state", ""))
        more = (("profile", NARROW), ("homing_how", NARROW), ("supervision", NARROW))
        _table(page, "setup-drives", (*heads, *more))
