"""The reference of the keys in ``config/KEYS.md`` is what the reader of machine files asks for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from controller.machine import keys as machine_keys
from controller.machine import machine_file
from controller.machine.toml_table import ConfigError, Table, parse

EVERY = Path(__file__).with_name("every_key.toml")
PAGE = machine_file.SHIPPED / "KEYS.md"


@pytest.fixture(scope="module")
def read() -> Table:
    top = parse(EVERY.read_text(), EVERY.name)
    machine_file.read_table(top, EVERY.read_text(), machine_file.SHIPPED)
    return top


def test_every_key_that_is_read_is_explained_and_no_other(read: Table) -> None:
    asked = {name: set(keys) for name, keys in machine_keys.asked_for(read).items()}
    told = {
        name: {one for key in keys for one in machine_keys.spelled(key)}
        for name, keys in machine_keys.MEANINGS.items()
    }
    assert asked == told


def test_the_file_of_the_tests_has_every_key(read: Table) -> None:
    """Only then is it known of every key what it may be."""
    for name, keys in machine_keys.asked_for(read).items():
        assert not [key for key, known in keys.items() if not known.allowed], name


def test_the_page_is_made_from_it(read: Table) -> None:
    assert PAGE.read_text() == machine_keys.markdown(read)


VALUE = re.compile(r"(?P<key>[A-Za-z_]\w*) = (?P<value>[^,}\n]+)")
FREE = {"name", "channel", "reason", "input", "output"}  # texts that may be anything


def test_a_wrong_value_is_refused_with_its_line() -> None:
    """Of every number, text and flag in a file with every key, one after another."""
    lines = EVERY.read_text().splitlines()
    tried = 0
    for number, line in enumerate(lines, 1):
        if line.startswith("#"):
            continue
        for found in VALUE.finditer(line):
            if found["key"] in FREE or found["value"].startswith(("{", "[")):
                continue
            wrong = f"{line[: found.start('value')]}[[]]{line[found.end('value') :]}"
            with pytest.raises(ConfigError) as refused:
                machine_file.read(
                    "\n".join([*lines[: number - 1], wrong, *lines[number:]]),
                    EVERY.name,
                    machine_file.SHIPPED,
                )
            told = str(refused.value)
            assert told.startswith(f"{EVERY.name}:{number}: ") and found["key"] in told, (wrong, told)
            tried += 1
    assert tried > 150
