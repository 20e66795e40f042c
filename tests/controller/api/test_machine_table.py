"""The machine file as a table with its lines."""

from __future__ import annotations

import tomllib

import pytest

from controller.api import machine_table
from controller.machine import machine_file


def values_in(told: dict[str, object], text: str) -> int:
    """How many values a table holds; what has no head of its own, as an inline table, is one."""
    return sum(_of(value, text) if f"{name}]" in text else 1 for name, value in told.items())


def _of(value: object, text: str) -> int:
    if isinstance(value, dict):
        return values_in(value, text)
    return sum(values_in(one, text) for one in value) if isinstance(value, list) else 1


@pytest.mark.parametrize("name", machine_file.shipped())
def test_every_value_of_every_shipped_machine_stands_in_its_line(name: str) -> None:
    text = machine_file.load(name).text
    lines = text.splitlines()
    found = machine_table.rows(text)
    for row in found:
        assert lines[row.line - 1].lstrip().startswith(row.key), row
    assert len(found) == values_in(tomllib.loads(text), text)


def test_a_row_tells_table_value_line_and_comment() -> None:
    text = 'top = 1\n[[axis]]\nname = "X"  # the long one\n# alone\n[[axis]]\nname = "#2" # with "#" inside\n'
    found = [(r.table, r.key, r.value, r.line, r.comment) for r in machine_table.rows(text)]
    assert found == [
        ("", "top", "1", 1, ""),
        ("axis X", "name", "X", 3, "the long one"),
        ("axis #2", "name", "#2", 6, 'with "#" inside'),
    ]


def test_a_value_over_several_lines_stands_at_its_first() -> None:
    text = "[a]\nlist = [\n  1, # one\n  2,\n]\nafter = true\n"
    found = [(r.key, r.value, r.line) for r in machine_table.rows(text)]
    assert found == [("list", "[1, 2]", 2), ("after", "true", 6)]


def test_dotted_keys_and_tables_find_their_values() -> None:
    text = "[a.b]\nc.d = 2.5\n'e' = {x = 1, y = \"z\"}\n"
    found = [(r.table, r.key, r.value) for r in machine_table.rows(text)]
    assert found == [("a.b", "c.d", "2.5"), ("a.b", "e", "{ x = 1, y = z }")]


def test_what_is_no_toml_is_refused() -> None:
    with pytest.raises(ValueError):
        machine_table.rows("a = \n")
