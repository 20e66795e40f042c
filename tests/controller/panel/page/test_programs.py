"""Programs on the page: in by drag and drop, checked, loaded, renamed, deleted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import browsing
import pytest
from browsing import Site, until

from controller.panel.page import programs

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
    page.click(f"tr[data-program='{name}'] button")
    page.wait_for_selector(f".program-title:has-text('{name}')")


@pytest.mark.slow
def test_a_program_is_dropped_and_loaded_from_the_second_line(page: Any, site: Site) -> None:
    drop(page, "part.ngc", "G21\nG1 X1 F100\nM2\n")
    choose(page, "part.ngc")
    page.wait_for_selector(".programs-detail >> text=87.3 mm")
    page.fill(".places [name=line]", "2")
    page.fill(".places [name=fraction]", "25")
    page.click(".places button")
    asked = until(lambda: site.asked("load"), "the loading")[-1][2]
    assert (asked["name"], asked["line"], asked["fraction"]) == ("part.ngc", 2, 0.25)
    page.evaluate("dx.show('run')")
    page.wait_for_selector("#run-listing >> text=G1 X1 F100")
    page.evaluate("dx.call('DELETE', 'job')")


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
def test_a_program_with_a_mistake_shows_the_line_with_a_caret_below_it(page: Any, site: Site) -> None:
    drop(page, "wrong.ngc", "G21\nG1 WRONG\n")
    choose(page, "wrong.ngc")
    shown = page.inner_text("#programs-wrong").splitlines()
    assert shown[-2].endswith("2  G1 WRONG")
    assert shown[-1].index("^") == shown[-2].index("WRONG")


@pytest.mark.slow
def test_a_program_is_renamed_and_deleted_after_a_question(page: Any, site: Site) -> None:
    drop(page, "old.ngc", "M2\n")
    choose(page, "old.ngc")
    page.click("[data-rename]")
    page.fill(".dx-ask input", "new name.ngc")
    browsing.yes(page)
    page.wait_for_selector("tr[data-program='new name.ngc']")
    choose(page, "new name.ngc")
    page.click(".program-acts [data-kind=warn]")
    browsing.yes(page)
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
    found = programs.around(file, 150, 6)
    assert found[-2] == "   150  N150 G1 X150"
    assert found[-1].index("^") == found[-2].index("G1")
    assert len(found) == programs.SHOWN_BEFORE + 2


def test_a_place_beyond_the_end_of_the_text_shows_what_there_is(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_bytes(b"G1 \xff\n")
    assert programs.around(file, 9, 0) == []
    assert programs.around(file, 1, 0) == ["     1  G1 �"]


@pytest.mark.parametrize(
    ("count", "shown"),
    [(0, "0 B"), (999, "999 B"), (1000, "1.0 kB"), (2_500_000, "2.5 MB"), (3e12, "3000.0 GB")],
)
def test_sizes_are_told_in_the_unit_that_fits(count: int, shown: str) -> None:
    assert programs.size(count) == shown


@pytest.mark.parametrize(
    ("seconds", "shown"), [(None, "–"), (0.4, "0:00"), (67.7, "1:08"), (3725.0, "1:02:05")]
)
def test_times_are_told_as_a_clock_does(seconds: float | None, shown: str) -> None:
    assert programs.clock(seconds) == shown
