"""Data sheets and drive profiles that a machine file names: found, read, and taken along in its text.

A machine travels as one text, to the panel and its checks, into records and back-ups, onto another computer,
where nothing lies beside it. So the text has those files at its end, a table for each:

    [[file]]
    name = "sheets/axis.eds"   # as seen from the machine file
    text = "..."               # the whole file, on one line

What comes with Directrix does not travel: it is on every computer.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from posixpath import dirname, join, normpath

from controller.machine import drive_profiles, inverter_profiles
from controller.machine.declaration import key
from controller.machine.forms import TEXT
from controller.machine.reading import Unread
from controller.machine.toml_table import Table, parse, read_text
from drives.text_file import Source, TextFile

SHIPPED = Path(__file__).resolve().parent.parent.parent / "config"  # beside the package, installed or not
TAKEN_ALONG = (
    "\n# Files that are named above, as they were. Without its table, one is looked for beside this file.\n"
)
SHEETS, PROFILES = "latin-1", "utf-8"  # how they are encoded (CiA 306-1; TOML)


def written(text: str) -> str:
    """A machine file's text as its builder wrote it, without the files that it took along."""
    return text.partition(TAKEN_ALONG)[0]


def beside(folder: Path, name: str, table: Table, key: str = "file") -> Path:
    """A file seen from ``folder``, else a shipped one, so that a copied machine file works."""
    if (found := _on_disk(folder, name)) is None:
        table.refuse(key, "no_named_file", folder=folder)
    return found


@dataclass(frozen=True, slots=True)
class NamedFile:
    """``[[file]]``."""

    name: str = key(TEXT, "of a file that `eds` or `profile` names, as it is named there")
    text: str = key(TEXT, "all of it; records and back-ups have so what was beside the machine file")


class NamedFiles:
    """The files that one machine file names: those in its text, else those in ``folder``.

    Without a folder, as of an old record's text, one that is nowhere stays a name, and is refused where it is
    read: what needs no drives needs no sheets.
    """

    def __init__(self, top: Table, folder: Path | None) -> None:
        self._folder, rows = folder, top.get("file", "", [])
        rows = rows if isinstance(rows, list) else []
        self._there = {
            normpath(row["name"]): row["text"]
            for row in rows
            if isinstance(row, dict) and all(isinstance(row.get(key), str) for key in ("name", "text"))
        }
        self._whole = len(self._there) == len(rows)  # else one was refused
        self._used: dict[str, str] = {}

    def sheet(self, table: Table) -> Source:
        """The data sheet that a table names; "" where it names none. Raises ConfigError."""
        return self._of(table, "eds", SHEETS) if table.has("eds") else ""

    def profile(self, table: Table) -> Source:
        """The drive profile of a table, shipped ones by their name. Raises ConfigError."""
        name = table.text("profile", default="simulated")
        if not name.endswith(".toml"):
            return table.text("profile", drive_profiles.shipped(), name)
        found = self._of(table, "profile", PROFILES)
        if not isinstance(found, TextFile):
            return found
        own = parse(found.text, name).table("drive", "[drive]").text("eds", default="")
        return TextFile(name, found.text, self._taken(join(dirname(name), own), SHEETS) if own else None)

    def inverter(self, table: Table) -> Source:
        """The register map of an inverter, shipped ones by their name. Raises ConfigError."""
        name = table.text("profile")
        if not name.endswith(".toml"):
            return table.text("profile", inverter_profiles.shipped())
        return self._of(table, "profile", PROFILES)

    def is_named(self, name: str) -> bool:
        """Whether one of the tables that were read names it."""
        return normpath(name) in self._used

    def completed(self, text: str) -> str:
        """The machine file's text with all of them."""
        new = {name: words for name, words in self._used.items() if name not in self._there}
        head = TAKEN_ALONG if new and TAKEN_ALONG not in text else ""
        tables = (
            f"\n[[file]]\nname = {toml_text(name)}\ntext = {toml_text(words)}\n"
            for name, words in new.items()
        )
        return "".join((text, head, *tables))

    def _of(self, table: Table, key: str, encoding: str) -> Source:
        name = table.text(key)
        if (found := self._taken(name, encoding)) is not None:
            return found
        if self._folder is None and _on_disk(SHIPPED, name) is None:
            return name
        if not self._whole and _on_disk(self._folder or SHIPPED, name) is None:
            raise Unread(name)
        return str(beside(self._folder or SHIPPED, name, table, key))

    def _taken(self, name: str, encoding: str) -> TextFile | None:
        """One that travels, with what it says; None for a shipped one, and where there is none."""
        place = normpath(name)
        if place not in self._there:
            path = self._folder / name if self._folder is not None else None
            if path is None or not path.is_file() or path.resolve().is_relative_to(SHIPPED):
                return None
            self._used[place] = self._used.get(place) or read_text(path, encoding)
        else:
            self._used[place] = self._there[place]
        return TextFile(place, self._used[place])


def _on_disk(folder: Path, name: str) -> Path | None:
    paths = (folder / name, SHIPPED / name, SHIPPED / "drives" / name)
    return next((path for path in paths if path.is_file()), None)


def toml_text(words: str) -> str:
    """A text in quotes, on one line for whatever reads lines."""
    plain = json.dumps(words, ensure_ascii=False)
    return re.sub(r"[^ -~]", lambda sign: f"\\U{ord(sign[0]):08X}", plain)
