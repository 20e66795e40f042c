"""``/metrics`` by the rules of Prometheus' own linter, and true to status and store."""

from __future__ import annotations

import asyncio
import math
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from prometheus_client import Metric
from prometheus_client.parser import text_string_to_metric_families
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import Scene

from controller.api import own_folder
from controller.messages import LANGUAGES
from controller.state.modes import Mode

# As promtool has them (client_golang, prometheus/promlint): a name is in base units, not abbreviated.
ABBREVIATED = {
    "s",
    "ms",
    "us",
    "ns",
    "sec",
    "b",
    "kb",
    "mb",
    "gb",
    "tb",
    "pb",
    "m",
    "h",
    "d",
    "mm",
    "deg",
    "min",
}
NO_BASE = {"minutes", "hours", "days", "weeks", "degrees", "bits", "millimeters", "percent", "inches"}
PREFIXES = ("milli", "micro", "nano", "kilo", "mega", "giga", "centi")
TYPES = {"gauge", "counter", "summary", "histogram", "metric"}


class Moving(FakeDoor):
    def status(self) -> dict[str, Any]:
        told = super().status()
        joints = {name: {**row, "actual": 90.0, "error": -0.5} for name, row in told["joints"].items()}
        job = {"left_s": 61.5, "elapsed_s": 2.0}
        drives = [
            {"axis": "X", "heartbeat_age_s": 0.01, "malformed": 3, "missed_setpoints": 5},
            {"axis": "Z", "malformed": None, "missed_setpoints": None, "overdue_setpoints": 1},
        ]
        return {
            **told,
            **{"drives": drives},
            **{"joints": joints, "job": job, "feed_mm_min": {"actual": 600.0}, "tick_alive": True},
            "tick": {**told["tick"], "skips": 3, "age_s": 0.001, "late_max_ms": 0.25, "lost_frames": 7},
        }


def filled(scene: Scene) -> None:
    """Runs and alarms as the service leaves them behind."""
    for result, seconds in (("completed", 10.0), ("completed", 20.0), ("fault", 5.0)):
        scene.history.run("a.ngc", result, duration_s=seconds, cut_time_s=seconds / 2.0)
    first = scene.history.alarm("ESTOP", "Emergency stop.")
    scene.history.alarm("ESTOP", "Emergency stop.")
    scene.history.acknowledge(first, "me")


def scraped(folder: Path, door: FakeDoor | None = None, language: str = "en") -> str:
    async def story() -> str:
        scene = Scene(folder, door=door or Moving())
        if not scene.history.runs():
            filled(scene)
        async with scene.client() as client:
            answer = await client.get("/metrics", headers={"Accept-Language": language})
            assert answer.status_code == 200, answer.text
            assert answer.headers["Content-Language"] == language
            return answer.text

    return asyncio.run(story())


def families(text: str) -> list[Metric]:
    return list(text_string_to_metric_families(text))


def values(text: str) -> dict[str, float]:
    """By name and label."""
    rows = [sample for family in families(text) for sample in family.samples]
    return {" ".join([row.name, *row.labels.values()]): row.value for row in rows}


def test_figures_are_those_of_the_status_in_base_units(tmp_path: Path) -> None:
    found = values(scraped(tmp_path))
    assert found["directrix_up"] == found["directrix_store_up"] == found["directrix_tick_alive"] == 1.0
    assert found["directrix_tick_period_seconds"] == pytest.approx(0.002)
    assert found["directrix_tick_late_max_seconds"] == pytest.approx(0.00025)
    assert found["directrix_feed_meters_per_second"] == pytest.approx(0.01)
    assert found["directrix_joint_position_meters X"] == pytest.approx(0.09)
    assert found["directrix_joint_position_radians C"] == pytest.approx(math.pi / 2.0)
    assert found["directrix_joint_following_error_meters Z"] == pytest.approx(-0.0005)
    assert found["directrix_drive_malformed_frames_total X"] == 3.0
    assert "directrix_drive_malformed_frames_total Z" not in found
    assert found["directrix_drive_missed_setpoints_total X"] == 5.0
    assert "directrix_drive_missed_setpoints_total Z" not in found
    assert found["directrix_drive_overdue_setpoints_total Z"] == 1.0
    assert (found["directrix_ticks_total"], found["directrix_tick_skips_total"]) == (500.0, 3.0)
    assert found["directrix_bus_lost_frames_total"] == 7.0
    assert {mode.name: found[f"directrix_mode {mode.name}"] for mode in Mode} == {
        mode.name: float(mode is Mode.OFF) for mode in Mode
    }


def test_runs_and_alarms_are_counted_by_outcome_and_name(tmp_path: Path) -> None:
    found = values(scraped(tmp_path))
    assert found["directrix_runs_total completed"] == 2.0 and found["directrix_runs_total fault"] == 1.0
    assert found["directrix_runs_total stopped"] == 0.0, "there before the first, so that it is seen to rise"
    assert found["directrix_run_seconds_total completed"] == 30.0
    assert found["directrix_cut_seconds_total fault"] == 2.5
    assert (found["directrix_alarms_total ESTOP"], found["directrix_alarms_open ESTOP"]) == (2.0, 1.0)


def test_the_disk_is_told_with_what_takes_it(tmp_path: Path) -> None:
    (tmp_path / "recordings" / "one").mkdir(parents=True)
    (tmp_path / "recordings" / "one" / "trace.npz").write_bytes(b"x" * 5000)
    found, disk = values(scraped(tmp_path)), shutil.disk_usage(tmp_path)
    assert found["directrix_disk_size_bytes"] == disk.total
    assert found["directrix_disk_free_bytes"] == pytest.approx(disk.free, rel=0.05)
    assert found["directrix_state_bytes recordings"] == 5000.0
    store = own_folder.of(tmp_path) / own_folder.STORE
    assert found["directrix_state_bytes store"] >= store.stat().st_size


def test_of_a_service_that_is_gone_nothing_is_read_but_what_the_panel_has_itself(tmp_path: Path) -> None:
    door = FakeDoor()
    door.there = False
    found = values(scraped(tmp_path, door))
    assert found["directrix_up"] == found["directrix_store_up"] == 0.0 and "directrix_listeners" in found
    of_service = ("directrix_mode", "directrix_tick", "directrix_runs", "directrix_alarms")
    assert not any(name.startswith(of_service) for name in found)


def test_a_tick_that_is_gone_is_told(tmp_path: Path) -> None:
    class Gone(Moving):
        def status(self) -> dict[str, Any]:
            told = super().status()
            tick = {**told["tick"], "age_s": 4.5, "number": -1}
            return {**told, "tick": tick, "tick_alive": False, "feed_mm_min": {"actual": None}}

    door = Gone()
    door.mode = "FAULT"
    found = values(scraped(tmp_path, door))
    assert (found["directrix_tick_alive"], found["directrix_tick_age_seconds"]) == (0.0, 4.5)
    assert found["directrix_mode FAULT"] == 1.0 and "directrix_feed_meters_per_second" not in found
    assert found["directrix_ticks_total"] == 0.0, "no tick yet is none, not less"


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_each_of_them_is_stands_in_the_catalogue_in_the_language_of_who_asks(
    tmp_path: Path, language: str
) -> None:
    texts = LANGUAGES[language].texts
    told = {
        f"metrics.{family.name.removeprefix('directrix_')}": family.documentation
        for family in families(scraped(tmp_path, language=language))
    }
    assert told == {key: text for key, text in texts.items() if key.startswith("metrics.")}


def complaints(family: Metric) -> list[str]:
    """What Prometheus' linter would say of a metric."""
    name, words = family.name, family.name.split("_")
    rules = {
        "no help": not family.documentation,
        "not snake case": not re.fullmatch(r"[a-z][a-z0-9_]*", name),
        "an abbreviated unit": bool(ABBREVIATED & set(words)),
        "no base unit": bool(NO_BASE & set(words)) or any(w.startswith(PREFIXES) for w in words),
        "its type in its name": bool(TYPES & set(words)),
        "an ending that is a histogram's": name.endswith(("_count", "_sum", "_bucket")),
        "a counter's end": family.type != "counter" and name.endswith("_total"),
        "no type": family.type in ("unknown", "untyped"),
        "a label that is a histogram's": any({"le", "quantile"} & set(s.labels) for s in family.samples),
        "a counter without its end": family.type == "counter"
        and not all(s.name == f"{name}_total" for s in family.samples),
    }
    return [f"{name}: {rule}" for rule, broken in rules.items() if broken]


def test_every_name_keeps_to_the_rules(tmp_path: Path) -> None:
    found = families(scraped(tmp_path))
    assert [said for family in found for said in complaints(family)] == []
    assert len(found) > 20 and len({family.name for family in found}) == len(found)
    assert {"directrix_ticks", "directrix_runs", "directrix_alarms"} <= {
        family.name for family in found if family.type == "counter"
    }


@pytest.mark.skipif(shutil.which("promtool") is None, reason="promtool (Debian: prometheus) is not installed")
def test_promtool_has_nothing_to_say(tmp_path: Path) -> None:
    said = subprocess.run(
        ["promtool", "check", "metrics"], input=scraped(tmp_path), text=True, capture_output=True
    )
    assert (said.returncode, said.stdout + said.stderr) == (0, "")
