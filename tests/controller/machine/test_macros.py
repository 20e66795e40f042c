"""Macros of a machine file: lines by name, each with the role that its button asks for."""

from __future__ import annotations

import pytest

from controller import messages
from controller.machine import machine_file
from controller.machine.model import Macro
from controller.machine.toml_table import ConfigError
from controller.runtime import checked
from controller.service import status

FILE = machine_file.load("trunnion").text
PARK = 'name = "Park"\nlines = ["G53 G0 Z260.", "G53 G0 X0."]\n'


def with_macros(*tables: str) -> str:
    return FILE + "".join(f"\n[[macro]]\n{table}" for table in tables)


def test_macros_are_read_in_their_order_and_told_with_the_facts() -> None:
    machine = machine_file.read(
        with_macros(PARK, 'name = "Warm up"\nlines = ["M3 S100"]\nrole = "set_up"\n'), "m"
    )
    assert machine.macros == (
        Macro("Park", ("G53 G0 Z260.", "G53 G0 X0."), "operate"),
        Macro("Warm up", ("M3 S100",), "set_up"),
    )
    told = status.facts(machine, {})["macros"]
    assert told[1] == {"name": "Warm up", "lines": ["M3 S100"], "role": "set_up"}
    assert machine_file.read(FILE, "m").macros == ()


def test_a_macro_changes_nothing_that_a_plan_or_a_check_hangs_on() -> None:
    assert repr(machine_file.read(with_macros(PARK), "m").axes) == repr(machine_file.read(FILE, "m").axes)
    assert "Park" not in repr(machine_file.read(with_macros(PARK), "m")).partition("text=")[0]


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ('lines = ["M5"]\n', "name"),
        ('name = ""\nlines = ["M5"]\n', "is no name of a macro"),
        ('name = "a/b"\nlines = ["M5"]\n', "is no name of a macro"),
        (f'name = "{"x" * 41}"\nlines = ["M5"]\n', "1 to 40"),
        ('name = "Off"\n', "lines"),
        ('name = "Off"\nlines = []\n', "is no list of lines"),
        ('name = "Off"\nlines = "M5"\n', "is no list of lines"),
        ('name = "Off"\nlines = ["M5\\nM9"]\n', "each line into quotes of its own"),
        (f'name = "Off"\nlines = ["({"x" * 1000})"]\n', "up to 1000"),
        ('name = "Off"\nlines = ["M5"]\nrole = "view"\n', '"operate" or "set_up"'),
        ('name = "Off"\nlines = ["M5"]\ncolour = "red"\n', "colour"),
        ('name = "Park"\nlines = ["M5"]\n', "a name per macro"),
    ],
)
def test_a_macro_that_is_none_is_refused_with_its_line_in_each_language(table: str, says: str) -> None:
    with pytest.raises(ConfigError) as error:
        machine_file.read(with_macros(PARK, table), "m.toml")
    assert says in str(error.value) and str(error.value).startswith("m.toml:")
    assert messages.text(error.value.said, "de") not in ("", str(error.value))


def test_the_macros_of_the_shop_are_programs_that_it_takes() -> None:
    machine = machine_file.load("shop")
    assert machine.macros
    for macro in machine.macros:
        task = checked.task("\n".join(macro.lines).encode(), macro.name, machine)
        assert any(True for _ in checked.path_of(task).items), macro.name
