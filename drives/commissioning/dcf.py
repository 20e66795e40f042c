"""A drive's set-up as a file: DCF (CiA 306-1), its data sheet with a ParameterValue for everything set.

Written by canopen's export and read by its import. Numbers are written by us beforehand, because
its export gives a negative one a form that nobody reads (``0x-5``).
"""

from __future__ import annotations

import configparser
import io
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from canopen.objectdictionary import ObjectDictionary, ODVariable, eds

from drives.commissioning import sheet
from drives.commissioning.sheet import INTEGERS, SheetError
from drives.texts import message

Value = int | float | str | bytes
Place = tuple[int, int]  # index, sub-index

HEADS = ("DeviceComissioning", "DeviceCommissioning")  # CiA 306 writes it with one m; people with two


@dataclass(frozen=True, slots=True)
class Kept:
    """What a file says; ``node`` None = it does not say of which node id it is."""

    name: str
    node: int | None
    vendor: tuple[int, ...]
    product: tuple[int, ...]
    values: dict[Place, Value]


def variables(dictionary: ObjectDictionary) -> Iterator[ODVariable]:
    """Every entry of the objects of a device, in order."""
    for index in sorted(dictionary.indices):
        found = dictionary.indices[index]
        if index < 0x1000:  # data types
            continue
        if isinstance(found, ODVariable):
            yield found
        else:
            yield from (found.subindices[sub] for sub in sorted(found.subindices))


def written(about: sheet.Sheet, node: int, bit_rate: int, values: Mapping[Place, Value], file: str) -> str:
    """The text of a DCF. ``about`` is the caller's own: it is changed. ``bit_rate`` (bit/s) 0 = unsaid."""
    dictionary = about.dictionary
    for entry in variables(dictionary):
        value = values.get((entry.index, entry.subindex))
        entry.value = None  # of a maker's sheet that is a DCF itself
        entry.value_raw = None if value is None else _text(value)  # type: ignore[attr-defined]
    dictionary.node_id, dictionary.bitrate = node, bit_rate or None
    now = time.localtime()
    date, clock = time.strftime("%m-%d-%Y", now), time.strftime("%I:%M%p", now)
    info = {  # the export's own default is one dictionary for all files of a process
        "FileName": Path(file).name,
        "FileVersion": "1",
        "FileRevision": "1",
        "LastEDS": about.name,
        "EDSVersion": "4.0",
        "Description": f"Set-up of node {node}",
        "CreationDate": date,
        "CreationTime": clock,
        "CreatedBy": "Directrix",
        "ModificationDate": date,
        "ModificationTime": clock,
        "ModifiedBy": "Directrix",
    }
    text = io.StringIO()
    eds.export_dcf(dictionary, text, info)  # type: ignore[no-untyped-call]
    return text.getvalue()


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
        raise SheetError(message("sheet.dcf_unreadable", path=path, why=error)) from error
    node = _node(text)
    about = sheet.read(text, path.name, node or 1)
    found = {
        (entry.index, entry.subindex): signed(entry, entry.value)
        for entry in variables(about.dictionary)
        if entry.value is not None
    }
    if not found:
        raise SheetError(message("sheet.no_values", name=path.name))
    return Kept(path.name, node, about.identities(1), about.identities(2), found)


def signed(entry: ODVariable, value: Value) -> Value:
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
