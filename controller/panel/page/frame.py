"""The frame around every view: what the machine does, what is wrong, who may move it, and the stop."""

from __future__ import annotations

from nicegui import ui
from nicegui.element import Element

from controller.panel.page.view import Page, View, act, bar, live, tagged, text


def build(page: Page, views: tuple[View, ...]) -> dict[str, Element]:
    """Header, alarms, navigation; the empty section of each view by its name."""
    with ui.element("div").classes("shell"):
        with ui.element("header"):
            _mode()
            _program(page)
            _control(page)
            _choices(page)
            _stops(page)
        _lines(page)
        _navigation(page, views)
        with ui.element("div").classes("views"):
            sections = {view.NAME: _section(view, page) for view in views}
        tagged(ui.element("div").classes("said"), id="dx-said", role="status", hidden="")
    return sections


def _section(view: View, page: Page) -> Element:
    label = page.word(f"view.{view.NAME}")
    return tagged(ui.element("section").classes("view"), data_view=view.NAME, aria_label=label)


def _mode() -> None:
    """In word and colour, to be read from the other end of the shop."""
    with tagged(ui.element("div").classes("mode"), role="status", aria_live="polite"):
        live("mode", "word:mode", "mode-word")
        live("shown.under_way", "plain", "mode-more")


def _program(page: Page) -> None:
    with ui.element("div").classes("program"):
        with ui.element("div").classes("program-line"):
            live("job.name", "text", "program-name")
            live("job.state", "word:state", "dim")
            with ui.element("span").classes("program-left dim"):
                text(page.word("frame.left") + " ", "span")
                live("job.left_s", "time", "strong")
        bar("job.fraction", "program-bar")


def _control(page: Page) -> None:
    with tagged(ui.element("button").classes("control"), id="dx-control", type="button"):
        tagged(ui.icon("back_hand"), aria_hidden="true")
        with ui.element("span").classes("control-words"):
            text(page.word("frame.control"), "span", "dim")
            tagged(ui.element("span").classes("strong"), id="dx-holder")
        text(page.word("frame.take"), "span", "control-take")
        text(page.word("frame.give"), "span", "control-give")


def _choices(page: Page) -> None:
    with ui.element("div").classes("choices"):
        other = page.word("frame.language")
        with tagged(ui.element("button").classes("small"), id="dx-language", type="button", title=other):
            text("DE" if page.language == "en" else "EN", "span")
        title = page.word("frame.theme")
        small = ui.element("button").classes("small")
        with tagged(small, id="dx-theme", type="button", title=title, aria_label=title):
            tagged(ui.icon("contrast"), aria_hidden="true")
        if page.who.csrf:
            _log_out(page)


def _log_out(page: Page) -> None:
    """Who is logged in; without users nobody is."""
    title = f"{page.word('frame.log_out')}: {page.who.name}"
    small = ui.element("button").classes("small")
    with tagged(small, id="dx-log-out", type="button", title=title, aria_label=title):
        text(page.who.name, "span", "user-name")
        tagged(ui.icon("logout"), aria_hidden="true")


def _stops(page: Page) -> None:
    for key in ("stop", "estop"):
        button = tagged(ui.element("button").classes(key), id=f"dx-{key}", type="button")
        with tagged(button, title=page.word(f"frame.{key}_title")):
            text(page.word(f"frame.{key}"), "span")


def _lines(page: Page) -> None:
    """What must not be overlooked: that figures are old, and what is wrong."""
    with ui.element("div").classes("lines"):
        with tagged(ui.element("div").classes("line stale"), role="alert"):
            tagged(ui.icon("link_off"), aria_hidden="true")
            text(page.word("frame.stale"), "strong")
            tagged(ui.element("span"), id="dx-stale-text")
        with tagged(ui.element("div").classes("line alarm"), role="alert"):
            tagged(ui.icon("error"), aria_hidden="true")
            with ui.element("span").classes("alarm-words"):
                live("shown.fault", "plain", "strong")
                live("shown.next", "plain")
            act(page, "frame.reset", "POST machine/reset", kind="warn", icon="restart_alt")
        with tagged(ui.element("div").classes("line barred"), role="status"):
            tagged(ui.icon("front_hand"), aria_hidden="true")
            live("shown.interlock", "plain")
        with tagged(ui.element("div").classes("line failed"), role="status"):
            tagged(ui.icon("info"), aria_hidden="true")
            live("shown.failed", "plain")


def _navigation(page: Page, views: tuple[View, ...]) -> None:
    with tagged(ui.element("nav"), aria_label=page.word("frame.views")):
        for view in views:
            with tagged(ui.element("button").classes("tab"), data_to=view.NAME, type="button"):
                tagged(ui.icon(view.ICON), aria_hidden="true")
                text(page.word(f"view.{view.NAME}"), "span")
