"""A drive's data sheet (EDS or DCF, CiA 306-1) as canopen reads it, mended where it cannot.

Makers' files have empty numbers (``VendorNumber=``), sections that appear twice, entries
without a data type, another spelling of ``sub``, umlauts in Latin-1. What such a line wanted
to say is unknown, so it is left out; what remains must be readable, or the sheet is refused.
"""

from __future__ import annotations

import configparser
import contextlib
import io
import logging
import pickle
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import canopen
from canopen.objectdictionary import ObjectDictionary, ODVariable

from drives import sheet_text
from drives.commissioning import overrides
from drives.profile import Override
from drives.text_file import Source, text_of
from drives.texts import Message, TextError, message

# What canopen would log, of data sheets as of drives, is raised as well or mended, and told in a sentence.
logging.getLogger("canopen").setLevel(logging.CRITICAL)

SECTION = re.compile(r"([0-9A-Fa-f]{4})(?:sub([0-9A-Fa-f]+))?", re.IGNORECASE)
VARIABLE, DOMAIN = 0x7, 0x2
# As canopen wants them written; CiA 306-1 does not care for case.
KEYS = {
    name.lower(): name
    for name in (
        "DeviceInfo",
        "FileInfo",
        "DummyUsage",
        "ParameterName",
        "ObjectType",
        "DataType",
        "AccessType",
        "PDOMapping",
        "LowLimit",
        "HighLimit",
        "DefaultValue",
        "ParameterValue",
        "CompactSubObj",
        "VendorNumber",
        "ProductNumber",
        "RevisionNumber",
        *(f"BaudRate_{rate}" for rate in (10, 20, 50, 125, 250, 500, 800, 1000)),
    )
}
UNSIGNED8 = "0x0005"
DUMMIES = tuple(f"Dummy{i:04d}" for i in range(1, 8))
MANY = 254  # most sub-indices of an object
NO_REMOTE = 0x4000_0000  # COB-ID bit 30: no remote frames for this TPDO

# CiA 301 data types: bits and sign.
INTEGERS = {
    0x01: (1, False),
    0x02: (8, True),
    0x03: (16, True),
    0x04: (32, True),
    0x05: (8, False),
    0x06: (16, False),
    0x07: (32, False),
    0x15: (64, True),
    0x1B: (64, False),
}


class SheetError(TextError):
    """A data sheet is not there or cannot be read; which, why, what to do."""


class Sheet:
    """What a data sheet says about objects."""

    def __init__(
        self, name: str, dictionary: canopen.ObjectDictionary, overridden: tuple[Message, ...] = ()
    ) -> None:
        self.name = name
        self.dictionary = dictionary
        self.overridden = overridden  # for everything that the drive is believed instead

    def find(self, index: int, sub: int = 0) -> ODVariable | None:
        """The entry; exactly this one, while canopen makes up members of arrays."""
        found = self.dictionary.indices.get(index)
        if isinstance(found, ODVariable):
            return found if sub == 0 else None
        return None if found is None else found.subindices.get(sub)

    def has(self, index: int, sub: int = 0) -> bool:
        return self.find(index, sub) is not None

    def holds(self, index: int) -> bool:
        """Whether there is anything under this index."""
        return index in self.dictionary.indices

    def writable(self, index: int, sub: int = 0) -> bool:
        found = self.find(index, sub)
        return found is not None and found.writable

    def default(self, index: int, sub: int = 0) -> int | None:
        """As after power-on; None where the sheet does not say it."""
        found = self.find(index, sub)
        if found is None or not isinstance(found.default, int):
            return None
        bits, signed = INTEGERS.get(found.data_type or 0, (64, False))
        # "-1" is written as 0xFFFFFFFF as well.
        return found.default - (1 << bits) if signed and found.default >> (bits - 1) == 1 else found.default

    def identities(self, sub: int) -> tuple[int, ...]:
        """1018h:01 to :03 as the head of the sheet says it and as the object does; none, one or two."""
        about = self.dictionary.device_information
        head = (about.vendor_number, about.product_number, about.revision_number)[sub - 1]
        return tuple(dict.fromkeys(word for word in (head, self.default(0x1018, sub)) if word))

    def identity(self, sub: int) -> int | None:
        """1018h:01 to :03, the head's word before the object's."""
        return next(iter(self.identities(sub)), None)

    @property
    def homing_methods(self) -> tuple[int, ...]:
        """Those that 60E3h lists, where the sheet fills it in; some write them as unsigned."""
        listed = (self.default(0x60E3, sub) for sub in self.subs(0x60E3))
        return tuple((method + 128) % 256 - 128 for method in listed if method)

    def subs(self, index: int) -> list[int]:
        """The sub-indices of an object but 0."""
        found = self.dictionary.indices.get(index)
        return [] if found is None or isinstance(found, ODVariable) else sorted(set(found.subindices) - {0})


class Named(Protocol):
    """What any kind of node's settings tell of it."""

    @property
    def node(self) -> int: ...

    @property
    def eds(self) -> Source: ...


def of(settings: Named) -> Sheet:
    """The data sheet of a node, with what its profile and the machine file know better. Raises SheetError."""
    return load(settings.eds, settings.node, known_of(settings))


def known_of(settings: Named) -> tuple[Override, ...]:
    """Where the data sheet of a node is wrong, by its profile and by the machine file."""
    family = getattr(settings, "profile", None)
    return (*(family.overrides if family else ()), *getattr(settings, "overrides", ()))


@lru_cache(maxsize=64)
def load(path: Source, node: int, known: tuple[Override, ...] = ()) -> Sheet:
    """The data sheet of a file, for a node id ("$NODEID"), overridden. Raises SheetError."""
    return own(path, node, known)


def own(path: Source, node: int, known: tuple[Override, ...] = ()) -> Sheet:
    """As ``load``, and nobody else's: it may be changed. Raises SheetError."""
    return overridden(_read(_mended(path), Path(path).name, node), known)


def overridden(sheet: Sheet, known: tuple[Override, ...]) -> Sheet:
    """The sheet with other words in it; the one that is given is changed, too."""
    sentences = overrides.apply(sheet.dictionary, known, sheet.name)
    return Sheet(sheet.name, sheet.dictionary, (*sheet.overridden, *sentences))


@lru_cache(maxsize=16)
def _mended(path: Source) -> str:
    """The text of a file; once for all drives that have this sheet."""
    try:
        text = text_of(path)
    except OSError as error:
        raise SheetError(message("sheet.unreadable", path=path, why=error)) from error
    with _refusals(Path(path).name):
        return cleaned(text)


def read(text: str, name: str, node: int = 1) -> Sheet:
    """The data sheet of a text. Raises SheetError."""
    with _refusals(name):
        mended = cleaned(text)
    return _read(mended, name, node)


def _read(mended: str, name: str, node: int) -> Sheet:
    with _refusals(name):
        packed: tuple[ObjectDictionary, list[tuple[ODVariable, str]]] = pickle.loads(_imported(mended))
    dictionary, relative = packed
    for variable, what in relative:
        setattr(variable, what, getattr(variable, what) + node)
    return Sheet(name, dictionary)


@lru_cache(maxsize=16)
def _imported(mended: str) -> bytes:
    """The dictionary for node 0, and what of it is relative to the node id, once for all drives of a sheet.

    Packed, for each may change its own.
    """
    source = io.StringIO(mended)
    source.name = "sheet.eds"  # canopen looks at the suffix
    dictionary = canopen.import_od(source, 0)
    entries = dictionary.indices.values()
    groups = ([entry] if isinstance(entry, ODVariable) else entry.subindices.values() for entry in entries)
    relative = [(variable, what) for group in groups for variable in group for what in _relative(variable)]
    return pickle.dumps((dictionary, relative), pickle.HIGHEST_PROTOCOL)


def _relative(variable: ODVariable) -> Iterator[str]:
    """Attributes that are relative to the node id ("$NODEID+0x200") in an entry that was read for node 0."""
    for written, read in (("default_raw", "default"), ("value_raw", "value")):
        text = getattr(variable, written, "")
        if isinstance(getattr(variable, read), int) and "$NODEID" in text.upper().replace(" ", ""):
            yield read


@contextlib.contextmanager
def _refusals(name: str) -> Iterator[None]:
    """Whatever a parser says of a file that is none of its kind, in one sentence."""
    try:
        yield
    except (
        sheet_text.LineError,
        *(configparser.Error, canopen.ObjectDictionaryError, ValueError, KeyError, TypeError),
    ) as error:
        own = error.said if isinstance(error, TextError) else " ".join(str(error).split())
        raise SheetError(message("sheet.no_eds", name=name, reason=own)) from error


def cleaned(text: str) -> str:
    """The text without what canopen cannot read. Raises sheet_text.LineError."""
    kept: sheet_text.Sections = {}
    for section, values in sheet_text.sections(text).items():
        written = {KEYS.get(key.lower(), key): value for key, value in values.items() if value}
        _keep(kept, KEYS.get(section.lower(), section), written)
    kept.setdefault("DeviceInfo", {})
    if not any(SECTION.fullmatch(section) for section in kept):
        raise sheet_text.LineError(message("sheet.no_objects"))
    return sheet_text.written(kept)


def _keep(kept: sheet_text.Sections, section: str, values: dict[str, str]) -> None:
    """One section, as canopen wants it; nothing of a section that says too little."""
    match = SECTION.fullmatch(section)
    if match is not None:
        _keep_object(kept, match.group(1).upper(), match.group(2), values)
    elif section == "DummyUsage":
        kept["DummyUsage"] = {dummy: values.get(dummy, "0") for dummy in DUMMIES}
    elif section in ("DeviceInfo", "FileInfo"):
        kept[section] = {key: value for key, value in values.items() if _sound(key, value)}


def _sound(key: str, value: str) -> bool:
    """Texts may hold anything; numbers must be numbers."""
    if key.endswith(("Name", "OrderCode")) or key in ("CreatedBy", "Description", "ModifiedBy"):
        return True
    return not key.startswith(
        ("BaudRate", "VendorNumber", "ProductNumber", "Revision", "NrOf")
    ) or _is_number(value)


def _is_number(text: str) -> bool:
    try:
        int(text, 0)
    except ValueError:
        return False
    return True


def _keep_object(kept: sheet_text.Sections, index: str, sub: str | None, values: dict[str, str]) -> None:
    section = index if sub is None else f"{index}sub{int(sub, 16):X}"
    values.setdefault("ParameterName", section)
    kind = values.get("ObjectType", "0x7")
    if not _is_number(kind) or (sub is not None and index not in kept):
        return
    single = sub is not None or int(kind, 0) in (VARIABLE, DOMAIN)
    if single and not _is_number(values.get("DataType", "")):
        return
    count = values.pop("CompactSubObj", "")
    if not single and _is_number(count) and int(count, 0) > 0:
        _expand(kept, section, values, min(int(count, 0), MANY))
        return
    if single:
        values.setdefault("AccessType", "ro")
        if not _is_number(values.get("PDOMapping", "0")):
            values.pop("PDOMapping")
    kept[section] = values


def _expand(kept: sheet_text.Sections, index: str, values: dict[str, str], count: int) -> None:
    """An object that says ``CompactSubObj``: so many members like this one, and their number in sub 0."""
    kept[index] = {"ParameterName": values["ParameterName"], "ObjectType": values["ObjectType"]}
    number = {"DataType": UNSIGNED8, "AccessType": "ro", "DefaultValue": str(count)}
    kept[f"{index}sub0"] = {"ParameterName": "Number of entries", **number}
    member = {key: value for key, value in values.items() if key != "ObjectType"}
    member.setdefault("AccessType", "ro")
    for sub in range(1, count + 1):
        kept[f"{index}sub{sub:X}"] = member


def range_of(found: ODVariable) -> tuple[int | None, int | None]:
    """What the type holds, narrowed by the limits; zeros, or turned round, were not meant."""
    if found.data_type not in INTEGERS:
        return None, None
    bits, signed = INTEGERS[found.data_type]
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if found.min == found.max == 0 or (found.min or least) > (most if found.max is None else found.max):
        return least, most
    return max(least, least if found.min is None else found.min), min(
        most, most if found.max is None else found.max
    )
