"""``directrix demo --panel``: one command, a simulated machine with its page, and nothing left behind."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from support.live import browser
from support.live.ports import free_port
from support.machines.stored_tools import StoredTools

from controller.cli import demo_panel
from controller.store.tool_store import Step

ENDS_S = 90.0  # no test is meant to come near


def test_its_changer_knows_what_it_holds_whatever_the_last_one_was_doing(tmp_path: Path) -> None:
    """Nobody could look into a simulated magazine, and confirm what is there before anything moves."""
    for _ in range(2):
        demo_panel.load_magazine(tmp_path)
        with contextlib.closing(StoredTools(tmp_path)) as store:
            assert store.known and store.spindle == 1 and store.places[2] == 2 and store.step is None
            store.begin(Step(1, 2, 5, "Let it go", carries=True, goes_to=1))
    demo_panel.load_magazine(tmp_path)
    with contextlib.closing(StoredTools(tmp_path)) as store:
        assert store.known and store.step is None


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.calm
def test_one_command_opens_a_machine_with_its_page_and_programs_and_ends_both(tmp_path: Path) -> None:
    port = free_port()
    command = (sys.executable, "-m", "controller", "demo", "--panel", "--port", str(port), "--json")
    demo = subprocess.Popen(
        (*command, "--out", str(tmp_path)),
        cwd=browser.ROOT,
        env={**os.environ, "PYTHONPATH": str(browser.ROOT)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert demo.stdout is not None
        url = json.loads(demo.stdout.readline())["url"]
        assert "/page/main.js" in asked(url)
        programs = json.loads(asked(f"{url}api/v1/programs"))["programs"]
        assert {one["name"] for one in programs} == {"example1_ready.ngc", "example2_ready.ngc"}
        browser.until(lambda: machine_answers(url), "the machine")
        browser.until(lambda: changer(url)["spindle"] == 1, "the tool that the simulated changer holds")
        assert not changer(url)["doubt"]
    finally:
        demo.send_signal(signal.SIGTERM)
        code = demo.wait(ENDS_S)
    assert code == 0
    with pytest.raises(OSError):
        asked(url)


def asked(url: str) -> str:
    with urllib.request.urlopen(url) as answer:
        return str(answer.read().decode())


def changer(url: str) -> dict[str, Any]:
    return dict(json.loads(asked(f"{url}api/v1/status"))["changer"])


def machine_answers(url: str) -> bool:
    """The service may come up after its panel."""
    with contextlib.suppress(OSError):
        return json.loads(asked(f"{url}api/v1/status"))["mode"] == "OFF"
    return False
