"""One line on what the machine is doing now: feed programmed and actual, and what limits it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from controller.state import Binding, binding_text

FEED = binding_text(Binding.FEED, ())  # what is programmed is no limit


def live_line(now: Mapping[str, Any]) -> str:
    """Of a status. For instance ``line 8: F 1000, actual 873 mm/min, limited by C acceleration``."""
    if now["mode"] != "RUNNING" or not now["in_block"]:
        return str(now["mode"]).lower()
    line = now["job"]["line"]
    if now["waiting"]:
        return f"line {line}: waiting for {_awaited(now['spindle'])}"
    feed = now["feed_mm_min"]
    share = 1.0 if now["own_feed"] else now["override"]
    wanted = "rapid" if feed["programmed"] is None else f"F {feed['programmed'] * share:.0f}"
    limit = f", limited by {now['limited_by']}" if now["limited_by"] not in (None, FEED) else ""
    return f"line {line}: {wanted}, actual {feed['actual']:.0f} mm/min{limit}"


def _awaited(spindle: Mapping[str, Any]) -> str:
    """What motion stands for."""
    if spindle["at_speed"]:
        return "coolant and clamps"
    return f"the spindle: S {spindle['rev_min']:.0f}, actual {spindle['actual_rev_min']:.0f} 1/min"
