"""Where there are users, the page says who is logged in and lets him log out."""

from __future__ import annotations

import urllib.error
from typing import Any

import pytest
from argon2 import PasswordHasher
from support.live import browser

from controller.api.store import Store

pytestmark = pytest.mark.slow
PASSWORD = "correct horse"


def lets_nobody_in(site: browser.Site) -> bool:
    try:
        site.ask("control")
    except urllib.error.HTTPError as error:
        return error.code == 401
    return False


def logged_in(context: Any, site: browser.Site, name: str) -> Any:
    page = context.new_page()
    page.set_default_timeout(browser.HANGS_S * 1000)
    page.goto(site.url)
    page.wait_for_url("**/login")
    page.fill("#name", name)
    page.fill("#password", PASSWORD)
    page.keyboard.press("Enter")
    page.wait_for_selector(f"#dx-log-out >> text={name}")
    return page


def test_who_is_logged_in_is_shown_and_leaves_without_control(chromium: Any, tmp_path: Any) -> None:
    with browser.fake_site(tmp_path) as site:
        Store(tmp_path).users.set("anna", PasswordHasher().hash(PASSWORD), "operate")
        browser.until(lambda: lets_nobody_in(site), "a panel that knows of its users")
        context = chromium.new_context(locale="en-GB")
        page = logged_in(context, site, "anna")
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


def test_users_and_tokens_are_made_changed_and_removed_on_the_page(chromium: Any, tmp_path: Any) -> None:
    """Each step is looked up in the store itself."""
    with browser.fake_site(tmp_path) as site:
        users = Store(tmp_path).users
        users.set("chief", PasswordHasher().hash(PASSWORD), "set_up")
        browser.until(lambda: lets_nobody_in(site), "a panel that knows of its users")
        context = chromium.new_context(locale="en-GB")
        page = logged_in(context, site, "chief")
        page.evaluate("dx.show('setup')")
        page.click("[data-setup=users]")
        page.wait_for_selector("tr[data-user=chief]")
        page.click("#users-add")
        for typed in ("bert", PASSWORD):
            page.fill(".dx-ask input", typed)
            page.keyboard.press("Enter")
        page.fill(".dx-ask input[type=password]", PASSWORD)  # before anything is changed
        page.keyboard.press("Enter")
        page.wait_for_selector("tr[data-user=bert]")
        assert {row.name: row.role for row in users.all()} == {"chief": "set_up", "bert": "operate"}
        page.select_option("tr[data-user=bert] select", "view")
        browser.until(lambda: {row.name: row.role for row in users.all()}["bert"] == "view", "the other role")
        page.click("#users-token")
        page.fill(".dx-ask input", "robot")
        page.keyboard.press("Enter")
        token = page.inner_text(".made code")
        assert [(row.name, row.role) for row in users.tokens()] == [("robot", "operate")]
        told = page.evaluate(
            "(t) => fetch('/api/v1/programs', {credentials: 'omit', headers: {Authorization: `Bearer ${t}`}})"
            ".then((a) => a.status)",
            token,
        )
        assert told == 200
        for path in ("[data-token=robot]", "[data-user=bert]"):
            page.click(f"tr{path} [data-kind=warn]")
            browser.yes(page)
            page.wait_for_selector(f"tr{path}", state="detached")
        assert not users.tokens() and [row.name for row in users.all()] == ["chief"]
        page.wait_for_selector("#users-audit tr:has-text('chief')")
        page.click("tr[data-user=chief] [data-kind=warn]")
        browser.yes(page)
        page.wait_for_selector("#dx-said:has-text('chief')")  # the last one who sets up stays
        assert [row.name for row in users.all()] == ["chief"]
        context.close()


def test_a_viewer_changes_the_own_password_and_ends_a_session_on_it(chromium: Any, tmp_path: Any) -> None:
    with browser.fake_site(tmp_path) as site:
        users = Store(tmp_path).users
        users.set("bert", PasswordHasher().hash(PASSWORD), "view")
        browser.until(lambda: lets_nobody_in(site), "a panel that knows of its users")
        here, there = (chromium.new_context(locale="en-GB") for _ in range(2))
        logged_in(there, site, "bert")
        page = logged_in(here, site, "bert")
        page.evaluate("dx.show('setup')")
        page.click("[data-setup=users]")
        page.click("#users-sessions tr:not(:has-text('this one')) button")
        page.wait_for_selector("#users-sessions tr:nth-child(2)", state="detached")
        before = users.all()
        page.click("#users-own")
        for typed in (PASSWORD, "battery staple"):
            page.fill(".dx-ask input", typed)
            page.keyboard.press("Enter")
        page.wait_for_selector("#dx-said:has-text('another password')")
        assert users.all() != before
        page.click("#dx-log-out")
        page.wait_for_url("**/login")
        here.close()
        there.close()
