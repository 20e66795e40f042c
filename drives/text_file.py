"""A file that travels as its text: data sheets and profiles that a machine file names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class TextFile:
    """A file whose text is at hand, wherever it was. As a path it is its name, which sentences show."""

    name: str  # as seen from the machine file
    text: str
    sheet: TextFile | None = None  # that it names itself: a profile's

    def __fspath__(self) -> str:
        return self.name

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        return f"TextFile({self.name!r}, {len(self.text)} characters)"


Source = str | Path | TextFile


def text_of(source: Source) -> str:
    """The text of a data sheet (Latin-1, CiA 306-1), with its line ends as they are. Raises OSError."""
    return source.text if isinstance(source, TextFile) else Path(source).read_bytes().decode("latin-1")
