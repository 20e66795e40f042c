"""What a view is made of: its page, figures that live in the browser, buttons that ask there."""

from __future__ import annotations

import inspect
import json
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from nicegui import Client, ui
from nicegui.element import Element
from nicegui.elements.mixins.text_element import TextElement

from controller.panel.answers import Refusal
from controller.panel.core import Panel
from controller.panel.page.words import Language, Words
from controller.panel.roles import Principal

Handler = Callable[[Any], Awaitable[None] | None]
Kind = Literal["plain", "go", "hold", "stop", "warn"]
CALL_S = 60.0  # a call that the browser makes for us: homing is answered after 4 s, loading when it is read


class View(Protocol):
    """A module of this folder that builds one view.

    ``NAME`` is its id and address, ``ICON`` a material icon, ``WORDS`` its own words. A module may
    also have ``SCRIPT`` and ``STYLE``: files of ``static`` that are loaded with the page.
    """

    NAME: str
    ICON: str
    WORDS: Words

    def build(self, page: Page) -> Awaitable[None] | None:
        """Make the view, within its section; called when it is first shown."""
        ...


@dataclass
class Page:
    """One browser's page."""

    panel: Panel
    who: Principal
    language: Language
    words: Mapping[str, str]
    client: Client
    facts: dict[str, Any] = field(default_factory=dict)  # of the door; {} = no service answers
    shown: str = ""  # name of the view on the screen
    handlers: dict[str, list[Handler]] = field(default_factory=dict)  # by topic of ``panel.events``
    on_shown: dict[str, list[Callable[[], Any]]] = field(default_factory=dict)

    def word(self, key: str) -> str:
        """The text in the page's language."""
        return self.words[key]

    def on(self, topic: str, handler: Handler) -> None:
        """Have ``handler(data)`` called with what is told under a topic, as long as the page is open."""
        self.handlers.setdefault(topic, []).append(handler)

    def when_shown(self, name: str, handler: Callable[[], Any]) -> None:
        """Have ``handler()`` called each time that view comes on the screen."""
        self.on_shown.setdefault(name, []).append(handler)

    def showing(self, name: str) -> bool:
        """Whether that view is on the screen."""
        return self.shown == name

    async def refresh_facts(self) -> dict[str, Any]:
        """The machine's facts as they are now; the last known where no service answers."""
        try:
            self.facts = await self.panel.door.ask("facts")
        except Refusal:
            return self.facts
        return self.facts

    async def call(self, method: str, path: str, body: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Have the browser ask a route, with its own token: {"ok", "status", "body"}.

        A refusal is shown there. ``path`` as ``programs/part.ngc``.
        """
        asked = f"return await window.dx.call({json.dumps(method)}, {json.dumps(path)}, {json.dumps(body)})"
        try:
            said = await self.client.run_javascript(asked, timeout=CALL_S)
        except TimeoutError:
            return {"ok": False, "status": 0, "body": {}}
        return dict(said)


async def given(result: Awaitable[None] | Any) -> None:
    """Await what is to be awaited of a handler's result."""
    if inspect.isawaitable(result):
        await result


# ---- elements


def text(words: str, tag: str = "div", classes: str = "") -> TextElement:
    """An element with text, which changes only where its ``text`` is set."""
    return TextElement(tag=tag, text=words).classes(classes)


def tagged(element: Element, **attributes: str) -> Element:
    """The element with attributes; ``_`` in a name stands for ``-``."""
    for name, value in attributes.items():
        element.props[name.replace("_", "-")] = value
    return element


def live(path: str, form: str = "text", classes: str = "", tag: str = "span") -> Element:
    """A figure of the status (``joints.X.work``), written by the browser; ``form``: see ``dx.forms``."""
    return tagged(ui.element(tag).classes(f"figures {classes}"), data_live=path, data_form=form)


def bar(path: str, classes: str = "") -> Element:
    """A bar as long as a share of the status (0 to 1)."""
    return tagged(ui.element("div").classes(f"bar {classes}"), data_bar=path)


def act(
    page: Page,
    word: str,
    call: str = "",
    body: Mapping[str, Any] | None = None,
    *,
    needs: Literal["control", "role", ""] = "control",
    kind: Kind = "plain",
    ask: str = "",
    modes: str = "",
    icon: str = "",
    classes: str = "",
) -> Element:
    """A button; the browser asks ``call`` ("POST cycle/hold") with ``body`` when it is pressed.

    ``ask`` is the key of a question that comes first; ``modes`` are those in which it can be pressed.
    """
    button = ui.element("button").classes(f"act {classes}")
    tagged(button, type="button", data_kind=kind)
    values = {
        "data-call": call,
        "data-body": json.dumps(body) if body is not None else "",
        "data-needs": needs,
        "data-ask": page.word(ask) if ask else "",
        "data-modes": modes,
    }
    button.props.update({key: value for key, value in values.items() if value})
    with button:
        if icon:
            tagged(ui.icon(icon), aria_hidden="true")
        text(page.word(word), "span")
    return button


@contextmanager
def card(page: Page, title: str = "", classes: str = "") -> Iterator[Element]:
    """A part of a view, with a heading."""
    with ui.element("div").classes(f"card {classes}") as made:
        if title:
            text(page.word(title), "h2")
        yield made


@contextmanager
def row(classes: str = "") -> Iterator[Element]:
    """Elements side by side, on more lines where there is no room."""
    with ui.element("div").classes(f"row {classes}") as made:
        yield made
