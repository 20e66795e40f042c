"""What the operator reads about faults, by language; each text stands here once.

A fault has the same three sentences in every language: what happened, where that usually
comes from, what to do. What the machine does about it is no matter of language and stands
in ``fault_table``. Plain values in plain modules, so that no file can be missing at the
moment when something has gone wrong. Refusals, which are no faults, stand beside them by a key
each, as sentences or parts of one with {placeholders}.
"""

from __future__ import annotations

from typing import NamedTuple

from controller.catalogue import (
    english,
    form_english,
    form_german,
    german,
    panel_english,
    panel_german,
)
from controller.faults import Fault, Reaction, Recovery, Words


class Catalogue(NamedTuple):
    """All texts of one language. ``frames``: what is put round them; both it and ``refusals`` with
    {placeholders}."""

    faults: dict[Fault, Words]
    classes: dict[Reaction, str]
    recoveries: dict[Recovery, str]
    frames: dict[str, str]
    refusals: dict[str, str]


LANGUAGES: dict[str, Catalogue] = {
    module.LANGUAGE: Catalogue(
        module.FAULTS,
        module.CLASSES,
        module.RECOVERIES,
        module.FRAMES,
        {**module.REFUSALS, **panel.REFUSALS, **form.REFUSALS},
    )
    for module, panel, form in (
        (english, panel_english, form_english),
        (german, panel_german, form_german),
    )
}


class Key(str):
    """A value of a refusal that is itself a text of the refusals, for instance what was waited for.

    Its places are filled with the other values.
    """


def of(language: str) -> Catalogue:
    """The texts of a language, for instance of 'en'. Raises ValueError with a sentence."""
    if language in LANGUAGES:
        return LANGUAGES[language]
    raise ValueError(
        f"language {language!r}: there are no texts in it; allowed are {' and '.join(LANGUAGES)}; "
        "choose one of these."
    )


def refusal(key: str, language: str = "en", **values: object) -> str:
    """The text of a refusal. Raises ValueError where the catalogue has no such language."""
    said = of(language).refusals
    if "why" in values and not str(values["why"] or "").strip():  # an OSError may have no words, for one
        values["why"] = Key("no_why")
    plain = {name: value for name, value in values.items() if not isinstance(value, Key)}
    keys = {name: said[value].format(**plain) for name, value in values.items() if isinstance(value, Key)}
    return said[key].format(**plain, **keys)


def in_both(key: str, **values: object) -> tuple[str, str]:
    """The text of a refusal in English and in German."""
    return refusal(key, "en", **values), refusal(key, "de", **values)
