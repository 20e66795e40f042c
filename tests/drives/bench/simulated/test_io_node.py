"""Digital inputs and outputs (CiA 401) on the stepped bus, and with canopen's own client."""

from __future__ import annotations

import struct

import canopen
import pytest

from drives import pdo
from drives.bench.simulated import IoNode
from drives.bench.simulated.io_node import IO_EDS
from drives.bench.virtual.virtual_bus import SteppedBus

NODE = 11
START, PRE_OPERATIONAL, RESET_NODE = 0x01, 0x80, 0x81


class Bench:
    """The node, operational, and a hand that puts frames on its bus."""

    def __init__(self) -> None:
        self.bus = SteppedBus()
        self.node = IoNode(NODE)
        self.bus.attach(self.node)
        self.heard: list[tuple[int, bytes]] = []
        self._source = self.bus.connect(lambda frame, _at_s: self.heard.append(pdo.unpack(frame)))
        self.wait(0.03)
        self.put(pdo.NMT, bytes([START, NODE]))
        self.heard.clear()

    def wait(self, seconds: float) -> None:
        self.bus.advance(self.bus.now_s + seconds)

    def put(self, can_id: int, data: bytes) -> None:
        self.bus.submit(self._source, self.bus.now_s, can_id, bytes(pdo.frame(can_id, data)))
        self.wait(0.002)

    def write(self, index: int, sub: int, value: int, size: int = 1) -> bytes:
        head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
        self.put(0x600 + NODE, head + value.to_bytes(size, "little").ljust(4, b"\0"))
        return self.heard[-1][1]

    def outputs(self, word: int) -> None:
        self.put(pdo.RPDO1 + NODE, word.to_bytes(4, "little"))

    def set_input(self, number: int, on: bool) -> None:
        self.node.set_input(number, on, self.bus.now_s)
        self.wait(0.002)

    @property
    def shown(self) -> list[int]:
        """Inputs by TPDO, one number per frame."""
        return [int.from_bytes(data, "little") for can_id, data in self.heard if can_id == 0x180 + NODE]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_changed_input_goes_out_at_once(bench: Bench) -> None:
    bench.set_input(3, True)
    bench.set_input(9, True)
    bench.set_input(3, False)
    assert bench.shown == [0x008, 0x208, 0x200]


def test_outputs_follow_the_rpdo_and_the_watchers_hear_of_it(bench: Bench) -> None:
    seen: list[int] = []
    bench.node.watchers.append(lambda word, _at_s: seen.append(word))
    bench.outputs(0x05)
    bench.outputs(0x05)
    bench.outputs(0x04)
    assert seen == [0x05, 0x04] and bench.node.outputs == 0x04


def test_a_wire_closes_a_switch_after_its_delay(bench: Bench) -> None:
    bench.node.wire(2, 5, delay_s=0.01)
    bench.node.wire(2, 6, delay_s=0.02, inverted=True)
    bench.wait(0.05)
    assert bench.node.inputs == 0x40
    bench.outputs(0x04)
    assert bench.node.inputs == 0x40
    bench.wait(0.01)
    assert bench.node.inputs == 0x60
    bench.wait(0.01)
    assert bench.node.inputs == 0x20


def test_a_switch_that_is_called_back_does_not_close(bench: Bench) -> None:
    bench.node.wire(0, 1, delay_s=0.01)
    bench.outputs(1)
    bench.outputs(0)
    bench.wait(0.05)
    assert bench.node.inputs == 0


@pytest.mark.parametrize("index", [0x6005, 0x6006])
def test_without_its_interrupt_a_change_waits_for_the_next_question(bench: Bench, index: int) -> None:
    bench.write(index, 0 if index == 0x6005 else 1, 0)
    bench.set_input(0, True)
    bench.wait(0.1)
    assert bench.shown == []
    bench.put(0x600 + NODE, bytes.fromhex("4000600100000000"))
    assert (0x580 + NODE, bytes.fromhex("4f00600101000000")) in bench.heard


def test_rising_and_falling_interrupts_can_be_chosen(bench: Bench) -> None:
    bench.write(0x6006, 1, 0)
    bench.write(0x6007, 1, 0x01)
    bench.write(0x6008, 1, 0x02)
    for number in (0, 1):
        bench.set_input(number, True)
        bench.set_input(number, False)
    assert bench.shown == [0x01, 0x00]


def test_polarities_turn_single_bits_round(bench: Bench) -> None:
    bench.write(0x6002, 1, 0x01)
    bench.set_input(0, True)
    assert bench.shown[-1] & 1 == 0
    bench.write(0x6202, 1, 0x80)
    assert bench.node.outputs == 0x80


def test_the_filter_keeps_an_output_as_it_is(bench: Bench) -> None:
    bench.outputs(0x01)
    bench.write(0x6208, 1, 0xFE)
    bench.outputs(0x02)
    assert bench.node.outputs == 0x03


def silent_master(bench: Bench) -> None:
    bench.write(0x1016, 1, 0x7F_0064, 4)
    bench.put(0x77F, b"\x05")
    bench.wait(0.2)


def test_outputs_are_off_when_the_master_is_silent(bench: Bench) -> None:
    bench.outputs(0xFF)
    silent_master(bench)
    assert bench.node.outputs == 0
    assert (0x080 + NODE, bytes.fromhex("3081110000000000")) in bench.heard


def test_an_output_may_keep_its_state_or_take_a_chosen_one(bench: Bench) -> None:
    bench.write(0x6206, 1, 0xFD)
    bench.write(0x6207, 1, 0x10)
    bench.outputs(0x0F)
    silent_master(bench)
    assert bench.node.outputs == 0x12


@pytest.mark.parametrize("command", [PRE_OPERATIONAL, RESET_NODE])
def test_leaving_operation_switches_the_outputs_off(bench: Bench, command: int) -> None:
    bench.outputs(0xFF)
    bench.put(pdo.NMT, bytes([command, NODE]))
    assert bench.node.outputs == 0


def test_a_loss_of_the_supply_switches_off_and_boots(bench: Bench) -> None:
    bench.outputs(0xFF)
    bench.node.power_cycle(bench.bus.now_s)
    assert bench.node.outputs == 0
    bench.wait(0.05)
    assert bench.heard[-1] == (0x700 + NODE, b"\0")


def test_inputs_are_repeated_by_the_event_timer(bench: Bench) -> None:
    bench.set_input(0, True)
    bench.write(0x1800, 5, 20, 2)
    bench.heard.clear()
    bench.wait(0.1)
    assert bench.shown == [1] * 5


def test_inputs_can_be_set_over_the_bus_for_tests(bench: Bench) -> None:
    bench.write(0x2004, 0, 0x8001, 4)
    assert bench.node.inputs == 0x8001 and bench.shown == [0x8001]


def test_its_data_sheet_says_what_it_is() -> None:
    sheet = canopen.import_od(str(IO_EDS), NODE)
    assert sheet[0x1000].default == 0x000B_0191
    assert sheet.device_information.product_number == sheet[0x1018][2].default == 0x401
