"""Maps of the cut surface on the page: what has which colour, and what full colour is."""

from __future__ import annotations

from controller.panel.page import cut_maps


def surface(row: list[float | None]) -> dict[str, object]:
    return {"line": 1, "overcut_mm": 0.0, "undercut_mm": 0.0, "map_um": [row]}


def test_overcut_is_red_undercut_blue_and_what_is_not_cut_is_open() -> None:
    gradient = cut_maps.colours([-50.0, 0.0, 50.0, None, -500.0], 50.0)
    red, blue, none = (
        f"#{r:02x}{g:02x}{b:02x}" for r, g, b in (cut_maps.OVER, cut_maps.UNDER, cut_maps.NONE)
    )
    assert gradient == f"linear-gradient(to right, {red}, {none}, {blue}, transparent, {red})"


def test_full_colour_leaves_a_single_sharp_edge_out_and_is_never_less_than_a_micrometre() -> None:
    assert cut_maps.scale_um([surface([float(-k) for k in range(100)] + [-5000.0])]) == 99.0
    assert cut_maps.scale_um([surface([0.0, 0.01, None])]) == cut_maps.LEAST_UM
    assert cut_maps.scale_um([surface([None])]) == cut_maps.LEAST_UM
