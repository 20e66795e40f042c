"""The log's lines against python-can's reader and writer, and the ring that keeps them."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from drives import pdo
from drives.bench.virtual.virtual_bus import SteppedBus
from drives.log import candump, frame_log
from drives.log.frame_log import FrameLog

FRAMES = [
    # frame, the line's part behind the bus
    (pdo.frame(0x183, bytes.fromhex("370610270000")), "183#370610270000"),
    (pdo.frame(0x080), "080#"),
    (pdo.FRAME.pack(0x703 | pdo.REMOTE_FLAG, 1, b""), "703#R1"),
    (pdo.frame(0x1ABCDEF0 | pdo.EXTENDED_FLAG, b"\x01\x02"), "1ABCDEF0#0102"),
    (pdo.frame(0x40 | pdo.ERROR_FLAG, bytes(8)), "20000040#0000000000000000"),
]


@pytest.mark.parametrize(("frame", "text"), FRAMES)
def test_a_frame_is_a_line_and_a_line_is_a_frame(frame: bytes, text: str) -> None:
    line = candump.line(1234.56789, "can0", frame)
    assert line == f"(1234.567890) can0 {text}"
    assert candump.parse(line) == (1234.56789, "can0", bytes(frame))


def test_python_can_reads_the_file_as_it_was_meant(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    candump.save(path, [(n * 0.001, "can0", bytes(frame)) for n, (frame, _) in enumerate(FRAMES)])
    messages = list(can.CanutilsLogReader(path))
    assert [m.arbitration_id for m in messages[:4]] == [0x183, 0x080, 0x703, 0x1ABCDEF0]
    assert bytes(messages[0].data) == bytes.fromhex("370610270000")
    assert [m.is_remote_frame for m in messages] == [False, False, True, False, False]
    assert [m.is_extended_id for m in messages[:4]] == [False, False, False, True]
    assert messages[4].arbitration_id == 0x40  # python-can takes for errors what has the bus-error class
    assert messages[1].timestamp == pytest.approx(0.001)


def test_a_log_that_python_can_wrote_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    writer = can.CanutilsLogWriter(path)
    writer(
        can.Message(
            timestamp=1.5, arbitration_id=0x183, data=b"\x37\x06", is_extended_id=False, channel="can1"
        )
    )
    writer.stop()
    ((at_s, bus, frame),) = candump.read(path.read_text().splitlines())
    assert (at_s, bus) == (1.5, "can1")
    assert pdo.unpack(frame) == (0x183, b"\x37\x06")


def test_a_line_that_is_none_is_named_with_its_number() -> None:
    with pytest.raises(candump.CandumpError, match=r"line 2: 'hello' is no line of a candump log"):
        list(candump.read(["(1.0) can0 183#37", "hello"]))


def test_the_ring_keeps_the_last_seconds_and_no_more_than_it_has_room_for() -> None:
    log = FrameLog(seconds=0.1, capacity=8)
    for n in range(20):
        log(bytes(pdo.frame(n)), n * 0.01)
    assert [pdo.unpack(frame)[0] for _, frame in log.frames()] == list(range(12, 20))
    assert [pdo.unpack(frame)[0] for _, frame in log.frames(until_s=0.15)] == [12, 13, 14, 15]
    late = FrameLog(seconds=0.1, capacity=100)
    for n in range(50):
        late(bytes(pdo.frame(n)), n * 0.01)
    assert next(at_s for at_s, _ in late.frames()) == pytest.approx(0.39)


def test_two_buses_are_logged_in_the_order_of_time(tmp_path: Path) -> None:
    logs = {"can0": FrameLog(), "can1": FrameLog()}
    for n in range(6):
        logs[f"can{n % 2}"](bytes(pdo.frame(0x180 + n)), n * 0.001)
    candump.save(tmp_path / "both.log", frame_log.merged(logs, offset_s=100.0))
    read = list(candump.read((tmp_path / "both.log").read_text().splitlines()))
    assert [(bus, pdo.unpack(frame)[0]) for _, bus, frame in read] == [
        (f"can{n % 2}", 0x180 + n) for n in range(6)
    ]
    assert read[0][0] == pytest.approx(100.0)


def test_a_stepped_bus_is_watched_whole_and_a_listening_port_is_drained() -> None:
    bus, log, heard = SteppedBus(), FrameLog(), FrameLog()
    bus.log(log.keep)
    one, two, listener = bus.port(), bus.port([(0x180, 0x780)]), bus.port()
    one.send(pdo.frame(0x201))
    two.send(pdo.frame(0x181))
    bus.advance(1.0)
    assert [pdo.unpack(frame)[0] for _, frame in log.frames()] == [0x181, 0x201]
    assert heard.drain(listener, bus.now_s) == 2
    assert [pdo.unpack(frame)[0] for _, frame in heard.frames()] == [0x181, 0x201]
