"""What is reported of a program that is loaded, beside its check."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.machines.planning_bench import Bench
from support.machines.stepped_runs import shipped

from controller.runtime.plan_messages import Program


@pytest.mark.parametrize(
    ("text", "offset"),
    [
        ("G1 X1 F600\n", "G54"),
        ("G10 L2 P3 X1 Y2 Z3\nG53 G0 Z90\nG56 G0 X1\nG54 G0 X0\n", "G56"),
        ("S900 M3\n", None),
    ],
)
def test_the_work_offset_that_a_start_names_is_that_of_the_first_motion_by_it(
    tmp_path: Path, text: str, offset: str | None
) -> None:
    bench = Bench(tmp_path, shipped())
    answer = bench.order(
        "check", program=Program(f"G21 G90\n{text}M30\n".encode(), "part.ngc", bench.machine)
    )
    assert answer.facts["offset"] == offset
