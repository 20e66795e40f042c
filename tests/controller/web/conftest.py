"""One browser for file after file, and one panel before a machine for all tests of a file."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterator
from typing import Any

import pytest
from support.live import browser

OPEN = contextlib.ExitStack()  # what ends the browser
MADE: dict[tuple[str, ...], Any] = {}  # the browser, if it is there, by the names that it may have


@pytest.fixture(scope="module")
def chromium(request: pytest.FixtureRequest) -> Any:
    """The browser of the file before, if there is one; ``BROWSER`` of a file: the names that it may have."""
    names = getattr(request.module, "BROWSER", browser.NAMES)
    if names not in MADE:
        _end()
        MADE[names] = OPEN.enter_context(browser.browser(names))
    return MADE[names]


def _end() -> None:
    """No browser is there any more."""
    MADE.clear()
    OPEN.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None]:
    """At a file's end its pages are closed; the browser, whose loop no other loop may run beside, is
    kept for a file that asks for it."""
    yield
    if nextitem is not None and nextitem.path == item.path:
        return
    for context in [context for made in MADE.values() for context in made.contexts]:
        context.close()
    if nextitem is None or "chromium" not in getattr(nextitem, "fixturenames", ()):
        _end()


@pytest.fixture(scope="module")
def site(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[browser.Site]:
    """Before a machine that only keeps its mode."""
    with browser.fake_site(tmp_path_factory.mktemp("panel")) as made:
        yield made


@pytest.fixture(scope="module")
def stepped(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[browser.Site]:
    """Before a machine that cuts Example 2: lists, meters and traces with something in them."""
    with browser.fake_site(tmp_path_factory.mktemp("stepped"), "stepped_site") as made:
        yield made


@pytest.fixture
def page(chromium: Any, site: browser.Site) -> Iterator[Any]:
    """The page with control of the machine, which tells its own again at the end of a test."""
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")
    made = browser.opened(context, site)
    made.evaluate("dx.call('POST', 'control', {take_over: true}).then((s) => { dx.token = s.body.token; })")
    made.wait_for_selector("body[data-control=mine]")
    yield made
    site.tell()
    let_go(context.request, f"{site.url}api/v1/control")
    errors = made.errors
    context.close()
    assert not errors, errors  # of its scripts


def let_go(request: Any, control: str) -> None:
    """Nobody has control of the machine. Not asked for by the page, which may be about to be loaded anew."""
    token = request.post(control, data={"take_over": True}).json()["token"]
    assert request.delete(control, headers={"X-Control-Token": token}).ok
