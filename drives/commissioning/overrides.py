"""A data sheet's word put aside for the drive's own: by name, and with a reason.

Makers' sheets have slips that the drive contradicts (a range that the standard's own value
does not fit into, "ro" for what can be written). Whoever knows that says so in the profile or
the machine file; the value is then tried on the drive instead of being refused from paper.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from canopen.objectdictionary import ObjectDictionary, ODRecord, ODVariable
from canopen.objectdictionary.datatypes import SIGNED_TYPES

from drives.profile import Override
from drives.texts import Key, Message, message

# Attribute of an entry as canopen has it, by the field of the override.
WHAT = {
    "low": "min",
    "high": "max",
    "access": "access_type",
    "default": "default",
    "mappable": "pdo_mappable",
    "data_type": "data_type",
}
TOLD = {"data_type": "type"}  # as the tables call it
IDENTITY, HEAD = 0x1018, {1: "vendor_number", 2: "product_number", 3: "revision_number"}


def apply(dictionary: ObjectDictionary, wanted: Sequence[Override], sheet: str) -> tuple[Message, ...]:
    """Change the dictionary; a sentence for everything that the sheet says otherwise."""
    return tuple(sentence for one in wanted for sentence in _applied(dictionary, one, sheet))


def _applied(dictionary: ObjectDictionary, one: Override, sheet: str) -> Iterator[Message]:
    at = {"where": message("drive.object", index=one.index, sub=one.sub), "sheet": sheet}
    found = _find(dictionary, one)
    if found is None:
        found = _added(dictionary, one)
        if found is None:
            yield message("sheet.override_of_nothing", **at)
            return
        yield message("sheet.override_added", **at, reason=one.reason)
    for field, attribute in WHAT.items():
        value = getattr(one, field)
        before = getattr(found, attribute)
        if before is None and field in ("low", "high"):
            before = _whole(found)[field == "high"]
        if value is not None and value != before:
            setattr(found, attribute, value)
            values = {"before": _shown(before), "taken": _shown(value)}
            yield message("sheet.override", **at, field=TOLD.get(field, field), **values, reason=one.reason)
    if one.index == IDENTITY and one.default is not None and one.sub in HEAD:
        setattr(dictionary.device_information, HEAD[one.sub], one.default)  # the head of a sheet says it, too


def _whole(found: ODVariable) -> tuple[int, int]:
    """What its type holds, where the sheet names no limit."""
    bits = len(found)
    signed = found.data_type in SIGNED_TYPES
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)


def _find(dictionary: ObjectDictionary, one: Override) -> ODVariable | None:
    """Exactly this entry; canopen makes up members of arrays."""
    found = dictionary.indices.get(one.index)
    if isinstance(found, ODVariable):
        return found if one.sub == 0 else None
    return None if found is None else found.subindices.get(one.sub)


def _added(dictionary: ObjectDictionary, one: Override) -> ODVariable | None:
    """An entry that the sheet lacks; None where it cannot be: without a type, or below a single object."""
    parent = dictionary.indices.get(one.index)
    if one.data_type is None or isinstance(parent, ODVariable):
        return None
    made = ODVariable(f"object {one.index:04X}h:{one.sub:02X}", one.index, one.sub)
    made.data_type = one.data_type
    if parent is None and one.sub:
        parent = ODRecord(f"object {one.index:04X}h", one.index)
        dictionary.add_object(parent)
    if parent is None:
        dictionary.add_object(made)
    else:
        parent.add_member(made)
    return made


def _shown(value: object) -> str:
    if value is None:
        return Key("sheet.nothing")
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value} ({value:#x})" if isinstance(value, int) and value > 9 else str(value)
