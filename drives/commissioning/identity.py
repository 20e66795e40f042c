"""Who a node must be (1018h): by its data sheet, its profile, and the machine file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from drives.commissioning.sheet import Sheet
from drives.commissioning.wanted import Settings
from drives.settings import IoSettings, NodeSettings
from drives.texts import Key, Message, chain, message


@dataclass(frozen=True, slots=True)
class Word:
    """One word of the identity that is asked for, and who says so."""

    sub: int
    wanted: tuple[int, ...]  # any of these: a sheet may contradict itself
    source: Message

    def mismatch(self, found: int) -> Message | None:
        """What is to be said where another node answers; None where it is the right one."""
        if found in self.wanted:
            return None
        wanted = chain("or", [f"{word:#x}" for word in self.wanted])
        return message("identity.other", **named(self.sub), found=found, source=self.source, wanted=wanted)


def named(sub: int) -> dict[str, object]:
    """A word of 1018h as texts have places for it."""
    return {"what": Key(f"identity.{sub}"), "sub": sub}


def words_of(settings: Settings, sheet: Sheet) -> Iterator[Word]:
    """Vendor, product code and serial number, as far as anybody says them."""
    profile = None if isinstance(settings, IoSettings) else settings.profile
    sheets = message("identity.by_sheet", eds=settings.eds)
    for sub, family in ((1, profile.vendor if profile else None), (2, profile.product if profile else None)):
        if wanted := sheet.identities(sub):
            yield Word(sub, wanted, sheets)
        elif family:
            yield Word(sub, (family,), message("identity.by_profile"))
    if isinstance(settings, NodeSettings) and settings.serial:
        yield Word(4, (settings.serial,), message("identity.by_file"))


def contradictions(sheet: Sheet, found: Mapping[int, int] | None = None) -> Iterator[Message]:
    """What is to be said of each word that the head of a sheet and its object 1018h have differently.

    ``found``: what the drive says, by sub-index.
    """
    for sub in (1, 2):
        words = sheet.identities(sub)
        if len(words) > 1:
            head, entry = (f"{word:#x}" for word in words)
            facts = {**named(sub), "sheet": sheet.name, "head": head, "entry": entry}
            if found and sub in found:
                yield message("identity.contradiction_judged", **facts, drives=f"{found[sub]:#x}")
            else:
                yield message("identity.contradiction", **facts)
