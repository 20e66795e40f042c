"""The parameters of a program: numbered, named, and those that the control itself gives.

#1 to #30 (on controls as Fanuc's to #33) and names belong to the sub that runs (its arguments, then
whatever it sets), all else to the whole program; names that begin with _ are global. A number that
nobody has set is 0, a name that nobody has set has no value (both as LinuxCNC).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol, TypeGuard

from controller.machine.changes import Change
from controller.messages import Message, message

Name = int | str
ARGUMENTS = range(1, 31)  # a sub's own
OF_MACRO = range(1, 34)  # a macro's own, on controls as Fanuc's
SAYS_DEBUG = 5599  # 0: what (DEBUG,) would say is not said
OF_THE_MACHINE = range(5061, 5603)  # positions, offsets and tools: the control gives them
ALARM, STOP = 3000, 3006  # what a program writes to end itself, and to stop with a message
INPUTS, OUTPUTS = 1000, 1100  # the first of those that programs have by P of M66, and of M62 to M65
VACANT = range(1000)  # there, until a program sets them: neither 0 nor a number
OF_PROBING = range(5061, 5071)  # of the last probing move: what a program sets there holds until the next
RETURNED = ("_value", "_value_returned")  # what the last sub gave back, and whether it did
_OF_LINUXCNC = re.compile(r"_(?:ini|hal)\[").match  # names that read its INI file, or a pin of its HAL
_BEGUN: Mapping[Name, float] = MappingProxyType({**dict.fromkeys(RETURNED, 0.0), SAYS_DEBUG: 1.0})


def written(key: Name) -> str:
    """A parameter as programs write it."""
    return f"#{key}" if isinstance(key, int) else f"#<{key}>"


class NoValue(Exception):
    """A parameter that cannot be read, or set, here: the key of the text why, and its values."""

    def __init__(self, key: str, **values: object) -> None:
        super().__init__(key)
        self.key, self.values = key, values


class Given(Protocol):
    """What the control says of itself by parameters of its own."""

    def value(self, key: Name) -> float | None:
        """The value of one of its parameters; None where it has none of that name. Raises NoValue."""


class System(Protocol):
    """Numbers by which controls as Fanuc's mean themselves."""

    asks: dict[int, float]  # ``ALARM`` or ``STOP`` of the line that is read
    notes: list[Message]  # what ``check`` is to tell of it
    changes: list[Change]  # what it changes for good
    reads: dict[int, bool]  # inputs that were read, by P of M66, and as what
    is_modal_call: bool  # G66 is on

    def has(self, key: int) -> bool:
        """Whether a number is one of them."""

    def value(self, key: int) -> float:
        """Raises NoValue."""

    def check_settable(self, key: int) -> None:
        """Raises NoValue."""

    def set(self, key: int, value: float) -> None:
        """Carries out what it is written for. Raises NoValue."""


class Nothing:
    """Nothing is given."""

    def value(self, key: Name) -> float | None:
        return None


class Parameters:
    """The values of one run of a program."""

    def __init__(
        self,
        given: Given | None = None,
        begun: Sequence[tuple[Name, float]] = (),
        kept: Sequence[tuple[int, int]] = (),
        system: System | None = None,
        left: Sequence[tuple[str, float]] = (),
    ) -> None:
        """``begun``: of the machine file, and of earlier programs; ``kept``: from to, for later ones.

        ``system``: the system variables of controls as Fanuc's, whose macros these are then.
        ``left``: of the lines by hand before this one, as ``to_leave`` has it.
        """
        self._system = system
        self._vacant = VACANT if system is not None else range(0)
        self._own = OF_MACRO if system is not None else ARGUMENTS
        self._macros = 0  # that are running, one in the other
        self._left_out: set[str] = set()  # words that were told of
        self._given = given or Nothing()
        self._global: dict[Name, float] = {**_BEGUN, **dict(begun)}
        self._kept, self._fresh = kept, dict[int, float]()
        self._locals: list[dict[Name, float]] = [{}]  # of the program, and of each sub that runs in it
        for name, value in left:
            key = int(name) if name.isdigit() else name
            if not self._is_persistent(key):
                self._room(key)[key] = value

    @property
    def of_fanuc(self) -> bool:
        """Whether expressions are those of Fanuc's macros."""
        return self._system is not None

    @property
    def level(self) -> int:
        """How many subs are running, one in the other."""
        return len(self._locals) - 1

    def value(self, key: Name) -> float:
        """Raises NoValue."""
        if key in OF_PROBING and (probed := self._global.get(key)) is not None:
            return probed  # that a line by hand has left
        if self._system is not None and self._is_of_system(key):
            return self._system.value(key)
        if (found := self._room(key).get(key)) is not None:
            return found
        if (given := self._of_the_control(key)) is not None:
            return given
        if isinstance(key, int):
            return 0.0
        raise NoValue("value.of_linuxcnc" if _OF_LINUXCNC(key) else "value.unset", name=key)

    def is_vacant(self, key: Name) -> bool:
        """Whether it is there and nobody has set it: on controls as Fanuc's neither 0 nor a number."""
        return key in self._vacant and key not in self._room(key)

    def may_be_vacant(self, key: Name) -> bool:
        """Whether its value can be taken from it; what outlives the program keeps a number."""
        return key in self._vacant and not self._is_persistent(key)

    def exists(self, key: Name) -> bool:
        """As EXISTS asks: every number does."""
        try:
            self.value(key)
        except NoValue:
            return False
        return True

    def check_settable(self, key: Name) -> None:
        """Raises NoValue for what a program cannot set."""
        if self._system is not None and self._is_of_system(key):
            self._system.check_settable(key)
            return
        first, last = OF_THE_MACHINE.start if self.of_fanuc else OF_PROBING.stop, OF_THE_MACHINE.stop - 1
        if isinstance(key, int) and first <= key <= last and key != SAYS_DEBUG:
            raise NoValue("value.of_the_machine", number=key, first=first, last=last)
        if key in RETURNED or (isinstance(key, str) and self._is_given(key)):
            raise NoValue("value.given", name=key)
        if isinstance(key, str) and _OF_LINUXCNC(key):
            raise NoValue("value.of_linuxcnc", name=key)

    def _is_of_system(self, key: Name) -> TypeGuard[int]:
        """Whether a number is a system variable, and not kept for programs."""
        if self._system is None or not isinstance(key, int) or not self._system.has(key):
            return False
        return not self._is_persistent(key)

    def _is_persistent(self, key: Name) -> TypeGuard[int]:
        return isinstance(key, int) and any(low <= key <= high for low, high in self._kept)

    def set(self, settings: Mapping[Name, float | None]) -> None:
        """The settings of a line, which take effect together; None makes vacant. Raises NoValue."""
        for key, value in settings.items():
            if value is None:
                self._room(key).pop(key, None)
                continue
            if self._system is not None and self._is_of_system(key):
                self._system.set(key, value)
                continue
            self._room(key)[key] = value
            if self._is_persistent(key):
                self._fresh[key] = value

    def forget_probed(self) -> None:
        """Behind a probing move what it has found counts, and no longer what was set."""
        for key in OF_PROBING:
            self._global.pop(key, None)

    def note_modal_call(self, is_on: bool) -> None:
        """G66 and G67."""
        if self._system is not None:
            self._system.is_modal_call = is_on

    def taken_reads(self) -> dict[int, bool]:
        """Inputs that were read since this was asked last, and as what."""
        if self._system is None or not self._system.reads:
            return {}
        reads, self._system.reads = self._system.reads, {}
        return reads

    def fresh(self) -> dict[int, float]:
        """Those that later programs find and that were set since this was asked last."""
        found, self._fresh = self._fresh, {}
        return found

    def to_leave(self) -> tuple[tuple[str, float], ...]:
        """What a line by hand leaves to the next one: what it has set and probed, but for what is kept for
        good."""
        probed: dict[Name, float] = {key: value for key in OF_PROBING if (value := self._probed(key))}
        values = {**probed, **self._global, **self._locals[0]}
        return tuple(
            (str(key), value)
            for key, value in values.items()
            if not self._is_persistent(key) and value != _BEGUN.get(key)
        )

    def _probed(self, key: int) -> float | None:
        try:
            return self._given.value(key)
        except NoValue:
            return None

    def enter(self, arguments: Sequence[float]) -> None:
        """A sub begins: its #1 to #30 are its arguments, those that are missing 0."""
        self._locals.append(dict(enumerate(arguments, start=ARGUMENTS.start)))

    def leave(self, value: float | None) -> None:
        """A sub ends; ``value``: what it gives back."""
        self._locals.pop()
        self._global |= dict(zip(RETURNED, (value or 0.0, float(value is not None)), strict=True))

    def enter_sharing(self) -> None:
        """A sub of M98 begins: #1 to #30 are the caller's, names its own (as LinuxCNC)."""
        self._locals.append({key: value for key, value in self._locals[-1].items() if isinstance(key, int)})

    def leave_sharing(self) -> None:
        own = self._locals.pop()
        self._locals[-1].update((key, value) for key, value in own.items() if isinstance(key, int))

    def enter_macro(self, values: dict[Name, float]) -> None:
        """A macro begins with these values of its own, and leaves in them what it has set."""
        self._locals.append(values)
        self._macros += 1

    def leave_macro(self) -> None:
        self._locals.pop()
        self._macros -= 1

    def leave_out(self, key: int, word: str) -> bool:
        """Whether a word counts for nothing, as its value is an argument that the macro was not given; told
        once (B-63944EN: reference to an undefined variable)."""
        if self._system is None or not self._macros or key not in OF_MACRO:
            return False
        if word not in self._left_out:
            self._left_out.add(word)
            self._system.notes.append(message("note.word_left_out", word=word, number=key))
        return True

    def _room(self, key: Name) -> dict[Name, float]:
        """Where a parameter is kept."""
        local = key in self._own if isinstance(key, int) else not key.startswith("_")
        return self._locals[-1] if local else self._global

    def _of_the_control(self, key: Name) -> float | None:
        if key == "_call_level":
            return float(self.level)
        return self._given.value(key)

    def _is_given(self, name: str) -> bool:
        try:
            return self._of_the_control(name) is not None
        except NoValue:
            return True
