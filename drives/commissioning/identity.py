"""Who a node must be (1018h): by its data sheet, its profile, and the machine file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from drives.commissioning.sheet import Sheet
from drives.commissioning.wanted import Settings
from drives.settings import IoSettings, NodeSettings
from drives.values import dataclass


@dataclass(frozen=True, slots=True)
class Word:
    """One word of the identity that is asked for, and who says so."""

    sub: int
    what: str
    wanted: tuple[int, ...]  # any of these: a sheet may contradict itself
    source: str

    def mismatch(self, found: int) -> str:
        """A sentence where another node answers; "" where it is the right one."""
        if found in self.wanted:
            return ""
        wanted = " or ".join(f"{word:#x}" for word in self.wanted)
        return (
            f"{self.what} (object 1018h:{self.sub:02X}) is {found:#x}, {self.source} says {wanted};"
            " check node id and data sheet"
        )


def words_of(settings: Settings, sheet: Sheet) -> Iterator[Word]:
    """Vendor, product code and serial number, as far as anybody says them."""
    profile = None if isinstance(settings, IoSettings) else settings.profile
    said = f"its data sheet {settings.eds}"
    for sub, what, family in (
        (1, "vendor", profile.vendor if profile else None),
        (2, "product code", profile.product if profile else None),
    ):
        if wanted := sheet.identities(sub):
            yield Word(sub, what, wanted, said)
        elif family:
            yield Word(sub, what, (family,), "its profile")
    if isinstance(settings, NodeSettings) and settings.serial:
        yield Word(4, "serial number", (settings.serial,), "the machine file")


def contradictions(sheet: Sheet, found: Mapping[int, int] | None = None) -> Iterator[str]:
    """A sentence for each word that the head of a sheet and its object 1018h say differently.

    ``found``: what the drive says, by sub-index.
    """
    for sub, what in ((1, "vendor"), (2, "product code")):
        words = sheet.identities(sub)
        if len(words) > 1:
            drives = f"; the drive says {found[sub]:#x}" if found and sub in found else "; either is accepted"
            head, entry = (f"{word:#x}" for word in words)
            yield (
                f"{what} (object 1018h:{sub:02X}): {sheet.name} says {head} in its head and {entry} in the"
                f" object{drives}"
            )
