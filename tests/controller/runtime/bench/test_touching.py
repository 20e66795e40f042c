"""A simulated service has a part and a tool setter to touch, so probing can be tried at once."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.live.served_machine import Serving, serving

from controller.machine import machine_file
from controller.runtime.bench import bus
from controller.runtime.bench.touching import Touching, read
from controller.service import engine
from controller.tick.adaptive import BAND
from drives.bench.simulated.drive import SimulatedDrive

CENTRE = engine.simulated(machine_file.load("machining_centre"))


class _Inputs:
    def __init__(self) -> None:
        self.told: list[tuple[int, bool]] = []

    def set_input(self, number: int, on: bool, now_s: float) -> None:
        self.told.append((number, on))


class _Drive:
    """A motor that stands where the test says."""

    motor_counts = 0.0
    units_per_count = 1.0

    def strike(self, closed: bool, counts: float, now_s: float) -> None: ...


def touching() -> tuple[Touching, list[Any], _Inputs]:
    drives: list[Any] = [_Drive() for _ in CENTRE.axes]
    inputs = _Inputs()
    bench = read(None, CENTRE)
    return Touching(bench, CENTRE, drives, inputs, lambda _: None), drives, inputs


def stand(made: Touching, drives: list[SimulatedDrive], at_s: float, *joints: float) -> None:
    for drive, axis, q in zip(drives, CENTRE.axes, joints, strict=True):
        drive.motor_counts = q * axis.counts_per_unit  # type: ignore[misc]
    made.watch(at_s)


def test_the_probe_touches_the_part_and_another_tool_the_setter() -> None:
    made, drives, inputs = touching()
    assert CENTRE.io is not None and CENTRE.probe is not None and CENTRE.setter is not None
    probe, setter = CENTRE.io.input("probe"), CENTRE.io.input("setter")
    above = CENTRE.offsets[0].origin
    made.put_in(99, 0.0)
    x, y, z = above[0] + 30.0, above[1] + 20.0, above[2] + 80.0
    for k, height in enumerate((20.0, 0.5, -0.1, 5.0), 1):
        stand(made, drives, float(k), x, y, z + height, 0.0, 0.0)
    assert inputs.told == [(probe, True), (probe, False)]
    inputs.told.clear()
    made.put_in(2, 5.0)  # 55 mm long
    sx, sy, sz = CENTRE.setter.point
    for k, height in enumerate((70.0, 54.9, 70.0), 6):
        stand(made, drives, float(k), sx, sy, sz + height, 0.0, 0.0)
    assert inputs.told == [(setter, True), (setter, False)]
    inputs.told.clear()
    made.put_in(0, 9.0)
    stand(made, drives, 10.0, sx, sy, sz, 0.0, 0.0)
    assert inputs.told == [], "no tool, no touch"


def test_a_motor_that_counts_finer_than_its_drive_reports_touches_at_the_same_place() -> None:
    """As of a drive with a feed constant (6092h)."""
    made, drives, inputs = touching()
    for drive in drives:
        drive.units_per_count = 1e4
    made.put_in(99, 0.0)
    x, y, z = CENTRE.offsets[0].origin
    for k, height in enumerate((20.0, -0.1), 1):
        for drive, axis, q in zip(
            drives, CENTRE.axes, (x + 30.0, y + 20.0, z + 80.0 + height, 0, 0), strict=True
        ):
            drive.motor_counts = 1e-4 * q * axis.counts_per_unit
        made.watch(float(k))
    assert [on for _, on in inputs.told] == [True]


def test_a_tool_that_is_taken_out_while_it_touches_lets_go() -> None:
    made, drives, inputs = touching()
    made.put_in(99, 0.0)
    x, y, z = CENTRE.offsets[0].origin
    stand(made, drives, 1.0, x + 30.0, y + 20.0, z + 100.0, 0.0, 0.0)
    stand(made, drives, 2.0, x + 30.0, y + 20.0, z + 79.0, 0.0, 0.0)
    made.put_in(2, 3.0)
    assert [on for _, on in inputs.told] == [True, False]


def test_only_axes_of_one_virtual_bus_of_a_machine_with_a_probe_touch() -> None:
    assert bus.bus_of(CENTRE) == "can0"
    assert bus.bus_of(machine_file.load("trunnion")) is None


def test_what_nobody_listens_to_is_no_error(tmp_path: Path) -> None:
    bus.tell_tool(tmp_path, 3)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as own:
        own.bind(str(tmp_path / bus.SPINDLE))
        bus.tell_tool(tmp_path, 3)
        assert own.recv(9) == b"3"


# -- with the processes of a service


@pytest.fixture
def centre(tmp_path: Path) -> Iterator[Serving]:
    with serving(tmp_path, "--machine", "machining_centre", "--period-ms", "10") as running:
        running.up()
        running.ask("changer_confirm", spindle=99, away=[], clear=True)
        running.home()
        yield running


def typed(centre: Serving, *lines: str) -> None:
    for line in lines:
        centre.ask("mdi", text=line)
        centre.until(lambda now: now["mode"] == "READY" and now["job"] is None, line)


def probed(centre: Serving, cycle: str, **values: Any) -> dict[str, float]:
    centre.done("probe", cycle=cycle, values=values, offset="none")
    centre.until(lambda now: now["mode"] == "READY" and now["job"] is None, cycle)
    return dict(next(one for one in centre.ask("probed")["found"] if one["cycle"] == cycle)["values"])


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.calm
def test_probing_works_at_a_simulated_service_as_it_comes(centre: Serving) -> None:
    typed(centre, "G0 G43 H99 Z60", "G0 G43 H99 X30 Y20", "G0 G43 H99 Z12")
    assert probed(centre, "top", most=20.0)["height_mm"] == pytest.approx(0.1, abs=0.01)
    typed(centre, "G0 G43 H99 Z20", "G0 G43 H99 X0 Y0", "G0 G43 H99 Z-6")
    bore = probed(centre, "bore", most=20.0)
    assert bore["x_mm"] == pytest.approx(0.35, abs=0.01) and bore["y_mm"] == pytest.approx(-0.2, abs=0.01)
    typed(centre, "G0 G43 H99 Z60", "T2 M6", "G53 G0 X-80 Y-40", "G53 G0 Z130")
    assert probed(centre, "tool_length", most=30.0, keep="no")["length_mm"] == pytest.approx(55.0, abs=0.01)


TARGET = 60.0  # %, of the shipped machine's law
LOADED = """
[[solid]]
kind = "block"
low_mm = [-400.0, -400.0, -400.0]
high_mm = [400.0, 400.0, 0.0]

[cut]
force_n_mm2 = 1800.0
rated_nm = 1.0
length_mm = 70.0

[[stock]]
low_mm = [-400.0, -400.0, -400.0]
high_mm = [400.0, 400.0, 400.0]
section_mm2 = 12.0
"""


@pytest.mark.slow
@pytest.mark.live
def test_the_load_of_a_simulated_service_leads_the_feed(tmp_path: Path) -> None:
    """The spindle's drive is on another bus than the axes, so in another process."""
    (tmp_path / "part.toml").write_text(LOADED)
    part = ("--part", str(tmp_path / "part.toml"))
    with serving(tmp_path, "--machine", "machining_centre", "--period-ms", "10", *part) as running:
        running.up()
        running.ask("changer_confirm", spindle=1, away=[], clear=True)
        running.home()
        running.done("adaptive_feed", on=True)
        running.ask("mdi", text="M3 S3000 F600 G91 G1 X60")
        led = running.until(lambda now: now["adaptive"]["on"] and now["adaptive"]["share"] < 0.95, "it acts")
        assert led["spindle"]["load"] > TARGET
        settled = running.until(
            lambda now: abs(now["spindle"]["load"] / TARGET - 1.0) < BAND, "at its target"
        )
        assert 0.5 < settled["adaptive"]["share"] < 0.95
        running.until(lambda now: now["mode"] == "READY", "the end")
        running.until(lambda now: abs(now["spindle"]["load"]) < 10.0, "nothing is cut")
