"""Whatever comes over the bus, a device lives on, and a reset brings it back."""

from __future__ import annotations

import random

import pytest
from support.drives.lone_drive import PRE_OPERATIONAL, RESET_COMMUNICATION, RESET_NODE, START, STOP, Lone

from drives import pdo
from drives.bench.simulated import IoNode
from drives.bench.virtual.virtual_bus import SteppedBus

FRAMES = 8000
COMMANDS = (*[START] * 30, PRE_OPERATIONAL, STOP, RESET_NODE, RESET_COMMUNICATION, 0x55)
NODE = 5
SDO, RPDOS = 0x600 + NODE, (0x200 + NODE, 0x300 + NODE)
EVERYWHERE = (pdo.NMT, pdo.SYNC, 0x100, *RPDOS, *[SDO] * 5)


def frame(random_: random.Random, indexes: list[int]) -> tuple[int, bytes]:
    """Mostly frames that mean something: SDO to objects that are there, NMT, LSS, process data."""
    can_id = random_.choice(EVERYWHERE) if random_.random() < 0.95 else random_.randrange(0x800)
    data = bytearray(random_.randbytes(random_.choice((0, 1, 2, 6, 8, 8, 8, 8))))
    if can_id == SDO and len(data) == 8 and random_.random() < 0.9:
        where = random_.choice((*indexes, *[0x6040_00, 0x6060_00] * 30))
        data[0] = random_.choice((0x23, 0x2B, 0x2F, 0x40, 0x21, 0xA0, 0xC2, 0x60, data[0]))
        data[1:4] = (where >> 8).to_bytes(2, "little") + bytes([where & 0xFF])
        if random_.random() < 0.5:
            data[4:8] = random_.choice((0, 1, 2, 3, 6, 7, 8, 9, 15, 255, 0x8000_0000)).to_bytes(4, "little")
    if can_id == pdo.NMT:
        data = bytearray((random_.choice(COMMANDS), random_.choice((0, NODE))))
    flag = random_.choice((0, 0, 0, 0, 0, 0, pdo.REMOTE_FLAG, pdo.EXTENDED_FLAG))
    return can_id | (flag if random_.random() < 0.2 else 0), bytes(data)


def enable(lone: Lone, mode: int) -> None:
    """As far as the drive lets it."""
    lone.put(pdo.NMT, bytes([START, NODE]), 0.05)
    lone.put(SDO, bytes.fromhex("2f606000") + mode.to_bytes(4, "little"), 0.01)
    for word in (0x00, 0x80, 0x06, 0x07, 0x0F):
        lone.put(SDO, bytes.fromhex("2b406000") + word.to_bytes(4, "little"), 0.03)


@pytest.mark.parametrize("seed", range(1))
def test_a_drive_survives_any_frame(seed: int) -> None:
    random_ = random.Random(seed)
    lone = Lone(node=NODE)
    indexes = list(lone.drive.dictionary.variables)
    powered = 0
    for k in range(FRAMES):
        if k % 50 == 0:
            enable(lone, random_.choice((1, 3, 6, 7, 8, 9)))
        powered += lone.drive.axis.powered
        lone.put(*frame(random_, indexes), wait_s=random_.choice((0.0, 0.0005, 0.002)))
    assert len(lone.of(0x580 + NODE)) > FRAMES // 20, f"seed {seed}: it has to be alive for this"
    assert powered > FRAMES // 10
    lone.wait(1.0)
    lone.drive.power_cycle(lone.bus.now_s)
    lone.wait(0.1)
    assert lone.heard[-1][0] & 0x780 in (0x700, 0x080) or lone.drive.node == 255, f"seed {seed}"


@pytest.mark.parametrize("seed", range(1))
def test_inputs_and_outputs_survive_any_frame(seed: int) -> None:
    random_ = random.Random(seed)
    bus, node = SteppedBus(), IoNode(NODE)
    bus.attach(node)
    node.wire(0, 3, 0.001)
    source = bus.connect(lambda _frame, _at_s: None)
    indexes = list(node.dictionary.variables)
    for _ in range(FRAMES):
        can_id, data = frame(random_, indexes)
        bus.submit(source, bus.now_s, can_id, bytes(pdo.frame(can_id, data)))
        node.set_inputs(random_.randrange(256), bus.now_s)
        bus.advance(bus.now_s + random_.choice((0.0, 0.0005, 0.002)))
    node.power_cycle(bus.now_s)
    assert node.outputs == 0, f"seed {seed}"
