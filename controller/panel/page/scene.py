"""The view in three dimensions: part, path, tool and rotaries, as the machine tells where they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.elements.scene.scene_object3d import Object3D

from controller.panel.page.view import Page, live, row, tagged, text
from controller.panel.page.words import Words

NAME, ICON, STYLE = "scene", "view_in_ar", "looks.css"
WORDS: Words = {
    "view.scene": ("3-D", "3-D"),
    "scene.part": ("Part stands", "Teil steht"),
    "scene.machine": ("Machine stands", "Maschine steht"),
    "scene.iso": ("Oblique", "Schräg"),
    "scene.top": ("Top", "Oben"),
    "scene.front": ("Front", "Vorn"),
    "scene.side": ("Side", "Seite"),
    "scene.clear": ("Clear the trail", "Spur löschen"),
    "scene.done": ("done", "gefahren"),
    "scene.ahead": ("ahead", "folgt"),
    "scene.rapid": ("rapid", "Eilgang"),
    "scene.trail": ("trail", "Spur"),
    "scene.picture": ("The machine in three dimensions", "Die Maschine in drei Dimensionen"),
}
FPS = 40  # looks for a change, on a screen of 60 Hz every 33 ms: no status of 20 a second is passed over
LOOKS = ("iso", "top", "front", "side")
KEYS = (("done", "--go"), ("ahead", "--text"), ("rapid", "--dim"), ("trail", "--hold"))
FAR_MM = 20_000.0


class MachinePicture(Object3D, component=Path(__file__).parent / "static" / "machine_picture.js"):
    """Everything that is drawn; it moves by itself, see its script."""

    def __init__(self, scene: str, facts: dict[str, Any]) -> None:
        """``scene``: id of the element in the browser."""
        super().__init__(scene, facts)


def build(page: Page) -> None:
    """Make the view."""
    camera = ui.scene.perspective_camera(fov=40, near=1.0, far=FAR_MM)
    with ui.element("div").classes("looks scene"), ui.element("div").classes("card scene-card"):
        scene = ui.scene(grid=False, camera=camera, fps=FPS)
        tagged(scene, aria_label=page.word("scene.picture"), role="img")
        with scene:
            MachinePicture(str(scene.id), _facts(page))
        _tools(page)
        with ui.element("div").classes("scene-said"):
            for axis in "XYZ":
                with ui.element("span"):
                    text(f"{axis} ", "span", "dim")
                    live(f"tip.{axis}", "mm")
            for key, colour in KEYS:
                with ui.element("span").classes("key dim"):
                    ui.element("i").style(f"--colour: var({colour})")
                    text(page.word(f"scene.{key}"), "span")
            tagged(ui.element("span").classes("dim"), id="scene-said")
    ui.run_javascript("dx.tell('built', 'scene')")


def _facts(page: Page) -> dict[str, Any]:
    """What the picture is made of."""
    return {name: page.facts.get(name) for name in ("axes", "offsets", "tools")}


def _tools(page: Page) -> None:
    with row("scene-tools"):
        for frame in ("part", "machine"):
            button = tagged(ui.element("button").classes("act"), type="button", data_scene=f"frame {frame}")
            with tagged(button, aria_pressed=str(frame == "part").lower()):
                text(page.word(f"scene.{frame}"), "span")
        for look in LOOKS:
            button = tagged(ui.element("button").classes("act"), type="button", data_scene=f"look {look}")
            with button:
                text(page.word(f"scene.{look}"), "span")
        with tagged(ui.element("button").classes("act"), type="button", data_scene="clear"):
            text(page.word("scene.clear"), "span")
