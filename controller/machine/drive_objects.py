"""Objects of drives as TOML tables name them: ``"2210:01"``, and where a data sheet is wrong about one.

    [[override]]                # of a profile; in a machine file [[axis.override]]
    object = "1016:01"
    high = 0xFFFFFFFF           # or low, access, default, mappable, type
    reason = "node << 16 | ms does not fit the sheet's 65535; firmware 1.1.15 takes it"

Every refusal is a ``ConfigError`` in the form of ``toml_table``.
"""

from __future__ import annotations

from controller.machine.toml_table import Table
from drives.profile import Override

OBJECT = "an object in hexadecimal, in quotes, from 1000 to FFFF"
ACCESS = ("ro", "wo", "rw", "rwr", "rww", "const")  # CiA 306-1, AccessType
TYPES = {  # CiA 301, 7.4.7.1
    "INTEGER8": 0x02,
    "INTEGER16": 0x03,
    "INTEGER32": 0x04,
    "UNSIGNED8": 0x05,
    "UNSIGNED16": 0x06,
    "UNSIGNED32": 0x07,
}
WHAT = ("low", "high", "access", "default", "mappable", "type")
LEAST, MOST = -(2**31), 2**32 - 1  # of any integer up to 32 bits


def index(text: str) -> int | None:
    """1000h .. FFFFh of "60F4"; None for anything else."""
    try:
        found = int(text, 16)
    except ValueError:
        return None
    return found if len(text) == 4 and 0x1000 <= found <= 0xFFFF else None


def place(table: Table) -> tuple[int, int]:
    """Index and sub-index of ``object = "2210:01"``. Raises ConfigError."""
    first, _, sub = table.text("object").partition(":")
    number = index(first)
    if number is None or not (sub == "" or (len(sub) == 2 and set(sub.upper()) <= set("0123456789ABCDEF"))):
        table.refuse("object", "is no object", f"{OBJECT}, with a sub-index", 'write e.g. "2210:01"')
    return number, int(sub or "0", 16)


def overrides(table: Table) -> tuple[Override, ...]:
    """The ``[[override]]`` tables below a table, none or more. Raises ConfigError."""
    found = table.tables("override")
    if table.name.startswith("["):  # of an axis, or another of the machine file's tables
        for entry in found:
            entry.name = f"{table.name}: {entry.name}"
    return tuple(map(_override, found))


def _override(table: Table) -> Override:
    where = place(table)
    for key in WHAT:
        table.get(key, "", False)  # known, so that ``finish`` lists it among what is allowed
    if not any(table.has(key) for key in WHAT):
        table.refuse("object", "nothing of it is overridden", f"one of {', '.join(WHAT)}", "add what is so")

    def number(key: str) -> int | None:
        return table.integer(key, LEAST, MOST) if table.has(key) else None

    found = Override(
        *where,
        reason=table.text("reason").strip(),
        low=number("low"),
        high=number("high"),
        access=table.text("access", ACCESS) if table.has("access") else None,
        default=number("default"),
        mappable=table.flag("mappable", False) if table.has("mappable") else None,
        data_type=TYPES[table.text("type", tuple(TYPES))] if table.has("type") else None,
    )
    if not found.reason:
        table.refuse("reason", "is empty", "a text in quotes", "write who says so, for whoever reads it next")
    if found.low is not None and found.high is not None and found.low > found.high:
        table.refuse("low", f"is above high = {found.high}", "low <= high", "swap or change them")
    table.finish()
    return found
