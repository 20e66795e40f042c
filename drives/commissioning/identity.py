"""Who a node must be (1018h): by its data sheet, its profile, and the machine file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from drives.commissioning.sheet import Sheet
from drives.commissioning.wanted import Settings
from drives.settings import IoSettings, NodeSettings


@dataclass(frozen=True, slots=True)
class Word:
    """One word of the identity that is asked for, and who says so."""

    sub: int
    what: str
    wanted: int
    source: str

    def mismatch(self, found: int) -> str:
        """A sentence where another node answers; "" where it is the right one."""
        if found == self.wanted:
            return ""
        return (
            f"{self.what} (object 1018h:{self.sub:02X}) is {found:#x}, {self.source} says {self.wanted:#x};"
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
        if wanted := sheet.identity(sub):
            yield Word(sub, what, wanted, said)
        elif family:
            yield Word(sub, what, family, "its profile")
    if isinstance(settings, NodeSettings) and settings.serial:
        yield Word(4, "serial number", settings.serial, "the machine file")
