"""What the pump sends in each period, on ports that write down what they get."""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence

import pytest

from drives import pdo
from drives.pump.plan_memory import FOLLOWS, Memory, Phase, PlanWriter, Played, Stop
from drives.pump.player import LONG_GAP, Player, beat_every
from drives.pump.wires import BusWire, DriveWire

MASTER = 127
T = 0.002
HOLD = 4
SYNC = (pdo.SYNC, b"")
BEAT = (pdo.HEARTBEAT + MASTER, bytes([pdo.NMT_OPERATIONAL]))
WORD = 0x0F


class Port:
    """Takes packets, or refuses them."""

    def __init__(self) -> None:
        self.heard: list[tuple[int, bytes]] = []
        self.packets = 0
        self.takes = True

    def send(self, frame: bytes | bytearray | memoryview) -> bool:
        if self.takes:
            self.packets += 1
            for at in range(0, len(frame), pdo.FRAME_BYTES):
                self.heard.append(pdo.unpack(frame[at : at + pdo.FRAME_BYTES]))
        return self.takes

    def last(self, beats: bool = False) -> list[tuple[int, bytes]]:
        heard, self.heard = self.heard, []
        return [one for one in heard if beats or one != BEAT]


class Bench:
    """Three drives, on one bus or two."""

    def __init__(self, buses: Sequence[Sequence[int]] = ((0, 1, 2),), beats: int = 1000, **drive: bool):
        self.memory = Memory(3)
        self.writer = PlanWriter(self.memory)
        self.ports = [Port() for _ in buses]
        wires = [
            BusWire(port, [(i, DriveWire(i + 1, 1, drive.get("feed_forward", False))) for i in bus], False)
            for port, bus in zip(self.ports, buses, strict=True)
        ]
        self.player = Player(self.memory, wires, T, MASTER, beats)
        for i in range(3):
            self.memory.words[i] = WORD | FOLLOWS

    def publish(self, first: int, rows: int, nominal: int = 0, stop: Stop | None = None, anew: bool = True):
        for period in range(first, first + rows):
            self.writer.put(period, (float(period), *(100.0 * i + period for i in range(3))))
        self.writer.publish(first, first, nominal or rows, HOLD, stop, anew)

    def play(self) -> Played:
        self.player.prepare()
        self.player.send(0, 0)
        return self.writer.played()


def command(place: int, setpoint: int, word: int = WORD) -> tuple[int, bytes]:
    return pdo.rpdo(1, place + 1), pdo.COMMAND.pack(word, setpoint)


def test_without_a_plan_nothing_is_sent_and_the_period_is_recorded() -> None:
    bench = Bench()
    for period in range(5):
        played = bench.play()
        assert (played.period, played.phase, played.number) == (period, Phase.SILENT, 0)
    assert bench.ports[0].heard == []


def test_each_period_is_sync_then_its_setpoints() -> None:
    bench = Bench()
    bench.publish(0, 4)
    for period in range(4):
        played = bench.play()
        assert (played.period, played.phase, played.number) == (period, Phase.NOMINAL, 1)
        assert bench.ports[0].last() == [SYNC, *(command(i, 100 * i + period) for i in range(3))]


def test_sync_goes_to_every_bus_before_any_setpoint() -> None:
    order: list[int] = []
    bench = Bench(buses=((0, 2), (1,)))
    for n, port in enumerate(bench.ports):
        take = port.send

        def send(frame, n=n, take=take):
            order.append(n)
            return take(frame)

        bench.player._buses[n].send = send
    bench.publish(0, 2)
    bench.play()
    assert order[:5] == [0, 1, 0, 0, 1]
    assert [port.last() for port in bench.ports] == [
        [SYNC, command(0, 0), command(2, 200)],
        [SYNC, command(1, 100)],
    ]


def test_a_plan_used_up_is_held_and_then_there_is_silence_heartbeat_too() -> None:
    bench = Bench(beats=1)
    bench.publish(0, 3)
    phases = []
    for _ in range(3 + HOLD):
        phases.append(bench.play().phase)
        heard = bench.ports[0].last(beats=True)
        last = min(len(phases), 3) - 1
        assert heard == [SYNC, *(command(i, 100 * i + last) for i in range(3)), BEAT]
    assert phases == [Phase.NOMINAL] * 3 + [Phase.HOLDING] * HOLD
    for _ in range(3):
        assert bench.play().phase is Phase.SILENT
        assert bench.ports[0].last(beats=True) == []


def test_a_stop_is_along_the_rows_from_the_last_one_that_is_played_as_it_is() -> None:
    """A straight line at a row a period: the counts of a place are known."""
    jerk, held = -2.0e9 / 8, 8
    stop = Stop((jerk, -jerk), held, 0, 1.0 / T, 0.0)  # v(16 T) = v + jerk (8 T)^2 = 1/T - 64 T^2 * 2.5e8
    bench = Bench()
    bench.publish(0, 40, nominal=5, stop=stop)
    setpoints = []
    for period in range(5 + 2 * held + HOLD):
        phase = bench.play().phase
        setpoints.append(pdo.COMMAND.unpack(bench.ports[0].last()[1][1])[1])
        wanted = Phase.NOMINAL if period < 5 else Phase.BRAKING if period < 21 else Phase.HOLDING
        assert phase is wanted, period
    assert setpoints[:5] == [0, 1, 2, 3, 4]
    steps = [b - a for a, b in itertools.pairwise(setpoints)]
    assert steps[-HOLD:] == [0] * HOLD
    assert bench.play().phase is Phase.SILENT


def test_a_newer_plan_takes_over_at_once_and_from_holding() -> None:
    bench = Bench()
    bench.publish(0, 3)
    for _ in range(2):
        bench.play()
    bench.publish(2, 3, anew=False)
    assert [bench.play().phase for _ in range(4)] == [Phase.NOMINAL] * 3 + [Phase.HOLDING]
    bench.writer.put(6, (6.0, 0.0, 0.0, 0.0))
    bench.writer.publish(4, 6, 3, HOLD, None)
    played = bench.play()
    assert (played.phase, played.number) == (Phase.NOMINAL, 3)


def test_silence_ends_with_a_beginning_only() -> None:
    bench = Bench()
    bench.publish(0, 1)
    while bench.play().phase is not Phase.SILENT:
        pass
    period = bench.player.period
    bench.publish(period + 1, 5, anew=False)
    assert bench.play().phase is Phase.SILENT
    bench.ports[0].last()
    bench.publish(period + 2, 5)
    assert bench.play().phase is Phase.NOMINAL
    assert bench.ports[0].last()[1] == command(0, period + 2)


@pytest.mark.parametrize("silences", [0, 3])
@pytest.mark.parametrize("late", [0, 1, HOLD + 9])
def test_a_beginning_whose_rows_are_over_is_none(silences: int, late: int) -> None:
    bench = Bench()
    if silences:
        bench.publish(0, 2)
    for _ in range(silences and 2 + HOLD + silences):
        bench.play()
    bench.ports[0].last()
    bench.publish(bench.player.period + 1 - 4 - late, 4)  # a pump that was away takes its looks late
    played = bench.play()
    assert played.phase is Phase.SILENT and bench.ports[0].last() == []
    bench.publish(bench.player.period + 1 - 3, 4)
    assert bench.play().phase is Phase.NOMINAL, "the last of its rows is enough"
    assert bench.ports[0].last()[1] == command(0, bench.player.period)


@pytest.mark.parametrize("seed", range(20))
def test_whatever_is_published_and_however_late_each_setpoint_is_of_a_row_or_as_before(seed: int) -> None:
    chance = random.Random(seed)
    bench, before, silent = Bench(), None, True
    for _ in range(400):
        next_ = bench.player.period + 1
        if chance.random() < 0.6:
            late = chance.choice((0, 0, 0, 1, 2, 5, 12))
            bench.publish(next_ - late, chance.randrange(1, 8), anew=silent or chance.random() < 0.1)
        if chance.random() < 0.03:
            bench.player.slip(chance.choice((0.5, LONG_GAP + 1.0)))
        phase = bench.play().phase
        silent = phase in (Phase.SILENT, Phase.GAP)
        heard = bench.ports[0].last()
        assert bool(heard) is (phase is not Phase.SILENT)
        if heard:
            expected = next_ if phase is Phase.NOMINAL else before
            assert heard == [SYNC, *(command(i, 100 * i + expected) for i in range(3))]
            before = expected


def test_a_drive_that_does_not_follow_gets_the_position_where_it_is() -> None:
    bench = Bench()
    bench.publish(0, 2)
    bench.memory.words[1], bench.memory.positions[1] = 0x06, -12345
    bench.play()
    assert bench.ports[0].last() == [SYNC, command(0, 0), command(1, -12345, 0x06), command(2, 200)]


def test_a_word_acts_with_the_next_period_whatever_the_plan_is() -> None:
    bench = Bench()
    bench.publish(0, 9)
    bench.play()
    bench.memory.words[0] = 0x02 | FOLLOWS  # quick stop
    bench.ports[0].last()
    bench.play()
    assert bench.ports[0].last()[1] == command(0, 1, 0x02)


def test_a_bus_that_is_muted_gets_the_heartbeat_alone() -> None:
    bench = Bench(buses=((0, 1), (2,)), beats=2)
    bench.publish(0, 9)
    bench.memory.muted = 0b10
    heard = []
    for _ in range(4):
        assert bench.play().unsent == 0
        heard.append(bench.ports[1].last(beats=True))
    assert heard == [[BEAT], [], [BEAT], []]
    assert len(bench.ports[0].last(beats=True)) == 4 * 3 + 2


def test_what_a_bus_does_not_take_is_reported_by_its_number() -> None:
    bench = Bench(buses=((0, 1), (2,)))
    bench.publish(0, 9)
    bench.ports[1].takes = False
    assert bench.play().unsent == 0b10
    bench.ports[1].takes = True
    assert bench.play().unsent == 0


def test_setpoints_of_a_bus_that_packs_go_in_one_packet() -> None:
    memory, port = Memory(2), Port()
    wires = [BusWire(port, [(0, DriveWire(1, 1, False)), (1, DriveWire(2, 3, False))], True)]
    player, writer = Player(memory, wires, T, MASTER, 1000), PlanWriter(memory)
    memory.words[0] = memory.words[1] = WORD | FOLLOWS
    writer.put(0, (0.0, 5.0, 6.0))
    writer.publish(0, 0, 1, HOLD, None, True)
    player.prepare()
    player.send(0, 0)
    assert port.packets == 3  # SYNC, setpoints, heartbeat of period 0
    assert port.heard[1:3] == [command(0, 5), (pdo.rpdo(3, 2), pdo.COMMAND.pack(WORD, 6))]


def test_a_bus_that_packs_and_has_no_drive_gets_sync_alone() -> None:
    """An empty packet would be the end of its client to a hub."""
    bench, port = Bench(), Port()
    bench.player = Player(bench.memory, [BusWire(port, [], True)], T, MASTER, 1000)
    bench.publish(0, 2)
    for _ in range(2):
        assert bench.play().unsent == 0
    assert port.packets == 3 and port.last() == [SYNC, SYNC], "and one heartbeat"


def test_feed_forward_is_the_slope_of_the_setpoints() -> None:
    bench = Bench(feed_forward=True)
    for i in range(3):
        bench.memory.velocity_units[i] = 10.0
    for period, counts in enumerate((0.0, 3.0, 5.0)):
        bench.writer.put(period, (0.0, counts, counts, counts))
    bench.writer.publish(0, 0, 3, HOLD, None, True)
    heard = []
    for _ in range(4):
        bench.play()
        heard.append(pdo.TARGET.unpack(bench.ports[0].last()[1][1]))
    assert heard == [(0, 0), (3, 30), (5, 20), (5, 0)]


def test_setpoints_are_kept_within_32_bits() -> None:
    bench = Bench()
    bench.writer.put(0, (0.0, 1e12, -1e12, 2.5))
    bench.writer.publish(0, 0, 1, HOLD, None, True)
    bench.play()
    found = [pdo.COMMAND.unpack(data)[1] for _, data in bench.ports[0].last()[1:4]]
    assert found == [(1 << 31) - 1, -(1 << 31), 2]


@pytest.mark.parametrize(("late", "phase"), [(1.0, Phase.NOMINAL), (LONG_GAP + 0.5, Phase.GAP)])
def test_a_pump_that_was_late_goes_on_but_after_a_long_gap_only_anew(late: float, phase: Phase) -> None:
    bench = Bench()
    bench.publish(0, 30)
    for _ in range(3):
        bench.play()
    bench.player.slip(late)
    bench.ports[0].last()
    played = bench.play()
    assert (played.period, played.phase, played.slips) == (3, phase, 1)
    heard = bench.ports[0].last()
    assert heard[1] == command(0, 3 if phase is Phase.NOMINAL else 2)
    bench.publish(4, 30, anew=False)
    assert bench.play().phase is phase
    bench.publish(5, 30)
    assert bench.play().phase is Phase.NOMINAL


def test_a_gap_in_which_nobody_begins_anew_ends_in_silence() -> None:
    bench = Bench()
    bench.publish(0, 30)
    bench.play()
    bench.player.slip(LONG_GAP + 1.0)
    assert [bench.play().phase for _ in range(HOLD + 1)] == [Phase.GAP] * HOLD + [Phase.SILENT]


def test_told_to_finish_it_takes_no_other_plan_and_comes_to_its_end() -> None:
    bench = Bench()
    bench.publish(0, 3)
    bench.play()
    bench.player.finish()
    bench.publish(1, 50)
    phases = [bench.play().phase for _ in range(2 + HOLD + 1)]
    assert phases == [Phase.NOMINAL] * 2 + [Phase.HOLDING] * HOLD + [Phase.SILENT]


def test_the_heartbeat_is_never_rarer_than_it_is_promised() -> None:
    assert beat_every(0.002, 0.05) == 25
    assert beat_every(0.003, 0.05) == 16
    assert beat_every(0.1, 0.05) == 1


# ---- a thread's spindle

FULLY = (0.0, 0.0, 0.0)  # a row is led: it has no law of its own


class ThreadBench:
    """A drive and a spindle, which a row leads."""

    def __init__(self) -> None:
        self.memory, self.port = Memory(1, thread=True), Port()
        self.writer = PlanWriter(self.memory)
        wire = BusWire(self.port, [(0, DriveWire(1, 1, False))], False, DriveWire(9, 1, False))
        self.player = Player(self.memory, [wire], T, MASTER, 1000)
        self.memory.words[0] = self.memory.words[1] = WORD | FOLLOWS
        self.memory.velocity_units[1] = 100.0  # units of 60FFh in one rev/s

    def speeds(self, periods: int) -> list[int | None]:
        """What the spindle was told in each period; None: nothing."""
        found: list[int | None] = []
        for _ in range(periods):
            self.player.prepare()
            self.player.send(0, 0)
            told = [data for can_id, data in self.port.last() if can_id == pdo.rpdo(1, 9)]
            assert len(told) <= 1
            found.append(pdo.COMMAND.unpack(told[0])[1] if told else None)
        return found


def test_a_row_leads_the_spindle_and_at_the_end_of_the_plan_it_stands() -> None:
    bench = ThreadBench()
    for period, thread in enumerate([(0.0, 0.0, 0.0), (1.5, -2.0, 0.0), (-2.25, -2.0, 0.1)]):
        bench.writer.put(period, (float(period), 5.0, *thread, *FULLY))
    bench.writer.publish(0, 0, 3, HOLD, None, True)
    assert bench.speeds(4 + HOLD) == [None, 150, -225, *[0] * HOLD, None]


def test_a_spindle_that_cannot_be_led_is_told_nothing() -> None:
    bench = ThreadBench()
    bench.memory.words[1] = WORD
    bench.writer.put(0, (0.0, 5.0, 1.5, -2.0, 0.0, *FULLY))
    bench.writer.publish(0, 0, 1, HOLD, None, True)
    assert bench.speeds(2) == [None, None]


def test_along_a_stop_spindle_and_axes_go_by_its_speed_and_by_how_they_answer() -> None:
    """The axes are at s + lag v, and the spindle turns at turn ((1 + slip) v + lag a), v of the period."""
    v, turn, counts, axis_s, slip, lag_s = 20.0, -2.0, 1e6, 0.005, 0.03, 0.02
    jerk, held = 4e3, 16
    stop = Stop((-jerk, jerk), held, 0, v, 0.0, axis_s, slip, lag_s)
    bench, nominal = ThreadBench(), 3
    for period in range(60):
        s, speed = v * T * period, turn * (1.0 + slip) * v
        bench.writer.put(period, (s, counts * (s + axis_s * v), speed, turn, axis_s * v, *FULLY))
    bench.writer.publish(0, 0, nominal, HOLD, stop, True)
    s, a = v * T * (nominal - 1), 0.0
    assert bench.speeds(nominal) == [round(100.0 * turn * (1.0 + slip) * v)] * nominal
    for k in range(2 * held):
        j = -jerk if k < held else jerk
        before = s
        s, v, a = s + T * (v + T * (a / 2.0 + T * j / 6.0)), v + T * (a + T * j / 2.0), a + T * j
        (told,) = bench.speeds(1)
        wanted = 100.0 * turn * ((1.0 + slip) * (s - before) / T + lag_s * a)
        assert told is not None and abs(told - wanted) <= 0.5 + 1e-6
        wanted = counts * (s + axis_s * (v + 0.5 * axis_s * a))
        assert bench.player._counts[0] == pytest.approx(wanted, abs=1.0)
    assert bench.speeds(1) == [0]
