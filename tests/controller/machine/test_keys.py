"""A key of the machine file is declared once: reading, refusals, KEYS.md and JSON Schema are made of it."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from typing import Any

import pytest
from support.machines.every_key import BY_INVERTER, BY_MODBUS, EVERY, TEXT, values_of_every_key

from controller import messages
from controller.machine import keys as machine_keys
from controller.machine import machine_file
from controller.machine.declaration import Key, key
from controller.machine.forms import Number, Sub
from controller.machine.kinematics import builds
from controller.machine.reading import File, Reading
from controller.machine.toml_table import ConfigError, parse

VALUES = tomllib.loads(TEXT)
FILES = (VALUES, tomllib.loads(BY_INVERTER), tomllib.loads(BY_MODBUS))
PAGE = machine_keys.PAGE.read_text()
SCHEMA = json.loads(machine_keys.SCHEMA.read_text())
DECLARED = [(section, one) for section in machine_keys.sections() for one in section.keys]
each_key = pytest.mark.parametrize(
    ("section", "one"), DECLARED, ids=[f"{section.name}.{one.name}" for section, one in DECLARED]
)


def test_the_files_that_are_made_of_the_declarations_are_made_anew() -> None:
    """``python -m controller.machine.keys`` makes both."""
    assert machine_keys.PAGE.read_text() == machine_keys.markdown()
    assert machine_keys.SCHEMA.read_text() == machine_keys.written_schema()


# ---- every key that is declared


def tables_of(values: Any, section: str) -> list[dict[str, Any]]:
    """The tables of the file with every key that are of a section; * is any name."""
    first, _, rest = section.partition(".")
    found = list(values.values()) if first == "*" else [values[first]] if first in values else []
    rows = [row for one in found for row in (one if isinstance(one, list) else [one])]
    below = [one for row in rows for one in (tables_of(row, rest) if rest else [row])]
    return [one for one in below if isinstance(one, dict)]


@each_key
def test_a_key_has_a_meaning_a_range_and_what_a_silent_file_means(
    section: machine_keys.Section, one: Key
) -> None:
    assert len(one.means) > 3 and len(machine_keys.allowed(one)) > 3
    assert machine_keys.left_out(one, section.called)
    written = {name for file in FILES for table in tables_of(file, section.name) for name in table}
    assert written.issuperset(one.spelled), "the files of the tests have every key"


@each_key
def test_a_key_is_in_the_reference_and_in_the_schema(section: machine_keys.Section, one: Key) -> None:
    page = PAGE.partition(f"\n## {section.title}\n")[2].partition("\n## ")[0]
    assert f"| {', '.join(f'`{name}`' for name in one.spelled)} | {one.means} |" in page
    table = SCHEMA
    for part in section.name.split("."):
        table = table["additionalProperties"] if part == "*" else table["properties"][part]
        table = table.get("items", table)
        table = next((other for other in table.get("anyOf", ()) if "properties" in other), table)
    for name in one.spelled:
        assert table["properties"][name]["description"] == one.means
    assert table["additionalProperties"] is False


def test_a_wrong_value_of_every_key_is_refused_with_its_line_and_nothing_else_is() -> None:
    tried = set()
    for line, name, text in values_of_every_key():
        with pytest.raises(ConfigError) as refused:
            machine_file.read(text, EVERY.name, machine_file.SHIPPED)
        told = str(refused.value)
        assert told.startswith(f"{EVERY.name}:{line}: ") and name in told, (name, told)
        assert len(refused.value.mistakes) == 1, told
        tried.add(name)
    declared = {name for _, one in DECLARED for name in one.spelled}
    above = {"axis", "bus", "changer", "file", "machine", "macro", "offsets", "straightness", "table", "tool"}
    assert tried >= declared - above - TABLES


# Tables that the file has under heads of their own.
TABLES = {
    *("analogue_out", "gear", "inverter", "m_codes", "modbus", "override", "pitch"),
    *("prepare", "put_away", "take"),
}


def test_the_reference_names_every_kinematics_that_there_is() -> None:
    (one,) = (one for _, one in DECLARED if one.name == "kinematics")
    assert machine_keys.allowed(one) == " or ".join(f'"{name}"' for name in builds())


@dataclass(frozen=True, slots=True)
class Lamp:
    """A table with one key."""

    blinks_s: float = key(Number(0.1, 5.0), "how long it is on", default=1.0)


@dataclass(frozen=True, slots=True)
class Shop:
    """A file with it."""

    lamp: Lamp = key(Sub(Lamp, top=True, always=True), "a lamp")


def test_a_new_key_is_one_declaration() -> None:
    def read(text: str) -> Lamp:
        file = File({})
        found: Shop = Reading(file, Shop, parse(text, "shop.toml")).value()
        file.finish()
        return found.lamp

    assert read("[lamp]\nblinks_s = 2").blinks_s == 2.0
    assert read("").blinks_s == 1.0
    with pytest.raises(ConfigError, match=r"shop\.toml:2: \[lamp\]: blinks_s = 9: .* from 0\.1 to 5;"):
        read("[lamp]\nblinks_s = 9")
    with pytest.raises(ConfigError, match="did you mean 'blinks_s'"):
        read("[lamp]\nblink_s = 2")


# ---- JSON Schema


def accepts(schema: dict[str, Any], value: Any) -> bool:
    """Whether a value keeps to a schema, as far as ours go (draft 7)."""
    kinds = {
        "object": isinstance(value, dict),
        "array": isinstance(value, list),
        "string": isinstance(value, str),
        "boolean": isinstance(value, bool),
        "number": isinstance(value, int | float) and not isinstance(value, bool),
        "integer": isinstance(value, int) and not isinstance(value, bool),
    }
    known = {"type", "enum", "const", "properties", "required", "additionalProperties", "items", "minItems"}
    known |= {"maxItems", "uniqueItems", "minimum", "maximum", "exclusiveMinimum", "minLength", "maxLength"}
    assert schema.keys() <= known | {"anyOf", "description", "default", "$schema", "title"}
    wanted = schema.get("type", [])
    if wanted and not any(kinds[one] for one in ([wanted] if isinstance(wanted, str) else wanted)):
        return False
    if value not in schema.get("enum", [value]) or value != schema.get("const", value):
        return False
    if "anyOf" in schema and not any(accepts(one, value) for one in schema["anyOf"]):
        return False
    if kinds["number"]:
        low, high = schema.get("minimum", value), schema.get("maximum", value)
        return low <= value <= high and value > schema.get("exclusiveMinimum", value - 1)
    if kinds["string"]:
        return schema.get("minLength", 0) <= len(value) <= schema.get("maxLength", len(value))
    if kinds["array"]:
        sizes = schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value))
        return sizes and all(accepts(schema.get("items", {}), one) for one in value)
    if kinds["object"]:
        others = schema.get("additionalProperties", {})
        below = {name: schema.get("properties", {}).get(name, others) for name in value}
        return set(schema.get("required", ())) <= value.keys() and all(
            one is not False and accepts(one, value[name]) for name, one in below.items()
        )
    return True


@pytest.mark.parametrize("name", machine_file.shipped())
def test_the_schema_accepts_every_shipped_machine(name: str) -> None:
    assert accepts(SCHEMA, tomllib.loads((machine_file.SHIPPED / f"{name}.toml").read_text()))
    assert accepts(SCHEMA, tomllib.loads(machine_file.load(name).text)), "with its tools"


def test_the_schema_accepts_the_file_with_every_key_and_no_wrong_type_in_it() -> None:
    assert accepts(SCHEMA, tomllib.loads(TEXT))
    for line, name, text in values_of_every_key():
        assert not accepts(SCHEMA, tomllib.loads(text)), (line, name)


def test_the_schema_accepts_no_unknown_key() -> None:
    for section in machine_keys.sections():
        values = tomllib.loads(TEXT)
        for table in tables_of(values, section.name)[:1]:
            table["no_such_key"] = 1
            assert not accepts(SCHEMA, values), section.name


def test_what_a_key_may_be_that_is_missing_is_a_text_in_every_language() -> None:
    """Also where it hangs on another key, which may itself be refused."""
    needed = [one for section, one in DECLARED if one.is_needed(section.called)]
    assert len(needed) > 40 and not [one.name for one in needed if isinstance(one.may_be, str) and one.may_be]
    added = '[[straightness]]\nmoves = "Z"\nat_mm = 5\n'
    with pytest.raises(ConfigError) as refused:
        machine_file.read(machine_file.load("trunnion").text + added, "m.toml")
    assert "so viele Zahlen wie `at`" in messages.text(refused.value.said, "de")
