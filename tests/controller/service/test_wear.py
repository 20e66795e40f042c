"""Wear of a tool: corrections of radius and length beside what the tool table says, and Q below 0."""

from __future__ import annotations

from dataclasses import replace

import pytest

from controller.machine import machine_file, setup_data
from controller.machine.machine_file import ConfigError
from controller.machine.model import Machine, Tool
from controller.motion.motions import SurfaceCut
from controller.program.program import ProgramError
from controller.runtime import checked

TEXT = (machine_file.SHIPPED / "trunnion.toml").read_text() + (
    machine_file.SHIPPED / "tools.toml"
).read_text()
HEAD = "G21 G90 G54 G61\nT2 M6\nS9000 M3\n"
CONE = "G51 X20. Y0. Z0. I0. J0. K0. H10. R15. D40. F1000.\n"


def with_tool_2(**changes: object) -> Machine:
    built = machine_file.load("trunnion")
    tools = (replace(one, **changes) if one.number == 2 else one for one in built.tools)  # type: ignore[arg-type]
    return replace(built, tools=tuple(tools))


def cut(machine: Machine, text: str = CONE, side: str = "G42") -> SurfaceCut:
    task = checked.task(f"{HEAD}{side}\n{text}M30\n".encode(), "part.ngc", machine)
    walk = checked.walk_of(task, None, False)
    return next(one.motion for one in checked.stretches(walk).values() if one.cutting)  # type: ignore[return-value]


def test_a_worn_cutter_is_led_and_looked_at_as_the_cutter_that_it_is() -> None:
    worn = with_tool_2(wear_radius_mm=-0.02, wear_length_mm=-0.1)
    measured = with_tool_2(radius_mm=1.48, length_mm=-0.1)
    found = cut(worn)
    assert found == cut(measured)
    assert (found.offset_mm, found.length_mm) == (pytest.approx(1.48), pytest.approx(-0.1))


def test_g43_takes_the_length_as_it_is() -> None:
    for form in ("G43", "G43 H2"):
        text = f"{HEAD}{form}\nG0 Z100.\n"
        ends = []
        for length in (0.0, -0.1):
            task = checked.task(text.encode(), "part.ngc", with_tool_2(wear_length_mm=length))
            ends.append(list(checked.stretches(checked.path_of(task)).values())[-1].end)
        assert ends[1][2] - ends[0][2] == pytest.approx(-0.1)


def test_a_ball_stays_a_ball_and_the_holder_stays_on_the_spindle() -> None:
    ball = Tool(1, "", 3.0, 50.0, 15.0, corner_mm=3.0, holder=((20.0, 40.0, 8.0),))
    worn = replace(ball, wear_radius_mm=-0.05, wear_length_mm=-0.2).worn
    assert (worn.radius_mm, worn.corner_mm, worn.length_mm) == (2.95, 2.95, 49.8)
    assert worn.holder == ((19.8, 39.8, 8.0),)
    assert worn.worn == worn and ball.worn is ball


@pytest.mark.parametrize(
    ("key", "value"), [("wear_radius_mm", "-0.8"), ("wear_radius_mm", "0.6"), ("wear_length_mm", "-0.51")]
)
def test_more_than_wear_is_refused_with_what_is_allowed(key: str, value: str) -> None:
    with pytest.raises(ConfigError, match=rf"{key}.*0\.5"):
        machine_file.read(TEXT.replace("radius_mm = 1.500", f"radius_mm = 1.500\n{key} = {value}"), "m.toml")


def test_wear_is_read_and_what_the_operator_enters_keeps_it() -> None:
    wear = "radius_mm = 1.500\nwear_radius_mm = -0.01\nwear_length_mm = 0.02"
    machine = machine_file.read(TEXT.replace("radius_mm = 1.500", wear), "m.toml")
    values = {"radius_mm": 1.6, "length_mm": 10.0, "flute_mm": 15.0}
    for entered, wears in ((values, (-0.01, 0.02)), ({**values, "wear_radius_mm": 0.0}, (0.0, 0.02))):
        again = setup_data.with_tool(machine, 2, entered)
        kept = next(one for one in again.tools if one.number == 2)
        assert (kept.radius_mm, kept.wear_radius_mm, kept.wear_length_mm) == (1.6, *wears)
        assert again.tool(2).radius_mm == pytest.approx(1.6 + wears[0])  # type: ignore[union-attr]


def test_q_below_0_brings_the_cutter_nearer() -> None:
    machine = with_tool_2()
    assert cut(machine, side="G42 Q-0.03").offset_mm == pytest.approx(1.47)
    assert cut(machine, side="G41 Q-0.03").offset_mm == pytest.approx(-1.47)


@pytest.mark.parametrize(
    ("side", "radius_mm", "sentence"),
    [("G42 Q-0.6", 1.5, r"Q-0\.6 takes 0\.6 mm more off"), ("G42 Q-0.4", 0.3, r"leaves nothing of T2")],
)
def test_q_below_what_wear_can_be_is_refused(side: str, radius_mm: float, sentence: str) -> None:
    with pytest.raises(ProgramError, match=sentence):
        cut(with_tool_2(radius_mm=radius_mm), side=side)
