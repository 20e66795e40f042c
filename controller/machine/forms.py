"""What the values of keys may be: numbers, texts, flags, lists and tables (see ``declaration``)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from controller.machine.declaration import Form, Schema, Words, resolved
from controller.machine.reading import Reading
from controller.machine.toml_table import is_number, span
from controller.messages import chain, message

MAX_ROW = 1000  # numbers
Bound = float | Callable[..., float]


@dataclass(frozen=True, slots=True)
class Number(Form):
    """A finite number from ``lower`` to ``upper``."""

    lower: Bound = -math.inf
    upper: Bound = math.inf

    def _bounds(self, here: Reading | None) -> tuple[float, float]:
        return resolved(self.lower, here), resolved(self.upper, here)

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.number", span=span(*self._bounds(here)))

    def read(self, here: Reading, name: str) -> float:
        try:
            bounds = self._bounds(here)
        except AttributeError:  # what they hang on was refused
            return here.table.number(name)
        return here.table.number(name, *bounds)

    def schema(self) -> Schema:
        bounds = {"minimum": self.lower, "maximum": self.upper}
        fixed = {name: one for name, one in bounds.items() if not callable(one) and math.isfinite(one)}
        return {"type": "number", **fixed}


class _Positive(Form):
    """A finite number above zero."""

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.positive")

    def read(self, here: Reading, name: str) -> float:
        return here.table.positive(name)

    def schema(self) -> Schema:
        return {"type": "number", "exclusiveMinimum": 0}


@dataclass(frozen=True, slots=True)
class Integer(Form):
    """A whole number from ``lower`` to ``upper``."""

    lower: int
    upper: int

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.integer", lower=self.lower, upper=self.upper)

    def read(self, here: Reading, name: str) -> int:
        return here.table.integer(name, self.lower, self.upper)

    def schema(self) -> Schema:
        return {"type": "integer", "minimum": self.lower, "maximum": self.upper}


def any_of(options: Sequence[str] | Mapping[str, Any]) -> Words:
    """Each in quotes, with "or" between them."""
    return chain("or", [f'"{one}"' for one in options])


@dataclass(frozen=True, slots=True)
class Choice(Form):
    """One of some texts; of a mapping the value that goes with it."""

    options: Sequence[str] | Mapping[str, Any] | Callable[..., Sequence[str]]

    def allowed(self, here: Reading | None) -> Words:
        return any_of(resolved(self.options, here))

    def read(self, here: Reading, name: str) -> Any:
        try:
            options = resolved(self.options, here)
        except AttributeError:  # what they are was refused
            options = ()
        found = here.table.text(name, tuple(options))
        return options[found] if isinstance(options, Mapping) else found

    def schema(self) -> Schema:
        return {"type": "string"} if callable(self.options) else {"enum": list(self.options)}

    def written(self, value: Any) -> Any:
        if not isinstance(self.options, Mapping):
            return value
        return next((name for name, one in self.options.items() if one == value), None)


class _Text(Form):
    """Any text."""

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.text")

    def read(self, here: Reading, name: str) -> str:
        return here.table.text(name)

    def schema(self) -> Schema:
        return {"type": "string"}


class _Flag(Form):
    """true or false."""

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.flag")

    def read(self, here: Reading, name: str) -> bool:
        return here.table.flag(name, False)

    def schema(self) -> Schema:
        return {"type": "boolean"}


@dataclass(frozen=True, slots=True)
class Numbers(Form):
    """So many finite numbers in brackets."""

    count: int

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.numbers", count=self.count)

    def read(self, here: Reading, name: str) -> tuple[float, ...]:
        return here.table.numbers(name, self.count)

    def schema(self) -> Schema:
        return numbers_schema(self.count, self.count)


def numbers_schema(least: int, most: int, items: str = "number") -> Schema:
    return {"type": "array", "items": {"type": items}, "minItems": least, "maxItems": most}


class _Names(Form):
    """A list of texts, each once."""

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.name_list")

    def read(self, here: Reading, name: str) -> tuple[str, ...]:
        return here.table.names(name)

    def schema(self) -> Schema:
        return {"type": "array", "items": {"type": "string", "minLength": 1}, "uniqueItems": True}


@dataclass(frozen=True, slots=True)
class Row(Form):
    """Finite numbers in brackets: ``count`` of them, or where that is 0 any number of two and more."""

    count: int | Callable[[Reading], int] = 0
    most: float = math.inf  # of the size of each

    def allowed(self, here: Reading | None) -> Words:
        count = resolved(self.count, here)
        each = "" if math.isinf(self.most) else message("file.may.each", low=-self.most, high=self.most)
        return message("file.may.row" if count else "file.may.rows", count=count, most=MAX_ROW, each=each)

    def read(self, here: Reading, name: str) -> list[float]:
        value, known = here.table.get(name, ""), self
        try:
            count = resolved(self.count, here)
        except AttributeError:  # what it hangs on was refused
            count, known = 0, Row(0, self.most)
        sound = isinstance(value, list) and all(map(is_number, value))
        sound = sound and (len(value) == count if count else 2 <= len(value) <= MAX_ROW)
        if not sound or max(map(abs, value)) > self.most:
            here.table.refuse(name, "no_row", allowed=known.allowed(here))
        return [float(one) for one in value]

    def schema(self) -> Schema:
        return numbers_schema(0 if self.count else 2, MAX_ROW)


@dataclass(frozen=True, slots=True)
class Own(Form):
    """What no other form is; ``reads`` makes its value, and refuses it."""

    reads: Callable[[Reading, str], Any]
    may_be: Words
    json: Mapping[str, Any]

    def allowed(self, here: Reading | None) -> Words:
        return self.may_be

    def read(self, here: Reading, name: str) -> Any:
        return self.reads(here, name)

    def schema(self) -> Schema:
        return dict(self.json)


@dataclass(frozen=True, slots=True)
class Sub(Form):
    """A table whose keys are the fields of ``of``. ``named``: the keys are the file's own names, and each is
    such a table; the value is that of all, in their order.
    """

    of: type
    named: bool = False
    top: bool = False  # of the top level: [spindle]
    always: bool = False  # a file without it has an empty one

    @property
    def within(self) -> type | None:
        return self.of if self.top else None

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.table")

    def read(self, here: Reading, name: str) -> Any:
        shown = f"[{name}]" if self.top else f"{here.table.name} {name}"
        table = here.table.table(name, shown, optional=self.always)
        if not self.named:
            return here.under(name, self.of, table, called=name)
        found = []
        for one in table.written:
            with here.file.collecting():
                entry = table.table(one, f"{shown}.{one}")
                found.append(here.under(name, self.of, entry, called=one, within=table))
        return here.all_of(found, len(table.written))

    def entry_schema(self, table: Schema) -> Schema:
        """Of one of several by name, where the schema of its table is known."""
        return table

    def schema(self) -> Schema:
        raise NotImplementedError  # ``keys`` goes into it


@dataclass(frozen=True, slots=True)
class Rows(Form):
    """Tables in double brackets, the keys of each the fields of ``of``; the value is a tuple."""

    of: type
    beneath: bool = False  # they are called by the table above, too
    brackets = "[[{}]]"

    @property
    def within(self) -> type | None:
        return self.of

    def allowed(self, here: Reading | None) -> Words:
        return message("file.may.tables", key="...")

    def read(self, here: Reading, name: str) -> Any:
        rows, found = here.table.tables(name), []
        for one in rows:
            if self.beneath:
                one.name = f"{here.table.name}: {one.name}"
            with here.file.collecting():
                found.append(here.under(name, self.of, one, called=name))
        return here.all_of(found, len(rows))

    def schema(self) -> Schema:
        raise NotImplementedError  # ``keys`` goes into it


POSITIVE, TEXT, FLAG, NAMES, VECTOR = _Positive(), _Text(), _Flag(), _Names(), Numbers(3)
