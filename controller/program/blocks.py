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

from collections.abc import Iterator, Sequence
from dataclasses import replace
from types import MappingProxyType

from controller.machine.model import Joints, Machine
from controller.messages import Message, chain, message
from controller.program import (
    carried,
    codes,
    compensation,
    corner_words,
    cycle_moves,
    cycles,
    dynamic_offset,
    foreign,
    linked,
    modal,
    modal_words,
    motion_words,
    offset_words,
    own_codes,
    planar_words,
    plane_words,
    pocket_words,
    points,
    polar_words,
    source_text,
    spline_words,
    surface_words,
    words,
)
from controller.program.carried import InForce, Saved, after_program
from controller.program.code_rows import Fate
from controller.program.code_table import BY_DIALECT, HOLD_AXES, takers_of
from controller.program.codes import (
    CURVES,
    CYCLES,
    PROBES,
    SIDES,
    SURFACES,
    TILTS,
    TO_PLANE,
    ParsedLine,
    letters_of,
)
from controller.program.flow import Limits
from controller.program.given import Given
from controller.program.line import CommonRun, Upcoming
from controller.program.modal import TIPS, State
from controller.program.offset_words import Here
from controller.program.parameters import Name, Parameters
from controller.program.plain import CommonLines
from controller.program.position import Position, homed
from controller.program.program import (
    Act,
    Action,
    Block,
    OperatorMessage,
    Program,
    ProgramError,
    Remark,
    Setting,
    Tip,
)
from controller.program.source_text import Bytes
from controller.program.system_variables import SystemVariables
from controller.program.words import Line, Word

# Groups of the codes beside which an H alone is one of a length: G15 H and G56 H of Okuma's are others.
BESIDE_H = frozenset(
    (
        "motion",
        "spindle",
        "coolant",
        "tool change",
        "stop",
        "path",
        "distance",
        "feed",
        "plane",
        "unit",
        "side",
    )
)
NEEDS_WORDS = (*CYCLES, "G2", "G3")
_CLEARED = MappingProxyType(  # what has ended a motion, and the text that says so
    {
        "G51": "cleared.G51",
        "G52": "cleared.G52",
        "G6.2": "cleared.G6.2",
        "G80": "cleared.G80",
        **dict.fromkeys(PROBES, "cleared.probe"),
        **dict.fromkeys(cycle_moves.THREADS, "cleared.thread"),
        **dict.fromkeys(CURVES, "cleared.curve"),
    }
)


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
    data: Bytes,
    machine: Machine,
    name: str,
    block_delete: bool = False,
    start: Joints | None = None,
    refused: list[ProgramError] | None = None,
    begin: State | None = None,
    in_force: InForce | None = None,
) -> Iterator[Block]:
    """As ``read``, block by block: what comes before a line that is refused has been given by then.

    With ``refused``, lines that are refused are noted there and left out, as far as it can be read on.
    ``begin``: the modal state before the first line; None: that of power-on. The state of each line is
    noted in ``in_force``.
    """
    program, behind = linked.parts(data)
    text, remark = source_text.text_of(program, name)
    files = {
        label: (file, source_text.text_of(content, file)[0].whole())
        for label, (file, content) in behind.items()
    }
    position = Position(machine, start or homed(machine))
    begun = dynamic_offset.refreshed(modal.begun(machine, begin), position, machine)
    given = Given(machine, begun, position)
    if in_force is not None:
        in_force.add(0, given.state)
    system = SystemVariables(machine, given) if machine.dialect == "fanuc" else None
    left = given.state.parameters
    values: tuple[tuple[Name, float], ...] = (*machine.parameters, *machine.named_values)
    parameters = Parameters(given, values, machine.kept, system, left)
    own = own_codes.calls(machine)
    limits = Limits(machine.call_levels, machine.program_passes, machine.without_point, own)
    common = CommonLines(machine, given)
    front = foreign.front_lines(text, name, refused)
    read: Iterator[Line | CommonRun] = front or words.read(
        text, name, block_delete, parameters, limits, files, refused, common.take, system
    )
    if remark is not None:
        yield Remark(remark[0], given.state.modal, remark[1])
    made = _blocks(Upcoming(read), machine, given, common, parameters, refused, in_force)
    beside = compensation.beside(made, given.position, machine, name, refused)
    for together in beside if front else foreign.judged(beside, text, name, refused):
        yield from together


def _blocks(
    ahead: Upcoming,
    machine: Machine,
    given: Given,
    common: CommonLines,
    parameters: Parameters,
    refused: list[ProgramError] | None = None,
    in_force: InForce | None = None,
) -> Iterator[CommonRun | Sequence[Block]]:
    """Blocks of lines; ``given`` has the state and the position between two of them."""
    saved, functions, note = Saved(machine), common.functions, in_force or InForce()
    order = 0
    for line in ahead.items:
        if ahead.told:
            yield _notes_and_settings(ahead.told, given.state)
        if isinstance(line, CommonRun):
            if in_force is not None:
                in_force.add_run(line, given.state)
            order = line.blocks[-1].place.order
            yield line
            continue
        order = line.order
        if (quick := common.read(line)) is not None:
            note.add(line.order, given.state)
            yield (quick,)
            continue
        state = before = given.state
        if (known := functions.read(line, state)) is not None:
            done, given.state = known
            note.add(line.order, given.state)
            yield done
            continue
        common.rests = True
        try:
            state, restored, line = saved.carry_out(line, state)
            ask = points.counted(codes.sort(line, machine), state, machine)
            ask = polar_words.cartesian(ask, state, given.position, machine)
            if state.polar is not None or "polar" in ask.codes:
                ask, state = polar_words.programmed(ask, state, given.position, machine)
            turn = _BlockInterpreter(ask, state, machine, given.position, ahead)
            turn.run()
            if turn.corner is not None:
                turn = _with_corners(turn, line, given, machine, ahead)
        except ProgramError as error:
            if refused is None:
                raise
            refused.append(error)
            given.state = _behind(line, state, machine, ahead)
            continue
        finally:
            common.rests = False
        given.state = functions.learnt(line, before, turn.state, turn.made)
        note.add(line.order, given.state)
        yield [*restored, *turn.made]
        if given.see_probed(turn.made, line):
            parameters.forget_probed()
        if (following := given.state.origins.following) is not None and not following.is_current:
            given.state = dynamic_offset.refreshed(given.state, given.position, machine)
        if turn.ended:
            break
    if ahead.told:
        yield _notes_and_settings(ahead.told, given.state)
    note.add(order, given.state._replace(parameters=parameters.to_leave()))


def _with_corners(
    turn: _BlockInterpreter, line: Line, given: Given, machine: Machine, ahead: Upcoming
) -> _BlockInterpreter:
    """A line with a corner at its end and those that follow it, up to the first without, as one turn.

    Raises ProgramError.
    """
    position, given.position = given.position, given.position.copied()
    try:
        moves = [_move_to_corner(turn, line, given)]
        first = [block for block in turn.made if block is not turn.made[-1]]
        while turn.corner is not None:
            if len(moves) > corner_words.MAX_LINES or (following := next(ahead, None)) is None:
                raise line.refusal(turn.corner, "corner.nothing_follows", corner=turn.corner.text)
            ask = points.counted(codes.sort(following, machine), turn.state, machine)
            ask = polar_words.cartesian(ask, turn.state, given.position, machine)
            before, given.state, line = turn.corner, turn.state, following
            turn = _BlockInterpreter(ask, turn.state, machine, given.position, ahead)
            turn.run()
            moves.append(_move_to_corner(turn, line, given, before))
            first += [block for block in turn.made if isinstance(block, Remark)]
    finally:
        given.position = position
    turn.made = [*first, *corner_words.joined(moves, machine)]
    return turn


def _move_to_corner(
    turn: _BlockInterpreter, line: Line, given: Given, before: Word | None = None
) -> corner_words.Move:
    """The one motion of a line; ``before``: the corner that it follows, beside which it has nothing else."""
    block = corner_words.moved(turn.made)
    others = before is not None and any(not isinstance(one, Remark) for one in turn.made[:-1])
    if block is None or others:
        word = before or turn.corner or line.words[0]
        raise line.refusal(word, "corner.no_way", corner=word.text)
    begin = given.position.in_frame(block.modal)
    given.position.take(block)
    end = given.position.in_frame(block.modal)
    size = 0.0 if turn.corner is None else turn.corner.value * turn.state.mm_per_unit
    return corner_words.Move(line, block, begin, end, turn.corner, size)


def _behind(line: Line, state: State, machine: Machine, ahead: Upcoming) -> State:
    """The state behind a line that was refused and left out, so that what follows it is not refused, too."""
    state = state._replace(begun=None)
    named = [f"G{word.value:g}" for word in line.words if word.letter == "G"]
    known = BY_DIALECT[machine.dialect]
    motion = next((code for code in named if code in known and known[code].group == "motion"), state.motion)
    if motion in SURFACES or motion == "G5.2":  # and its points
        while (after := ahead.look()) is not None and all(map(_is_part, after.words)):
            next(ahead)
    return state._replace(motion="" if motion in _CLEARED else motion)


def _is_part(word: Word) -> bool:
    """Whether it may stand in the lines behind a surface's or a NURBS' first."""
    return word.letter in "XYZKRPL" or (word.letter == "G" and word.value in (5.2, 5.3))


def _notes_and_settings(told: list[Line], state: State) -> list[Block]:
    said: list[Block] = []
    for line in told:
        at, asides = (line.place(1), state.modal), line.asides
        said += [Remark(*at, note) for note in asides.notes]
        if asides.changes:
            said.append(Setting(*at, tuple(asides.changes)))
        if asides.message:
            said.append(OperatorMessage(*at, asides.message))
        if asides.kept:
            said.append(Setting(*at, carried.parameter_changes(asides.kept)))
    told.clear()
    return said


class _BlockInterpreter:
    """One line being carried out; its state counts only when ``run`` returns."""

    def __init__(
        self,
        ask: ParsedLine,
        state: State,
        machine: Machine,
        position: Position,
        ahead: Upcoming,
    ) -> None:
        self.ask = ask
        self.state = self._before = state
        self.made: list[Block] = []
        self.ended = False
        self._machine, self._position = machine, position
        self._ahead = ahead  # what follows: G52 takes its points from here
        self._axes = "".join(axis.name for axis in machine.axes)
        self._shifts = ask.code("motion") == "G52" and surface_words.is_shift(ask, state, machine, ahead)
        self._holder = self._find_holder()  # the code that has the axis words, where it is no motion
        self._motion = self._find_motion()
        self._taking = self._takers()

    @property
    def corner(self) -> Word | None:
        """,R or ,C of the line; of 0 it is none."""
        word = corner_words.corner_of(self.ask.words)
        return None if word is None or word.value == 0.0 else word

    @property
    def _free(self) -> str:
        """Letters that need no code."""
        if not self._is_fanuc:
            return "FST"
        return "FSTDH" if self.ask.codes.keys() <= BESIDE_H and not self._shifts else "FSTD"

    @property
    def _is_fanuc(self) -> bool:
        return self._machine.dialect == "fanuc"

    def _note(self, key: str, word: Word) -> None:
        """What such controls take, and ``check`` tells of."""
        self.ask.lenient.append((key, word))

    def run(self) -> None:
        plane_words.check_whole(self.ask, self.state)
        self._check_words()
        if corner_words.CUT in self.ask.words and corner_words.ROUND in self.ask.words:
            word = self.ask.words[corner_words.CUT]
            raise self.ask.refusal(word, "corner.two", corner=word.text)
        self._keep_number()
        sides = [letters for code, letters in self._taking if code in SIDES]
        self.state, self.made = modal_words.apply(
            self.ask, self._motion, self.state, self._machine, "".join(sides)
        )
        self._check_frame()
        self._notes()
        self._origins()
        if self.state.origins.mirror is not None:
            offset_words.check_mirrored(self._here(self._motion or self.ask.code("one-line")), self._motion)
        if self.state.origins.following is not None:
            motion = self._motion or self.ask.code("one-line")
            self.state = dynamic_offset.followed(self._here(motion), self._motion)
        planar_words.check(self.ask, self._before.modal, self.state.modal)
        if self._motion:
            self.made += self._move()
        self._keep_motion()
        self._stop()

    def _keep_number(self) -> None:
        """D of Fanuc's, which stays for the next G41 or G42 without one."""
        words, taking = self.ask.words, self._taking
        if not self._is_fanuc or not ("D" in words or "H" in words):
            return
        if "D" in words and not any("D" in letters for code, letters in taking if code not in SIDES):
            self.state = self.state._replace(offset_number=words["D"])
        if "H" in words and not any("H" in letters for _, letters in taking):
            self.state = self.state._replace(length_number=words["H"])
            self._note("note.length_number", words["H"])

    def _find_motion(self) -> str:
        """The motion this line makes: named, or modal where words for one stand."""
        if self._shifts or self._holder:
            return ""
        named = self.ask.code("motion")
        drills = not named and self.state.motion in CYCLES  # again at each place, and at none without
        moving = self.ask.has(self._axes if drills else self._axes + "IJK")
        moving = moving or (named in ("G2", "G3") and self.ask.has("RP"))
        if named in SURFACES or named in CURVES or named in PROBES or named in pocket_words.CODES:
            return named
        if self.ask.code("one-line") == "G60" and named in ("", "G0"):
            return "G0" if self.ask.has(self._axes) else ""
        if named == "G80":
            named = self._beneath()
            return named if moving else ""
        if moving and not named and not self.state.motion and self._is_fanuc and self._begins:
            self.state = self.state._replace(motion="G0")
            self._note("note.power_on_motion", self._word_of_motion())
        return (named or self.state.motion) if moving else ""

    @property
    def _begins(self) -> bool:
        """Whether no motion has been active yet: at power-on it is G0."""
        return self.state.cleared == modal.NO_MOTION and self.ask.has(self._axes)

    def _beneath(self) -> str:
        """What G80 leaves modal: nothing, under fanuc what was before the cycle."""
        if self._machine.dialect != "fanuc":
            return ""
        return self.state.beneath if self.state.motion in CYCLES else self.state.motion

    def _find_holder(self) -> str:
        """The code that leaves a motion no axis words; one that is only noted leaves them to a named one."""
        holding = HOLD_AXES[self._machine.dialect]
        for group, (code, _) in self.ask.codes.items():
            if code in holding and not (group == code and self._names_motion):
                return code
        return ""

    @property
    def _names_motion(self) -> bool:
        return self.ask.code("motion") not in ("", "G80")

    # ---- words and their codes ---------------------------------------------------------

    def _takers(self) -> list[tuple[str, str]]:
        """The codes that run on this line, with the letters each takes."""
        running = [code for group, (code, _) in self.ask.codes.items() if group != "motion"]
        takers = [(code, self._letters(code)) for code in running]
        if self._motion:
            letters = self._letters(self._motion)
            if self._motion == "G81" and any("P" in taken for _, taken in takers):
                letters = letters.replace("P", "")  # which does nothing there: P is of the other code
            takers.append((self._motion, letters))
        if self._shifts:
            takers.append(("G52", self._axes))
        return [(code, self._side_letters(takers) if code in SIDES else taken) for code, taken in takers]

    def _letters(self, code: str) -> str:
        """The letters of the table, as far as this line and dialect have them."""
        if code in ("G0", "G1"):
            letters = "XYZIJK" if self._vectors() else self._axes
            return letters + corner_words.LETTERS if code == "G1" and self._is_fanuc else letters
        if self._names_motion and code in self.ask.codes:  # a noted one, beside a motion
            return letters_of(code, self._machine.dialect, "")
        return letters_of(code, self._machine.dialect, self._axes, self._form(code))

    def _form(self, code: str) -> str:
        """Which form of a code the line has: by a word such as L2, or by the plane; "" if none of them."""
        forms = dict(BY_DIALECT[self._machine.dialect][code].forms)
        if not forms:
            return ""
        plane = self.ask.code("plane") or self.state.modal.plane
        word = self.ask.words.get(next(iter(forms))[0])
        return plane if plane in forms else f"{word.letter}{word.value:g}" if word is not None else ""

    def _side_letters(self, takers: list[tuple[str, str]]) -> str:
        """P, Q, R, and D but for G40, of G40 to G42: those that no other code of the line takes."""
        others = "".join(letters for _, letters in takers)
        mine = "PQR" if "G40" in (code for code, _ in takers) else "DPQR"
        return "".join(letter for letter in mine if letter not in others)

    def _vectors(self) -> bool:
        """Whether G0 and G1 of this line take tool vectors: G43.5, but for machine positions."""
        code = self.ask.code("length")
        tip = TIPS.get(code, Tip.OFF) if code else self.state.modal.tip
        return tip is Tip.VECTORS and self.ask.code("one-line") != "G53"

    def _check_words(self) -> None:
        """Every word belongs to exactly one code, and a cycle or an arc has words."""
        takers = self._taking
        named = self.ask.code("motion")
        if (
            named in NEEDS_WORDS
            and self._machine.dialect == "rs274"
            and not self.ask.has(self._axes + "IJKRP")
        ):
            raise self.ask.refusal(self.ask.codes["motion"][1], "word.no_place", code=named)
        for letter, word in self.ask.words.items():
            owners = [code for code, letters in takers if letter in letters]
            if not owners and letter not in self._free:
                raise self._unowned(word, takers)
            if len(owners) > 1:
                raise self.ask.refusal(word, "word.two_owners", owners=chain("and", owners), letter=letter)
            if owners:
                self.ask.takers[letter] = owners[0]

    def _unowned(self, word: Word, takers: Sequence[tuple[str, str]]) -> ProgramError:
        if self._motion == "G6.2":
            return surface_words.nurbs_refusal(self.ask.line, word, message("surface.found", found=word.text))
        if self._motion in CURVES:
            return spline_words.refusal(self.ask.line, word, self._motion)
        if self._motion in SURFACES:
            return surface_words.surplus(self.ask, self._motion, word)
        if word.letter in corner_words.LETTERS:
            return self.ask.refusal(word, "corner.no_line", corner=word.text)
        if word.letter in self._axes + "K" and not self._motion and not self._holder:
            return self.ask.refusal(word, "word.no_motion", cleared=self.state.cleared)
        if word.letter == "E":
            return self.ask.refusal(word, "word.exponent")
        if word.letter in self._axes and self._vectors():
            return self.ask.refusal(word, "word.rotary_with_vectors")
        if word.letter in "IJK" and self._motion in ("G0", "G1"):
            return self.ask.refusal(word, "word.vector", motion=self._motion)
        belongs, of_line = takers_of(word.letter, self._machine.dialect), list[Message]()
        for code, letters in takers:
            if letters:
                of_line.append(message("word.takes", code=self._with_form(code), letters=" ".join(letters)))
            elif code == self._holder:
                of_line.append(message("word.takes_none", code=code))
        if not of_line:
            return self.ask.refusal(word, "word.no_owner", takers=belongs)
        return self.ask.refusal(word, "word.no_owner_here", takers=belongs, here=chain("and", of_line))

    def _with_form(self, code: str) -> str:
        return f"{code} {self._form(code)}".strip()

    def _check_frame(self) -> None:
        once = self.ask.code("one-line")
        if once == "G53" and self._is_fanuc and not self.ask.has(self._axes) and not self._names_motion:
            self._note("note.g53_alone", self.ask.codes["one-line"][1])
        elif once == "G53" and self._motion not in ("G0", "G1"):
            raise self.ask.refusal(self.ask.codes["one-line"][1], "word.g53_alone")
        named = self.ask.code("motion")
        harmless = ("", "G80") if self._machine.dialect == "rs274" else ("", "G80", "G0", "G1", "G2", "G3")
        for other, beside in ((self._holder, harmless), (once if once == "G60" else "", ("", "G80", "G0"))):
            if other and named not in beside:
                word = self.ask.codes["motion"][1]
                raise self.ask.refusal(word, "word.two_take_axes", code=named, other=other)

    # ---- what is done ------------------------------------------------------------------

    def _notes(self) -> None:
        """A remark for the first of each code that needs no action here."""
        for code, word in self.ask.codes.values():
            row = BY_DIALECT[self._machine.dialect][code]
            if row.only and not self._has(row.only):
                raise self.ask.refusal(word, "code.not_done", **row.refused_with())
            if row.fate is Fate.NOTED and code not in self.state.noted:
                self.made.append(Remark(self.ask.place(word), self.state.modal, row.noted_with()))
                self.state = self.state._replace(noted=self.state.noted | {code})
        self._lenient_notes()

    def _lenient_notes(self) -> None:
        """A remark for the first of each thing that is taken though it is written loosely."""
        if not (self._is_fanuc or self._motion == "G5.2"):
            return
        named = self.ask.code("motion")
        if self._is_fanuc and named in CYCLES and not self._motion:
            self._note("note.drills_nothing", self.ask.codes["motion"][1])
        if self._motion == "G5.2" and self._has("L2"):
            self._note("note.nurbs_order", self.ask.words["L"])
        if self._is_fanuc and self.ask.takers.get("P") == "G81":
            self._note("note.g81_p", self.ask.words["P"])
        for letter in "PR":
            if self.ask.takers.get(letter) == "G31":
                self._note("note.skip_signal", self.ask.words[letter])
        if self.ask.code("one-line") == "G60":
            self._note("note.one_side", self.ask.codes["one-line"][1])
        for key, word in self.ask.lenient:
            if key not in self.state.noted:
                told = message(key, word=word.text)
                self.made.append(Remark(self.ask.place(word), self.state.modal, told))
                self.state = self.state._replace(noted=self.state.noted | {key})

    def _has(self, written: str) -> bool:
        """Whether the line has a word such as P0."""
        word = self.ask.words.get(written[0])
        return word is not None and word.value == float(written[1:])

    def _here(self, code: str) -> Here:
        """What the line gives to one of its codes."""
        return Here(self.ask.of(code), self.state, self._position, self._machine)

    def _origins(self) -> None:
        """What shifts, turns or stores positions, and the ways to the reference points."""
        once, turn, before = self.ask.code("one-line"), self.ask.code("rotation"), self.state
        if turn in TILTS:
            self.state, told = plane_words.defined(self._here(turn))
            self.made += told
        elif turn:
            self.state = offset_words.rotation(self._here(turn))
        if code := self.ask.code("mirror"):
            self.state = offset_words.mirrored(self._here(code))
        if code := self.ask.code("dynamic offset"):
            self.state = dynamic_offset.switched(self._here(code))
        if self._shifts:
            self.state = offset_words.local_shift(self._here("G52"))
            self.made.append(surface_words.shift_remark(self.ask, self.state))
        if once in TO_PLANE:
            self.state, turned = plane_words.turned(self._here(once))
            self.made += turned
        elif once in ("G28", "G30"):
            self.made += motion_words.to_reference(self._here(once))
        elif once in ("G28.1", "G30.1"):
            self.state = motion_words.store_reference(self._here(once))
        elif once == "G10" and self._has("L50"):
            self._parameters_of_the_control()
        elif once == "G10" or once.startswith("G92"):
            self.state = offset_words.applied(self._here(once), once)
        if changes := carried.changes_between(before, self.state):
            self.made.append(Setting(self.ask.line.place(1), self.state.modal, changes))

    def _parameters_of_the_control(self) -> None:
        """G10 L50 to G11: lines that change parameters of Fanuc's, which this control does not have."""
        word = self.ask.codes["one-line"][1]
        while (line := self._ahead.look()) is not None:
            if any(one.letter == "G" and one.value == 11.0 for one in line.words):
                told = message("note.control_parameters", line=line.number)
                self.made.append(Remark(self.ask.place(word), self.state.modal, told))
                return
            next(self._ahead)
        raise self.ask.refusal(word, "offset.no_g11")

    def _move(self) -> list[Block]:
        motion = self._motion
        self._for_side()
        here, word = self._here(motion), self._word_of_motion()
        if motion == "G51":
            return [surface_words.cone(here.ask, self.state, self._machine)]
        if motion == "G52":
            return [surface_words.ruled(here.ask, self.state, self._machine, self._ahead)]
        if motion == "G6.2":
            return [surface_words.nurbs(here.ask, self.state, self._machine, self._ahead)]
        if motion in CURVES:
            made_curve, self.state = spline_words.curve(here, motion, word, self._ahead)
            return [made_curve]
        if motion in PROBES:
            return [motion_words.probing_line(here, motion, word)]
        if motion in CYCLES:
            made, self.state = cycles.blocks(here, motion, word)
            return made
        if motion in pocket_words.CODES:
            return pocket_words.blocks(here, motion, word)
        if motion in cycle_moves.THREADS:
            made, self.state = cycle_moves.thread_blocks(here, motion, word)
            return made
        return (
            [motion_words.line(here, motion, word)]
            if motion in ("G0", "G1")
            else [motion_words.arc(here, motion, word)]
        )

    def _for_side(self) -> None:
        """Whether the side of the cutter that is on is for this motion."""
        word = self._word_of_motion()
        if self._motion in SURFACES:
            self.state = planar_words.for_surfaces(self.ask, self._motion, word, self.state)
        elif self._motion in ("G1", "G2", "G3"):
            self.state = planar_words.for_lines(self.ask, self._motion, word, self.state)

    def _keep_motion(self) -> None:
        """G0 to G3 and cycles stay; G51, G52, G6.2, curves and G80 leave no motion mode."""
        named = self.ask.code("motion")
        if self._shifts or not named or named in pocket_words.CODES:  # which leave the motion as it is
            return
        if named == "G80" and (beneath := self._beneath()):
            self.state = self.state._replace(motion=beneath, cycle=None)
        elif named in _CLEARED:
            why = message(_CLEARED[named], line=self.ask.line.number)
            goes = self.state.curve_goes if named == "G5" else None
            self.state = self.state._replace(motion="", cleared=why, cycle=None, curve_goes=goes)
        elif named != self.state.motion or (self.state.cycle and named not in CYCLES):
            kept = self.state.cycle if named in CYCLES else None
            self.state = self.state._replace(motion=named, cycle=kept)

    def _word_of_motion(self) -> Word:
        """The motion code, or the first word that the modal motion takes."""
        if "motion" in self.ask.codes:
            return self.ask.codes["motion"][1]
        return next(word for letter, word in self.ask.words.items() if letter in self._axes + "IJK")

    def _stop(self) -> None:
        """M2 and M30 end the program with spindle and coolant off."""
        if "stop" not in self.ask.codes:
            return
        code, word = self.ask.codes["stop"]
        self.ended = code in ("M2", "M30")
        if self.ended:
            off = replace(self.state.modal, spindle_rev_min=0.0, coolant=0)
            self.state = self.state._replace(modal=off)
        act = {"M0": Act.STOP, "M60": Act.STOP, "M1": Act.OPTIONAL_STOP}.get(code, Act.END)
        self.made.append(Action(self.ask.place(word), self.state.modal, act))
        if self.ended:
            self.state = after_program(self.state, self._machine)
