"""Every abort code of CiA 301's table 22, and what makes a drive give it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.drives.lone_drive import Lone, Refused

from drives.bench.simulated import Parameters
from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.dictionary import Code
from drives.bench.simulated.sdo_server import checksum

SCRATCH = bytes.fromhex("022000")
NAME = bytes.fromhex("081000")


def wrong_toggle(lone: Lone) -> None:
    lone.ask(b"\x40" + NAME)
    lone.ask(b"\x70")


def silent_client(lone: Lone) -> None:
    lone.ask(b"\x40" + NAME)
    lone.wait(3.0)
    raise Refused(int.from_bytes(lone.of(0x585)[-1][4:], "little"))


def wrong_sequence(lone: Lone) -> None:
    lone.ask(b"\xa4" + NAME + b"\x14")
    lone.sdo(b"\xa3")
    lone.ask(b"\xa2\x50\x14")


def wrong_checksum(lone: Lone) -> None:
    lone.ask(b"\xc6" + SCRATCH + b"\x07")
    lone.ask(b"\x81abcdefg")
    lone.ask(b"\xc1" + (checksum(b"abcdefg") ^ 1).to_bytes(2, "little"))


def too_much_for_the_memory(lone: Lone) -> None:
    lone.ask(b"\x21" + SCRATCH + (1_000_000).to_bytes(4, "little"))


def mapping_while_on(lone: Lone) -> None:
    lone.write(0x1600, 1, 0x6060_0008, 4)


def what_cannot_be_mapped(lone: Lone) -> None:
    lone.write(0x1601, 0, 0, 1)
    lone.write(0x1601, 1, 0x6065_0020, 4)


def nine_bytes(lone: Lone) -> None:
    lone.write(0x1601, 0, 0, 1)
    for sub, entry in enumerate((0x607A_0020, 0x60FF_0020, 0x6060_0008), 1):
        lone.write(0x1601, sub, entry, 4)
    lone.write(0x1601, 0, 3, 1)


def one_producer_watched_twice(lone: Lone) -> None:
    lone.write(0x1016, 1, 0x7F_0064, 4)
    lone.write(0x1016, 2, 0x7F_00C8, 4)


def memory_chip_broken(lone: Lone) -> None:
    lone.drive.storage.broken = True
    lone.write(0x1010, 1, int.from_bytes(b"save", "little"), 4)


def other_length_than_promised(lone: Lone) -> None:
    lone.ask(b"\x21" + SCRATCH + b"\x09\0\0\0")
    lone.ask(b"\x01abcdefg")


def maximum_below_minimum(lone: Lone) -> None:
    lone.write(0x607B, 1, 500, 4)
    lone.write(0x607B, 2, 400, 4)


def full_buffer_of_records(lone: Lone) -> None:
    lone.write(0x60C4, 2, 1, 4)
    lone.write(0x60C1, 1, 100, 4)
    lone.write(0x60C1, 1, 200, 4)


def panel_has_control(lone: Lone) -> None:
    lone.drive.take_local_control(True)
    lone.write(0x6085, 0, 5, 4)


def storing_while_enabled(lone: Lone) -> None:
    lone.enable()
    lone.write(0x1010, 1, int.from_bytes(b"save", "little"), 4)


def dictionary_not_built(lone: Lone) -> None:
    lone.drive.dictionary.missing = True
    lone.read(0x1000)


def injected(code: Code) -> Callable[[Lone], None]:
    """No state of this drive leads there; the test's hand does, as a fault in real firmware would."""

    def refuse(lone: Lone) -> None:
        lone.drive.dictionary.refusals[key(0x6085)] = code
        lone.read(0x6085)

    return refuse


CAUSES: dict[Code, Callable[[Lone], object]] = {
    Code.TOGGLE: wrong_toggle,
    Code.TIMEOUT: silent_client,
    Code.COMMAND: lambda lone: lone.ask(b"\xe0"),
    Code.BLOCK_SIZE: lambda lone: lone.ask(b"\xa0" + NAME + b"\x80"),
    Code.SEQUENCE: wrong_sequence,
    Code.CRC: wrong_checksum,
    Code.MEMORY: too_much_for_the_memory,
    Code.ACCESS: mapping_while_on,
    Code.WRITE_ONLY: lambda lone: lone.read(0x2001),
    Code.READ_ONLY: lambda lone: lone.write(0x6041, 0, 0, 2),
    Code.NO_OBJECT: lambda lone: lone.read(0x5000),
    Code.NOT_MAPPABLE: what_cannot_be_mapped,
    Code.PDO_LENGTH: nine_bytes,
    Code.INCOMPATIBLE: one_producer_watched_twice,
    Code.INTERNAL: injected(Code.INTERNAL),
    Code.HARDWARE: memory_chip_broken,
    Code.LENGTH: other_length_than_promised,
    Code.TOO_LONG: lambda lone: lone.write(0x605A, 0, 2, 4),
    Code.TOO_SHORT: lambda lone: lone.write(0x6085, 0, 2, 1),
    Code.NO_SUB_INDEX: lambda lone: lone.read(0x1000, 1),
    Code.VALUE: lambda lone: lone.write(0x6060, 0, 4, 1),
    Code.TOO_HIGH: lambda lone: lone.write(0x605A, 0, 9, 2),
    Code.TOO_LOW: lambda lone: lone.write(0x60C2, 1, 0, 1),
    Code.MAX_BELOW_MIN: maximum_below_minimum,
    Code.NO_RESOURCE: full_buffer_of_records,
    Code.GENERAL: injected(Code.GENERAL),
    Code.NOT_STORED: lambda lone: lone.write(0x1011, 1, int.from_bytes(b"laod", "little"), 4),
    Code.LOCAL_CONTROL: panel_has_control,
    Code.DEVICE_STATE: storing_while_enabled,
    Code.NO_DICTIONARY: dictionary_not_built,
    Code.NO_DATA: lambda lone: lone.read(0x1003, 1),
}


def test_every_code_of_the_table_has_a_cause() -> None:
    assert set(CAUSES) == set(Code)


@pytest.mark.parametrize("code", list(Code), ids=lambda code: f"{code:08x} {code.name.lower()}")
def test_its_cause_gives_the_code(code: Code) -> None:
    with pytest.raises(Refused) as refused:
        CAUSES[code](Lone(Parameters(sdo_patience_s=1.0)))
    assert Code(refused.value.code) is code


@pytest.mark.parametrize("code", [Code.TOGGLE, Code.CRC, Code.SEQUENCE], ids=lambda code: code.name)
def test_after_an_abort_the_next_transfer_begins_afresh(code: Code) -> None:
    lone = Lone()
    with pytest.raises(Refused):
        CAUSES[code](lone)
    assert lone.read(0x1000) == 0x20192
