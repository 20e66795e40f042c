"""A queue goes through on a machine that runs, and what was cut by it is counted, also over a kill."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.live import shop
from support.live.shop import Shop

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

TEXT = "G21 G90 G54\nG1 X{0} F3000\nG1 X0\nM30\n"


def put(running: Shop, name: str, mm: float, count: int) -> None:
    files = {"file": (name, TEXT.format(mm).encode())}
    running.do("POST", "/programs", data={"name": f"queue/{name}"}, files=files)
    running.do("POST", "/queue", json={"program": f"queue/{name}", "count": count})


def told(running: Shop, path: str) -> Any:
    return running.http.get(path).json()


def counts(running: Shop) -> list[int]:
    return [one["done"] for one in told(running, "/queue")["entries"]]


def travel(running: Shop) -> float:
    return next(float(one["value"]) for one in told(running, "/usage")["counters"] if one["name"] == "X")


def test_what_is_queued_runs_through_and_is_counted(tmp_path: Path) -> None:
    with shop.opened(tmp_path) as running:
        running.ready()
        put(running, "a.ngc", 10.0, 2)
        put(running, "b.ngc", 5.0, 1)
        running.do("POST", "/queue/load")
        before = travel(running)
        running.do("PUT", "/queue/go_on", json={"on": True})
        running.do("POST", "/cycle/start")
        running.until(lambda _: heard(running) and counts(running) == [2, 1], "all of it")
        queue = told(running, "/queue")
        assert (queue["go_on"], queue["sentence"]) == (False, "The queue is done.")
        done = [(run["program"], run["result"]) for run in told(running, "/runs")["runs"]]
        assert done == [(f"queue/{name}.ngc", "completed") for name in ("b", "a", "a")]
        gone_m = travel(running) - before
        assert gone_m >= 0.045
        use = told(running, "/usage")["tools"]
        assert [(one["number"], one["parts"]) for one in use] == [(1, 3)]
        assert use[0]["cut_s"] > 0.5
        running.kill("panel")
        running.until(bool, "the panel")
        assert counts(running) == [2, 1]
        kept = travel(running)
        running.do("PUT", "/usage/tools/1", json={"parts": 3})
        running.kill("serve")
        running.ready()
        assert travel(running) >= kept
        running.do("POST", "/job", json={"program": "queue/a.ngc"})
        assert "T1, is worn" in running.refused("POST", "/cycle/start", 409)["sentence"]


def heard(running: Shop) -> bool:
    """As a page that holds control is."""
    return running.http.get("/control").is_success
