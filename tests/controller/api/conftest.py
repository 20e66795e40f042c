"""What holds for the tests of the panel: the stores that a module opened are closed behind it.

FastAPI remembers what it has made of an application, and so the application with its store.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

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
