"""What the operator reads of the place where a program is entered, in both languages."""

from __future__ import annotations

import pytest
from support.machines.interrupted_runs import EXAMPLE_2, rest_of
from support.machines.stepped_runs import shipped

from controller.plan.route.spot import Spot
from controller.service import entered

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
    told = entered.told(rest_of(EXAMPLE_2, Spot(SECOND, 0.25), shipped()), language)
    assert len(told) == len(starts)
    for sentence, start in zip(told, starts, strict=True):
        assert sentence.startswith(start) and sentence.endswith(".")
    assert "{" not in "".join(told)
    assert ("coolant off, feed " if language == "en" else "Kühlmittel aus, Vorschub ") in told[2]
