"""The page's texts by language, each as one document that the page asks for."""

from __future__ import annotations

import json

from controller import messages


def of(language: str) -> dict[str, str]:
    """All texts by key, with the causes and remedies of faults; and the languages that there are, by code."""
    said = messages.of(language)
    faults = {
        f"alarms.{key}": text for key, text in said.texts.items() if key.startswith(("cause.", "remedy."))
    }
    names = {f"language.{code}": one.name for code, one in messages.LANGUAGES.items()}
    return {**said.page, **faults, **names}


def document(language: str) -> bytes:
    """As JSON."""
    return json.dumps(of(language), ensure_ascii=False).encode()
