"""A drive's set-up as a file: DCF (CiA 306-1), its data sheet with a ParameterValue for everything set."""

from __future__ import annotations

import configparser
import time
from collections.abc import Mapping
from pathlib import Path

from drives import sheet_text
from drives.commissioning import sheet
from drives.commissioning.dictionary import (
    ARRAY,
    DUMMIES,
    RATES,
    RECORD,
    VARIABLE,
    DeviceInformation,
    Dictionary,
    Group,
    Value,
    Variable,
    variables,
)
from drives.commissioning.sheet import INTEGERS, SheetError
from drives.values import dataclass

Place = tuple[int, int]  # index, sub-index

HEADS = ("DeviceComissioning", "DeviceCommissioning")  # CiA 306 writes it with one m; people with two
NO_VALUE = "it has no ParameterValue, so it is a data sheet and no set-up; name a file that save has written"
MANDATORY, MAKERS = (0x1000, 0x1001, 0x1018), range(0x2000, 0x6000)


@dataclass(frozen=True, slots=True)
class Kept:
    """What a file says; ``node`` None = it does not say of which node id it is."""

    name: str
    node: int | None
    vendor: tuple[int, ...]
    product: tuple[int, ...]
    values: dict[Place, Value]


def written(about: sheet.Sheet, node: int, bit_rate: int, values: Mapping[Place, Value], file: str) -> str:
    """The text of a DCF. ``bit_rate`` (bit/s) 0 = unsaid."""
    dictionary = about.dictionary
    made: sheet_text.Sections = {
        "FileInfo": _file_info(about.name, node, file),
        "DeviceInfo": _head(dictionary.device_information),
        HEADS[0]: {**({"Baudrate": str(bit_rate // 1000)} if bit_rate else {}), "NodeID": str(node)},
        "Comments": {"Lines": "0"},
        "DummyUsage": {dummy: str(int(dummy in dictionary.dummies)) for dummy in DUMMIES},
        **_lists(dictionary),
    }
    for index in sorted(dictionary.indices):
        found = dictionary.indices[index]
        if isinstance(found, Group):
            made[f"{index:04X}"] = {
                "ParameterName": found.name,
                "SubNumber": f"0x{len(found.subindices):X}",
                "ObjectType": f"0x{ARRAY if found.is_array else RECORD:X}",
            }
        for entry in [found] if isinstance(found, Variable) else found.subindices.values():
            section = f"{index:04X}sub{entry.subindex:X}" if entry.group else f"{index:04X}"
            made[section] = _entry(entry, values.get((index, entry.subindex)))
    return sheet_text.written(made)


def _file_info(sheet_name: str, node: int, file: str) -> dict[str, str]:
    now = time.localtime()
    date, clock = time.strftime("%m-%d-%Y", now), time.strftime("%I:%M%p", now)
    return {
        "FileName": Path(file).name,
        "FileVersion": "1",
        "FileRevision": "1",
        "LastEDS": sheet_name,
        "EDSVersion": "4.0",
        "Description": f"Set-up of node {node}",
        "CreationDate": date,
        "CreationTime": clock,
        "CreatedBy": "Directrix",
        "ModificationDate": date,
        "ModificationTime": clock,
        "ModifiedBy": "Directrix",
    }


def _head(about: DeviceInformation) -> dict[str, str]:
    numbers = {
        "VendorNumber": about.vendor_number,
        "ProductNumber": about.product_number,
        "RevisionNumber": about.revision_number,
    }
    said = {key: f"0x{number:X}" for key, number in numbers.items() if number is not None}
    rates = {f"BaudRate_{rate}": str(int(1000 * rate in about.allowed_baudrates)) for rate in RATES}
    return {**about.texts, **said, **rates}


def _lists(dictionary: Dictionary) -> sheet_text.Sections:
    """Which objects there are, in the standard's three lists."""
    there = sorted(dictionary.indices)
    lists = {
        "MandatoryObjects": [index for index in there if index in MANDATORY],
        "OptionalObjects": [i for i in there if i >= 0x1000 and i not in MANDATORY and i not in MAKERS],
        "ManufacturerObjects": [index for index in there if index in MAKERS],
    }
    return {
        name: {
            "SupportedObjects": str(len(listed)),
            **{str(n): f"0x{index:04X}" for n, index in enumerate(listed, 1)},
        }
        for name, listed in lists.items()
    }


def _entry(entry: Variable, value: Value | None) -> dict[str, str]:
    default = entry.default_raw
    if default is None and entry.default is not None:  # of an override
        default = _text(entry.default)
    said = {
        "DefaultValue": default,
        "ParameterValue": None if value is None else _text(value),
        "LowLimit": None if entry.min is None else str(entry.min),
        "HighLimit": None if entry.max is None else str(entry.max),
    }
    return {
        "ParameterName": entry.name,
        "ObjectType": f"0x{VARIABLE:X}",
        "DataType": f"0x{entry.data_type or 0:04X}",
        "AccessType": entry.access_type,
        "PDOMapping": str(int(entry.pdo_mappable)),
        **{key: text for key, text in said.items() if text is not None},
    }


def _text(value: Value) -> str:
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, int):
        return f"0x{value:X}" if value >= 0 else str(value)
    return repr(value) if isinstance(value, float) else " ".join(value.split())


def read(path: Path) -> Kept:
    """What a file says. Raises SheetError."""
    try:
        text = path.read_bytes().decode("latin-1")
    except OSError as error:
        raise SheetError(f"{path}: cannot be read: {error.strerror}; check path and permission") from error
    node = _node(text)
    about = sheet.read(text, path.name, node or 1)
    found = {
        (entry.index, entry.subindex): signed(entry, entry.value)
        for entry in variables(about.dictionary)
        if entry.value is not None
    }
    if not found:
        raise SheetError(f"{path.name}: {NO_VALUE}")
    return Kept(path.name, node, about.identities(1), about.identities(2), found)


def signed(entry: Variable, value: Value) -> Value:
    """Some write -1 as FFFFFFFFh, which is the same bits."""
    bits, is_signed = INTEGERS.get(entry.data_type or 0, (64, False))
    negative = isinstance(value, int) and is_signed and value >> (bits - 1) == 1
    return value - (1 << bits) if negative and isinstance(value, int) else value


def _node(text: str) -> int | None:
    """The node id of ``[DeviceComissioning]``; None where there is none."""
    parser = configparser.RawConfigParser(strict=False, allow_no_value=True, inline_comment_prefixes=(";",))
    try:
        parser.read_string(text)
    except configparser.Error:
        return None  # told by whoever reads the rest
    for head in HEADS:
        word = parser.get(head, "nodeid", fallback="") or ""
        if word.strip().isalnum():
            try:
                return int(word, 0)
            except ValueError:
                return None
    return None
