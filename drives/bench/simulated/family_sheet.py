"""The electronic data sheet of a simulated drive of a family, where its maker's own is not at hand.

Made from the simulated drive's sheet: objects that the family lacks are left out, who it is
comes from the profile, and so does the object that holds the position at the homed point.
What a sheet cannot say (steps of the period, homing methods) ``families.restrict`` adds.
"""

from __future__ import annotations

import re
from pathlib import Path

from drives.bench.simulated.data_sheet import EDS
from drives.bench.simulated.families import missing, supported_modes
from drives.profile import Profile

LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
MANUFACTURERS = range(0x2000, 0x6000)
OBJECT = re.compile(r"([0-9A-F]{4})(?:sub([0-9A-F]+))?$")
HOME = 0x607C

Sections = dict[str, list[str]]  # lines by name


def text(profile: Profile, bare: bool = False, source: Path = EDS) -> str:
    """The sheet as text. ``bare``: without what the profile calls optional. Raises OSError."""
    sections = _read(source.read_text(encoding="latin-1"))
    if profile.home_offset is not None and profile.home_offset != HOME:
        sections[f"{profile.home_offset:04X}"] = list(sections[f"{HOME:04X}"])
    away = missing(profile) | (set(profile.optional) if bare else set())
    if profile.home_offset != HOME:
        away.add(HOME)
    made = {name: lines for name, lines in sections.items() if _index(name) not in away}
    _identify(made, profile)
    if "6502" in made:
        _set(made, "6502", "DefaultValue", f"0x{supported_modes(profile):08X}")
    _list(made)
    return "\n".join(line for name, lines in made.items() for line in (f"[{name}]", *lines, "")) + "\n"


def write(path: Path, profile: Profile, bare: bool = False) -> Path:
    """Write the sheet to a file. Raises OSError."""
    path.write_text(text(profile, bare), encoding="latin-1")
    return path


def _read(source: str) -> Sections:
    sections: Sections = {}
    for line in source.splitlines():
        if line.startswith("["):
            sections[line.strip("[]")] = []
        elif line and sections:
            next(reversed(sections.values())).append(line)
    return sections


def _index(name: str) -> int:
    """The object a section belongs to; -1 = to none."""
    found = OBJECT.match(name)
    return int(found[1], 16) if found else -1


def _set(sections: Sections, name: str, entry: str, value: str) -> None:
    lines = [line for line in sections[name] if not line.startswith(f"{entry}=")]
    sections[name] = [*lines, f"{entry}={value}"]


def _identify(sections: Sections, profile: Profile) -> None:
    for sub, entry, said in (
        (1, "VendorNumber", profile.vendor),
        (2, "ProductNumber", profile.product),
    ):
        if said is not None:
            _set(sections, "DeviceInfo", entry, f"0x{said:08X}")
            _set(sections, f"1018sub{sub}", "DefaultValue", f"0x{said:08X}")
    _set(sections, "DeviceInfo", "ProductName", f"Simulated drive of the family {profile.name}")


def _list(sections: Sections) -> None:
    """The lists of objects name those that are there."""
    there = sorted({_index(name) for name in sections} - {-1})
    mandatory = [0x1000, 0x1001, 0x1018]
    makers = [index for index in there if index in MANUFACTURERS]
    others = [index for index in there if index not in mandatory and index not in makers]
    for name, indexes in zip(LISTS, (mandatory, others, makers), strict=True):
        named = [f"{n}=0x{index:04X}" for n, index in enumerate(indexes, 1)]
        sections[name] = [f"SupportedObjects={len(indexes)}", *named]
