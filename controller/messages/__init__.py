"""Every text that an operator reads, by language; and how a text travels.

What is reported is a key with its values (``Said``): through the shared state, the service's socket and the
store, in no language. Who shows it asks for the words in the reader's language (``text``, ``told``).

A language is one file of this folder, ``<code>.json``: key -> text, a line each, sorted by key. Nothing
else names the languages. What a file lacks is read in English, so that a translation may lag. All files are
read at the start, so that none can be missing at the moment when something has gone wrong. Of a key, the
part before the first dot says where the text belongs:

- ``language``: the language, in itself;
- ``page.``: the page's own; {0} ... are filled in by the page;
- ``fault.``, ``cause.``, ``remedy.`` with a fault's name: what happened, where that usually comes from, what
  to do (what the machine does about it is in ``fault_table``);
- ``class.``, ``recovery.``, ``faults.``: the table of faults: reactions, steps out, its frame;
- any other: what a ``Said`` may name, with {placeholders} by name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

DEFAULT = "en"
FOLDER = Path(__file__).parent
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
    english = _read(folder / f"{DEFAULT}.json")
    codes = sorted({file.stem for file in folder.glob("*.json")} - {DEFAULT})
    found = {DEFAULT: english, **{code: {**english, **_read(folder / f"{code}.json")} for code in codes}}
    return {code: _catalogue(texts) for code, texts in found.items()}


def _read(file: Path) -> dict[str, str]:
    try:
        texts: dict[str, str] = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: {error}; a file of texts is a JSON object of key and text.") from error
    return texts


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


# ---- how a text travels


class Said(TypedDict):
    """A text in no language. A value is plain JSON, another ``Said``, or a list of them, which are read
    one after the other; a text among the values may use the values beside it.
    """

    key: str
    values: dict[str, Any]


class Key(str):
    """A value that is itself a text, by its key, for instance what was waited for."""


def said(key: str, /, **values: object) -> Said:
    """The text of a key, with what it has places for."""
    if "why" in values and not str(values["why"] or "").strip():  # an OSError may have no words, for one
        values["why"] = Key("no_why")
    return Said(key=key, values={name: _value(value) for name, value in values.items()})


def plain(sentence: Said | str) -> Said:
    """Also of what is known as a sentence only, of a program's reader for one."""
    return said("text", text=sentence) if isinstance(sentence, str) else sentence


def of_error(error: BaseException) -> Said:
    """What an error says: its own text, with its place where it has one; else its words."""
    own: Said | None = getattr(error, "placed", None) or getattr(error, "said", None)
    return own or plain(str(error))


class TextError(Exception):
    """An error that is a text: ``said``; in words it is English, for logs."""

    def __init__(self, what: Said | str) -> None:
        """``what``: a sentence alone where it has no key."""
        self.said = plain(what)
        super().__init__(text(self.said))


def several(*texts: Said | str) -> Said:
    """One after the other, without those that are empty."""
    return said("text", text=[plain(one) for one in texts if one])


def chain(link: str, texts: Sequence[Said | str]) -> Said | str:
    """Several as one: ``link`` is "and" or "or"; each is a key or plain words."""
    last: Said | str = texts[-1]
    for one in texts[-2::-1]:
        last = said(link, one=one, other=last)
    return last


def _value(value: object) -> Any:
    if isinstance(value, Key):
        return Said(key=str(value), values={})
    if isinstance(value, list | tuple):
        return [_value(one) for one in value]
    own: Said | None = getattr(value, "said", None) if isinstance(value, BaseException) else None
    return value if isinstance(value, str | int | float | dict | None) else own or str(value)


def _is_said(value: object) -> bool:
    return isinstance(value, Mapping) and "key" in value and "values" in value


def text(said: Mapping[str, Any] | None, language: str = DEFAULT) -> str:
    """In words; what was kept as a ``sentence`` alone, before keys were, is that. "" where there is neither.

    Raises ValueError for a language that there is not.
    """
    if said and said.get("key"):
        return _filled(said, of(language).texts, {})
    return str((said or {}).get("sentence") or "")


def kept(facts: Mapping[str, Any]) -> Said | None:
    """What ``facts`` has made facts of; None where nothing is said."""
    return Said(key=facts["key"], values=facts["values"] or {}) if facts.get("key") else None


def facts(said: Said | None) -> dict[str, Any]:
    """Key and values as facts of something else; both are null where there is nothing to be said."""
    return dict(said) if said else {"key": None, "values": None}


def _filled(said: Mapping[str, Any], texts: Mapping[str, str], around: Mapping[str, Any]) -> str:
    """A key of another version, and values that do not fit it, are shown as they are: it must not fail."""

    def words(value: Any) -> Any:
        if _is_said(value):
            return _filled(value, texts, figures)
        return " ".join(map(words, value)) if isinstance(value, list) and all(map(_is_said, value)) else value

    key, values = str(said["key"]), {**around, **(said["values"] or {})}
    figures = {name: value for name, value in values.items() if isinstance(value, str | int | float)}
    try:
        return texts[key].format(**{name: words(value) for name, value in values.items()})
    except (KeyError, ValueError, IndexError, TypeError):
        return f"{key} {figures}"


_LEAVES = (str, int, float, type(None))  # of a tree: most of it


def told(tree: Any, language: str = DEFAULT) -> Any:
    """JSON values with the ``sentence`` of every text in them, beside its key and values."""
    if isinstance(tree, _LEAVES):
        return tree
    if isinstance(tree, Mapping):
        own = {"sentence": text(tree, language) or None} if _is_said(tree) else {}
        kept = {
            name: one if isinstance(one, _LEAVES) or (own and name == "values") else told(one, language)
            for name, one in tree.items()
        }
        return {**kept, **own}
    if isinstance(tree, list | tuple):
        return [one if isinstance(one, _LEAVES) else told(one, language) for one in tree]
    return tree
