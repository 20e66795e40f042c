"""What 20 open pages cost the tick: its lateness with the pages in a browser, and without.

A machine as in a shop moves slowly; turns with and without the pages alternate in one
run, so both meet the same computer. The lateness of every tick comes from the recorder. The browser
runs at the lowest priority: in a shop it is another computer.

And how long a page takes from its address to the first figure of the machine, with nothing kept from before.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from panel import ENOUGH, NICE, PERIOD_S, lateness_s, percentiles, tick, told  # noqa: E402
from support.live import browser  # noqa: E402
from support.live.shop import Shop, opened  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.ipc.control_socket import Client, control_path  # noqa: E402

PAGES = 20
SETTLE_S = 2.0  # after the pages came or went
STATUSES_S = 20.0  # that each page is told
FIRST_S = 1.0  # until the first figure
OPENED = 10  # pages, one after another
FIGURE = "() => /[0-9]/.test(document.querySelector('.dro td.big')?.textContent ?? '') && performance.now()"
COUNT = "() => { window.heard = 0; dx.on('status', () => { window.heard += 1; }); }"


def come(pages: list[Any], shop: Shop) -> None:
    """Every page on a view, all views in turn, with its figures there."""
    for number, page in enumerate(pages):
        page.goto(f"{shop.url}/#{browser.VIEWS[number % len(browser.VIEWS)]}")
        page.wait_for_selector("section.view[data-shown] .card")
        page.wait_for_function("() => !dx.stale")
        page.evaluate(COUNT)


def go(pages: list[Any]) -> None:
    for page in pages:
        page.goto("about:blank")


def first_figure_s(chromium: Any, shop: Shop) -> float:
    """Seconds since the page began to load, by the browser's own clock."""
    context = chromium.new_context()
    page = context.new_page()
    page.goto(shop.url, wait_until="commit")
    found = page.wait_for_function(FIGURE).json_value()
    context.close()
    return float(found) / 1e3


def turn(shop: Shop, door: Client, seconds: float) -> tuple[np.ndarray, int]:
    """Lateness of every tick (s), and ticks that were skipped."""
    time.sleep(SETTLE_S)
    first = tick(shop)
    time.sleep(seconds)
    return lateness_s(door, first)


def measure(rounds: int, seconds: float, period_s: float, nice: int, count: int) -> dict[str, Any]:
    late: dict[str, list[np.ndarray]] = {"quiet": [], "pages": []}
    skips, heard = dict.fromkeys(late, 0), []
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder), period_s) as shop:
        shop.ready()
        shop.move_slowly()
        door = Client(control_path(shop.runtime))
        os.nice(nice)  # the browser inherits it, the machine does not
        with browser.browser() as chromium:
            first_s = [first_figure_s(chromium, shop) for _ in range(OPENED if count > 1 else 1)]
            pages = [chromium.new_page() for _ in range(count)]
            for number in range(2 * rounds):
                name = "pages" if number % 2 else "quiet"
                if number % 2:
                    come(pages, shop)
                began_s, before = time.monotonic(), _heard(pages) if number % 2 else 0.0
                found, skipped = turn(shop, door, seconds)
                late[name].append(found)
                skips[name] += skipped
                if number % 2:
                    heard.append((_heard(pages) - before) / (time.monotonic() - began_s) / count)
                    go(pages)
    return {
        "us": {name: percentiles(np.concatenate(values)) for name, values in late.items()},
        "skips": skips,
        "statuses per s and page": float(np.mean(heard)),
        "first figure": float(np.median(first_s)),
    }


def _heard(pages: list[Any]) -> float:
    return float(sum(page.evaluate("window.heard") for page in pages))


def report(short: bool) -> Report:
    rounds, seconds, count = (1, 0.5, 1) if short else (3, 10.0, PAGES)
    found = measure(rounds, seconds, PERIOD_S, NICE, count)
    statuses = Figure("statuses to each page", found["statuses per s and page"], "1/s", STATUSES_S, "told")
    first = Figure("first figure of a page", found["first figure"], "s", FIRST_S, "wanted")
    note = f"{count} pages; skips {found['skips']}"
    if statuses.value < ENOUGH * STATUSES_S:
        note += "; the pages were not told all: this computer has no time for so many, read it with care"
    return Report((*told(found, "pages"), statuses, first), note=note)


if __name__ == "__main__":
    figures.main(report)
