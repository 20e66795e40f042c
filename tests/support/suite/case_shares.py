"""A share of the long suites, another one in each run: for .ci/run, which is to end within the hour.

``--share N`` keeps every N-th case of each parametrized test, and all tests without cases.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

import pytest


def picked(
    items: Sequence[pytest.Item], one_in: int, seed: int
) -> tuple[list[pytest.Item], list[pytest.Item]]:
    """Kept and left out, in order; of every test at least one case is kept, by ``seed`` which."""
    groups: dict[tuple[str, str], list[pytest.Item]] = {}
    for item in items:
        groups.setdefault((str(item.path), getattr(item, "originalname", item.name)), []).append(item)
    kept: set[pytest.Item] = set()
    for (path, name), cases in groups.items():
        first = random.Random(f"{seed} {path.rpartition('tests')[2]} {name}").randrange(one_in)
        kept.update(cases[first % len(cases) :: one_in])
    return [item for item in items if item in kept], [item for item in items if item not in kept]
