"""Programs on the page: in by drag and drop, checked, loaded, renamed, deleted."""

from __future__ import annotations

import unicodedata
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from support.live import browser
from support.live.browser import Site, until

from controller.api import listing

DROP = """([name, text]) => {
  const transfer = new DataTransfer();
  transfer.items.add(new File([text], name));
  document.querySelector("#programs-drop").dispatchEvent(
    new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
}"""


def drop(page: Any, name: str, text: str) -> None:
    page.evaluate("dx.show('programs')")
    page.wait_for_selector("#programs-drop")
    page.evaluate(DROP, [name, text])
    page.wait_for_selector(f"tr[data-program='{name}']")


def choose(page: Any, name: str) -> None:
    page.click(f"tr[data-program='{name}'] button >> nth=0")
    page.wait_for_selector(f".program-title:has-text('{name}')")


@pytest.mark.slow
def test_a_program_is_dropped_and_loaded_from_the_second_line(page: Any, site: Site) -> None:
    drop(page, "part.ngc", "G21\nG1 X1 F100\nM2\n")
    choose(page, "part.ngc")
    page.wait_for_selector(".programs-detail >> text=87.3 mm")
    page.fill(".places [name=line]", "2")
    page.fill(".places [name=fraction]", "25")
    page.click(".places button")
    asked = until(lambda: site.commands("load"), "the loading")[-1][2]
    assert (asked["name"], asked["line"], asked["fraction"]) == ("part.ngc", 2, 0.25)
    page.evaluate("dx.show('run')")
    page.wait_for_selector("#run-listing >> text=G1 X1 F100")
    for language, words in (("en", "Tool T1"), ("de", "Werkzeug T1")):
        page.evaluate("(language) => { dx.language = language; dx.socket.close(); }", language)
        page.wait_for_selector(f".run .restart li:has-text('{words}')")
    page.evaluate("dx.call('DELETE', 'job')")


@pytest.mark.slow
def test_a_program_is_loaded_for_a_dry_run_above_the_part_and_unloaded_again(page: Any, site: Site) -> None:
    drop(page, "dry.ngc", "G21\nM2\n")
    choose(page, "dry.ngc")
    page.fill(".places [name=dry]", "12.5")
    page.click(".places button")
    (asked,) = until(
        lambda: [args for _, _, args in site.commands("load") if args["name"] == "dry.ngc"], "the loading"
    )
    assert asked["dry_run_mm"] == 12.5
    page.click(".program-acts >> text=Unload")
    until(lambda: site.commands("unload"), "the unloading")
    page.wait_for_selector("tr[data-program='dry.ngc'] .chip:text-is('loaded')", state="detached")
    page.wait_for_selector(".program-acts >> text=Unload", state="detached")


@pytest.mark.slow
def test_what_is_typed_stays_while_another_program_is_being_checked(page: Any, site: Site) -> None:
    drop(page, "typed.ngc", "G21\nM2\n")
    choose(page, "typed.ngc")
    page.fill(".places [name=line]", "2")
    drop(page, "slow.ngc", "SLOWLY\nM2\n")
    share = "tr[data-program='slow.ngc'] .p-check .figures"
    for _ in range(2):
        shown = page.inner_text(share)
        page.wait_for_function(
            "([s, was]) => document.querySelector(s).textContent !== was", arg=[share, shown]
        )
    assert page.input_value(".places [name=line]") == "2"
    page.evaluate("dx.call('DELETE', 'programs/slow.ngc')")


@pytest.mark.slow
def test_the_list_is_up_to_date_again_when_one_comes_back_to_it(page: Any, site: Site) -> None:
    """The second view was built before: only its being shown is told."""
    for view in ("programs", "runs", "programs", "runs", "programs"):
        page.evaluate("(view) => dx.show(view)", view)
        page.wait_for_selector(f"section[data-view={view}] .card")
    drop(page, "back.ngc", "SLOWLY\nM2\n")
    share = "tr[data-program='back.ngc'] .p-check .figures"
    shown = page.inner_text(share)
    page.wait_for_function("([s, was]) => document.querySelector(s).textContent !== was", arg=[share, shown])
    page.evaluate("dx.call('DELETE', 'programs/back.ngc')")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["twice.ngc", "Gehäuse.ngc"])
def test_what_is_there_already_is_replaced_only_after_a_question(name: str, page: Any, site: Site) -> None:
    """Also where a system has the signs of a name decomposed."""
    drop(page, name, "M2\n")
    for say_yes in (False, True):
        page.evaluate(DROP, [unicodedata.normalize("NFD", name), "G21\nM2\n"])
        page.wait_for_selector(".dx-ask >> text=is there already. Replace it?")
        if say_yes:
            browser.yes(page)
        else:
            page.click(".dx-ask button >> nth=1")
        page.wait_for_selector(".upload", state="detached")
        assert site.ask(f"programs/{quote(name)}")["size"] == (7 if say_yes else 3)


@pytest.mark.slow
def test_files_are_chosen_with_the_button_one_after_another_even_if_a_question_is_given_up(
    page: Any, site: Site, tmp_path: Path
) -> None:
    for name in ("one.ngc", "two.ngc"):
        (tmp_path / name).write_text("M2\n")
    drop(page, "one.ngc", "G21\nM2\n")
    page.set_input_files("#programs-file", [tmp_path / "one.ngc", tmp_path / "two.ngc"])
    page.wait_for_selector(".dx-ask >> text=one.ngc")
    page.evaluate("void dx.ask('Another question?')")
    page.wait_for_selector("tr[data-program='two.ngc']")
    page.keyboard.press("Escape")
    assert site.ask("programs/one.ngc")["size"] == 7
    with page.expect_download() as waiting:
        choose(page, "two.ngc")
        page.click(".program-acts >> text=Download")
    assert waiting.value.suggested_filename == "two.ngc"
    assert waiting.value.path().read_text() == "M2\n"


@pytest.mark.slow
def test_an_upload_shows_how_far_it_is(page: Any, site: Site) -> None:
    page.evaluate("dx.show('programs')")
    page.wait_for_selector("#programs-drop")
    page.evaluate(
        """() => {
          window.shares = [];
          const look = () => {
            for (const one of document.querySelectorAll(".upload-share")) {
              shares.push([one.textContent, Number(one.previousSibling.style.getPropertyValue("--share"))]);
            }
          };
          const seen = { childList: true, subtree: true, characterData: true };
          new MutationObserver(look).observe(document.getElementById("programs-uploads"), seen);
        }"""
    )
    page.evaluate(DROP, ["long.ngc", "G1 X1 F100\n" * 2_000_000])
    page.wait_for_selector("tr[data-program='long.ngc']")
    told = [(text, share) for text, share in page.evaluate("shares") if text]
    assert told[-1][0] == "100 %"  # the row may be gone before the browser tells of the last bytes
    assert all(text == f"{round(share * 100)} %" for text, share in told)
    page.evaluate("dx.call('DELETE', 'programs/long.ngc')")


@pytest.mark.slow
def test_what_a_check_found_is_shown_with_its_units(page: Any, site: Site) -> None:
    drop(page, "sound.ngc", "G21\nM2\n")
    choose(page, "sound.ngc")
    page.wait_for_selector(".programs-detail .facts")
    told = page.inner_text(".programs-detail .facts").split("\n")
    for shown in (
        "1:08",
        "87.3 mm, 0:52",
        "210.0 mm, 0:13",
        "36.0 mm, 0:22",
        "6",
        "programmed feed 93 %, Y velocity 7 %",
        "250.2 µm",
    ):
        assert shown in told, told
    box = page.inner_text(".programs-detail .box tbody tr:nth-child(2)").split()
    assert box == ["Y", "-27.60", "150.00", "42", "%", "30", "%", "90", "%"]
    tools = [page.inner_text(f".programs-detail .tools tbody tr:nth-child({k})").split() for k in (1, 2)]
    assert tools == [
        ["T4", "52.4", "s", "2.5", "s", "87.3", "9000–12000", "100", "-0.250"],
        ["T5", "0.0", "s", "1.5", "s", "0.0"],
    ]
    hole = page.inner_text(".programs-detail .holes tbody tr").split()
    assert hole == ["7", "T4", "G83", "G55", "1.000", "2.500", "3.000", "Y-7.000"]
    row = page.inner_text("tr[data-program='sound.ngc']")
    assert "7 B" in row and "Uploaded" in row and "1:08" in row
    at = page.get_attribute("tr[data-program='sound.ngc'] time", "data-at")
    assert float(at) == site.ask("programs/sound.ngc")["uploaded_s"]
    year = page.evaluate("new Date().getFullYear()")
    page.wait_for_selector(f"tr[data-program='sound.ngc'] time:has-text('{year}')")


@pytest.mark.slow
def test_the_cut_surfaces_of_a_checked_program_are_shown_as_maps_with_their_figures(
    page: Any, site: Site
) -> None:
    drop(page, "cut.ngc", "G21\nM2\n")
    choose(page, "cut.ngc")
    page.wait_for_selector(".facts >> text=250.2 µm")
    assert "overcut 18.0 µm" in str(page.get_attribute("[data-map='10']", "aria-label"))
    assert "worst at u 0.980, v 0.00" in str(page.get_attribute("[data-map='19']", "aria-label"))
    rows = page.query_selector_all("[data-map='19'] > div")
    shown = [row.evaluate("(row) => getComputedStyle(row).backgroundImage") for row in rows]
    assert len(shown) == 3 and all(one.startswith("linear-gradient") for one in shown)
    assert "rgb(211, 34, 42)" in shown[0] and "rgb(211, 34, 42)" not in shown[2]


@pytest.mark.slow
def test_a_surface_beyond_its_tolerance_is_no_green_word_but_said_with_its_place(
    page: Any, site: Site
) -> None:
    drop(page, "deep.ngc", "(TOO DEEP)\nM2\n")
    choose(page, "deep.ngc")
    page.wait_for_selector(".programs-detail [role=alert] >> text=exceeds its form tolerance of 0.05 mm")
    told = page.inner_text(".programs-detail [role=alert]")
    for words in ("line 19", "by 0.4331 mm", "u = 1.0000", "10.000 mm above", "lead out", "P2"):
        assert words in told, words
    assert page.inner_text("tr[data-program='deep.ngc'] .p-check .chip") == "exceeds tolerance"
    assert page.get_attribute("tr[data-program='deep.ngc'] .p-check .chip", "data-tone") == "stop"
    assert page.query_selector_all("tr[data-program='deep.ngc'] .p-check [data-tone=go]") == []
    assert site.ask("programs/deep.ngc/check")["verdict"]["exceeds_mm"] == pytest.approx(0.4331)


SHOWN = "(img) => img.complete && img.naturalWidth > 0 && img.checkVisibility()"


@pytest.mark.slow
def test_each_program_has_its_path_as_a_picture_in_the_list_and_before_it_is_loaded(page: Any) -> None:
    drop(page, "square.ngc", "G21\nM2\n")
    thumbnail = "tr[data-program='square.ngc'] .thumbnail img"
    page.wait_for_selector(thumbnail)
    page.wait_for_function(f'() => ({SHOWN})(document.querySelector("{thumbnail}"))')
    choose(page, "square.ngc")
    page.wait_for_function(f"() => ({SHOWN})(document.querySelector('.preview img'))")
    assert page.get_attribute(".preview img", "alt") == "The path of square.ngc"
    assert page.locator(".preview figcaption").count() == 0
    box = page.locator(".preview img").bounding_box()
    assert box["height"] >= 150 and box["y"] + box["height"] < 720, "seen without scrolling"
    drop(page, "being.ngc", "SLOWLY\nM2\n")
    page.wait_for_selector("tr[data-program='being.ngc'] .thumbnail svg")


@pytest.mark.slow
def test_a_refused_program_is_shown_with_its_guilty_place(page: Any) -> None:
    drop(page, "guilty.ngc", "G21\nG1 WRONG\n")
    choose(page, "guilty.ngc")
    page.wait_for_function(f"() => ({SHOWN})(document.querySelector('.preview img'))")
    assert page.inner_text(".preview figcaption") == "Red: where it is refused, line 2"
    source = page.get_attribute(".preview img", "src")
    svg = page.evaluate("(url) => fetch(url).then((answer) => answer.text())", source)
    assert 'class="guilty"' in svg and "<circle" in svg


@pytest.mark.slow
def test_a_program_that_takes_an_axis_over_a_limit_has_no_green_word_beside_it(page: Any, site: Site) -> None:
    drop(page, "fast.ngc", "(TOO FAST)\nM2\n")
    choose(page, "fast.ngc")
    page.wait_for_selector(".programs-detail .box >> text=102 % over the limit")
    assert page.locator(".programs-detail .box .wrong").count() == 1, (
        "101 % of a jerk is as near as laws come"
    )
    chip = page.locator("tr[data-program='fast.ngc'] .p-check .chip")
    assert (chip.inner_text(), chip.get_attribute("data-tone")) == ("over a limit", "stop")
    assert site.ask("programs/fast.ngc/check")["over_limit"] is True
    page.evaluate("dx.show('run')")
    page.wait_for_selector("#run-empty")
    assert page.locator("#run-empty [data-load='fast.ngc']").count() == 0, "nor is it offered unseen"


@pytest.mark.slow
def test_a_program_with_a_mistake_shows_the_line_with_a_caret_below_it(page: Any, site: Site) -> None:
    drop(page, "wrong.ngc", "G21\nG1 WRONG\n")
    choose(page, "wrong.ngc")
    page.wait_for_selector("#programs-wrong:not(:empty)")
    shown = page.inner_text("#programs-wrong").splitlines()
    assert shown[-2].endswith("2  G1 WRONG")
    assert shown[-1].index("^") == shown[-2].index("WRONG")


@pytest.mark.slow
def test_a_mistake_in_a_called_file_is_shown_with_the_name_and_the_text_of_that_file(page: Any) -> None:
    drop(page, "5.ngc", "o5 sub\nG1 wrong\no5 endsub\n")
    drop(page, "calls.ngc", "G21\nG0 X1\no5 call\nM2\n")
    choose(page, "calls.ngc")
    page.wait_for_selector("#programs-wrong:not(:empty)")
    shown = page.inner_text("#programs-wrong").splitlines()
    assert shown[-2].endswith("2  G1 wrong") and shown[-1].index("^") == shown[-2].index("wrong")
    assert page.inner_text(".programs-detail .wrong >> nth=1").startswith("5.ngc:2: ")
    assert page.inner_text(".preview figcaption") == "Red: where it is refused, line 3"
    assert page.inner_text("#programs-calls").splitlines()[-2].endswith("3  o5 call")


@pytest.mark.slow
def test_a_program_is_renamed_and_deleted_after_a_question(page: Any, site: Site) -> None:
    drop(page, "old.ngc", "M2\n")
    choose(page, "old.ngc")
    page.click("[data-rename]")
    page.fill(".dx-ask input", "new name.ngc")
    browser.yes(page)
    page.wait_for_selector("tr[data-program='new name.ngc']")
    choose(page, "new name.ngc")
    page.click(".program-acts [data-kind=warn]")
    browser.yes(page)
    page.wait_for_selector("tr[data-program='new name.ngc']", state="detached")


@pytest.mark.slow
def test_a_name_that_is_html_is_shown_as_it_is(page: Any, site: Site) -> None:
    drop(page, "a&lt;b.ngc", "(<script>dx.bad = 1</script>)\nWRONG\n")
    choose(page, "a&lt;b.ngc")
    assert page.evaluate("dx.bad") is None


# ---- without a browser


def test_the_caret_stands_below_the_column(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text("".join(f"N{n} G1 X{n}\n" for n in range(1, 200)))
    found = listing.around(file, 150, 6)
    assert found[-2] == "   150  N150 G1 X150"
    assert found[-1].index("^") == found[-2].index("G1")
    assert len(found) == listing.SHOWN_BEFORE + 2


def test_the_caret_stands_below_the_column_also_behind_tabs_and_far_to_the_right(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text("G1\n(" + "é" * 400 + ")\tG1\tWRONG X1 (" + "." * 400 + ")\n")
    column = len("(" + "é" * 400 + ")\tG1\t") + 1
    first, wrong, caret = listing.around(file, 2, column)
    assert first == "     1"
    assert caret.index("^") == wrong.index("WRONG")
    assert len(wrong) <= 8 + listing.SHOWN_WIDE


def test_the_caret_stands_below_the_column_of_a_line_beyond_the_millionth(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text("\n" * 1_000_000 + "G1 WRONG\n")
    *_, wrong, caret = listing.around(file, 1_000_001, 4)
    assert caret.index("^") == wrong.index("WRONG")


def test_a_place_beyond_the_end_of_the_text_shows_what_there_is(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_bytes(b"G1 \xff\n")
    assert listing.around(file, 9, 0) == []
    assert listing.around(file, 1, 0) == ["     1  G1 �"]


# ---- figures, as the page writes them


@pytest.mark.slow
def test_sizes_are_told_in_the_unit_that_fits(page: Any) -> None:
    sizes = {0: "0 B", 999: "999 B", 1000: "1.0 kB", 2_500_000: "2.5 MB", 3e12: "3000.0 GB"}
    assert page.evaluate("(all) => all.map(dx.forms.size)", list(sizes)) == list(sizes.values())


@pytest.mark.slow
def test_times_are_told_as_a_clock_does(page: Any) -> None:
    times = {None: "–:––", 0.4: "0:00", 67.7: "1:08", 3725.0: "1:02:05"}
    assert page.evaluate("(all) => all.map(dx.forms.time)", list(times)) == list(times.values())
