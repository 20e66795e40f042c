"""Measurements by REST: the same figures as on the desk, and nothing written."""

from __future__ import annotations

import asyncio
import json
import math
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from support.fakes.panels import Scene, sentence
from support.machines.hidden_geometry import Errors, hidden, probed
from typer.testing import CliRunner

from controller.calibration.measurements import MEASUREMENTS
from controller.calibration.positions import Probe, Sphere
from controller.cli.calibrate import app
from controller.cli.measurements import EVALUATE
from controller.ipc.handoff import COLUMN, ROW
from controller.machine import machine_file, setup_data

MACHINE = machine_file.load("trunnion")
SPHERE, PROBE = Sphere((60.0, 100.0, 170.0), 12.7), Probe(100.0, 3.0)
PLACES = [(a, c) for a in (-0.9, 0.0, 1.0) for c in (-2.0, -0.5, 2.5)]
LASER = "target,sense,measured\n" + "".join(
    f"{x},{sense},{x + 0.001 * n + (0.004 if sense > 0 else 0.0)}\n"
    for n in range(3)
    for x in (0, 50, 100)
    for sense in (1, -1)
)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    setup_data.note(tmp_path, MACHINE)
    return Scene(tmp_path)


def asked(scene: Scene, name: str, **body: Any) -> httpx.Response:
    async def ask() -> httpx.Response:
        async with scene.client() as client:
            return await client.post(f"/api/v1/calibration/{name}", json=body)

    return asyncio.run(ask())


def found(scene: Scene, name: str, **body: Any) -> dict[str, Any]:
    answer = asked(scene, name, **body)
    assert answer.status_code == 200, answer.text
    told: dict[str, Any] = answer.json()
    return told


def on_the_desk(*words: object) -> dict[str, Any]:
    ran = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert ran.exit_code == 0, ran.output
    told: dict[str, Any] = json.loads(ran.stdout)
    return told


def touches() -> str:
    """Of a sphere at many positions, on a machine that is not as its file says."""
    real = hidden(MACHINE, np.random.default_rng(2), Errors())
    made = probed(MACHINE, real, SPHERE, PROBE, PLACES, np.random.default_rng(3))
    head = [axis.name for axis in MACHINE.axes] + ["i", "j", "k", "length_mm", "radius_mm"]
    shown = [axis.shown_per_unit for axis in MACHINE.axes]
    rows = np.column_stack([made.joints * shown, made.ways, made.length_mm, made.radius_mm])
    return "\n".join([",".join(head), *(",".join(f"{v:.7f}" for v in row) for row in rows)])


def test_every_measurement_that_is_declared_is_evaluated() -> None:
    assert set(MEASUREMENTS) == set(EVALUATE)


def test_rotaries_come_out_as_on_the_desk_with_the_file_as_it_would_be(scene: Scene, tmp_path: Path) -> None:
    table = touches()
    told = found(scene, "rotaries", values={"sphere_radius": 12.7, "add": 0}, table=table)
    (tmp_path / "t.csv").write_text(table)
    desk = on_the_desk("rotaries", tmp_path / "t.csv", "--sphere-radius", 12.7, "--add", 0)
    assert told["told"]["rotaries"] == desk["rotaries"]
    made = machine_file.read(told["machine_file"], "new.toml")
    assert list(made.axes[4].point_mm) == pytest.approx(desk["rotaries"][1]["point_mm"], abs=1e-6)
    assert setup_data.noted(tmp_path).text == MACHINE.text, "nothing is written"


def test_an_axis_comes_out_as_on_the_desk_with_its_picture(scene: Scene, tmp_path: Path) -> None:
    told = found(scene, "axis", values={"axis": "X"}, table=LASER)
    (tmp_path / "x.csv").write_text(LASER)
    desk = on_the_desk("axis", tmp_path / "x.csv", "--axis", "X")
    assert {name: desk[name] for name in told["told"]} == told["told"]
    assert "pitch" in told["machine_file"] and told["picture"].startswith("iVBOR")


def test_a_circle_is_measured_in_the_ticks_that_were(scene: Scene) -> None:
    """10 mm about (0, 0), both senses, Y late by 3 um."""
    rows = []
    for sense, line in ((1, 2), (-1, 3)):
        for k in range(1200):
            turn = sense * 2.0 * math.pi * k / 1199
            x, y = 10.0 * math.cos(turn), 10.0 * math.sin(turn)
            late_mm = 0.003 * math.copysign(1.0, sense * math.cos(turn))
            rows.append((line, (x, y), (x, y - late_mm)))
    for tick, (line, command, actual) in enumerate(rows):
        row = [0.0] * len(ROW)
        row[COLUMN["tick"]], row[COLUMN["line"]], row[COLUMN["motion_id"]] = tick, line, line
        for axis in (0, 1):
            row[COLUMN[f"joint_command_{axis}"]] = command[axis]
            row[COLUMN[f"actual_{axis}"]] = actual[axis]
        scene.door.recorder.write(row)
    told = found(scene, "circle", values={"axes": "XY"}, ticks="now")["told"]
    assert told["radius_mm"] == pytest.approx(10.0, abs=1e-3) and told["H_um"] == pytest.approx(6.0, abs=0.5)


def test_what_is_missing_or_wrong_is_said_in_the_language_that_is_asked_for(scene: Scene) -> None:
    for name, body, status, words in (
        ("angles", {}, 404, "allowed are rotaries"),
        ("rotaries", {"values": {"sphere_radius": 12.7}}, 422, "give one as CSV"),
        ("rotaries", {"values": {"sphere_radius": 0.1}, "table": "X"}, 422, "from 0.5 to 200 mm"),
        ("rotaries", {"values": {"sphere_radius": 12.7}, "table": "X\n1"}, 422, "the column"),
        ("axis", {"values": {"axis": "Q"}, "table": LASER}, 422, "none of that name"),
        ("circle", {}, 422, "while the machine moves"),
        ("points", {"values": {"line": 10}}, 422, "surfaces of a program"),
        ("positions", {"values": {"count": 4.5}}, 422, "centre_x"),
    ):
        answer = asked(scene, name, **body)
        assert answer.status_code == status and words in sentence(answer), answer.text


def test_places_to_probe_on_a_wall_are_of_a_program_in_the_store(scene: Scene) -> None:
    program = (Path(__file__).parents[3] / "config/programs/example2_ready.ngc").read_bytes()
    program = program.replace(b"P4", b"P2")

    async def play() -> None:
        async with scene.client() as client:
            sent = await client.post("/api/v1/programs", files={"file": ("wall.ngc", program)})
            assert sent.status_code == 201
            places = {"values": {"line": 10, "along": 4, "across": 2}, "program": "wall.ngc"}
            told = (await client.post("/api/v1/calibration/points", json=places)).json()["told"]
            assert len(told["points"]) == 8 and told["feature"] == "line 10"
            none = await client.post("/api/v1/calibration/points", json={**places, "program": "no.ngc"})
            assert none.status_code == 404

    asyncio.run(play())
