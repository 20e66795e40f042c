"""``directrix calibrate``: from a table to the machine file, and nothing without being told to."""

from __future__ import annotations

import json
import random

import numpy as np
import pytest
from support.machines.hidden_geometry import Errors, hidden, probed
from support.machines.probed_parts import moved, touched
from typer.testing import CliRunner

from controller.calibration.positions import Probe, Sphere
from controller.cli.calibrate import app
from controller.machine import machine_file

SPHERE, PROBE = Sphere((60.0, 100.0, 170.0), 12.7), Probe(100.0, 3.0)
PLACES = [(a, c) for a in (-0.9, 0.0, 0.5, 1.0) for c in (-2.0, -0.5, 1.0, 2.5)]


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def table_of(touches, machine) -> str:
    names = [axis.name for axis in machine.axes]
    head = [*names, "i", "j", "k", "length_mm", "radius_mm", *(f"from_{name}" for name in names)]
    shown = [axis.shown_per_unit for axis in machine.axes]
    rows = [
        [
            *(touches.joints[k] * shown),
            *touches.ways[k],
            touches.length_mm[k],
            touches.radius_mm[k],
            *touches.senses[k],
        ]
        for k in range(len(touches))
    ]
    return "\n".join([",".join(head), *(",".join(f"{value:.7f}" for value in row) for row in rows)])


@pytest.fixture(scope="module")
def real():
    machine = machine_file.load("trunnion")
    return hidden(machine, np.random.default_rng(2), Errors())


@pytest.fixture
def scene(tmp_path, real):
    machine = machine_file.load("trunnion")
    file, csv = tmp_path / "own.toml", tmp_path / "touches.csv"
    file.write_text((machine_file.SHIPPED / "trunnion.toml").read_text())
    touches = probed(machine, real, SPHERE, PROBE, PLACES, np.random.default_rng(3))
    csv.write_text(table_of(touches, machine))
    return file, csv


def test_a_calibration_is_told_and_written_only_when_it_is_asked_for(scene, real):
    file, csv = scene
    before = file.read_text()
    words = ["rotaries", csv, "--sphere-radius", 12.7, "--machine", file, "--add", 0]
    told = run(*words)
    assert told.exit_code == 0 and "Nothing is written" in told.output and file.read_text() == before
    german = run(*words, "--language", "de")
    assert "Nichts ist geschrieben" in german.output and "Drehmitte" not in told.output
    facts = json.loads(run(*words, "--write", "--json").stdout)
    assert facts["ok"] and facts["dispersion_um"]["before"]["max"] > facts["dispersion_um"]["after"]["max"]
    found = machine_file.load(file).axes[4]
    assert found.point_mm[0] == pytest.approx(real.machine.axes[4].point_mm[0], abs=0.01)
    assert len(list(file.parent.glob("own.before-*.toml"))) == 1


def test_a_change_beyond_what_is_allowed_is_refused_and_nothing_is_written(scene):
    file, csv = scene
    before = file.read_text()
    words = ["rotaries", csv, "--sphere-radius", 12.7, "--machine", file, "--add", 0, "--write"]
    refused = run(*words, "--max-mm", 0.001)
    assert refused.exit_code == 1 and file.read_text() == before


def test_a_shipped_machine_is_not_written(scene):
    _, csv = scene
    refused = run(
        "rotaries", csv, "--sphere-radius", 12.7, "--machine", "trunnion", "--add", 0, "--write", "--json"
    )
    assert refused.exit_code == 1 and "copy it" in json.loads(refused.stdout)["error"]


def test_positions_to_probe_are_told_with_the_bounds_that_they_would_leave():
    words = ["positions", "--centre", "60,100,170", "--sphere-radius", 12.7, "--length", 100, "--count", 6]
    facts = json.loads(run(*words, "--json").stdout)
    assert len(facts["positions_deg"]) == 6 and set(facts["bounds"]) == {"A", "C"}
    assert run(*words[:2], "1,2", *words[3:]).exit_code == 1


def part_scene(tmp_path, off_mm=0.0):
    """The shipped example placed at two points, its surfaces touched on a part that lies 0.3 mm off."""
    machine, program = machine_file.load("trunnion"), tmp_path / "part.ngc"
    program.write_text(machine_file.shipped_program("example2_ready").read_text().replace("P4", "P2"))
    made = run("points", program, "--line", 10, "--along", 5, "--across", 2)
    assert made.exit_code == 0, made.output
    rows = [line.split(",") for line in made.stdout.splitlines()[1:]]
    more = run("points", program, "--line", 19, "--along", 5, "--across", 2)
    rows += [line.split(",") for line in more.stdout.splitlines()[1:]]
    places = [(row[0], [float(c) for c in row[3:6]], [float(c) for c in row[6:9]]) for row in rows]
    real = moved(machine.offset(0).frame, (0.3, -0.2, 0.1), (0.1, 0.0, -0.2))
    touches = touched(machine, real, places, random.Random(1), off_mm=off_mm)
    csv, file = tmp_path / "part.csv", tmp_path / "own.toml"
    head, *lines = table_of(touches, machine).splitlines()
    named = [f"{line},{name}" for line, name in zip(lines, touches.features, strict=True)]
    csv.write_text("\n".join([f"{head},feature", *named]))
    file.write_text((machine_file.SHIPPED / "trunnion.toml").read_text())
    return program, csv, file, real


def test_an_offset_is_found_from_touches_on_the_programs_surfaces_and_written(tmp_path):
    program, csv, file, real = part_scene(tmp_path)
    words = ["part", csv, "--program", program, "--machine", file]
    facts = json.loads(run(*words, "--write", "--json").stdout)
    assert facts["origin_mm"] == pytest.approx(real.origin, abs=1e-3)
    found = machine_file.load(file).offsets[0]
    assert found.origin == pytest.approx(real.origin, abs=1e-3) and found.x == pytest.approx(real.x, abs=1e-5)
    assert "Ursprung" in run(*words, "--language", "de").output
    assert run(*words, "--free", "XQ").exit_code == 1
    assert run(*words, "--offset", "G60").exit_code == 1


def test_a_machine_that_became_warm_is_told_by_how_much_and_the_shift_is_written(tmp_path):
    """The tool stands 8 um higher than it is told: a face is met where it seems 8 um lower."""
    machine, csv, file = machine_file.load("trunnion"), tmp_path / "warm.csv", tmp_path / "own.toml"
    faces = [("1,0,0", (10.0, y, -3.0)) for y in (-9.0, 8.0)] + [
        ("0,1,0", (x, 0.0, -3.0)) for x in (1.0, 9.0)
    ]
    faces += [("0,0,1", (x, y, 0.0)) for x, y in ((1.0, 1.0), (9.0, -8.0), (2.0, -7.0))]
    places = []
    for way, point in faces:
        normal = [float(c) for c in way.split(",")]
        height = sum(a * b for a, b in zip(normal, point, strict=True))
        places.append((f"plane {way.replace(',', ' ')} {height:g}", point, normal))
    seems = moved(machine.offset(0).frame, (-0.02, 0.01, -0.008), (0.0, 0.0, 0.0))
    touches = touched(machine, seems, places, random.Random(1))
    head, *lines = table_of(touches, machine).splitlines()
    named = [f"{line},{name}" for line, name in zip(lines, touches.features, strict=True)]
    csv.write_text("\n".join([f"{head},feature", *named]))
    file.write_text((machine_file.SHIPPED / "trunnion.toml").read_text())
    words = ["thermal", csv, "--machine", file]
    facts = json.loads(run(*words, "--write", "--json").stdout)
    assert facts["shift_mm"] == pytest.approx([0.02, -0.01, 0.008], abs=1e-6)
    assert machine_file.load(file).thermal_shift_mm == pytest.approx((0.02, -0.01, 0.008), abs=1e-6)
    again = json.loads(run(*words, "--json").stdout)
    assert again["shift_mm"] == pytest.approx([0.04, -0.02, 0.016], abs=1e-6), "what is known is added to"


def test_a_wall_is_inspected_beside_what_the_plan_leaves_there(tmp_path):
    program, csv, file, _ = part_scene(tmp_path, off_mm=0.01)
    assert run("part", csv, "--program", program, "--machine", file, "--write").exit_code == 0
    facts = json.loads(run("inspect", csv, "--program", program, "--machine", file, "--json").stdout)
    told = [row for row in facts["touches"] if row["predicted_um"] is not None]
    assert len(told) >= 15
    assert all(abs(row["predicted_um"]) < 20.0 for row in told)  # the tolerance of that program
    assert (
        "geplant" in run("inspect", csv, "--program", program, "--machine", file, "--language", "de").output
    )


def test_points_of_a_line_that_cuts_no_surface_are_refused():
    program = machine_file.shipped_program("example2_ready")
    refused = run("points", program, "--line", 3)
    assert refused.exit_code == 1 and "10, 19" in refused.output
