"""The back-up on the page: one is saved by a button, and how it is put back is said, not done."""

from __future__ import annotations

from typing import Any

import pytest
from support.live.browser import Site

pytestmark = pytest.mark.slow


def test_a_backup_is_saved_by_a_button_and_listed_with_its_date(page: Any, site: Site) -> None:
    page.evaluate("dx.show('setup')")
    page.click("[data-setup=backup]")
    page.wait_for_selector("#backup-save:not([aria-disabled])")
    page.click("#backup-save")
    page.wait_for_selector("#backup-list tr")
    (made,) = site.ask("backups")["backups"]
    row = page.locator("#backup-list tr")
    assert page.evaluate("(s) => dx.forms.date(s)", made["made_s"]) in row.inner_text()
    assert made["name"] in row.inner_text() and page.inner_text("#dx-said").startswith("Saved: ")
    with page.expect_download() as waiting:
        row.locator("a").click()
    assert waiting.value.suggested_filename == made["name"]
    told = page.inner_text("#backup-restore")
    assert (
        told == f"directrix backup restore {site.folder}/panel/backups/{made['name']} --state {site.folder}"
    )
    assert "command line only" in page.inner_text(".setup .restore")


def test_who_does_not_set_up_saves_none(page: Any) -> None:
    page.evaluate("dx.user = {...dx.user, role: 'operate'}; dx.show('setup')")
    page.click("[data-setup=backup]")
    page.wait_for_selector("#backup-save[aria-disabled=true][title^='Only who sets up']")
    assert page.locator("#backup-list a").count() == 0
