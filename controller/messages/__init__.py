"""Every text that an operator reads, by language; and how a text travels.

What is reported is a key with its values (``Message``): through the shared state, the service's socket and
the store, in no language. Who shows it puts it in words of a language (``text``, ``with_sentences``).

A language is one file of this folder, ``<code>.json``: key -> text, a line each, sorted by key. Nothing
else names the languages. What a file lacks is read in English, so that a translation may lag. All files are
read at the start, so that none can be missing at the moment when something has gone wrong. Of a key, the
part before the first dot says where the text belongs:

- ``language``: the language, in itself;
- ``page.``: the page's own; {0} ... are filled in by the page;
- ``fault.``, ``cause.``, ``remedy.`` with a fault's name: what happened, where that usually comes from, what
  to do (what the machine does about it is in ``fault_table``);
- ``class.``, ``recovery.``, ``faults.``: the table of faults: reactions, steps out, its frame;
- any other: what a ``Message`` may name, with {placeholders} by name.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from drives import texts
from drives.texts import (
    FOLDER,
    Key,
    Message,
    TextError,
    chain,
    is_message,
    message,
    of_error,
    once,
    plain,
    reason,
    several,
)

__all__ = [
    "FOLDER",
    "Key",
    "Message",
    "TextError",
    "chain",
    "is_message",
    "message",
    "of_error",
    "once",
    "plain",
    "reason",
    "several",
]

DEFAULT = "en"
_PAGE = "page."


class Catalogue(NamedTuple):
    """All texts of one language. ``name``: of the language, in itself; ``page``: the page's own, their keys
    without ``page.``.
    """

    name: str
    texts: dict[str, str]
    page: dict[str, str]


def languages(folder: Path = FOLDER) -> dict[str, Catalogue]:
    """The language of every file of a folder by its code, English first. Raises OSError, and ValueError that
    names the file, its line and column.
    """
    english = texts.english_texts() if folder == FOLDER else texts.read(folder / f"{DEFAULT}.json")
    codes = sorted({file.stem for file in folder.glob("*.json")} - {DEFAULT})
    found = {DEFAULT: english, **{code: {**english, **texts.read(folder / f"{code}.json")} for code in codes}}
    return {code: _catalogue(texts) for code, texts in found.items()}


def _catalogue(texts: Mapping[str, str]) -> Catalogue:
    own, page = {}, {}
    for key, text in texts.items():
        if key.startswith(_PAGE):
            page[key[len(_PAGE) :]] = text
        else:
            own[key] = text
    return Catalogue(texts["language"], own, page)


LANGUAGES = languages()


def of(language: str) -> Catalogue:
    """The texts of a language, for instance of 'en'. Raises ValueError with a sentence."""
    if language in LANGUAGES:
        return LANGUAGES[language]
    raise ValueError(
        f"language {language!r}: there are no texts in it; allowed are {' and '.join(LANGUAGES)}; "
        "choose one of these."
    )


def chosen(*wanted: str) -> str:
    """The first language of which there are texts; English where there is none.

    Each of ``wanted`` is a code, or an Accept-Language header: "fr, de-CH;q=0.9, en;q=0.8" is 'de'.
    """
    for header in wanted:
        ranked = sorted(map(_ranked, header.split(",")), key=lambda one: -one[0])
        for language in (code for weight, code in ranked if weight > 0.0):
            if language in LANGUAGES:
                return language
    return DEFAULT


def _ranked(part: str) -> tuple[float, str]:
    """Weight and language of one part of an Accept-Language header."""
    code, _, weight = part.replace(" ", "").partition(";q=")
    try:
        return float(weight or 1.0), code.split("-")[0].lower()
    except ValueError:
        return 0.0, ""


# ---- in words


def text(said: Mapping[str, Any] | None, language: str = DEFAULT) -> str:
    """In words; what was kept as a ``sentence`` alone, before keys were, is that. "" where there is neither.

    Raises ValueError for a language that there is not.
    """
    if said and said.get("key"):
        return texts.filled(said, of(language).texts)
    return str((said or {}).get("sentence") or "")


def from_facts(facts: Mapping[str, Any]) -> Message | None:
    """The message that ``facts`` has made facts of; None where there is none."""
    return Message(key=facts["key"], values=facts["values"] or {}) if facts.get("key") else None


def facts(said: Message | None) -> dict[str, Any]:
    """Key and values as facts of something else; both are null where there is nothing to be said."""
    return dict(said) if said else {"key": None, "values": None}


_LEAVES = (str, int, float, type(None))  # of a tree: most of it


def with_sentences(tree: Any, language: str = DEFAULT) -> Any:
    """JSON values with the ``sentence`` of every text in them, beside its key and values."""
    if isinstance(tree, _LEAVES):
        return tree
    if isinstance(tree, Mapping):
        own = {"sentence": text(tree, language) or None} if is_message(tree) else {}
        kept = {
            name: one
            if isinstance(one, _LEAVES) or (own and name == "values")
            else with_sentences(one, language)
            for name, one in tree.items()
        }
        return {**kept, **own}
    if isinstance(tree, list | tuple):
        return [one if isinstance(one, _LEAVES) else with_sentences(one, language) for one in tree]
    return tree
