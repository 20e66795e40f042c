"""Frames that the kernel throws away because nobody took them are noticed."""

from __future__ import annotations

import socket

from guest import on_can

from controller.machine import machine_file
from drives import bus, pdo
from drives.bus import Port
from drives.cia402 import Wanted
from drives.cyclic.drive import Drive, DriveFault
from drives.cyclic.group import Group

FLOOD = 20_000  # frames; the receive queue asked for holds far fewer
STRANGER = bytes(pdo.frame(pdo.TPDO1 + 100, bytes(8)))  # passes the tick's filters, is no drive's


def flood(frames: int) -> None:
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender:
        sender.bind(("vcan0",))
        for _ in range(frames):
            sender.send(STRANGER)


def emptied(port: Port) -> int:
    buffer, count = bytearray(pdo.FRAME_BYTES), 0
    while port.receive_into(buffer):
        count += 1
    return count


def test_a_port_counts_the_frames_that_its_full_queue_lost() -> None:
    (settings,) = machine_file.bus_settings(on_can.machine())
    port = bus.open(settings)
    flood(100)
    assert (emptied(port), port.overflows) == (100, 0)
    flood(FLOOD)
    kept = emptied(port)
    assert 500 < kept < FLOOD
    flood(1)  # the count comes with the next frame that finds room
    assert (emptied(port), port.overflows) == (1, FLOOD - kept)
    port.close()


def test_a_group_makes_a_fault_of_it() -> None:
    machine = on_can.machine()
    (settings,) = machine_file.bus_settings(machine)
    port = bus.open(settings)
    drives = [Drive(node) for node in machine_file.node_settings(machine)]
    group = Group(drives, {settings.name: port}, machine_file.master_settings(machine))
    group.want(Wanted.ENABLED)
    group.receive(0.0)
    assert group.fault(0.0)[0] is DriveFault.NONE
    flood(FLOOD)
    emptied(port)
    flood(1)
    group.receive(0.0)
    assert group.fault(0.0)[0] is DriveFault.RX_OVERFLOW
    group.close()
