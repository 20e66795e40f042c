"""What the operator reads of the place where a program is entered, in both languages."""

from __future__ import annotations

import pytest
from support.machines.interrupted_runs import EXAMPLE_2, rest_of
from support.machines.stepped_runs import shipped

from controller.machine.kinematics import kinematics_of
from controller.messages import text
from controller.plan.restart.program_position import Spot
from controller.runtime import entry_state

SECOND = 19  # line of the second surface of Example 2


@pytest.mark.parametrize(
    ("language", "starts"),
    [
        (
            "en",
            ("Line 19, 25.0 % of its block (cut).", "Tool T2 (radius 1.500 mm", "Spindle 12000", "Entry "),
        ),
        (
            "de",
            ("Zeile 19, 25.0 % des Satzes (Schnitt).", "Werkzeug T2 (Radius 1.500", "Spindel 12000", "Ein"),
        ),
    ],
)
def test_the_state_at_a_place_inside_of_a_surface_is_told(language: str, starts: tuple[str, ...]) -> None:
    told = [
        text(one, language) for one in entry_state.messages(rest_of(EXAMPLE_2, Spot(SECOND, 0.25), shipped()))
    ]
    assert len(told) == len(starts)
    for sentence, start in zip(told, starts, strict=True):
        assert sentence.startswith(start) and sentence.endswith(".")
    assert "{" not in "".join(told)
    assert ("coolant off, feed " if language == "en" else "Kühlmittel aus, Vorschub ") in told[2]


TILTED = """G21 G90 G54 G61 T1 M6
S8000 M3
G0 X0. Y0. Z60.
G68.2 X5. Y6. Z7. J20.
G53.1
G0 X1. Y2. Z20.
G1 X10. Y-3. Z5. F1500.
G69
M30
"""


@pytest.mark.parametrize(
    ("language", "sentence"),
    [
        (
            "en",
            "Tilted plane, seen from the table at zero: origin X13.0000 Y102.0000 Z127.0000, X along I1.0000",
        ),
        ("de", "Geschwenkte Ebene, gesehen vom Tisch in Null: Ursprung X13.0000 Y102.0000 Z127.0000, X"),
    ],
)
def test_a_tilted_plane_is_told_and_entered(language: str, sentence: str) -> None:
    rest = rest_of(TILTED, Spot(7, 0.5), shipped(dialect="fanuc", without_point="unit"))
    told = [text(one, language) for one in entry_state.messages(rest)]
    assert len(told) == 5 and told[2].startswith(sentence) and told[2].endswith("K0.9397.")
    kinematics = kinematics_of(rest.source.machine)
    tip, axis = kinematics.forward(rest.target.joints, 0.0)
    plane = rest.target.modal.frame(rest.source.machine)
    assert plane.from_parent(tip) == pytest.approx((5.5, -0.5, 12.5)) and axis == pytest.approx(plane.z)


# The modal codes that an operator reads are those that the program has said.

START = "G17 G49 G54 G61"
