"""Dataclasses with slots that are made quickly: a command imports two hundred of them before it begins.

Python compiles six functions for each from text, one by one, which is a quarter of the time from the start of
``directrix`` to its first work. Here only ``__init__`` is compiled; the others go by the names of the fields.
What comes of it is what ``dataclasses`` makes: for ``fields``, ``replace``, ``asdict`` and ``match``, copying
and pickling included. What is out of the ordinary is left to ``dataclasses``.
"""

from __future__ import annotations

import dataclasses
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
_OF_A_VALUE = ("__init__", "__setattr__", "__delattr__", "__getstate__", "__setstate__")


def _is_ordinary(cls: type) -> bool:
    """A documented class that inherits no fields, and whose own are arguments or are made by itself."""
    own = cls.__dict__
    kinds = own.get("__annotations__", {}).values()
    given = [value for value in own.values() if isinstance(value, dataclasses.Field)]
    return (
        not any(hasattr(base, "__dataclass_fields__") for base in cls.__bases__)
        and bool(cls.__doc__)
        and not any(name in own for name in _OF_A_VALUE)
        and not any(word in str(kind) for kind in kinds for word in _NOT_FIELDS)
        and not any(field.kw_only is True for field in given)
        and all(field.init or field.default is field.default_factory for field in given)  # both are missing
    )


def _value(cls: Any, *, slots: bool, frozen: bool = False, eq: bool = True, unsafe_hash: bool = False) -> Any:
    own = cls.__dict__
    made: Any = dataclasses.dataclass(init=False, repr=False, eq=False, slots=slots)(cls)
    made.__dataclass_params__.frozen, made.__dataclass_params__.eq = frozen, eq  # for who inherits from it
    fields = dataclasses.fields(made)
    methods = [_init(made, fields)]
    if frozen:
        methods += _kept(made, [field.name for field in fields])
    if "__repr__" not in own:
        methods.append(_repr([field.name for field in fields if field.repr]))
    if eq and "__eq__" not in own:
        methods.append(_eq([field.name for field in fields if field.compare]))
    if not unsafe_hash and eq and not frozen:
        made.__hash__ = own.get("__hash__")  # what may change has none
    elif (unsafe_hash or eq) and own.get("__hash__") is None:
        methods.append(_hash([one.name for one in fields if (one.compare if one.hash is None else one.hash)]))
    for method in methods:
        method.__qualname__ = f"{made.__qualname__}.{method.__name__}"
        setattr(made, method.__name__, method)
    return made


def _init(made: Any, fields: tuple[dataclasses.Field[Any], ...]) -> Any:
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
    init = known["__init__"]
    init.__module__ = made.__module__
    init.__annotations__ = {field.name: field.type for field in fields if field.init} | {"return": None}
    return init


def _kept(made: Any, names: list[str]) -> tuple[Any, ...]:
    """What keeps it as it is, and what copies and pickles get past that."""
    present = frozenset(names)

    def __setattr__(self: Any, name: str, value: object) -> None:
        if type(self) is made or name in present:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        object.__setattr__(self, name, value)

    def __delattr__(self: Any, name: str) -> None:
        if type(self) is made or name in present:
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
