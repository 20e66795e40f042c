"""All rows of a table in one test: where a row takes less time than pytest's own work on a case.

    @each("mode", Mode)
    @each(("code", "told"), ROWS)
    def test_...(mode, code, told): ...

A fixture of the test is the same for all rows. What fails is noted with its row.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any

Test = Callable[..., None]


def each(names: str | tuple[str, ...], rows: Iterable[Any]) -> Callable[[Test], Test]:
    """The test for every one of ``rows``: values of ``names``, or a value where there is one name."""
    table = list(rows)
    assert table, names

    def of(test: Test) -> Test:
        @functools.wraps(test)
        def whole(**others: Any) -> None:
            for row in table:
                values = {names: row} if isinstance(names, str) else dict(zip(names, row, strict=True))
                try:
                    test(**values, **others)
                except BaseException as error:
                    error.add_note(f"with {values}")
                    raise

        asked = inspect.signature(test)
        taken = {names} if isinstance(names, str) else set(names)
        left = [one for name, one in asked.parameters.items() if name not in taken]
        del whole.__wrapped__  # type: ignore[attr-defined]
        whole.__signature__ = asked.replace(parameters=left)  # type: ignore[attr-defined]
        return whole

    return of
