"""Tools that know other protocols on the virtual bus, with unmodified python-can. No time is asserted."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import threading
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
from support.drives.gateway_guests import (
    TIMEOUT_S,
    Served,
    by_hub,
    heard,
    heard_at_once,
    let_in,
    same,
    serving,
    until,
)

from drives import bus, pdo
from drives.bench.gateways import options
from drives.bench.gateways.slcan import SlcanTerminal
from drives.bench.virtual.hub import Hub
from drives.ports import hub_protocol
from drives.settings import BusSettings

ROOT = Path(__file__).parents[4]


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    with serving(tmp_path) as made:
        yield made


MESSAGES = [
    can.Message(arbitration_id=0x123, data=b"\x11\xff\x00", is_extended_id=False),
    can.Message(arbitration_id=0x080, data=b"", is_extended_id=False),
    can.Message(arbitration_id=0x1ABCDEF0, data=bytes(range(8)), is_extended_id=True),
]


def installed(folder: Path) -> dict[str, str]:
    """The environment of a process for which the package is installed, with the plugins it declares."""
    plugins = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    made = folder / "directrix-0.dist-info"
    made.mkdir()
    (made / "METADATA").write_text("Metadata-Version: 2.1\nName: directrix\nVersion: 0\n")
    lines = [
        f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in ways.items()) for group, ways in plugins.items()
    ]
    (made / "entry_points.txt").write_text("\n".join(lines))
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(folder), str(ROOT)))}


def test_python_can_finds_the_virtual_bus_by_the_name_of_its_plugin(served: Served, tmp_path: Path) -> None:
    tool = (
        "import can, sys\n"
        "bus = can.Bus(interface='directrix', channel=sys.argv[1], bitrate=1_000_000)\n"
        "bus.send(can.Message(arbitration_id=0x123, data=b'\\x11', is_extended_id=False))\n"
        "assert bus.recv(20.0).arbitration_id == 0x124\n"
        "bus.shutdown()\n"
    )
    native = served.native()
    process = subprocess.Popen(
        [sys.executable, "-c", tool, served.path], env=installed(tmp_path), cwd=tmp_path
    )
    assert [m.arbitration_id for m in heard(native, 1)] == [0x123]
    native.send(can.Message(arbitration_id=0x124, is_extended_id=False))
    assert process.wait(TIMEOUT_S) == 0
    native.shutdown()


@pytest.mark.parametrize("interface", ["socketcand", "slcan"])
def test_python_can_comes_in_by_a_gateway_and_hears_and_is_heard(served: Served, interface: str) -> None:
    open_bus: Callable[[], can.BusABC] = getattr(served, interface)
    guest, native = open_bus(), served.native()
    try:
        for message in MESSAGES:
            guest.send(message)
            assert same(heard(native, 1), [message])
            native.send(message)
            assert same(heard(guest, 1), [message])
    finally:
        native.shutdown()
        guest.shutdown()


def test_slcan_carries_remote_frames(served: Served) -> None:
    guest, native = served.slcan(), served.native()
    remote = can.Message(arbitration_id=0x703, is_remote_frame=True, dlc=1, is_extended_id=False)
    try:
        guest.send(remote)
        assert same(heard(native, 1), [remote])
        native.send(remote)
        assert same(heard(guest, 1), [remote])
    finally:
        native.shutdown()
        guest.shutdown()


NONSENSE = (
    b"< send 123 2 11 >",
    b"< send xyz 0 >",
    b"< send >",
    b"< send 123 1 1FF >",
    b"< send -1 0 >",
    b"< send 0x1 0 >",
    b"< send FFF 0 >",
    b"< send 20000000 0 >",
    b"< send 123 1 -1 >",
)


def test_what_a_guest_says_that_makes_no_sense_is_answered_and_changes_nothing(served: Served) -> None:
    with socket.create_connection(("127.0.0.1", served.tcp.port)) as guest:
        guest.settimeout(TIMEOUT_S)

        def ask(text: bytes) -> bytes:
            guest.sendall(text)
            return guest.recv(256)

        assert guest.recv(256) == b"< hi >"
        assert ask(b"< send 123 1 11 >").startswith(b"< error send 123")
        assert ask(b"< open can0 >") == b"< ok >"
        assert ask(b"< rawmode >") == b"< ok >"
        for nonsense in NONSENSE:
            assert re.fullmatch(rb"< error 20000004 [0-9.]+ send: [^<>]+ >", ask(nonsense)), nonsense
        assert ask(b"junk" * 100 + b"< echo >") == b"< echo >"
    assert served.hub.bus.frames == 0


def test_only_this_computer_can_come_in(served: Served) -> None:
    assert served.tcp._server.getsockname()[0] == "127.0.0.1"


def test_a_guest_that_leaves_is_forgotten(served: Served) -> None:
    before = len(served.hub.bus._ports)
    guest = served.socketcand()
    guest.shutdown()
    until(lambda: len(served.hub.bus._ports) == before)


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


def test_an_adapter_of_python_can_takes_options_in_its_channel(served: Served) -> None:
    channel = f"can0?host=127.0.0.1&port={served.tcp.port}"
    port = bus.open(BusSettings("can0", "socketcand", channel, 1_000_000))
    native = served.native()
    assert port.send(pdo.frame(0x201, b"\x0f\x00"))
    assert [m.arbitration_id for m in heard(native, 1)] == [0x201]
    native.shutdown()
    port.close()


def test_the_link_goes_with_the_hub_and_a_file_in_its_place_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    hub = Hub(str(tmp_path / "hub"))
    with pytest.raises(OSError):
        SlcanTerminal(hub, str(tmp_path / "file"))
    terminal = SlcanTerminal(hub, str(tmp_path / "tty"))
    terminal.close()
    hub.close()
    assert not (tmp_path / "tty").is_symlink()
    assert (tmp_path / "file").read_text() == "mine"


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
            opened = far.errors.of(served.terminal._source)
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


@pytest.mark.parametrize("serial", ["/dev/ttyACM0", "=1000000", "/dev/ttyACM0=fast"])
def test_a_serial_adapter_that_is_not_fully_named_is_a_sentence(tmp_path: Path, serial: str) -> None:
    hub = Hub(str(tmp_path / "hub"))
    refused = pytest.raises(bus.BusError, match="write its port and bit rate")
    with refused, options.equipped(hub, serial=serial):
        pass
    hub.close()
