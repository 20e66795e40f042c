"""Whatever units, polarity and 6085h a drive comes with: its motor is right in mm and s, or it is refused."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest
from support.drives.axis_in_units import PERIOD_S, Axis, Bench, Mechanics, Sheet
from support.drives.makers_sheets import sheet_of
from support.drives.random_drives import INC, METRE, PER_SECOND, REV, any_drive, word
from support.machines.stepped_runs import cut
from support.oracles.motor_units import LATENCY_S, SERVO_S, SETTLES_S, judge

from controller.machine import machine_file
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault, Request
from drives.commission import CommissionError

SHIPPED = Mechanics(1_000_000, (1, 1), 5.0)  # 200 000 counts per mm, where nothing else is said
FAST = {"counts": 200_000.0, "velocity": 200.0, "acceleration": 2000.0}
SOON, LONG = 12, 600  # drives


@pytest.mark.parametrize("seed", range(SOON))
def test_any_drive_moves_and_stops_in_mm_and_s_or_is_refused_by_name(seed: int, tmp_path: Path) -> None:
    drive = any_drive(seed)
    try:
        judge(drive, tmp_path)
    except AssertionError as error:
        raise AssertionError(f"{error}\n{drive.told}") from error


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 1000 + LONG, 50))
def test_many_drives(first: int, tmp_path: Path) -> None:
    for seed in range(first, first + 50):
        (folder := tmp_path / str(seed)).mkdir()
        try:
            judge(any_drive(seed), folder)
        except AssertionError as error:
            raise AssertionError(f"{seed}: {error}\n{any_drive(seed).told}") from error


@pytest.mark.slow
def test_drives_without_a_fault_are_mostly_not_refused(tmp_path: Path) -> None:
    found: Counter[str] = Counter()
    for seed in range(5000, 5060):
        (folder := tmp_path / str(seed)).mkdir()
        drive = any_drive(seed, faults=False)
        found[judge(drive, folder).split(":")[0]] += 1
    assert found["right"] > 30, found


# ---- 6085h ---------------------------------------------------------------------------


def soft(**ways: set[int]) -> Sheet:
    return Sheet(values={(0x6085, 0): 4_000_000}, **ways)


WAYS = [{"fixed": {0x6085}}, {"refusing": {0x6085}}]


@pytest.mark.parametrize("ways", WAYS)
def test_a_quick_stop_of_ten_seconds_is_refused_with_the_object(
    ways: dict[str, set[int]], tmp_path: Path
) -> None:
    with pytest.raises(
        CommissionError, match=r"drive X .* 10 s \(object 6085h reads 4000000.*max_quick_stop_s = 3"
    ):
        Bench(SHIPPED, Axis(**FAST), soft(**ways), tmp_path)


@pytest.mark.parametrize("ways", WAYS)
def test_where_it_is_allowed_it_stands_after_ten_seconds_in_a_metre(
    ways: dict[str, set[int]], tmp_path: Path
) -> None:
    bench = Bench(SHIPPED, Axis(**FAST, general=("max_quick_stop_s = 15.0",)), soft(**ways), tmp_path)
    assert bench.found.stop_s == pytest.approx(10.0)
    bench.home()
    bench.enable()
    bench.run_up(-200.0)
    taken_s, way = bench.quick_stop(12.0)
    assert 9.9 < taken_s < 10.0 + SETTLES_S + LATENCY_S
    assert way == pytest.approx(-1000.0, rel=0.005)


def test_one_that_lets_itself_be_told_stops_as_the_axis_can(tmp_path: Path) -> None:
    bench = Bench(SHIPPED, Axis(**FAST), soft(), tmp_path)
    assert bench.found.stop_s == pytest.approx(0.1)
    bench.home()
    bench.enable()
    bench.run_up(200.0)
    taken_s, way = bench.quick_stop(1.0)
    assert 0.1 < taken_s < 0.1 + SETTLES_S + LATENCY_S and way == pytest.approx(10.0, abs=2.5)


def test_a_limit_of_decelerations_counts_for_quick_stops_too(tmp_path: Path) -> None:
    """60C6h at half of what the axis needs holds back what 6085h would do; so does it on the path."""
    sheet = Sheet(values={(0x60C6, 0): 200_000_000}, fixed={0x60C6})
    with pytest.raises(CommissionError, match=r"object 60C6h reads 200000000.*axis needs 4e\+08"):
        Bench(SHIPPED, Axis(**FAST), sheet, tmp_path)
    axis = Axis(**FAST, extra=("quick_stop_mm_s2 = 4000.0",))
    sheet = Sheet(values={(0x60C6, 0): 400_000_000}, fixed={0x60C6})
    bench = Bench(SHIPPED, axis, sheet, tmp_path)
    assert bench.found.stop_s == pytest.approx(0.1)
    bench.home()
    bench.enable()
    bench.run_up(200.0)
    assert 0.1 < bench.quick_stop(1.0)[0] < 0.1 + SETTLES_S + LATENCY_S


# ---- what would hold an axis back --------------------------------------------------------


@pytest.mark.parametrize(
    ("index", "value"), [(0x607F, 30_000_000), (0x60C5, 300_000_000), (0x60C6, 300_000_000)]
)
@pytest.mark.parametrize("way", ["fixed", "refusing", "ranges"])
def test_a_drive_that_cannot_go_as_the_axis_is_to_is_refused_with_the_object(
    index: int, value: int, way: str, tmp_path: Path
) -> None:
    sheet = Sheet(values={(index, 0): value})
    if way == "ranges":
        sheet.ranges[index] = (1, value)
    else:
        getattr(sheet, way).add(index)
    with pytest.raises(CommissionError, match=rf"object {index:04X}h reads {value}, .* the axis needs"):
        Bench(SHIPPED, Axis(**FAST), sheet, tmp_path)


TURNS = {(0x608F, 1): 1_000_000}  # 5 mm each: 200 mm/s are 2400 1/min


@pytest.mark.parametrize(
    ("values", "sound"),
    [
        ({(0x6080, 0): 2399}, False),
        ({(0x6080, 0): 2400}, True),
        ({(0x6080, 0): 2399, (0x60A9, 0): word(0, REV, 0x47)}, False),
        ({(0x6080, 0): 24_000, (0x60A9, 0): word(-1, REV, 0x47)}, True),
        ({(0x6080, 0): 3000, (0x60A9, 0): word(0, INC, PER_SECOND)}, True),
        ({(0x6080, 0): 2399, (0x60A9, 0): word(-3, METRE, PER_SECOND)}, True),  # some makers': mm/s
        ({(0x6080, 0): 199, (0x60A9, 0): word(-3, METRE, PER_SECOND)}, False),
    ],
)
def test_no_motor_is_told_to_turn_faster_than_its_maker_says(
    values: dict[tuple[int, int], int], sound: bool, tmp_path: Path
) -> None:
    sheet = Sheet(values={**TURNS, (0x6092, 1): 1_000_000, **values}, fixed={0x6080} if not sound else set())

    def commissioned() -> Bench:
        return Bench(SHIPPED, Axis(**FAST), sheet, tmp_path)

    if not sound:
        with pytest.raises(CommissionError, match=r"object 6080h lets the motor turn at"):
            commissioned()
        return
    bench = commissioned()
    bench.home()
    bench.enable()
    bench.run_up(200.0, 0.2)
    assert bench.speed == pytest.approx(200.0, rel=1e-3)


def test_an_epos4_is_not_told_to_turn_a_million_times_a_minute(tmp_path: Path) -> None:
    """2000 counts per revolution and 200 000 per mm: 200 mm/s were 1 200 000 1/min."""
    text = (machine_file.SHIPPED / "trunnion.toml").read_text()
    text = text.replace(
        'profile = "simulated"', f'profile = "maxon_epos4"\neds = "{sheet_of("maxon_epos4")}"', 1
    )
    text = re.sub(r"period_s = [\d.]+", "period_s = 0.01", text)
    (tmp_path / "mine.toml").write_text(text)
    (tmp_path / "tools.toml").write_bytes((machine_file.SHIPPED / "tools.toml").read_bytes())
    with pytest.raises(
        CommissionError, match=r"drive X \(node 1\): object 6080h lets the motor turn at 50000"
    ):
        SteppedMachine(machine_file.load(tmp_path / "mine.toml"))


# ---- contradictions ------------------------------------------------------------------------


def refused_as(values: dict[tuple[int, int], int], sentence: str, folder: Path) -> None:
    with pytest.raises(CommissionError, match=sentence):
        Bench(SHIPPED, Axis(**FAST), Sheet(values=values), folder)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (
            {**TURNS, (0x60A8, 0): word(0, INC), (0x6092, 1): 5000, (0x60A9, 0): word(0, REV, 0x47)},
            "60A8h .* 6092h",
        ),
        (
            {**TURNS, (0x60A8, 0): word(-6, REV), (0x6092, 1): 5000, (0x60A9, 0): word(0, REV, 0x47)},
            "60A8h .* 6092h",
        ),
        ({**TURNS, (0x60A8, 0): 0, (0x60AA, 0): word(0, 0xFF, 0x57)}, "60AAh is 00FF5700h"),
        ({(0x6092, 1): 5000, (0x60A9, 0): word(0, INC, PER_SECOND)}, "60A9h is 00B50300h, in increments"),
    ],
)
def test_what_contradicts_itself_is_refused_with_the_objects(
    values: dict[tuple[int, int], int], sentence: str, tmp_path: Path
) -> None:
    refused_as(values, sentence, tmp_path)


# ---- the whole machine ------------------------------------------------------------------


def odd_sheet() -> Sheet:
    """An encoder with 65536 increments, a gear of 7 : 3, 10 um units by 6092h, and everything inverted."""
    return Sheet(
        values={
            (0x608F, 1): 65_536, (0x6091, 1): 7, (0x6091, 2): 3, (0x6092, 1): 500_000,
            (0x60A9, 0): word(-3, REV, 0x47), (0x60AA, 0): word(0, 0xC0, PER_SECOND), (0x607E, 0): 0xC0,
            (0x6085, 0): 3, (0x6084, 0): 77, (0x60C5, 0): 5, (0x607F, 0): 1,
        }
    )  # fmt: skip


@pytest.mark.parametrize("extra", ["", "feed_forward = true\n"])
def test_a_machine_with_such_a_drive_cuts_and_stops_as_it_is_told(extra: str, tmp_path: Path) -> None:
    eds = odd_sheet().write(tmp_path / "odd.eds", "generic")
    text = (machine_file.SHIPPED / "trunnion.toml").read_text()
    mine = f'{extra}profile = "generic"\neds = "{eds}"'
    text = text.replace("counts_per_mm = 200_000", "counts_per_mm = -100_000", 1)
    text = text.replace('profile = "simulated"', mine, 1)
    (tmp_path / "mine.toml").write_text(text)
    (tmp_path / "tools.toml").write_bytes((machine_file.SHIPPED / "tools.toml").read_bytes())
    made = machine_file.load(tmp_path / "mine.toml")
    mill = SteppedMachine(made)
    mill.come_up()
    seen = mill.observe()
    motor = mill.rig.drives["X"].axis
    per_increment = 5.0 * 3 / 7 / 65_536

    def place() -> float:
        return (motor.servo.position - motor.sensors.moved) * per_increment  # inverted twice

    begun = place()
    done = cut("G21 G90 G0 X60.\nG1 X-60. F6000.\nM2\n", made, stepped=mill)
    assert (done.run.result, done.run.fault) == ("completed", Fault.NONE), done.run.fault_text
    mill.go(100)
    ends = -60.0 + 8.0  # G54
    assert place() - begun == pytest.approx(ends, abs=1e-3)
    assert seen.sight.motors[-1, 0] == pytest.approx(ends, abs=1e-3), "as somebody sees it who stands beside"
    behind = 0.1 if extra else 1.05 * 200.0 * SERVO_S
    assert seen.sight.distance[:, 0].max() < behind
    mill.request(Request.ESTOP)
    mill.go(round((mill.times.quick_stop_s + 0.03) / PERIOD_S))
    assert abs(motor.servo.velocity * per_increment) < 0.2
