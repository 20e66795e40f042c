"""Faults that befall drives by a script: hardware, repeated and late frames, strangers on the bus."""

from __future__ import annotations

import pytest
from support.drives.stepped_drives import PERIOD_S, Bench

from drives import pdo
from drives.bench.simulated import IoNode, Parameters
from drives.bench.simulated.machine402 import Power
from drives.bench.virtual.fault_script import Action, FaultScript, Injection, ScriptError, When, parse
from drives.bench.virtual.virtual_bus import SteppedBus

STEP = 20_000
SPEED = STEP / PERIOD_S

READ = [
    ("at 2 s: jam 3", Injection(Action.JAM, node=3)),
    ("at 2 s: jam 3 for 500 ms", Injection(Action.JAM, node=3, duration_s=0.5)),
    ("at 2 s: weak 3 to 20 %", Injection(Action.WEAK, node=3, value=20)),
    ("at 2 s: weak 3 to 20% for 1 s", Injection(Action.WEAK, node=3, value=20, duration_s=1.0)),
    ("at 2 s: sto 3 for 50 ms", Injection(Action.STO, node=3, duration_s=0.05)),
    ("at 2 s: power 3 for 100 ms", Injection(Action.POWER, node=3, duration_s=0.1)),
    ("at 2 s: limit 3 at -12345", Injection(Action.LIMIT, node=3, value=-12345)),
    ("at 2 s: switch 3 high for 1 s", Injection(Action.SWITCH, node=3, word="high", duration_s=1.0)),
    ("at 2 s: repeat rpdo 3 for 2 s", Injection(Action.REPEAT, 0x203, count=None, duration_s=2.0)),
    ("at 2 s: repeat 203 x 4", Injection(Action.REPEAT, 0x203, count=4)),
    ("at 2 s: mode 3 to 1", Injection(Action.MODE, node=3, value=1)),
    ("at 2 s: mode 3 to -2", Injection(Action.MODE, node=3, value=-2)),
    ("at 2 s: write 3 1400:02 to 255", Injection(Action.WRITE, node=3, word="1400:02", value=255)),
    ("at 2 s: write 3 607a:00 to -5", Injection(Action.WRITE, node=3, word="607A:00", value=-5)),
    ("at 2 s: nmt 3 reset_communication", Injection(Action.NMT, node=3, word="reset_communication")),
    ("at 2 s: foreign rpdo 3", Injection(Action.FOREIGN, 0x203, count=1)),
    ("at 2 s: foreign 203 data 0f00 for 1 s",
     Injection(Action.FOREIGN, 0x203, count=None, data=b"\x0f\0", duration_s=1.0)),
    ("at 2 s: second 3", Injection(Action.SECOND, node=3)),
]  # fmt: skip

REFUSED = [
    ("jam", "'' is no node"),
    ("jam master", "jam does not befall the master"),
    ("jam rpdo 3", "'rpdo' is no node"),
    ("jam 3 x 2", "'x' does not go with jam"),
    ("weak 3", "write 'weak 3 to 20 %'"),
    ("weak 3 to 20", "write per cent"),
    ("weak 3 to 0 %", "a whole number from 1 to 100"),
    ("weak 3 to 120 %", "a whole number from 1 to 100"),
    ("limit 3", "write 'limit 3 at 12345'"),
    ("limit 3 at 1.5", "a whole number from -2147483648 to 2147483647"),
    ("switch 3", "write 'switch 3 high' or 'switch 3 low'"),
    ("switch 3 left", "'left' does not go with switch"),
    ("mode 3", "write 'mode 3 to 1'"),
    ("mode 3 to 200", "a whole number from -128 to 127"),
    ("mode 3 to 1 for 1 s", "'for' does not go with mode"),
    ("write 3 1400:02", "write 'write 3 1400:02 to 255'"),
    ("write 3 to 255", "write 'write 3 1400:02 to 255'"),
    ("write 3 1400 to 255", "'1400' does not go with write"),
    ("write 3 1400:02 to 4294967296", "a whole number from -2147483648 to 4294967295"),
    ("nmt 3", "write 'nmt 3 stop', or another of start, stop"),
    ("nmt 3 halt", "'halt' does not go with nmt"),
    ("nmt 3 stop start", "'start' does not go with nmt"),
    ("foreign rpdo 3 data 0F0", "one to eight bytes"),
    ("foreign 3 data 000102030405060708", "one to eight bytes"),
    ("power 3 by 5 ms", "'by' does not go with power"),
    ("second 3 for 1 s", "'for' does not go with second"),
]


@pytest.mark.parametrize(("line", "meant"), READ)
def test_a_line_means_one_injection_and_can_be_written_again(line: str, meant: Injection) -> None:
    read = parse(line)
    assert read == Injection(**{n: getattr(meant, n) for n in meant.__slots__} | {"when": When(2.0)})
    assert parse(read.text()) == read


@pytest.mark.parametrize(("words", "sentence"), REFUSED)
def test_a_line_that_makes_no_sense_is_refused(words: str, sentence: str) -> None:
    with pytest.raises(ScriptError) as refused:
        FaultScript.read(f"at 2 s: {words}")
    assert sentence in str(refused.value)


@pytest.mark.parametrize("words", ["jam 9", "sto 9", "second 9", "weak 9 to 5 %", "limit 9 at 3"])
def test_what_has_no_motor_cannot_be_jammed(words: str) -> None:
    bus = SteppedBus()
    bus.attach(IoNode(9, Parameters()))
    with pytest.raises(ScriptError, match="node 9 is no drive"):
        FaultScript.read(f"at 1 s: {words}").inject(bus)


class Run:
    """An axis that moves at 10 000 000 counts/s; the faults come 0.1 s after the beginning."""

    def __init__(self, *lines: str, ticks: int = 200, **nature: object) -> None:
        self.bench = bench = Bench(parameters=Parameters(strongest_counts_s2=4e8, **nature))  # type: ignore[arg-type]
        bench.enable()
        start = bench.actual["X"]
        drive = bench.drive
        bus = bench.rig.buses["can"]
        self.faults = FaultScript.read("\n".join(lines)).inject(bus, bus.now_s + 0.0001)
        self.targets: list[int] = []
        self.positions: list[float] = []  # of the motor, at each SYNC
        self.speeds: list[float] = []
        self.statuswords: list[int] = []
        target = start
        for k in range(ticks):
            target += STEP * min(k, 25) // 25
            bench.tick(targets=[target])
            self.targets.append(target)
            self.positions.append(drive.motor_counts - drive.origin_counts)
            self.speeds.append(drive.motor_counts_s)
            self.statuswords.append(bench.statuswords["X"])


def test_a_jammed_motor_stops_hard_and_goes_on_when_it_is_free() -> None:
    run = Run("at 100 ms: jam 1 for 40 ms")
    stuck = run.positions[52:70]
    assert max(stuck) == min(stuck) and run.speeds[55] == 0.0
    assert run.speeds[75] > 0.0
    assert run.positions[-1] == pytest.approx(run.targets[-4], abs=2 * STEP), "it has caught up"
    assert max(b - a for a, b in zip(run.speeds, run.speeds[1:], strict=False)) <= 4e8 * PERIOD_S * 1.001


def test_a_weak_motor_lags() -> None:
    lags = []
    for share in (100, 5):
        run = Run(f"at 0 s: weak 1 to {share} %", ticks=60)
        lags.append(run.targets[25] - run.positions[25])
    assert lags[1] > lags[0] + 50_000


def test_torque_off_lets_it_coast_and_is_told() -> None:
    run = Run("at 100 ms: sto 1 for 20 ms", coast_counts_s2=1e8)
    assert run.speeds[60] == pytest.approx(SPEED - 1e8 * 0.018, rel=0.05)
    assert run.bench.emergencies[0] == (1, 0x9000)
    assert run.bench.drive.axis.power is not Power.ENABLED


def test_power_gone_and_back_is_a_boot_up_and_no_feedback_in_between() -> None:
    booted: list[float] = []
    run = Run("at 100 ms: power 1 for 50 ms", ticks=60)
    bus = run.bench.rig.buses["can"]
    bus.watch(0x701, lambda _frame, at_s: booted.append(at_s))
    begun = bus.now_s
    run.bench.wait(50)
    assert [at - begun for at in booted] == [pytest.approx(0.05 - 0.018 + 0.02, abs=0.003)]


@pytest.mark.parametrize("words", ["limit 1 at 900000", "switch 1 high"])
def test_a_limit_switch_ends_the_motion(words: str) -> None:
    run = Run(f"at 100 ms: {words}", limit_fault=True)
    assert (1, 0x8612) in run.bench.emergencies
    assert run.bench.drive.axis.power is Power.FAULT
    assert run.positions[-1] < run.targets[-1] - 1_000_000


def test_the_switch_on_the_other_side_does_nothing() -> None:
    run = Run("at 100 ms: limit 1 at -100", "at 100 ms: switch 1 low", limit_fault=True)
    assert run.bench.emergencies == []


def test_a_sender_that_repeats_an_old_setpoint_holds_the_axis_there() -> None:
    run = Run("at 100 ms: repeat rpdo 1 for 200 ms", ticks=350)
    assert run.positions[130] == pytest.approx(run.targets[49], abs=STEP)
    assert run.positions[-1] == pytest.approx(run.targets[-4], abs=2 * STEP)


def contents(bench: Bench, *lines: str, ticks: int = 100) -> list[int]:
    """First data bytes of the RPDO 1 as they are on the wire; each tick sends its number."""
    bus, heard = bench.rig.buses["can"], []
    bus.watch(0x201, lambda frame, _at_s: heard.append(frame[8]))
    FaultScript.read("\n".join(lines)).inject(bus, bus.now_s + 0.0001)
    for k in range(ticks):
        bench.wait()
        bench.port.send(pdo.frame(pdo.SYNC))
        bench.port.send(pdo.frame(0x201, bytes([k, 0, 0, 0, 0, 0])))
    bench.wait(50)
    return heard


def test_a_repeated_frame_has_the_content_of_the_last_one_before() -> None:
    heard = contents(Bench(), "at 10 ms: repeat rpdo 1 for 20 ms", ticks=20)
    assert heard == [*range(5), *[4] * 10, *range(15, 20)]


def test_the_first_frame_is_repeated_where_none_was_before() -> None:
    assert contents(Bench(), "at 0 s: repeat rpdo 1 x 3", ticks=5) == [0, 0, 0, 3, 4]


def test_setpoints_that_are_late_for_long_keep_their_order_to_the_end() -> None:
    heard = contents(Bench(), "at 10 ms: delay rpdo 1 by 40 ms for 100 ms")
    assert heard == list(range(100))


def test_late_setpoints_are_as_late_as_is_said() -> None:
    late = Run("at 0 s: delay rpdo 1 by 40 ms for 10 s")
    usual = Run("at 0 s: drop 7FF")
    assert late.positions[150] == pytest.approx(usual.positions[130], abs=STEP)


@pytest.mark.parametrize(("where", "value"), [("1400:02", 255), ("6065:00", 4711), ("60C2:02", -4)])
def test_a_stranger_writes_an_object_of_any_size(where: str, value: int) -> None:
    run = Run(f"at 100 ms: write 1 {where} to {value}")
    index, sub = (int(part, 16) for part in where.split(":"))
    assert run.bench.drive.dictionary.get(index, sub) == value


def test_a_stranger_changes_the_mode() -> None:
    run = Run("at 100 ms: mode 1 to 1")
    assert run.bench.drive.axis.mode == 1
    assert run.positions[-1] < run.targets[-1] - 1_000_000, "setpoints are not followed any more"


@pytest.mark.parametrize(
    ("command", "state"), [("stop", pdo.NMT_STOPPED), ("preop", pdo.NMT_PRE_OPERATIONAL)]
)
def test_a_stranger_commands_the_node(command: str, state: int) -> None:
    run = Run(f"at sync 50: nmt 1 {command}")
    assert run.bench.drive.nmt == state


def test_a_stranger_uses_our_identifier() -> None:
    heard = contents(Bench(), "at 5 ms: foreign rpdo 1 data EE x 2", ticks=6)
    assert [byte for byte in heard if byte != 0xEE] == list(range(6))
    assert heard.count(0xEE) == 2
    heard = contents(Bench(), "at 5 ms: foreign rpdo 1 for 3 ms", ticks=6)
    assert len(heard) == 9


def test_two_nodes_with_one_id_answer_twice() -> None:
    bench = Bench()
    bus, heard = bench.rig.buses["can"], []
    bus.watch(0x581, lambda _frame, at_s: heard.append(at_s))
    FaultScript.read("at 0 s: second 1").inject(bus, bus.now_s)
    bench.wait(50)
    bench.service.send(pdo.frame(0x601, bytes.fromhex("4000100000000000")))
    bench.wait(5)
    assert len(heard) == 2


def test_the_same_script_gives_the_same_run() -> None:
    script = ("at sync 20: weak 1 to 30 %", "at 90 ms: jam 1 for 3 ms", "at 0.2 s: power 1 for 30 ms")
    first, second = Run(*script), Run(*script)
    assert first.positions == second.positions and first.faults.log == second.faults.log
