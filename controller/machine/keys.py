"""The reference of the keys of a machine file, and its JSON Schema, made of the declarations.

python -m controller.machine.keys      writes config/KEYS.md and config/machine.schema.json
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

from controller.machine.declaration import Form, Key, Schema, in_order
from controller.machine.forms import Rows, Sub
from controller.machine.machine_file import SHIPPED, MachineFile

PAGE, SCHEMA = SHIPPED / "KEYS.md", SHIPPED / "machine.schema.json"
HEAD = """# The keys of a machine file

Made of their declarations (`python -m controller.machine.keys`); a test holds it. Lengths are in mm, angles
in degrees, times in seconds, as the ends of the names say; what is not known is refused with its line. How
they go together, and examples, are in [README.md](README.md). Editors that know JSON Schema complete a file
whose first line is `#:schema machine.schema.json`, with the path of that file.
"""


@dataclass(frozen=True, slots=True)
class Section:
    """A table of the file. ``name``: as ``axis.homing``; * is a name that the file gives."""

    name: str
    title: str
    called: str  # its key
    form: Sub | Rows

    @property
    def of(self) -> type:
        return self.form.of

    @property
    def keys(self) -> list[Key]:
        return [key for key in in_order(self.of) if key.is_in(self.called)]


def sections() -> list[Section]:
    """All tables that have keys, each before those in it; what several have (``Rows.beneath``) once."""
    found: list[Section] = []
    for key in in_order(MachineFile):
        for one in _below(key, "", ""):
            beneath = isinstance(one.form, Rows) and one.form.beneath
            if not (beneath and any(one.form == other.form for other in found)):
                found.append(one)
    return found


def _below(key: Key, above: str, title: str) -> Iterator[Section]:
    form = key.form
    if not isinstance(form, Sub | Rows):
        return
    name = f"{above}.{key.name}" if above else key.name
    named = isinstance(form, Sub) and form.named
    if isinstance(form, Rows) and (not above or above == "changer"):
        shown = whole = f"`[[{name}]]`"
    else:
        whole = title or f"`[{name}]`"
        shown = f"{whole}: {key.name}" if title else whole
        shown += ": a name, and in it" if named else ""
    yield Section(f"{name}.*" if named else name, shown, key.name, form)
    for one in in_order(form.of):
        if one.is_in(key.name):
            yield from _below(one, name, whole)


# ---- the reference


def markdown() -> str:
    """``config/KEYS.md``."""
    return "\n".join([HEAD, *map(_section, sections())])


def _section(section: Section) -> str:
    rows = (f"| {' | '.join(_columns(key, section.called))} |" for key in section.keys)
    head = ["| key | what | may be | left out |", "|---|---|---|---|"]
    return "\n".join([f"## {section.title}", "", *head, *rows, ""])


def _columns(key: Key, table: str) -> tuple[str, ...]:
    return ", ".join(f"`{name}`" for name in key.spelled), key.means, allowed(key), left_out(key, table)


def allowed(key: Key) -> str:
    """What a key may be."""
    if isinstance(key.form, Rows):
        return f"one [[{key.name}]] table or more"
    return key.allowed


def left_out(key: Key, table: str) -> str:
    """What a file without the key means."""
    if key.left_out or key.is_needed(table):
        return key.left_out or "needed"
    default = key.shown_default()
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    if isinstance(default, float):
        return f"`{default:g}`"
    return "–" if default in (None, "", ()) else f"`{default}`"


# ---- JSON Schema


def schema() -> Schema:
    """Of a whole file. What hangs on other keys (a travel, the names of bits) it cannot say."""
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "title": "Directrix machine file"}
    return {**head, **_table(MachineFile, "")}


def _table(of: type, called: str) -> Schema:
    keys = [key for key in in_order(of) if key.is_in(called)]
    needed = [key for key in keys if key.is_needed(called) and key.only is None]
    found: Schema = {
        "type": "object",
        "properties": {name: _described(key, called) for key in keys for name in key.spelled},
        "required": [key.name for key in needed if len(key.spelled) == 1],
        "additionalProperties": False,
    }
    by_unit = list(zip(*(key.spelled for key in needed if len(key.spelled) == 2), strict=True))
    return {**found, "anyOf": [{"required": list(names)} for names in by_unit]} if by_unit else found


def _described(key: Key, called: str) -> Schema:
    found = {"description": key.means, **_of(key.form, key.name)}
    default = None if key.is_needed(called) else key.shown_default()
    return found if default is None or isinstance(key.form, Sub | Rows) else {**found, "default": default}


def _of(form: Form, name: str) -> Schema:
    if isinstance(form, Rows):
        return {"type": "array", "items": _table(form.of, name)}
    if not isinstance(form, Sub):
        return form.schema()
    table = _table(form.of, name)
    return {"type": "object", "additionalProperties": form.entry_schema(table)} if form.named else table


def written_schema() -> str:
    """``config/machine.schema.json``."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def main() -> None:
    """Write both files."""
    PAGE.write_text(markdown(), encoding="utf-8")
    SCHEMA.write_text(written_schema(), encoding="utf-8")


if __name__ == "__main__":
    main()
