"""One browser and one panel before a fake machine for all tests of a file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import browsing
import pytest


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browsing.browser() as made:
        yield made


@pytest.fixture(scope="module")
def site(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[browsing.Site]:
    with browsing.fake_site(tmp_path_factory.mktemp("panel")) as made:
        yield made


@pytest.fixture
def page(chromium: Any, site: browsing.Site) -> Iterator[Any]:
    """The page with control of the machine; its scripts must not have failed."""
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")
    made = browsing.opened(context, site)
    made.evaluate("dx.call('POST', 'control', {take_over: true}).then((s) => { dx.token = s.body.token; })")
    made.wait_for_selector("body[data-control=mine]")
    yield made
    made.evaluate("dx.call('DELETE', 'control', null, true)")
    errors = made.errors
    context.close()
    assert not errors, errors
