"""What a simulated machine at rest costs, with its page open: processor time of each of its processes.

A machine as in a shop (``serve --simulate`` and ``panel``) stands with its drives off, then with its drives
on, then after a program, while a page in a headless browser looks on. The browser is not counted: in a
shop it is another computer. What the page asks of the panel is. Others on the same hardware make all of it
dearer and nothing cheaper: of some turns in each state the cheapest is told.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from memory import PERIOD_S, called, cpu_s, tree  # noqa: E402
from support.live import browser  # noqa: E402
from support.live.shop import Shop, opened  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

WANTED = 10.0  # % of a core, issue by issue
SETTLE_S = 3.0  # after a change
TURNS = 3  # in each state
PROGRAM = b"G21 G90\nG1 X1 F600\nX0\nM30\n"


def used(shop: Shop, seconds: float) -> dict[str, float]:
    """Per cent of a core by process."""
    every = [pid for one in shop.processes.values() for pid in tree(one.pid)]
    names = {pid: called(pid, every) for pid in every}
    before, began_s = {pid: cpu_s(pid) for pid in every}, time.monotonic()
    time.sleep(seconds)
    lasted_s = time.monotonic() - began_s
    return {names[pid]: 100.0 * (cpu_s(pid) - before[pid]) / lasted_s for pid in every}


def cut(shop: Shop) -> None:
    """A program from start to end."""
    shop.upload("short.ngc", PROGRAM)
    shop.do("POST", "/job", json={"program": "short.ngc"})
    shop.do("POST", "/cycle/start")
    shop.run_record()


def report(short: bool) -> Report:
    seconds, settle_s = (2.0, 0.5) if short else (30.0, SETTLE_S)
    found: dict[str, dict[str, float]] = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        opened(Path(folder), PERIOD_S) as shop,
        browser.browser() as chromium,
    ):
        shop.up()
        page = chromium.new_page()
        page.goto(shop.url)
        page.wait_for_function("() => !dx.stale && dx.all_views")
        for state, begin in (("off", shop.up), ("on", shop.ready), ("after a program", lambda: cut(shop))):
            begin()
            time.sleep(settle_s)
            turns = [used(shop, seconds / TURNS) for _ in range(TURNS)]
            found[state] = min(turns, key=lambda shares: sum(shares.values()))
    rows = [
        Figure(f"{state}: {name}", share, "% of a core")
        for state, shares in found.items()
        for name, share in shares.items()
    ]
    rows += [
        Figure(f"{state}: all", sum(shares.values()), "% of a core", WANTED, "wanted", at_most=WANTED)
        for state, shares in found.items()
    ]
    return Report(tuple(rows), figures.shares(found["on"]), "the machine with its drives on")


if __name__ == "__main__":
    figures.main(report)
