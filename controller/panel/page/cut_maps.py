"""Maps of the cut surfaces: how far each is off, as rows of colour with the figures beside them."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from controller.panel.page.view import Page, tagged, text
from controller.panel.page.words import Words

WORDS: Words = {
    "maps.title": ("Surfaces as cut", "Flächen, wie geschnitten"),
    "maps.surface": ("Line {0}", "Zeile {0}"),
    "maps.over": ("overcut {0} µm", "{0} µm zu tief"),
    "maps.under": ("undercut {0} µm", "{0} µm stehen gelassen"),
    "maps.worst": ("worst at u {0}, v {1}", "am meisten bei u {0}, v {1}"),
    "maps.scale": (
        "Red: too deep, blue: left standing, full colour at {0} µm. Along: u, down: v, the upper edge first.",
        "Rot: zu tief, blau: stehen gelassen, voll bei {0} µm. Waagrecht u, senkrecht v, die Oberkante oben.",
    ),
    "maps.more": ("{0} more surfaces: directrix verify", "{0} weitere Flächen: directrix verify"),
}
MOST = 12  # maps on the screen: of the surfaces that are off most
LEAST_UM = 1.0  # full colour at no less
OVER, UNDER, NONE = (211, 34, 42), (29, 111, 165), (190, 198, 205)  # red, blue, between


def form(page: Page, verdict: dict[str, Any] | None) -> None:
    """Whether the surfaces keep their tolerance: one sentence, in colour where they do not."""
    if not verdict:
        return
    sentence = str(verdict["sentence_de" if page.language == "de" else "sentence"])
    if verdict["within"]:
        text(sentence, "p", "note")
    else:
        tagged(text(sentence, "p", "wrong"), role="alert")


def cut_maps(page: Page, verified: dict[str, Any]) -> None:
    """The surfaces that are off most, in the program's order; nothing where nothing was verified."""
    surfaces = list(verified.get("surfaces") or ())
    if not surfaces:
        return
    shown = sorted(surfaces, key=_off, reverse=True)[:MOST]
    full_um = scale_um(shown)
    text(page.word("maps.title"), "h2")
    for one in surfaces:
        if one in shown:
            _surface(page, one, full_um)
    text(page.word("maps.scale").format(f"{full_um:.0f}"), "p", "dim note")
    if more := len(surfaces) - len(shown) + int(verified.get("left_out") or 0):
        text(page.word("maps.more").format(more), "p", "dim note")


def scale_um(surfaces: list[dict[str, Any]]) -> float:
    """What has full colour: all but the outermost hundredth of the points lies below it."""
    amounts = sorted(abs(t) for one in surfaces for row in one["map_um"] for t in row if t is not None)
    return max(LEAST_UM, amounts[int(0.99 * (len(amounts) - 1))]) if amounts else LEAST_UM


def colours(row: list[float | None], full_um: float) -> str:
    """One row of a map as a CSS gradient; what is not cut is left open."""
    return f"linear-gradient(to right, {', '.join(_colour(t, full_um) for t in row)})"


def _colour(um: float | None, full_um: float) -> str:
    if um is None:
        return "transparent"
    share, end = min(1.0, abs(um) / full_um), OVER if um < 0.0 else UNDER
    red, green, blue = (round(a + share * (b - a)) for a, b in zip(NONE, end, strict=True))
    return f"#{red:02x}{green:02x}{blue:02x}"


def _off(one: dict[str, Any]) -> float:
    return max(float(one["overcut_mm"]), float(one["undercut_mm"]))


def _surface(page: Page, one: dict[str, Any], full_um: float) -> None:
    words = ", ".join(_words(page, one))
    text(words, "p", "figures note")
    box = ui.element("div").style("border: 1px solid var(--line); border-radius: 4px; overflow: hidden")
    tagged(box, role="img", aria_label=words, data_map=str(one["line"]))
    with box:
        for row in one["map_um"]:
            ui.element("div").style(f"height: 0.5rem; background: {colours(row, full_um)}")


def _words(page: Page, one: dict[str, Any]) -> list[str]:
    """``Line 10: overcut 17.9 µm, ...`` in parts."""
    over, under = (f"{1e3 * one[name]:.1f}" for name in ("overcut_mm", "undercut_mm"))
    line = page.word("maps.surface").format(one["line"])
    told = [f"{line}: {page.word('maps.over').format(over)}", page.word("maps.under").format(under)]
    if one.get("overcut_at"):
        u, v = one["overcut_at"]
        told.append(page.word("maps.worst").format(f"{u:.3f}", f"{v:.2f}"))
    return told
