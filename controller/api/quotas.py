"""How much one asker may have under way of what takes long, so that others have their turn.

An asker is a user, or a script's token, at one address: see ``access.owner_of``.
"""

from __future__ import annotations

import contextlib
import threading
from collections import Counter, OrderedDict, deque
from collections.abc import Iterator
from typing import Generic, TypeVar

from controller.api.answers import Refusal

Owner = tuple[str, str]  # name and address
NOBODY: Owner = ("", "")
MAX_UPLOADS = 4  # of one asker; half of all
MAX_CHECKS = 20  # that wait, of one asker
T = TypeVar("T")


class Quota:
    """What is under way, by asker; of one thread."""

    def __init__(self, key: str, most: int) -> None:
        """``key``: of the refusal's sentence."""
        self._key, self._most = key, most
        self._held = Counter[Owner]()

    @contextlib.contextmanager
    def held(self, owner: Owner) -> Iterator[None]:
        """One more, as long as the block lasts. Raises Refusal 429."""
        check(self._held[owner], owner, self._key, self._most)
        self._held[owner] += 1
        try:
            yield
        finally:
            self._held[owner] -= 1
            if not self._held[owner]:
                del self._held[owner]


def check(count: int, owner: Owner, key: str, most: int) -> None:
    """Raises Refusal 429 where an asker has as many as there may be."""
    if count >= most:
        raise Refusal.of(429, "many", key, name=owner[0], most=most, headers={"Retry-After": "1"})


class Turns(Generic[T]):
    """A queue in which the askers take turns: who asks for a hundred keeps others waiting for one.

    Any thread.
    """

    def __init__(self) -> None:
        self._waiting: OrderedDict[Owner, deque[T]] = OrderedDict()
        self._changed, self._over = threading.Condition(), False

    def put(self, owner: Owner, one: T) -> None:
        with self._changed:
            self._waiting.setdefault(owner, deque()).append(one)
            self._changed.notify()

    def count(self, owner: Owner) -> int:
        """How many of an asker wait."""
        with self._changed:
            return len(self._waiting.get(owner, ()))

    def take(self) -> T | None:
        """The next one, waited for; None: it has come to its end."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._over)
            if self._over:
                return None
            owner, waiting = self._waiting.popitem(last=False)
            one = waiting.popleft()
            if waiting:
                self._waiting[owner] = waiting  # after all others
            return one

    def end(self) -> None:
        """What waits is left."""
        with self._changed:
            self._over = True
            self._changed.notify_all()
