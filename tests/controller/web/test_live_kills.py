"""The tick is killed in a cut, on a machine that runs in real time: no figure of the page is lost by it."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest
from support.live import browser, live_page, shop

from controller.ipc.control_socket import Client, control_path
from controller.machine import machine_file

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

NAME = "example2_ready.ngc"
AS_TOLD = """() => {
  const { joints, job, in_block } = dx.status;
  return {
    axes: Object.values(joints).map(({ work }) => work),
    place: [job.line, job.block, in_block.fraction, in_block.u],
    times: [job.elapsed_s, job.left_s, job.duration_s],
  };
}"""


@pytest.fixture
def page(chromium: Any) -> Any:
    return chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")


def whole(page: Any) -> dict[str, Any]:
    """The page's figures, of which none is missing; the machine's own numbers are behind them."""
    page.wait_for_selector(".listing .now")
    told, shown = browser.until(lambda: drawn(page), "the last status to be drawn")
    assert len(told["axes"]) == 5 and 0.0 < told["place"][3] < 1.0, told
    assert all(type(one) in (int, float) for group in told.values() for one in group), told
    assert [float(one) for one in shown["axes"]] == [round(abs(one), 3) for one in told["axes"]]
    assert shown["place"][:2] == [str(one) for one in told["place"][:2]]
    assert shown["place"][3] == f"{told['place'][3]:.4f}"
    assert all(":" in time and "–" not in time for time in shown["times"]), shown
    assert "N50" in shown["line"] and 0.0 < shown["share"] < 1.0, shown
    found: dict[str, Any] = shown
    return found


def drawn(page: Any) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """What the page was told and what it shows, once that is the same place: it draws a moment later."""
    told, shown = page.evaluate(AS_TOLD), page.evaluate(browser.FIGURES_OF_RUN)
    u = told["place"][3]
    return (told, shown) if u is None or shown["place"][3:] == [f"{u:.4f}"] else None


def test_no_figure_is_missing_after_the_tick_is_killed_in_a_cut_and_a_reload(
    page: Any, tmp_path: Path
) -> None:
    with shop.opened(tmp_path, machine="shop") as running:
        running.ready()
        running.put_in(4)
        running.upload(NAME, machine_file.shipped_program(NAME).read_bytes())
        running.do("POST", "/job", json={"program": NAME})
        running.do("POST", "/cycle/start")
        with live_page.page(page, running) as seen:
            live_page.wait(seen, "dx.status.in_block?.u > 0.2")
            pid = Client(control_path(running.runtime)).ask("facts")["pids"]["tick"]
            os.kill(pid, signal.SIGKILL)
            seen.wait_for_selector(".line.alarm:visible")
            seen.wait_for_function("() => dx.status.mode === 'FAULT' && dx.stale")
            killed = whole(seen)
            assert "process is gone" in killed["alarm"] and killed["stale"], killed
            seen.reload()
            seen.wait_for_function("() => window.dx?.status && dx.stale")
            assert whole(seen) == killed
            seen.wait_for_selector("body[data-control=mine]")
            seen.click("[data-call='POST machine/reset']:not([aria-disabled=true])")
            seen.wait_for_function("() => !dx.stale && !dx.status.fault")
            seen.wait_for_function("() => Object.values(dx.status.joints).every(({ work }) => work !== null)")
            seen.wait_for_selector(".offer")
            after = whole(seen)
            assert after["place"][:2] == killed["place"][:2] and not after["alarm"].strip()
