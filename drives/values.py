"""Dataclasses with slots that are made quickly: a command imports two hundred of them before it begins.

Python compiles six functions for each from text, one by one, and makes the class twice, which is a quarter of
the time from the start of ``directrix`` to its first work. Here only ``__init__`` is compiled, when the first
one is made; the others go by the names of the fields.
What comes of it is what ``dataclasses`` makes: for ``fields``, ``replace``, ``asdict`` and ``match``, copying
and pickling included. What is out of the ordinary is left to ``dataclasses``.
"""

from __future__ import annotations

import dataclasses
from copy import copy
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, **asked):
        """``dataclasses.dataclass``, with the same arguments."""

        def made(cls):
            quick = asked.get("slots") and asked.keys() <= QUICKLY and _is_ordinary(cls)
            if not quick:
                return dataclasses.dataclass(**asked)(cls)
            return _value(cls, **asked)

        return made if cls is None else made(cls)


QUICKLY = {"frozen", "slots", "eq", "unsafe_hash"}
_MISSING = dataclasses.MISSING
_NOT_FIELDS = ("ClassVar", "InitVar", "KW_ONLY")
_OF_A_VALUE = ("__init__", "__setattr__", "__delattr__", "__getstate__", "__setstate__", "__slots__")


def _is_ordinary(cls: type) -> bool:
    """A documented class that inherits no fields, and whose own are arguments or are made by itself."""
    own = cls.__dict__
    kinds = own.get("__annotations__", {})
    given = [(name in own, own.get(name, _MISSING)) for name in kinds]
    fields = [value for _, value in given if isinstance(value, dataclasses.Field)]
    words = " ".join(map(str, kinds.values()))
    return (
        not any(
            hasattr(base, "__dataclass_fields__") or "__slots__" in base.__dict__ for base in cls.__mro__[1:]
        )
        and bool(own.get("__doc__"))
        and own.keys().isdisjoint(_OF_A_VALUE)
        and not any(word in words for word in _NOT_FIELDS)
        and not any(field.kw_only is True for field in fields)
        and all(field.init or field.default is field.default_factory for field in fields)  # both are missing
        and _is_told_apart(given)
    )


def _is_told_apart(given: list[tuple[bool, Any]]) -> bool:
    """What ``dataclasses`` refuses is left to it: a default before none, and one that may be changed."""
    last = False
    for has_default, value in given:
        if isinstance(value, dataclasses.Field):
            if not value.init:
                continue
            has_default = value.default is not value.default_factory
            value = value.default
        if (last and not has_default) or value.__class__.__hash__ is None:
            return False
        last = has_default
    return True


@dataclasses.dataclass
class _Sample:
    """Shows what ``dataclasses`` notes of a field and of a class."""

    one: int


_FIELD = _Sample.__dataclass_fields__["one"]._field_type  # type: ignore[attr-defined]
_PARAMETERS = _Sample.__dataclass_params__  # type: ignore[attr-defined]


def _value(cls: Any, *, slots: bool, frozen: bool = False, eq: bool = True, unsafe_hash: bool = False) -> Any:
    """The class with all that a value has, made anew, for slots cannot be had later."""
    own = dict(cls.__dict__)
    fields = {name: _field(name, kind, own) for name, kind in own.get("__annotations__", {}).items()}
    made_of: list[Any] = []  # the class, once it is there
    methods = [_init(made_of, list(fields.values()))]
    if frozen:
        methods += _kept(made_of, list(fields))
    if "__repr__" not in own:
        methods.append(_repr([name for name, field in fields.items() if field.repr]))
    if eq and "__eq__" not in own:
        methods.append(_eq([name for name, field in fields.items() if field.compare]))
    if (unsafe_hash or (eq and frozen)) and own.get("__hash__") is None:
        hashed = [one.name for one in fields.values() if (one.compare if one.hash is None else one.hash)]
        methods.append(_hash(hashed))
    for method in methods:
        method.__qualname__ = f"{cls.__qualname__}.{method.__name__}"
        method.__module__ = cls.__module__
        own[method.__name__] = method
    for gone in ("__dict__", "__weakref__", *fields):
        own.pop(gone, None)
    parameters = copy(_PARAMETERS)
    parameters.frozen, parameters.eq, parameters.unsafe_hash = frozen, eq, unsafe_hash
    own |= {
        "__slots__": tuple(fields),
        "__dataclass_fields__": fields,
        "__dataclass_params__": parameters,
        "__qualname__": cls.__qualname__,
    }
    own.setdefault("__match_args__", tuple(name for name, field in fields.items() if field.init))
    made = type(cls)(cls.__name__, cls.__bases__, own)
    made_of.append(made)
    return made


def _field(name: str, kind: Any, own: dict[str, Any]) -> Any:
    given = own.get(name, _MISSING)
    field: Any = given if isinstance(given, dataclasses.Field) else dataclasses.field(default=given)
    field.name, field.type, field._field_type, field.kw_only = name, kind, _FIELD, False
    return field


def _init(made_of: list[Any], fields: list[dataclasses.Field[Any]]) -> Any:
    """Compiles itself when the first one is made: of half of the classes there is none in a process."""

    def __init__(self: Any, *given: Any, **named: Any) -> None:
        made = made_of[0]
        made.__init__ = _compiled(made, fields)
        made.__init__(self, *given, **named)

    __init__.__annotations__ = {field.name: field.type for field in fields if field.init} | {"return": None}
    return __init__


def _compiled(made: Any, fields: list[dataclasses.Field[Any]]) -> Any:
    """By what sets the slots, for ``__setattr__`` may be closed."""
    known: dict[str, Any] = {"made_here": object()}
    words, lines = ["self"], []
    for field in fields:
        name, value = field.name, field.name
        known[f"set_{name}"] = made.__dict__[name].__set__
        if not field.init:
            continue
        if field.default is not _MISSING:
            known[f"default_{name}"] = field.default
            words.append(f"{name}=default_{name}")
        elif field.default_factory is not _MISSING:
            known[f"make_{name}"] = field.default_factory
            words.append(f"{name}=made_here")
            value = f"make_{name}() if {name} is made_here else {name}"
        else:
            words.append(name)
        lines.append(f"    set_{name}(self, {value})")
    if hasattr(made, "__post_init__"):
        lines.append("    self.__post_init__()")
    exec(f"def __init__({', '.join(words)}):\n" + "\n".join(lines or ["    pass"]), known)
    init, before = known["__init__"], made.__dict__["__init__"]
    for what in ("__module__", "__qualname__", "__annotations__"):
        setattr(init, what, getattr(before, what))
    return init


def _kept(made_of: list[Any], names: list[str]) -> tuple[Any, ...]:
    """What keeps it as it is, and what copies and pickles get past that."""
    present = frozenset(names)

    def __setattr__(self: Any, name: str, value: object) -> None:
        if type(self) in made_of or name in present:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        object.__setattr__(self, name, value)

    def __delattr__(self: Any, name: str) -> None:
        if type(self) in made_of or name in present:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        object.__delattr__(self, name)

    def __getstate__(self: Any) -> list[Any]:
        return [getattr(self, name) for name in names]

    def __setstate__(self: Any, state: list[Any]) -> None:
        for name, value in zip(names, state, strict=True):
            object.__setattr__(self, name, value)

    return __setattr__, __delattr__, __getstate__, __setstate__


def _repr(names: list[str]) -> Any:
    @recursive_repr()
    def __repr__(self: Any) -> str:
        said = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__qualname__}({said})"

    return __repr__


def _eq(names: list[str]) -> Any:
    values = _values(names)

    def __eq__(self: Any, other: object) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return __eq__


def _hash(names: list[str]) -> Any:
    values = _values(names)

    def __hash__(self: Any) -> int:
        return hash(values(self))

    return __hash__


def _values(names: list[str]) -> Any:
    """Gives the tuple of a value's fields."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda one: tuple(getattr(one, name) for name in names)
