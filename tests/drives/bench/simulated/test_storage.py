"""Parameters that survive a reset: 1010h "save" and 1011h "load"."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import RESET_COMMUNICATION, RESET_NODE, Lone, Refused

SAVE, LOAD = int.from_bytes(b"save", "little"), int.from_bytes(b"load", "little")


def changed() -> Lone:
    lone = Lone()
    lone.write(0x1017, 0, 20_000, 2)
    lone.write(0x6085, 0, 4711, 4)
    return lone


def values(lone: Lone) -> tuple[int, int]:
    return lone.read(0x1017), lone.read(0x6085)


DEFAULT = (0, 400_000_000)
NEW = (20_000, 4711)


@pytest.mark.parametrize(
    ("group", "after"),
    [(1, NEW), (2, (NEW[0], DEFAULT[1])), (3, (DEFAULT[0], NEW[1])), (4, DEFAULT)],
)
def test_a_reset_brings_back_what_its_group_has_saved(group: int, after: tuple[int, int]) -> None:
    lone = changed()
    lone.write(0x1010, group, SAVE, 4)
    lone.nmt(RESET_NODE)
    assert values(lone) == after


def test_a_reset_of_communication_leaves_the_application_alone() -> None:
    lone = changed()
    lone.nmt(RESET_COMMUNICATION)
    assert values(lone) == (0, 4711)


def test_load_brings_defaults_with_the_next_reset() -> None:
    lone = changed()
    lone.write(0x1010, 1, SAVE, 4)
    lone.write(0x1011, 3, LOAD, 4)
    assert values(lone) == NEW, "not before the reset"
    lone.nmt(RESET_NODE)
    assert values(lone) == (NEW[0], DEFAULT[1])


def test_reading_says_that_saving_and_restoring_are_possible_on_command() -> None:
    lone = Lone()
    assert {lone.read(index, sub) for index in (0x1010, 0x1011) for sub in range(1, 5)} == {1}


@pytest.mark.parametrize("index", [0x1010, 0x1011])
def test_a_wrong_signature_is_refused(index: int) -> None:
    with pytest.raises(Refused, match="08000020"):
        Lone().write(index, 1, int.from_bytes(b"evas", "little"), 4)


def test_a_remapped_and_saved_pdo_is_there_after_a_reset() -> None:
    lone = Lone()
    lone.map(0x1801, 0x1A01, [0x6064_0020], 3, 0x285)
    lone.write(0x1010, 2, SAVE, 4)
    lone.nmt(RESET_NODE)
    lone.nmt(1)
    lone.run(0.012)
    assert len(lone.of(0x285)) == 2
