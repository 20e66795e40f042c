"""Maps of the cut surface on the page: what has which colour, and what full colour is."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.slow
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
    least = asked(page, "LEAST_UM")
    sharp = [surface([float(-k) for k in range(100)] + [-5000.0])]
    assert asked(page, "scale_um", sharp) == 99.0
    assert asked(page, "scale_um", [surface([0.0, 0.01, None])]) == least == 1
    assert asked(page, "scale_um", [surface([None])]) == least
