"""What an argument of a command may be. Each kind reads a value as it came through the socket."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

NEEDED: Any = object()  # in place of a default: it must be given


class ArgumentError(Exception):
    """Why a value is none: a key of the texts, with what its text has places for."""

    def __init__(self, key: str, **values: object) -> None:
        super().__init__(key)
        self.key, self.values = key, values


@dataclass(frozen=True, slots=True)
class Number:
    """A finite number between two bounds; ``above``: the lower one itself is none."""

    lowest: float
    highest: float
    above: bool = False

    def read(self, name: str, value: Any) -> float:
        """Raises ArgumentError."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not self.lowest <= value <= self.highest or (self.above and value == self.lowest):
            key = "not_above" if self.above else "not_number"
            raise ArgumentError(key, name=name, value=value, lowest=self.lowest, highest=self.highest)
        return float(value)


@dataclass(frozen=True, slots=True)
class Whole:
    """A whole number between two bounds."""

    lowest: int
    highest: int

    def read(self, name: str, value: Any) -> int:
        """Raises ArgumentError."""
        if not isinstance(value, int) or isinstance(value, bool) or not self.lowest <= value <= self.highest:
            raise ArgumentError(
                "not_whole_between", name=name, value=value, lowest=self.lowest, highest=self.highest
            )
        return value


@dataclass(frozen=True, slots=True)
class Switch:
    """On or off."""

    def read(self, name: str, value: Any) -> bool:
        """Raises ArgumentError."""
        if not isinstance(value, bool):
            raise ArgumentError("not_switch", name=name, value=value)
        return value


@dataclass(frozen=True, slots=True)
class Text:
    """A text; ``pattern`` is what the REST interface lets through: the handler knows the names themselves."""

    longest: int
    shortest: int = 0
    pattern: str = ""

    def read(self, name: str, value: Any) -> str:
        """Raises ArgumentError."""
        sound = isinstance(value, str) and not any("\ud800" <= one <= "\udfff" for one in value)
        if not sound or not self.shortest <= len(value) <= self.longest:
            key = "not_text" if self.shortest else "not_short_text"
            raise ArgumentError(key, name=name, value=value, shortest=self.shortest, most=self.longest)
        return str(value)


@dataclass(frozen=True, slots=True)
class Label:
    """A text that only tells one from another, as that of a press of a key; nothing is refused for it."""

    longest: int

    def read(self, name: str, value: Any) -> str:
        return str(value)


@dataclass(frozen=True, slots=True)
class Choice:
    """One of some words."""

    words: tuple[str, ...]

    def read(self, name: str, value: Any) -> str:
        """Raises ArgumentError."""
        if value not in self.words:
            raise ArgumentError("not_choice", name=name, value=value, allowed=", ".join(self.words))
        return str(value)


@dataclass(frozen=True, slots=True)
class Several:
    """A list of values of one kind. A value alone is taken as such a list."""

    of: Kind
    most: int
    fewest: int = 0

    def read(self, name: str, value: Any) -> list[Any]:
        """Raises ArgumentError."""
        values = value if isinstance(value, list) else [value]
        if not self.fewest <= len(values) <= self.most:
            raise ArgumentError("not_several", name=name, fewest=self.fewest, most=self.most)
        return [self.of.read(name, one) for one in values]


@dataclass(frozen=True, slots=True)
class Named:
    """Values by name, numbers or words."""

    most: int
    lowest: float
    highest: float
    longest: int

    def read(self, name: str, value: Any) -> dict[str, Any]:
        """Raises ArgumentError. What each name may be, the handler knows."""
        if not isinstance(value, Mapping):
            raise ArgumentError("not_named", name=name, value=value)
        return dict(value)


@dataclass(frozen=True, slots=True)
class Given:
    """Whatever its handler takes, and refuses by itself."""

    def read(self, name: str, value: Any) -> Any:
        return value


Kind = Number | Whole | Switch | Text | Label | Choice | Several | Named | Given


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a command. ``default``: where it is left out; None: then the handler gets None."""

    name: str
    kind: Kind
    meaning: str = ""  # in OpenAPI; with the unit where it has one
    default: Any = NEEDED
    in_path: str = ""  # its name in the path of the REST route, where it stands there and not in the body
    is_local: bool = False  # of the socket alone
    is_role: bool = False  # of whoever asks: the panel fills it in

    def read(self, values: Mapping[str, Any]) -> Any:
        """Its value among those that were sent; null is as if it were left out. Raises ArgumentError."""
        value = values.get(self.name)
        if value is None and self.default is not NEEDED:
            return self.default
        return self.kind.read(self.name, value)
