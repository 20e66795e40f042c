"""What one program sets the next one finds: through the file, to the last digit that counts."""

from __future__ import annotations

import json
import random
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from support.oracles import reference_interpreter

from controller.machine import changes, machine_file, setup_data
from controller.machine.model import Machine
from controller.plan.report import explained
from controller.program import blocks
from controller.program.position import homed
from controller.program.program import ProgramError, Setting

HEAD = "G21 G90 G54 G80 G40 G49\n"
ENDS = (
    "G0 X1 Y2 Z3 A4 C5",
    "G55 G0 X1 Y2 Z3 A4 C5",
    "G59.3 G0 X1 Y2 Z3 C7",
    "G43 H2 G0 Z9",
    "G28 Y3",
    "G30",
    "X#500",
)


def base(dialect: str = "rs274") -> Machine:
    return reference_interpreter.machine(dialect, kept=((500, 510),), without_point="unit")


def left(text: str, on: Machine, values: Mapping[str, Any]) -> dict[str, Any]:
    """What is fitted behind a program, as its file would have it."""
    made = dict(values)
    for block in blocks.stream(text.encode(), setup_data.applied(on, values), "p.ngc"):
        if isinstance(block, Setting):
            made = changes.laid(made, setup_data.applied(on, made), block.changes)
    return dict(json.loads(json.dumps(made)))


def axes(text: str, on: Machine) -> list[dict[str, float | None]]:
    """Where the rapids of a program lead."""
    read = blocks.stream(text.encode(), on, "p.ngc")
    found = explained.steps(read, on, "p.ngc", homed(on))
    return [step.axes for step in found if step.kind == "rapid"]


def a_line(of: random.Random) -> str:
    x, y, z, r = (round(of.uniform(-40.0, 40.0), 3) for _ in range(4))
    p = of.randint(1, 9)
    return of.choice(
        (
            f"G10 L2 P{p} X{x} Y{y} Z{z}",
            f"G10 L2 P{p} X{x} C{z} R{r}",
            f"G10 L20 P{p} X{x} A{y}",
            f"G10 L1 P2 Z{z} R{abs(r) + 1.0}",
            f"G10 L10 P2 Z{z}",
            f"G92 X{x} C{y}",
            *("G92.1", "G92.2", "G92.3"),
            *("G28.1", "G30.1"),
            f"#500=[#500+{x}]",
            f"G0 X{x} Z{z} C{r}",
        )
    )


@pytest.mark.parametrize("seed", range(15))
def test_two_programs_lead_as_one(seed: int) -> None:
    of = random.Random(seed)
    first = "".join(a_line(of) + "\n" for _ in range(of.randint(1, 12)))
    stand = "G0 G53 X0 Y0 Z0 A0 C0\n"  # where the second begins, too
    behind = HEAD + stand + "".join(f"{line}\n" for line in ENDS)
    on = base()
    at_zero = replace(on, axes=tuple(replace(a, homing=replace(a.homing, position=0.0)) for a in on.axes))
    values = left(HEAD + first, at_zero, {})
    alone = axes(behind, setup_data.applied(at_zero, values))
    whole = axes(HEAD + first + behind, at_zero)[-len(alone) :]
    for one, other in zip(alone, whole, strict=True):
        assert one == pytest.approx(other, abs=1e-9), (first, values)


def test_a_program_that_is_refused_behind_it_has_set_what_stands_before() -> None:
    """As far as it is read: that it is run to there first is the service's matter."""
    on = base()
    with pytest.raises(ProgramError):
        left("G10 L2 P1 X5\nG10 L2 P77 X1\n", on, {})


def test_only_parameters_that_the_machine_keeps_are_kept() -> None:
    on, text = base(), "#500=5 #31=2\n#<_name>=3\n#511=1\nG0 X#500\n"
    assert left(text, on, {}) == {"parameters": {"500": 5.0}}
    again = setup_data.applied(on, {"parameters": {"500": 5.0}})
    assert axes("G0 X[#500+#31]\n", again)[0]["X"] == 5.0
    with pytest.raises(ProgramError, match="has no value"):
        axes("G0 X#<_name>\n", again)
    assert setup_data.applied(replace(on, kept=()), {"parameters": {"500": 5.0}}).parameters == ()


def test_fanucs_wear_stays_beside_the_length() -> None:
    on = base("fanuc")
    values = left("G90\nG10 L10 P2 R12.\nG10 L11 P2 R-0.2\nG91\nG10 L11 P2 R-0.1\n", on, {})
    tool = values["tools"]["2"]
    assert (tool["length_mm"], tool["wear_length_mm"]) == pytest.approx((12.0, -0.3))
    length = setup_data.applied(on, values).tool(2)
    assert length is not None and length.length_mm == pytest.approx(11.7)


def test_what_is_measured_anew_is_worn_no_more() -> None:
    on = setup_data.applied(
        base(), {"tools": {"2": {"radius_mm": 2, "length_mm": 9, "flute_mm": 5, "wear_length_mm": -0.25}}}
    )
    tool = left("G10 L1 P2 Z8\n", on, {})["tools"]["2"]
    assert (tool["length_mm"], tool["wear_length_mm"], tool["radius_mm"]) == (8.0, 0.0, 2.0)


def test_one_can_go_back_to_the_file_one_by_one() -> None:
    on = base()
    values = left("G10 L2 P2 X5\nG92 X1\n#500=1\nG10 L1 P2 Z3\nG28.1\n", on, {})
    assert set(setup_data.names(values)) == {"G55", "T2", "G92", "G28", "#500"}
    told = setup_data.to_json(setup_data.applied(on, values), values)
    assert told["offsets"]["G55"]["source"] == "machine" and told["offsets"]["G54"]["source"] == "file"
    assert told["shift"]["source"] == told["references"]["G28"]["source"] == "machine"
    assert told["references"]["G30"]["source"] == "file"
    for name in setup_data.names(values):
        values = setup_data.without(values, name)
    assert setup_data.applied(on, values) == setup_data.applied(on, {})
    with pytest.raises(KeyError):
        setup_data.without(values, "G55")


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("[30]", "cannot be kept"),
        ("[[9, 5]]", "cannot be kept"),
        ('["a"]', "cannot be kept"),
        ("7", "cannot be kept"),
    ],
)
def test_parameters_that_cannot_be_kept_are_refused(value: str, why: str) -> None:
    text = machine_file.load("trunnion").text.replace(
        "[machine]\n", f"[machine]\nkept_parameters = {value}\n", 1
    )
    with pytest.raises(machine_file.ConfigError, match=why):
        machine_file.read(text, "m.toml")
    fine = text.replace(value, "[100, [500, 549]]", 1)
    assert machine_file.read(fine, "m.toml").kept == ((100, 100), (500, 549))
