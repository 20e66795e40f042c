"""A compact table of requests and answer classes, made from the log of a CiA 301 conformance test.

The log (CANopenDemo, test_report_CCT.md, Apache-2.0) shows another device, node 4, under
the conformance test tool. The table keeps facts only: for each case the frames the tool
sent, and what class of answer came. Requests to that device's own objects (2000h and up)
are counted and left out. One line per request, equal neighbours folded:

    [2.8 SDO 08]                              a case of the tool
    sdo 40031000 ok                           a request (trailing zeros cut) that succeeded
    sdo 23031000 06070012                     ... that was aborted; "-" = no answer
    sdo 40{1206-127f}01 06020000              ... for each index of a range
    sdo 23051000{0-7f,101-180} 06090030       ... for each value of a list
    nmt 8104 boot                             an NMT command, and the kinds of frames it led to
    sync - tpdo / frame 701:7f -              SYNC with its data, any other frame
    other 12                                  requests to the other device's own objects

A line may end with "xN". Kinds: boot, beat and the state, tpdo, sync, emcy and the code.
"""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

FRAME = re.compile(r"Test CAN\s*: CAN1\s+([0-9A-F]{3}) (Tx|Rx) SD\s+\d\s*((?:[0-9A-F]{2} ?)*)")
CASE = re.compile(r"Test case : (\S+)\s+-\s+Test name : (.*?) #")
NODE = 4
TOOL, REQUEST, ANSWER = 0x7FF, 0x600 + NODE, 0x580 + NODE
FIRST_OF_ITS_OWN = 0x2000
MARK = re.compile(r"\{([0-9a-f,-]+)\}")


@dataclass
class Step:
    """One frame of the tool: identifier, data, class of the SDO answer, kinds of other frames."""

    can_id: int
    data: bytes
    answer: str = "-"
    kinds: set[str] = field(default_factory=set)


@dataclass
class Case:
    title: str
    steps: list[Step] = field(default_factory=list)
    others: int = 0


# -- reading the log


def read_log(path: Path) -> list[Case]:
    """Raises OSError."""
    with gzip.open(path, "rt", encoding="latin-1") as file:
        cases = _cases(file)
    for case in cases:
        _leave_out_others(case)
    return [case for case in cases if case.steps or case.others or not case.title.startswith("prepare")]


def _cases(lines: Iterator[str]) -> list[Case]:
    cases = [Case("prepare 0")]
    for line in lines:
        if found := CASE.search(line):
            cases.append(Case(f"{found[1]} {found[2]}"))
        elif "Prepare DUT" in line:
            cases.append(Case(f"prepare {len(cases)}"))
        elif found := FRAME.search(line):
            _add(cases[-1].steps, int(found[1], 16), found[2] == "Tx", bytes.fromhex(found[3]))
    return cases


def _add(steps: list[Step], can_id: int, sent: bool, data: bytes) -> None:
    """The log may show a request before the answer to the one before it."""
    if can_id == TOOL:
        return
    if sent:
        steps.append(Step(can_id, data))
    elif can_id == ANSWER:
        for step in _waiting(steps)[:1]:
            step.answer = data[7:3:-1].hex() if data[0] == 0x80 else "ok"
    elif steps and (what := kind(can_id, data, NODE)):
        steps[-1].kinds.add(what)


def _waiting(steps: list[Step]) -> list[Step]:
    """Requests that may still be answered: the tool gives one up with an abort or a reset."""
    ends = [k for k, step in enumerate(steps) if step.can_id == 0 or step.data[:1] == b"\x80"]
    later = steps[ends[-1] + 1 :] if ends else steps
    return [step for step in later if step.can_id == REQUEST and step.answer == "-"]


def kind(can_id: int, data: bytes, node: int) -> str:
    """What sort of frame a node's frame is; "" = none of its own."""
    if can_id == 0x700 + node:
        return "boot" if data == b"\0" else f"beat{data[0] & 0x7F:02x}"
    if can_id == 0x80 + node:
        return f"emcy{data[1]:02x}{data[0]:02x}"
    if can_id - node in (0x180, 0x280, 0x380, 0x480):
        return "tpdo"
    return "sync" if can_id == 0x80 else ""


def index_of(step: Step) -> int | None:
    """The object that an SDO request names; None for segments and what belongs to a block."""
    command, sub_command = step.data[0] >> 5, step.data[0] & 3
    if command in (0, 3) or (command == 4 and step.data[0] != 0x80):
        return None
    if (command == 5 and sub_command) or (command == 6 and sub_command & 1):
        return None
    return int.from_bytes(step.data[1:3], "little")


def _leave_out_others(case: Case) -> None:
    kept: list[Step] = []
    foreign = False
    for step in case.steps:
        if step.can_id == REQUEST:
            index = index_of(step)
            foreign = foreign if index is None else index >= FIRST_OF_ITS_OWN
            if foreign:
                case.others += 1
                continue
        kept.append(step)
    case.steps = kept


# -- the table


def write_table(cases: list[Case]) -> str:
    lines = []
    for case in cases:
        lines.append(f"[{case.title}]")
        for line, same in groupby(_folded([_line(step) for step in case.steps])):
            count = len(list(same))
            lines.append(line if count == 1 else f"{line} x{count}")
        lines += [f"other {case.others}"] if case.others else []
    return "\n".join(lines) + "\n"


def _line(step: Step) -> str:
    text = step.data.hex()
    kinds = ",".join(sorted(step.kinds))
    if step.can_id == REQUEST:
        return f"sdo {text.rstrip('0').ljust(8, '0')} {step.answer} {kinds}".rstrip()
    name = {0x000: "nmt", 0x080: "sync"}.get(step.can_id, "frame")
    text = f"{step.can_id:03x}:{text}" if name == "frame" else text or "-"
    return f"{name} {text} {kinds or '-'}"


def _folded(lines: list[str]) -> Iterator[str]:
    """Runs of requests that differ by one index or one value become one line."""
    for _, run in groupby(enumerate(lines), key=lambda pair: _pattern(pair[1])):
        texts = [text for _, text in run]
        if len(texts) < 4 or not texts[0].startswith("sdo "):
            yield from texts
        else:
            yield _fold(texts)


def _pattern(line: str) -> tuple[str, ...]:
    """Lines of equal pattern may be folded: reads of sub-index 1 by index, writes of 4 bytes by value."""
    words = line.split(" ")
    if len(words) != 3 or words[0] != "sdo":
        return (line,)
    if words[1].startswith("40") and words[2] == "06020000":
        return ("by index", words[1][6:], words[2])
    if words[1].startswith("23") and words[2] == "06090030":
        return ("by value", words[1][:8], words[2])
    return (line,)


def _fold(texts: list[str]) -> str:
    requests = [bytes.fromhex(_even(text.split(" ")[1])).ljust(8, b"\0") for text in texts]
    answer = texts[0].split(" ")[2]
    if requests[0][0] == 0x40:
        numbers = [int.from_bytes(request[1:3], "little") for request in requests]
        return f"sdo 40{{{_ranges(numbers)}}}{requests[0][3]:02x} {answer}"
    numbers = [int.from_bytes(request[4:], "little") for request in requests]
    return f"sdo {requests[0][:4].hex()}{{{_ranges(numbers)}}} {answer}"


def _even(text: str) -> str:
    return text + "0" * (len(text) % 2)


def _ranges(numbers: list[int]) -> str:
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][1] + 1:
            parts[-1][1] = number
        else:
            parts.append([number, number])
    return ",".join(f"{a:x}-{b:x}" if a != b else f"{a:x}" for a, b in parts)


def read_table(path: Path) -> list[Case]:
    """Raises OSError."""
    cases: list[Case] = []
    for line in path.read_text(encoding="ascii").splitlines():
        if line.startswith("["):
            cases.append(Case(line[1:-1]))
        elif line.startswith("other "):
            cases[-1].others = int(line[6:])
        elif line and not line.startswith(";"):
            cases[-1].steps += _steps(line)
    return cases


def _steps(line: str) -> Iterator[Step]:
    words = line.split(" ")
    count = int(words.pop()[1:]) if words[-1][0] == "x" else 1
    name, text, rest = words[0], words[1], words[2:]
    kinds = set(rest[-1].split(",")) if (name != "sdo" or len(rest) == 2) and rest[-1] != "-" else set()
    for _ in range(count):
        for request in _unfolded(text) if name == "sdo" else [text]:
            yield _step(name, request, rest[0], set(kinds))


def _step(name: str, text: str, answer: str, kinds: set[str]) -> Step:
    if name == "sdo":
        return Step(REQUEST, bytes.fromhex(_even(text)).ljust(8, b"\0"), answer, kinds)
    if name == "frame":
        can_id, _, data = text.partition(":")
        return Step(int(can_id, 16), bytes.fromhex(data), "", kinds)
    can_id = 0x000 if name == "nmt" else 0x080
    return Step(can_id, bytes.fromhex("" if text == "-" else text), "", kinds)


def _unfolded(text: str) -> Iterator[str]:
    found = MARK.search(text)
    if found is None:
        yield text
        return
    by_index = text.startswith("40")
    for part in found[1].split(","):
        first, _, last = part.partition("-")
        for number in range(int(first, 16), int(last or first, 16) + 1):
            inner = number.to_bytes(2 if by_index else 4, "little").hex()
            yield text[: found.start()] + inner + text[found.end() :]
