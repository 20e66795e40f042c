"""Commissioning over SocketCAN, checked by a client that is not ours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import canopen
import pytest
from guest import on_can
from support.live.live_machines import Listener

from controller.machine import machine_file
from controller.machine.model import Machine
from drives import bus, commission, pdo
from drives.settings import NodeSettings

NODES = range(1, 6)


@pytest.fixture
def machine() -> Iterator[Machine]:
    with on_can.drives():
        yield on_can.machine()


def commissioned(machine: Machine, nodes: tuple[NodeSettings, ...]) -> None:
    (settings,) = machine_file.bus_settings(machine)
    port = bus.open(settings, pdo.SERVICE_FILTERS)
    try:
        network = commission.Network(port, commission.wall_pump(port.fileno()))
        commission.commission(network, nodes, machine_file.master_settings(machine))
    finally:
        port.close()


def test_five_drives_are_commissioned_and_another_client_reads_it_in_them(machine: Machine) -> None:
    nodes = machine_file.node_settings(machine)
    commissioned(machine, nodes)
    network = canopen.Network()
    network.connect(interface="socketcan", channel="vcan0")
    try:
        for settings in nodes:
            node = network.add_node(settings.node, settings.eds)
            assert node.nmt.wait_for_heartbeat(5.0) == "OPERATIONAL"
            assert node.sdo[0x1400][1].raw == 0x200 + settings.node
            assert [node.sdo[0x1600][sub].raw for sub in (1, 2)] == [0x6040_0010, 0x607A_0020]
            assert (node.sdo[0x60C2][1].raw, node.sdo[0x60C2][2].raw) == (10, -3)
            assert node.sdo[0x1016][1].raw == 127 << 16 | 200
            assert node.sdo[0x607D][1].raw == settings.counts_min
            assert node.sdo[0x6061].raw == 8
        assert sorted(network.scanner.nodes) == list(NODES)
    finally:
        network.disconnect()


def downloads(listener: Listener) -> int:
    """SDO downloads begun (CiA 301, 7.2.4.3.3) since it was last asked."""
    listener.listen()
    heard, listener.frames = listener.frames, []
    return sum(0x600 < can_id < 0x680 and data[0] >> 5 == 1 for can_id, data in heard)


def test_commissioning_again_writes_nothing(machine: Machine) -> None:
    nodes = machine_file.node_settings(machine)
    listener = Listener(machine)
    commissioned(machine, nodes)
    assert downloads(listener) > 5 * len(nodes)
    commissioned(machine, nodes)
    assert downloads(listener) == 0


def test_a_drive_that_is_not_there_is_refused_by_name_and_node(machine: Machine) -> None:
    nodes = machine_file.node_settings(machine)
    absent = replace(nodes[2], node=9)
    with pytest.raises(commission.CommissionError, match=r"Z \(node 9\).*no answer"):
        commissioned(machine, (*nodes[:2], absent))
