"""What versions before left in a state folder: of the panel, a store of an older schema."""

from __future__ import annotations

import contextlib
from pathlib import Path

from controller import own_database
from controller.api import database


def panel_store(folder: Path, version: int, *rows: str) -> Path:
    """With a schema of then, and what statements put into it."""
    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.closing(own_database.opened(folder / "store.sqlite")) as sql:
        with own_database.transaction(sql):
            own_database.migrate(sql, database.MIGRATIONS[:version], 0)
        for row in rows:
            sql.execute(row)
    return folder / "store.sqlite"
