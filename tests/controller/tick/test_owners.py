"""Each value of the tick has one owner: nobody writes into the attributes of another room."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from controller import tick

ROOMS = {"modes", "follow", "jogging", "peripherals", "encoder", "answers", "group", "again", "check"}


def written(source: str) -> Iterator[str]:
    """Assignments to attributes of a room that is not ``self``."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            owner = node.value.attr if isinstance(node.value, ast.Attribute) else ast.unparse(node.value)
            if owner.lstrip("_") in ROOMS:
                yield ast.unparse(node)


def test_no_room_of_the_tick_writes_into_another() -> None:
    files = sorted(Path(tick.__file__).parent.glob("*.py"))
    found = {file.name: told for file in files if (told := list(written(file.read_text())))}
    assert len(files) > 5 and not found


def test_a_write_into_another_room_would_be_seen() -> None:
    assert list(
        written("self.modes.mode = 1\nfollow._check.x += 2\nself.own = 3\none.v = 4\nmodes.away: int = 5")
    ) == [
        "self.modes.mode",
        "follow._check.x",
        "modes.away",
    ]
