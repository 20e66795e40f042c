"""A page that stays open on a running machine holds its memory, and so does the panel.

DIRECTRIX_SOAK_MIN=15 pytest -m soak tests/controller/web/test_live_memory.py -s
"""

from __future__ import annotations

import os
import re
import time
from pathlib import Path
from typing import Any

import pytest
from support.live import browser, live_page, shop

pytestmark = pytest.mark.soak

MINUTES = float(os.environ.get("DIRECTRIX_SOAK_MIN", "60"))
WARM_S = 120.0  # every view has been there, and figures of a minute are full
EVERY_S = 15.0  # another view
GROWTH = 1.2
RUNS_PER_MIN = 0.2  # at least: the part takes about a minute
PERIOD_S = 0.01
PART = b"G21 G90 G54\n" + b"G1 X40. Y10. F900\nG1 X-40. Y-10. A20. F900\nG1 X0 Y0 A0 F900\n" * 6 + b"M30\n"


def test_an_open_page_holds_its_memory(chromium: Any, tmp_path: Path) -> None:
    with shop.opened(tmp_path, PERIOD_S) as running:
        running.ready()
        running.upload("part.ngc", PART)
        with live_page.page(chromium.new_context(), running, control=False) as page:
            first = looked_at(page, running, WARM_S)
            last, left_s = first, MINUTES * 60.0
            while left_s > 0.0:
                last = looked_at(page, running, min(left_s, WARM_S))
                left_s -= WARM_S
        assert len(running.do("GET", "/runs")["runs"]) > RUNS_PER_MIN * MINUTES
        for name in ("heap, MB", "panel, MB"):
            assert last[name] <= GROWTH * first[name], (name, first, last)


def looked_at(page: Any, running: shop.Shop, seconds: float) -> dict[str, float]:
    """What page and panel hold after all views have been looked at for a while."""
    end_s, turn = time.monotonic() + seconds, 0
    while time.monotonic() < end_s:
        page.evaluate(f"dx.show('{browser.VIEWS[turn % len(browser.VIEWS)]}')")
        turn += 1
        page.wait_for_timeout(min(EVERY_S, seconds / len(browser.VIEWS)) * 1000.0)
        keep_running(running)
    page.evaluate("dx.show('run')")
    found = memory(page, running.processes["panel"].pid)
    print({name: round(value, 1) for name, value in found.items()}, flush=True)
    return found


def keep_running(running: shop.Shop) -> None:
    """A step towards the next run, whatever a busy computer has made of the last one.

    What is refused, or not done yet, is asked for again at the next look.
    """
    now = running.status()
    if now["mode"] == "FAULT":
        running.http.post("/machine/reset")
    elif now["mode"] == "OFF" and now["not_homed"]:
        running.http.post("/machine/home", json={})
    elif now["mode"] == "OFF":
        running.http.post("/machine/enable")
    elif now["mode"] == "READY" and now["at_rest"]:
        running.http.post("/job", json={"program": "part.ngc"})
        running.http.post("/cycle/start")


def memory(page: Any, pid: int) -> dict[str, float]:
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.enable")
    session.send("HeapProfiler.collectGarbage")
    session.send("Performance.enable")
    told = {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}
    session.detach()
    status = Path(f"/proc/{pid}/status").read_text()
    found = re.search(r"VmRSS:\s+(\d+) kB", status)
    assert found is not None
    return {
        "heap, MB": told["JSHeapUsedSize"] / 1e6,
        "panel, MB": int(found[1]) / 1e3,
        "nodes": told["Nodes"],
        "listeners": told["JSEventListeners"],
    }
