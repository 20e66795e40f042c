"""What a fault script says, and that exactly this happens on the bus."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.drives.stepped_drives import PERIOD_S, Bench
from support.oracles import frame_bits

from drives import pdo
from drives.bench.virtual.error_counters import Level
from drives.bench.virtual.fault_script import MASTER, Action, FaultScript, Injection, ScriptError, When, parse
from drives.bench.virtual.virtual_bus import Port, SteppedBus

READ = [
    # line, what it means
    ("at 2.5 s: drop 203 x 2", Injection(Action.DROP, 0x203, when=When(2.5), count=2)),
    ("at sync 1200: delay 203 by 500 us x 1",
     Injection(Action.DELAY, 0x203, when=When(sync=1200), delay_s=500e-6)),
    ("at 3s: duplicate tpdo 1 x 4", Injection(Action.DUPLICATE, 0x181, when=When(3.0), count=4)),
    ("at 3 s: reorder rpdo2 5", Injection(Action.REORDER, 0x305, when=When(3.0))),
    ("at 3 s: corrupt heartbeat 3 x 40", Injection(Action.CORRUPT, 0x703, when=When(3.0), count=40)),
    ("at 20 ms: babble 001 for 20 ms",
     Injection(Action.BABBLE, 0x001, when=When(0.02), duration_s=0.02)),
    ("at 6 s: bus_off 3", Injection(Action.BUS_OFF, node=3, when=When(6.0))),
    ("at 6 s: bus_off master for 50 ms",
     Injection(Action.BUS_OFF, node=MASTER, when=When(6.0), duration_s=0.05)),
    ("at 7 s: node_reset 2", Injection(Action.NODE_RESET, node=2, when=When(7.0))),
    ("at 8 s: silence 4 for 100ms", Injection(Action.SILENCE, node=4, when=When(8.0), duration_s=0.1)),
    ("at 9 s: queue_full master for 5 ms",
     Injection(Action.QUEUE_FULL, node=MASTER, when=When(9.0), duration_s=0.005)),
    ("at 4 s: drop sync for 10 ms odds 0.3",
     Injection(Action.DROP, 0x80, when=When(4.0), count=None, duration_s=0.01, odds=0.3)),
    ("at 4 s: falsify emcy 3 byte 7 xor fF x 3",
     Injection(Action.FALSIFY, 0x83, when=When(4.0), count=3, byte=7, mask=0xFF)),
]  # fmt: skip


@pytest.mark.parametrize(("line", "meant"), READ)
def test_a_line_means_one_injection_and_can_be_written_again(line: str, meant: Injection) -> None:
    read = parse(line)
    assert read == Injection(**{n: getattr(meant, n) for n in meant.__slots__} | {"when": read.when})
    assert read.when.at_s == pytest.approx(meant.when.at_s)
    assert parse(read.text()).text() == read.text()


REFUSED = [
    # line, part of the sentence
    ("drop 203", "has no colon"),
    ("at 2.5 s: dorp 203", "'dorp' is no fault; use one of drop, delay"),
    ("at 2.5: drop 203", "write a number and s, ms or us"),
    ("at sync 0: drop 203", "the first SYNC is 1"),
    ("after 3 s: drop 203", "is no time"),
    ("at 2.5 s: drop 803", "'803' is no identifier"),
    ("at 2.5 s: drop rpdo 128", "'128' is no node"),
    ("at 2.5 s: drop 203 x 0", "a whole number from 1"),
    ("at 2.5 s: drop 203 by 5 ms", "'by' does not go with drop"),
    ("at 2.5 s: drop 203 x 2 x 2", "'x' stands twice"),
    ("at 2.5 s: delay 203 x 1", "delay needs a time"),
    ("at 2.5 s: babble 001", "babble needs an end"),
    ("at 2.5 s: bus_off 0x3", "'0x3' is no node"),
    ("at 2.5 s: node_reset master", "cannot be reset from the bus"),
    ("at 2.5 s: falsify 183 byte 8 xor 01", "from 0 to 7"),
    ("at 2.5 s: falsify 183 byte 1 with 01", "stands 'xor'"),
    ("at 2.5 s: falsify 183", "needs the bits to turn"),
    ("at 2.5 s: queue_full master", "queue_full needs an end"),
    ("at 2.5 s: drop 203 odds 2", "a number from 0 to 1"),
    ("seed x", "one whole number"),
    ("at 2.5 s:", "'' is no fault"),
]


@pytest.mark.parametrize(("line", "sentence"), REFUSED)
def test_a_line_that_makes_no_sense_is_refused_with_its_number_and_what_would(
    line: str, sentence: str
) -> None:
    with pytest.raises(ScriptError) as refused:
        FaultScript.read(f"# comment\n\n{line}  # why")
    assert str(refused.value).startswith("line 3: ")
    assert sentence in str(refused.value)


class Wire:
    """A bus with a talker and a listener."""

    def __init__(self, script: str = "", bit_rate: int = 1_000_000) -> None:
        self.bus = SteppedBus(bit_rate)
        self.talker, self.listener = self.bus.port(), self.bus.port()
        self.faults = FaultScript.read(script).inject(self.bus)
        self.heard: list[tuple[float, int, bytes]] = []
        self.bus.connect(lambda frame, at_s: self.heard.append((at_s, *pdo.unpack(frame))))

    def say(self, can_id: int, data: bytes = b"", at_s: float | None = None) -> None:
        if at_s is not None:
            self.bus.advance(at_s)
        assert self.talker.send(pdo.frame(can_id, data))

    def ids(self) -> list[int]:
        return [can_id for _, can_id, _ in self.heard]


def queued(port: Port) -> list[int]:
    buffer, found = bytearray(16), []
    while port.receive_into(buffer):
        found.append(pdo.unpack(buffer)[0])
    return found


def test_dropped_frames_take_the_wire_and_reach_nobody() -> None:
    wire = Wire("at 10 ms: drop 203 x 2")
    for n in range(5):
        wire.say(0x203, bytes([n]), at_s=0.005 * n)
        wire.say(0x204, bytes([n]))
    wire.bus.advance(1.0)
    assert [data[0] for _, can_id, data in wire.heard if can_id == 0x203] == [0, 1, 4]
    assert wire.ids().count(0x204) == 5
    assert wire.bus.frames == 10
    assert wire.faults.finished


def test_a_delayed_frame_comes_later_and_once() -> None:
    wire = Wire("at 0 s: delay 203 by 500 us x 1")
    wire.say(0x203)
    wire.say(0x204)
    wire.bus.advance(1.0)
    (first, _, _), (second, _, _) = wire.heard
    assert wire.ids() == [0x204, 0x203]
    assert second == pytest.approx(500e-6 + frame_bits.length(0x203) * 1e-6)
    assert first == pytest.approx(frame_bits.length(0x204) * 1e-6)


def test_a_duplicated_frame_comes_twice_with_the_same_data() -> None:
    wire = Wire("at 0 s: duplicate 203 x 1")
    wire.say(0x203, b"\x07")
    wire.say(0x203, b"\x08")
    wire.bus.advance(1.0)
    assert sorted(data for _, _, data in wire.heard) == [b"\x07", b"\x07", b"\x08"]


def test_reordered_frames_of_an_identifier_change_places() -> None:
    wire = Wire("at 0 s: reorder 203 x 2")
    for n in range(6):
        wire.say(0x203, bytes([n]), at_s=0.001 * n)
    wire.bus.advance(1.0)
    assert [data[0] for _, _, data in wire.heard] == [1, 0, 3, 2, 4, 5]


def test_a_falsified_frame_has_the_bits_turned_that_were_asked_for() -> None:
    wire = Wire("at 0 s: falsify 183 byte 1 xor 0A x 1")
    wire.say(0x183, b"\x37\x06")
    wire.say(0x183, b"\x37\x06")
    wire.bus.advance(1.0)
    assert [data for _, _, data in wire.heard] == [b"\x37\x0c", b"\x37\x06"]


def test_a_fault_at_a_sync_befalls_that_sync_and_what_follows() -> None:
    wire = Wire("at sync 3: drop sync\nat sync 3: drop 203 x 1")
    for n in range(5):
        wire.say(0x80, at_s=0.002 * n)
        wire.say(0x203, bytes([n]))
    wire.bus.advance(1.0)
    assert wire.ids().count(0x80) == 4
    assert [data[0] for _, can_id, data in wire.heard if can_id == 0x203] == [0, 1, 3, 4]


def test_times_count_from_the_origin() -> None:
    bus = SteppedBus(start_s=100.0)
    port, listener = bus.port(), bus.port()
    FaultScript.read("at 1 s: drop 203").inject(bus, origin_s=100.0)
    for at_s in (100.5, 101.5, 102.5):
        bus.advance(at_s)
        port.send(pdo.frame(0x203))
    bus.advance(103.0)
    assert queued(listener) == [0x203] * 2


def test_chance_is_the_same_with_the_same_seed_and_another_with_another() -> None:
    def survivors(seed: int) -> list[int]:
        wire = Wire(f"seed {seed}\nat 0 s: drop 203 for 1 s odds 0.5")
        for n in range(100):
            wire.say(0x203, bytes([n]), at_s=0.001 * n)
        wire.bus.advance(1.0)
        return [data[0] for _, _, data in wire.heard]

    assert survivors(1) == survivors(1) != survivors(2)
    assert 30 < len(survivors(1)) < 70


def test_a_babbling_node_keeps_everything_above_it_from_the_wire_until_it_ends() -> None:
    wire = Wire("at 1 ms: babble 001 for 20 ms")
    wire.say(0x203, at_s=0.002)
    wire.bus.advance(0.0205)
    assert 0x203 not in wire.ids()
    wire.bus.advance(0.1)
    assert wire.ids().count(0x203) == 1
    at_s = {can_id: at_s for at_s, can_id, _ in wire.heard}
    assert at_s[0x203] == pytest.approx(0.021, abs=0.0004)
    assert wire.ids().count(0x001) == pytest.approx(
        20e-3 / (frame_bits.length(0x001, bytes(8)) * 1e-6), abs=2
    )


def test_a_babbling_node_without_bit_timing_ends_too() -> None:
    wire = Wire("at 1 ms: babble 001 for 20 ms", bit_rate=0)
    wire.bus.advance(1.0)
    assert wire.ids().count(0x001) == pytest.approx(20e-3 / 135e-6, abs=3)


def test_corrupt_frames_are_tried_again_and_end_in_bus_off_with_error_frames_to_their_sender_only() -> None:
    wire = Wire("at 0 s: corrupt 203 x 32")
    stranger = wire.bus.connect(lambda *_: None)
    wire.say(0x203)
    wire.bus.advance(0.001)
    assert wire.bus.controller.transmit > 0
    wire.bus.advance(0.1)
    assert wire.bus.controller.level is Level.OFF
    assert wire.ids() == []
    assert not wire.talker.send(pdo.frame(0x203))
    classes = [can_id & 0xFFF for can_id in queued(wire.listener)]
    assert classes == [0x04, 0x04, 0x40], "warning, passive, bus-off"
    assert wire.bus.errors.of(stranger).receive == 32


def test_a_few_corrupt_frames_cost_time_only_and_are_forgotten() -> None:
    wire = Wire("at 0 s: corrupt 203 x 3")
    wire.say(0x203)
    wire.bus.advance(0.1)
    assert wire.ids() == [0x203]
    bits = frame_bits.length(0x203)
    assert wire.heard[0][0] == pytest.approx((3 * (bits + 23) + bits) * 1e-6)
    assert wire.bus.controller.transmit == 23
    for n in range(30):
        wire.say(0x204, at_s=0.2 + n * 0.001)
    wire.bus.advance(1.0)
    assert wire.bus.controller.clean


def test_the_masters_bus_off_refuses_sending_and_hears_nothing_until_it_is_restarted() -> None:
    wire = Wire("at 10 ms: bus_off master for 50 ms")
    other = wire.bus.connect(lambda *_: None)
    wire.say(0x80, at_s=0.001)
    wire.bus.advance(0.02)
    queued(wire.listener)
    assert not wire.talker.send(pdo.frame(0x203))
    wire.bus.submit(other, wire.bus.now_s, 0x181, bytes(pdo.frame(0x181)))
    wire.bus.advance(0.05)
    assert queued(wire.listener) == []
    wire.bus.advance(0.07)
    assert [can_id & 0xFFF for can_id in queued(wire.listener)] == [0x100]
    assert wire.talker.send(pdo.frame(0x203))
    wire.bus.advance(0.08)
    assert wire.ids() == [0x80, 0x181, 0x203]


def test_a_full_queue_refuses_and_what_was_in_it_goes_out() -> None:
    wire = Wire("at 10 ms: queue_full master for 5 ms")
    wire.bus.advance(0.0099)
    for _ in range(4):
        wire.say(0x203, bytes(8))
    wire.bus.advance(0.012)
    assert not wire.talker.send(pdo.frame(0x204))
    assert wire.ids() == [0x203] * 4
    wire.say(0x205, at_s=0.016)
    wire.bus.advance(0.02)
    assert wire.ids() == [0x203] * 4 + [0x205]


def test_faults_of_nodes_hit_the_node_that_is_named() -> None:
    bench = Bench("XY")
    bus = bench.rig.buses["can"]
    now_s = bus.now_s
    script = FaultScript.read("at 20 ms: silence 1 for 20 ms\nat 100 ms: node_reset 2\nat 200 ms: bus_off 1")
    script.inject(bus, now_s)
    heard: list[tuple[float, int]] = []
    bus.connect(lambda frame, at_s: heard.append((at_s - now_s, pdo.unpack(frame)[0])))
    for _ in range(150):
        bench.tick()
    times = {node: [at_s for at_s, can_id in heard if can_id == 0x180 + node] for node in (1, 2)}
    gap = [at_s for at_s in times[1] if 0.0201 < at_s < 0.0399]
    assert not gap
    assert [at_s for at_s in times[1] if 0.04 < at_s < 0.2]
    assert not [at_s for at_s in times[1] if at_s > 0.201]
    boots = [at_s for at_s, can_id in heard if can_id == 0x702]
    assert boots
    assert max(times[2]) == pytest.approx(0.1, abs=2 * PERIOD_S)


def test_a_node_that_is_not_there_and_a_second_script_are_refused() -> None:
    bus = SteppedBus()
    with pytest.raises(ScriptError, match="node 9 is not on this bus"):
        FaultScript.read("at 1 s: node_reset 9").inject(bus)
    with pytest.raises(ScriptError, match="has faults already"):
        FaultScript().inject(bus)


def test_what_was_done_is_told_and_more_can_be_added_while_it_runs() -> None:
    wire = Wire()
    wire.bus.advance(0.5)
    wire.faults.add(Injection(Action.DROP, 0x203))
    wire.say(0x203)
    wire.say(0x203)
    wire.bus.advance(1.0)
    assert wire.ids() == [0x203]
    assert wire.faults.log == [(0.5, "at 0 s: drop 203 x 1")]


VOCABULARY = (
    "at sync seed : 0 1 2.5 s ms us drop delay duplicate corrupt reorder falsify babble bus_off silence"
    " node_reset queue_full 203 rpdo tpdo emcy heartbeat master x by for odds byte xor 0A # 999999 -1 ."
    " \u0663 \u00b2"
)


@given(st.lists(st.sampled_from(VOCABULARY.split()), max_size=14).map(" ".join) | st.text(max_size=40))
def test_any_text_is_a_script_or_a_sentence(text: str) -> None:
    try:
        FaultScript.read(text)
    except ScriptError as error:
        assert str(error).startswith("line ")


FRAME_FAULTS = st.builds(
    Injection,
    action=st.sampled_from([action for action in Action if action.of_frames]),
    can_id=st.sampled_from([0x080, 0x203, 0x204]),
    when=st.builds(When, at_s=st.floats(0.0, 0.05)) | st.builds(When, sync=st.integers(1, 20)),
    count=st.integers(1, 12) | st.none(),
    duration_s=st.floats(0.001, 0.02),
    delay_s=st.floats(0.0001, 0.01),
    odds=st.sampled_from([0.5, 1.0]),
    mask=st.integers(1, 255),
)
NODE_FAULTS = st.builds(
    Injection,
    action=st.sampled_from([Action.BABBLE, Action.BUS_OFF, Action.SILENCE, Action.QUEUE_FULL]),
    can_id=st.just(0x001),
    node=st.just(MASTER),
    when=st.builds(When, at_s=st.floats(0.0, 0.05)) | st.builds(When, sync=st.integers(1, 20)),
    duration_s=st.floats(0.001, 0.02),
)


@settings(max_examples=60)
@given(st.lists(FRAME_FAULTS | NODE_FAULTS, max_size=5), st.integers(0, 9), st.sampled_from([1_000_000, 0]))
def test_after_any_faults_the_bus_carries_again_and_no_frame_has_come_from_nowhere(
    faults: list[Injection], seed: int, bit_rate: int
) -> None:
    bus = SteppedBus(bit_rate)
    bus.errors.restart_s = 0.001
    port = bus.port()
    times: list[float] = []
    ids: list[int] = []

    def hear(frame: bytes, at_s: float) -> None:
        times.append(at_s)
        ids.append(pdo.unpack(frame)[0])

    bus.connect(hear)
    FaultScript(tuple(faults), seed).inject(bus)
    for n in range(50):
        bus.advance(n * 0.002)
        port.send(pdo.frame(0x080))
        port.send(pdo.frame(0x203, n.to_bytes(2, "little")) + pdo.frame(0x204, bytes(4)))
    bus.advance(1.0)
    copies = sum(f.count or 50 for f in faults if f.action is Action.DUPLICATE)
    assert times == sorted(times)
    assert len([can_id for can_id in ids if can_id in (0x080, 0x203, 0x204)]) <= 150 + copies
    assert port.send(pdo.frame(0x111))
    bus.advance(2.0)
    assert ids[-1] == 0x111
