"""TOML tables that refuse in full sentences and remember which keys were read.

Every refusal is a ``ConfigError`` of one form:
``file:line: table: key = found value: what is wrong; allowed: ...; what to do``.
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
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from controller.geometry.vectors import Vector


class ConfigError(Exception):
    """One sentence that names file, table, key, found value, what is allowed and what to do."""


Place = tuple[str, ...]  # of a table in its file: names, those in an array with "#" and their number


class Known(NamedTuple):
    """What a key may be, what it is where the file is silent, and whether it may not be."""

    allowed: str
    default: object | None
    needed: bool


class Table:
    """One TOML table that remembers which keys were read."""

    def __init__(
        self, file: str, name: str, values: dict[str, Any], text: str = "", place: Place = ()
    ) -> None:
        """``text``: of the whole file, and ``place``: of this table in it; without them no line is told."""
        self.file, self.name, self._values = file, name, values
        self._text, self._place = text, place
        self.known: dict[str, Known] = {}  # what was asked for
        self.below: list[Table] = []  # tables in it that were asked for

    def refuse(self, key: str, problem: str, allowed: str, do: str) -> NoReturn:
        found = f"{key} = {_shown(self._values[key])}" if key in self._values else key
        line = line_of(self._text, (*self._place, key))
        where = f"{self.file}:{line}" if line else self.file
        raise ConfigError(f"{where}: {self.name}: {found}: {problem}; allowed: {allowed}; {do}.")

    def has(self, key: str) -> bool:
        self.known.setdefault(key, Known("", None, False))
        return key in self._values

    def get(self, key: str, allowed: str, default: object = None) -> Any:
        """The raw value, or ``default``; a missing key without default is refused."""
        before = self.known.get(key)
        if before is None or not before.allowed:
            self.known[key] = Known(allowed, default, before is None and default is None)
        if key in self._values:
            return self._values[key]
        if default is not None:
            return default
        near = difflib.get_close_matches(key, self._values.keys() - self.known.keys(), n=1, cutoff=0.7)
        do = f"add the key {key!r}" + (f" (did you mean it by {near[0]!r}?)" if near else "")
        self.refuse(key, "is missing", allowed, do)

    def number(
        self, key: str, lower: float = -math.inf, upper: float = math.inf, default: float | None = None
    ) -> float:
        """A finite number with ``lower <= number <= upper``."""
        allowed = f"a number {span(lower, upper)}"
        value = self._finite(key, allowed, default)
        if not lower <= value <= upper:
            self.refuse(key, "is out of range", allowed, "change the value")
        return value

    def positive(self, key: str, default: float | None = None) -> float:
        """A finite number above zero."""
        value = self._finite(key, "a number above 0", default)
        if value <= 0.0:
            self.refuse(key, "is not above zero", "a number above 0", "change the value")
        return value

    def _finite(self, key: str, allowed: str, default: float | None) -> float:
        value = self.get(key, allowed, default)
        if not is_number(value):
            self.refuse(key, "is not a finite number", allowed, "write one number without quotes")
        return float(value)

    def integer(self, key: str, lower: int, upper: int, default: int | None = None) -> int:
        allowed = f"a whole number from {lower} to {upper}"
        value = self.get(key, allowed, default)
        if type(value) is not int or not lower <= value <= upper:
            self.refuse(key, "is out of range or not whole", allowed, "change the value")
        return value

    def text(self, key: str, choices: Sequence[str] = (), default: str | None = None) -> str:
        allowed = " or ".join(f'"{c}"' for c in choices) or "a text in quotes"
        value = self.get(key, allowed, default)
        if not isinstance(value, str):
            self.refuse(key, "is not a text", allowed, "put it in quotes")
        if choices and value not in choices:
            near = difflib.get_close_matches(value, choices, n=1)
            self.refuse(key, "is not known", allowed, f"write {near[0]!r}" if near else "choose one of these")
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self.get(key, "true or false", default)
        if not isinstance(value, bool):
            self.refuse(key, "is not true or false", "true or false", "write it without quotes")
        return value

    def positive_or_none(self, key: str, unit: float = 1.0) -> float | None:
        """A number above zero times ``unit``, or None where the key is absent."""
        return self.positive(key) * unit if self.has(key) else None

    def numbers(self, key: str, count: int, default: Sequence[float] | None = None) -> tuple[float, ...]:
        allowed = f"{count} numbers in brackets"
        value = self.get(key, allowed, default)
        sound = isinstance(value, list | tuple) and len(value) == count and all(map(is_number, value))
        if not sound:
            self.refuse(key, f"is not a list of {count} finite numbers", allowed, "write all of them")
        return tuple(float(v) for v in value)

    def vector(self, key: str, default: Vector | None = None) -> Vector:
        x, y, z = self.numbers(key, 3, default)
        return (x, y, z)

    def names(self, key: str) -> tuple[str, ...]:
        """A list of texts, each once; none where the key is absent."""
        value, allowed = self.get(key, "a list of names", []), "a list of names in quotes, each once"
        if not isinstance(value, list) or not all(isinstance(v, str) and v for v in value):
            self.refuse(key, "is no list of names", allowed, "put each into quotes")
        if len(set(value)) < len(value):
            self.refuse(key, "has a name twice", allowed, "remove one")
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
        value = self.get(key, "a table", {} if optional else None)
        if not isinstance(value, dict):
            self.refuse(key, "is not a table", f"a table {name}", f"write {name} and its keys below it")
        return self._of(name, value, key)

    def tables(self, key: str) -> list[Table]:
        """The entries of an array of tables, each called by its name or number."""
        value = self.get(key, f"one [[{key}]] table or more", [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            self.refuse(key, "is not an array of tables", f"[[{key}]] tables", "double the brackets")
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
                do = f"did you mean {near[0]!r}" if near else "remove it"
                self.refuse(key, "this key is not known", ", ".join(known), do)


def read_text(path: Path, encoding: str = "utf-8") -> str:
    try:
        return path.read_text(encoding=encoding)
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path.name}: byte {error.start} is not UTF-8; save the file as UTF-8.") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}; check path and permission.") from error


def parse(text: str, file: str) -> Table:
    """The top level of a TOML text; raises ``ConfigError``."""
    try:
        return Table(file, "top level", tomllib.loads(text), text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{file}: is not TOML: {error}; correct that line.") from error


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


def span(lower: float, upper: float) -> str:
    if math.isinf(upper):
        return "of any size" if math.isinf(lower) else f"from {lower:g} on"
    return f"from {lower:g} to {upper:g}"


def _shown(value: object) -> str:
    text = repr(value).replace("'", '"')
    return text if len(text) <= 60 else f"{text[:57]}..."
