"""Programs written and mended on the page: read as they are typed, compared with what is stored, and kept."""

from __future__ import annotations

from typing import Any
from urllib.request import urlopen

import pytest
from support.live.browser import Site, until, yes

pytestmark = pytest.mark.slow

WRONG = "G21 G90\r\nG1 X10 F100\r\nG1 X1..5\r\nG1 Q7\r\nM30\r\n"
MENDED = WRONG.replace("1..5", "1.5").replace("G1 Q7\r\n", "")
UPLOAD = """([name, text]) => { const form = new FormData();
  form.append("file", new File([text], name));
  const sent = {method: "POST", body: form, headers: dx.headers()};
  return fetch("/api/v1/programs", sent).then((answer) => answer.status); }"""
SAID = ".editor-said"
READS_WELL = f"{SAID} >> text=The reader finds no mistake."


def text_of(site: Site, name: str) -> str:
    with urlopen(f"{site.url}api/v1/programs/{name}/text") as answer:
        return str(answer.read().decode())


def opened(page: Any, name: str, text: str) -> None:
    assert page.evaluate(UPLOAD, [name, text]) in (201, 409)
    page.evaluate("dx.show('programs')")
    page.click(f"tr[data-program='{name}'] button >> nth=0")
    page.click(f".programs-detail:has(.program-title:text-is('{name}')) [data-edit=open]")
    page.wait_for_selector(".cm-content")


def at(page: Any, line: int) -> Any:
    return page.locator(".cm-line").nth(line - 1)


def left(page: Any) -> None:
    page.click("[data-edit=leave]")
    page.wait_for_selector(".editor", state="detached")


def test_every_mistake_stands_in_its_line_and_goes_when_it_is_mended(page: Any, site: Site) -> None:
    opened(page, "edit.ngc", WRONG)
    page.wait_for_selector(f"{SAID} button:has-text('Line 3, column')")
    page.wait_for_selector(f"{SAID} button:has-text('Line 4, column')")
    assert page.locator(".cm-line:nth-child(3) .cm-lintRange-error").inner_text() == ".5"  # of X1..5
    assert page.locator(".cm-line:nth-child(2) .cm-lintRange-error").count() == 0
    assert page.locator(".cm-lint-marker-error").count() == 2
    assert page.get_attribute("[data-edit=keep]", "aria-disabled") == "true"
    page.click(f"{SAID} button:has-text('Line 4')")
    page.keyboard.press("Control+Shift+K")  # the line under the caret is deleted
    at(page, 3).click()
    page.keyboard.press("End")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Backspace")
    page.wait_for_selector(READS_WELL)
    assert page.locator(".cm-lintRange-error").count() == 0
    page.click("[data-edit=compare]")
    page.wait_for_selector(".cm-deletedChunk:has-text('G1 X1..5')")
    page.wait_for_selector(".cm-changedLine:has-text('G1 X1.5')")
    assert text_of(site, "edit.ngc") == WRONG
    page.click("[data-edit=keep]")
    page.wait_for_selector(".programs-detail .program-title:text-is('edit.ngc')")
    until(lambda: text_of(site, "edit.ngc") == MENDED, "the text, its ends of lines as they were")


CYCLES = "G21 G90\nG83 X1 Y1 Z-5 R2 Q1 F100\nX2 Y2\nG80\nX3\no<probe_bore> call [20] [0]\n(G81)\nM30\n"


def test_the_cycle_of_the_carets_line_is_drawn_beside_the_program(page: Any, site: Site) -> None:
    opened(page, "cycles.ngc", CYCLES)
    picture = page.locator(".editor-picture")
    for line, code in ((2, "G83"), (3, "G83"), (4, None), (5, None), (6, "probe_bore"), (7, None)):
        at(page, line).click()
        picture.wait_for(state="attached" if code else "detached")
        assert not code or picture.get_attribute("alt") == code
    at(page, 3).click()
    drawn = ".editor-picture[src='/api/v1/cycles/G83.svg']"
    page.wait_for_function("(one) => document.querySelector(one)?.naturalWidth > 0", arg=drawn)
    left(page)


def test_a_program_is_written_from_nothing_and_not_left_unasked(page: Any, site: Site) -> None:
    page.evaluate("dx.show('programs')")
    page.click("[data-edit=new]")
    page.fill(".dx-ask input", "new.ngc")
    yes(page)
    page.click(".cm-content")
    page.keyboard.type("G21 G90\nG0 X1\nM30\n")
    page.wait_for_selector(READS_WELL)
    page.click("[data-edit=leave]")
    page.wait_for_selector(".dx-ask >> text=new.ngc is not saved.")
    page.keyboard.press("Escape")
    page.click("[data-edit=keep]")
    page.wait_for_selector(".programs-detail .program-title:text-is('new.ngc')")
    assert text_of(site, "new.ngc") == "G21 G90\nG0 X1\nM30\n"


def test_what_another_one_has_changed_meanwhile_is_replaced_only_by_yes(page: Any, site: Site) -> None:
    opened(page, "both.ngc", "G21\nM30\n")
    at(page, 1).click()
    page.keyboard.type("G90 ")
    assert page.evaluate(UPLOAD, ["both.ngc", "G20\nM30\n"]) == 201
    page.wait_for_timeout(1500)  # the list is looked at every second
    page.click("[data-edit=keep]")
    page.wait_for_selector(".dx-ask >> text=both.ngc was changed by somebody else meanwhile.")
    page.keyboard.press("Escape")
    assert text_of(site, "both.ngc") == "G20\nM30\n"
    page.click("[data-edit=keep]")
    yes(page)
    until(lambda: "G90" in text_of(site, "both.ngc"), "the text of the editor")


def test_a_text_that_saving_would_change_is_not_opened(page: Any, site: Site) -> None:
    script = UPLOAD.replace("[text]", "[new Uint8Array([71, 50, 49, 10, 40, 252, 41, 10])]")
    assert page.evaluate(script, ["latin.ngc", ""]) in (201, 409)
    page.evaluate("dx.show('programs')")
    page.click("tr[data-program='latin.ngc'] button >> nth=0")
    page.click(".programs-detail:has(.program-title:text-is('latin.ngc')) [data-edit=open]")
    page.wait_for_selector("#dx-said:has-text('is not written in UTF-8')")
    assert page.locator(".editor").count() == 0
