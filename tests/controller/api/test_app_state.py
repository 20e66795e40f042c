"""What the panel does by itself, besides answering."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path

import pytest
from support.fakes.panels import Scene

from controller.api import app_state
from controller.api.store import StoreError

TIMEOUT_S = 20.0


@pytest.mark.parametrize(
    ("error", "told"), [(RuntimeError("a mistake"), True), (StoreError("store", "The disk is away."), False)]
)
def test_what_the_panel_does_by_itself_goes_on_after_any_mistake(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    error: Exception,
    told: bool,
) -> None:
    monkeypatch.setattr(app_state, "AGAIN_S", 0.0)
    monkeypatch.setattr(app_state, "POLL_S", 0.0)
    scene, looks = Scene(tmp_path), 0

    async def look() -> None:
        nonlocal looks
        looks += 1
        if looks == 1:
            raise error

    async def story() -> None:
        async with scene.panel.running(), asyncio.timeout(TIMEOUT_S):
            while looks < 3:
                await asyncio.sleep(0.001)

    monkeypatch.setattr(scene.panel, "_report_losses", look)
    with caplog.at_level(logging.ERROR):
        asyncio.run(story())
    assert ("a mistake" in caplog.text) is told
