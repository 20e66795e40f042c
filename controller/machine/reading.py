"""The reading of tables whose keys are declared (``declaration``): all mistakes of a file in one answer.

A table is read key by key, each when it is first asked for, so that a range may hang on any other key. A key
that is refused leaves its field out: whoever asks for it gets ``Unread``, an AttributeError like that of a
value which lacks the field, and is not carried out. So no mistake is told that another one has caused. What
only several keys can show is checked by plain functions (``Rules.checks``, ``File.check``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from typing import Any

from controller.machine.declaration import Key, keys_of, parts_of, spellings
from controller.machine.toml_table import ConfigError, Table


class Unread(AttributeError):
    """Of a key that was refused: what needs it cannot be told."""


Check = Callable[["Reading"], object]


@dataclass(frozen=True, slots=True)
class Rules:
    """What is more to the tables of a class than its keys."""

    unit: Callable[[Reading], str] | None = None  # mm or deg ...
    inner: Callable[[Reading], float] | None = None  # ... and what one of it is inside
    fills: Mapping[str, Callable[[Reading], Any]] = field(default_factory=dict)  # fields without a key
    checks: Sequence[Check] = ()
    made: Callable[[Any, Reading], Any] | None = None  # of the value what the table is read as
    part: bool = False  # other fields are filled elsewhere


NO_RULES = Rules()


class File:
    """A file that is read, with the mistakes that were found in it."""

    def __init__(self, rules: Mapping[type, Rules], files: Any = None) -> None:
        """``files``: a ``NamedFiles``, where tables may name some."""
        self.rules, self.files, self.mistakes = rules, files, list[ConfigError]()
        self.tables: list[Reading] = []  # all that were read
        self._names = set[tuple[str, str]]()

    def collecting(self) -> File:
        """``with file.collecting():`` notes what is refused within, and leaves out what another mistake does
        not let tell.
        """
        return self

    def __enter__(self) -> None:
        pass

    def __exit__(self, _: object, error: BaseException | None, __: object) -> bool:
        if isinstance(error, ConfigError):
            self.mistakes.append(error)
            return True
        return isinstance(error, AttributeError) and bool(self.mistakes)

    def check(self, checks: Mapping[type, Sequence[Check]]) -> None:
        """Carry out the checks of every table that has been read, as far as its values allow."""
        for table in self.tables:
            for check in checks.get(table.of, ()):
                with self.collecting():
                    check(table)

    def misses(self, kind: str, name: str) -> bool:
        """Whether it is for the first time that a name is looked for which is nowhere: told once."""
        is_new = (kind, name) not in self._names
        self._names.add((kind, name))
        return is_new

    def finish(self) -> None:
        """Raises ConfigError with all mistakes, where there are any."""
        if self.mistakes:
            raise ConfigError.of_all(self.mistakes)


class Reading:
    """One table as it is read: the values of its fields."""

    def __init__(
        self,
        file: File,
        of: type,
        table: Table,
        above: Reading | None = None,
        called: str = "",
        within: Table | None = None,
        before: Any = None,
    ) -> None:
        """``called``: the key of the table, or its name where the file gives it in the table ``within``.
        ``before``: has the values of keys about which the table is silent.
        """
        self.file, self.of, self.table, self.above, self.called = file, of, table, above, called
        self.within, self.before = within, before
        self.top: Reading = self if above is None else above.top
        self.below: dict[str, list[Reading]] = {}  # by key
        self.shown: dict[str, Any] = {}  # values in the units of the file
        self.values: dict[str, Any] = {}
        self._rules, self._begun = file.rules.get(of, NO_RULES), set[str]()
        file.tables.append(self)
        self._parts = {name: Reading(file, one.of, table, self, called) for name, one in parts_of(of).items()}

    def __getitem__(self, name: str) -> Any:
        """The value of a field. Raises Unread where its key was refused."""
        if name not in self.values:
            self._take(name)
        return self.values[name]

    def as_written(self, name: str) -> Any:
        """The value of a field in the file's unit. Raises Unread."""
        self[name]
        return self.shown[name]

    @property
    def unit(self) -> str:
        """mm or deg in this table; "" where it has neither."""
        if self._rules.unit is not None:
            return self._rules.unit(self)
        return self.above.unit if self.above is not None else ""

    @property
    def inner(self) -> float:
        """What one of the unit is inside, with the sign of its sense."""
        if self._rules.inner is not None:
            return self._rules.inner(self)
        return self.above.inner if self.above is not None else 1.0

    def under(self, key: str, of: type, table: Table, called: str, within: Table | None = None) -> Any:
        """The value of a table below this one."""
        one = Reading(self.file, of, table, self, called, within)
        self.below.setdefault(key, []).append(one)
        return one.value()

    def one_below(self, key: str) -> Reading:
        """The reading of the table of a key. Raises Unread where it was not read."""
        if key not in self.below:
            raise Unread(key)
        return self.below[key][0]

    def all_of(self, found: Sequence[Any], wanted: int) -> tuple[Any, ...]:
        """Several values as one. Raises Unread where some are not there."""
        if len(found) < wanted:
            raise Unread
        return tuple(found)

    def names(self) -> list[str]:
        """The keys that the table may have."""
        found: list[str] = []
        for key in keys_of(self.of).values():
            with suppress(AttributeError):
                if not self._has(key):
                    continue
            found += self._spelled(key)
        for name, part in self._parts.items():
            with suppress(AttributeError):
                if not self._has_part(name):
                    continue
            found += part.names()
        return found

    def _has(self, key: Key) -> bool:
        return key.is_in(self.called) and (key.only is None or key.only(self))

    def _has_part(self, name: str) -> bool:
        only = parts_of(self.of)[name].only
        return only is None or only(self)

    def _spelled(self, key: Key) -> Sequence[str]:
        """A key as this table writes it: both ways where it is not known which."""
        with suppress(AttributeError):
            return (self._name(key),)
        return key.spelled

    def _name(self, key: Key) -> str:
        return key.name.format(unit=self.unit) if "{" in key.name else key.name

    def _take(self, name: str) -> None:
        if name in self._begun:
            raise Unread(name)
        self._begun.add(name)
        with self.file.collecting():
            if name in self._parts:
                is_in = self._has_part(name)
                none = parts_of(self.of)[name].default
                self.values[name] = self._parts[name].value(foreign=False) if is_in else none
            elif name in self._rules.fills:
                self.values[name] = self._rules.fills[name](self)
            else:
                self._read(name, keys_of(self.of)[name])
        if name not in self.values:
            raise Unread(name)

    def _read(self, name: str, key: Key) -> None:
        if not self._has(key):
            none = key.silent if key.default is MISSING else key.default
            self.shown[name] = self.values[name] = none
            return
        written = self._name(key)
        if not self.table.holds(written):
            self._refuse_misspelt(written, key)
        if self.table.holds(written) or key.form.always:
            self.shown[name] = key.form.read(self, written)
            self.values[name] = key.inside(self.shown[name], self)
        elif key.is_needed(self.called):
            self.table.known |= set(self.names())
            raise self.table.missing(written, self._allowed(key))
        else:
            self._leave(name, key)

    def _refuse_misspelt(self, name: str, key: Key) -> None:
        """Refuse a key that nobody knows and that is meant to be this one: what it says is not known then.

        Of a key that is needed it is said that it is missing.
        """
        if key.is_needed(self.called):
            return
        whole = self if self.above is None or self.above.table is not self.table else self.above
        if any(one not in spellings(whole.of) for one in self.table.written):
            self.table.refuse_misspelt(name, whole.names())

    def _allowed(self, key: Key) -> Any:
        with suppress(AttributeError):
            return key.form.allowed(self)
        return key.may_be

    def _leave(self, name: str, key: Key) -> None:
        """What a silent file means."""
        if callable(key.silent):
            self.shown[name] = key.silent(self)
        elif self.before is not None:
            self.shown[name] = self.values[name] = getattr(self.before, name)
            return
        elif key.silent is not None:
            self.shown[name] = key.silent
        elif key.default is not MISSING:
            self.shown[name] = self.values[name] = key.default
            return
        self.values[name] = key.inside(self.shown[name], self) if name in self.shown else None

    def value(self, foreign: bool = True) -> Any:
        """What the table is read as: whole, or without the fields whose keys were refused."""
        before, names = len(self.file.mistakes), (*keys_of(self.of), *self._parts, *self._rules.fills)
        for name in names:
            with suppress(Unread):
                self[name]
        if foreign:
            self.file.mistakes += self.table.foreign(self.names(), tables_with(self.of))
        for check in self._rules.checks:
            with self.file.collecting():
                self._carry_out(check)
        own = {one.name for one in fields(self.of)}
        values = {name: one for name, one in self.values.items() if name in own}
        fault = len(self.file.mistakes) > before or any(name not in self.values for name in names)
        if fault and self._rules.made is not None:
            raise Unread(self.called)
        if fault or self._rules.part:
            return partial(self.of, values)
        whole = self.of(**values)
        return whole if self._rules.made is None else self._rules.made(whole, self)

    def _carry_out(self, check: Check) -> None:
        """What a check refuses counts as not read."""
        try:
            check(self)
        except ConfigError as error:
            for name, key in keys_of(self.of).items():
                if error.place and error.place[-1] in key.spelled:
                    self.values.pop(name, None)
            raise


@cache
def tables_with(of: type) -> dict[str, str]:
    """The keys of the tables in a table, and the heads of those that have them."""
    found: dict[str, list[str]] = {}
    for key in keys_of(of).values():
        for name in spellings(key.form.within) if key.form.within else ():
            found.setdefault(name, []).append(key.form.brackets.format(key.name))
    return {name: ", ".join(heads) for name, heads in found.items()}


def partial(of: type, values: Mapping[str, Any]) -> Any:
    """A value without the fields that are not known, which raise AttributeError."""
    made: Any = object.__new__(of)
    defaults = {
        one.name: one.default for one in fields(of) if one.default is not MISSING and not one.metadata
    }
    for name, value in {**defaults, **values}.items():
        object.__setattr__(made, name, value)
    return made


def read_alone(
    of: type, table: Table, rules: Mapping[type, Rules], called: str = "", before: object = None
) -> Any:
    """The value of one table by itself. Raises ConfigError with all its mistakes."""
    file, found = File(rules), None
    with file.collecting():
        found = Reading(file, of, table, called=called, before=before).value()
    file.finish()
    return found
