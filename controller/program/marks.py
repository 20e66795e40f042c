"""The O-words of a text: where subs, choices and loops begin, branch and end.

    o100 sub ... o100 return ... o100 endsub       called by o100 call [argument] ...
    o101 if [] ... o101 elseif [] ... o101 else ... o101 endif
    o102 while [] ... o102 endwhile       o103 do ... o103 while []       o104 repeat [] ... o104 endrepeat
    O1000 ... M99                                  called by M98 P1000

Found in one pass before a line is carried out, so that nothing is searched later and a
structure that is wrong is refused wherever it stands. A text without O-words has no marks.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from controller.messages import Key, message
from controller.program.expressions import GAPS
from controller.program.program import ProgramError
from controller.program.source_text import NEWLINE, Text, without_comments

PERCENT = re.compile(
    r"[ \t]*%[ \t]*(?:;.*)?"
)  # a line that begins or ends a text; ; as Fanuc's lists end lines
ENDS = {"endsub": "sub", "endif": "if", "endwhile": "while", "endrepeat": "repeat"}
LOOPS = ("while", "do", "repeat")
STRUCTURES = ("if", *LOOPS)
BY_NUMBER = ("M97", "M98", "M198", "G65", "G66")  # calls that are no O-words
ALONE = ""  # the keyword of a number that stands alone: a sub for M98
COMPUTED = ""  # the label of a call whose number is an expression

_BARE = ("sub", "else", "endif", "do", "endwhile", "endrepeat", "break", "continue")  # take nothing
_CONDITIONED = ("if", "elseif", "while", "repeat")  # take one value in brackets

_COMMENTS = r"(?:\([^()\r\n]*\)[ \t]*)*"
_O = re.compile(r"[oO:](?<![A-Za-z].)")
_LINE = re.compile(rf"[ \t]*{_COMMENTS}/?[ \t]*{_COMMENTS}(?:[nN][ \t]*[0-9.][0-9. \t]*)?{_COMMENTS}[oO:]")
_MARK = re.compile(
    rf"[{GAPS}]*(?P<deleted>/?)[{GAPS}]*(?:n[ \t]*[0-9.][0-9. \t]*)?[{GAPS}]*[o:][{GAPS}]*"
    r"(?:<(?P<name>[^<>\0]*)>|(?P<number>[0-9][0-9 \t]*)|(?=[\[#]))"
)
_KEYWORD = re.compile(
    rf"[{GAPS}]*(endsub|endif|endwhile|endrepeat|else[ \t]*if|sub|call|return|if|else|while|do|repeat|break"
    r"|continue)"
    r"(?![a-z])"
)
_TITLE = re.compile(rf"[{GAPS}]*(<[^<>]*>)?[{GAPS}]*")  # as some controls name programs: O1234 <PART>
_CALLS_BY_NUMBER = (
    r"[mM][ \t]*0*(?:9[ \t]*[789]|1[ \t]*9[ \t]*8)(?![0-9])",
    r"[gG][ \t]*0*6[ \t]*[56](?![0-9])",
)


# The same two in bytes, a pattern for each letter: one that begins with a letter is looked for at a run.
_SIGNS = [re.compile(_O.pattern.replace("[oO:]", letter).encode()) for letter in "oO:"]
_CALLS = [
    re.compile(form.replace(form[:4], letter).encode()) for form in _CALLS_BY_NUMBER for letter in form[1:3]
]


@dataclass(eq=False, slots=True)
class Mark:
    """A line with an O-word."""

    at: int  # offset of the line in its text
    after: int  # ... and of the line behind it
    number: int  # of the line, from 1
    label: str
    keyword: str
    text: str = ""  # the line in small letters, its comments blanked
    rest: int = 0  # where what follows the keyword (the label, if computed) begins in it
    deleted: bool = False  # it begins with /
    statement: str = ""  # as written, of one that is no O-word (``macros``)
    column: int = 0  # of it
    parts: list[Mark] = field(default_factory=list)  # of the structure it belongs to, in order, itself too

    @property
    def last(self) -> Mark:
        return self.parts[-1]

    @property
    def written(self) -> str:
        if self.keyword in BY_NUMBER:
            return f"{self.keyword} P{self.label}"
        if self.statement:
            return self.statement
        label = self.label if self.label.isdigit() else f"<{self.label}>"
        return f"o{'[]' if self.label == COMPUTED else label} {self.keyword}".rstrip()

    def refusal(self, name: str, key: str, **values: object) -> ProgramError:
        """Of this mark in the text ``name``; the text of ``key`` may name it as {mark} and its {label}."""
        why = message(key, **{"mark": self.written, "label": self.label, **values})
        return ProgramError(name, self.number, self.column or self.text.find("o") + 1 or 1, why)

    def label_used(self, name: str, other: Mark) -> ProgramError:
        """What is told where ``other`` has the label already."""
        return self.refusal(name, "flow.label_used", line=other.number, other=other.written)

    def surplus(self, name: str, behind: str) -> ProgramError:
        """What is told of text behind all that an O-word takes."""
        return self.refusal(name, "flow.surplus", behind=behind.strip(GAPS).upper()[:20])


More = Callable[[str, str, int], Iterable[Mark]]  # text, its name, where it ends


@dataclass(frozen=True, slots=True)
class Marks:
    """All of a text."""

    by_offset: dict[int, Mark]
    subs: dict[str, Mark]  # label -> sub
    numbered: dict[str, Mark]  # label -> number that stands alone
    by_number: bool  # M98, M99, G65 or G66 may stand in the text
    end: int  # of the text: the closing %

    @property
    def none(self) -> bool:
        """Lines are carried out as they stand: at most the program's own number is marked."""
        return not self.subs and not self.by_number and len(self.by_offset) == len(self.numbered) <= 1


def marks_of(text: str, name: str, more: More | None = None) -> Marks:
    """The marks of a text, with ``more`` of it. Raises ProgramError for what makes no whole structure."""
    end = _end_of(text)
    marks = list(_marks(text, name, end))
    if more is not None:
        marks = sorted([*marks, *more(text, name, end)], key=lambda mark: mark.at)
    _paired(marks, name)
    subs = {mark.label: mark for mark in marks if mark.keyword == "sub"}
    numbered = {mark.label: mark for mark in marks if mark.keyword == ALONE}
    by_number = any(re.search(form, text) for form in _CALLS_BY_NUMBER)
    return Marks({mark.at: mark for mark in marks}, subs, numbered, by_number, end)


def plain(text: Text) -> bool:
    """Whether lines just follow: the text has at most one number alone."""
    if any(call.search(text.body) for call in _CALLS):
        return False
    if not any(sign.search(text.body) for sign in _SIGNS):
        return True
    numbers = 0
    for part in text.parts():
        try:
            words = [mark.keyword for mark in _marks(part, "", len(part))]
        except ProgramError:
            return False
        numbers += len(words)
        if any(words) or numbers > 1:
            return False
    return True


def _marks(text: str, name: str, end: int) -> Iterator[Mark]:
    stop, number = 0, 1
    while (candidate := _O.search(text, stop, end)) is not None:
        at = _line_start(text, stop, candidate.start())
        number += sum(1 for _ in NEWLINE.finditer(text, stop, at))
        newline = NEWLINE.search(text, candidate.end())
        if _LINE.match(text, at):
            yield _mark(text, at, newline, number, name)
        if newline is None:
            return
        stop, number = newline.end(), number + 1


def _line_start(text: str, low: int, at: int) -> int:
    """The offset of the line that ``at`` is in; no line begins before ``low`` that is not begun there."""
    return max(low, text.rfind("\n", low, at) + 1, text.rfind("\r", low, at) + 1)


def _mark(text: str, at: int, stop: re.Match[str] | None, number: int, name: str) -> Mark:
    raw = text[at : stop.start() if stop else len(text)]
    bare = without_comments(raw, name, number).lower()
    head = _MARK.match(bare)
    if head is None:
        column = re.search("[o:]", bare)
        raise ProgramError(name, number, column.start() + 1 if column else 1, message("flow.o_alone"))
    label = "".join((head["name"] or "").split()) or head["number"] or COMPUTED
    label = str(int("".join(label.split()))) if head["number"] else label
    word = _KEYWORD.match(bare, head.end())
    keyword = "".join(word.group(1).split()) if word else "call" if label == COMPUTED else ALONE
    rest = word.end() if word else head.end()
    made = Mark(
        at, stop.end() if stop else len(text) + 1, number, label, keyword, bare, rest, bool(head["deleted"])
    )
    if keyword == ALONE and not _TITLE.fullmatch(bare, rest):
        raise made.refusal(name, "flow.no_o_word", behind=bare[rest:].strip(GAPS).upper(), label=label)
    return made


def _end_of(text: str) -> int:
    """Where the closing % stands, or the end of the text."""
    low, opened = 0, False
    while (at := text.find("%", low)) >= 0:
        start, newline = _line_start(text, low, at), NEWLINE.search(text, at)
        low = newline.end() if newline else len(text)
        if PERCENT.fullmatch(text, start, newline.start() if newline else len(text)) is None:
            continue
        if opened or any(_says_something(line) for line in text[:start].splitlines()):
            return start
        opened = True
    return len(text)


def _says_something(line: str) -> bool:
    return bool(re.sub(r"\([^()]*\)|;.*", "", line).strip())


def _paired(marks: list[Mark], name: str) -> None:
    pairs = _Pairs(name)
    for mark in marks:
        pairs.take(mark)
    if pairs.open:
        mark = pairs.open[-1]
        ends = {start: end for end, start in ENDS.items()} | {"do": "while [condition]"}
        what = f"o{mark.label} {ends[mark.keyword]}"
        if mark.statement:
            what = f"END{mark.label.partition('.')[0]}"
        raise mark.refusal(name, "flow.no_end", what=what)


def behind_bracket(text: str, at: int) -> str:
    """What stands behind the first value in brackets from ``at`` on; nothing where it has no end."""
    depth = 0
    for k in range(at, len(text)):
        depth += (text[k] == "[") - (text[k] == "]")
        if depth == 0 and text[k] == "]":
            return text[k + 1 :]
    return ""


class _Pairs:
    """What is open while the marks are gone through in order."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.open: list[Mark] = []
        self._around: dict[str, Mark] = {}  # of these the structures, by label
        self._subs: dict[str, Mark] = {}

    def take(self, mark: Mark) -> None:
        if mark.keyword in _BARE or mark.keyword in _CONDITIONED:
            behind = mark.text[mark.rest :] if mark.keyword in _BARE else behind_bracket(mark.text, mark.rest)
            if behind.strip(GAPS):
                raise mark.surplus(self._name, behind)
        if mark.deleted and mark.keyword in ("sub", ALONE):
            raise mark.refusal(self._name, "flow.deleted")
        if mark.keyword in ("sub", ALONE):
            self._sub(mark)
        elif mark.keyword in STRUCTURES:
            self._begins(mark)
        elif mark.keyword in ENDS:
            self._ends(mark, ENDS[mark.keyword])
        elif mark.keyword in ("elseif", "else"):
            self._branch(mark)
        elif mark.keyword in ("break", "continue"):
            self._in_loop(mark)
        elif mark.keyword == "return" and not (self.open and self.open[0].keyword == "sub"):
            raise mark.refusal(self._name, "flow.return_outside")

    def _sub(self, mark: Mark) -> None:
        if self.open:
            raise mark.refusal(
                self._name, "flow.sub_in_sub", other=self.open[-1].written, line=self.open[-1].number
            )
        if (other := self._subs.setdefault(mark.label, mark)) is not mark:
            raise mark.label_used(self._name, other)
        mark.parts = [mark]
        if mark.keyword == "sub":
            self.open.append(mark)

    def _begins(self, mark: Mark) -> None:
        if mark.keyword == "while" and self.open and self._closes(mark, "do"):
            self._ends(mark, "do")
            return
        if (other := self._around.setdefault(mark.label, mark)) is not mark:
            raise mark.label_used(self._name, other)
        mark.parts = [mark]
        self.open.append(mark)

    def _closes(self, mark: Mark, keyword: str) -> bool:
        return bool(self.open) and self.open[-1].keyword == keyword and self.open[-1].label == mark.label

    def _part(self, mark: Mark, keyword: str) -> Mark:
        """The open structure that ``mark`` goes on with or ends."""
        if not self._closes(mark, keyword):
            inner = self.open[-1] if self.open else None
            here = (
                message("flow.open", other=inner.written, line=inner.number) if inner else Key("flow.nothing")
            )
            raise mark.refusal(self._name, "flow.belongs_nowhere", keyword=keyword, here=here)
        opened = self.open[-1]
        if mark.deleted != opened.deleted:
            raise (mark if mark.deleted else opened).refusal(self._name, "flow.deleted")
        opened.parts.append(mark)
        mark.parts = opened.parts
        return opened

    def _ends(self, mark: Mark, keyword: str) -> None:
        self._part(mark, keyword)
        self.open.pop()
        if keyword != "sub":
            del self._around[mark.label]

    def _branch(self, mark: Mark) -> None:
        opened = self._part(mark, "if")
        if any(part.keyword == "else" for part in opened.parts[:-1]):
            raise mark.refusal(self._name, "flow.after_else")

    def _in_loop(self, mark: Mark) -> None:
        loop = next((o for o in reversed(self.open) if o.keyword in LOOPS and o.label == mark.label), None)
        if loop is None:
            raise mark.refusal(self._name, "flow.no_loop")
        if loop.deleted and not mark.deleted:
            raise loop.refusal(self._name, "flow.deleted")
        mark.parts = loop.parts
