import contextlib
import socket
import struct
import time

import can
import pytest

from drives import bus, pdo
from drives.log.frame_log import FrameLog
from drives.ports import can_socket, hub_protocol
from drives.settings import BusSettings


@pytest.fixture
def hub_end():
    """A hub socket and the other end of its wire."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    port = bus.HubSocket(ours, "can0")
    theirs.settimeout(1.0)
    yield port, theirs
    theirs.close()
    port.close()


def test_a_frame_goes_out_as_it_lies_in_memory(hub_end):
    port, theirs = hub_end
    assert port.send(pdo.frame(0x201, b"\x01"))
    assert theirs.recv(64) == bytes(pdo.frame(0x201, b"\x01"))


def packets(theirs: socket.socket) -> list[bytes]:
    """All that has come."""
    theirs.setblocking(False)
    found = []
    with contextlib.suppress(BlockingIOError):
        while True:
            found.append(theirs.recv(4096))
    return found


def begins(at_ns: int) -> bytes:
    return bytes(pdo.frame(hub_protocol.AHEAD, struct.pack("<Q", at_ns)))


def test_frames_that_are_kept_are_one_packet_with_the_times_at_which_they_begin(hub_end):
    port, theirs = hub_end
    sync, setpoint = bytes(pdo.frame(0x80)), bytes(pdo.frame(0x201, b"\x01"))
    port.keep()
    assert port.send(sync) and port.send(setpoint)
    assert packets(theirs) == [sync], "which is due now"
    port.later(12345.678)
    assert port.send(sync)
    assert packets(theirs) == []
    port.hand_over()
    assert packets(theirs) == [setpoint + begins(12345_678_000_000) + sync]
    assert port.send(sync) and packets(theirs) == [sync], "nothing is kept any more"
    port.keep()
    port.hand_over()
    assert packets(theirs) == []


def test_what_is_too_much_for_a_packet_is_several_with_their_times(hub_end):
    port, theirs = hub_end
    five = bytes(pdo.frame(0x201)) * 5
    port.keep()
    assert port.send(pdo.frame(0x80)) and len(packets(theirs)) == 1
    for turn in range(20):
        port.later(0.001 * turn)
        assert port.send(five)
    port.hand_over()
    found = packets(theirs)
    assert max(map(len, found)) <= 16 * hub_protocol.MAX_SENT and len(found) == 2
    assert b"".join(found).count(bytes(pdo.frame(0x201))) == 100
    assert all(packet.startswith(begins(ns)) for packet, ns in zip(found, (0, 10_000_000), strict=True))


def test_a_hub_that_takes_no_packet_is_told_of_with_the_next_frame_that_is_kept(hub_end):
    port, theirs = hub_end
    theirs.close()
    port.keep()
    assert not port.send(pdo.frame(0x80))
    assert port.send(pdo.frame(0x201))
    port.hand_over()
    port.keep()
    assert not port.send(pdo.frame(0x80))
    assert not port.send(pdo.frame(0x201))


def test_a_packet_of_several_frames_comes_out_one_by_one(hub_end):
    port, theirs = hub_end
    frames = [bytes(pdo.frame(0x180 + i, bytes([i]))) for i in range(5)]
    theirs.send(b"".join(frames[:3]))
    theirs.send(b"".join(frames[3:]))
    buffer = bytearray(16)
    seen = []
    while port.receive_into(buffer):
        seen.append(bytes(buffer))
    assert seen == frames


def test_a_truncated_frame_is_not_taken_for_one(hub_end):
    port, theirs = hub_end
    theirs.send(bytes(pdo.frame(0x181)) + b"abc")
    buffer = bytearray(16)
    assert port.receive_into(buffer)
    assert not port.receive_into(buffer)


def test_a_dead_hub_and_a_full_queue_are_false_and_not_exceptions(hub_end):
    port, theirs = hub_end
    sends = 0
    while port.send(pdo.frame(0x80)) and sends < 100_000:
        sends += 1
    assert 0 < sends < 100_000
    theirs.close()
    buffer = bytearray(16)
    assert not port.send(pdo.frame(0x80))
    assert not port.receive_into(buffer)


def test_no_hub_is_a_sentence(tmp_path):
    with pytest.raises(bus.BusError, match=r"no virtual bus at .* start its hub first"):
        bus.open(BusSettings("can0", "virtual", str(tmp_path / "none"), 1_000_000))


def test_kernel_filters_let_eleven_bit_data_frames_through_only():
    can_id, mask = struct.unpack_from("=II", bus.kernel_filters(pdo.SERVICE_FILTERS))
    assert can_id == 0x580
    for heard, frame_id in [(True, 0x585), (False, 0x605), (False, 0x8000_0585), (False, 0x4000_0585)]:
        assert (frame_id & mask == can_id) is heard


def test_a_python_can_adapter_carries_the_same_frames():
    settings = BusSettings("can0", "virtual_in_process", "test_adapter", 1_000_000)
    ours = bus.AdapterSocket(can.Bus(interface="virtual", channel="test_adapter"), settings.name)
    theirs = can.Bus(interface="virtual", channel="test_adapter")
    try:
        assert ours.send(pdo.frame(0x201, b"\x0f\x00\x01\x02\x03\x04"))
        message = theirs.recv(1.0)
        assert message is not None
        assert (message.arbitration_id, bytes(message.data)) == (0x201, b"\x0f\x00\x01\x02\x03\x04")
        assert ours.send(pdo.guard_frame(3))
        asked = theirs.recv(1.0)
        assert asked is not None
        assert (asked.arbitration_id, asked.is_remote_frame, asked.dlc) == (0x703, True, 1)
        buffer = bytearray(16)
        assert not ours.receive_into(buffer)
        theirs.send(can.Message(arbitration_id=0x181, data=b"\x37\x12", is_extended_id=False))
        assert ours.receive_into(buffer)
        assert pdo.unpack(buffer) == (0x181, b"\x37\x12")
    finally:
        theirs.shutdown()
        ours.close()


@pytest.fixture
def adapters():
    """A python-can adapter with the slow side's filters, and another on the same bus."""
    ours = bus.AdapterSocket(can.Bus(interface="virtual", channel="adapters"), "can0", pdo.SERVICE_FILTERS)
    theirs = can.Bus(interface="virtual", channel="adapters")
    yield ours, theirs
    theirs.shutdown()
    ours.close()


def heard(port):
    """Identifiers of what one tick takes."""
    buffer, found = bytearray(16), []
    while port.receive_into(buffer):
        found.append(pdo.unpack(buffer)[0])
    return found


def message(can_id, data=b"", **kind):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=kind.pop("extended", False), **kind)


def test_a_frame_that_an_adapter_filters_out_does_not_keep_those_after_it_from_the_tick(adapters):
    ours, theirs = adapters
    for _ in range(50):
        theirs.send(message(0x181, bytes(6)))
    for unwanted in (message(0x701, extended=True), message(0x701, is_remote_frame=True), message(0x080)):
        theirs.send(unwanted)
    for node in range(1, 6):
        theirs.send(message(0x700 + node, bytes(1)))
    assert heard(ours) == [0x701, 0x702, 0x703, 0x704, 0x705]


def test_who_babbles_what_nobody_wants_holds_nobody_up(adapters):
    ours, theirs = adapters
    for _ in range(bus.MAX_UNWANTED + 1):
        theirs.send(message(0x001))
    theirs.send(message(0x701))
    assert heard(ours) == []
    assert heard(ours) == [0x701]


@pytest.mark.parametrize("extended", [False, True], ids=["gs_usb", "socketcand"])
def test_an_adapter_s_word_about_lost_frames_passes_its_filters_and_is_counted(adapters, extended):
    ours, theirs = adapters
    assert ours.overflows == 0
    for classes, detail in ((0x004, 0x01), (0x044, 0x01), (0x004, 0x02), (0x040, 0x00), (0x004, 0x20)):
        data = bytes((0, detail, *bytes(6)))
        theirs.send(message(classes, data, extended=extended, is_error_frame=True))
    assert len(heard(ours)) == 3
    assert ours.overflows == 2


def test_an_adapter_without_filters_hears_everything(adapters):
    ours = bus.AdapterSocket(can.Bus(interface="virtual", channel="adapters"), "can0", [(0, 0)])
    adapters[1].send(message(0x581))
    adapters[1].send(message(0x18123, extended=True))
    assert heard(ours) == [0x581, 0x18123 | pdo.EXTENDED_FLAG]
    ours.close()


def test_an_unknown_adapter_is_a_sentence():
    with pytest.raises(bus.BusError, match="python-can cannot open interface 'nonesuch'"):
        bus.open(BusSettings("can0", "nonesuch", "0", 1_000_000))


def test_a_missing_can_interface_is_a_sentence():
    with pytest.raises(bus.BusError, match=r"no CAN sockets|ip link set nonesuch0 up"):
        bus.open(BusSettings("can0", "socketcan", "nonesuch0", 1_000_000))


def test_the_hubs_word_about_lost_frames_is_a_count_and_no_frame(hub_end):
    port, theirs = hub_end
    buffer = bytearray(16)
    theirs.send(hub_protocol.lost_frame(3))
    assert not port.receive_into(buffer) and not port.receive_into(buffer)
    assert port.overflows == 3
    theirs.send(hub_protocol.lost_frame(7) + bytes(pdo.frame(0x181)))
    assert port.receive_into(buffer)
    assert pdo.unpack(buffer)[0] == 0x181
    assert not port.receive_into(buffer)
    assert port.overflows == 7


def datagrams(receive_bytes):
    """A CanSocket on a datagram socket of another family, whose queue overflows like a CAN socket's."""
    ours = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ours.bind(("127.0.0.1", 0))
    port = bus.CanSocket(ours, "can0")
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
    theirs = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    theirs.connect(ours.getsockname())
    return port, theirs


def test_frames_that_the_kernels_queue_refuses_are_counted():
    port, theirs = datagrams(4096)
    assert port.overflows == 0
    for n in range(500):
        theirs.send(pdo.frame(n))
    buffer, got = bytearray(16), 0
    while port.receive_into(buffer):
        got += 1
    assert port.overflows == 500 - got > 0
    theirs.close()
    port.close()


def test_a_frame_comes_with_the_kernels_time_stamp():
    port, theirs = datagrams(1 << 16)
    log, buffer = FrameLog(), bytearray(16)
    assert port.receive_stamped(buffer) is None
    before_s = time.time()
    theirs.send(pdo.frame(0x181))
    after_s = time.time()
    for _ in range(20):
        theirs.send(pdo.frame(0x182))
    assert before_s - 0.01 <= port.receive_stamped(buffer) <= after_s + 0.01
    assert pdo.unpack(buffer)[0] == 0x181
    assert log.drain(port, 1000.0) == 20
    assert [at_s for at_s, _ in log.frames()] == sorted(at_s for at_s, _ in log.frames())
    assert max(at_s for at_s, _ in log.frames()) <= 1000.0
    theirs.close()
    port.close()


class Interface:
    """Stands for ioctl on an interface with a transmit queue."""

    def __init__(self, length, changeable):
        self.length, self.changeable = length, changeable

    def __call__(self, _sock, request, packed):
        name, length = struct.unpack("16si20x", packed)
        assert name.rstrip(b"\0") == b"can0"
        if request == 0x8942:
            return struct.pack("16si20x", name, self.length)
        if not self.changeable:
            raise PermissionError(1, "Operation not permitted")
        self.length = length
        return packed


@pytest.mark.parametrize(
    ("length", "changeable", "after"), [(10, True, 128), (1000, False, 1000), (128, False, 128)]
)
def test_a_short_transmit_queue_is_lengthened_and_a_long_one_left_alone(
    monkeypatch, length, changeable, after
):
    interface = Interface(length, changeable)
    monkeypatch.setattr(can_socket.fcntl, "ioctl", interface)
    can_socket._lengthen_queue(None, BusSettings("main", "socketcan", "can0", 1_000_000))
    assert interface.length == after


def test_a_short_transmit_queue_that_may_not_be_lengthened_is_a_sentence(monkeypatch):
    monkeypatch.setattr(can_socket.fcntl, "ioctl", Interface(10, False))
    sentence = "bus main: the transmit queue of can0 holds 10 frames, .* 'ip link set can0 txqueuelen 128'"
    with pytest.raises(bus.BusError, match=sentence):
        can_socket._lengthen_queue(None, BusSettings("main", "socketcan", "can0", 1_000_000))


def test_a_filter_of_nothing_lets_every_kind_of_frame_through():
    assert struct.unpack("=II", bus.kernel_filters([(0, 0)])) == (0, 0)


def test_an_adapter_of_python_can_takes_options_in_its_channel(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, object] = {}

    def opened(**options: object) -> can.BusABC:
        asked.update(options)
        return made

    made = can.Bus(interface="virtual", channel="options")
    monkeypatch.setattr(can, "Bus", opened)
    port = bus.open(BusSettings("can0", "socketcand", "can0?host=127.0.0.1&port=29536", 1_000_000))
    assert (asked["interface"], asked["channel"]) == ("socketcand", "can0")
    assert (asked["host"], asked["port"], asked["bitrate"]) == ("127.0.0.1", 29536, 1_000_000)
    port.close()
