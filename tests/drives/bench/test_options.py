"""A serial adapter whose bus a hub shares between processes. No time is asserted."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from support.drives.hub_guests import (
    Served,
    by_hub,
    heard,
    heard_at_once,
    let_in,
    same,
    serving,
    until,
)
from support.drives.serial_pty import Pty

from drives import bus, pdo
from drives.bench import options
from drives.bench.virtual.hub import Hub
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.line import Line
from drives.ports import hub_protocol
from drives.settings import BusSettings


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    with serving(tmp_path) as made:
        yield made


MESSAGES = [
    can.Message(arbitration_id=0x123, data=b"\x11\xff\x00", is_extended_id=False),
    can.Message(arbitration_id=0x080, data=b"", is_extended_id=False),
    can.Message(arbitration_id=0x1ABCDEF0, data=bytes(range(8)), is_extended_id=True),
]


def test_our_own_serial_adapter_port_speaks_with_the_terminal(served: Served) -> None:
    port = bus.open(BusSettings("can0", "slcan", served.link, 1_000_000))
    native = served.native()
    try:
        assert port.send(pdo.frame(0x201, b"\x0f\x00") + pdo.frame(0x202, b"\x0f\x01"))
        assert [m.arbitration_id for m in heard(native, 2)] == [0x201, 0x202]
        native.send(can.Message(arbitration_id=0x181, data=b"\x37\x06", is_extended_id=False))
        buffer = bytearray(16)
        until(lambda: port.receive_into(buffer))
        assert pdo.unpack(buffer) == (0x181, b"\x37\x06")
        assert port.overflows == 0
    finally:
        native.shutdown()
        port.close()


def test_a_serial_adapter_is_shared_by_a_hub(served: Served, tmp_path: Path) -> None:
    shared = Hub(str(tmp_path / "shared"), bit_rate=0)
    ends: list[bool] = []
    with options.equipped(shared, serial=f"{served.link}=1000000"):
        thread = threading.Thread(target=shared.run, args=(lambda: bool(ends),))
        thread.start()
        native, one, two = served.native(), let_in(shared), let_in(shared)
        try:
            native.send(MESSAGES[0])
            assert same(heard(one, 1), MESSAGES[:1])
            assert same(heard(two, 1), MESSAGES[:1])
            one.send(MESSAGES[2])
            assert same(heard(two, 1), MESSAGES[2:])
            assert same(heard(native, 1), MESSAGES[2:])
            far = served.hub.bus
            opened = far.errors.of(served.terminal.source)
            by_hub(served.hub, lambda: far.errors.switch_off(opened, far.now_s))
            (error,) = heard(two, 1)
            assert error.is_error_frame
            assert error.arbitration_id == 0x40
            one._socket.send(hub_protocol.RESTART_FRAME)
            until(lambda: same(heard_at_once(native, one, MESSAGES[0]), MESSAGES[:1]))
        finally:
            for each in (native, one, two):
                each.shutdown()
            ends.append(True)
            thread.join()
            shared.close()


def test_frames_that_a_shared_adapter_has_lost_are_raised_by_everybody_who_shares_it(tmp_path: Path) -> None:
    shared, line_s_end = Hub(str(tmp_path / "shared"), bit_rate=0), Pty()
    with options.equipped(shared, serial=f"{line_s_end.path}=1000000"):
        port = bus.open(BusSettings("can0", "shared", shared.path, 1_000_000))
        line = Line(port, [], -1)
        line_s_end.write(b"t18121122\r")

        def drained(fault: DriveFault) -> bool:
            shared.turn(time.monotonic() + 0.01)
            line.drain(0.0)
            return line.fault is fault

        until(lambda: drained(DriveFault.NONE) and line.bits > 0)
        line_s_end.write(b"e1o\r")
        until(lambda: drained(DriveFault.RX_OVERFLOW))
        line.forget()
        line_s_end.write(b"t18121122\r")
        line.bits = 0
        until(lambda: drained(DriveFault.NONE) and line.bits > 0)
        port.close()
    shared.close()
    line_s_end.cut()


def test_an_adapter_that_has_nothing_to_wait_on_is_shared_by_a_hub(tmp_path: Path) -> None:
    """An interface of python-can; whoever joins hears what comes there, and not itself."""
    shared = Hub(str(tmp_path / "shared"), bit_rate=0)
    adapter = bus.AdapterSocket(can.Bus(interface="virtual", channel="shared"), "can0", options.EVERYTHING)
    assert adapter.fileno() == -1
    shared.open_gateway(options.SharedAdapter(shared, adapter))
    ports = [bus.open(BusSettings("can0", "shared", shared.path, 1_000_000), [(0, 0)]) for _ in range(2)]
    far = can.Bus(interface="virtual", channel="shared")

    def got(port: bus.Port) -> list[int]:
        buffer, found = bytearray(16), list[int]()

        def turned() -> list[int]:
            shared.turn(time.monotonic() + 0.01)
            while port.receive_into(buffer):
                found.append(pdo.unpack(buffer)[0])
            return found

        until(lambda: bool(turned()))
        return found

    while len(shared._clients) < 2:  # one who has only knocked hears nothing
        shared.turn(time.monotonic() + 0.01)
    far.send(MESSAGES[0])
    assert [got(port) for port in ports] == [[0x123], [0x123]]
    assert ports[0].send(pdo.frame(0x201, b"\x0f\x00") + pdo.frame(0x202, b"\x0f\x01"))
    assert got(ports[1]) == [0x201, 0x202]
    assert [one.arbitration_id for one in heard(far, 2)] == [0x201, 0x202]
    assert not ports[0].receive_into(bytearray(16))
    for port in ports:
        port.close()
    shared.close()
    far.shutdown()


@pytest.mark.parametrize("serial", ["/dev/ttyACM0", "=1000000", "/dev/ttyACM0=fast"])
def test_a_serial_adapter_that_is_not_fully_named_is_a_sentence(tmp_path: Path, serial: str) -> None:
    hub = Hub(str(tmp_path / "hub"))
    refused = pytest.raises(bus.BusError, match="write its port and bit rate")
    with refused, options.equipped(hub, serial=serial):
        pass
    hub.close()
