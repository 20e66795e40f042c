"""What probing cycles have found: which messages tell it, and that it is there after a restart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from controller.service.probed import FILE, KEPT, Probed, found

BORE = {"cycle": "bore", "values": {"x_mm": -0.25, "diameter_mm": 20.0}}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("bore x_mm=-0.250000 diameter_mm=20.000000", BORE),
        ("mine way=1.5", {"cycle": "mine", "values": {"way": 1.5}}),
        ("bore", None),
        ("turn the part over", None),
        ("bore x_mm=######", None),  # of what has no value
        ("bore x_mm=1.0 and more", None),
        ("bore x_mm=1", None),
        ("Bore x_mm=1.0", None),
    ],
)
def test_a_message_of_a_name_and_values_is_a_result(text: str, told: dict[str, Any] | None) -> None:
    assert found(text) == told


def test_results_are_there_after_a_restart_and_no_more_than_are_kept(tmp_path: Path) -> None:
    kept = Probed(tmp_path)
    for k in range(KEPT + 3):
        kept.add(f"{k}.ngc", [BORE])
    kept.save()
    for told in (kept.told(), Probed(tmp_path).told()):
        assert [row["program"] for row in told] == [f"{k}.ngc" for k in range(KEPT + 2, 2, -1)]
        assert told[0].items() >= BORE.items() and told[0]["at_s"] >= told[-1]["at_s"]


@pytest.mark.parametrize("text", ["", "{}", "[1, null]", "no JSON"])
def test_what_is_not_sound_is_begun_anew(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    kept = Probed(tmp_path)
    kept.add("a.ngc", [BORE])
    assert [row["program"] for row in kept.told()] == ["a.ngc"]
