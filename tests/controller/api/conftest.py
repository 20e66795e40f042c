"""What holds for the tests of the panel: the stores that a module opened are closed behind it.

FastAPI remembers what it has made of an application, and so the application with its store.

And requests are only made up for tests that are run: it takes seconds for each test of every operation.
"""

from __future__ import annotations

import weakref
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from _pytest.mark.expression import Expression

from controller.api.database import Database


@pytest.fixture(autouse=True, scope="module")
def closed_stores() -> Iterator[None]:
    opened: weakref.WeakSet[Database] = weakref.WeakSet()

    def noted(database: Database, folder: Path) -> None:
        open_it(database, folder)
        opened.add(database)

    open_it = Database.__init__
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Database, "__init__", noted)
        yield
    for database in list(opened):
        database.close()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_pycollect_makeitem(collector: pytest.Collector, obj: Any) -> Generator[None, Any, Any]:
    made, asked = (yield), collector.config.getoption("markexpr")
    if not asked or not type(made).__module__.startswith("schemathesis"):
        return made
    marks = {mark.name for mark in getattr(obj, "pytestmark", ())}
    return made if Expression.compile(asked).evaluate(lambda name, **_: name in marks) else []
