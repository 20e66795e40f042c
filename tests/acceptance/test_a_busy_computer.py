"""A computer whose cores are all busy with other work loses no cut: late ticks are counted and shown.

Simulated drives take no harm from a tick that comes late (``late = "count"``); what is queued needs
nothing of the plan. One process at normal priority spins for each core meanwhile.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from support.live.shop import Shop, Values, opened

from controller.machine import machine_file

SPIN = "while True: pass"
PERIOD_S = 0.005
TIMES = 20  # of each, by hand; one of the first is drawn by .ci/run
EXAMPLES = {"example1_ready.ngc": 0, "example2_ready.ngc": 4}  # and the tool to put in first, 0: it is there
ENDED = ("completed", "stopped", "fault", "refused")
ON_THE_WAY = (0.1, 0.6)  # shares of a cut at which somebody holds

pytestmark = pytest.mark.live


@contextlib.contextmanager
def busy() -> Iterator[None]:
    spinning = [subprocess.Popen([sys.executable, "-c", SPIN]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
        assert all(process.poll() is None for process in spinning)
    finally:
        for process in spinning:
            process.kill()
            process.wait()


def looked_at(shop: Shop, name: str) -> None:
    """One part with everything that an operator does on the way; without a fault to its end."""
    shop.do("POST", "/job", json={"program": name})
    shop.do("PUT", "/overrides/feed", json={"share": 1.0})
    shop.do("POST", "/cycle/start")
    for share in ON_THE_WAY:
        shop.until(partial(in_cut, share), f"{share:.0%} of a cut")
        shop.do("POST", "/cycle/hold")
        shop.until(lambda now: now["mode"] == "HOLD" and now["at_rest"], "the hold")
        shop.do("POST", "/cycle/retract", json={"mm": 15.0})
        shop.until(lambda now: now["mode"] == "HOLD" and now["at_rest"] and now["aside"], "the retract")
        shop.do("POST", "/cycle/return")
        shop.until(lambda now: now["mode"] == "HOLD" and now["at_rest"] and not now["aside"], "the return")
        shop.do("PUT", "/overrides/feed", json={"share": 2.0})
        shop.do("POST", "/cycle/resume")
    last = shop.until(lambda now: now["job"]["state"] in ENDED, "the end")
    assert (last["mode"], last["fault"], last["job"]["state"]) == ("READY", None, "completed")
    assert isinstance(last["tick"]["skips"], int), "counted, and shown"
    assert shop.run_record()["result"] == "completed"


def in_cut(share: float, now: Values) -> bool:
    """While the tool is changed the mode is another, before there is any cut; within one it never is."""
    under_way = now["in_block"]
    cuts = bool(under_way and under_way["what"] == "cut")
    assert now["mode"] == "RUNNING" or (now["mode"] in ("HOLD", "TOOL_CHANGE") and not cuts), now
    return cuts and under_way["fraction"] >= share


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize(
    ("commands", "seed"),
    [pytest.param(("demo",), k, marks=pytest.mark.soak if k else pytest.mark.slow) for k in range(TIMES)]
    + [pytest.param(("serve", "panel"), k, marks=pytest.mark.soak) for k in range(TIMES)],
)
def test_a_served_machine_finishes_a_part(
    commands: tuple[str, ...], seed: int, name: str, tmp_path: Path
) -> None:
    """``demo --panel`` is the others by one command: in .ci/run it stands for them, and for ``demo``."""
    with busy(), opened(tmp_path, PERIOD_S, commands) as shop:
        shop.ready()
        if EXAMPLES[name] and "demo" not in commands:  # whose changer fetches it
            shop.put_in(EXAMPLES[name])
        shop.upload(name, machine_file.shipped_program(name).read_bytes())
        looked_at(shop, name)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(TIMES))
@pytest.mark.parametrize("part", ["cone", "ruled"])
def test_the_demo_finishes(part: str, seed: int, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "controller", "demo", "--part", part, "--out", str(tmp_path), "--json"]
    with busy():
        done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    told = json.loads(done.stdout)
    assert told["result"] == "completed" and isinstance(told["skips"], int)
