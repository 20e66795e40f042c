"""One line of a fault script, read (see ``fault_script`` for examples of every one)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from drives import pdo
from drives.bench.virtual.fault_kinds import MASTER, Action, Injection, ScriptError, When
from drives.texts import message

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


OF_THE_MASTER = (Action.BUS_OFF, Action.SILENCE, Action.QUEUE_FULL)
WORDS = {
    Action.SWITCH: ("high", "low"),
    Action.NMT: ("start", "stop", "preop", "reset", "reset_communication"),
}
NEEDS = {
    Action.WEAK: "script.weak",
    Action.LIMIT: "script.limit",
    Action.SWITCH: "script.switch",
    Action.MODE: "script.mode",
    Action.WRITE: "script.write",
    Action.NMT: "script.nmt",
}


def parse(line: str) -> Injection:
    """One line without its comment. Raises ScriptError."""
    head, colon, rest = line.partition(":")
    if not colon:
        raise ScriptError(message("script.no_colon", line=line))
    tokens = iter(rest.split())
    name = next(tokens, "")
    actions = {action.value: action for action in Action}
    if name not in actions:
        raise ScriptError(message("script.no_fault", name=name, names=", ".join(actions)))
    injection = Injection(actions[name], when=_when(head))
    injection = _aimed(injection, tokens)
    injection = _with_words(injection, tokens)
    return _complete(injection)


def _when(head: str) -> When:
    words = head.split()
    if len(words) == 3 and words[:2] == ["at", "sync"] and words[2].isdecimal() and int(words[2]):
        return When(sync=int(words[2]))
    if words[:1] == ["at"] and len(words) > 1 and words[1] != "sync":
        return When(at_s=_seconds(" ".join(words[1:])))
    raise ScriptError(message("script.when", head=head.strip()))


def _seconds(text: str) -> float:
    found = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(s|ms|us)", text)
    if found is None:
        raise ScriptError(message("script.time", text=text))
    return float(found[1]) * UNITS[found[2]]


def _aimed(injection: Injection, tokens: Iterator[str]) -> Injection:
    """The target: an identifier, or a node."""
    word = next(tokens, "")
    if injection.action.names_frames:
        if word == "sync":
            return replace(injection, can_id=pdo.SYNC)
        if word in MEANINGS:
            return replace(injection, can_id=MEANINGS[word] + _node(next(tokens, "")))
        if not re.fullmatch(r"[0-9A-Fa-f]{1,3}", word) or int(word, 16) > 0x7FF:
            names = "sync, rpdo 3, tpdo 3, heartbeat 3, emcy 3"
            raise ScriptError(message("script.identifier", word=word, names=names))
        return replace(injection, can_id=int(word, 16))
    if word == "master":
        if injection.action is Action.NODE_RESET:
            raise ScriptError(message("script.master_reset"))
        if injection.action not in OF_THE_MASTER:
            raise ScriptError(message("script.not_the_master", action=injection.action.value))
        return replace(injection, node=MASTER)
    return replace(injection, node=_node(word))


def _node(word: str) -> int:
    if not word.isdecimal() or not 1 <= int(word) <= 127:
        raise ScriptError(message("script.node", word=word))
    return int(word)


def _with_words(injection: Injection, tokens: Iterator[str]) -> Injection:
    """The injection with the words after its target, each at most once. Raises ScriptError."""
    seen: set[str] = set()
    for word in tokens:
        if word in seen:
            raise ScriptError(message("script.twice", word=word))
        seen.add(word)
        injection = _with_word(injection, word, tokens)
    counts = injection.action.of_frames or injection.action is Action.FOREIGN
    if counts and "x" not in seen and injection.duration_s:
        injection = replace(injection, count=None)
    return injection


def _with_value(injection: Injection, word: str, tokens: Iterator[str]) -> Injection | None:
    """What one action alone is told; None: the word is none of these."""
    action = injection.action
    if word == "to" and action is Action.WEAK:
        share = next(tokens, "")
        if not share.endswith("%") and next(tokens, "") != "%":
            raise ScriptError(message("script.percent", share=share))
        return replace(injection, value=_whole(share.rstrip("%"), 1, 100, "to"))
    if word == "to" and action is Action.MODE:
        return replace(injection, value=_signed(next(tokens, ""), -128, 127, "to"))
    if action is Action.WRITE and re.fullmatch(r"[0-9A-Fa-f]{4}:[0-9A-Fa-f]{2}", word):
        return replace(injection, word=word.upper())
    if word == "to" and action is Action.WRITE:
        return replace(injection, value=_signed(next(tokens, ""), -(2**31), 2**32 - 1, "to"))
    if word == "at" and action is Action.LIMIT:
        return replace(injection, value=_signed(next(tokens, ""), -(2**31), 2**31 - 1, "at"))
    if word == "data" and action is Action.FOREIGN:
        return replace(injection, data=_bytes(next(tokens, "")))
    if word in WORDS.get(action, ()) and not injection.word:
        return replace(injection, word=word)
    return None


def _with_word(injection: Injection, word: str, tokens: Iterator[str]) -> Injection:
    """One option; which of them an action takes is its own matter."""
    frames, action = injection.action.of_frames, injection.action
    told = _with_value(injection, word, tokens)
    if told is not None:
        return told
    if word == "x" and (frames or action is Action.FOREIGN):
        return replace(injection, count=_whole(next(tokens, ""), 1, 10**9, "x"))
    if word == "by" and action is Action.DELAY:
        return replace(injection, delay_s=_time_words(tokens))
    if word == "for" and action.lasts:
        return replace(injection, duration_s=_time_words(tokens))
    if word == "odds" and frames:
        return replace(injection, odds=_odds(next(tokens, "")))
    if word == "byte" and action is Action.FALSIFY:
        byte = _whole(next(tokens, ""), 0, 7, "byte")
        if next(tokens, "") != "xor":
            raise ScriptError(message("script.xor"))
        return replace(injection, byte=byte, mask=_mask(next(tokens, "")))
    raise ScriptError(message("script.word", word=word, action=action.value))


def _time_words(tokens: Iterator[str]) -> float:
    """A number and its unit, in one word or in two."""
    word = next(tokens, "")
    return _seconds(word if word[-1:].isalpha() else f"{word} {next(tokens, '')}")


def _whole(word: str, low: int, high: int, what: str) -> int:
    if not word.isdecimal() or not low <= int(word) <= high:
        raise ScriptError(message("script.whole", word=word, what=what, low=low, high=high))
    return int(word)


def _signed(word: str, low: int, high: int, what: str) -> int:
    if not re.fullmatch(r"[+-]?\d+", word) or not low <= int(word) <= high:
        raise ScriptError(message("script.whole", word=word, what=what, low=low, high=high))
    return int(word)


def _bytes(word: str) -> bytes:
    if not re.fullmatch(r"([0-9A-Fa-f]{2}){1,8}", word):
        raise ScriptError(message("script.data", word=word))
    return bytes.fromhex(word)


def _odds(word: str) -> float:
    if not re.fullmatch(r"0?\.\d+|1|1\.0*|0", word):
        raise ScriptError(message("script.odds", word=word))
    return float(word)


def _mask(word: str) -> int:
    if not re.fullmatch(r"[0-9A-Fa-f]{2}", word):
        raise ScriptError(message("script.mask", word=word))
    return int(word, 16)


def _complete(injection: Injection) -> Injection:
    """What an action cannot do without."""
    action = injection.action
    if action is Action.DELAY and not injection.delay_s:
        raise ScriptError(message("script.delay"))
    if action is Action.BABBLE and not injection.duration_s:
        raise ScriptError(message("script.babble"))
    if action is Action.QUEUE_FULL and not injection.duration_s:
        raise ScriptError(message("script.queue_full"))
    if action is Action.FALSIFY and not injection.mask:
        raise ScriptError(message("script.falsify"))
    lacks = action is Action.WRITE and (injection.value is None or not injection.word)
    if lacks or (action in NEEDS and injection.value is None and not injection.word):
        raise ScriptError(message(NEEDS[action], words=", ".join(WORDS.get(action, ()))))
    return injection
