"""A value of ours is what ``dataclasses`` makes of the same class, but for the time that this takes."""

from __future__ import annotations

import abc
import copy
import dataclasses
import pickle
from collections.abc import Callable
from typing import Any, ClassVar

import pytest

from controller import values

Decorator = Callable[[Any], Any]


@values.dataclass(frozen=True, slots=True)
class Kept:
    """At the top of a module, where pickle finds it."""

    name: str
    numbers: tuple[int, ...] = ()


def ordinary(decorator: Decorator) -> Any:
    class Ordinary:
        """With all that is quick."""

        a: int
        b: str = "b"
        c: list[int] = dataclasses.field(default_factory=list, compare=False)
        d: float = dataclasses.field(init=False, repr=False, compare=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "d", 2.0 * self.a)

    return decorator(Ordinary)


def single(decorator: Decorator) -> Any:
    class Single:
        """Of one field its tuple has one, too."""

        a: int = 0

    return decorator(Single)


def empty(decorator: Decorator) -> Any:
    class Empty:
        """Of none."""

    return decorator(Empty)


def own_words(decorator: Decorator) -> Any:
    class OwnWords:
        """With words of its own on what it is."""

        a: int

        def __repr__(self) -> str:
            return "own"

        def __eq__(self, other: object) -> bool:
            return other is self or other == "own"

    return decorator(OwnWords)


def left_to_dataclasses(decorator: Decorator) -> Any:
    class Left:
        """With what is no field."""

        a: int
        known: ClassVar[int] = 3
        b: int = dataclasses.field(default=2, kw_only=True)

    return decorator(Left)


class Shape(abc.ABC):
    """What has no fields, and leaves something to be done."""

    @abc.abstractmethod
    def area(self) -> int: ...

    def __eq__(self, other: object) -> bool:
        return False


def built_on_another(decorator: Decorator) -> Any:
    class Square(Shape):
        """With what its base asks for."""

        a: int

        def area(self) -> int:
            return self.a**2

    return decorator(Square)


KINDS = (ordinary, single, empty, own_words, left_to_dataclasses, built_on_another)


def _both(kind: Callable[[Decorator], Any]) -> tuple[Any, Any]:
    return kind(values.dataclass(frozen=True, slots=True)), kind(
        dataclasses.dataclass(frozen=True, slots=True)
    )


def _looks(cls: Any, *arguments: Any) -> dict[str, Any]:
    one, same = cls(*arguments), cls(*arguments)
    return {
        "repr": repr(one),
        "equal": one == same,
        "unlike": one == 7,
        "hash": hash(one) == hash(same),
        "match": cls.__match_args__,
        "slots": cls.__slots__,
        "fields": [(f.name, f.type, f.init, f.repr, f.compare) for f in dataclasses.fields(cls)],
        "dict": dataclasses.asdict(one),
        "replaced": repr(dataclasses.replace(one)),
        "copied": repr(copy.copy(one)),
        "arguments": cls.__init__.__annotations__ if cls.__name__ != "Empty" else {},
        "frozen": cls.__dataclass_params__.frozen,
    }


@pytest.mark.parametrize("kind", KINDS)
def test_a_value_is_what_dataclasses_makes_of_it(kind: Callable[[Decorator], Any]) -> None:
    ours, theirs = _both(kind)
    arguments = [] if kind in (single, empty) else [4]
    found, wanted = _looks(ours, *arguments), _looks(theirs, *arguments)
    assert found == wanted


@pytest.mark.parametrize("kind", KINDS)
def test_it_cannot_be_changed(kind: Callable[[Decorator], Any]) -> None:
    cls: Any = kind(values.dataclass(frozen=True, slots=True))
    one = cls() if kind in (single, empty) else cls(4)
    for change in (lambda: setattr(one, "a", 1), lambda: delattr(one, "a")):
        with pytest.raises(dataclasses.FrozenInstanceError):
            change()  # type: ignore[no-untyped-call]


def test_fields_that_do_not_count_are_not_compared() -> None:
    ours, _ = _both(ordinary)
    assert ours(1, "x", [1]) == ours(1, "x", [2]) != ours(2, "x", [1])
    assert ours(1).c is not ours(1).c
    assert ours(3).d == 6.0


def test_identity_is_kept_where_equality_is_not_asked_for() -> None:
    cls = single(values.dataclass(frozen=True, slots=True, eq=False))
    assert cls(1) != cls(1)
    assert len({cls(1), cls(1)}) == 2


def test_it_goes_through_pickle_as_before() -> None:
    one = Kept("x", (1, 2))
    assert pickle.loads(pickle.dumps(one)) == one
    attributes = {"__doc__": "x", "__annotations__": Kept.__annotations__, "__module__": __name__}
    stdlib: Any = dataclasses.dataclass(frozen=True, slots=True)(type("Kept", (), attributes))
    assert one.__reduce_ex__(4)[2] == stdlib("x", (1, 2)).__reduce_ex__(4)[2]


def test_one_may_inherit_from_it() -> None:
    base = single(values.dataclass(frozen=True, slots=True))

    @values.dataclass(frozen=True, slots=True)
    class More(base):  # type: ignore[misc, valid-type]
        """A field more."""

        b: int = 1

    assert repr(More(2)).endswith("More(a=2, b=1)")
    with pytest.raises(dataclasses.FrozenInstanceError):
        More(2).a = 3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("asked", [{}, {"eq": False}, {"unsafe_hash": True}])
def test_what_may_change_is_what_dataclasses_makes_of_it(
    kind: Callable[[Decorator], Any], asked: dict[str, bool]
) -> None:
    ours, theirs = (
        kind(values.dataclass(slots=True, **asked)),
        kind(dataclasses.dataclass(slots=True, **asked)),
    )
    arguments = [] if kind in (single, empty) else [4]
    for cls in (ours, theirs):
        one = cls(*arguments)
        assert (cls.__hash__ is None) is (theirs.__hash__ is None)
        if "unsafe_hash" in asked:
            assert hash(one) == hash(theirs(*arguments))
        assert repr(one) == repr(theirs(*arguments))
        assert (one == cls(*arguments)) is (theirs(*arguments) == theirs(*arguments))
        assert cls.__dataclass_params__.frozen is False
        if kind is not empty:
            one.a = 5
            assert one.a == 5 and (copy.copy(one).a, dataclasses.asdict(one)["a"]) == (5, 5)


def test_what_has_no_slots_is_left_to_dataclasses() -> None:
    @values.dataclass
    class Open:
        a: int = 1

    one = Open()
    one.a = 5
    assert one == Open(5)
