"""``/healthz`` and ``/readyz``: without log-in, nothing but ok or not."""

from __future__ import annotations

import asyncio
from pathlib import Path

from support.fakes.panels import Scene

from controller.api import health


def test_who_watches_needs_no_log_in_and_learns_nothing_but_ok_or_not(tmp_path: Path) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        async with scene.client(peer="10.0.0.7") as anybody:
            for there, status in ((False, 503), (True, 200)):
                scene.door.there = there
                alive, ready = await anybody.get(health.ALIVE), await anybody.get(health.READY)
                assert (alive.status_code, alive.json()) == (200, {"ok": True})
                assert (ready.status_code, ready.json()) == (status, {"ok": there})

    asyncio.run(story())
