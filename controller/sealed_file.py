"""JSON files of the state folder that carry their own checksum.

    sealed_file.write(file, values)     # {..., "seal": {"generation": 1, "at_s": 1.8e9, "sha256": "..."}}
    sealed_file.read(file)              # values without the seal, or Damaged

The sum is of the file's name, generation, time and values, so that a file that stands in another's place is
none of it either. Lines of a file that grows have a sum of their own (``line``).

A file of a version without seals is taken as it is until ``mark`` says that those of its name have one.
What has to be known after a bad bit is in a database (``sealed_rows``).
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from controller import atomic_file, own_files
from controller.messages import Message, TextError, message

SEAL, VALUE = "seal", "value"  # VALUE: of what is no JSON object
SUM = "sum"  # of a line
MARK = "sealed"  # in a folder: the names of its files that have seals, one a line
_OF_A_SEAL = {"generation", "at_s", "sha256"}
UNREADABLE = (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)


class Damaged(TextError, ValueError):
    """A file that is not as it was written: ``said`` is why."""


def write(file: Path, values: Any, within: Path | None = None) -> None:
    """Replaces a file, whole or not at all; ``within``: as ``own_files`` has it. Raises OSError."""
    own_files.make_folder(file.parent, within)
    atomic_file.write(file, text(values, file.name), within)


def text(values: Any, name: str) -> str:
    """What is written into a file of that name."""
    whole = json.loads(json.dumps(values))  # as it is read again
    at_s = time.time()
    seal = {"generation": 1, "at_s": at_s, "sha256": _sum(name, 1, at_s, whole)}
    return json.dumps({**_as_object(whole), SEAL: seal})


INDENTED = "{\n"  # so records of runs and drives began before they had seals


def read(
    file: Path, name: str = "", within: Path | None = None, shared: bool = False, older: str = ""
) -> Any:
    """The values of a file; ``name``: that it was written by, if it is a copy; ``within`` and ``shared``: as
    ``own_files`` has them; ``older``: what one without a seal begins with.

    Raises Damaged, FileNotFoundError or another OSError.
    """
    values, seal = _parted(file, name, within, shared, older)
    if seal is None and is_marked(file):
        raise Damaged(message("sealed.none"))
    return values


def before_counts(file: Path, why: Exception | Message | str, aside: str, at_s: float) -> Message:
    """What an alarm says where a copy of a file, of ``at_s``, counts now.

    ``aside``: the name that the damaged one has now; "" where it is gone.
    """
    at = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at_s))
    if not aside:
        return message("file_gone_before", file=file, at=at)
    return message("file_before", file=file, why=why, aside=aside, at=at)


def begun_anew(file: Path, why: Exception | Message | str, aside: str) -> Message:
    """Likewise where nothing of it counts any more."""
    return (
        message("file_damaged", file=file, why=why, aside=aside) if aside else message("file_gone", file=file)
    )


def line(values: Mapping[str, Any], number: int = 0) -> str:
    """A line of a file that grows, with its own sum; ``number``: in a file where none may be left out."""
    whole = json.loads(json.dumps(values))
    return json.dumps({**whole, SUM: _sum("", number, 0, whole)}) + "\n"


def of_line(text: bytes | str, file: Path | None = None, number: int = 0) -> dict[str, Any]:
    """The values of a line of a file; ``file``: one that an older version may have written without sums.

    The end of the last line may be another character than it was. Raises Damaged.
    """
    try:
        return _of_line(text, file, number)
    except Damaged as error:
        if text[-1:] in (b"\n", "\n"):
            raise
        with contextlib.suppress(Damaged):
            return _of_line(text[:-1], file, number)
        raise error


def _of_line(text: bytes | str, file: Path | None, number: int) -> dict[str, Any]:
    try:
        whole = dict(json.loads(text))
    except (ValueError, TypeError, RecursionError) as error:
        raise Damaged(message("sealed.unread", why=str(error))) from error
    found = whole.pop(SUM, None)
    if found is None and (file is None or is_marked(file)):
        raise Damaged(message("sealed.none"))
    if found is not None and found != _sum("", number, 0, whole):
        raise Damaged(message("sealed.other"))
    return whole


def mark(folder: Path, names: Iterable[str]) -> None:
    """From now on files of these names are damaged where they have no seal, or are gone. Raises OSError."""
    marked = _marked(folder)
    if not marked.issuperset(names):
        atomic_file.write(folder / MARK, "".join(f"{name}\n" for name in sorted(marked.union(names))))


def is_marked(file: Path) -> bool:
    """Whether there was such a file, with a seal."""
    return file.name in _marked(file.parent)


def is_sealed(file: Path, within: Path | None = None, shared: bool = False) -> bool:
    """Whether it has a seal; one of an older version has none. Raises as ``read``."""
    return _parted(file, within=within, shared=shared)[1] is not None


def has_sum(text: bytes) -> bool:
    """Whether a line has one, be it right or wrong."""
    return f'"{SUM}": '.encode() in text


def _marked(folder: Path) -> set[str]:
    """Names of files that have seals; none where that cannot be read."""
    with contextlib.suppress(*UNREADABLE):
        return set(own_files.read_text(folder / MARK).split())
    return set()


def _parted(
    file: Path, name: str = "", within: Path | None = None, shared: bool = False, older: str = ""
) -> tuple[Any, dict[str, Any] | None]:
    """Values and seal, which fits them; None: it has none. Raises as ``read``."""
    name = name or file.name
    try:
        data = own_files.read_text(file, within, shared)
        whole = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise Damaged(message("sealed.unread", why=str(error))) from error
    if not isinstance(whole, dict) or SEAL not in whole:
        if not data.startswith(older) or _has_a_damaged_seal(whole):
            raise Damaged(message("sealed.none"))
        return whole, None
    seal = whole.pop(SEAL)
    values = whole[VALUE] if whole.keys() == {VALUE} else whole
    try:
        fits = seal["sha256"] == _sum(name, seal["generation"], seal["at_s"], values)
    except (KeyError, TypeError):
        fits = False
    if not fits:
        raise Damaged(message("sealed.other"))
    return values, seal


def _has_a_damaged_seal(whole: Any) -> bool:
    """Whether there is one under another name."""
    rows = whole.values() if isinstance(whole, dict) else ()
    return any(isinstance(row, dict) and len(_OF_A_SEAL & row.keys()) > 1 for row in rows)


def _as_object(values: Any) -> dict[str, Any]:
    plain = isinstance(values, dict) and values.keys() != {VALUE}
    return values if plain else {VALUE: values}


def _sum(name: str, generation: object, at_s: object, values: Any) -> str:
    canonical = json.dumps([name, generation, at_s, values], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()
