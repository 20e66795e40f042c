"""The benchmarks can be started, and parts add up: they run by hand, and what they import moves."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "benchmarks"


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.py")))
def test_a_benchmark_finds_all_that_it_imports(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(FOLDER), *sys.path])
    runpy.run_path(str(FOLDER / f"{name}.py"), run_name="imported")


def _told(name: str, *words: str) -> dict[str, object] | list[dict[str, object]]:
    command = (sys.executable, str(FOLDER / f"{name}.py"), *words, "--json")
    told = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(told.stdout)  # type: ignore[no-any-return]


def test_the_steps_of_a_tick_add_up() -> None:
    shares = _told("tick_cost", "--ticks", "60")["shares"]  # type: ignore[call-overload]
    assert abs(sum(shares.values()) - 1.0) < 1e-9
    assert all(0.0 < share < 1.0 for share in shares.values()), shares


@pytest.mark.slow
def test_the_parts_of_a_simulation_add_up_to_the_whole_command() -> None:
    program = Path(__file__).parents[1] / "config" / "programs" / "example1.ngc"
    (figure,) = _told("simulate_speed", str(program), "--runs", "1")
    parts_s, cpu_s = figure["parts_s"], figure["cpu_s"]
    assert list(parts_s) == ["start", "plan", "come up", "ticks", "trace", "end"]
    assert all(seconds > 0.0 for seconds in parts_s.values()), parts_s
    assert abs(sum(parts_s.values()) - cpu_s) < 1e-9
    assert figure["times_faster"] == figure["motion_s"] / cpu_s
