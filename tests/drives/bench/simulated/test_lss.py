"""Layer setting services: node id and bit rate, selected by identity, switched or scanned."""

from __future__ import annotations

import struct

import canopen
import pytest
from support.drives.lone_drive import RESET_COMMUNICATION, START, Lone

IDENTITY = (0xD1E, 0x402, 0x10000, 5)


def lss(lone: Lone, *data: int) -> list[bytes]:
    came = lone.put(0x7E5, bytes(data).ljust(8, b"\0"))
    return [answer for can_id, answer in came if can_id == 0x7E4]


def word(lone: Lone, command: int, value: int) -> list[bytes]:
    return lss(lone, command, *struct.pack("<I", value))


def configuring() -> Lone:
    lone = Lone()
    lss(lone, 0x04, 1)
    return lone


def test_a_new_node_id_counts_from_the_next_reset_of_communication_on() -> None:
    lone = configuring()
    assert lss(lone, 0x11, 9)[0][:2] == b"\x11\0"
    lss(lone, 0x04, 0)
    assert lone.read(0x1000) == 0x20192
    lone.nmt(RESET_COMMUNICATION)
    assert lone.heard[-1] == (0x709, b"\0")
    assert lone.node == 9
    assert lone.read(0x1200, 1) == 0x609


def test_an_impossible_node_id_is_refused() -> None:
    assert lss(configuring(), 0x11, 128)[0][:2] == b"\x11\x01"


@pytest.mark.parametrize(("index", "error"), [(0, 0), (2, 0), (5, 1), (8, 0), (9, 1)])
def test_bit_rates_of_the_table_are_taken(index: int, error: int) -> None:
    assert lss(configuring(), 0x13, 0, index)[0][1] == error


def test_store_and_inquire() -> None:
    lone = configuring()
    lss(lone, 0x11, 9)
    assert lss(lone, 0x17)[0][:2] == b"\x17\0"
    assert lone.drive.lss.stored == 9
    assert lss(lone, 0x5E)[0][1] == 5
    found = tuple(struct.unpack_from("<I", lss(lone, 0x5A + k)[0], 1)[0] for k in range(4))
    assert found == IDENTITY


def test_outside_of_configuration_nothing_is_set_or_told() -> None:
    lone = Lone()
    assert [lss(lone, command, 9) for command in (0x11, 0x13, 0x17, 0x5A, 0x5E)] == [[]] * 5
    lone.nmt(START)
    lss(lone, 0x04, 1)
    assert not lone.drive.lss.configuring, "LSS rests in operational"


def test_selective_switching_needs_the_whole_identity() -> None:
    lone = Lone()
    for wrong in range(4):
        for place in range(4):
            value = IDENTITY[place] + (1 if place == wrong else 0)
            assert word(lone, 0x40 + place, value) == []
    answers = [word(lone, 0x40 + place, IDENTITY[place]) for place in range(4)]
    assert answers[3][0][0] == 0x44 and lone.drive.lss.configuring


def test_identify_by_range() -> None:
    lone = Lone()
    for words in ((0xD1E, 0x402, 0, 0x20000, 0, 9), (0xD1E, 0x402, 0, 0x20000, 6, 9)):
        answers = [word(lone, 0x46 + place, value) for place, value in enumerate(words)]
        assert bool(answers[5]) is (words[4] <= 5)


class Wire:
    """What canopen's LSS master needs of a network."""

    def __init__(self, lone: Lone) -> None:
        self.lone = lone
        self.master = canopen.lss.LssMaster()
        self.master.network = self
        self.master.RESPONSE_TIMEOUT = 0

    def send_message(self, can_id: int, data: bytes) -> None:
        for answer_id, answer in self.lone.put(can_id, bytes(data), 0.002):
            if answer_id == 0x7E4:
                self.master.on_message_received(answer_id, bytearray(answer), 0.0)


def test_canopens_fastscan_finds_a_drive_without_node_id_and_gives_it_one() -> None:
    lone = Lone(node=255)
    assert lone.heard == [], "no boot-up without a node id"
    wire = Wire(lone)
    found, identity = wire.master.fast_scan()
    assert found
    assert tuple(identity) == (0xD1E, 0x402, 0x10000, 255)
    wire.master.configure_node_id(12)
    wire.master.store_configuration()
    wire.master.send_switch_state_global(wire.master.WAITING_STATE)
    lone.wait(0.05)
    assert lone.heard[-1] == (0x70C, b"\0")
    assert lone.read(0x1000) == 0x20192


def test_canopens_selective_switching_works() -> None:
    lone = Lone()
    wire = Wire(lone)
    assert wire.master.send_switch_state_selective(*IDENTITY)
    assert wire.master.inquire_node_id() == 5
