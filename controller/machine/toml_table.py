"""TOML tables that refuse in full sentences and remember which keys were read.

Every refusal is a ``ConfigError`` of one form:
``file:line: table: key = found value: what is wrong; allowed: ...; what to do``,
a text of the catalogue with its values.
A key that nothing reads is an error too (``Table.finish``), because a misspelt limit
would be a missing limit. Tables whose keys are declared are read by ``reading``.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn

from controller.geometry.vectors import Vector
from controller.messages import Key, Message, chain, message, several, text


class ConfigError(Exception):
    """What is wrong with a file, each mistake one sentence that names file, table, key, found value, what is
    allowed and what to do: ``said``, a text whose keys begin with ``file.``. As a str it is English.
    """

    def __init__(self, said: Message, file: str = "", line: int = 0, place: Place = ()) -> None:
        """``line``: of the file, from 1; 0: none is known. ``place``: of the key in it."""
        super().__init__(said)
        self.said, self.file, self.line, self.place = said, file, line, place
        self._several: tuple[ConfigError, ...] = ()

    @property
    def mistakes(self) -> tuple[ConfigError, ...]:
        """All of them, in the order of their lines; of a single one that itself."""
        return self._several or (self,)

    def __str__(self) -> str:
        return text(self.said)

    @classmethod
    def of_all(cls, errors: Iterable[ConfigError]) -> ConfigError:
        """One error of several: their mistakes by file, as these come, and by line, each once."""
        every = [one for error in errors for one in error.mistakes]
        found = [one for k, one in enumerate(every) if one.said not in [other.said for other in every[:k]]]
        files = list(dict.fromkeys(one.file for one in found))
        found.sort(key=lambda one: (files.index(one.file), one.line))
        first = found[0]
        whole = cls(several(*(one.said for one in found)), first.file, first.line, first.place)
        whole._several = tuple(found)
        return whole if len(found) > 1 else first


Place = tuple[str, ...]  # of a table in its file: names, those in an array with "#" and their number


NOWHERE: Mapping[str, str] = {}


class Table:
    """One TOML table that remembers which keys were read."""

    def __init__(
        self, file: str, name: Message | str, values: dict[str, Any], text: str = "", place: Place = ()
    ) -> None:
        """``name``: as it is shown. ``text``: of the whole file, and ``place``: of this table in it; without
        them no line is named.
        """
        self.file, self.name, self._values = file, name, values
        self._text, self._place = text, place
        self.known: set[str] = set()  # what was asked for
        self._meant: set[str] = set()  # what was taken for another key misspelt

    def refuse(self, key: str, what: str, /, **values: object) -> NoReturn:
        """``what``: the text ``file.<what>``, of what is wrong, what is allowed and what to do."""
        raise self.refusal(key, what, **values)

    def refusal(self, key: str, what: str, /, **values: object) -> ConfigError:
        found = f"{key} = {_shown(self._values[key])}" if key in self._values else key
        place = (*self._place, key)
        line = line_of(self._text, place)
        where = f"{self.file}:{line}" if line else self.file
        wrong = message(f"file.{what}", **values)
        whole = message("file.refused", where=where, table=self.name, found=found, what=wrong)
        return ConfigError(whole, self.file, line or 0, place)

    def has(self, key: str) -> bool:
        self.known.add(key)
        return key in self._values

    def holds(self, key: str) -> bool:
        """Whether the file has it; that does not count as asked for."""
        return key in self._values

    def get(self, key: str, allowed: Message | str, default: object = None) -> Any:
        """The raw value, or ``default``; a missing key without default is refused."""
        self.known.add(key)
        if key in self._values:
            return self._values[key]
        if default is not None:
            return default
        raise self.missing(key, allowed)

    def missing(self, key: str, allowed: Message | str) -> ConfigError:
        """The refusal of a file without this key."""
        near = difflib.get_close_matches(key, self._values.keys() - self.known, n=1, cutoff=0.7)
        self._meant.update(near)
        do = message("file.add_or", key=key, near=near[0]) if near else message("file.add", key=key)
        return self.refusal(key, "missing", allowed=allowed, do=do)

    def number(
        self, key: str, lower: float = -math.inf, upper: float = math.inf, default: float | None = None
    ) -> float:
        """A finite number with ``lower <= number <= upper``."""
        allowed = message("file.may.number", span=span(lower, upper))
        value = self._finite(key, allowed, default)
        if not lower <= value <= upper:
            self.refuse(key, "out_of_range", allowed=allowed)
        return value

    def positive(self, key: str, default: float | None = None) -> float:
        """A finite number above zero."""
        value = self._finite(key, message("file.may.positive"), default)
        if value <= 0.0:
            self.refuse(key, "not_positive")
        return value

    def _finite(self, key: str, allowed: Message, default: float | None) -> float:
        value = self.get(key, allowed, default)
        if not is_number(value):
            self.refuse(key, "no_number", allowed=allowed)
        return float(value)

    def integer(self, key: str, lower: int, upper: int, default: int | None = None) -> int:
        allowed = message("file.may.integer", lower=lower, upper=upper)
        value = self.get(key, allowed, default)
        if type(value) is not int or not lower <= value <= upper:
            self.refuse(key, "no_integer", allowed=allowed)
        return value

    def text(self, key: str, choices: Sequence[str] = (), default: str | None = None) -> str:
        allowed = chain("or", [f'"{c}"' for c in choices]) if choices else message("file.may.text")
        value = self.get(key, allowed, default)
        if not isinstance(value, str):
            self.refuse(key, "no_text", allowed=allowed)
        if choices and value not in choices:
            near = difflib.get_close_matches(value, choices, n=1)
            do = message("file.write", near=near[0]) if near else message("file.choose")
            self.refuse(key, "no_choice", allowed=allowed, do=do)
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self.get(key, message("file.may.flag"), default)
        if not isinstance(value, bool):
            self.refuse(key, "no_flag")
        return value

    def positive_or_none(self, key: str, unit: float = 1.0) -> float | None:
        """A number above zero times ``unit``, or None where the key is absent."""
        return self.positive(key) * unit if self.has(key) else None

    def numbers(self, key: str, count: int, default: Sequence[float] | None = None) -> tuple[float, ...]:
        allowed = message("file.may.numbers", count=count)
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
        value, allowed = self.get(key, message("file.may.name_list"), []), message("file.may.names")
        if not isinstance(value, list) or not all(isinstance(v, str) and v for v in value):
            self.refuse(key, "no_names", allowed=allowed)
        if len(set(value)) < len(value):
            self.refuse(key, "name_twice", allowed=allowed)
        return tuple(value)

    @property
    def written(self) -> list[str]:
        """The keys of a table whose keys are the file's own names."""
        return list(self._values)

    def table(self, key: str, name: str, optional: bool = False) -> Table:
        value = self.get(key, message("file.may.table"), {} if optional else None)
        if not isinstance(value, dict):
            self.refuse(key, "no_table", name=name)
        return self._of(name, value, key)

    def tables(self, key: str) -> list[Table]:
        """The entries of an array of tables, each called by its name or number."""
        value = self.get(key, message("file.may.tables", key=key), [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            self.refuse(key, "no_tables", key=key)
        called = [v.get("name", v.get("number", i + 1)) for i, v in enumerate(value)]
        rows = enumerate(zip(called, value, strict=True), 1)
        return [self._of(f"[[{key}]] {name}", entry, f"{key}#{n}") for n, (name, entry) in rows]

    def _of(self, name: str, values: dict[str, Any], place: str) -> Table:
        return Table(self.file, name, values, self._text, (*self._place, place))

    def refuse_misspelt(self, key: str, known: Collection[str]) -> None:
        """Refuse what is none of the keys ``known``, but so near to ``key`` that it is meant."""
        foreign = [one for one in self._values if one not in known and one not in self._meant]
        if near := difflib.get_close_matches(key, foreign, n=1, cutoff=0.7):
            self._meant.update(near)
            raise self.unknown(near[0], known)

    def finish(self) -> None:
        """Refuse what nothing has read."""
        if foreign := self.foreign(self.known):
            raise ConfigError.of_all(foreign)

    def foreign(self, known: Collection[str], belongs: Mapping[str, str] = NOWHERE) -> list[ConfigError]:
        """The refusals of what is none of the keys ``known``, but for what was taken for one of them.

        ``belongs``: the tables within this one that have a key of that name.
        """
        return [
            self.unknown(key, known, belongs)
            for key in self._values
            if key not in known and key not in self._meant
        ]

    def unknown(self, key: str, known: Collection[str], belongs: Mapping[str, str] = NOWHERE) -> ConfigError:
        near = difflib.get_close_matches(key, sorted(known), n=1, cutoff=0.4)
        do = message("file.mean", near=near[0]) if near else message("file.remove")
        if key in belongs:
            do = message("file.belongs", tables=belongs[key])
        return self.refusal(key, "unknown_key", allowed=", ".join(sorted(known)), do=do)


def read_text(path: Path, encoding: str = "utf-8") -> str:
    try:
        return path.read_text(encoding=encoding)
    except UnicodeDecodeError as error:
        raise ConfigError(message("file.not_utf8", file=path.name, byte=error.start)) from error
    except OSError as error:
        raise ConfigError(message("file.unread", file=path, why=error)) from error


def parse(text: str, file: str) -> Table:
    """The top level of a TOML text; raises ``ConfigError``."""
    try:
        return Table(file, Key("file.top_level"), _values_of(text), text)
    except tomllib.TOMLDecodeError as error:
        raise _no_toml(text, file, str(error)) from error


MARK = "\ufeff"  # of the order of bytes, as Windows' editors put it before a text

# What the standard library's reader of TOML finds wrong, and the text that says it.
NO_TOML = {
    "Cannot overwrite a value": "toml.key_twice",
    "Duplicate inline table key": "toml.key_twice",
    "Cannot declare": "toml.table_twice",
    "Cannot redefine namespace": "toml.table_twice",
    "Cannot mutate immutable namespace": "toml.table_twice",
    "Expected newline or end of document after a statement": "toml.more_on_line",
    "Expected '=' after a key": "toml.no_equals",
    "Expected ']": "toml.head_open",
    "Invalid statement": "toml.no_statement",
    "Invalid initial character for a key part": "toml.no_statement",
    "Invalid value": "toml.no_value",
    "Invalid date or datetime": "toml.no_value",
    "Unclosed array": "toml.list_open",
    "Unclosed inline table": "toml.table_open",
    "Unterminated string": "toml.text_open",
    "Expected": "toml.text_open",  # the quotes of a text
    "Illegal character '\\n'": "toml.text_open",
    "Unescaped": "toml.no_escape",
    "Invalid hex value": "toml.no_escape",
    "Escaped character": "toml.no_escape",
    "Illegal character": "toml.no_sign",
    "Found invalid character": "toml.no_sign",
}


def _no_toml(text: str, file: str, why: str) -> ConfigError:
    """The refusal of a text that is no TOML, with the line and the column where its reader stopped."""
    lines = text.splitlines() or [""]
    found = re.search(r" \(at line (\d+), column (\d+)\)$", why)
    number, column = (int(found[1]), int(found[2])) if found else (len(lines), len(lines[-1]) + 1)
    line = lines[number - 1] if number <= len(lines) else ""
    key = next((key for words, key in NO_TOML.items() if why.startswith(words)), "toml.other")
    head, single = HEAD.match(line), 0
    if text.startswith(MARK):
        key, number, column = "toml.mark", 1, 1
    elif head is not None and head[1] == "[[" and (single := _single_head(lines, head[2])):
        key = "toml.single_head"
    if why.startswith("Cannot overwrite") and KEY.match(line):  # the reader has read its value, too
        column = len(line) - len(line.lstrip()) + 1
    what = message(f"file.{key}", why=re.sub(r" \(at .*\)$", "", why), line=single)
    line = line.strip().lstrip(MARK)
    shown = line if len(line) <= 60 else f"{line[:57]}..."
    where = f"{file}:{number}:{column}"
    return ConfigError(
        message("file.no_toml", where=where, found=shown or Key("file.toml.end"), what=what), file, number
    )


def _single_head(lines: Sequence[str], name: str) -> int:
    """The number of the line [name]; 0: there is none."""
    heads = enumerate(map(HEAD.match, lines), 1)
    return next((n for n, head in heads if head and (head[1], head[2]) == ("[", name)), 0)


@lru_cache(16)
def _values_of(text: str) -> dict[str, Any]:
    """Nobody changes them; a machine, its tools and its drives' profiles are asked for again and again."""
    return tomllib.loads(text)


HEAD = re.compile(r"\s*(\[\[?)\s*([^\]#]+?)\s*\]")
KEY = re.compile(r"\s*([\w.\"'-]+)\s*=")


def line_of(text: str, wanted: Place) -> int | None:
    """The line of a key, or of the nearest thing around it that the text has; None where it has nothing."""
    nearest, depth, array = None, 0, None
    for number, place in _places(text):
        if array is None and place == (*wanted[:-1], f"{wanted[-1]}#1"):
            array = number
        alike = len(place) if _leads(place, wanted) else 0
        if alike > depth:
            nearest, depth = number, alike
    return nearest or array


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


def span(lower: float, upper: float) -> Message:
    if math.isinf(upper):
        return message("file.span.any") if math.isinf(lower) else message("file.span.from", lower=lower)
    return message("file.span", lower=lower, upper=upper)


def _shown(value: object) -> str:
    text = str(value).lower() if isinstance(value, bool) else repr(value).replace("'", '"')
    return text if len(text) <= 60 else f"{text[:57]}..."
