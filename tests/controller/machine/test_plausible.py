"""What a machine file says and hardly any machine has is asked about; ordinary machines are asked nothing."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from importlib.metadata import entry_points

import pytest
from can.interfaces import BACKENDS

from controller.cli import machine_check
from controller.machine import machine_file, plausible
from controller.messages import text as in_words
from drives.bus import HUBS

COUNTS = 4096  # of an encoder in one turn of its motor
TOOLS = (machine_file.SHIPPED / "tools.toml").read_text()


@dataclass(frozen=True)
class Ordinary:
    """An ordinary machine: screws, gears of the rotaries, and what its axes can."""

    shape: str  # the shipped machine of which it has the axes
    screw_mm: float = 5.0  # in one turn of the motor
    gear: float = 50.0  # of the rotaries
    period_ms: float = 2.0
    can_mm: tuple[float, float, float] = (200.0, 1000.0, 20_000.0)  # velocity, acceleration, jerk
    can_deg: tuple[float, float, float] = (60.0, 300.0, 3000.0)
    following: float = 2.0  # mm, deg
    travel_mm: tuple[float, float] = (-300.0, 300.0)
    spindle: str = 'by = "hand"'

    def text(self) -> str:
        """Its file, with the tools."""
        made = (machine_file.SHIPPED / f"{self.shape}.toml").read_text()
        for unit, can, counts in (
            ("mm", self.can_mm, COUNTS / self.screw_mm),
            ("deg", self.can_deg, COUNTS * self.gear / 360.0),
        ):
            keys = (f"velocity_{unit}_s", f"acceleration_{unit}_s2", f"jerk_{unit}_s3")
            for key, value in zip(keys, can, strict=True):
                made = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", made)
            made = re.sub(rf"(?m)^counts_per_{unit} = .*$", f"counts_per_{unit} = {counts}", made)
            made = re.sub(
                rf"(?m)^following_error_{unit} = .*$", f"following_error_{unit} = {self.following}", made
            )
        made = re.sub(r"(?m)^travel_mm = .*$", f"travel_mm = {list(self.travel_mm)}", made)
        made = re.sub(r"(?m)^period_s = .*$", f"period_s = {self.period_ms / 1e3}", made)
        made = made.replace('by = "hand"', self.spindle)
        return f"{made}\n{TOOLS}"


TWELVE = {
    "small mill, 5 mm screws, rotaries 1:50": Ordinary("trunnion"),
    "the same at 1 ms": Ordinary("trunnion", period_ms=1.0),
    "the same at 0.5 ms": Ordinary("trunnion", period_ms=0.5),
    "10 mm screws, rotaries 1:100": Ordinary("table_head", 10.0, 100.0, can_deg=(30.0, 100.0, 500.0)),
    "10 mm screws, 1:90, soft": Ordinary("fig4b", 10.0, 90.0, can_mm=(150.0, 500.0, 2000.0)),
    "head with 1:100": Ordinary("head_head", 10.0, 100.0, 4.0, travel_mm=(-1500.0, 1500.0)),
    "three axes, 5 mm": Ordinary("three_axes", can_mm=(50.0, 250.0, 2500.0)),
    "three axes, 10 mm at 1 ms": Ordinary(
        "three_axes", 10.0, period_ms=1.0, can_mm=(500.0, 5000.0, 200_000.0)
    ),
    "old iron": Ordinary("fig4c", 10.0, 50.0, 5.0, (80.0, 200.0, 1500.0), (10.0, 40.0, 200.0), 0.5),
    "fast router": Ordinary("oblique45", 10.0, 50.0, 1.0, (1000.0, 8000.0, 400_000.0), following=20.0),
    "gantry": Ordinary("fig4d", 10.0, 100.0, 2.0, (600.0, 1500.0, 15_000.0), travel_mm=(-3000.0, 3000.0)),
    "with a spindle drive": Ordinary(
        "trunnion", spindle="node = 6\ncounts_per_rev = 4096\nacceleration_rev_s2 = 100.0"
    ),
}


@pytest.mark.parametrize("name", TWELVE)
def test_nothing_is_asked_about_an_ordinary_machine(name: str) -> None:
    machine = machine_file.read(TWELVE[name].text(), "ours.toml", machine_file.SHIPPED)
    assert [in_words(one) for one in plausible.doubts(machine)] == []


@pytest.mark.parametrize("name", machine_file.shipped())
def test_nothing_is_asked_about_a_shipped_machine(name: str) -> None:
    assert machine_check.warnings(machine_file.load(name)) == []


# ---- absurd values: each is asked about, alone, with its key

ABSURD = [
    ("acceleration_mm_s2 = 2000.0", "acceleration_mm_s2 = 2.0", "acceleration_mm_s2 = 2.0"),
    ("velocity_mm_s = 200.0", "velocity_mm_s = 12_000.0", "velocity_mm_s = 12000.0"),
    ("velocity_mm_s = 200.0", "velocity_mm_s = 0.2", "velocity_mm_s = 0.2"),
    ("following_error_mm = 4.0", "following_error_mm = 2_000.0", "following_error_mm = 2000.0"),
    ("following_error_mm = 4.0", "following_error_mm = 0.002", "1.6 counts"),
    ("brake = true", "brake = false", "Z has no brake"),
    ("brake = true\n", "", "Z has no brake"),
    ("travel_mm = [-300.0, 300.0]", "travel_mm = [-15_000.0, 15_000.0]", "30000 from end to end"),
    ("travel_mm = [-300.0, 300.0]", "travel_mm = [-0.3, 0.3]", "0.6 from end to end"),
    ("jerk_mm_s3 = 50_000.0", "jerk_mm_s3 = 5.0", "jerk_mm_s3 = 5.0"),
    ("jerk_mm_s3 = 50_000.0", "jerk_mm_s3 = 5e11", "jerk_mm_s3"),
    ("jerk_mm_s3 = 50_000.0", "jerk_mm_s3 = 400.0", "takes 5 s to acceleration_mm_s2"),
    ("counts_per_mm = 819.2", "counts_per_mm = 20", "counts_per_mm = 20"),
    ("velocity_deg_s = 180.0", "velocity_deg_s = 180_000.0", "velocity_deg_s"),
    ("acceleration_deg_s2 = 1500.0", "acceleration_deg_s2 = 15.0", "takes 12 s to velocity_deg_s"),
    ("point_mm = [0.0, 96.0, 120.0]", "point_mm = [0.0, 96.0, 120_000.0]", "point_mm"),
    ("clearance_mm = 5.0", "clearance_mm = 5_000.0", "clearance_mm = 5000.0"),
    ("lead_mm = 2.0", "lead_mm = 2_000.0", "lead_mm = 2000.0"),
    ("lead_mm = 2.0", "lead_mm = 2.0\ntip_acceleration_mm_s2 = 0.5", "tip_acceleration_mm_s2 = 0.5"),
    ("tolerance_mm = 0.05 ", "tolerance_mm = 50.0 ", "tolerance_mm = 50.0"),
    ("max_rev_min = 24000", "max_rev_min = 24_000_000", "max_rev_min = 24000000"),
    ("{ method = 37, group = 1, position_mm = 0.0 }", "{ method = 23, fast_mm_s = 900.0 }", "fast_mm_s"),
    ("{ method = 37, group = 1, position_mm = 0.0 }", "{ method = 23, fast_mm_s = 0.5 }", "may take 20 min"),
    (
        "{ method = 37, group = 1, position_mm = 0.0 }",
        "{ method = 23, fast_mm_s = 2.0, slow_mm_s = 20.0 }",
        "faster than fast_mm_s",
    ),
    (
        "{ method = 37, group = 1, position_mm = 0.0 }",
        "{ method = 18, group = 1, position_mm = -290.0 }",
        "limit switch at the end 300",
    ),
    (
        "{ method = 37, group = 1, position_mm = 0.0 }",
        "{ method = 1, group = 1, position_mm = 290.0 }",
        "limit switch at the end -300",
    ),
    ('"virtual"', '"soketcan"\nchannel = "can0"', 'interface = "soketcan"'),
    ("radius_mm = 3.0", "radius_mm = 3_000.0", "[[tool]] end mill 6 mm: radius_mm"),
    (
        'by = "hand"',
        "node = 6\ncounts_per_rev = 4096\nspin_up_s = 2.0",
        "spin_up_s = 2.0: by acceleration_rev_s2 it takes 8.0 s",
    ),
]


@pytest.mark.parametrize(
    ("old", "new", "told"), ABSURD, ids=[new.strip()[:40] or old for old, new, _ in ABSURD]
)
def test_an_absurd_value_is_asked_about_with_its_key(old: str, new: str, told: str) -> None:
    text = (machine_file.SHIPPED / "trunnion.toml").read_text() + TOOLS
    text = text.replace("counts_per_mm = 200_000", "counts_per_mm = 819.2")
    assert old in text
    machine = machine_file.read(text.replace(old, new, 1), "ours.toml", machine_file.SHIPPED)
    found = [in_words(one) for one in plausible.doubts(machine)]
    assert any(told in one for one in found), found
    assert len(found) <= 2, "what follows of it may be told, too"


def test_a_doubt_names_the_line_and_refuses_nothing() -> None:
    text = (
        (machine_file.SHIPPED / "trunnion.toml")
        .read_text()
        .replace("acceleration_mm_s2 = 2000.0", "acceleration_mm_s2 = 2")
    )
    line = next(n for n, one in enumerate(text.splitlines(), 1) if one == "acceleration_mm_s2 = 2")
    machine = machine_file.read(f"{text}\n{TOOLS}", "ours.toml", machine_file.SHIPPED)
    (first, *_) = machine_check.warnings(machine)
    assert f"trunnion:{line}: [[axis]] X: acceleration_mm_s2 = 2" in first
    assert "usual: from 10 to 100000" in first


def test_a_machine_without_a_file_is_asked_nothing() -> None:
    from support.machines.shipped_kinds import machine

    assert plausible.doubts(machine("fig4a")) == []


def test_they_are_json(capsys: pytest.CaptureFixture[str]) -> None:
    machine_check.alone(machine_file.load("trunnion"), [], True)
    assert json.loads(capsys.readouterr().out)["warnings"] == []


def test_the_interfaces_that_are_known_are_python_can_s_and_our_own() -> None:
    brought = {one.name for one in entry_points(group="can.interface")}
    assert {*BACKENDS} - brought | {*HUBS} == plausible.INTERFACES
