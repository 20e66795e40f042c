"""A program with the files that it calls, as one text; and lines that block delete leaves out.

``o<name> call``, ``M98 P1000`` and ``G65 P1000`` take subs from files of that name beside the
program. What is checked, kept, recorded and gone on with must be all of it, so the files are put
behind the program as soon as it is read, each behind a mark that no text holds:

    program ... M30
    <FS>name<TAB>file
    o<name> sub ...

A program that calls no file stays as it is, to the byte.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import TypeVar

from controller.machine.model import Machine
from controller.program import own_codes
from controller.program.source_text import Bytes

MAX_FILES = 200
MAX_BYTES = 1 << 30  # of a program
SHIPPED = Path(__file__).resolve().parents[2] / "config" / "programs" / "probing"
SUFFIXES = (".ngc", ".nc", ".tap", ".cnc", ".txt", ".h", "")  # of files of subs, the first that is there

_MARK = re.compile(rb"\n\x1c([^\t\n\x1c]+)\t([^\t\n\x1c]+)\n")
_CALL = re.compile(rb"[oO][ \t]*(?:<([^<>\r\n]*)>|([0-9]+))[ \t]*[cC][aA][lL][lL]")
_WHOLE_SUB = re.compile(
    rb"^[ \t]*[oO][ \t]*(<[^<>\r\n]*>|[0-9]+)[ \t]*[sS][uU][bB]\b.*?"
    rb"^[ \t]*[oO][ \t]*\1[ \t]*[eE][nN][dD][sS][uU][bB][^\r\n]*",
    re.MULTILINE | re.DOTALL,
)
_IDLE = re.compile(rb"\([^)\r\n]*\)|;[^\r\n]*|%|[mM][ \t]*0*(?:2|30)\b")  # comments, and ends of programs
_BY_NUMBER = re.compile(rb"(?:[mM][ \t]*0*1?98|[gG][ \t]*0*6[56])[^;(\r\n]*?[pP][ \t]*([0-9]+)")
_OF_FILE = re.compile(rb"[mM][ \t]*0*198[^;(\r\n]*?[pP][ \t]*([0-9]+)")  # whatever the program has
_BY_NAME = re.compile(rb"[mM][ \t]*0*98[ \t]*(?:[lL][ \t]*[0-9]+[ \t]*)?\(([^()\r\n]+)\)")
_SUB = re.compile(rb"[oO][ \t]*(?:<([^<>\r\n]*)>|([0-9]+))[ \t]*[sS][uU][bB]")
_NUMBER = re.compile(rb"(?:^|[\r\n])[ \t]*[oO:][ \t]*([0-9]+)[ \t]*(?=[\r\n(;<]|$)")
_DELETED = re.compile(rb"((?:^|[\r\n])[ \t]*)/")

B = TypeVar("B", bound=Bytes)
Find = Callable[[str], tuple[str, bytes] | None]  # label -> name and content of its file


def linked(program: B, find: Find, machine: Machine | None = None) -> B | bytes:
    """The program with all files that it and they call; unknown names are left to the reader to refuse.

    ``machine``: whose codes of its own call subs, and in whose folders they are looked for, too.
    """
    finds = [find, *(_of_folder(Path(one)) for one in (machine.sub_folders if machine else ())), _shipped()]
    subs = own_codes.subs(machine) if machine else {}
    found: dict[str, tuple[str, bytes]] = {}
    due = list(_called(program, subs))
    known = set(_defined(program)) - {str(int(number)) for number in _OF_FILE.findall(program)}
    while due and len(found) < MAX_FILES:
        label = due.pop(0)
        if label in found or label in known:
            continue
        if (file := next((file for one in finds if (file := one(label)) is not None), None)) is None:
            continue
        found[label] = file
        due += _called(file[1], subs)
    if not found:
        return program
    return bytes(program) + b"".join(
        b"\n\x1c%s\t%s\n%s" % (label.encode(), name.encode(), text) for label, (name, text) in found.items()
    )


@cache
def _shipped() -> Find:
    """Cycles that come with Directrix, where the program has no file of that name beside it."""
    return among({file.name: file for file in sorted(SHIPPED.glob("*.ngc"))})


def mapped(program: Path) -> Bytes:
    """A file whose bytes are mapped, not read: they take no memory of ours. Raises OSError."""
    with program.open("rb") as file:
        return mmap(file.fileno(), 0, access=ACCESS_READ) if os.fstat(file.fileno()).st_size else b""


def parts(data: Bytes) -> tuple[Bytes, dict[str, tuple[str, bytes]]]:
    """The program, and the files behind it: label -> name and content."""
    if _MARK.search(data) is None:
        return data, {}  # not split: a long program is not held twice
    program, *rest = _MARK.split(data)
    files = zip(rest[::3], rest[1::3], rest[2::3], strict=True)
    return program, {label.decode(): (name.decode(), text) for label, name, text in files}


def beside(program: Path) -> Find:
    """Finds files of subs in the folder of a program."""
    return _of_folder(program.parent)


def _of_folder(folder: Path) -> Find:
    """Of a folder that is not there, or that cannot be read, none."""
    try:
        return among({file.name: file for file in sorted(folder.expanduser().iterdir())})
    except OSError:
        return among({})


def among(files: Mapping[str, Path], read: Callable[[Path], bytes] = Path.read_bytes) -> Find:
    """Finds files of subs among these, by name: ``name.ngc``, or for a number ``1000.ngc`` and ``O1000``."""
    by_label: dict[str, dict[str, str]] = {}
    for name in files:
        stem, suffix = Path(name).stem, Path(name).suffix.lower()
        for label in labels_of(stem if suffix in SUFFIXES else name):
            by_label.setdefault(label, {}).setdefault(suffix, name)

    def find(label: str) -> tuple[str, bytes] | None:
        there = by_label.get(label, {})
        name = next((there[suffix] for suffix in SUFFIXES if suffix in there), None)
        if name is None or not files[name].is_file():
            return None
        return name, read(files[name])

    return find


def labels_of(stem: str) -> Iterator[str]:
    """What the sub in a file of that name may be called by."""
    name = "".join(stem.lower().split())
    yield name
    if (number := name.removeprefix("o")).isdigit():
        yield str(int(number))


def without_deleted(program: bytes) -> bytes:
    """What is carried out with block delete on: lines that begin with / are comments."""
    return _DELETED.sub(rb"\1;/", program)


def _called(text: Bytes, subs: Mapping[str, str]) -> Iterator[str]:
    for code, label in subs.items():
        if own_codes.pattern(code).search(text):
            yield label
    for name in _BY_NAME.findall(text):
        yield file_label(name.decode("utf-8", "replace"))
    for name, number in _CALL.findall(text):
        yield _label(name, number)
    for number in _BY_NUMBER.findall(text):
        yield str(int(number))
        yield str(int(number[-4:]))


def file_label(name: str) -> str:
    """The label of a file that M98 calls by its name, with its ending or without: ``M98 (SUB.NC)``."""
    stem, suffix = Path(name.strip()).stem, Path(name.strip()).suffix.lower()
    return _label((stem if suffix in SUFFIXES else name.strip()).encode(), b"")


def only_subs(text: Bytes) -> bool:
    """Whether a file is there to be called by others: subs, and nothing beside them but an end."""
    beside = _WHOLE_SUB.sub(b"", parts(text)[0])
    return beside != text and not _IDLE.sub(b"", beside).strip()


def _defined(text: Bytes) -> Iterator[str]:
    for name, number in _SUB.findall(text):
        yield _label(name, number)
    for number in _NUMBER.findall(text):
        yield str(int(number))


def _label(name: bytes, number: bytes) -> str:
    return str(int(number)) if number else "".join(name.decode("utf-8", "replace").lower().split())
