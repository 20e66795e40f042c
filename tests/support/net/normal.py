"""Answers as lines "place = value" that do not depend on the last bit, on words, or on this computer."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterator
from pathlib import PurePath
from typing import Any

SAME = 1e-9  # of numbers: absolute, and relative beyond 1
WORDS = frozenset({"error", "sentence", "note", "shown", "told", "text", "remedy", "cause"})
OF_THIS_COMPUTER = frozenset({"stored", "sheets", "took_s", "out", "files"})
PATHS = frozenset({"program", "file"})
DEPTHS = ("mm", "overcut_mm", "undercut_mm")
WHERE = frozenset({"u", "v", "height_mm", "place", "by", "by_line", "at", "x", "y", "z"})  # of a depth


def lines(value: object, place: str = "") -> Iterator[str]:
    """Every value in it, a line each, with the place where it is."""
    if isinstance(value, dict):
        yield from _of_table(value, place)
    elif isinstance(value, list) and value and any(isinstance(one, dict | list) for one in value):
        for k, one in enumerate(value):
            yield from lines(one, f"{place}[{k}]")
    else:
        yield f"{place} = {json.dumps(_plain(value), ensure_ascii=False)}"


def _of_table(value: dict[str, Any], place: str) -> Iterator[str]:
    if not value:
        yield f"{place} = {{}}"
    # Where nothing is off, the place of the largest is one of the last bit.
    depths = [abs(value[key]) for key in DEPTHS if isinstance(value.get(key), int | float)]
    nowhere = WHERE if depths and max(depths) < SAME else frozenset[str]()
    for key, one in value.items():
        below = f"{place}.{key}" if place else str(key)
        if key in WORDS and isinstance(one, str):
            continue
        if key in OF_THIS_COMPUTER or key in nowhere:
            continue
        if key == "warnings":
            yield f"{below} = {len(one)}"
        elif key in PATHS and isinstance(one, str):
            yield f"{below} = {json.dumps(PurePath(one).name)}"
        else:
            yield from lines(one, below)


def _plain(value: object) -> object:
    if isinstance(value, float):
        return round(value, 9) + 0.0  # -0.0 is 0.0
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return value


def differences(before: str, now: str) -> list[str]:
    """Lines that are others, as of a unified diff; numbers by ``SAME``."""
    if before == now:
        return []
    one, other = before.splitlines(), now.splitlines()
    if len(one) == len(other):
        other = [a if _same(a, b) else b for a, b in zip(one, other, strict=True)]
    return list(difflib.unified_diff(one, other, "before", "now", lineterm="", n=0))[2:]


def _same(a: str, b: str) -> bool:
    place, _, value = a.partition(" = ")
    other_place, _, other = b.partition(" = ")
    if place != other_place:
        return False
    try:
        one, two = json.loads(value), json.loads(other)
    except ValueError:
        return value == other
    return _near(one, two)


def _near(one: object, two: object) -> bool:
    if isinstance(one, list) and isinstance(two, list):
        return len(one) == len(two) and all(map(_near, one, two))
    if isinstance(one, float) and isinstance(two, float | int):
        return abs(one - two) <= 2.0 * SAME * max(1.0, abs(one))
    return one == two
