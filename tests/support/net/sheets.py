"""The parts of the net that are texts: each entry is made anew from the code as it is, and compared.

An entry is a file of the folder, plain where it is short, else packed; all that is reported of a difference
are the lines that differ.
"""

from __future__ import annotations

import gzip
from collections.abc import Callable, Iterator
from pathlib import Path

from support.net import answers, declared, machine_files, normal, state_folder

MAX_LINES = 40  # of a difference that are reported
PLAIN_BYTES = 4000  # an answer that is longer is packed

# Cheap ones of each kind: what every run of the fast tests holds.
FAST = (
    *("answers/explain-contour", "answers/explain-tip_lines", "answers/check-example1_ready"),
    *("answers/check-expressions", "answers/check-points_and_blu", "answers/explain-nx_five_axis-fanuc"),
    *("declared/openapi", "declared/verbs", "declared/help", "declared/keys", "declared/texts"),
    *("declared/columns", "refused/programs", "refused/machine_files"),
)


def entries(folder: Path) -> dict[str, Callable[[], str]]:
    """How each entry is made, by its name: "part/entry"."""
    return {
        **{f"answers/{name}": _answer(name) for name in answers.names()},
        "declared/columns": declared.columns,
        "declared/help": declared.help_texts,
        "declared/keys": declared.keys,
        "declared/openapi": declared.openapi,
        "declared/texts": declared.texts,
        "declared/verbs": declared.verbs,
        "refused/machine_files": lambda: machine_files.text(folder),
        "refused/programs": answers.refusals,
        "state/opened": lambda: state_folder.text(folder),
    }


def _answer(name: str) -> Callable[[], str]:
    return lambda: answers.text(name)


def chosen(folder: Path, wanted: list[str]) -> list[str]:
    """Entries whose name begins so; all of them for none."""
    return [name for name in entries(folder) if not wanted or any(name.startswith(one) for one in wanted)]


def known(folder: Path, name: str) -> str | None:
    """What was before; None where there is no such entry."""
    plain, packed = _files(folder, name)
    if plain.exists():
        return plain.read_text(encoding="utf-8")
    return gzip.decompress(packed.read_bytes()).decode() if packed.exists() else None


def write(folder: Path, name: str, text: str) -> None:
    """The same file for the same text, wherever it is made."""
    plain, packed = _files(folder, name)
    plain.parent.mkdir(parents=True, exist_ok=True)
    plain.unlink(missing_ok=True)
    packed.unlink(missing_ok=True)
    if len(text) <= PLAIN_BYTES:
        plain.write_text(text, encoding="utf-8")
    else:
        packed.write_bytes(gzip.compress(text.encode(), 9, mtime=0))


def stored(folder: Path) -> Iterator[str]:
    """Names of the entries that there are files of."""
    for file in folder.glob("*/*.txt*"):
        yield f"{file.parent.name}/{file.name.partition('.txt')[0]}"


def difference(folder: Path, name: str, now: str) -> str:
    """What is another, as lines of a diff; "" where all is the same."""
    before = known(folder, name)
    if before is None:
        return f"{name}: is not in the net yet"
    found = normal.differences(before, now)
    if not found:
        return ""
    more = f"\n... and {len(found) - MAX_LINES} lines more" if len(found) > MAX_LINES else ""
    return f"{name}: {len(found)} lines of the difference:\n" + "\n".join(found[:MAX_LINES]) + more


def _files(folder: Path, name: str) -> tuple[Path, Path]:
    return folder / f"{name}.txt", folder / f"{name}.txt.gz"
