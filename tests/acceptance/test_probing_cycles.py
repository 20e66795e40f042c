"""The probing cycles that ship as programs, on parts whose sizes and places are drawn by chance."""

from __future__ import annotations

import math
import random

import pytest
from support.machines import probing_machine
from support.suite.seed import SEED

from controller.program import linked, probing_cycles
from tests.acceptance.test_probing import told

PERIOD = {"period_s = 0.002": "period_s = 0.01"}  # what a cycle makes of its touches does not hang on it
HEAD = "G21 G90 G54\nT99 M6\nG43 H99\n#<_probe_feed>=900.\n#<_probe_slow>=200.\n"


def cycle(text: str, part: str) -> probing_machine.Probed:
    whole = linked.linked(f"{HEAD}{text}\nG0 Z60\nM30\n".encode(), lambda _: None)
    done = probing_machine.run(whole.decode(), probing_machine.up(part, probing_machine.machine(**PERIOD)))
    assert done.error == ""
    assert done.run.result == "completed", done.run.fault_text
    return done


@pytest.fixture
def some(request: pytest.FixtureRequest) -> random.Random:
    return random.Random(f"{SEED} {request.node.name}")


def block(low: tuple[float, float, float], high: tuple[float, float, float], kind: str = "solid") -> str:
    return f'[[{kind}]]\nkind = "block"\nlow_mm = {list(low)}\nhigh_mm = {list(high)}\n'


def cylinder(x: float, y: float, z: float, radius: float, kind: str = "solid") -> str:
    size = f"centre_mm = [{x}, {y}, {z}]\nradius_mm = {radius}\nheight_mm = 85.0\n"
    return f'[[{kind}]]\nkind = "cylinder"\n{size}'


@pytest.mark.parametrize(("dx", "dy"), [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_an_edge_from_each_side(dx: int, dy: int, some: random.Random) -> None:
    half = some.uniform(10.0, 20.0)
    part = block((-half, -half, -20.0), (half, half, 0.0))
    start = f"G0 Z20\nG0 X{-30 * dx} Y{-30 * dy}\nG0 Z-10\n"
    done = cycle(f"{start}o<probe_edge> call [{dx}] [{dy}] [30] [2]", part)
    assert told(done)[0][0] == pytest.approx(-(dx + dy) * half, abs=0.001)


def corner_sets_the_offset(some: random.Random, before: str = "", behind: str = "") -> None:
    """Lines right before the call of the cycle and behind it change nothing of what it does."""
    x, y = some.uniform(-5, 5), some.uniform(-5, 5)
    part = block((x, y, -20.0), (x + 50, y + 50, 0.0))
    start = f"G0 Z20\nG0 X{x - 12} Y{y - 12}\nG0 Z-10\n{before}"
    call = "o<probe_corner> call [1] [1] [22] [20] [2]\n(DEBUG, #5241 #5242)"
    assert told(cycle(f"{start}{call}{behind}", part))[-1] == pytest.approx([x + 8.0, y + 96.0], abs=0.001)


def test_a_corner_sets_the_offset(some: random.Random) -> None:
    corner_sets_the_offset(some)


def test_a_bore(some: random.Random) -> None:
    x, y, radius = some.uniform(-2, 2), some.uniform(-2, 2), some.uniform(8, 14)
    part = block((-40, -40, -60.0), (40, 40, 0.0)) + cylinder(x, y, 30.0, radius, "hole")
    done = cycle("G0 X0 Y0\nG0 Z-10\no<probe_bore> call [20] [2]\n(DEBUG, #5241 #5242)", part)
    assert told(done)[-2] == pytest.approx([x, y, 2 * radius], abs=0.002)
    assert told(done)[-1] == pytest.approx([x + 8.0, y + 96.0], abs=0.002)


def test_a_boss(some: random.Random) -> None:
    x, y, radius = some.uniform(-2, 2), some.uniform(-2, 2), some.uniform(8, 14)
    done = cycle("G0 X0 Y0\nG0 Z5\no<probe_boss> call [24] [12] [20] [0]", cylinder(x, y, 0.0, radius))
    assert told(done)[-1] == pytest.approx([x, y, 2 * radius], abs=0.002)


@pytest.mark.parametrize("along", ["[1] [0]", "[0] [1]"])
def test_a_pocket_and_a_web(along: str, some: random.Random) -> None:
    low, high = some.uniform(-15, -8), some.uniform(8, 15)
    hole = block((low, low, -30.0), (high, high, 30.0), "hole")
    done = cycle(
        f"G0 X0 Y0\nG0 Z-10\no<probe_pocket> call {along} [30] [0]",
        block((-40, -40, -60), (40, 40, 0)) + hole,
    )
    assert told(done)[-1] == pytest.approx([(low + high) / 2, high - low], abs=0.001)
    done = cycle(
        f"G0 X0 Y0\nG0 Z5\no<probe_web> call {along} [25] [12] [20] [0]",
        block((low, low, -30), (high, high, 0)),
    )
    assert told(done)[-1] == pytest.approx([(low + high) / 2, high - low], abs=0.001)


def test_a_tilted_plane(some: random.Random) -> None:
    a, b, z = some.uniform(-0.05, 0.05), some.uniform(-0.05, 0.05), some.uniform(-3, 3)
    part = f'[[solid]]\nkind = "plane"\npoint_mm = [0.0, 0.0, {z}]\nnormal = [{-a}, {-b}, 1.0]\n'
    done = cycle("G0 X0 Y0\nG0 Z10\no<probe_plane> call [20] [25] [20] [0]", part)
    wanted = [z, math.degrees(math.atan(a)), math.degrees(math.atan(b))]
    assert told(done)[-1] == pytest.approx(wanted, abs=0.002)


@pytest.mark.parametrize("face", ["x", "y"])
def test_an_angle_turns_the_offset(face: str, some: random.Random) -> None:
    turned = some.uniform(-3.0, 3.0)
    part = f"turned_deg = [0.0, 0.0, {turned}]\n" + block((-60, -60, -30), (60, 60, 0))
    start = "G0 Z20\nG0 X-75 Y-20" if face == "x" else "G0 Z20\nG0 X-20 Y-75"
    call = "[1] [0] [40] [30] [2]" if face == "x" else "[0] [1] [40] [30] [2]"
    done = cycle(f"{start}\nG0 Z-10\no<probe_angle> call {call}\n(DEBUG, #5250)", part)
    assert told(done)[-2][0] == pytest.approx(turned, abs=0.005)
    assert told(done)[-1][0] == pytest.approx(turned, abs=0.005)


def by_name(
    name: str,
    values: dict[str, object],
    start: str,
    part: str,
    show: str,
    *unset: str,
    dialect: str = "rs274",
) -> list[list[float]]:
    """A cycle as page, REST and command line run it; what it says, and at the end ``show``."""
    lines, _ = linked.parts(probing_cycles.program(name, values, "G55", unset))
    whole = f"{HEAD}{start}{bytes(lines).decode()}(DEBUG, {show})".encode()
    return told(cycle_of(linked.linked(whole + b"\nG0 Z60.\nM30\n", lambda _: None), part, dialect))


def cycle_of(whole: bytes, part: str, dialect: str) -> probing_machine.Probed:
    made = probing_machine.machine(**{"[machine]\n": f'[machine]\ndialect = "{dialect}"\n', **PERIOD})
    done = probing_machine.run(whole.decode(), probing_machine.up(part, made))
    assert done.error == "" and done.run.result == "completed", (done.error, done.run.fault_text)
    return done


def test_an_edge_by_name_sets_the_offset_that_is_named(some: random.Random) -> None:
    half = some.uniform(10.0, 20.0)
    part = block((-half, -half, -20.0), (half, half, 0.0))
    start = "G10 L2 P2 X8 Y96 Z120\nG0 Z20\nG0 X-30 Y0\nG0 Z-10\n"
    found = by_name("edge", {"towards": "X+", "most": 30}, start, part, "#5241 #5242")
    assert found[0][0] == pytest.approx(-half, abs=0.001)
    assert found[1] == pytest.approx([8.0 - half, 96.0], abs=0.001)


def test_the_height_of_a_face_by_name_sets_an_offset_that_nobody_has_set(some: random.Random) -> None:
    height = some.uniform(-5.0, 5.0)
    part = block((-20.0, -20.0, -20.0), (20.0, 20.0, height))
    found = by_name("top", {"most": 30}, "G0 Z20\nG0 X0 Y0\n", part, "#5243", "G55")
    assert found[0][0] == pytest.approx(height, abs=0.001)
    assert found[1][0] == pytest.approx(120.0 + height, abs=0.001)


@pytest.mark.parametrize("dialect", ["rs274", pytest.param("fanuc", marks=pytest.mark.slow)])
def test_an_angle_by_name_turns_an_offset_that_nobody_has_set(dialect: str, some: random.Random) -> None:
    """It begins as G54, which is turned itself; what is told is seen from there."""
    turned, before = some.uniform(-3.0, 3.0), some.uniform(-1.0, 1.0)
    part = f"turned_deg = [0.0, 0.0, {turned}]\n" + block((-60, -60, -30), (60, 60, 0))
    start = f"G10 L2 P1 X8. Y96. Z120. R{before:.9f}\nG0 Z20.\nG0 X-75. Y-20.\nG0 Z-10.\n"
    values = {"towards": "X+", "along": 40, "most": 30}
    shown = "#5241 #5242 #5243" + (" #5250" if dialect == "rs274" else "")  # Fanuc has none of a turn
    found = by_name("angle", values, start, part, shown, "G55", dialect=dialect)
    assert found[0][0] == pytest.approx(turned - before, abs=0.005)
    assert found[1] == pytest.approx([8.0, 96.0, 120.0, turned][: len(shown.split())], abs=0.005)


def test_a_corner_is_found_in_mm_where_the_program_counts_in_inches(some: random.Random) -> None:
    corner_sets_the_offset(some, "G20 G91\n", "\nG21 G90")


def probe_of(name: str, values: dict[str, object], start: str, part: str) -> list[list[float]]:
    """A cycle of the probe itself; at the end its length and diameter as the tool table has them then."""
    lines, _ = linked.parts(probing_cycles.program(name, values, "none"))
    whole = f"{HEAD}{start}{bytes(lines).decode()}G43 H99\n(DEBUG, #5403 #5410)".encode()
    return told(cycle_of(linked.linked(whole + b"\nG0 Z60.\nM30\n", lambda _: None), part, "rs274"))


PRETRAVEL = "[probe]\npretravel_mm = 0.012\n"


def test_a_ring_tells_the_ball_as_it_touches_in_every_direction(some: random.Random) -> None:
    x, y = some.uniform(-1, 1), some.uniform(-1, 1)
    ring = PRETRAVEL + block((-40, -40, -60.0), (40, 40, 0.0)) + cylinder(x, y, 30.0, 12.5, "hole")
    values = {"diameter": 25.0, "most": 12, "keep": "yes"}
    *_, found, table = probe_of("ring", values, "G0 X0 Y0\nG0 Z-10\n", ring)
    radius, was, *by_direction = found
    assert radius == pytest.approx(was - 0.012, abs=0.001) and len(by_direction) == 8
    assert by_direction == pytest.approx([was - 0.012] * 8, abs=0.002)
    assert table[1] == pytest.approx(2.0 * radius, abs=1e-5)


def test_a_sphere_tells_the_ball_and_where_it_is(some: random.Random) -> None:
    x, y, z = (some.uniform(-1, 1) for _ in range(3))
    ball = f'{PRETRAVEL}[[solid]]\nkind = "sphere"\ncentre_mm = [{x}, {y}, {z}]\nradius_mm = 12.7\n'
    values = {"diameter": 25.4, "most": 25, "keep": "yes"}
    *_, found, table = probe_of("sphere", values, "G0 X0 Y0\nG0 Z20\n", ball)
    assert found[:2] == pytest.approx([x, y], abs=0.002)
    assert found[2] == pytest.approx(z, abs=0.002)
    assert found[3] == pytest.approx(found[4] - 0.012, abs=0.001)
    assert table[1] == pytest.approx(2.0 * found[3], abs=1e-5)


def test_a_face_of_known_height_tells_the_length_of_the_probe(some: random.Random) -> None:
    """It lies 0.05 mm higher than a probe of the length of the table finds it."""
    height = round(some.uniform(-5.0, 5.0), 6)
    face = block((-20.0, -20.0, -20.0), (20.0, 20.0, height))
    values = {"height": height + 0.05, "most": 40, "keep": "yes"}
    *_, found, table = probe_of("gauge", values, "G0 X0 Y0\nG0 Z20\n", face)
    assert found[0] == pytest.approx(found[1] - 0.05, abs=0.001)
    assert table[0] == pytest.approx(found[0], abs=1e-5)
