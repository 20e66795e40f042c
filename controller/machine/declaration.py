"""A key of a machine file, declared once: as the field of the value that it fills.

    @dataclass(frozen=True, slots=True)
    class Clamp:
        open_s: float = key(Number(0.01, 30.0), "most that opening or closing may take", default=0.5)

Of the declaration ``reading`` makes the reading, its ranges and its refusals; ``keys`` makes the reference
(``config/KEYS.md``) and the JSON Schema. A form (``forms``) says what a value may be: a number, a text out of
some, a table. What hangs on other keys (the travel of an axis, the names of the buses) is a function of the
``Reading`` of the table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from typing import Any

from controller.messages import Message, plain, text

Words = Message | str
Schema = dict[str, Any]
UNITS = ("mm", "deg")
Sizes = tuple[float, float]
Usual = Sizes | Mapping[str, Sizes]


def resolved(value: Any, here: Any) -> Any:
    """A value, or what a function of the reading makes it."""
    return value(here) if callable(value) else value


class Form:
    """What the value of a key may be. ``here``: the ``Reading`` of its table; None for the reference."""

    always = False  # read also where the file has no such key
    within: type | None = None  # whose fields are the keys of a table at the top level of a file ...
    brackets = "[{}]"  # ... and how its head is written

    def allowed(self, here: Any) -> Words:
        """In words."""
        raise NotImplementedError

    def read(self, here: Any, name: str) -> Any:
        """The value as the file has it. Raises ConfigError."""
        raise NotImplementedError

    def schema(self) -> Schema:
        """What a JSON Schema can say of it."""
        raise NotImplementedError

    def written(self, value: Any) -> Any:
        """A value as a file has it."""
        return value


@dataclass(frozen=True, slots=True)
class Key:
    """All that is declared of a key."""

    form: Form
    means: str
    name: str  # {unit} in it is mm of a slide and deg of a rotary
    needed: bool | tuple[str, ...]  # in all tables of the class, or in those of these names
    silent: Any  # the value, as a file would have it, of a file that is silent; None: the field's default
    default: Any  # the field's
    scale: Any  # what one of the file's unit is inside
    per: Any  # what one inside is in the file's unit
    tables: tuple[str, ...]  # that have it; () = all of the class
    only: Callable[[Any], bool] | None  # whether such a table may have it
    may_be: Words  # in words, where it hangs on other keys
    left_out: str  # likewise what a silent file means
    usual: Any  # [least, most] size that real machines have, in the file's unit, or by mm and deg

    @property
    def spelled(self) -> tuple[str, ...]:
        """As files write it: once, or in mm and in degrees."""
        if "{" not in self.name:
            return (self.name,)
        return tuple(self.name.format(unit=unit) for unit in UNITS)

    def is_in(self, table: str) -> bool:
        """Whether a table of this name has it."""
        return not self.tables or table in self.tables

    def is_needed(self, table: str) -> bool:
        """Whether a table of this name must have it."""
        return self.needed if isinstance(self.needed, bool) else table in self.needed

    def usual_in(self, unit: str) -> Sizes | None:
        """The sizes that real machines have, where the table is in mm or in deg; None: any."""
        found: Sizes | None = self.usual[unit] if isinstance(self.usual, Mapping) else self.usual
        return found

    @property
    def allowed(self) -> str:
        """What it may be, in English, for the reference."""
        return text(plain(self.may_be or self.form.allowed(None)))

    def inside(self, value: Any, here: Any) -> Any:
        """A value of the file as the field has it."""
        if self.scale is not None:
            return value * resolved(self.scale, here)
        return value / resolved(self.per, here) if self.per is not None else value

    def shown_default(self) -> Any:
        """The value of a silent file as a file would have it; None where there is none that is always so."""
        if self.silent is not None:
            return None if callable(self.silent) else self.form.written(self.silent)
        value = None if self.default is MISSING else self.form.written(self.default)
        if type(value) is not float or callable(self.scale) or callable(self.per):
            return value
        return value / (self.scale or 1.0) * (self.per or 1.0)


def declared(
    form: Form,
    means: str,
    *,
    name: str = "",
    needed: bool | tuple[str, ...] | None = None,
    silent: Any = None,
    default: Any = MISSING,
    scale: Any = None,
    per: Any = None,
    tables: tuple[str, ...] = (),
    only: Callable[[Any], bool] | None = None,
    may_be: Words = "",
    left_out: str = "",
    usual: Usual | None = None,
) -> Key:
    """A key; it is needed where neither the field nor the declaration says what a silent file means."""
    if needed is None:
        needed = silent is None and default is MISSING and not form.always
    return Key(form, means, name, needed, silent, default, scale, per, tables, only, may_be, left_out, usual)


def key(form: Form, means: str, *, default: Any = MISSING, shown: bool = True, **more: Any) -> Any:
    """A field that a key of the file fills, with its ``default`` in Python; ``shown``: in its repr."""
    return field(
        default=default, repr=shown, metadata={"key": declared(form, means, default=default, **more)}
    )


@dataclass(frozen=True, slots=True)
class Part:
    """A field that is a value of its own, whose keys are in the same table."""

    of: type
    default: Any
    only: Callable[[Any], bool] | None  # whether such a table may have them


def same_table(of: type, default: Any = MISSING, only: Callable[[Any], bool] | None = None) -> Any:
    """A field whose value has keys in the same table."""
    return field(default=default, metadata={"part": Part(of, default, only)})


def shared(one: Key, **changes: Any) -> Any:
    """A field whose key several tables have."""
    one = replace(one, **changes)
    return field(default=one.default, metadata={"key": one})


@cache
def keys_of(of: type) -> dict[str, Key]:
    """The keys of a table in their order, by field, or by the name of the class variable that declares one
    which fills no field.
    """
    metadata = {one.name: one.metadata for one in fields(of)}
    found: dict[str, Key] = {}
    for name in of.__annotations__:
        one = metadata[name].get("key") if name in metadata else getattr(of, name, None)
        if isinstance(one, Key):
            found[name] = replace(one, name=one.name or name)
    return found


@cache
def parts_of(of: type) -> dict[str, Part]:
    """Its parts by field."""
    return {one.name: one.metadata["part"] for one in fields(of) if "part" in one.metadata}


@cache
def spellings(of: type) -> frozenset[str]:
    """Every key that some table of the class may have."""
    return frozenset(name for key in in_order(of) for name in key.spelled)


def in_order(of: type) -> list[Key]:
    """The keys of a table in their order, those of its parts at their place."""
    keys, parts = keys_of(of), parts_of(of)
    found: list[Key] = []
    for name in of.__annotations__:
        found += [keys[name]] if name in keys else in_order(parts[name].of) if name in parts else []
    return found
