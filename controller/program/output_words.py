"""M62 to M68 and M19: which output or input of the machine a P or E names, and what it is told."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

from controller.machine.model import Machine
from controller.messages import Key, message
from controller.program.codes import ParsedLine
from controller.program.program import Await, Block, Level, Modal, Remark
from controller.program.words import Word

MAX_WAIT_S = 604_800.0  # a week


def number(ask: ParsedLine, code: str, word: Word, machine: Machine) -> int:
    """The output that P of M62 to M65 names. Raises ProgramError."""
    return _named(ask, code, word, "digital_out", machine.io.digital_out if machine.io else ())


def awaited(ask: ParsedLine, word: Word, modal: Modal, machine: Machine) -> list[Block]:
    """M66 P L Q. Raises ProgramError."""
    number = _named(ask, "M66", word, "digital_in", machine.io.digital_in if machine.io else ())
    kind, most = ask.words.get("L"), ask.words.get("Q")
    level = 0 if kind is None else ask.whole(kind)
    if level == 0:
        return [Remark(ask.place(word), modal, message("note.reads_input"))]
    if level > len(Level):
        raise ask.refusal(kind or word, "output.no_level", level=level)
    if most is None or not 0.0 < most.value <= MAX_WAIT_S:
        raise ask.refusal(most or word, "output.no_time", level=level, most=MAX_WAIT_S)
    return [Await(ask.place(word), modal, number, Level(level), most.value)]


def led(ask: ParsedLine, code: str, word: Word, machine: Machine) -> tuple[int, float]:
    """M67 and M68 E Q: the number of an analogue output, and its value. Raises ProgramError."""
    outs = machine.io.analogue_out if machine.io else ()
    if not outs:
        raise ask.refusal(word, "output.no_analogue", code=code)
    known = ", ".join(f"E{i} {out.name}" for i, out in enumerate(outs))
    e, q = ask.words.get("E"), ask.words.get("Q")
    if e is None or ask.whole(e) >= len(outs):
        raise ask.refusal(e or word, "output.which_analogue", found=e.text if e else code, known=known)
    out = outs[int(e.value)]
    if q is None or not out.low <= q.value <= out.high:
        raise ask.refusal(q or word, "output.range", name=out.name, low=out.low, high=out.high)
    return int(e.value), q.value


def oriented(ask: ParsedLine, word: Word, machine: Machine) -> tuple[int, int, float]:
    """M19 R Q P: the numbers of output and input, and the seconds that it may take. Raises ProgramError."""
    output, back, most_s = standing(ask, word, machine, "M19")
    r, q, p = (ask.words.get(letter) for letter in "RQP")
    angle = machine.io.orient.angle_deg if machine.io and machine.io.orient else 0.0
    if r is not None and (r.value - angle) % 360.0 != 0.0:
        raise ask.refusal(r, "spindle.angle", angle=angle)
    if p is not None and p.value != 0.0:
        raise ask.refusal(p, "spindle.direction")
    if q is not None and not 0.0 < q.value <= MAX_WAIT_S:
        raise ask.refusal(q, "spindle.no_time")
    return output, back, most_s if q is None else q.value


_INSTEAD = MappingProxyType({"M19": "M5", "G76": Key("spindle.bore"), "G87": Key("spindle.from_below")})


def standing(ask: ParsedLine, word: Word, machine: Machine, code: str) -> tuple[int, int, float]:
    """With what the spindle is brought to its angle: output, input, seconds at most. Raises ProgramError."""
    io = machine.io
    if io is None or io.orient is None:
        raise ask.refusal(word, "spindle.no_orient", code=code, instead=_INSTEAD[code])
    return len(io.digital_out), len(io.digital_in), io.orient.within_s


def _named(ask: ParsedLine, code: str, word: Word, key: str, names: Sequence[str]) -> int:
    if not names:
        raise ask.refusal(word, "output.none", code=code, table=key)
    known = ", ".join(f"P{i} {name}" for i, name in enumerate(names))
    p = ask.words.get("P")
    if p is None:
        raise ask.refusal(word, "output.which", code=code, known=known)
    if ask.whole(p) >= len(names):
        raise ask.refusal(p, "output.unknown", table=key, known=known)
    return int(p.value)
