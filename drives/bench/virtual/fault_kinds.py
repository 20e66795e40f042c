"""The faults that a script can name, as values (see ``fault_script`` for what they say)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from drives.texts import TextError

MASTER = 0  # as a node: the CAN controller of who sends SYNC


class ScriptError(TextError, ValueError):
    """A line of a fault script that cannot be understood; the text says which, and what can be."""


class Action(Enum):
    """What can go wrong."""

    DROP = "drop"
    DELAY = "delay"
    DUPLICATE = "duplicate"
    REORDER = "reorder"
    CORRUPT = "corrupt"
    FALSIFY = "falsify"
    REPEAT = "repeat"
    BABBLE = "babble"
    BUS_OFF = "bus_off"
    NODE_RESET = "node_reset"
    SILENCE = "silence"
    QUEUE_FULL = "queue_full"
    JAM = "jam"
    WEAK = "weak"
    STO = "sto"
    POWER = "power"
    LIMIT = "limit"
    SWITCH = "switch"
    MODE = "mode"
    WRITE = "write"
    NMT = "nmt"
    FOREIGN = "foreign"
    SECOND = "second"

    @property
    def of_frames(self) -> bool:
        """Whether it befalls frames of an identifier, and not a node."""
        return self in _OF_FRAMES

    @property
    def names_frames(self) -> bool:
        """Whether its target is an identifier."""
        return self.of_frames or self in (Action.BABBLE, Action.FOREIGN)

    @property
    def of_drives(self) -> bool:
        """Whether it befalls the hardware of a drive."""
        return self in _OF_DRIVES

    @property
    def lasts(self) -> bool:
        """Whether it can have an end ("for"), and not just happen."""
        return self not in (Action.NODE_RESET, Action.MODE, Action.WRITE, Action.NMT, Action.SECOND)


_OF_FRAMES = frozenset(
    {Action.DROP, Action.DELAY, Action.DUPLICATE, Action.REORDER, Action.CORRUPT, Action.FALSIFY}
    | {Action.REPEAT}
)
_OF_DRIVES = frozenset({Action.JAM, Action.WEAK, Action.STO, Action.LIMIT, Action.SWITCH, Action.SECOND})


@dataclass(frozen=True, slots=True)
class When:
    """A time (s since the origin), or the number of a SYNC since the injection (the first is 1)."""

    at_s: float = float("-inf")
    sync: int = 0  # 0 = by time


AT_ONCE = When()


@dataclass(frozen=True, slots=True)
class Injection:
    """One fault."""

    action: Action
    can_id: int | None = None  # of frames, and of BABBLE
    node: int | None = None  # of the others; MASTER for the controller
    when: When = AT_ONCE
    count: int | None = 1  # frames; None = all, as long as it lasts
    duration_s: float = 0.0  # 0 = no end
    delay_s: float = 0.0
    odds: float = 1.0  # for each frame
    byte: int = 0  # FALSIFY: which, and the bits to turn
    mask: int = 0
    value: int | None = None  # WEAK: per cent; LIMIT: counts; MODE: 6060h; WRITE: what is written
    word: str = ""  # SWITCH: which end; NMT: the command; WRITE: index and sub-index
    data: bytes = b""  # FOREIGN; empty = zeros

    def text(self) -> str:
        """The line of a script that says this."""
        words = [f"at sync {self.when.sync}:" if self.when.sync else f"at {_number(self.when.at_s)} s:"]
        words += [self.action.value, self._target()]
        if self.action is Action.FALSIFY:
            words.append(f"byte {self.byte} xor {self.mask:02X}")
        words += self._how()
        if (self.action.of_frames or self.action is Action.FOREIGN) and self.count is not None:
            words.append(f"x {self.count}")
        if self.delay_s:
            words.append(f"by {_number(self.delay_s)} s")
        if self.duration_s:
            words.append(f"for {_number(self.duration_s)} s")
        if self.odds != 1.0:
            words.append(f"odds {_number(self.odds)}")
        return " ".join(words)

    def _how(self) -> list[str]:
        """What some actions are told besides."""
        before = {Action.WEAK: "to", Action.LIMIT: "at", Action.MODE: "to", Action.WRITE: "to"}
        words = [self.word] if self.word else []
        words += [] if self.value is None else [before[self.action], str(self.value)]
        words += ["%"] if self.action is Action.WEAK else []
        return words + (["data", self.data.hex().upper()] if self.data else [])

    def _target(self) -> str:
        if self.can_id is not None:
            return f"{self.can_id:03X}"
        return "master" if self.node == MASTER else str(self.node)


def _number(value: float) -> str:
    return f"{max(0.0, value):.9f}".rstrip("0").rstrip(".")
