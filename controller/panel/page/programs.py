"""The view of the store: programs come in by drag and drop, are checked, and are loaded from here."""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import asdict
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from controller.panel.answers import Refusal
from controller.panel.page import cut_maps
from controller.panel.page.figures import around, clock, overcut, percent, size
from controller.panel.page.view import Page, act, card, row, tagged, text
from controller.panel.page.words import Words
from controller.panel.programs import Program

NAME, ICON, SCRIPT = "programs", "description", "programs.js"
WORDS: Words = {
    "view.programs": ("Programs", "Programme"),
    "programs.drop": ("Drop programs here, or", "Programme hierher ziehen oder"),
    "programs.choose": ("choose files", "Dateien wählen"),
    "programs.uploading": ("uploading", "wird übertragen"),
    "programs.replace": ("Replace", "Ersetzen"),
    "programs.replace_ask": ("{0} is there already. Replace it?", "{0} gibt es schon. Ersetzen?"),
    "programs.none": ("No programs yet.", "Noch keine Programme."),
    "programs.name": ("Name", "Name"),
    "programs.size": ("Size", "Größe"),
    "programs.check": ("Check", "Prüfung"),
    "programs.time": ("Time", "Zeit"),
    "programs.last": ("Last run", "Letzter Lauf"),
    "programs.uploaded": ("Uploaded", "Übertragen"),
    "programs.load": ("Load", "Laden"),
    "programs.unload": ("Unload", "Entladen"),
    "programs.ask_check": ("Check", "Prüfen"),
    "programs.download": ("Download", "Herunterladen"),
    "programs.rename": ("Rename", "Umbenennen"),
    "programs.rename_ask": ("New name of {0}", "Neuer Name von {0}"),
    "programs.delete": ("Delete", "Löschen"),
    "programs.delete_ask": ("Delete {0}?", "{0} löschen?"),
    "programs.loaded": ("loaded", "geladen"),
    "programs.line": ("From line", "Ab Zeile"),
    "programs.fraction": ("at % of its block", "bei % des Satzes"),
    "programs.dry": ("Dry run, mm above", "Probelauf, mm darüber"),
    "programs.block_delete": ("Leave out lines with /", "Sätze mit / auslassen"),
    "programs.load_there": ("Load from there", "Von dort laden"),
    "programs.state_there": ("State at that place", "Zustand an dieser Stelle"),
    "programs.offer": (
        "{0} was interrupted at line {1}, {2} % of its block, on {3}.",
        "{0} wurde in Zeile {1} unterbrochen, bei {2} % des Satzes, am {3}.",
    ),
    "programs.go_on": ("Load from that place", "Ab dieser Stelle laden"),
    "programs.not_offered": ("It cannot be gone on with:", "Fortsetzen geht nicht:"),
    "programs.cut": ("Cut", "Schnitt"),
    "programs.blocks": ("Blocks", "Sätze"),
    "programs.binds": ("Held by", "Begrenzt durch"),
    "programs.overcut": ("Overcut", "Überschnitt"),
    "programs.velocity": ("velocity", "Geschwindigkeit"),
    "programs.acceleration": ("acceleration", "Beschleunigung"),
    "programs.jerk": ("jerk", "Ruck"),
    "programs.from": ("from", "von"),
    "programs.to": ("to", "bis"),
    "programs.select": (
        "Choose a program to see its check.",
        "Ein Programm wählen, um seine Prüfung zu sehen.",
    ),
    "check.none": ("not checked", "ungeprüft"),
    "check.waiting": ("waiting", "wartet"),
    "check.running": ("checking", "wird geprüft"),
    "check.passed": ("passed", "in Ordnung"),
    "check.exceeds": ("exceeds tolerance", "über Toleranz"),
    "check.refused": ("refused", "abgelehnt"),
    "check.failed": ("failed", "gescheitert"),
    "result.completed": ("completed", "fertig"),
    "result.stopped": ("stopped", "gestoppt"),
    "result.fault": ("fault", "Störung"),
    "result.refused": ("refused", "abgelehnt"),
    "result.interrupted": ("interrupted", "unterbrochen"),
    "result.lost": ("lost", "verloren"),
    "result.running": ("running", "läuft"),
    **cut_maps.WORDS,
}
TONES = {
    "passed": "go",
    "exceeds": "stop",
    "refused": "stop",
    "failed": "stop",
    "running": "info",
    "waiting": "info",
}
RESULT_TONES = {"completed": "go", "fault": "stop", "refused": "stop", "lost": "stop", "stopped": "hold"}
LOOK_S = 1.0  # between two looks at checks under way
AT_REST = "OFF READY FAULT"  # a job that runs is kept
BOX_SHARES = ("velocity", "acceleration", "jerk")


async def build(page: Page) -> None:
    """Make the view."""
    await _Programs(page).build()


class _Programs:
    """List and details; of both only that part is made anew whose facts have changed.

    A press, or a half typed figure, must not be lost because another program is being checked.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._rows: list[dict[str, Any]] = []
        self._chosen = ""
        self._loaded = ""
        self._shown: dict[str, Any] = {}  # by part: the facts it was made of
        self._shares: dict[str, TextElement] = {}  # by program: how far its check is

    async def build(self) -> None:
        page = self._page
        with ui.element("div").classes("programs"):
            with card(page, "", "programs-list"):
                offer()
                restart(page)
                self._drop()
                self._list()
            with card(page, "", "programs-detail"):
                self._head()
                await self._found()
                self._places()
        page.on("programs", lambda _: self._look())
        page.on("job", lambda _: self._look())
        page.when_shown(NAME, self._look)
        ui.timer(LOOK_S, self._watch, immediate=False)

    async def _watch(self) -> None:
        """Checks under way, other tools and new records tell nobody."""
        if self._page.showing(NAME):
            await self._look()

    async def _look(self) -> None:
        self._rows = await asyncio.to_thread(self._read)
        with contextlib.suppress(Refusal):
            job = (await self._page.panel.watch.status()).get("job") or {}
            self._loaded = str(job.get("name") or "")
        self._show()

    def _show(self) -> None:
        one = self._one()
        still = [{**entry, "progress": None} for entry in self._rows]  # it is written where it stands
        self._renew("list", self._list, still, self._chosen, self._loaded)
        self._renew("head", self._head, self._chosen if one else "", self._loaded == self._chosen)
        self._renew("found", self._found, one and (one["sha256"], one["state"], one["check"]))
        self._renew("places", self._places, one and (one["name"], one["sha256"], one["state"] == "passed"))
        for entry in self._rows:
            if (share := self._shares.get(str(entry["name"]))) is not None:
                share.text = percent(entry["progress"])

    def _renew(self, part: str, made: Any, *facts: Any) -> None:
        if self._shown.get(part) != facts:
            self._shown[part] = facts
            made.refresh()

    def _one(self) -> dict[str, Any] | None:
        """The chosen program, if it is there."""
        return next((one for one in self._rows if one["name"] == self._chosen), None)

    def _read(self) -> list[dict[str, Any]]:
        return [self._row(program) for program in self._page.panel.store.programs.list()]

    def _row(self, program: Program) -> dict[str, Any]:
        panel = self._page.panel
        check = panel.checker.of(program) if panel.checker is not None else None
        run = panel.store.runs.last_of(program.name)
        return {
            **asdict(program),
            "state": check.state if check else "none",
            "progress": check.progress if check else 0.0,
            "check": dict(check.result) if check else {},
            "run": asdict(run) if run else None,
        }

    # ---- the list

    def _drop(self) -> None:
        page = self._page
        with tagged(ui.element("div").classes("drop"), id="programs-drop"):
            tagged(ui.icon("upload_file"), aria_hidden="true")
            text(page.word("programs.drop"), "span")
            choose = tagged(ui.element("label").classes("act"), tabindex="0")
            with choose:
                text(page.word("programs.choose"), "span")
                tagged(ui.element("input"), type="file", multiple="", id="programs-file")
        tagged(ui.element("div").classes("uploads"), id="programs-uploads", aria_live="polite")

    @ui.refreshable_method
    def _list(self) -> None:
        page = self._page
        self._shares.clear()
        if not self._rows:
            text(page.word("programs.none"), "p", "dim")
            return
        with ui.element("div").classes("scroll"), ui.element("table").classes("list"):
            with ui.element("thead"), ui.element("tr"):
                for column in ("name", "check", "time", "last", "size"):
                    tagged(text(page.word(f"programs.{column}"), "th", f"p-{column}"), scope="col")
            with ui.element("tbody"):
                for one in self._rows:
                    self._entry(one)

    def _entry(self, one: dict[str, Any]) -> None:
        page, name = self._page, str(one["name"])
        line = tagged(ui.element("tr").classes("entry"), data_program=name)
        if name == self._chosen:
            line.props["aria-selected"] = "true"
        with line.on("click", lambda: self._choose(name)):
            with ui.element("td").classes("p-name"):
                choose = tagged(ui.element("button").classes("plain"), type="button")
                with choose:
                    text(name, "span")
                if name == self._loaded:
                    chip(page.word("programs.loaded"), "info")
                when(one["uploaded_s"], page.word("programs.uploaded"))
            with ui.element("td").classes("p-check"):
                self._state(one)
            text(clock(one["check"].get("duration_s")), "td", "figures p-time")
            with ui.element("td").classes("p-last"):
                if one["run"]:
                    result = str(one["run"]["result"])
                    chip(page.words.get(f"result.{result}", result), RESULT_TONES.get(result, "dim"))
                    when(one["run"]["began_s"])
            text(size(one["size"]), "td", "figures p-size")

    def _state(self, one: dict[str, Any]) -> None:
        page, state = self._page, str(one["state"])
        verdict = one["check"].get("verdict")
        if verdict and not verdict["within"]:  # no green word beside a wall that is off
            state = "refused" if state == "refused" else "exceeds"
        chip(page.word(f"check.{state}"), TONES.get(state, "dim"))
        if state == "running":
            self._shares[str(one["name"])] = text(percent(one["progress"]), "span", "figures dim")

    def _choose(self, name: str) -> None:
        self._chosen = name
        self._show()

    # ---- one program

    @ui.refreshable_method
    def _head(self) -> None:
        page, one = self._page, self._one()
        if one is None:
            text(page.word("programs.select"), "p", "dim")
            return
        text(one["name"], "h2", "program-title")
        self._acts(str(one["name"]))

    @ui.refreshable_method
    async def _found(self) -> None:
        """What its check says."""
        one = self._one()
        if one is None:
            return
        if "sentence" in one["check"]:
            await self._wrong(one)
        elif one["state"] == "passed":
            self._figures(one["check"])

    def _acts(self, name: str) -> None:
        page = self._page
        path = f"programs/{quote(name, safe='')}"
        with row("program-acts"):
            body = {"program": name}
            act(page, "programs.load", "POST job", body, kind="go", icon="input", modes="OFF READY")
            if name == self._loaded:
                act(page, "programs.unload", "DELETE job", icon="eject", modes=AT_REST)
            act(page, "programs.ask_check", f"POST {path}/check", needs="role", icon="fact_check")
            link = tagged(ui.element("a").classes("act"), href=f"/api/v1/{path}/text", download=name)
            with link:
                tagged(ui.icon("download"), aria_hidden="true")
                text(page.word("programs.download"), "span")
            rename = act(page, "programs.rename", needs="role", icon="edit")
            tagged(rename, data_rename=name, data_question=page.word("programs.rename_ask").format(name))
            delete = act(page, "programs.delete", f"DELETE {path}", needs="role", kind="warn", icon="delete")
            tagged(delete, data_ask=page.word("programs.delete_ask").format(name))

    async def _wrong(self, one: dict[str, Any]) -> None:
        """The sentence, and the text around the place with a caret below it."""
        check = one["check"]
        if check.get("verdict"):  # it says the same in the page's language
            cut_maps.form(self._page, check["verdict"])
        else:
            tagged(text(str(check["sentence"]), "p", "wrong"), role="alert")
        if not check.get("line"):
            return
        path = self._page.panel.store.programs.path(str(one["sha256"]))
        place = text("", "pre", "listing caret")  # gone if it is made anew meanwhile
        tagged(place, id="programs-wrong", tabindex="0")
        lines = await asyncio.to_thread(around, path, int(check["line"]), int(check.get("column") or 0))
        place.text = "\n".join(lines)

    def _figures(self, check: dict[str, Any]) -> None:
        page = self._page
        with ui.element("dl").classes("facts wide"):
            for word, shown in (
                ("time", clock(check.get("duration_s"))),
                ("cut", f"{check.get('cut_length_mm', 0.0):.1f} mm, {clock(check.get('cut_time_s'))}"),
                ("blocks", str(check.get("blocks", "–"))),
                ("binds", ", ".join(_binds(page, check))),
                ("overcut", overcut(check)),
            ):
                if shown:
                    text(page.word(f"programs.{word}"), "dt")
                    text(shown, "dd", "figures")
        cut_maps.form(page, check.get("verdict"))
        cut_maps.cut_maps(page, check.get("verified") or {})
        if check.get("warning"):
            text(str(check["warning"]), "p", "wrong")
        self._box(check)
        for note in check.get("notes") or ():
            text(f"{page.word('run.line')} {note.get('line')}: {note.get('note')}", "p", "dim note")

    def _box(self, check: dict[str, Any]) -> None:
        page = self._page
        with ui.element("div").classes("scroll"), ui.element("table").classes("list box"):
            with ui.element("thead"), ui.element("tr"):
                for word in (
                    "run.axis",
                    "programs.from",
                    "programs.to",
                    *(f"programs.{n}" for n in BOX_SHARES),
                ):
                    tagged(text(page.word(word), "th"), scope="col")
            with ui.element("tbody"):
                for joint in check.get("joints") or ():
                    with ui.element("tr"):
                        tagged(text(str(joint["name"]), "th"), scope="row")
                        for key in ("lowest", "highest"):
                            text(f"{joint[key]:.2f}", "td", "figures")
                        for key in BOX_SHARES:
                            text(percent(joint[f"{key}_share"]), "td", "figures")

    @ui.refreshable_method
    def _places(self) -> None:
        """To begin elsewhere; what will be in force there is shown once it is loaded."""
        page, one = self._page, self._one()
        if one is None or one["state"] != "passed":
            return
        with tagged(ui.element("form").classes("row places"), data_program=str(one["name"])):
            for key, most in (("line", one["lines"]), ("fraction", 100), ("dry", 1000)):
                with ui.element("label"):
                    text(page.word(f"programs.{key}"), "span", "dim")
                    field = tagged(ui.element("input"), type="number", name=key, min="0", max=str(most))
                    tagged(field, step="1" if key == "line" else "any")
            with ui.element("label"):
                text(page.word("programs.block_delete"), "span", "dim")
                tagged(ui.element("input"), type="checkbox", name="block_delete")
            act(page, "programs.load_there", kind="go", icon="low_priority", modes="OFF READY")


def offer() -> None:
    """Where what was interrupted is offered; its script fills it."""
    tagged(ui.element("div").classes("offer"), data_offer="1", hidden="")


def restart(page: Page) -> None:
    """The state at the place where the loaded program begins, if that is not its beginning."""
    with tagged(ui.element("div").classes("restart"), data_restart="1", hidden=""):
        text(page.word("programs.state_there"), "h2")
        ui.element("ul")


def chip(words: str, tone: str) -> None:
    """A word on its colour."""
    tagged(text(words, "span", "chip"), data_tone=tone)


def when(seconds: float, before: str = "") -> None:
    """A time of day, written by the browser as its user writes times."""
    with ui.element("div").classes("dim when"):
        if before:
            text(before, "span")
        tagged(ui.element("time").classes("figures"), data_at=str(seconds))


def _binds(page: Page, check: dict[str, Any]) -> list[str]:
    """What held the feed for at least a hundredth of the time."""
    return [
        f"{bound(page, str(one['what']))} {percent(one['share'])}"
        for one in check.get("cut_binds") or ()
        if one["share"] >= 0.01
    ]


def bound(page: Page, what: str) -> str:
    """``Y velocity`` in the page's language."""
    if (whole := page.words.get(f"bound.{what}")) is not None:
        return whole
    axis, _, kind = what.partition(" ")
    return f"{axis} {page.words.get(f'bound.{kind}', kind)}"
