"""What a step changes of an object, so that it can be taken back, or gone on from by another one like it."""

from __future__ import annotations

from operator import attrgetter
from typing import Any


class Changes:
    """Attributes of one kind of object, declared once."""

    __slots__ = ("_names", "of")

    def __init__(self, *names: str) -> None:
        self._names = names
        self.of = attrgetter(*names)  # of an object: their values

    def put(self, owner: object, values: tuple[Any, ...]) -> None:
        """They are as they were."""
        for name, value in zip(self._names, values, strict=True):
            setattr(owner, name, value)
