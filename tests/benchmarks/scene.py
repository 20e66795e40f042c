"""What a program of 100 000 lines costs the 3-D view: pictures a second, bytes, and time to load.

A machine on the stepped clock moves at every status, so each of them wants another picture. Turns with
the program's path in the scene and without it alternate in one page, so both meet the same computer; what
is loaded is the shipped Example 2 and then the long program. A browser without a graphics card draws on the
processor: there the empty scene tells what this computer can do, and the share of it is the figure.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.live import browser  # noqa: E402
from support.parts import cam_lines  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.machine import machine_file  # noqa: E402
from controller.plan.report.picture import Picture, Shape  # noqa: E402
from controller.runtime import checked  # noqa: E402

LONG = "long"
WIDTH, HEIGHT = 1280, 720
WAITS_MS = 300_000
# What is counted while the page is left alone: pictures, statuses, and the time that each takes of the page.
WATCHED = """() => {
  const { renderer } = getElement(dxScene.scene);
  const [draw, move] = [renderer.render, dxScene.status.bind(dxScene)];
  const timed = (work, into, counts) => (...all) => {
    const [began, before] = [performance.now(), dxScene.drawn];
    work(...all);
    if (counts() !== before || into === "moves") window.seen[into].push(performance.now() - began);
  };
  window.seen = { draws: [], moves: [] };
  renderer.render = timed(draw, "draws", () => dxScene.drawn);
  dxScene.status = timed(move, "moves", () => dxScene.drawn);
}"""
EMPTIED = """(empty) => {
  if (empty) [dxScene.kept, dxScene.shape] = [dxScene.shape, null];
  else dxScene.shape = dxScene.kept;
  dxScene.part.visible = !empty;
  window.seen = { draws: [], moves: [] };
}"""


def shape(lines: int) -> Shape:
    """Of a program of five-axis lines, as its check leaves it."""
    machine = machine_file.load("trunnion")
    text = "".join(cam_lines.program(cam_lines.places(lines), False, "G21 G90 G61"))
    task = checked.task(text.encode(), "long.ngc", machine)
    picture = Picture(machine, task.kinematics)
    for _ in picture.watched(checked.path_of(task, None).items):
        pass
    return picture.shape()


def loaded(page: Any, site: browser.Site) -> dict[str, float]:
    """From the address to the first picture with the path in it; what came for it."""
    with page.expect_response("**/picture", timeout=WAITS_MS) as waiting:
        began_s = time.monotonic()
        page.goto(f"{site.url}#scene")
    page.wait_for_function("() => window.dxScene?.shape && dxScene.drawn > 0", timeout=WAITS_MS)
    took_s = time.monotonic() - began_s
    points = page.evaluate("dxScene.shape.tips.length")
    size = len(waiting.value.body())
    page.goto("about:blank")
    return {"s": took_s, "bytes": size, "points": points}


def turn(page: Any, seconds: float, empty: bool) -> dict[str, Any]:
    """Times (ms) of the pictures and of the statuses in so many seconds."""
    page.evaluate(EMPTIED, empty)
    began_s = time.monotonic()
    page.wait_for_timeout(seconds * 1e3)
    seen: dict[str, Any] = page.evaluate("window.seen")
    return {**seen, "seconds": time.monotonic() - began_s}


def measure(lines: int, rounds: int, seconds: float, width: int, height: int) -> dict[str, Any]:
    """All figures, as plain values."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with browser.fake_site(folder, "stepped_site") as site, browser.browser() as chromium:
            page = chromium.new_page(viewport={"width": width, "height": height})
            short = loaded(page, site)
            shape(lines).save(folder / "panel" / "pictures" / f"{LONG}.npz")
            (folder / "picture").write_text(LONG)
            long = loaded(page, site)
            page.goto(f"{site.url}#scene")
            page.wait_for_function("() => window.dxScene?.shape && dxScene.drawn > 0", timeout=WAITS_MS)
            page.evaluate(WATCHED)
            turns = [(turn(page, seconds, empty), empty) for _ in range(rounds) for empty in (True, False)]
    found = {
        name: summed([one for one, empty in turns if empty == wanted])
        for name, wanted in (("empty", True), ("program", False))
    }
    return {"lines": lines, "loading": {"Example 2": short, "long": long}, "drawing": found}


def summed(turns: list[dict[str, Any]]) -> dict[str, float]:
    """Of all turns of a kind."""
    seconds = sum(one["seconds"] for one in turns)
    draws, moves = ([ms for one in turns for ms in one[name]] for name in ("draws", "moves"))
    return {
        "pictures per s": len(draws) / seconds,
        "statuses per s": len(moves) / seconds,
        "ms of a picture": float(np.median(draws)) if draws else 0.0,
        "ms of a status": float(np.median(moves)) if moves else 0.0,
        "ms of the slowest status": max(moves, default=0.0),
    }


def report(short: bool) -> Report:
    lines, rounds, seconds = (500, 1, 0.5) if short else (100_000, 3, 10.0)
    found = measure(lines, rounds, seconds, WIDTH, HEIGHT)
    short_one, long_one = found["loading"]["Example 2"], found["loading"]["long"]
    empty, program = found["drawing"]["empty"], found["drawing"]["program"]
    told = [
        Figure(f"loading {lines} lines", long_one["s"], "s", short_one["s"], "Example 2"),
        Figure(f"bytes of {lines} lines", long_one["bytes"], "bytes", short_one["bytes"], "Example 2"),
        *(Figure(name, program[name], "", empty[name], "empty scene") for name in empty),
    ]
    return Report(tuple(told))


if __name__ == "__main__":
    figures.main(report)
