"""Whether the hot rooms of this installation are compiled (hatch_build.py), and of the present source."""

from __future__ import annotations

from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

ROOT = Path(__file__).parents[1]
GROUP = "directrix__mypyc"
PACKAGES = ("controller", "drives")


def is_compiled(root: Path = ROOT) -> bool:
    """Whether there is a library that this Python loads."""
    return _library(root) is not None


def outdated(root: Path = ROOT) -> Path | None:
    """A source that is newer than what was compiled of it and would not be run; None = there is none.

    Only a checkout can have one: what is installed as a whole is never edited.
    """
    library = _library(root)
    if library is None or not (root / "pyproject.toml").exists():
        return None
    made_s = library.stat().st_mtime
    sources = (
        made.parent / f"{made.name.partition('.')[0]}.py"
        for package in PACKAGES
        for depth in ("*", "*/*", "*/*/*")
        for made in (root / package).glob(f"{depth}{EXTENSION_SUFFIXES[0]}")
    )
    return next((source for source in sources if source.exists() and source.stat().st_mtime > made_s), None)


def _library(root: Path) -> Path | None:
    found = root / f"{GROUP}{EXTENSION_SUFFIXES[0]}"
    return found if found.exists() else None
