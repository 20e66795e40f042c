"""Of a function that ``-m`` cannot ask for no case is made; of any other all are."""

from __future__ import annotations

import pytest
from support.suite.asked_marks import is_out

SLOW, LIVE = pytest.mark.slow.mark, pytest.mark.live.mark
SOME_SLOW = pytest.mark.parametrize("n", [1, pytest.param(2, marks=pytest.mark.slow)]).mark
ONCE = pytest.mark.parametrize("n", iter([1, 2])).mark


@pytest.mark.parametrize(
    ("expression", "marks", "out"),
    [
        ("", [SLOW], False),
        ("not slow and not soak", [SLOW], True),
        ("not slow and not soak", [LIVE], False),
        ("not slow", [SOME_SLOW], False),
        ("slow and not live", [SLOW], False),
        ("slow and not live", [SLOW, LIVE], True),
        ("slow and live", [SLOW], True),
        ("slow", [SOME_SLOW], False),
        ("slow", [], True),
        ("slow", [ONCE], False),
        ("slow or live", [], False),
        ("not (slow or live)", [SLOW], False),
    ],
)
def test_a_function_is_left_out_only_where_no_case_of_it_can_be_asked_for(
    expression: str, marks: list[pytest.Mark], out: bool
) -> None:
    assert is_out(expression, marks) is out
