"""The serial adapter: lines and frames, opening, refusals, and whole reads. The test plays the adapter."""

from __future__ import annotations

import os
import threading
import tty
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.drives.slcan_terminal import state_line

from drives import bus, pdo
from drives.bench.virtual.error_counters import Controller
from drives.ports import slcan, slcan_port
from drives.ports.slcan_port import SlcanPort
from drives.settings import BusSettings

LINES = [
    (b"t1836370610270000", pdo.frame(0x183, bytes.fromhex("370610270000"))),
    (b"t0800", pdo.frame(0x080)),
    (b"T1ABCDEF020102", pdo.frame(0x1ABCDEF0 | pdo.EXTENDED_FLAG, b"\x01\x02")),
    (b"r7031", pdo.FRAME.pack(0x703 | pdo.REMOTE_FLAG, 1, b"")),
    (b"R000007031", pdo.FRAME.pack(0x703 | pdo.REMOTE_FLAG | pdo.EXTENDED_FLAG, 1, b"")),
]


@pytest.mark.parametrize(("text", "frame"), LINES)
def test_a_frame_is_a_line_and_a_line_is_a_frame(text: bytes, frame: bytes) -> None:
    assert slcan.line(frame) == text + b"\r"
    assert slcan.frame(text) == bytes(frame)


@given(st.binary(max_size=40))
def test_no_line_raises(text: bytes) -> None:
    slcan.frame(text)


@pytest.mark.parametrize(
    "text", [b"t18", b"t1839", b"t18320", b"t183211", b"t-010", b"tXYZ0", b"T1", b"", b"sx000000"]
)
def test_a_line_that_is_none_is_none(text: bytes) -> None:
    assert slcan.frame(text) is None


def test_the_state_of_the_controller_goes_over_the_line_as_error_frames() -> None:
    controller = Controller()
    for _ in range(16):
        controller.failed(sending=True)
    line = state_line(controller.error_frame())
    assert line == b"sp000128\r"
    can_id, data = pdo.unpack(slcan.frame(line[:-1]) or b"")
    assert can_id == pdo.ERROR_FLAG | 0x04
    assert data[1] & 0x20
    controller.switch_off()
    can_id, _ = pdo.unpack(slcan.frame(state_line(controller.error_frame())[:-1]) or b"")
    assert can_id == pdo.ERROR_FLAG | 0x40


class Adapter:
    """The far end of a pseudo terminal: answers commands, notes what it was told."""

    def __init__(self, refuses: bytes = b"") -> None:
        self.end, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self.told: list[bytes] = []
        self._refuses = refuses
        self._text = b""
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while True:
            try:
                self._text += os.read(self.end, 4096)
            except OSError:
                return
            *lines, self._text = self._text.split(b"\r")
            self.told += lines
            for line in lines:
                if line[:1] == b"q":
                    return
                refused = line[:1] and line[:1] in self._refuses
                os.write(self.end, b"\a" if refused else b"\r")

    def close(self) -> None:
        os.write(self._slave, b"q\r")
        self._thread.join()
        os.close(self.end)
        os.close(self._slave)


def test_opening_closes_sets_the_bit_rate_switches_time_stamps_off_and_opens() -> None:
    adapter = Adapter()
    port = bus.open(BusSettings("can0", "slcan", adapter.path + "@1000000", 500_000))
    port.close()
    adapter.close()  # it has read everything
    commands = [line for line in adapter.told if line]
    assert commands[:4] == [b"C", b"Z0", b"S6", b"O"]


@pytest.mark.parametrize(
    ("refuses", "sentence"), [(b"S", "a bit rate of 1000000"), (b"O", "opening its channel")]
)
def test_an_adapter_that_refuses_is_a_sentence(
    refuses: bytes, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slcan_port, "SETTLING_S", 0.3)  # for an adapter that has to share a computer
    adapter = Adapter(refuses)
    try:
        with pytest.raises(bus.BusError, match=f"the adapter at {adapter.path} refuses {sentence}"):
            bus.open(BusSettings("can0", "slcan", adapter.path, 1_000_000))
    finally:
        adapter.close()


def test_an_adapter_without_time_stamps_is_none_the_worse() -> None:
    adapter = Adapter(b"ZC")
    port = bus.open(BusSettings("can0", "slcan", adapter.path, 1_000_000))
    assert port.send(pdo.frame(0x80))
    port.close()
    adapter.close()


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (
            BusSettings("can0", "slcan", "/dev/nonesuch", 1_000_000),
            "cannot open the serial port /dev/nonesuch",
        ),
        (BusSettings("can0", "slcan", "/dev/ttyACM0", 333_000), "no bit rate of 333000; use one of 10000"),
        (BusSettings("can0", "slcan", "/dev/ttyACM0@fast", 500_000), "'fast' after @ is no baud rate"),
    ],
)
def test_what_cannot_be_opened_is_a_sentence(settings: BusSettings, sentence: str) -> None:
    with pytest.raises(bus.BusError, match=sentence):
        bus.open(settings)


@pytest.fixture
def wire() -> Iterator[tuple[SlcanPort, int]]:
    """A port and the bare other end."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    yield SlcanPort(ours, "can0"), theirs
    os.close(ours)
    os.close(theirs)


def test_one_read_takes_everything_and_a_line_may_come_in_two_parts(wire: tuple[SlcanPort, int]) -> None:
    port, far = wire
    os.write(far, b"t1810\rt1820\rt183211")
    buffer, seen = bytearray(16), []
    while port.receive_into(buffer):
        seen.append(pdo.unpack(buffer))
    os.write(far, b"22\r")
    while port.receive_into(buffer):
        seen.append(pdo.unpack(buffer))
    assert seen == [(0x181, b""), (0x182, b""), (0x183, b"\x11\x22")]


def test_several_frames_go_out_in_one_write(wire: tuple[SlcanPort, int]) -> None:
    port, far = wire
    assert port.send(pdo.frame(0x201, b"\x0f") + pdo.frame(0x202, b"\x1f"))
    assert os.read(far, 4096) == b"t20110F\rt20211F\r"


def test_a_refused_frame_makes_the_next_send_false_once(wire: tuple[SlcanPort, int]) -> None:
    port, far = wire
    assert port.send(pdo.frame(0x201))
    os.write(far, b"z\r\a")
    assert not port.receive_into(bytearray(16))
    assert not port.send(pdo.frame(0x201))
    assert port.send(pdo.frame(0x201))


def test_a_line_that_takes_nothing_is_false_at_last_and_goes_on_where_it_stopped(
    wire: tuple[SlcanPort, int],
) -> None:
    port, far = wire
    sent = 0
    while port.send(pdo.frame(0x201, sent.to_bytes(4, "little"))):
        sent += 1
        assert sent < 100_000
    text = b""
    os.set_blocking(far, False)
    for _ in range(10_000):
        port.receive_into(bytearray(16))  # hands on what is left
        try:
            text += os.read(far, 4096)
        except BlockingIOError:
            break
    frames = [slcan.frame(line) for line in text.split(b"\r")[:-1]]
    assert len(frames) == sent
    assert [pdo.unpack(frame or b"")[1] for frame in frames] == [n.to_bytes(4, "little") for n in range(sent)]


def test_overruns_and_noise_are_counted(wire: tuple[SlcanPort, int]) -> None:
    port, far = wire
    os.write(far, b"e1o\rhello\r" + b"x" * 60)
    assert not port.receive_into(bytearray(16))
    assert (port.overflows, port.malformed) == (2, 1)


def test_bus_off_comes_as_an_error_frame(wire: tuple[SlcanPort, int]) -> None:
    port, far = wire
    os.write(far, b"sb256256\r")
    buffer = bytearray(16)
    assert port.receive_into(buffer)
    assert pdo.unpack(buffer)[0] == pdo.ERROR_FLAG | 0x40


def test_an_adapter_that_is_pulled_out_is_false_and_no_exception() -> None:
    ours, theirs = os.openpty()
    port = SlcanPort(ours, "can0")
    os.close(theirs)
    buffer = bytearray(16)
    assert not port.receive_into(buffer)
    os.close(ours)
    assert not port.send(pdo.frame(0x80)) or not port.send(pdo.frame(0x80))
