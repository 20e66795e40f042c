"""Words to blocks: what each line asks for, under the modal state it stands in.

The language is RS-274/NGC as far as DESIGN section 1 names it, with the paper's G51
(cone) and G52 (ruled surface) and G6.2 (ruled surface between NURBS curves). Codes of
one line run in the order of RS-274/NGC section 3.8: F S T M6 M3-5 M7-9 G4, the modal G
codes, the motion, M0-M30. Only the unit comes first, so that G20 holds for the F beside
it. A line changes nothing until all of it has been found sound: state is replaced,
never edited.

Length words are millimetres or inches as G21/G20 say. The words of G51, G52 and G6.2
follow the paper: without a decimal point they count in BLU (0.01 mm, 0.001 degree,
0.01 mm/min), with one in the active unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from types import MappingProxyType

from controller.geometry import Vector
from controller.machine import Joints, Machine
from controller.plan.text import codes, decoding, linked, modal, nurbs_words, surface_words, words
from controller.plan.text.codes import CONE_WORDS, GROUP_OF, SIDES, SURFACES, Ask
from controller.plan.text.flow import Limits
from controller.plan.text.given import Given
from controller.plan.text.line import Upcoming
from controller.plan.text.modal import TIPS, State
from controller.plan.text.parameters import Parameters
from controller.plan.text.plain import PlainLines
from controller.plan.text.position import Position, homed
from controller.plan.text.program import (
    Act,
    Action,
    Block,
    JointArc,
    JointLine,
    Message,
    Program,
    ProgramError,
    Remark,
    Targets,
    Tip,
    TipLine,
)
from controller.plan.text.saved import Saved
from controller.plan.text.words import Line, Word

SHORTEST_VECTOR = 1e-6  # of I J K; shorter ones have no sure direction
MOST_TURNS = 1000  # of one arc

# Plane axes so that first x second = normal: counter-clockwise is the right hand about the normal.
_PLANES = MappingProxyType({"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)})


def read(
    data: bytes, machine: Machine, name: str, block_delete: bool = False, start: Joints | None = None
) -> Program:
    """The program in ``data`` as blocks: millimetres, radians (carried sense), mm/s.

    The text ends at M2, M30, the closing % or the end of the file; what follows is
    not looked at, beyond being text. ``block_delete`` skips lines that begin with /. ``start``: the
    joints (mm, rad) from which it is run; None: the homed position.
    Raises ProgramError with file, line, column and one sentence; nothing is kept then.
    """
    return Program(name, tuple(stream(data, machine, name, block_delete, start)))


def stream(
    data: bytes,
    machine: Machine,
    name: str,
    block_delete: bool = False,
    start: Joints | None = None,
    refused: list[ProgramError] | None = None,
) -> Iterator[Block]:
    """As ``read``, block by block: what comes before a line that is refused has been given by then.

    With ``refused``, lines that are refused are noted there and left out, as far as it can be read on.
    """
    program, behind = linked.parts(data)
    text, remark = decoding.text_of(program, name)
    files = {label: (file, decoding.text_of(content, file)[0]) for label, (file, content) in behind.items()}
    given = Given(machine, modal.power_on(), Position(machine, start or homed(machine)))
    limits = Limits(machine.call_levels, machine.program_passes)
    lines = words.read(text, name, block_delete, Parameters(given), limits, files, refused)
    if remark is not None:
        yield Remark(remark[0], given.state.modal, remark[1])
    for block in _blocks(lines, machine, given, refused):
        given.position.take(block)
        yield block


def _blocks(
    read: Iterator[Line], machine: Machine, given: Given, refused: list[ProgramError] | None = None
) -> Iterator[Block]:
    """Blocks of lines; ``given`` has the state and the position between two of them."""
    state, plain, ahead, saved = given.state, PlainLines(machine), Upcoming(), Saved()
    told: list[Line] = []
    lines = ahead.given(_heard(read, told))
    for line in lines:
        if told:
            yield from _said(told, state)
        if (quick := plain.read(line, state)) is not None:
            block, given.state = quick
            state = given.state
            yield block
            continue
        try:
            state, restored, line = saved.carry_out(line, state)
            turn = _Turn(codes.sort(line, machine), state, machine, lines, ahead)
            turn.run()
        except ProgramError as error:
            if refused is None:
                raise
            refused.append(error)
            state = given.state = _behind(line, state, lines, ahead)
            continue
        state = given.state = turn.state
        yield from restored
        yield from turn.made
        if turn.ended:
            break
    yield from _said(told, state)


def _behind(line: Line, state: State, lines: Iterator[Line], ahead: Upcoming) -> State:
    """The state behind a line that was refused and left out, so that what follows it is not refused, too."""
    if (plain := line.plain) is not None:
        return replace(state, motion="G1") if plain.with_g1 else state
    named = [f"G{word.value:g}" for word in line.words if word.letter == "G"]
    motion = next((code for code in named if GROUP_OF.get(code) == "motion"), state.motion)
    if motion in SURFACES:  # and its points
        while (after := ahead.look(lines)) is not None and all(w.letter in "XYZKR" for w in after.words):
            next(lines)
    return replace(state, motion="" if motion in (*SURFACES, "G80") else motion)


def _heard(read: Iterator[Line], told: list[Line]) -> Iterator[Line]:
    """The lines with words; those that say something are noted."""
    for line in read:
        if line.message:
            told.append(line)
        if line.is_plain or line.words:
            yield line


def _said(told: list[Line], state: State) -> list[Block]:
    said: list[Block] = [Message(line.place(1), state.modal, line.message) for line in told]
    told.clear()
    return said


class _Turn:
    """One line being carried out; its state counts only when ``run`` returns."""

    def __init__(
        self, ask: Ask, state: State, machine: Machine, lines: Iterator[Line], ahead: Upcoming
    ) -> None:
        self.ask = ask
        self.state = state
        self.made: list[Block] = []
        self.ended = False
        self._machine = machine
        self._lines = lines  # what follows: G52 takes its points from here
        self._axes = "".join(axis.name for axis in machine.axes)
        self._cancels = ask.code("motion") == "G52" and surface_words.cancels_shift(ask, state, lines, ahead)
        self._motion = self._find_motion()

    def run(self) -> None:
        self._check_words()
        sides = [letters for code, letters in self._takers() if code in SIDES]
        self.state, self.made = modal.apply(self.ask, self._motion, self.state, self._machine, "".join(sides))
        self._check_frame()
        if self._cancels:
            self.made.append(surface_words.no_shift(self.ask, self.state))
        if self._motion:
            self.made.append(self._move())
        self._keep_motion()
        self._stop()

    def _find_motion(self) -> str:
        """The motion this line makes: named, or modal where words for one stand."""
        if self._cancels:
            return ""
        named = self.ask.code("motion")
        moving = self.ask.has(self._axes + "IJK") or (named in ("G2", "G3") and self.ask.has("RP"))
        if named in SURFACES:
            return named
        return (named or self.state.motion) if moving and named != "G80" else ""

    def _takers(self) -> list[tuple[str, str]]:
        """The codes that run on this line, with the letters each takes."""
        letters = {"G4": "P", "G64": "PQ"} | dict.fromkeys(TIPS, "H")
        letters |= {"G51": CONE_WORDS, "G52": "XYZ", "G6.2": "PQ"}
        letters |= dict.fromkeys(("G0", "G1"), "XYZIJK" if self._vectors() else self._axes)
        letters |= dict.fromkeys(("G2", "G3"), self._axes + "IJKRP")
        running = [code for code, _ in self.ask.codes.values() if GROUP_OF[code] != "motion"]
        takers = [(code, letters.get(code, "")) for code in [*running, self._motion]]
        if self._cancels:
            takers.append(("G52", self._axes))
        return [(code, self._side_letters(takers) if code in SIDES else taken) for code, taken in takers]

    def _side_letters(self, takers: list[tuple[str, str]]) -> str:
        """P, Q and R of G40 to G42: those that no other code of the line takes."""
        others = "".join(letters for _, letters in takers)
        return "".join(letter for letter in "PQR" if letter not in others)

    def _vectors(self) -> bool:
        """Whether G0 and G1 of this line take tool vectors: G43.5, but for machine positions."""
        code = self.ask.code("length")
        tip = TIPS.get(code, Tip.OFF) if code else self.state.modal.tip
        return tip is Tip.VECTORS and self.ask.code("one-line") != "G53"

    def _check_words(self) -> None:
        """Every word belongs to exactly one code."""
        takers = self._takers()
        for letter, word in self.ask.words.items():
            owners = [code for code, letters in takers if letter in letters]
            if not owners and letter not in "FST":
                raise self._unowned(word)
            if len(owners) > 1:
                raise self.ask.refusal(
                    word,
                    f"{' and '.join(owners)} on one line both take {letter}: which of them {word.text} "
                    "belongs to is not clear; write two lines",
                )

    def _unowned(self, word: Word) -> ProgramError:
        if self._motion == "G6.2":
            return nurbs_words.refusal(self.ask.line, word, f"found {word.text}")
        if self._motion in SURFACES:
            return surface_words.surplus(self.ask, self._motion, word)
        if word.letter in self._axes + "K" and not self._motion:
            return self.ask.refusal(
                word,
                f"{word.text} has no motion: {self.state.cleared}; write G0 to G3, G51, G52 or G6.2 with it, "
                "or remove the line",
            )
        if word.letter in self._axes and self._vectors():
            return self.ask.refusal(
                word,
                f"{word.text} is a rotary position under G43.5, where I J K along the tool axis say how the "
                "tool stands; write I J K, or G43.4 for rotary words",
            )
        if word.letter in "IJK" and self._motion in ("G0", "G1"):
            return self.ask.refusal(
                word,
                f"no code on this line takes {word.text}: {self._motion} has tool vectors I J K under G43.5 "
                "only, and arcs with I J K are G2 and G3; write G43.5 or remove the word",
            )
        return self.ask.refusal(
            word,
            f"no code on this line takes {word.text}: P belongs to G4, G64, G2, G3, G6.2, Q to G64, G6.2, "
            "both to G40 to G42, H to G43 and G51, I J K R to G2, G3 and G51, R to G40 to G42, too, "
            "D to G51; add the code or remove the word",
        )

    def _check_frame(self) -> None:
        if self.ask.code("one-line") == "G53" and self._motion not in ("G0", "G1"):
            raise self.ask.refusal(
                self.ask.codes["one-line"][1],
                "G53 (machine position) has no move: it goes with axis words under G0 or G1; add G0 and the "
                "axes, or remove G53",
            )

    def _move(self) -> Block:
        if self._motion == "G51":
            return surface_words.cone(self.ask, self.state, self._machine)
        if self._motion == "G52":
            return surface_words.ruled(self.ask, self.state, self._machine, self._lines)
        if self._motion == "G6.2":
            return nurbs_words.surface(self.ask, self.state, self._machine, self._lines)
        return self._line() if self._motion in ("G0", "G1") else self._arc()

    def _keep_motion(self) -> None:
        """G0 to G3 stay; G51, G52, G6.2 and G80 leave no motion mode."""
        if self._cancels:
            return
        named, number = self.ask.code("motion"), self.ask.line.number
        why = {
            "G51": f"it is surplus after the whole cone of G51 on line {number}, which clears the "
            "motion mode",
            "G52": f"it is a surplus point, as G52 needs 8 points of X Y Z, the G52 of line {number} has "
            "them and clears the motion mode",
            "G6.2": f"it is surplus after the two whole curves of G6.2 on line {number}, which clears the "
            "motion mode",
            "G80": f"G80 on line {number} cleared the motion mode",
        }
        if named in why:
            cuts = self.state.cuts or named in SURFACES
            self.state = replace(self.state, motion="", cleared=why[named], cuts=cuts)
        elif named and named != self.state.motion:
            self.state = replace(self.state, motion=named)

    def _word_of_motion(self) -> Word:
        """The motion code, or the first word that the modal motion takes."""
        if "motion" in self.ask.codes:
            return self.ask.codes["motion"][1]
        return next(word for letter, word in self.ask.words.items() if letter in self._axes + "IJK")

    def _check_side(self, word: Word) -> None:
        if self.state.side != "G40":
            raise self.ask.refusal(
                word,
                f"{self._motion} runs under {self.state.side}: G41 and G42 choose the side of the cutter on "
                "G51, G52 and G6.2 only, and G1 to G3 are not offset for now; write G40 before it",
            )

    def _targets(self) -> Targets:
        """A value per axis of the machine: mm, or radians of the carried body."""
        targets: list[float | None] = []
        for axis in self._machine.axes:
            word = self.ask.words.get(axis.name)
            if word is None:
                targets.append(None)
            elif axis.is_rotary:
                targets.append(word.value / axis.shown_per_unit)
            else:
                targets.append(word.value * self.state.mm_per_unit)
        return tuple(targets)

    def _line(self) -> Block:
        word, state = self._word_of_motion(), self.state
        mm = degrees = time = None
        if self._motion == "G1":
            self._check_side(word)
            time = state.time(self.ask, "G1", word)
            mm = 0.0 if time else state.feed(self.ask, "G1", word)
            degrees = 0.0 if time else state.feed_deg_s
        machine_frame = self.ask.code("one-line") == "G53"
        relative = not state.absolute and not machine_frame
        place = self.ask.place(word)
        if state.modal.tip is Tip.OFF or machine_frame:
            targets = self._targets()
            return JointLine(place, state.modal, targets, relative, machine_frame, mm, degrees, time)
        x, y, z, first, second = self._tip_targets()
        return TipLine(
            place, state.modal, (x, y, z), (first, second), self._axis(), relative, mm, degrees, time
        )

    def _tip_targets(self) -> Targets:
        """Tip and rotaries as G43.4 and G43.5 take them: X Y Z, first and second rotary."""
        targets = self._targets()
        return tuple(targets[i] for i in (*self._machine.linear(), *self._machine.rotary()))

    def _axis(self) -> Vector | None:
        """I J K along the tool axis (G43.5): all of them or none."""
        given = [self.ask.words.get(letter) for letter in "IJK"]
        here = [word for word in given if word is not None]
        if not here:
            return None
        found = " ".join(word.text for word in here)
        if len(here) < 3:
            raise self.ask.refusal(
                here[0],
                f"{found} is not a whole tool vector: under G43.5 I J K stand together, from the tip to the "
                "spindle in the part frame, or none of them; write all three",
            )
        if not self.state.absolute:
            raise self.ask.refusal(
                here[0], f"{found} is a direction and no distance: tool vectors need G90; write G90 before it"
            )
        i, j, k = (word.value for word in here)
        if math.sqrt(i * i + j * j + k * k) < SHORTEST_VECTOR:
            raise self.ask.refusal(
                here[0],
                f"{found} has no length: a tool vector points from the tip to the spindle and may have any "
                f"length from {SHORTEST_VECTOR:g} up; correct I J K",
            )
        return i, j, k

    def _arc(self) -> Block:
        word = self._word_of_motion()
        self._check_side(word)
        if self.state.modal.tip is not Tip.OFF:
            code = "G43.4" if self.state.modal.tip is Tip.ROTARIES else "G43.5"
            raise self.ask.refusal(
                word,
                f"{self._motion} under {code} is not done: arcs of the tool tip with a turning axis have no "
                "agreed meaning; write the arc as G1 lines (with G64 P they become one smooth path), or G49 "
                "before it",
            )
        time = self.state.time(self.ask, self._motion, word)
        centre, radius = self._centre(word)
        return JointArc(
            self.ask.place(word),
            self.state.modal,
            _PLANES[self.state.modal.plane],
            self._motion == "G2",
            self._targets(),
            not self.state.absolute,
            centre,
            radius,
            self._turns(),
            0.0 if time else self.state.feed(self.ask, self._motion, word),
            time,
        )

    def _turns(self) -> int:
        word = self.ask.words.get("P")
        turns = 1 if word is None else self.ask.whole(word)
        if word is not None and turns == 0:
            raise self.ask.refusal(word, f"{word.text} is no arc: P counts the turns, from 1 up; correct it")
        if word is not None and turns > MOST_TURNS:
            raise self.ask.refusal(
                word, f"{word.text} is too many turns: P counts 1 to {MOST_TURNS} of them; write more arcs"
            )
        return turns

    def _centre(self, word: Word) -> tuple[tuple[float, float] | None, float | None]:
        """Centre from the start along the two plane axes, or the radius; one of them is given."""
        first, second, normal = _PLANES[self.state.modal.plane]
        given, radius = self.ask.words, self.ask.words.get("R")
        centre = [letter for letter in "IJK" if letter in given]
        allowed = "IJK"[min(first, second)] + " " + "IJK"[max(first, second)]
        if "IJK"[normal] in given:
            extra = given["IJK"[normal]]
            raise self.ask.refusal(
                extra,
                f"{extra.text} is not in the plane: under {self.state.modal.plane} a centre has "
                f"{allowed}; correct the word or the plane",
            )
        if (radius is None) == (not centre):
            found = "both a centre and R" if centre else "neither a centre nor R"
            raise self.ask.refusal(
                word,
                f"{self._motion} has {found}: under {self.state.modal.plane} it takes either {allowed} or R; "
                "write one of them",
            )
        if radius is None:
            i, j = (given.get("IJK"[axis]) for axis in (first, second))
            unit = self.state.mm_per_unit
            return ((i.value * unit if i else 0.0), (j.value * unit if j else 0.0)), None
        return None, self._radius(radius, ("XYZ"[first], "XYZ"[second]))

    def _radius(self, word: Word, plane: tuple[str, str]) -> float:
        if word.value == 0.0 or not any(letter in self.ask.words for letter in plane):
            raise self.ask.refusal(
                word,
                f"{word.text} gives no arc: with R the radius is not 0 and an end point {' or '.join(plane)} "
                "stands beside it; add it, or give the centre",
            )
        return word.value * self.state.mm_per_unit

    def _stop(self) -> None:
        """M2 and M30 end the program with spindle and coolant off."""
        if "stop" not in self.ask.codes:
            return
        code, word = self.ask.codes["stop"]
        self.ended = code in ("M2", "M30")
        if self.ended:
            off = replace(self.state.modal, spindle_rev_min=0.0, coolant=0)
            self.state = replace(self.state, modal=off)
        act = {"M0": Act.STOP, "M1": Act.OPTIONAL_STOP}.get(code, Act.END)
        self.made.append(Action(self.ask.place(word), self.state.modal, act))
