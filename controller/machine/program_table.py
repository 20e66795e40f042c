"""What ``[machine]`` says of programs: where else subs lie, and G and M codes of the machine's own."""

from __future__ import annotations

import re
from pathlib import Path

from controller.machine.equipment import M_CODE, M_CODES
from controller.machine.forms import Own
from controller.machine.reading import Reading
from controller.messages import message

_G_CODE = re.compile(r"G[1-9][0-9]{2}(\.[0-9])?")
OWN_CODES = f"{M_CODES}, G100 to G999.9"
CODE = re.compile(r"[GM][0-9]{1,3}(\.[0-9])?")  # one that another stands for
_SUB = re.compile(r"[a-z_0-9][a-z_0-9-]*")
_VALUE = re.compile(r"_(ini|hal)\[[^<>\[\]#;]+\][^<>\[\]#;]*", re.IGNORECASE)
_FOLDERS, _TABLE = message("file.may.folders"), message("file.may.table")


def _sub_folders(here: Reading, name: str) -> tuple[str, ...]:
    """Folders of subs, searched in their order behind that of the program. Raises ConfigError."""
    value = here.table.get(name, _FOLDERS)
    rows = value if isinstance(value, list) else [None]
    if not all(isinstance(row, str) and Path(row).expanduser().is_absolute() for row in rows):
        here.table.refuse(name, "no_folders", allowed=_FOLDERS)
    return tuple(rows)


def _own_codes(here: Reading, name: str) -> tuple[tuple[str, str], ...]:
    """``own_codes = { M200 = "clamp_part", M428 = "G43.4" }``: a sub, or the code that it stands for.

    Raises ConfigError.
    """
    codes = here.table.table(name, f"{here.table.name} {name}")
    found: list[tuple[str, str]] = []
    for code in codes.written:
        if not (M_CODE.fullmatch(code) or _G_CODE.fullmatch(code)):
            codes.refuse(code, "no_own_code", allowed=OWN_CODES)
        meant = codes.text(code)
        if not (CODE.fullmatch(meant) or _SUB.fullmatch(meant)):
            codes.refuse(code, "no_meaning", allowed=message("file.may.meaning"))
        found.append((code, meant))
    codes.finish()
    return tuple(found)


def _named_values(here: Reading, name: str) -> tuple[tuple[str, float], ...]:
    """``named_values = { "_ini[TOOLSENSOR]X" = 12.5 }``. Raises ConfigError."""
    values = here.table.table(name, f"{here.table.name} {name}")
    found: list[tuple[str, float]] = []
    for one in values.written:
        if not _VALUE.fullmatch(one):
            values.refuse(one, "no_named_value", allowed=message("file.may.named_value"))
        found.append(("".join(one.split()).lower(), values.number(one)))
    values.finish()
    return tuple(found)


SUB_FOLDERS = Own(_sub_folders, _FOLDERS, {"type": "array", "items": {"type": "string"}})
NAMED = Own(_named_values, _TABLE, {"type": "object", "additionalProperties": {"type": "number"}})
OWN = Own(_own_codes, _TABLE, {"type": "object", "additionalProperties": {"type": "string"}})
