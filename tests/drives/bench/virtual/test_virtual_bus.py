"""The wire: arbitration, frame times, queues, filters, injected faults."""

from __future__ import annotations

from support.drives.stepped_drives import Bench

from drives import pdo
from drives.bench.simulated import SimulatedDrive
from drives.bench.virtual.fault_script import FaultScript
from drives.bench.virtual.virtual_bus import MAX_CARRIED, PORT_LIMIT, QUEUE_LIMIT, Port, SteppedBus
from drives.log.frame_log import FrameLog

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


def test_a_frame_takes_the_time_of_its_worst_stuffing_where_that_is_asked_for() -> None:
    for length, bits in ((0, 55), (4, 95), (6, 115), (8, 135)):
        bus = SteppedBus(worst_stuffing=True)
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


def test_what_is_said_just_as_before_is_nothing_new() -> None:
    bus = SteppedBus(start_s=0.0)
    source = bus.connect(lambda frame, at_s: None)
    new_s = []
    for at_s, can_id, data in [
        (1.0, 0x181, b"\1"),
        (2.0, 0x182, b"\1"),
        (3.0, 0x181, b"\1"),
        (4.0, 0x181, b"\2"),
        (5.0, 0x182, b"\1"),
    ]:
        assert bus.submit(source, at_s, can_id, bytes(pdo.frame(can_id, data)))
        bus.advance(at_s + 0.5)
        new_s.append(bus.new_s)
    assert new_s == [1.0, 2.0, 2.0, 4.0, 4.0]


def test_a_babbler_of_ever_new_identifiers_takes_no_memory_for_ever() -> None:
    bus = SteppedBus(bit_rate=0)
    source = bus.connect(lambda frame, at_s: None)
    for can_id in range(1, 2 * MAX_CARRIED):
        assert bus.submit(source, bus.now_s, can_id, bytes(pdo.frame(can_id)))
        bus.advance(bus.now_s)
    assert bus.frames == 2 * MAX_CARRIED - 1
    assert len(bus._carried) <= MAX_CARRIED + 1


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


def test_a_port_that_does_not_read_counts_what_it_has_lost() -> None:
    bus = SteppedBus(bit_rate=0)
    sender, listener = bus.port(), bus.port()
    for n in range(PORT_LIMIT + 7):
        assert sender.send(pdo.frame(n & 0x7FF))
        bus.advance(bus.now_s)
    assert listener.overflows == 7
    assert len(received(listener)) == PORT_LIMIT
    assert sender.overflows == 0


def test_all_ports_of_one_bus_are_one_can_interface_and_a_connection_is_another() -> None:
    bus = SteppedBus()
    tick, service, filtered = bus.port(), bus.port(), bus.port([(0x580, 0x780)])
    guest: list[int] = []
    source = bus.connect(lambda frame, _at_s: guest.append(pdo.unpack(frame)[0]))
    bus.errors.switch_off(bus.controller, 0.0)
    for port in (tick, service, filtered):
        assert received(port) == [pdo.ERROR_FLAG | 0x40]
        assert not port.send(pdo.frame(0x80))
    assert bus.submit(source, 0.0, 0x181, bytes(pdo.frame(0x181)))
    bus.advance(0.1)
    assert received(tick) == []
    assert guest == []
    bus.errors.restart(bus.controller, bus.now_s)
    assert received(tick) == [pdo.ERROR_FLAG | 0x100]
    assert tick.send(pdo.frame(0x80))
    bus.advance(0.2)
    assert guest == [0x80]


def test_the_master_is_who_sent_sync_first_until_it_leaves() -> None:
    bus = SteppedBus()
    first, second = (bus.connect(lambda *_: None) for _ in range(2))
    assert bus.masters is bus.controller
    for source in (first, second):
        bus.submit(source, bus.now_s, 0x80, bytes(pdo.frame(0x80)))
        bus.advance(bus.now_s + 0.001)
        assert bus.masters is bus.errors.of(first)
    bus.disconnect(first)
    bus.submit(second, bus.now_s, 0x80, bytes(pdo.frame(0x80)))
    bus.advance(bus.now_s + 0.001)
    assert bus.masters is bus.errors.of(second)


def test_what_a_bus_off_controller_had_waiting_is_gone_and_others_go_on() -> None:
    bus = SteppedBus()
    port = bus.port()
    heard: list[int] = []
    other = bus.connect(lambda frame, _at_s: heard.append(pdo.unpack(frame)[0]))
    for n in range(20):
        port.send(pdo.frame(0x100 + n, bytes(8)))
        bus.submit(other, 0.0, 0x200 + n, bytes(pdo.frame(0x200 + n)))
    bus.advance(0.0005)
    bus.errors.switch_off(bus.controller, bus.now_s)
    frames_of_port = len(heard) + 1  # one is on the wire
    bus.advance(1.0)
    assert len(heard) == frames_of_port
    assert bus.frames == frames_of_port + 20
    bus.errors.restart(bus.controller, bus.now_s)
    assert all(port.send(pdo.frame(0x100)) for _ in range(QUEUE_LIMIT))
    assert not port.send(pdo.frame(0x100))


def test_a_device_comes_back_by_itself_after_128_times_11_bits_and_a_port_when_it_is_told_to() -> None:
    bus = SteppedBus()
    port = bus.port()
    drive = SimulatedDrive(5)
    source = bus.attach(drive)
    bus.advance(0.1)
    bus.errors.switch_off(bus.errors.of(source), bus.now_s)
    bus.errors.switch_off(bus.controller, bus.now_s)
    bus.advance(0.1 + 1407e-6)
    assert not bus.errors.hears(source)
    bus.advance(0.1 + 1409e-6)
    assert bus.errors.hears(source)
    bus.advance(10.0)
    assert not port.send(pdo.frame(0x80))
    bus.errors.restart(bus.controller, bus.now_s)
    bus.errors.restart_s = 0.1
    bus.errors.switch_off(bus.controller, bus.now_s)
    bus.advance(10.2)
    assert port.send(pdo.frame(0x80))


def test_the_same_run_with_faults_is_the_same_to_the_bit() -> None:
    def run() -> list[tuple[float, bytes]]:
        bench = Bench("XY")
        log = FrameLog()
        bus = bench.rig.buses["can"]
        bus.log(log.keep)
        script = "seed 5\nat 0 s: drop tpdo 1 for 1 s odds 0.2\nat 50 ms: corrupt sync x 3\n"
        FaultScript.read(script + "at 0.1 s: babble 7F for 5 ms").inject(bus, bus.now_s)
        for _ in range(200):
            bench.tick()
        return list(log.frames())

    assert run() == run()
