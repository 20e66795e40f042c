"""Where there are users, the page says who is logged in and lets him log out."""

from __future__ import annotations

import urllib.error
from typing import Any

import pytest
from argon2 import PasswordHasher
from support.live import browser

from controller.panel.store import Store

pytestmark = pytest.mark.slow
PASSWORD = "correct horse"


def lets_nobody_in(site: browser.Site) -> bool:
    try:
        site.ask("control")
    except urllib.error.HTTPError as error:
        return error.code == 401
    return False


def test_who_is_logged_in_is_shown_and_leaves_without_control(chromium: Any, tmp_path: Any) -> None:
    with browser.fake_site(tmp_path) as site:
        Store(tmp_path).users.set("anna", PasswordHasher().hash(PASSWORD), "operate")
        browser.until(lambda: lets_nobody_in(site), "a panel that knows of its users")
        context = chromium.new_context(locale="en-GB")
        page = context.new_page()
        page.set_default_timeout(browser.HANGS_S * 1000)
        page.goto(site.url)
        page.wait_for_url("**/login")
        page.fill("#name", "anna")
        page.fill("#password", PASSWORD)
        page.keyboard.press("Enter")
        page.wait_for_selector("#dx-log-out >> text=anna")
        browser.take_control(page)
        token = page.evaluate("dx.token")
        page.click("#dx-log-out")
        page.wait_for_url("**/login")
        page.wait_for_selector("#password")
        said = page.evaluate(
            "(t) => fetch('/api/v1/control', {headers: {'X-Control-Token': t}}).then((a) => a.status)", token
        )
        assert said == 401
        context.close()
