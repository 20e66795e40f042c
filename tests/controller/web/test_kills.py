"""No figure on the page is missing after a kill of service or panel, and a reload; what is old says so."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes import cutting_service as cut
from support.live import browser
from support.live.ports import free_port

from controller.ipc.control_socket import LAST
from controller.machine import machine_file

pytestmark = pytest.mark.slow

PLACE = (str(cut.LINE), str(cut.BLOCK), "25 %", "0.2500")
TIMES = ("0:29", "0:50", "1:15")  # elapsed, left, in all


class Shop:
    """A service in a cut and the panel before it, as processes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.start_service()
        browser.until((folder / "state" / LAST).exists, "what the service keeps")
        where = ("--state", str(folder / "state"), "--runtime", str(folder))
        port = free_port()
        self.panel = browser.Site(folder, ("-m", "controller", "panel", "--port", str(port), *where), port)

    def start_service(self) -> None:
        command = [sys.executable, cut.__file__, str(self.folder)]
        path = os.pathsep.join((str(browser.ROOT), str(browser.ROOT / "tests")))
        self.service = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path})

    def kill_service(self) -> None:
        self.service.send_signal(signal.SIGKILL)
        self.service.wait()


@pytest.fixture
def shop(chromium: Any, tmp_path: Path) -> Iterator[Shop]:
    made = Shop(tmp_path)
    yield made
    made.kill_service()
    made.panel.end()


@pytest.fixture
def page(chromium: Any, shop: Shop) -> Any:
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")
    bring(context.request, f"{shop.panel.url}api/v1")
    return browser.opened(context, shop.panel)


def bring(request: Any, api: str) -> None:
    text = machine_file.shipped_program(cut.NAME).read_bytes()
    file = {"name": cut.NAME, "mimeType": "text/plain", "buffer": text}
    assert request.post(f"{api}/programs", multipart={"file": file}).ok


def shown(page: Any, *, stale: bool) -> dict[str, Any]:
    """The page with all its figures: axes, place, times."""
    page.wait_for_function("([stale]) => window.dx?.status && dx.stale === stale", arg=[stale])
    page.wait_for_selector(".listing .now")
    found: dict[str, Any] = page.evaluate(browser.FIGURES_OF_RUN)
    assert len(found["axes"]) == 5 and all(found["axes"]), found
    assert tuple(found["place"]) == PLACE and tuple(found["times"]) == TIMES, found
    assert found["share"] == pytest.approx(25 / 75) and "N50 G51" in found["line"]
    assert found["stale"] is stale
    return found


def test_no_figure_is_missing_after_kills_and_reloads(shop: Shop, page: Any) -> None:
    before = shown(page, stale=False)
    shop.kill_service()
    page.wait_for_selector(".line.alarm:has-text('service is gone')")
    assert page.evaluate("dx.status.mode") == "FAULT"
    assert shown(page, stale=True)["axes"] == before["axes"]
    page.reload()
    killed = shown(page, stale=True)
    assert killed["axes"] == before["axes"] and "service is gone" in killed["alarm"]
    shop.panel.end()
    shop.panel.start()
    page.reload()
    assert shown(page, stale=True) == killed
    shop.start_service()
    after = shown(page, stale=False)
    page.reload()
    assert shown(page, stale=False) == after and not after["alarm"].strip()
    page.wait_for_selector(".offer:has-text('line 8, 25.0 %')")
    assert page.is_visible("#run-empty") and page.evaluate("dx.status.job.state") == "interrupted"
    browser.take_control(page)
    page.wait_for_selector("[data-call='POST cycle/start'][title='Load a program first.']")
    assert page.errors == []
