"""TOML tables that refuse in full sentences and remember which keys were read.

Every refusal is a ``ConfigError`` of one form:
``file:line: table: key = found value: what is wrong; allowed: ...; what to do``,
a text of the catalogue with its values.
A key that nothing reads is an error too (``Table.finish``), because a misspelt limit
would be a missing limit. What a table was asked for, with range and default, is what its
file may say: ``Table.known``, of which the reference in ``config/`` is made.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from controller.geometry.vectors import Vector
from controller.messages import Key, Said, chain, plain, said, text


class ConfigError(Exception):
    """One sentence that names file, table, key, found value, what is allowed and what to do: ``said``.

    As a str it is English. Its texts have keys that begin with ``file.``.
    """

    def __init__(self, said: Said) -> None:
        super().__init__(said)
        self.said = said

    def __str__(self) -> str:
        return text(self.said)


Place = tuple[str, ...]  # of a table in its file: names, those in an array with "#" and their number


class Known(NamedTuple):
    """What a key may be, what it is where the file is silent, and whether it may not be."""

    may_be: Said | str
    default: object | None
    needed: bool

    @property
    def allowed(self) -> str:
        """``may_be`` in English."""
        return text(plain(self.may_be))


class Table:
    """One TOML table that remembers which keys were read."""

    def __init__(
        self, file: str, name: Said | str, values: dict[str, Any], text: str = "", place: Place = ()
    ) -> None:
        """``name``: as it is shown. ``text``: of the whole file, and ``place``: of this table in it; without
        them no line is named.
        """
        self.file, self.name, self._values = file, name, values
        self._text, self._place = text, place
        self.known: dict[str, Known] = {}  # what was asked for
        self.below: list[Table] = []  # tables in it that were asked for

    def refuse(self, key: str, what: str, /, **values: object) -> NoReturn:
        """``what``: the text ``file.<what>``, of what is wrong, what is allowed and what to do."""
        found = f"{key} = {_shown(self._values[key])}" if key in self._values else key
        line = line_of(self._text, (*self._place, key))
        where = f"{self.file}:{line}" if line else self.file
        wrong = said(f"file.{what}", **values)
        raise ConfigError(said("file.refused", where=where, table=self.name, found=found, what=wrong))

    def has(self, key: str) -> bool:
        self.known.setdefault(key, Known("", None, False))
        return key in self._values

    def get(self, key: str, allowed: Said | str, default: object = None) -> Any:
        """The raw value, or ``default``; a missing key without default is refused."""
        before = self.known.get(key)
        if before is None or not before.may_be:
            self.known[key] = Known(allowed, default, before is None and default is None)
        if key in self._values:
            return self._values[key]
        if default is not None:
            return default
        near = difflib.get_close_matches(key, self._values.keys() - self.known.keys(), n=1, cutoff=0.7)
        do = said("file.add_or", key=key, near=near[0]) if near else said("file.add", key=key)
        self.refuse(key, "missing", allowed=allowed, do=do)

    def number(
        self, key: str, lower: float = -math.inf, upper: float = math.inf, default: float | None = None
    ) -> float:
        """A finite number with ``lower <= number <= upper``."""
        allowed = said("file.may.number", span=span(lower, upper))
        value = self._finite(key, allowed, default)
        if not lower <= value <= upper:
            self.refuse(key, "out_of_range", allowed=allowed)
        return value

    def positive(self, key: str, default: float | None = None) -> float:
        """A finite number above zero."""
        value = self._finite(key, said("file.may.positive"), default)
        if value <= 0.0:
            self.refuse(key, "not_positive")
        return value

    def _finite(self, key: str, allowed: Said, default: float | None) -> float:
        value = self.get(key, allowed, default)
        if not is_number(value):
            self.refuse(key, "no_number", allowed=allowed)
        return float(value)

    def integer(self, key: str, lower: int, upper: int, default: int | None = None) -> int:
        allowed = said("file.may.integer", lower=lower, upper=upper)
        value = self.get(key, allowed, default)
        if type(value) is not int or not lower <= value <= upper:
            self.refuse(key, "no_integer", allowed=allowed)
        return value

    def text(self, key: str, choices: Sequence[str] = (), default: str | None = None) -> str:
        allowed = chain("or", [f'"{c}"' for c in choices]) if choices else said("file.may.text")
        value = self.get(key, allowed, default)
        if not isinstance(value, str):
            self.refuse(key, "no_text", allowed=allowed)
        if choices and value not in choices:
            near = difflib.get_close_matches(value, choices, n=1)
            do = said("file.write", near=near[0]) if near else said("file.choose")
            self.refuse(key, "no_choice", allowed=allowed, do=do)
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self.get(key, said("file.may.flag"), default)
        if not isinstance(value, bool):
            self.refuse(key, "no_flag")
        return value

    def positive_or_none(self, key: str, unit: float = 1.0) -> float | None:
        """A number above zero times ``unit``, or None where the key is absent."""
        return self.positive(key) * unit if self.has(key) else None

    def numbers(self, key: str, count: int, default: Sequence[float] | None = None) -> tuple[float, ...]:
        allowed = said("file.may.numbers", count=count)
        value = self.get(key, allowed, default)
        sound = isinstance(value, list | tuple) and len(value) == count and all(map(is_number, value))
        if not sound:
            self.refuse(key, "no_numbers", count=count, allowed=allowed)
        return tuple(float(v) for v in value)

    def vector(self, key: str, default: Vector | None = None) -> Vector:
        x, y, z = self.numbers(key, 3, default)
        return (x, y, z)

    def names(self, key: str) -> tuple[str, ...]:
        """A list of texts, each once; none where the key is absent."""
        value, allowed = self.get(key, said("file.may.name_list"), []), said("file.may.names")
        if not isinstance(value, list) or not all(isinstance(v, str) and v for v in value):
            self.refuse(key, "no_names", allowed=allowed)
        if len(set(value)) < len(value):
            self.refuse(key, "name_twice", allowed=allowed)
        return tuple(value)

    @property
    def key(self) -> str:
        """That the table itself has in its file; "" of the top level."""
        return self._place[-1].split("#")[0] if self._place else ""

    @property
    def written(self) -> list[str]:
        """The keys of a table whose keys are the file's own names."""
        return list(self._values)

    def table(self, key: str, name: str, optional: bool = False) -> Table:
        value = self.get(key, said("file.may.table"), {} if optional else None)
        if not isinstance(value, dict):
            self.refuse(key, "no_table", name=name)
        return self._of(name, value, key)

    def tables(self, key: str) -> list[Table]:
        """The entries of an array of tables, each called by its name or number."""
        value = self.get(key, said("file.may.tables", key=key), [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            self.refuse(key, "no_tables", key=key)
        called = [v.get("name", v.get("number", i + 1)) for i, v in enumerate(value)]
        rows = enumerate(zip(called, value, strict=True), 1)
        return [self._of(f"[[{key}]] {name}", entry, f"{key}#{n}") for n, (name, entry) in rows]

    def _of(self, name: str, values: dict[str, Any], place: str) -> Table:
        self.below.append(Table(self.file, name, values, self._text, (*self._place, place)))
        return self.below[-1]

    def entry(self, key: str, name: str) -> Table:
        """The entry of an array of tables that has this name. Raises KeyError."""
        for n, values in enumerate(self._values.get(key, ()), 1):
            if values.get("name") == name:
                return self._of(f"[[{key}]] {name}", values, f"{key}#{n}")
        raise KeyError(name)

    def finish(self) -> None:
        """Refuse what nothing has read."""
        for key in self._values:
            if key not in self.known:
                known = sorted(self.known)
                near = difflib.get_close_matches(key, known, n=1, cutoff=0.4)
                do = said("file.mean", near=near[0]) if near else said("file.remove")
                self.refuse(key, "unknown_key", allowed=", ".join(known), do=do)


def read_text(path: Path, encoding: str = "utf-8") -> str:
    try:
        return path.read_text(encoding=encoding)
    except UnicodeDecodeError as error:
        raise ConfigError(said("file.not_utf8", file=path.name, byte=error.start)) from error
    except OSError as error:
        raise ConfigError(said("file.unread", file=path, why=error)) from error


def parse(text: str, file: str) -> Table:
    """The top level of a TOML text; raises ``ConfigError``."""
    try:
        return Table(file, Key("file.top_level"), _values_of(text), text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(said("file.no_toml", file=file, why=error)) from error


@lru_cache(16)
def _values_of(text: str) -> dict[str, Any]:
    """Nobody changes them; a machine, its tools and its drives' profiles are asked for again and again."""
    return tomllib.loads(text)


HEAD = re.compile(r"\s*(\[\[?)\s*([^\]#]+?)\s*\]")
KEY = re.compile(r"\s*([\w.\"'-]+)\s*=")


def line_of(text: str, wanted: Place) -> int | None:
    """The line of a key, or of the nearest thing around it that the text has; None where it has nothing."""
    nearest, depth = None, 0
    for number, place in _places(text):
        alike = len(place) if _leads(place, wanted) else 0
        if alike > depth:
            nearest, depth = number, alike
    return nearest


def _leads(place: Place, wanted: Place) -> bool:
    """Whether what stands at ``place`` is ``wanted``, or around it; an array in brackets has no numbers."""
    if len(place) > len(wanted) or place[:-1] != wanted[: len(place) - 1]:
        return False
    ahead = wanted[len(place) - 1]
    return place[-1] in (ahead, ahead.split("#")[0])


def _places(text: str) -> Iterator[tuple[int, Place]]:
    """Line by line what a text says: heads of tables and keys."""
    counts: Counter[str] = Counter()
    table: Place = ()
    for number, line in enumerate(text.splitlines(), 1):
        if head := HEAD.match(line):
            names = [name.strip("\"' ") for name in head[2].split(".")]
            if head[1] == "[[":
                counts[".".join(names)] += 1
            whole = [".".join(names[: n + 1]) for n in range(len(names))]
            table = tuple(f"{n}#{counts[w]}" if counts[w] else n for n, w in zip(names, whole, strict=True))
            yield number, table
        elif key := KEY.match(line):
            yield number, (*table, *(name.strip("\"'") for name in key[1].split(".")))


def is_number(value: Any) -> bool:
    return type(value) in (int, float) and -1e300 < value < 1e300  # also refuses nan


def span(lower: float, upper: float) -> Said:
    if math.isinf(upper):
        return said("file.span.any") if math.isinf(lower) else said("file.span.from", lower=lower)
    return said("file.span", lower=lower, upper=upper)


def _shown(value: object) -> str:
    text = repr(value).replace("'", '"')
    return text if len(text) <= 60 else f"{text[:57]}..."
