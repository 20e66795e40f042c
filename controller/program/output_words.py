"""M62 to M68 and M19: which output or input of the machine a P or E names, and what it is told."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

from controller.machine.model import Machine
from controller.program.codes import Ask
from controller.program.program import Await, Block, Level, Modal, Remark
from controller.program.words import Word

MAX_WAIT_S = 604_800.0  # a week
READS = (
    "M66 without L, or with L0, reads an input for #5399, which no program can look at here; write L3 or "
    "L4 and Q to wait for it."
)


def number(ask: Ask, code: str, word: Word, machine: Machine) -> int:
    """The output that P of M62 to M65 names. Raises ProgramError."""
    return _named(ask, code, word, "digital_out", machine.io.digital_out if machine.io else ())


def awaited(ask: Ask, word: Word, modal: Modal, machine: Machine) -> list[Block]:
    """M66 P L Q. Raises ProgramError."""
    number = _named(ask, "M66", word, "digital_in", machine.io.digital_in if machine.io else ())
    kind, most = ask.words.get("L"), ask.words.get("Q")
    level = 0 if kind is None else ask.whole(kind)
    if level == 0:
        return [Remark(ask.place(word), modal, READS)]
    if level > len(Level):
        raise ask.refusal(
            kind or word,
            f"L{level} is nothing that M66 waits for: L1 is a rise, L2 a fall, L3 on, L4 off; use one of "
            "these",
        )
    if most is None or not 0.0 < most.value <= MAX_WAIT_S:
        raise ask.refusal(
            most or word,
            f"M66 L{level} has no time: write Q with the seconds that it may take, above 0 and at most "
            f"{MAX_WAIT_S:.0f}",
        )
    return [Await(ask.place(word), modal, number, Level(level), most.value)]


def led(ask: Ask, code: str, word: Word, machine: Machine) -> tuple[int, float]:
    """M67 and M68 E Q: the number of an analogue output, and its value. Raises ProgramError."""
    outs = machine.io.analogue_out if machine.io else ()
    if not outs:
        raise ask.refusal(
            word,
            f"{code} has nothing to work on: the machine file has no analogue_out in [io]; name it there",
        )
    known = ", ".join(f"E{i} {out.name}" for i, out in enumerate(outs))
    e, q = ask.words.get("E"), ask.words.get("Q")
    if e is None or ask.whole(e) >= len(outs):
        raise ask.refusal(
            e or word,
            f"{e.text if e else code} names no analogue output: write E and its number; there are {known}",
        )
    out = outs[int(e.value)]
    if q is None or not out.low <= q.value <= out.high:
        raise ask.refusal(
            q or word, f"{out.name} takes Q from {out.low:g} to {out.high:g}; write Q and its value"
        )
    return int(e.value), q.value


def oriented(ask: Ask, word: Word, machine: Machine) -> tuple[int, int, float]:
    """M19 R Q P: the numbers of output and input, and the seconds that it may take. Raises ProgramError."""
    output, back, most_s = standing(ask, word, machine, "M19")
    r, q, p = (ask.words.get(letter) for letter in "RQP")
    angle = machine.io.orient.angle_deg if machine.io and machine.io.orient else 0.0
    if r is not None and (r.value - angle) % 360.0 != 0.0:
        raise ask.refusal(
            r,
            f"{r.text} is not where this spindle stops: its drive brings it to {angle:g} degrees alone "
            f"(orient in [io]); write R{angle:g}, or leave R out",
        )
    if p is not None and p.value != 0.0:
        raise ask.refusal(
            p, f"{p.text} chooses a direction: the spindle's drive takes its own; write P0, or leave P out"
        )
    if q is not None and not 0.0 < q.value <= MAX_WAIT_S:
        raise ask.refusal(
            q,
            f"{q.text} is no time: Q is the seconds that it may take, above 0 and at most a week; correct it",
        )
    return output, back, most_s if q is None else q.value


_INSTEAD = MappingProxyType(
    {"M19": "M5", "G76": "G85, G86 or G89", "G87": "the moves of a cutter from below"}
)


def standing(ask: Ask, word: Word, machine: Machine, code: str) -> tuple[int, int, float]:
    """With what the spindle is brought to its angle: output, input, seconds at most. Raises ProgramError."""
    io = machine.io
    if io is None or io.orient is None:
        raise ask.refusal(
            word,
            f"{code} has nothing to work on: the machine file has no orient in [io], the output that brings "
            "the spindle to its angle and the input that says so; name them there, or write "
            f"{_INSTEAD[code]}",
        )
    return len(io.digital_out), len(io.digital_in), io.orient.within_s


def _named(ask: Ask, code: str, word: Word, key: str, names: Sequence[str]) -> int:
    if not names:
        raise ask.refusal(
            word, f"{code} has nothing to work on: the machine file has no {key} in [io]; name it there"
        )
    known = ", ".join(f"P{i} {name}" for i, name in enumerate(names))
    p = ask.words.get("P")
    if p is None:
        raise ask.refusal(word, f"{code} does not say which one: write P and its number; there are {known}")
    if ask.whole(p) >= len(names):
        raise ask.refusal(
            p, f"{p.text} names nothing: {key} in [io] of the machine file has {known}; use one of these"
        )
    return int(p.value)
