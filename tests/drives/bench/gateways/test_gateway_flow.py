"""Guests in a hurry, and guests with frames that the bus does not carry. python-can is the client."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
from support.drives.gateway_guests import TIMEOUT_S, Served, by_hub, heard, same, serving, until

from drives import pdo
from drives.bench.virtual.fault_script import FaultScript
from drives.bench.virtual.hub import Hub
from drives.bench.virtual.hub_bus import HubBus

MANY = 5000
WAITING = 3000  # at 20 kbit/s they take 10 s
REMOTE = can.Message(arbitration_id=0x703, is_remote_frame=True, dlc=4, is_extended_id=False)
PLAIN = can.Message(arbitration_id=0x123, data=b"\x11", is_extended_id=False)
FD = can.Message(arbitration_id=0x124, data=bytes(12), is_fd=True, is_extended_id=False)
WAYS = ("native", "socketcand", "slcan")


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    with serving(tmp_path) as made:
        yield made


def numbered(n: int) -> can.Message:
    return can.Message(arbitration_id=0x100 + n % 512, data=n.to_bytes(2, "little"), is_extended_id=False)


def numbers_on(hub: Hub) -> list[int]:
    """Numbers of what goes over the wire from now on, as it comes."""
    found: list[int] = []
    bus = hub.bus
    by_hub(
        hub, lambda: bus.watch_all(lambda frame, _at_s: found.append(int.from_bytes(frame[8:10], "little")))
    )
    return found


def answering(served: Served) -> None:
    """Have 581h answer 601h at once, as an SDO server would."""
    bus = served.hub.bus
    answer = bytes(pdo.frame(0x581, bytes.fromhex("4300100092010200")))

    def attach() -> None:
        server = bus.connect(lambda _frame, _at_s: None)
        bus.watch(0x601, lambda _frame, at_s: bus.submit(server, at_s, 0x581, answer))

    by_hub(served.hub, attach)


# -- what is asked early is answered


def test_a_question_right_after_rawmode_is_answered(served: Served) -> None:
    answering(served)
    for _ in range(5):
        guest = served.socketcand()
        guest.send(can.Message(arbitration_id=0x601, data=bytes(8), is_extended_id=False))
        assert [m.arbitration_id for m in heard(guest, 1)] == [0x581]
        guest.shutdown()


def test_a_whole_dialogue_in_one_segment_is_answered_in_order(served: Served) -> None:
    answering(served)
    with socket.create_connection(("127.0.0.1", served.tcp.port)) as guest:
        guest.settimeout(TIMEOUT_S)
        guest.sendall(b"< open can0 >< rawmode >< send 601 8 40 0 10 0 0 0 0 0 >< echo >")
        said = b""
        while b"frame" not in said or not said.endswith(b">"):
            said += guest.recv(4096)
    assert said.startswith(b"< hi >< ok >< ok >< echo >< frame 581 "), said
    assert said.endswith(b" 4300100092010200 >")


def test_a_guest_that_only_listens_misses_nothing_after_rawmode(served: Served) -> None:
    native, guest = served.native(), served.socketcand()
    sent = [numbered(n) for n in range(40)]
    for message in sent:
        native.send(message)
    assert same(heard(guest, 40), sent)
    native.shutdown()
    guest.shutdown()


# -- who sends faster than the bus carries


@pytest.mark.parametrize("way", WAYS)
def test_5000_frames_of_a_fast_loop_are_all_on_the_bus_once(served: Served, way: str) -> None:
    open_guest: Callable[[], can.BusABC] = getattr(served, way)
    found, guest = numbers_on(served.hub), open_guest()
    for n in range(MANY):
        guest.send(numbered(n))
    until(lambda: len(found) >= MANY)
    assert sorted(found) == list(range(MANY))
    guest.shutdown()


def test_what_does_not_fit_within_the_time_out_is_an_exception_and_the_rest_arrives(tmp_path: Path) -> None:
    with serving(tmp_path, bit_rate=20_000) as slow:
        guest, found = slow.native(), numbers_on(slow.hub)
        taken, refused = [], 0
        for n in range(2000):
            try:
                guest.send(numbered(n), timeout=0.0)
                taken.append(n)
            except can.CanOperationError as refusal:
                assert "queue is full" in str(refusal)
                refused += 1
        assert refused > 0
        until(lambda: len(found) >= len(taken))
        assert sorted(found) == taken
        guest.shutdown()


def test_what_was_taken_goes_out_after_its_sender_has_left(served: Served) -> None:
    guest, found = served.native(), numbers_on(served.hub)
    for n in range(1000):
        guest.send(numbered(n))
    guest.shutdown()
    until(lambda: len(found) >= 1000)
    assert sorted(found) == list(range(1000))
    until(lambda: not served.hub._clients)


def test_a_guest_that_waits_does_not_hold_up_another(tmp_path: Path) -> None:
    with serving(tmp_path, bit_rate=20_000) as slow:
        busy, other, found = slow.socketcand(), slow.native(), numbers_on(slow.hub)
        for n in range(WAITING):
            busy.send(numbered(n))
        other.send(can.Message(arbitration_id=0x001, data=b"\xff\xff", is_extended_id=False))
        until(lambda: 0xFFFF in found)
        assert len(found) < WAITING - 100, "it has the highest priority, and its own queue is empty"
        busy.shutdown()
        other.shutdown()


def test_a_queue_that_takes_nothing_is_told_by_an_error_frame(served: Served) -> None:
    guest, bus = served.native(), served.hub.bus
    guest.send(can.Message(arbitration_id=0x080, is_extended_id=False))  # who sends SYNC is the master
    # A frame counts when it begins; whose SYNC it was is known when it has arrived.
    until(lambda: bus.masters is not bus.controller)
    script = FaultScript.read("at 0 s: queue_full master for 60 s")
    by_hub(served.hub, lambda: script.inject(bus, bus.now_s))
    found: list[can.Message] = []

    def told() -> bool:
        guest.send(PLAIN)  # the bus is the hub's, and only its thread may look at its queues
        found.extend(filter(None, [guest.recv(0.0)]))
        return bool(found)

    until(told)
    (message,) = found
    assert message.is_error_frame
    assert (message.arbitration_id, message.data[1]) == (0x04, 0x02), (
        "a controller's overflow, of transmission"
    )
    guest.shutdown()


def test_a_listener_that_does_not_read_is_told_that_it_has_lost_frames(served: Served) -> None:
    sleeper, talker = served.native(), served.native()
    found = numbers_on(served.hub)
    for n in range(MANY):
        talker.send(numbered(n))
    until(lambda: len(found) >= MANY)
    by_hub(served.hub, lambda: None)  # whoever watches the bus hears a frame before the guests do
    while sleeper.recv(0.0) is not None:
        pass
    talker.send(PLAIN)
    first, second = heard(sleeper, 2)
    assert first.is_error_frame
    assert (first.arbitration_id, first.data[1]) == (0x04, 0x01), "a controller's overflow, of reception"
    assert same([second], [PLAIN])
    for guest in (sleeper, talker):
        guest.shutdown()


# -- remote frames


@pytest.mark.parametrize("dlc", range(9))
def test_the_plugin_carries_remote_frames_with_their_length_code(served: Served, dlc: int) -> None:
    one, two = served.native(), served.native()
    for extended in (False, True):
        sent = can.Message(arbitration_id=0x703, is_remote_frame=True, dlc=dlc, is_extended_id=extended)
        one.send(sent)
        (got,) = heard(two, 1)
        assert same([got], [sent])
        assert (got.is_remote_frame, got.dlc, bytes(got.data)) == (True, dlc, b"")
    for guest in (one, two):
        guest.shutdown()


def test_a_remote_frame_does_not_break_a_socketcand_guest(served: Served) -> None:
    guest, native = served.socketcand(), served.native()
    guest.send(REMOTE)
    (told,) = heard(guest, 1)
    assert told.is_error_frame and told.arbitration_id == 0x04
    native.send(REMOTE)  # there is no word for it
    native.send(PLAIN)
    assert same(heard(guest, 1), [PLAIN])
    guest.send(PLAIN)
    assert same(heard(native, 1), [PLAIN])
    by_hub(served.hub, lambda: None)  # it counts what it has delivered, after that
    assert served.hub.bus.frames == 3, "all but the remote frame of socketcand, which was not put on the bus"
    for each in (guest, native):
        each.shutdown()


@pytest.mark.parametrize("way", ["native", "socketcand"])
def test_an_error_frame_of_the_bus_is_one_for_the_guest(served: Served, way: str) -> None:
    others = set(served.hub.bus._ports)
    guest: can.BusABC = getattr(served, way)()
    until(lambda: set(served.hub.bus._ports) != others)
    bus = served.hub.bus
    (source,) = set(bus._ports) - others
    by_hub(served.hub, lambda: bus.errors.switch_off(bus.errors.of(source), bus.now_s))
    (told,) = heard(guest, 1)
    assert told.is_error_frame
    assert told.arbitration_id == 0x40
    guest.shutdown()


# -- CAN FD


def test_the_plugin_refuses_can_fd_by_name(served: Served) -> None:
    guest = served.native()
    with pytest.raises(can.CanOperationError, match="CAN FD frames are not carried"):
        guest.send(FD)
    with pytest.raises(can.CanInitializationError, match="CAN FD frames are not carried"):
        HubBus(served.path, fd=True)
    guest.send(PLAIN)
    until(lambda: served.hub.bus.frames == 1)
    guest.shutdown()


@pytest.mark.parametrize(
    "message",
    [
        can.Message(arbitration_id=0x800, is_extended_id=False),
        can.Message(arbitration_id=1 << 29, is_extended_id=True),
        can.Message(arbitration_id=0x123, dlc=9, is_remote_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x123, data=bytes(9), is_extended_id=False),
    ],
)
def test_the_plugin_refuses_what_is_no_frame(served: Served, message: can.Message) -> None:
    guest = served.native()
    with pytest.raises(can.CanOperationError, match=r"identifier|length"):
        guest.send(message)
    guest.shutdown()


def test_no_hub_is_a_sentence_of_python_can(tmp_path: Path) -> None:
    with pytest.raises(can.CanInitializationError, match="there is no virtual bus at"):
        HubBus(str(tmp_path / "nothing"))


@pytest.mark.parametrize("command", [b"< fdsend 123 1 11 >", b"< send 123 C 1 2 3 4 5 6 7 8 9 a b c >"])
def test_socketcand_refuses_can_fd_by_name(served: Served, command: bytes) -> None:
    with socket.create_connection(("127.0.0.1", served.tcp.port)) as guest:
        guest.settimeout(TIMEOUT_S)
        guest.sendall(b"< open can0 >< rawmode >" + command + b"< echo >")
        said = b""
        while not said.endswith(b"< echo >"):
            said += guest.recv(4096)
    assert b"CAN FD frames are not carried" in said
    assert served.hub.bus.frames == 0


def test_python_can_hears_of_a_refused_fd_frame_and_goes_on(served: Served) -> None:
    guest, native = served.socketcand(), served.native()
    guest.send(FD)
    (told,) = heard(guest, 1)
    assert told.is_error_frame
    native.send(PLAIN)
    assert same(heard(guest, 1), [PLAIN])
    for each in (guest, native):
        each.shutdown()


@pytest.mark.parametrize("brs", [False, True])
@pytest.mark.parametrize("extended", [False, True])
def test_slcan_refuses_can_fd_and_says_so_where_the_hub_runs(
    served: Served, capfd: pytest.CaptureFixture[str], brs: bool, extended: bool
) -> None:
    guest, native = served.slcan(), served.native()
    fd = can.Message(
        arbitration_id=0x124, data=bytes(12), is_fd=True, bitrate_switch=brs, is_extended_id=extended
    )
    guest.send(fd)
    guest.send(PLAIN)
    assert same(heard(native, 1), [PLAIN])
    assert capfd.readouterr().err.count("CAN FD frames are not carried") == 1
    for each in (guest, native):
        each.shutdown()


def test_a_line_that_is_no_frame_is_refused_by_a_bell_and_harms_nobody(served: Served) -> None:
    terminal = os.open(served.link, os.O_RDWR | os.O_NOCTTY)
    try:
        for line in (b"O", b"t-010", b"t1233", b"tFFF0", b"d12311122", b"t1231FF"):
            os.write(terminal, line + b"\r")
        said = b""
        while not said.endswith(b"z\r"):
            said += os.read(terminal, 256)
        assert said == b"\r" + 4 * b"\a" + b"z\r"
    finally:
        os.close(terminal)
