"""The benchmarks run, each figure stands beside its reference, and parts add up: all in their short form."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.live import five_buses
from support.suite import cyclictest, figures
from support.suite.cyclictest import Absence
from support.suite.figures import Figure, Report
from typer.testing import CliRunner

from controller.__main__ import app
from controller.cli import bench

FOLDER = Path(__file__).parent / "benchmarks"
NAMES = sorted(file.stem for file in FOLDER.glob("*.py"))
IN_REAL_TIME = ("sync", "live", "endurance", "request", "panel", "page", "scene", "memory", "idle")
WHOLE = ("accuracy", "page", "panel", "placements", "scene")  # without parts


def told(name: str) -> dict:
    done = CliRunner().invoke(app, ["bench", name, "--short", "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)["benchmarks"][name]


def judge(name: str) -> None:
    if name in ("sync", "live", "endurance") and shutil.which("cyclictest") is None:
        pytest.skip("cyclictest is not installed (Debian: rt-tests)")
    found = told(name)
    assert found["figures"] and any(one["ratio"] is not None for one in found["figures"])
    for one in found["figures"]:
        assert math.isfinite(one["value"]) and one["value"] >= 0.0, one
        if one["ratio"] is not None:
            assert one["ratio"] == pytest.approx(one["value"] / one["reference"]), one
    shares = found["parts"]
    assert bool(shares) is (name not in WHOLE)
    assert not shares or abs(sum(shares.values()) - 1.0) < 1e-9
    assert all(0.0 <= share <= 1.0 for share in shares.values()), shares


@pytest.mark.parametrize("name", ["tick", "accuracy", "placements"])
def test_a_short_benchmark_stands_beside_its_reference_and_adds_up(name: str) -> None:
    judge(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [one for one in NAMES if one not in IN_REAL_TIME])
def test_every_benchmark_off_the_wall_clock_does(name: str) -> None:
    judge(name)


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize("name", IN_REAL_TIME)
def test_every_benchmark_in_real_time_does(name: str) -> None:
    if name in ("page", "scene", "idle") and shutil.which("chromium") is None:
        pytest.skip("there is no browser")
    judge(name)


def test_a_skipped_sync_counts_as_two_and_only_an_absence_that_reaches_into_it_excuses_it() -> None:
    times_s = 0.5e-3 * np.array([0.0, 1.0, 3.0, 4.0, 5.26, 6.0, 7.2])
    assert five_buses.outside(times_s) == pytest.approx(4 / 7)  # two that make up for a late one, too
    assert five_buses.judged(times_s, ()) == [3.0, 0.0, 4.0]
    assert five_buses.judged(times_s, [Absence(1, 0.9e-3, 1.1e-3)]) == [3.0, 2.0, 2.0]
    assert five_buses.judged(times_s, [Absence(1, 1.6e-3, 1.9e-3)]) == [3.0, 0.0, 4.0]
    assert five_buses.judged(times_s, [Absence(1, -1.0, 9.0)]) == [3.0, 4.0, 0.0]


@pytest.mark.skipif(shutil.which("cyclictest") is None or os.geteuid(), reason="no cyclictest, or not for us")
def test_cyclictest_tells_when_it_was_woken_late_by_the_clock_of_syncs() -> None:
    began_s = time.monotonic()
    with cyclictest.Watch(1e-3, 1e-6) as watch:  # nobody is woken within a microsecond
        time.sleep(0.5)
    assert watch.woken and watch.absences
    for one in watch.absences:
        assert began_s < one.begin_s < one.end_s < time.monotonic()
    assert watch.longest_s(began_s, time.monotonic()) >= 1e-6 and not watch.longest_s(0.0, began_s)


def test_parts_that_do_not_add_up_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"add up to 0\.9"):
        Report((), {"a": 0.5, "b": 0.4}, "it")
    with pytest.raises(ValueError, match="is nan"):
        Report((Figure("a", math.nan, "s"),))
    assert figures.shares({"a": 3.0, "b": 1.0}) == {"a": 0.75, "b": 0.25}
    wrong = tmp_path / "wrong.py"
    wrong.write_text('print(\'{"figures": [], "parts": {"a": 5.0}, "whole": "it", "note": ""}\')')
    assert "add up to 500.0000 %" in bench._measured(wrong, short=True)["error"]


def test_a_benchmark_that_fails_is_told_and_ends_with_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "benchmarks" / "bad.py").write_text("raise SystemExit('no such luck')")
    monkeypatch.setattr(bench.checkout, "tests", lambda: tmp_path)
    done = CliRunner().invoke(app, ["bench", "--json"])
    found = json.loads(done.stdout)
    assert done.exit_code == 1 and found["benchmarks"] == {"bad": {"error": "no such luck"}}
    unknown = CliRunner().invoke(app, ["bench", "fast", "--json"])
    assert unknown.exit_code == 1 and "allowed are bad" in json.loads(unknown.stdout)["error"]


def test_the_figures_are_put_into_a_page_and_drawn(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{bench.BEGIN}\nold\n{bench.END}\nbehind\n")
    words = ["bench", "start", "--short", "--readme", str(page), "--plot", str(tmp_path / "plots")]
    assert CliRunner().invoke(app, words).exit_code == 0
    text = page.read_text()
    assert text.startswith(f"before\n{bench.BEGIN}\n`directrix bench --short`") and "old" not in text
    assert text.endswith(f"| at most 0.3 |\n{bench.END}\nbehind\n") and "| `start`: status |" in text
    assert "--version" not in text, "nothing is promised of it"
    assert (tmp_path / "plots" / "start.png").read_bytes().startswith(b"\x89PNG")
    page.write_text("no marks")
    refused = CliRunner().invoke(app, [*words, "--json"])
    assert refused.exit_code == 1 and "no one place" in json.loads(refused.stdout)["error"]


def test_a_benchmark_can_be_started_by_itself() -> None:
    command = (sys.executable, str(FOLDER / "accuracy.py"), "--short")
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "off C1" in done.stdout and "first-order step" in done.stdout
