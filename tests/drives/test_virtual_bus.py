"""The wire: arbitration, frame times, queues, filters, injected faults, cyclic SYNC."""

from __future__ import annotations

from itertools import pairwise

from drives import pdo
from drives.virtual_bus import QUEUE_LIMIT, Port, SteppedBus

BIT_S = 1e-6


def received(port: Port) -> list[int]:
    buffer, found = bytearray(16), []
    while port.receive_into(buffer):
        found.append(pdo.unpack(buffer)[0])
    return found


def test_the_lowest_identifier_goes_first_and_a_frame_on_the_wire_is_not_interrupted() -> None:
    bus = SteppedBus()
    sender, other, listener = bus.port(), bus.port(), bus.port()
    sender.send(pdo.frame(0x300, bytes(8)))
    bus.advance(20 * BIT_S)  # 300h is on the wire
    sender.send(pdo.frame(0x200))
    other.send(pdo.frame(0x100))
    bus.advance(1.0)
    assert received(listener) == [0x300, 0x100, 0x200]


def test_a_frame_takes_the_time_of_its_worst_stuffing() -> None:
    for length, bits in ((0, 55), (4, 95), (6, 115), (8, 135)):
        bus = SteppedBus()
        sender, listener = bus.port(), bus.port()
        sender.send(pdo.frame(0x123, bytes(length)))
        bus.advance((bits - 0.5) * BIT_S)
        assert received(listener) == []
        bus.advance((bits + 0.5) * BIT_S)
        assert received(listener) == [0x123]


def test_a_period_that_overloads_the_bus_fills_the_queue_until_send_refuses() -> None:
    bus = SteppedBus()
    sender = bus.port()
    refused = 0
    for tick in range(200):
        bus.advance(tick * 0.001)
        refused += sum(not sender.send(pdo.frame(0x201 + n, bytes(8))) for n in range(10))
    assert refused > 0
    assert bus.busy_s > 0.99 * bus.now_s - 0.001


def test_without_bit_timing_everything_arrives_at_once() -> None:
    bus = SteppedBus(bit_rate=0)
    sender, listener = bus.port(), bus.port()
    for n in range(QUEUE_LIMIT):
        assert sender.send(pdo.frame(n))
    bus.advance(0.0)
    assert len(received(listener)) == QUEUE_LIMIT


def test_a_port_hears_what_its_filters_pass_and_never_itself() -> None:
    bus = SteppedBus()
    sender = bus.port()
    feedback, everything = bus.port([(0x180, 0x780)]), bus.port()
    for can_id in (0x181, 0x201, 0x1FF):
        sender.send(pdo.frame(can_id))
    bus.advance(1.0)
    assert received(feedback) == [0x181, 0x1FF]
    assert received(everything) == [0x181, 0x1FF, 0x201]
    assert received(sender) == []


def test_an_error_frame_reaches_every_port_whatever_its_filters() -> None:
    bus = SteppedBus()
    sender, listener = bus.port(), bus.port([(0x180, 0x780)])
    sender.send(pdo.frame(pdo.ERROR_FLAG | 0x40, bytes(8)))
    bus.advance(1.0)
    assert received(listener) == [pdo.ERROR_FLAG | 0x40]


def test_several_frames_can_be_sent_at_once() -> None:
    bus = SteppedBus()
    sender, listener = bus.port(), bus.port()
    assert sender.send(pdo.frame(0x201) + pdo.frame(0x202))
    bus.advance(1.0)
    assert received(listener) == [0x201, 0x202]


def test_the_tamper_hook_loses_delays_and_doubles_frames() -> None:
    fates = {0x181: (), 0x182: (0.0, 0.0), 0x183: (0.01,)}
    bus = SteppedBus()
    bus.tamper = lambda _at_s, can_id, _frame: fates.get(can_id, (0.0,))
    sender, listener = bus.port(), bus.port()
    for can_id in (0x181, 0x182, 0x183, 0x184):
        sender.send(pdo.frame(can_id))
    bus.advance(0.005)
    assert received(listener) == [0x182, 0x182, 0x184]
    bus.advance(0.02)
    assert received(listener) == [0x183]


def test_cyclic_sync_keeps_exact_deadlines_comes_back_as_echo_and_ends_with_its_owner() -> None:
    bus = SteppedBus()
    owner = bus.port([(0x80, 0x7FF)])
    times: list[float] = []
    bus.watch(0x80, lambda _frame, at_s: times.append(at_s))
    owner.start_cyclic_sync(0.002)
    for n in range(1, 101):
        bus.advance(n * 0.001)
    assert len(received(owner)) == 49
    assert max(abs(b - a - 0.002) for a, b in pairwise(times)) < 1e-12
    owner.close()
    bus.advance(1.0)
    assert len(times) <= 50
