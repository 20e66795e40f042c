"""Maps of the cut surface on the page: what has which colour, and what full colour is."""

from __future__ import annotations

from typing import Any

import pytest
from support.live.browser import Site

pytestmark = pytest.mark.slow
UPLOAD = """() => { const form = new FormData();
  form.append("file", new File(["G21 (TOO DEEP)\\nG1 X1 F100\\nM2\\n"], "deep.ngc"));
  const sent = {method: "POST", body: form, headers: dx.headers()};
  return fetch("/api/v1/programs", sent).then((answer) => answer.status); }"""
ASKED = """async ([name, ...given]) => {
  const maps = await import("/page/maps.js");
  return typeof maps[name] === "function" ? maps[name](...given) : maps[name];
}"""


def asked(page: Any, name: str, *given: object) -> Any:
    return page.evaluate(ASKED, [name, *given])


def surface(row: list[float | None]) -> dict[str, object]:
    return {"line": 1, "overcut_mm": 0.0, "undercut_mm": 0.0, "map_um": [row]}


def test_overcut_is_red_undercut_blue_and_what_is_not_cut_is_open(page: Any) -> None:
    gradient = asked(page, "colours", [-50.0, 0.0, 50.0, None, -500.0], 50.0)
    red, blue, none = (
        f"rgb({', '.join(str(part) for part in asked(page, name))})" for name in ("OVER", "UNDER", "NONE")
    )
    assert gradient == f"linear-gradient(to right, {red}, {none}, {blue}, transparent, {red})"
    assert red == "rgb(211, 34, 42)" and blue == "rgb(29, 111, 165)"


def test_full_colour_leaves_a_single_sharp_edge_out_and_is_never_less_than_a_micrometre(page: Any) -> None:
    least = asked(page, "MIN_UM")
    sharp = [surface([float(-k) for k in range(100)] + [-5000.0])]
    assert asked(page, "scale_um", sharp) == 99.0
    assert asked(page, "scale_um", [surface([0.0, 0.01, None])]) == least == 1
    assert asked(page, "scale_um", [surface([None])]) == least


def test_the_contour_lies_where_the_amount_is_the_tolerance_on_either_side(page: Any) -> None:
    rows = [[0.0, -20.0, 40.0], [0.0, -20.0, 40.0]]
    assert asked(page, "contour", rows, 10.0) == "M0.5 0L0.5 1"
    assert asked(page, "contour", rows, 30.0) == "M1.5 0L1.5 1"
    assert asked(page, "contour", [[0.0, None], [50.0, 50.0]], 30.0) == "", "what is not cut has no edge"
    assert asked(page, "contour", rows, 50.0) == ""


def test_a_map_has_its_axes_in_mm_and_a_share_over_its_limit_a_word(page: Any, site: Site) -> None:
    assert page.evaluate(UPLOAD) in (201, 409)
    page.evaluate("dx.show('programs')")
    page.click("tr[data-program='deep.ngc']")
    page.wait_for_selector(".map-box .contour", state="attached")
    axes = page.locator(".map-box").first.locator(".map-axis").all_inner_texts()
    assert [one.split() for one in axes] == [
        ["0", "10.4", "mm"],
        ["0.0", "mm", "12.1", "mm", "24.9", "mm", "38.0", "mm", "50.5", "mm"],
    ]
    assert "tolerance of 50 µm" in page.inner_text(".programs-detail")
    assert page.inner_text(".box td.wrong >> nth=0") == "102 % over the limit"
