"""Faults on the virtual bus, written down: what happens to which frames or nodes, and when.

    seed 7                                     for the odds, if there are any
    at 2.5 s: drop 203 x 2                     two frames with identifier 203h reach nobody
    at sync 1200: delay rpdo 3 by 500 us       from the 1200th SYNC on the wire, itself included
    at 3 s: duplicate tpdo 1 x 4               each is sent twice
    at 3 s: reorder 203                        it comes after the next one of its identifier
    at 3 s: corrupt heartbeat 3 x 40           bit errors: error frames, counters, tried again
    at 4 s: falsify tpdo 3 byte 0 xor 08 x 3   a wrong content with a right check sum
    at 4 s: drop sync for 10 ms odds 0.3       each of them by chance
    at 5 s: babble 001 for 20 ms               a node that does not stop sending
    at 6 s: bus_off 3 for 50 ms                or "master"; without "for", for good
    at 7 s: node_reset 2                       power off and on
    at 8 s: silence 4 for 100 ms               it hears, and nothing of it comes
    at 9 s: queue_full master for 5 ms         sending is refused (ENOBUFS)

Identifiers are hexadecimal, or by meaning: ``rpdo 3``, ``tpdo 3``, ``rpdo2 3``, ``emcy 3``,
``heartbeat 3``, ``sync``. ``x N`` counts frames (1 if neither ``x`` nor ``for`` is there);
times are seconds of the bus' clock since the script was injected at its origin.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

from drives import pdo

if TYPE_CHECKING:
    from drives.virtual.fault_injector import Injector
    from drives.virtual.virtual_bus import SteppedBus

MASTER = 0  # as a node: the CAN controller of who sends SYNC

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
MEANINGS = {
    "emcy": pdo.EMCY,
    "heartbeat": pdo.HEARTBEAT,
    "sdo": pdo.SDO_ANSWER,
    **{f"tpdo{n}": 0x080 + n * 0x100 for n in range(1, 5)},
    **{f"rpdo{n}": 0x100 + n * 0x100 for n in range(1, 5)},
    "tpdo": pdo.TPDO1,
    "rpdo": pdo.RPDO1,
}


class ScriptError(ValueError):
    """A line of a fault script that cannot be understood; the text says which, and what can be."""


class Action(Enum):
    """What can go wrong."""

    DROP = "drop"
    DELAY = "delay"
    DUPLICATE = "duplicate"
    REORDER = "reorder"
    CORRUPT = "corrupt"
    FALSIFY = "falsify"
    BABBLE = "babble"
    BUS_OFF = "bus_off"
    NODE_RESET = "node_reset"
    SILENCE = "silence"
    QUEUE_FULL = "queue_full"

    @property
    def of_frames(self) -> bool:
        """Whether it befalls frames of an identifier, and not a node."""
        return self in _OF_FRAMES


_OF_FRAMES = frozenset(
    (Action.DROP, Action.DELAY, Action.DUPLICATE, Action.REORDER, Action.CORRUPT, Action.FALSIFY)
)


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

    def text(self) -> str:
        """The line of a script that says this."""
        words = [f"at sync {self.when.sync}:" if self.when.sync else f"at {_number(self.when.at_s)} s:"]
        words += [self.action.value, self._target()]
        if self.action is Action.FALSIFY:
            words.append(f"byte {self.byte} xor {self.mask:02X}")
        if self.action.of_frames and self.count is not None:
            words.append(f"x {self.count}")
        if self.delay_s:
            words.append(f"by {_number(self.delay_s)} s")
        if self.duration_s:
            words.append(f"for {_number(self.duration_s)} s")
        if self.odds != 1.0:
            words.append(f"odds {_number(self.odds)}")
        return " ".join(words)

    def _target(self) -> str:
        if self.can_id is not None:
            return f"{self.can_id:03X}"
        return "master" if self.node == MASTER else str(self.node)


def _number(value: float) -> str:
    return f"{max(0.0, value):.9f}".rstrip("0").rstrip(".")


@dataclass(frozen=True, slots=True)
class FaultScript:
    """Faults in the order of writing. Made by ``read``, or in Python from ``Injection``."""

    injections: tuple[Injection, ...] = ()
    seed: int = 0

    @staticmethod
    def read(text: str) -> FaultScript:
        """Raises ScriptError with the number of the line."""
        seed, found = 0, []
        for number, line in enumerate(text.splitlines(), 1):
            words = line.partition("#")[0].strip()
            try:
                if words.startswith("seed"):
                    seed = _seed(words)
                elif words:
                    found.append(parse(words))
            except ScriptError as error:
                raise ScriptError(f"line {number}: {error}") from None
        return FaultScript(tuple(found), seed)

    def inject(self, bus: SteppedBus, origin_s: float = 0.0) -> Injector:
        """Have these faults happen on a bus; times count from ``origin_s`` of its clock.

        Raises ScriptError for a node that is not on the bus. More may be added to what is returned.
        """
        from drives.virtual.fault_injector import Injector

        injector = Injector(bus, origin_s, self.seed)
        for injection in self.injections:
            injector.add(injection)
        return injector


def _seed(words: str) -> int:
    found = re.fullmatch(r"seed\s+(\d+)", words)
    if found is None:
        raise ScriptError(f"'{words}': after 'seed' one whole number is expected")
    return int(found[1])


def parse(line: str) -> Injection:
    """One line without its comment. Raises ScriptError."""
    head, colon, rest = line.partition(":")
    if not colon:
        raise ScriptError(f"'{line}' has no colon; write 'at 2.5 s: drop 203 x 2'")
    tokens = iter(rest.split())
    name = next(tokens, "")
    actions = {action.value: action for action in Action}
    if name not in actions:
        raise ScriptError(f"{name!r} is no fault; use one of {', '.join(actions)}")
    injection = Injection(actions[name], when=_when(head))
    injection = _aimed(injection, tokens)
    injection = _told(injection, tokens)
    return _complete(injection)


def _when(head: str) -> When:
    words = head.split()
    if len(words) == 3 and words[:2] == ["at", "sync"] and words[2].isdecimal() and int(words[2]):
        return When(sync=int(words[2]))
    if words[:1] == ["at"] and len(words) > 1 and words[1] != "sync":
        return When(at_s=_seconds(" ".join(words[1:])))
    raise ScriptError(
        f"'{head.strip()}' is no time; write 'at 2.5 s' or 'at sync 1200' (the first SYNC is 1)"
    )


def _seconds(text: str) -> float:
    found = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(s|ms|us)", text)
    if found is None:
        raise ScriptError(f"'{text}' is no time; write a number and s, ms or us, for example '500 us'")
    return float(found[1]) * UNITS[found[2]]


def _aimed(injection: Injection, tokens: Iterator[str]) -> Injection:
    """The target: an identifier, or a node."""
    word = next(tokens, "")
    if injection.action.of_frames or injection.action is Action.BABBLE:
        if word == "sync":
            return replace(injection, can_id=pdo.SYNC)
        if word in MEANINGS:
            return replace(injection, can_id=MEANINGS[word] + _node(next(tokens, "")))
        if not re.fullmatch(r"[0-9A-Fa-f]{1,3}", word) or int(word, 16) > 0x7FF:
            names = "sync, rpdo 3, tpdo 3, heartbeat 3, emcy 3"
            raise ScriptError(f"{word!r} is no identifier; use 000 to 7FF (hexadecimal), or {names}")
        return replace(injection, can_id=int(word, 16))
    if word == "master":
        if injection.action is Action.NODE_RESET:
            raise ScriptError("the master cannot be reset from the bus; use bus_off or silence")
        return replace(injection, node=MASTER)
    return replace(injection, node=_node(word))


def _node(word: str) -> int:
    if not word.isdecimal() or not 1 <= int(word) <= 127:
        raise ScriptError(f"{word!r} is no node; use 1 to 127 (decimal)")
    return int(word)


def _told(injection: Injection, tokens: Iterator[str]) -> Injection:
    """The words behind the target, each at most once."""
    seen: set[str] = set()
    for word in tokens:
        if word in seen:
            raise ScriptError(f"'{word}' stands twice")
        seen.add(word)
        injection = _with_word(injection, word, tokens)
    if injection.action.of_frames and "x" not in seen and injection.duration_s:
        injection = replace(injection, count=None)
    return injection


def _with_word(injection: Injection, word: str, tokens: Iterator[str]) -> Injection:
    """One option; which of them an action takes is its own matter."""
    frames, action = injection.action.of_frames, injection.action
    if word == "x" and frames:
        return replace(injection, count=_whole(next(tokens, ""), 1, 10**9, "x"))
    if word == "by" and action is Action.DELAY:
        return replace(injection, delay_s=_time_words(tokens))
    if word == "for" and action is not Action.NODE_RESET:
        return replace(injection, duration_s=_time_words(tokens))
    if word == "odds" and frames:
        return replace(injection, odds=_odds(next(tokens, "")))
    if word == "byte" and action is Action.FALSIFY:
        byte = _whole(next(tokens, ""), 0, 7, "byte")
        if next(tokens, "") != "xor":
            raise ScriptError("after 'byte N' stands 'xor' and two hexadecimal digits")
        return replace(injection, byte=byte, mask=_mask(next(tokens, "")))
    raise ScriptError(f"{word!r} does not go with {action.value}")


def _time_words(tokens: Iterator[str]) -> float:
    """A number and its unit, in one word or in two."""
    word = next(tokens, "")
    return _seconds(word if word[-1:].isalpha() else f"{word} {next(tokens, '')}")


def _whole(word: str, low: int, high: int, what: str) -> int:
    if not word.isdecimal() or not low <= int(word) <= high:
        raise ScriptError(f"{word!r} after '{what}': a whole number from {low} to {high} is expected")
    return int(word)


def _odds(word: str) -> float:
    if not re.fullmatch(r"0?\.\d+|1|1\.0*|0", word):
        raise ScriptError(f"{word!r} after 'odds': a number from 0 to 1 is expected")
    return float(word)


def _mask(word: str) -> int:
    if not re.fullmatch(r"[0-9A-Fa-f]{2}", word):
        raise ScriptError(f"{word!r} after 'xor': two hexadecimal digits are expected")
    return int(word, 16)


def _complete(injection: Injection) -> Injection:
    """What an action cannot do without."""
    action = injection.action
    if action is Action.DELAY and not injection.delay_s:
        raise ScriptError("delay needs a time: write 'delay 203 by 500 us'")
    if action is Action.BABBLE and not injection.duration_s:
        raise ScriptError("babble needs an end: write 'babble 001 for 20 ms'")
    if action is Action.QUEUE_FULL and not injection.duration_s:
        raise ScriptError("queue_full needs an end: write 'queue_full master for 5 ms'")
    if action is Action.FALSIFY and not injection.mask:
        raise ScriptError("falsify needs the bits to turn: write 'falsify 183 byte 0 xor 08'")
    return injection
