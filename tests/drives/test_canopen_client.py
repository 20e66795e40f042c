"""The canopen package's own client, as it comes, against a simulated drive.

Once on the stepped bus, and once through the hub by the python-can plugin, where a
thread of the client receives and time is the wall's. No time is asserted.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator

import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError
from support.drives.hub_process import ANSWER_S, served
from support.drives.lone_drive import Lone
from support.drives.stepped_drives import EDS

from drives.bench.simulated.io_node import IO_EDS
from drives.bench.virtual.hub_bus import HubBus

NODE = 5
NODES, IO = range(1, 6), 11
TEN_KB = random.Random(10).randbytes(10_000)
SCRATCH = 0x2002
COMMANDS = {0x1010, 0x1011, 0x1003, 0x2001}  # what is written there is no value to be kept
BLOCK_S, FRAME_S = 0.03, 0.002


class Stepped(canopen.Network):
    """canopen's network on a stepped bus: time passes with every frame that is sent."""

    def __init__(self, lone: Lone) -> None:
        super().__init__()
        self._lone = lone

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        sends_a_block = can_id == 0x600 + NODE and data[0] in (0xA2, 0xA3)
        for heard, answer in self._lone.put(can_id, bytes(data), BLOCK_S if sends_a_block else FRAME_S):
            self.notify(heard, bytearray(answer), self._lone.bus.now_s)

    def pause(self) -> None:
        before = len(self._lone.heard)
        self._lone.wait(0.01)
        for heard, answer in self._lone.heard[before:]:
            self.notify(heard, bytearray(answer), self._lone.bus.now_s)


class Hubbed(canopen.Network):
    """canopen's network on the hub, joined by the plugin."""

    def pause(self) -> None:
        time.sleep(0.01)


Net = Stepped | Hubbed


def wait_for(network: Net, done: Callable[[], bool]) -> None:
    for _ in range(5000):
        if done():
            return
        network.pause()
    raise AssertionError("it never came")


@pytest.fixture(scope="module")
def hubbed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hubbed]:
    path = tmp_path_factory.mktemp("hub") / "can"
    with served(path, "--nodes", *map(str, NODES), "--io", str(IO), nodes=(*NODES, IO)):
        joined = Hubbed(bus=HubBus(str(path)))
        joined.connect()
        yield joined
        joined.disconnect()


@pytest.fixture(params=["stepped", "hub"])
def network(request: pytest.FixtureRequest) -> Net:
    """A drive as after power-on."""
    if request.param == "stepped":
        return Stepped(Lone(node=NODE))
    joined: Hubbed = request.getfixturevalue("hubbed")
    reset(joined, NODE)
    return joined


def reset(network: Hubbed, node: int) -> None:
    """As after power-on."""
    booted: list[int] = []
    network.subscribe(0x700 + node, lambda _can_id, data, _at_s: booted.append(data[0]))
    network.send_message(0, bytes([0x81, node]))
    wait_for(network, lambda: 0 in booted)


def client(network: Net, number: int, eds: str = EDS) -> canopen.RemoteNode:
    made = canopen.RemoteNode(number, eds)
    network.add_node(made)
    made.sdo.RESPONSE_TIMEOUT = ANSWER_S
    return made


@pytest.fixture
def node(network: Net) -> canopen.RemoteNode:
    return client(network, NODE)


def read_and_write_back(node: canopen.RemoteNode) -> tuple[int, int]:
    """Every object of its data sheet; how many were read and written."""
    has = node.object_dictionary
    for parameters in [base + n for base in (0x1400, 0x1800) for n in range(4) if base + n in has]:
        number = node.sdo[parameters][1]
        number.raw = number.raw | 0x8000_0000
    counts = {}
    for mapping in [base + n for base in (0x1600, 0x1A00) for n in range(4) if base + n in has]:
        counts[mapping] = node.sdo[mapping][0].raw
        node.sdo[mapping][0].raw = 0
    read = written = 0
    for entry in node.object_dictionary.values():
        for variable in entry.values() if hasattr(entry, "subindices") else [entry]:
            if variable.readable and entry.index >= 0x1000 and entry.index not in COMMANDS:
                data = node.sdo.upload(variable.index, variable.subindex)
                read += 1
                if variable.writable and data:
                    node.sdo.download(variable.index, variable.subindex, data)
                    written += 1
                    assert node.sdo.upload(variable.index, variable.subindex) == data
    for mapping, count in counts.items():
        node.sdo[mapping][0].raw = count
    return read, written


def test_it_reads_every_object_and_writes_back_every_parameter(node: canopen.RemoteNode) -> None:
    read, written = read_and_write_back(node)
    assert read > 250
    assert written > 150


def test_it_reads_and_writes_all_of_an_input_and_output_node(hubbed: Hubbed) -> None:
    reset(hubbed, IO)
    node = client(hubbed, IO, str(IO_EDS))
    read, written = read_and_write_back(node)
    assert read > 120
    assert written > 60
    node.sdo[0x6200][1].raw = 0xA5
    assert node.sdo[0x6200][1].raw == 0xA5


@pytest.mark.parametrize("block", [False, True], ids=["segments", "blocks"])
def test_ten_kilobytes_go_down_and_come_up_unchanged(node: canopen.RemoteNode, block: bool) -> None:
    with node.sdo.open(SCRATCH, 0, "wb", size=len(TEN_KB), block_transfer=block, buffering=7000) as file:
        file.write(TEN_KB)
    with node.sdo.open(SCRATCH, 0, "rb", block_transfer=block, buffering=0 if block else 7000) as file:
        got = b""
        while part := file.read(7 if block else -1):
            got += part
    assert got == TEN_KB


def test_it_remaps_process_data_and_uses_them(network: Net, node: canopen.RemoteNode) -> None:
    node.rpdo.read()
    node.tpdo.read()
    incoming, outgoing = node.rpdo[3], node.tpdo[3]
    incoming.clear()
    incoming.add_variable(0x60FF)
    incoming.add_variable(0x6060)
    incoming.cob_id, incoming.trans_type, incoming.enabled = 0x400 + NODE, 1, True
    incoming.save()
    outgoing.clear()
    outgoing.add_variable(0x6061)
    outgoing.add_variable(0x6041)
    outgoing.add_variable(0x6064)
    outgoing.cob_id, outgoing.trans_type, outgoing.enabled = 0x380 + NODE, 1, True
    outgoing.save()
    node.nmt.state = "OPERATIONAL"
    incoming[0].raw, incoming[1].raw = 12345, 3
    incoming.transmit()

    def shown() -> bool:
        network.sync.transmit()
        network.pause()
        return bool(outgoing[0].raw == 3)

    wait_for(network, shown)
    assert node.sdo[0x60FF].raw == 12345
    assert outgoing[1].raw & 0x4F == 0x40


def lead_through_every_state(network: Net, node: canopen.RemoteNode) -> list[int]:
    """The states' part of the statusword, in the order they were reached."""
    sdo = node.sdo
    reached: list[int] = []
    sdo[0x605A].raw, sdo[0x605E].raw = 6, 1
    sdo[0x6060].raw = 3
    sdo[0x6084].raw = 500_000

    def reach(mask: int, value: int, word: int | None = None) -> None:
        if word is not None:
            sdo[0x6040].raw = word
        wait_for(network, lambda: sdo[0x6041].raw & mask == value)
        reached.append(value)

    reach(0x4F, 0x40)
    for word, value in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27), (0x02, 0x07), (0x0F, 0x27)):
        reach(0x6F, value, word)
    sdo[0x60FF].raw = 200_000
    wait_for(network, lambda: sdo[0x606C].raw > 190_000)
    sdo[0x2001].raw = 0x7305
    reach(0x4F, 0x0F)
    reach(0x4F, 0x08)
    sdo[0x6040].raw = 0x00
    reach(0x4F, 0x40, 0x80)
    return reached


# NOT READY TO SWITCH ON is before the boot-up message: no SDO answers there.
EVERY_STATE = {0x40, 0x21, 0x23, 0x27, 0x07, 0x0F, 0x08}


def test_it_leads_a_node_through_every_state(network: Net, node: canopen.RemoteNode) -> None:
    assert set(lead_through_every_state(network, node)) == EVERY_STATE


@pytest.mark.parametrize("number", NODES)
def test_it_leads_each_node_of_a_bus_through_every_state(hubbed: Hubbed, number: int) -> None:
    reset(hubbed, number)
    assert set(lead_through_every_state(hubbed, client(hubbed, number))) == EVERY_STATE


# What a client's plain uploads and downloads can meet; the rest of the table, which takes broken
# frames or a broken drive, is in simulated/test_abort_codes.py.
ZERO = bytes(4)
REFUSALS = [
    (0x0601_0001, "read", 0x2001, 0, b""),
    (0x0601_0002, "write", 0x1000, 0, ZERO),
    (0x0602_0000, "read", 0x5000, 0, b""),
    (0x0601_0000, "write", 0x1600, 0, b"\x01"),
    (0x0604_0041, "write", 0x1602, 1, (0x6065_0020).to_bytes(4, "little")),
    (0x0604_0042, "write", 0x1602, 0, b"\x40"),
    (0x0604_0043, "write", 0x1016, 2, (0x7F_0064).to_bytes(4, "little")),
    (0x0607_0012, "write", 0x6060, 0, ZERO),
    (0x0607_0013, "write", 0x6081, 0, b"\0\0"),
    (0x0609_0011, "read", 0x1018, 9, b""),
    (0x0609_0030, "write", 0x6060, 0, b"\x63"),
    (0x0609_0031, "write", 0x605A, 0, b"\x63\0"),
    (0x0609_0032, "write", 0x60C2, 1, b"\0"),
    (0x0609_0036, "write", 0x607B, 2, (-5).to_bytes(4, "little", signed=True)),
    (0x0800_0020, "write", 0x1010, 1, b"evas"),
    (0x0800_0022, "write", 0x1019, 0, b"\x10"),
    (0x0800_0024, "read", 0x1003, 5, b""),
]


@pytest.mark.parametrize("refusal", REFUSALS, ids=[f"{r[0]:08x}" for r in REFUSALS])
def test_what_the_drive_refuses_arrives_as_canopens_error(refusal: tuple[int, str, int, int, bytes]) -> None:
    code, way, index, sub, data = refusal
    node = client(Stepped(Lone(node=NODE)), NODE)
    node.sdo[0x1006].raw = 1_000_000  # so that 1019h may not be written
    node.sdo[0x1016][1].raw = 0x7F_0064
    node.sdo[0x607B][1].raw = 5
    node.sdo[0x1602][0].raw = 0
    with pytest.raises(SdoAbortedError) as refused:
        node.sdo.upload(index, sub) if way == "read" else node.sdo.download(index, sub, data)
    assert refused.value.code == code


def test_heartbeat_and_emergency_reach_the_client(network: Net, node: canopen.RemoteNode) -> None:
    node.sdo[0x1017].raw = 20
    wait_for(network, lambda: node.nmt.state == "PRE-OPERATIONAL")
    node.nmt.send_command(0x01)
    wait_for(network, lambda: node.nmt.state == "OPERATIONAL")
    node.sdo[0x2001].raw = 0x4310
    wait_for(network, lambda: bool(node.emcy.log))
    assert (node.emcy.log[0].code, node.emcy.log[0].register) == (0x4310, 0x09)
