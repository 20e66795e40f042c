"""A step of a bring-up is conducted by a worker, which asks the panel as whoever began the step."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from support.fakes.panels import Scene, take_control

from controller.machine import machine_file, setup_data


@pytest.mark.parametrize("by_tls", [False, True])
def test_the_worker_comes_by_the_panel_s_own_door_and_not_by_that_of_a_proxy(
    by_tls: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A proxy that does TLS says https of what it hands on, and the panel behind it does none."""
    jobs = list[Mapping[str, Any]]()

    async def begin(job: Mapping[str, Any]) -> None:
        jobs.append(job)

    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        setup_data.note(tmp_path, machine_file.load("trunnion"))
        scene.panel.by_tls = by_tls
        monkeypatch.setattr(scene.panel.bring_up, "begin", begin)
        async with scene.client("set_up", url="https://shop.example") as client:
            await take_control(client)
            assert (await client.post("/api/v1/bring-up/scale.X", json={})).status_code == 200

    asyncio.run(story())
    (job,) = jobs
    assert job["url"].startswith("https://" if by_tls else "http://")
    assert job["headers"]["authorization"] and job["headers"]["x-control-token"]
