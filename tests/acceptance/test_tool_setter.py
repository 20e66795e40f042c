"""The tool setter: tools that are not as their table says, measured by the cycles that ship."""

from __future__ import annotations

import random

import pytest
from support.machines import probing_machine
from support.suite.seed import SEED

from controller.program import linked, probing_cycles
from tests.acceptance.test_probing import told

pytestmark = pytest.mark.slow

FACE_MM = 60.0  # of the setter, as ``probing_machine.SETTER`` has it
TABLE = 'name = "end mill 6 mm"\nradius_mm = 3.000\nlength_mm = 60.0\nflute_mm = 15.0\n'
TOOL = f"\n[[tool]]\nnumber = 7\n{TABLE}"


@pytest.fixture
def some(request: pytest.FixtureRequest) -> random.Random:
    return random.Random(f"{SEED} {request.node.name}")


def measured(
    cycle: str, values: dict[str, object], length: float, radius: float, some: random.Random, dialect: str
) -> list[list[float]]:
    """What a cycle says of tool 7, which truly is so, and what its table says then: length and diameter."""
    done = ran(cycle, values, length, radius, some, dialect)
    assert done.error == "" and done.run.result == "completed", (done.error, done.run.fault_text)
    return told(done)[-2:]


def ran(
    cycle: str, values: dict[str, object], length: float, radius: float, some: random.Random, dialect: str
) -> probing_machine.Probed:
    changes = {"[machine]\n": f'[machine]\ndialect = "{dialect}"\n', "\n[setter]": f"{TOOL}\n[setter]"}
    machine = probing_machine.machine(**changes)
    part = f'[tool]\nlength_mm = {length}\nradius_mm = {radius}\n[[solid]]\nkind = "sphere"\n'
    part += "centre_mm = [200.0, 200.0, -200.0]\nradius_mm = 1.0\n"
    x, y = -80.0 + some.uniform(-1.0, 1.0), -40.0 + some.uniform(-1.0, 1.0)
    start = f"G21 G90 G54\nT7 M6\nG43 H7\nG53 G0 X{x:.4f} Y{y:.4f}\nG53 G0 Z{FACE_MM + length + 5.0:.4f}\n"
    lines, _ = linked.parts(probing_cycles.program(cycle, values, "none"))
    text = f"{start}{bytes(lines).decode()}(DEBUG, #5403 #5410)\nM30\n".encode()
    text = linked.linked(text, lambda _: None)
    return probing_machine.run(text.decode(), probing_machine.up(part, machine))


@pytest.mark.parametrize(("dialect", "keep"), [("rs274", "yes"), ("rs274", "no"), ("fanuc", "yes")])
def test_the_length_of_a_tool_is_measured_and_kept_where_it_is_said(
    dialect: str, keep: str, some: random.Random
) -> None:
    length = 60.0 + some.uniform(-3.0, 3.0)
    found, table = measured("tool_length", {"keep": keep}, length, 3.0, some, dialect)
    assert found == pytest.approx([7.0, length, 60.0], abs=0.002)
    assert table == pytest.approx([length if keep == "yes" else 60.0, 6.0], abs=0.002)


def test_the_radius_of_a_tool_is_measured_from_both_sides(some: random.Random) -> None:
    radius = 3.0 + some.uniform(-0.2, 0.2)
    found, table = measured("tool_radius", {"keep": "yes", "most": 15}, 60.0, radius, some, "rs274")
    assert found == pytest.approx([7.0, radius, 3.0], abs=0.002)
    assert table == pytest.approx([60.0, 2.0 * radius], abs=0.004)


@pytest.mark.parametrize(("off", "ends"), [(0.08, False), (-4.0, True)])
def test_a_tool_that_is_another_one_ends_the_program(off: float, ends: bool, some: random.Random) -> None:
    done = ran("tool_check", {"within": 0.1}, 60.0 + off, 3.0, some, "rs274")
    assert (f"T7 is {off:.1f}" in done.error and "another tool, or broken" in done.error) is ends, done.error
    assert told(done)[0] == pytest.approx([7.0, 60.0 + off, 60.0], abs=0.002)
    assert len(told(done)) == (1 if ends else 3)  # nothing behind it is carried out
