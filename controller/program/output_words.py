"""M6, M19 and M62 to M68: what the machine switches and waits for.

With a changer M6 is its steps as blocks, each behind a stop:

    M6 -> stop | step | stop | step | ... | stop | the program goes on

At each stop somebody keeps in a journal which step comes, before it moves anything, and only then lets the
machine go on (``service/tool_changer``). What a step switches is told at its place alone, and is no part of
the program's modal state: no restart brings it back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from controller.machine.model import Changer, ChangerStep, Io, Machine
from controller.messages import Key, message
from controller.program.codes import ParsedLine
from controller.program.line import READ_S
from controller.program.program import (
    UNSAID,
    Act,
    Action,
    Await,
    Block,
    Changing,
    JointLine,
    Level,
    Lifts,
    Modal,
    Outputs,
    Place,
    Remark,
)
from controller.program.words import Word

MAX_WAIT_S = 604_800.0  # a week


def number(ask: ParsedLine, code: str, word: Word, machine: Machine) -> int:
    """The output that P of M62 to M65 names. Raises ProgramError."""
    return _named(ask, code, word, "digital_out", machine.io.digital_out if machine.io else ())


def awaited(
    ask: ParsedLine, word: Word, modal: Modal, machine: Machine
) -> tuple[Await | Remark, float | None]:
    """M66 P L Q, and #5399 after it, None where nothing tells. Raises ProgramError."""
    number = _named(ask, "M66", word, "digital_in", machine.io.digital_in if machine.io else ())
    kind, most = ask.words.get("L"), ask.words.get("Q")
    level = 0 if kind is None else ask.whole(kind)
    if level == 0:
        reads = machine.io.read_as(number) if machine.io else None
        if reads is None:
            return Remark(ask.place(word), modal, message("note.reads_input")), None
        return Await(ask.place(word), modal, number, Level.HIGH if reads else Level.LOW, READ_S), float(reads)
    if level > len(Level):
        raise ask.refusal(kind or word, "output.no_level", level=level)
    if most is None or not 0.0 < most.value <= MAX_WAIT_S:
        raise ask.refusal(most or word, "output.no_time", level=level, most=MAX_WAIT_S)
    wait = Await(ask.place(word), modal, number, Level(level), most.value)
    return wait, float(wait.level in (Level.RISE, Level.HIGH))


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


CLAMPED = "tool_clamped"
GUARDS = (
    CLAMPED,
    "door",
    "feed_stop",
)  # inputs that forbid motion while they are off, and that a step may open
LEVELS = {"rise": Level.RISE, "fall": Level.FALL, "on": Level.HIGH, "off": Level.LOW}


def steps_of(changer: Changer, tool_out: int, tool_in: int) -> list[tuple[ChangerStep, int]]:
    """The steps of a change with the pocket of each: the tool of the spindle away, then the other."""
    rows = [(step, changer.pocket(tool_out) or 0) for step in changer.put_away] if tool_out else []
    return rows + ([(step, changer.pocket(tool_in) or 0) for step in changer.take] if tool_in else [])


def blocks(
    ask: ParsedLine, word: Word, before: Modal, after: Modal, machine: Machine, number: int
) -> tuple[list[Block], int]:
    """What M6 makes, and the number of the next stop. Raises ProgramError.

    ``before``, ``after``: the modal state without coolant, with the one and the other tool.
    """
    changer = machine.changer
    if changer is None or before.tool == after.tool == 0:
        return [], number
    place, still, made = ask.place(word), replace(after, spindle_rev_min=0.0, coolant=0), list[Block]()
    if before.tool == after.tool:  # nothing moves, but where the tool's life is over the run is held here
        return [_stop(place, still, Changing(number, before.tool, after.tool, 0, True))], number + 1
    for tool in (before.tool, after.tool):
        if tool and changer.pocket(tool) is None:
            known = ", ".join(f"T{one}" for one in changer.pockets if one) or "–"
            raise ask.refusal(word, "tool.no_pocket", tool=tool, known=known)
    if before.planar is not None:
        raise ask.refusal(word, "tool.change_beside")
    rows = steps_of(changer, before.tool, after.tool)
    lifts = _lifts(changer, machine.io, before.tool, after.tool)
    for k, (step, pocket) in enumerate(rows):
        made.append(_stop(place, still, Changing(number + k, before.tool, after.tool, k, False)))
        made += _step(place, still, step, pocket, machine, lifts[k])
    released = _released(machine.io, rows, after)
    if released != UNSAID or (lifts and lifts[-1][1]):  # left empty, every guard comes back
        made.append(Action(place, still, Act.OUTPUT, outputs=released, lifts=(0, 0)))
    last = Changing(number + len(rows), before.tool, after.tool, len(rows), True)
    made.append(_stop(place, still, last))
    return made, number + len(rows) + 1


def _released(io: Io | None, rows: Sequence[tuple[ChangerStep, int]], after: Modal) -> Outputs:
    """Switches off what has held the spindle at its angle for a step, but for an M19 of the program."""
    if io is None or io.orient is None or not any(step.orient for step, _ in rows):
        return UNSAID
    number = io.switched.index(io.orient.output)
    return UNSAID if after.outputs.on >> number & 1 else UNSAID.switched(number, False)


def _switched(step: ChangerStep) -> set[tuple[str, bool]]:
    """Outputs that a step switches, but for the number of the pocket, and whether each is on."""
    return {(name, True) for name in step.on} | {(name, False) for name in step.off}


def _openers(changer: Changer, guard: str) -> set[tuple[str, bool]]:
    """Outputs, and how they are switched where that guard goes off.

    By the steps that wait for it; a drawbar whose switch none waits for is open where the tool is let go.
    """
    put_away, take = changer.put_away, changer.take
    rows = [(step, step.level in ("rise", "on")) for step in (*put_away, *take) if step.input == guard]
    if not rows and guard == CLAMPED:
        rows = [(step, False) for step in put_away if step.carries]
        rows += [(step, True) for step in take if step.carries]
    return {(name, on is not shuts) for step, shuts in rows for name, on in _switched(step)}


def _lifts(changer: Changer, io: Io | None, tool_out: int, tool_in: int) -> list[Lifts]:
    """Of each step of a change the guards that do not count while it waits, and after it.

    A guard is lifted from the step that opens it to the end of that which closes it; that of the drawbar
    also while the spindle is empty, for there is nothing that could be clamped.
    """
    bits = {name: 1 << bit for name in GUARDS if io is not None and (bit := io.input(name)) is not None}
    openers = {name: _openers(changer, name) for name in bits}
    rows = [(step, True) for step in changer.put_away if tool_out]
    rows += [(step, False) for step in changer.take if tool_in]
    opened, empty, before, found = set[str](), False, 0, list[Lifts]()
    for step, goes_away in rows:
        switched = _switched(step)
        for name, opens in openers.items():
            if switched & opens:
                opened.add(name)
            elif switched & {(output, not on) for output, on in opens}:
                opened.discard(name)
        empty = goes_away if step.carries else empty
        after = sum(bit for name, bit in bits.items() if name in opened or (name == CLAMPED and empty))
        found.append((before | after, after))
        before = after
    return found


def _stop(place: Place, modal: Modal, changing: Changing) -> Action:
    return Action(place, modal, Act.STOP, changing)


def _step(
    place: Place, modal: Modal, step: ChangerStep, pocket: int, machine: Machine, lifts: Lifts
) -> list[Block]:
    """Moves, then the spindle's angle, then outputs, then the input."""
    made: list[Block] = []
    if step.move:
        goes = dict(step.move)
        targets = tuple(
            None if axis.name not in goes else _of(goes[axis.name], pocket) for axis in machine.axes
        )
        made.append(JointLine(place, modal, targets, False, True, None, None))
    io = machine.io
    if io is None:
        return made
    if step.orient and io.orient is not None:
        outputs = UNSAID.switched(io.switched.index(io.orient.output), True)
        made.append(Action(place, modal, Act.OUTPUT, outputs=outputs))
        back = io.awaited.index(io.orient.input)
        made.append(Await(place, modal, back, Level.HIGH, io.orient.within_s))
    said = UNSAID
    for name, on in step.outputs(pocket):
        said = said.switched(io.switched.index(name), on)
    if (
        step.input
    ):  # in one with the outputs, or a switch that is quick would have changed before it is awaited
        number = io.awaited.index(step.input)
        made.append(Await(place, modal, number, LEVELS[step.level], step.within_s, said, lifts))
    elif said != UNSAID or lifts[0] != lifts[1]:
        made.append(Action(place, modal, Act.OUTPUT, outputs=said, lifts=lifts))
    return made


def _of(places: tuple[float, ...], pocket: int) -> float:
    """The only place, or that of the pocket."""
    return places[0] if len(places) == 1 else places[pocket - 1]
