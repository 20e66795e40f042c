"""The order in which lines are carried out: subs called, choices made, loops gone round.

    lines = Run(text, name, ...).lines()        as the text has them, where it holds no O-word

A run is a place in the text and a stack of what was called; the structure itself is known
beforehand (``marks``). What goes back in the text is counted, so that no program runs for ever.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from controller.machine.model import CALL_LEVELS, PROGRAM_PASSES
from controller.messages import Key, message
from controller.program import macros, marks, own_codes
from controller.program.expressions import GAPS, Values
from controller.program.line import Line, Where, Word, waits
from controller.program.macros import NUMBER_OF, Macro
from controller.program.marks import ALONE, COMPUTED, STRUCTURES, Mark, Marks
from controller.program.parameters import ARGUMENTS, Name, Parameters
from controller.program.program import Caller, Callers, ProgramError
from controller.program.source_text import NEWLINE

LOCAL, CALLS, OF_FILE, RETURNS, RESTORES = 97.0, 98.0, 198.0, 99.0, 73.0  # M97, M98, M198, M99, M73
ANY_CALL = (LOCAL, CALLS, OF_FILE)
SPLIT = 10_000  # P of M98 in eight digits: how often, and which of four digits


@dataclass(frozen=True, slots=True)
class Limits:
    """What a program may do, and how; the keys of [machine] in the machine file."""

    call_levels: int = CALL_LEVELS  # subs, one in the other
    passes: int = PROGRAM_PASSES  # rounds of loops and calls of one run, together
    without_point: str = "unit"  # what arguments of macros without a decimal point count in
    own_codes: own_codes.Codes = field(default_factory=dict)  # codes of the machine's own that call subs


@dataclass(frozen=True, slots=True)
class Source:
    """A text with its marks."""

    name: str
    text: str
    marks: Marks

    @classmethod
    def of(cls, name: str, text: str, of_fanuc: bool = False) -> Source:
        """Raises ProgramError for O-words, and statements ``of_fanuc``, that make no whole structure."""
        found = marks.marks_of(text, name, macros.statements if of_fanuc else None)
        return cls(name, text[: found.end], found)


@dataclass(slots=True)
class _Frame:
    """A program or sub that is being carried out."""

    source: Source
    at: int  # offset of the line that comes next
    number: int
    sub: Mark | None = None
    callers: Callers = ()
    line: int = 0  # of the program that called a file in; 0: this is of the program itself
    by_number: bool = False  # with M98, G65 or G66
    values: dict[Name, float] | None = None  # a macro's own; None: it is no macro
    is_modal: bool = False  # of a macro: with G66
    serial: int = 0  # counted over all calls
    rounds: int = 1  # L of M98
    restores: bool = False  # M73 was given
    left: dict[int, int] = field(default_factory=dict)  # rounds of each repeat, by its offset


Scan = Callable[[str, str, int, Callers], Line | None]  # raw text, file, number, who called -> the line


class Run:
    """One run of a program."""

    def __init__(
        self,
        source: Source,
        scan: Scan,
        parameters: Parameters,
        limits: Limits,
        files: Mapping[str, tuple[str, str]],
        block_delete: bool,
    ) -> None:
        self._scan, self._parameters, self._limits = scan, parameters, limits
        self._files, self._block_delete = files, block_delete
        self._main = source
        self._sources = {source.name: source}
        self._frames = [_Frame(source, 0, 1)]
        self._passes = self._step = self._last = 0
        self._due: Line | None = None  # what a sub that ended has restored
        self._labels: dict[tuple[str, str, str], Mark] = {}  # structures that have run
        self._begun = False  # a word or an O-word with a meaning has been met
        self._modal: Macro | None = None  # called behind each line that moves
        self._modal_calls = 0  # of those that run
        self._targets: dict[tuple[str, int, float], tuple[int, int]] = {}  # of jumps, by name, place and N
        self._acts: dict[str, Callable[[Mark], Line | None]] = {
            "sub": self._over,
            "endsub": self._leave_sub,
            "return": self._leave_sub,
            "call": self._call,
            "if": self._choose,
            "elseif": self._over,
            "else": self._over,
            "while": self._while,
            "endwhile": self._again,
            "repeat": self._repeat,
            "endrepeat": self._repeat_again,
            "break": self._break,
            "continue": self._continue,
            ALONE: self._number_alone,
            macros.GOTO: self._jump,
            macros.IF_GOTO: self._jump,
            macros.IF_THEN: self._then,
        }

    def lines(self) -> Iterator[Line]:
        """All lines with words or messages, as often as they are carried out. Raises ProgramError."""
        while (frame := self._frames[-1]).at <= len(frame.source.text):
            number = frame.number
            try:
                line = self._next(frame)
            except ProgramError as error:
                raise error.within(frame.callers) from None
            for wait in waits(self._parameters.taken_reads(), frame.source.name, number):
                yield from self._execute(wait, frame)
            if line is not None:
                yield from self._execute(line, frame)
            if self._due is not None:
                yield self._due
                self._due = None
        if len(self._frames) > 1:
            raise self._unended(frame)

    def _next(self, frame: _Frame) -> Line | None:
        """Carry out the line that comes next, or give it away."""
        text, at, number = frame.source.text, frame.at, frame.number
        mark = frame.source.marks.by_offset.get(at)
        if mark is not None:
            frame.at, frame.number = mark.after, number + 1
            if mark.deleted and self._block_delete:
                return None
            if mark.keyword in STRUCTURES and mark.parts[0] is mark:
                self._check_label(frame, mark)
            return self._acts.get(mark.keyword, _nothing)(mark)
        end = NEWLINE.search(text, at)
        raw = text[at : end.start()] if end else text[at:]
        frame.at, frame.number = end.end() if end else len(text) + 1, number + 1
        return self._scan(raw, frame.source.name, number, frame.callers)

    def _execute(self, line: Line, frame: _Frame) -> Iterator[Line]:
        """Yield a line with its place in the order; calls by M98 are carried out after its other words."""
        self._begun |= line.is_plain or bool(line.words)
        self._count_step(frame, line.number)
        line.where = Where(frame.line or line.number, self._step, frame.serial, frame.callers)
        if line.is_plain:
            yield line
            self._behind(line)
            return
        if self._limits.own_codes and (call := own_codes.call_in(line, self._limits.own_codes)) is not None:
            self._own(line, call)
            return
        if self._parameters.of_fanuc and (call := macros.call_in(line)) is not None:
            yield from self._macro(line, call)
            return
        frame.restores |= any(w.letter == "M" and w.value == RESTORES for w in line.words)
        turn = next((w for w in line.words if self._turns(w)), None)
        if turn is None:
            yield line
            self._behind(line)
            return
        taken = "PL" if turn.value != RETURNS else "P" if self._parameters.of_fanuc else ""
        rest = tuple(w for w in line.words if w is not turn and w.letter not in taken)
        if rest or line.says:
            yield line.with_words(rest)
        if turn.value == RETURNS:
            self._return(line, turn)
        elif turn.value == CALLS and line.file and not any(w.letter == "P" for w in line.words):
            self._call_by_name(line, turn)
        else:
            self._call_by_number(line, turn)

    def _turns(self, word: Word) -> bool:
        """Whether a word calls a sub by number, or ends one; M97 and M198 under the dialect of Fanuc."""
        if word.letter != "M":
            return False
        return word.value in (CALLS, RETURNS) or (self._parameters.of_fanuc and word.value in ANY_CALL)

    def _count_step(self, frame: _Frame, number: int) -> None:
        """Steps are line numbers, until something goes back or another text begins."""
        ahead = number - self._last if len(self._frames) == 1 and number > self._last else 1
        self._step += ahead
        self._last = number if len(self._frames) == 1 else self._last

    # ---- structures

    def _check_label(self, frame: _Frame, mark: Mark) -> None:
        """A label stands for one structure that runs, of a program and of each sub (as LinuxCNC)."""
        sub = "" if frame.sub is None else frame.sub.label
        other = self._labels.setdefault((frame.source.name, sub, mark.label), mark)
        if other is not mark:
            raise mark.label_used(frame.source.name, other)

    def _go(self, mark: Mark, behind: bool = True) -> None:
        frame = self._frames[-1]
        frame.at, frame.number = (mark.after, mark.number + 1) if behind else (mark.at, mark.number)

    def _count(self, mark: Mark) -> None:
        self._passes += 1
        if self._passes > self._limits.passes:
            raise mark.refusal(self._frames[-1].source.name, "flow.too_many_passes", most=self._limits.passes)

    def _values(self, mark: Mark) -> Values:
        values = Values(mark.text, self._frames[-1].source.name, mark.number, self._parameters)
        values.go(mark.rest)
        return values

    def _value(self, mark: Mark) -> float:
        """The one value in brackets behind a keyword."""
        values = self._values(mark)
        values.peek()
        value = values.bracket()
        self._at_end(mark, values)
        return value

    def _at_end(self, mark: Mark, values: Values) -> None:
        if values.rest.strip(GAPS):
            raise mark.surplus(self._frames[-1].source.name, values.rest)

    def _over(self, mark: Mark) -> None:
        """A sub that is not called, or branches behind the one that was taken."""
        self._go(mark.last)

    def _choose(self, mark: Mark) -> None:
        for part in mark.parts:
            if part.keyword == "endif" or part.keyword == "else" or self._value(part) != 0.0:
                self._go(part)
                return

    def _while(self, mark: Mark) -> None:
        """At the head of a while, or at the end of a do."""
        true = self._value(mark) != 0.0
        first, last = mark.parts[0], mark.last
        if true:
            self._count(mark)
        if mark is first and not true:
            self._go(last)
        elif mark is last and true:
            self._go(first)

    def _again(self, mark: Mark) -> None:
        self._go(mark.parts[0], behind=False)

    def _repeat(self, mark: Mark) -> None:
        rounds = round(self._value(mark))  # to the nearest whole number, a half to the even one (as LinuxCNC)
        if rounds <= 0:
            self._go(mark.last)
            return
        self._count(mark)
        self._frames[-1].left[mark.at] = rounds - 1

    def _repeat_again(self, mark: Mark) -> None:
        first, left = mark.parts[0], self._frames[-1].left
        if left.get(first.at, 0) > 0:  # a jump may lead into it
            left[first.at] -= 1
            self._count(mark)
            self._go(first)

    def _break(self, mark: Mark) -> None:
        self._go(mark.last)

    def _continue(self, mark: Mark) -> None:
        self._go(mark.last, behind=False)

    # ---- statements of macros

    def _jump(self, mark: Mark) -> Line | None:
        """GOTO, where its condition holds, behind the settings that stand before it."""
        frame, made = self._frames[-1], None
        if "#" in (before := frame.source.text[mark.at : mark.at + mark.column - 1]):
            made = self._scan(before, frame.source.name, mark.number, frame.callers)
        values = self._values(mark)
        values.peek()
        if mark.keyword == macros.IF_GOTO:
            holds = values.bracket() != 0.0
            if not (holds and any(map(values.skip, macros.GOTO_WORDS))):
                return None
        number = values.value(mark.rest, Key("value.label"))[0]
        self._at_end(mark, values)
        self._count(mark)
        frame.at, frame.number = self._target(mark, frame.source, number)
        return made

    def _target(self, mark: Mark, source: Source, number: float) -> tuple[int, int]:
        """Offset and number of the line N ``number`` in the program or sub of a mark. Raises ProgramError."""
        if (found := self._line_of(source, mark.at, mark.after, number)) is None:
            raise mark.refusal(source.name, "flow.no_block", number=number)
        return found

    def _line_of(self, source: Source, at: int, after: int, number: float) -> tuple[int, int] | None:
        """The same of the program or sub of what stands from ``at`` to ``after``: the next, or the first."""
        key = source.name, at, number
        if key not in self._targets:
            begins = sorted([0, len(source.text) + 1, *(one.at for one in source.marks.numbered.values())])
            low, high = max(one for one in begins if one <= at), min(one for one in begins if one > at)
            found = None
            if number == math.floor(number) and number >= 0.0:
                n = int(number)
                found = macros.line_of(source.text, n, after, high)
                found = macros.line_of(source.text, n, low, at) if found is None else found
            if found is None:
                return None
            self._targets[key] = found, 1 + sum(1 for _ in NEWLINE.finditer(source.text, 0, found))
        return self._targets[key]

    def _behind_line(self, frame: _Frame, line: Line, word: Word, number: float) -> tuple[int, int]:
        """The line N ``number`` of the text that a frame is in, seen from where it has come to."""
        found = self._line_of(frame.source, max(0, frame.at - 1), frame.at, number)
        if found is None:
            raise line.refusal(word, "flow.no_block_of", number=number)
        return found

    def _then(self, mark: Mark) -> Line | None:
        """What stands behind THEN, where the condition holds."""
        values, source = self._values(mark), self._frames[-1].source
        values.peek()
        if values.bracket() == 0.0 or not any(map(values.skip, macros.THEN_WORDS)):
            return None
        raw, at = source.text[mark.at : mark.after].rstrip("\r\n"), len(mark.text) - len(values.rest)
        return self._scan(" " * at + raw[at:], source.name, mark.number, self._frames[-1].callers)

    # ---- subs

    def _call(self, mark: Mark) -> None:
        values = self._values(mark)
        label = mark.label if mark.label != COMPUTED else self._computed(mark, values)
        arguments: list[float] = []
        while values.peek() == "[":
            arguments.append(values.bracket())
        self._at_end(mark, values)
        if len(arguments) > len(ARGUMENTS):
            raise mark.refusal(
                self._frames[-1].source.name,
                "flow.too_many_arguments",
                count=len(arguments),
                most=len(ARGUMENTS),
            )
        source, sub = self._found(mark, label)
        self._enter(mark, source, sub)
        self._parameters.enter(arguments)

    def _computed(self, mark: Mark, values: Values) -> str:
        """The label of ``o[expression] call``."""
        value = values.value(mark.rest, Key("value.label"))[0]
        if value != math.floor(value) or value < 0.0 or not values.skip("call"):
            raise mark.refusal(self._frames[-1].source.name, "flow.no_label", value=value)
        return str(int(value))

    def _found(self, mark: Mark, label: str) -> tuple[Source, Mark]:
        """The sub of a label, in this text, the program's or a file of that name."""
        here = self._frames[-1].source
        for source in (here, self._main, self._file(label)):
            if source is not None and (sub := source.marks.subs.get(label)) is not None:
                return source, sub
        if label in here.marks.numbered:
            raise mark.refusal(here.name, "flow.called_by_m98", label=label)
        key, values = self._missing("flow.no_sub")
        raise mark.refusal(here.name, key, label=label, **values)

    def _missing(self, key: str) -> tuple[str, dict[str, str]]:
        """Key and values of a text that tells of a missing sub, with the files that are called, if any."""
        names = " ".join(sorted(name for name, _ in self._files.values())[:20])
        return (f"{key}_of_these", {"called": names}) if names else (key, {})

    def _file(self, label: str) -> Source | None:
        if label not in self._files:
            return None
        if label not in self._sources:
            self._sources[label] = Source.of(*self._files[label], self._parameters.of_fanuc)
        return self._sources[label]

    def _enter(self, mark: Mark, source: Source, sub: Mark) -> None:
        self._count(mark)
        caller = self._frames[-1]
        if len(self._frames) > self._limits.call_levels:
            raise mark.refusal(caller.source.name, "flow.too_deep", most=self._limits.call_levels)
        line = 0 if source is self._main else caller.line or mark.number
        callers = (Caller(mark.written, mark.number, caller.source.name), *caller.callers)
        frame = _Frame(source, sub.after, sub.number + 1, sub, callers, line)
        frame.serial = self._passes
        self._frames.append(frame)

    def _leave_sub(self, mark: Mark) -> None:
        values = self._values(mark)
        value = values.bracket() if values.peek() == "[" else None
        self._at_end(mark, values)
        self._leave(mark.number)
        self._parameters.leave(value)

    def _leave(self, number: int) -> None:
        frame = self._frames.pop()
        if frame.restores:
            words = (Word("M", 72.0, False, 1, "M72"),)
            self._due = Line(frame.source.name, number, words)
            self._due.where = Where(frame.line or number, self._step, frame.serial, frame.callers)

    # ---- subs by number

    def _call_by_number(self, line: Line, word: Word) -> None:
        """M98 P L. P of more than four digits: how often and, in the last four, which (as Fanuc)."""
        letters = {w.letter: w for w in line.words if w.letter in "PL"}
        if "P" not in letters:
            raise line.refusal(word, "flow.m98_alone")
        number, rounds = (_count_of(line, letters.get(letter)) for letter in "PL")
        if word.value == LOCAL:
            self._call_lines(line, word, letters["P"], rounds)
            return
        if str(number) not in self._main.marks.numbered and number >= SPLIT and "L" not in letters:
            rounds, number = divmod(number, SPLIT)
        if rounds == 0:
            return
        self._enter_numbered(line, word, str(number), rounds)
        self._parameters.enter_sharing()

    def _call_lines(self, line: Line, word: Word, p: Word, rounds: int) -> None:
        """M97 P: the lines from N on, up to an M99 (Haas)."""
        frame = self._frames[-1]
        at, number = self._behind_line(frame, line, p, p.value)
        if rounds:
            called = Mark(0, 0, line.number, f"{p.value:g}", "M97")
            self._enter_times(called, frame.source, Mark(at, at, number - 1, called.label, "M97"), rounds)
            self._parameters.enter_sharing()

    def _call_by_name(self, line: Line, word: Word) -> None:
        """M98 (FILE): the program in a file (Haas), or a sub in it."""
        rounds = _count_of(line, next((w for w in line.words if w.letter == "L"), None))
        source = self._file(line.file)
        if source is None:
            key, values = self._missing("flow.no_file")
            raise line.refusal(word, key, label=line.file, **values)
        if rounds:
            called = Mark(0, 0, line.number, line.file, "", statement=f"{word.text} ({line.file})")
            whole = Mark(0, 0, 0, line.file, ALONE)
            self._enter_times(called, source, next(iter(source.marks.numbered.values()), whole), rounds)
            self._parameters.enter_sharing()

    def _enter_numbered(self, line: Line, word: Word, label: str, rounds: int) -> _Frame:
        called = Mark(0, 0, line.number, label, f"{word.letter}{word.value:g}")
        return self._enter_times(called, *self._numbered(line, word, label), rounds)

    def _enter_times(self, called: Mark, source: Source, sub: Mark, rounds: int) -> _Frame:
        self._enter(called, source, sub)
        frame = self._frames[-1]
        frame.by_number, frame.rounds = True, rounds
        return frame

    def _numbered(self, line: Line, word: Word, label: str) -> tuple[Source, Mark]:
        here = self._frames[-1].source
        texts = (here, self._main) if word.value != OF_FILE or word.letter != "M" else ()
        for source in (*texts, self._file(label)):
            if source is not None and (sub := source.marks.numbered.get(label)) is not None:
                return source, sub
        if (source := self._file(label)) is not None and not source.marks.subs:
            return source, Mark(0, 0, 0, label, ALONE)  # a file without its number
        if label in here.marks.subs or label in self._main.marks.subs:
            raise line.refusal(word, "flow.called_by_o", label=label)
        key, values = self._missing("flow.no_number")
        raise line.refusal(word, key, label=label, **values)

    def _return(self, line: Line, word: Word) -> None:
        """M99: back to the caller, or once more from the top of the sub; P (Fanuc): to its line N there."""
        frame, p = self._frames[-1], next((w for w in line.words if w.letter == "P"), None)
        p = p if self._parameters.of_fanuc else None
        if len(self._frames) == 1 and p is not None:
            self._count(Mark(0, 0, line.number, f"{p.value:g}", "M99"))
            frame.at, frame.number = self._behind_line(frame, line, p, p.value)
            return
        if len(self._frames) == 1:
            raise line.refusal(word, "flow.m99_outside")
        if not frame.by_number or frame.sub is None:
            raise line.refusal(word, "flow.m99_in_o")
        frame.rounds = 0 if p is not None else frame.rounds - 1
        if frame.values is None:
            self._parameters.leave_sharing()
        if frame.rounds:
            if frame.values is None:
                self._parameters.enter_sharing()
            self._go(frame.sub)
            self._count(frame.sub)
            return
        if frame.values is not None:
            self._parameters.leave_macro()
            self._modal_calls -= frame.is_modal
        self._leave(line.number)
        if p is not None:
            caller = self._frames[-1]
            caller.at, caller.number = self._behind_line(caller, line, p, p.value)

    # ---- codes of the machine's own

    def _own(self, line: Line, call: Word) -> None:
        """The sub that the code of a line stands for, the other words of the line being its own."""
        words = tuple(word for word in line.words if word is not call)
        if (other := next((word for word in words if word.letter in "GM"), None)) is not None:
            raise line.refusal(other, "flow.own_alone", code=call.text)
        label = self._limits.own_codes[call.letter, call.value]
        values: dict[Name, float] = {word.letter.lower(): word.value for word in words}
        if self._parameters.of_fanuc:
            numbered = tuple(word for word in words if word.letter in "IJK" or word.letter in NUMBER_OF)
            inches = self._parameters.value("_metric") == 0.0
            values |= macros.arguments(line, call, numbered, self._limits.without_point, inches)
        if label.isdigit():
            frame = self._enter_numbered(line, call, label, 1)
            frame.values = values
        else:
            mark = Mark(0, 0, line.number, label, "call", statement=call.text, column=call.column)
            self._enter(mark, *self._found(mark, label))
        self._parameters.enter_macro(values)

    # ---- macros

    def _macro(self, line: Line, call: Word) -> Iterator[Line]:
        """G65, G66 and G67, behind what stands before them."""
        before, behind = macros.parted(line, call)
        kept = (*before, *behind) if call.value == macros.NO_MORE else before
        if kept or line.says:
            yield line.with_words(kept)
        if call.value == macros.NO_MORE:
            self._modal = None
            self._parameters.note_modal_call(False)
            return
        letters = {word.letter: word for word in behind if word.letter in "PL"}
        if "P" not in letters:
            raise line.refusal(call, "macro.alone")
        number, rounds = (_count_of(line, letters.get(letter)) for letter in "PL")
        words = tuple(word for word in behind if word.letter not in "PL")
        inches = self._parameters.value("_metric") == 0.0
        values = macros.arguments(line, call, words, self._limits.without_point, inches)
        macro = Macro(str(number), rounds, values, line, call)
        if call.value == macros.NOW:
            self._call_macro(line, macro, modal=False)
        elif self._modal is not None:
            raise line.refusal(call, "macro.modal_twice", line=self._modal.line.number)
        else:
            self._numbered(line, call, macro.label)  # which is refused here rather than at a move
            self._modal = macro
            self._parameters.note_modal_call(True)

    def _behind(self, line: Line) -> None:
        """The modal macro behind a line that moves, but in its own lines."""
        if self._modal is not None and not self._modal_calls and macros.moves(line):
            self._call_macro(line, self._modal, modal=True)

    def _call_macro(self, line: Line, macro: Macro, modal: bool) -> None:
        if macro.rounds == 0:
            return
        frame = self._enter_numbered(line, macro.call, macro.label, macro.rounds)
        frame.values, frame.is_modal = macro.values, modal
        self._modal_calls += modal
        self._parameters.enter_macro(macro.values)

    def _number_alone(self, mark: Mark) -> None:
        """The number of the program at its head; anywhere else a sub begins, which is only called."""
        frame = self._frames[-1]
        if not self._begun and len(self._frames) == 1:
            self._begun = True
            return
        what = frame.sub.written if frame.sub is not None else Key("flow.program")
        end = "M99" if frame.by_number else "M30"
        raise mark.refusal(
            frame.source.name, "flow.runs_into", what=what, mark=mark.written or "O" + mark.label, end=end
        )

    def _unended(self, frame: _Frame) -> ProgramError:
        sub = frame.sub.written if frame.sub is not None else ""
        why = message("flow.text_ends", sub=sub)
        return ProgramError(frame.source.name, max(1, frame.number - 1), 1, why).within(frame.callers)


def _nothing(mark: Mark) -> None:
    """A line that only marks a place."""


def _count_of(line: Line, word: Word | None) -> int:
    if word is None:
        return 1
    if word.value != math.floor(word.value) or word.value < 0.0:
        raise line.refusal(word, "flow.no_count")
    return int(word.value)
