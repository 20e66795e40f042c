"""TOML to ``InverterProfile``: the register map of a family of inverters on Modbus RTU.

``load(name_or_path)`` is the verb. A profile file has one table ``[inverter]``; ``config/inverters`` holds
the shipped ones. Every refusal is a ``ConfigError`` in the form of ``toml_table``, with all mistakes at once.
Numbers of registers and coils are those of the maker's manual; ``first`` says which of them is address 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

from controller.machine.declaration import key
from controller.machine.drive_profiles import WORDS, profile_file
from controller.machine.forms import POSITIVE, TEXT, Integer, Rows, Sub
from controller.machine.reading import File, Reading, Rules
from controller.machine.toml_table import parse, read_text
from drives.text_file import Source, TextFile

SHIPPED = Path(__file__).resolve().parent.parent.parent / "config" / "inverters"
WORD = 0xFFFF
NONE = -1  # no such register or coil
_NUMBER = Integer(0, WORD)


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """A register or a coil that is written."""

    register: int = key(_NUMBER, "that is written (function 06h)", default=NONE)
    coil: int = key(_NUMBER, "instead of a register (function 05h)", default=NONE)
    value: int = key(_NUMBER, "what is written; of a coil 0 or 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A register or a coil that says whether something is so."""

    register: int = key(_NUMBER, "that is read (function 03h)", default=NONE)
    coil: int = key(_NUMBER, "instead of a register (function 01h): so where it is on", default=NONE)
    mask: int = key(Integer(1, WORD), "the bits of the register that count", default=WORD)
    value: int = key(_NUMBER, "so where they are this; left out: where any of them is on", default=NONE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frequency:
    """A register with a frequency."""

    register: int = key(_NUMBER, "with its frequency, of two words the high one")
    words: int = key(Integer(1, 2), "of 16 bits, the high one first", default=1)
    per_hz: float = key(POSITIVE, "counts of one hertz")


@dataclass(frozen=True, slots=True, kw_only=True)
class InverterProfile:
    """How a family is asked and ordered."""

    source: str = key(TEXT, "the documents that the numbers are from")
    watchdog: str = key(WORDS, "how the inverter is set to stop by itself where it hears nothing")
    first: int = key(Integer(0, 1), "number of the register at address 0", default=0)
    forward: tuple[Order, ...] = key(Rows(Order), "what makes it turn clockwise")
    reverse: tuple[Order, ...] = key(Rows(Order), "and counter-clockwise")
    stop: tuple[Order, ...] = key(Rows(Order), "what stops it by its ramp")
    reset: tuple[Order, ...] = key(Rows(Order), "what resets its fault")
    set_point: Frequency = key(Sub(Frequency), "the frequency that it is told")
    actual: Frequency = key(Sub(Frequency), "the frequency that it has")
    running: State = key(Sub(State), "whether it runs")
    fault: State = key(Sub(State), "whether it has a fault")

    def highest_hz(self) -> float:
        """That the set-point can be told."""
        return float(((WORD + 1) ** self.set_point.words - 1) / self.set_point.per_hz)


@dataclass(frozen=True, slots=True)
class ProfileFile:
    """The tables of the file."""

    inverter: InverterProfile = key(Sub(InverterProfile, top=True), "the family")


def _check_one(here: Reading) -> None:
    """Either a register or a coil."""
    if (here["register"] == NONE) == (here["coil"] == NONE):
        here.table.refuse("register", "register_or_coil")


def _check_coil(here: Reading) -> None:
    if here["coil"] != NONE and here["value"] > 1:
        here.table.refuse("value", "coil_value")


def _check_orders(here: Reading) -> None:
    for name in ("forward", "reverse", "stop", "reset"):
        if not here[name]:
            here.table.refuse(name, "no_order")


def _check_first(here: Reading) -> None:
    """No number is below that of the first address."""
    for rows in here.below.values():
        for one in rows:
            for name in ("register", "coil"):
                if one.table.holds(name) and one[name] < here["first"]:
                    one.table.refuse(name, "below_first", first=here["first"])


RULES: Mapping[type, Rules] = {
    Order: Rules(checks=(_check_one, _check_coil)),
    State: Rules(checks=(_check_one,)),
    InverterProfile: Rules(checks=(_check_orders, _check_first)),
}


@cache
def shipped() -> tuple[str, ...]:
    """Names of the profiles that come with Directrix, for ``load``."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def load(source: Source) -> InverterProfile:
    """The profile of a file, or of a shipped file by its name. Raises ``ConfigError``."""
    return _load(source if isinstance(source, TextFile) else str(source))


@lru_cache(maxsize=16)
def _load(source: str | TextFile) -> InverterProfile:
    if isinstance(source, TextFile):
        return read(source.text, source.name)
    path = profile_file(source, SHIPPED)
    return read(read_text(path), path.name)


def read(text: str, file: str) -> InverterProfile:
    """The profile of a text. Raises ``ConfigError`` with all mistakes."""
    whole = File(RULES)
    found = None
    with whole.collecting():
        found = Reading(whole, ProfileFile, parse(text, file)).value()
    whole.finish()
    assert isinstance(found, ProfileFile)
    return found.inverter
