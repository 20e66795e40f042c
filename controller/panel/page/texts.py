"""The page's texts by language, each as one document that the page asks for."""

from __future__ import annotations

import json
from typing import Literal

from controller import catalogue
from controller.catalogue import page_english, page_german

Language = Literal["en", "de"]
PAGE: dict[Language, dict[str, str]] = {"en": page_english.TEXTS, "de": page_german.TEXTS}


def of(language: Language) -> dict[str, str]:
    """All texts by key, those of the faults among them: an alarm that is kept has only the English ones."""
    faults = {
        f"alarms.{part}.{fault.name}": text
        for fault, words in catalogue.of(language).faults.items()
        for part, text in (("cause", words.cause), ("remedy", words.remedy))
    }
    return {**PAGE[language], **faults}


def document(language: Language) -> bytes:
    """As JSON."""
    return json.dumps(of(language), ensure_ascii=False).encode()


def chosen(cookie: str, accepted: str) -> Language:
    """The language of a page: what was chosen before, else what the browser prefers."""
    for wanted in (cookie, *(part.split(";")[0].strip()[:2].lower() for part in accepted.split(","))):
        for language in PAGE:
            if wanted == language:
                return language
    return "en"
