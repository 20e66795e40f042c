"""The journal as who only looks on finds it, also while a service writes it."""

from __future__ import annotations

from pathlib import Path

from controller.service import journal
from controller.store import service_store


def read(state: Path) -> journal.Entry | None:
    """None where there is none."""
    try:
        return journal.entry_of(service_store.document_of(state, journal.DOCUMENT))
    except FileNotFoundError:
        return None
