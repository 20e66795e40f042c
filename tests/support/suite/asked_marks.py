"""Which functions ``-m`` can ask for: of the others no case is made, for that is most of collecting them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from typing import Any

import pytest
from _pytest.mark import ParameterSet

TERM = re.compile(r"(not )?(\w+)")


def is_out(expression: str, marks: Iterable[pytest.Mark]) -> bool:
    """Whether no case of a function with these ``marks`` is asked for.

    ``expression``: of ``-m``; one that is more than names and ``not`` joined by ``and`` lets all in.
    """
    terms = [TERM.fullmatch(term.strip()) for term in expression.split(" and ")]
    if not expression or None in terms:
        return False
    own = list(marks)
    tables = [_cases(mark) for mark in own if mark.name == "parametrize"]
    if not all(isinstance(table, Collection) for table in tables):
        return False  # to be looked at but once
    certain = {mark.name for mark in own}
    single = {
        one.name for table in tables for row in table if isinstance(row, ParameterSet) for one in row.marks
    }
    possible = certain | single
    return any(
        term[2] in certain if term[1] else term[2] not in possible for term in terms if term is not None
    )


def _cases(mark: pytest.Mark) -> Any:
    return mark.kwargs.get("argvalues", mark.args[1] if len(mark.args) > 1 else ())
