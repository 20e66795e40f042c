"""Objects and overrides in TOML tables; every slip is one sentence with file, table and key."""

from __future__ import annotations

import pytest

from controller.machine import drive_objects, machine_file, nodes
from controller.machine.toml_table import ConfigError, parse
from drives.profile import Override

LEAST = '[[override]]\nobject = "1016:01"\nreason = "so"\n'


def read(text: str) -> tuple[Override, ...]:
    return drive_objects.overrides(parse(text, "mine.toml"))


def test_every_word_of_a_data_sheet_may_be_overridden() -> None:
    text = 'low = -5\nhigh = 0xFFFFFFFF\naccess = "rw"\ndefault = 3\nmappable = true\ntype = "UNSIGNED32"\n'
    assert read(LEAST + text) == (Override(0x1016, 1, "so", -5, 0xFFFF_FFFF, "rw", 3, True, 0x07),)
    assert read("") == ()
    (one,) = read('[[override]]\nobject = "607A"\nmappable = false\nreason = "so"\n')
    assert (one.index, one.sub, one.mappable, one.high) == (0x607A, 0, False, None)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            LEAST,
            r"mine\.toml:\d+: \[\[override\]\] 1: object = .*: nothing of it is overridden; allowed: one of",
        ),
        (LEAST.replace("reason", "high = 3\n#"), "reason: is missing"),
        (LEAST.replace('"so"', '" "') + "high = 3\n", "reason = .*: is empty"),
        (LEAST.replace("1016:01", "16:01") + "high = 3\n", 'object = "16:01": is no object'),
        (LEAST + 'high = "all"\n', "high = .*: is out of range or not whole"),
        (LEAST + "high = 3.5\n", "high = 3.5: is out of range or not whole"),
        (LEAST + "low = 5\nhigh = 3\n", "low = 5: is above high = 3"),
        (LEAST + 'access = "r"\n', 'access = "r": is not known; allowed: "ro" or "wo"'),
        (LEAST + "mappable = 1\n", "mappable = 1: is not true or false"),
        (LEAST + 'type = "u32"\n', 'type = "u32": is not known; allowed: "INTEGER8" or'),
        (LEAST + "hihg = 3\nlow = 1\n", "hihg = 3: this key is not known; .* did you mean 'high'"),
        ("override = 3\n", "override = 3: is not an array of tables"),
    ],
)
def test_a_slip_is_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        read(text)


def text_of(more: str) -> str:
    """The trunnion's machine file with lines added to axis X."""
    return machine_file.load("trunnion").text.replace('name = "X"\n', f'name = "X"\n{more}\n', 1)


def test_an_axis_overrides_its_drives_sheet_and_tells_so_to_the_bus_side() -> None:
    line = 'override = [{ object = "605A:00", high = 7, reason = "firmware 3" }]'
    machine = machine_file.read(text_of(line), "mine.toml", machine_file.SHIPPED)
    x, y = nodes.node_settings(machine)[:2]
    assert x.overrides == (Override(0x605A, 0, "firmware 3", high=7),)
    assert y.overrides == ()


def test_a_slip_in_an_axis_names_the_axis() -> None:
    with pytest.raises(ConfigError, match=r"\[\[axis\]\] X: \[\[override\]\] 1: reason: is missing"):
        machine_file.read(
            text_of('override = [{ object = "605A", high = 7 }]'), "mine.toml", machine_file.SHIPPED
        )


def test_spindle_and_io_node_may_be_unsupervised_and_overridden_too() -> None:
    more = """
[spindle]
max_rev_min = 12000
node = 10
counts_per_rev = 4096
unsupervised = true
override = [{ object = "6085", high = 9, reason = "so" }]
[io]
node = 11
inputs = { door = 1 }
unsupervised = true
override = [{ object = "6005", access = "rw", reason = "so" }]
"""
    machine = machine_file.read(machine_file.load("trunnion").text + more, "m.toml", machine_file.SHIPPED)
    *_, spindle, io = nodes.all_settings(machine)
    assert spindle.unsupervised and io.unsupervised
    assert (spindle.overrides[0].index, io.overrides[0].access) == (0x6085, "rw")
