"""How drives stop by themselves: what they are told, what they make of it, what is promised then."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from support.drives.makers_sheets import SHEETS, sheet_of
from support.drives.stepped_drives import EDS, Bench, nodes

from controller.machine import drive_profiles
from drives import commission, pdo
from drives.arranged import Arranged
from drives.bench.simulated import Rig, rig
from drives.bench.simulated.dictionary import Abort, Code, key
from drives.commission import CommissionError
from drives.commissioning.stopping import stop_counts_s2
from drives.commissioning.units import Units
from drives.profile import GENERIC
from drives.settings import BusSettings, MasterSettings, NodeSettings
from drives.texts import english

BUS = BusSettings("can", "virtual", "", 1_000_000)
# 200 mm/s and 2000 mm/s2 at 200 000 counts per mm.
FAST = {"velocity_counts_s": 4e7, "acceleration_counts_s2": 4e8}
AXIS = NodeSettings("X", "can", 1, EDS, velocity_counts_s=4e7, acceleration_counts_s2=4e8)
STANDS = 400  # counts in a tick: 1 mm/s
SETTLES_S = 0.024  # two ticks on the bus, and the servo behind its demand
Change = Callable[[Rig], None]


def commissioned(change: Change = lambda _: None, **settings: object) -> tuple[Rig, commission.Outcome]:
    """One drive, changed before anybody speaks to it."""
    made = nodes("X", **{**FAST, **settings})
    stepped = rig(made, [BUS])
    change(stepped)
    return stepped, again(stepped, made)


def again(stepped: Rig, made: list[NodeSettings]) -> commission.Outcome:
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    return commission.commission(network, made, MasterSettings())[0]


def arranged(outcome: commission.Outcome) -> Arranged:
    assert outcome.arranged is not None
    return outcome.arranged


def fixed(index: int, value: int) -> Change:
    """Whatever is written, the drive reads so."""

    def change(stepped: Rig) -> None:
        stepped.drives["X"].dictionary.readers[key(index)] = lambda: value

    return change


def refusing(index: int) -> Change:
    def refuse(_: int) -> None:
        raise Abort(Code.VALUE)

    def change(stepped: Rig) -> None:
        stepped.drives["X"].dictionary.writers[key(index)] = refuse

    return change


def without(*indexes: int) -> Change:
    return lambda stepped: stepped.drives["X"].dictionary.leave_out(set(indexes))


def test_a_drive_is_told_to_stop_as_its_axis_can() -> None:
    stepped, outcome = commissioned()
    get = stepped.drives["X"].dictionary.get
    assert (get(0x6085), get(0x6084)) == (400_000_000, 400_000_000)
    assert [get(index) for index in (0x605A, 0x605B, 0x605C, 0x605D, 0x605E)] == [2, 1, 1, 1, 2]
    assert (get(0x607F), get(0x6080)) == (42_000_000, 0xFFFF_FFFF), "6080h is 1/min, and nothing says of what"
    assert (get(0x60C5), get(0x60C6)) == (0xFFFF_FFFF, 0xFFFF_FFFF), "no less than is needed"
    assert get(0x6066) == 10
    found = arranged(outcome)
    assert (found.stop_counts_s2, found.stop_s, found.notes) == (4e8, pytest.approx(0.1), ())
    assert ("6085h:00", 400_000_000) in found.objects


def test_the_machine_file_may_say_how_hard() -> None:
    stepped, outcome = commissioned(quick_stop_counts_s2=8e8)
    assert stepped.drives["X"].dictionary.get(0x6085) == 800_000_000
    assert stepped.drives["X"].dictionary.get(0x6084) == 400_000_000
    assert arranged(outcome).stop_s == pytest.approx(0.05)


def test_a_second_time_nothing_is_written() -> None:
    stepped, first = commissioned()
    assert {0x6084, 0x605B, 0x607F} <= {change.index for change in first.changes}
    heard = stepped.port()
    second = again(stepped, nodes("X", **FAST))
    buffer, written = bytearray(16), []
    while heard.receive_into(buffer):
        can_id, data = pdo.unpack(buffer)
        if can_id == 0x601 and data[0] & 0xE0 == 0x20:
            written.append(data)
    assert written == [] and second.changes == []
    assert second.arranged == first.arranged


def test_an_acceleration_limit_that_would_hold_the_quick_stop_back_is_raised() -> None:
    def weak(stepped: Rig) -> None:
        for index in (0x60C5, 0x60C6):
            stepped.drives["X"].dictionary.values[key(index)] = 1000

    stepped, outcome = commissioned(weak)
    get = stepped.drives["X"].dictionary.get
    assert (get(0x60C5), get(0x60C6)) == (480_000_000, 480_000_000)
    assert arranged(outcome).stop_s == pytest.approx(0.1)


def test_a_drive_that_brakes_softer_than_it_was_told_makes_the_promise_longer() -> None:
    _, outcome = commissioned(fixed(0x6085, 100_000_000))
    found = arranged(outcome)
    assert found.stop_s == pytest.approx(0.4)
    (note,) = map(english, found.notes)
    assert "drive X (node 1): object 6085h:00 was set to 400000000" in note and "reads 100000000" in note


def test_ten_seconds_are_promised_where_the_machine_file_allows_them_and_refused_otherwise() -> None:
    """4e6 counts/s2 from 4e7 counts/s."""
    with pytest.raises(
        CommissionError, match=r"drive X .* take 10 s \(object 6085h reads 4000000.*max_quick_stop_s = 3"
    ):
        commissioned(fixed(0x6085, 4_000_000))
    _, outcome = commissioned(fixed(0x6085, 4_000_000), most_quick_stop_s=15.0)
    assert arranged(outcome).stop_s == pytest.approx(10.0)


def test_a_refusal_is_told_with_the_drives_reason_and_what_it_has_counts() -> None:
    _, outcome = commissioned(refusing(0x6085), acceleration_counts_s2=3.5e8)
    (note,) = map(english, arranged(outcome).notes)
    assert "6085h:00 refuses 350000000" in note and "0x06090030" in note and "reads 400000000" in note
    assert arranged(outcome).stop_s == pytest.approx(4e7 / 3.5e8), "the axis is not made for more"


def test_a_ramp_that_no_motor_follows_is_promised_with_the_way_back() -> None:
    """From 4e7 counts/s by 2e8 counts/s^2 0.2 s and 4e6 counts to rest, and nearly all of it back."""
    found = {0x605A: 2, 0x6085: 0xFFFF_FFFF}
    promised_s = 4e7 / stop_counts_s2(found, replace(AXIS, acceleration_counts_s2=2e8), Units())
    assert promised_s == pytest.approx(0.2 + 2.0 * math.sqrt(4e6 / 2e8), rel=0.05)


def test_a_drive_without_the_object_is_promised_the_longest_stop_until_somebody_measures() -> None:
    _, outcome = commissioned(without(0x6085))
    found = arranged(outcome)
    assert (found.stop_counts_s2, found.stop_s) == (0.0, 3.0)
    missing, measure = map(english, found.notes)
    assert "it has no 6085h;" in missing and "measure it" in measure
    _, measured = commissioned(without(0x6085), quick_stop_counts_s2=1e8)
    assert arranged(measured).stop_s == pytest.approx(0.4)


def test_an_object_that_cannot_be_read_is_told_and_stops_nobody() -> None:
    def refuse() -> int:
        raise Abort(Code.HARDWARE)

    def secret(stepped: Rig) -> None:
        stepped.drives["X"].dictionary.readers[key(0x605B)] = refuse

    _, outcome = commissioned(secret)
    assert any("605Bh:00 cannot be read" in english(note) for note in arranged(outcome).notes)


def test_what_matters_little_may_be_missing_without_a_word() -> None:
    _, outcome = commissioned(without(0x605D, 0x6066, 0x6080, 0x60C5, 0x60C6))
    assert arranged(outcome).notes == ()


def test_without_limits_of_the_axis_the_stop_is_left_to_the_drive_but_for_a_quick_stop_that_is_named() -> (
    None
):
    stepped, outcome = commissioned(velocity_counts_s=0.0)
    assert stepped.drives["X"].dictionary.get(0x605B) == 0
    assert arranged(outcome).stop_s == 0.0
    stepped, outcome = commissioned(velocity_counts_s=0.0, quick_stop_counts_s2=3e7)
    assert arranged(outcome).objects == (("6085h:00", 30_000_000),)
    assert stepped.drives["X"].dictionary.get(0x6085) == 30_000_000


@pytest.mark.parametrize(
    ("found", "stop", "why"),
    [
        ({0x605A: 2, 0x6085: 50}, 500.0, "quick stop's ramp"),
        ({0x605A: 6, 0x6085: 50}, 500.0, "and stay"),
        ({0x605A: 1, 0x605E: 2, 0x6084: 20, 0x6085: 50}, 200.0, "the profile's ramp"),
        ({0x605A: 5, 0x605E: 2, 0x6083: 30, 0x6085: 50}, 300.0, "its acceleration where there is no 6084h"),
        ({0x605A: 2, 0x605E: 1, 0x6084: 20, 0x6085: 50}, 200.0, "a faulted drive takes longer"),
        ({0x605A: 2, 0x605E: 0, 0x6085: 50}, 500.0, "one that coasts has no torque, and no promise"),
        ({0x605A: 2, 0x6085: 50, 0x60C6: 10}, 100.0, "60C6h holds it back"),
        ({0x605A: 2, 0x6085: 0}, 0.0, "not set"),
        ({0x605A: 0, 0x6085: 50}, 0.0, "it coasts"),
        ({0x6085: 50}, 500.0, "605Ah is 2 where it is not there"),
        ({}, 0.0, "nothing is known"),
    ],
)
def test_what_is_promised_is_the_weakest_ramp_as_read(found: dict[int, int], stop: float, why: str) -> None:
    assert stop_counts_s2(found, AXIS, Units(1.0, 10.0)) == pytest.approx(stop), why


# ---- standstill ------------------------------------------------------------------


@pytest.mark.parametrize("quick_stop", [1e8, 4e8, 8e8])
def test_the_simulated_axis_stands_after_the_time_that_is_promised(quick_stop: float) -> None:
    bench = Bench("X", **FAST, quick_stop_counts_s2=quick_stop, following_error_counts=10**7)
    bench.enable()
    speed, target = 0.0, bench.actual["X"]
    while speed < 4e7:
        speed += 4e8 * 0.002
        target += round(speed * 0.002)
        bench.tick(targets=(target,))
    for _ in range(20):
        target += 80_000
        bench.tick(targets=(target,))
    before = bench.actual["X"]
    ticks, moved = 0, STANDS
    while moved >= STANDS and ticks < 1000:
        bench.tick(0x02, targets=(target,))
        ticks, moved, before = ticks + 1, abs(bench.actual["X"] - before), bench.actual["X"]
    promised_s = 4e7 / quick_stop
    assert 0.9 * promised_s < ticks * 0.002 < 1.05 * promised_s + SETTLES_S


# ---- in the drive's own units ----------------------------------------------------


def epos(tmp_path: Path, resolution: int = 4096) -> str:
    """The simulated drive's data sheet with the SI units of an EPOS4."""
    text = Path(EDS).read_text(encoding="latin-1")
    begin = text.index("[608Fsub1]")
    end = text.index("[", begin + 1)
    entry = text[begin:end].replace("DefaultValue=1", f"DefaultValue={resolution}")
    feed = text.index("[6092sub1]")
    text = (
        text[:begin]
        + entry
        + text[end:feed]
        + text[feed:].replace("DefaultValue=1", f"DefaultValue={resolution}", 1)
    )
    for index, value in (("60A9", "0x00B44700"), ("60AA", "0x00C00300")):
        before, section, after = text.partition(f"[{index}]")
        text = before + section + after.replace("DefaultValue=0", f"DefaultValue={value}", 1)
    file = tmp_path / "epos.eds"
    file.write_text(text, encoding="latin-1")
    return str(file)


def test_a_drive_in_revolutions_per_minute_is_told_everything_in_them(tmp_path: Path) -> None:
    """4096 counts: 1/min is 68.26667 counts/s; 3000 1/min are 204800 counts/s."""
    made = nodes(
        "X",
        eds=epos(tmp_path),
        velocity_counts_s=204_800.0,
        acceleration_counts_s2=2_048_000.0,
        homing_fast_counts_s=68_267,
        homing_slow_counts_s=683,
        homing_acceleration_counts_s2=683_000,
        following_error_counts=4000,
    )
    stepped = rig(made, [BUS])
    found = arranged(again(stepped, made))
    get = stepped.drives["X"].dictionary.get
    assert (get(0x6099, 1), get(0x6099, 2), get(0x609A)) == (1000, 10, 10005)
    assert (get(0x6085), get(0x6084), get(0x607F), get(0x6080)) == (30_000, 30_000, 3150, 3150)
    assert found.velocity_units == pytest.approx(60 / 4096)
    assert (found.stop_counts_s2, found.stop_s) == (pytest.approx(2_048_000.0), pytest.approx(0.1))
    assert get(0x6065) == 4000, "positions are counts all the same"


def test_a_homing_speed_below_the_smallest_unit_is_refused_with_the_object(tmp_path: Path) -> None:
    made = nodes("X", eds=epos(tmp_path), homing_slow_counts_s=20)
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): object 6099h:02: 20 counts/s are wanted"):
        again(rig(made, [BUS]), made)


def test_polarity_of_one_half_is_refused_before_anything_is_written() -> None:
    stepped = rig(nodes("X"), [BUS])
    stepped.drives["X"].dictionary.readers[key(0x607E)] = lambda: 0x80
    before = dict(stepped.drives["X"].dictionary.values)
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): object 607Eh is 80h"):
        again(stepped, nodes("X"))
    assert stepped.drives["X"].dictionary.values == before


# ---- makers' data sheets ----------------------------------------------------------


def of_family(name: str, **changes: object) -> list[NodeSettings]:
    """1e5 counts/s within a second, at 10 ms."""
    profile = drive_profiles.load(name)
    made = NodeSettings(
        "X",
        "can",
        1,
        sheet_of(name),
        following_error_counts=900,
        homing_method=profile.homing_methods[-1],
        period_s=0.01,
        profile=profile,
        velocity_counts_s=1e5,
        acceleration_counts_s2=1e6,
    )
    return [replace(made, **changes)]  # type: ignore[arg-type]


def family(name: str, **changes: object) -> tuple[Rig, list[commission.Outcome]]:
    """Commissioned twice."""
    made = of_family(name, **changes)
    stepped = rig(made, [BUS])
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    master = MasterSettings(period_s=0.01)
    return stepped, [commission.commission(network, made, master)[0] for _ in range(2)]


@pytest.mark.parametrize("name", SHEETS)
def test_a_familys_drive_is_arranged_once(name: str) -> None:
    _, (first, second) = family(name)
    assert second.changes == [] and second.arranged == first.arranged
    assert 0.0 < arranged(first).stop_s <= 3.0


def test_an_epos4_is_told_in_its_units_and_by_its_encoder() -> None:
    """Its sheet: 500 pulses, 2000 counts; 1/min are 33.3 counts/s."""
    stepped, (first, _) = family("maxon_epos4")
    get = stepped.drives["X"].dictionary.get
    assert (get(0x6085), get(0x607F), get(0x6080)) == (30_000, 3150, 3150)
    assert get(0x6066) == 0, "its sheet allows nothing else"
    assert arranged(first).stop_s == pytest.approx(0.1)
    assert (get(0x605B), get(0x605C), get(0x605E)) == (1, 1, 2)


def test_a_technosoft_is_told_in_65536ths_of_a_count_per_loop() -> None:
    stepped, (first, _) = family("technosoft_ipos", homing_fast_counts_s=1000)
    get = stepped.drives["X"].dictionary.get
    assert (get(0x6085), get(0x6099, 1)) == (65_536, 65_536)
    assert arranged(first).stop_s == pytest.approx(0.1)


def test_a_simpliq_is_told_in_counts() -> None:
    stepped, (first, _) = family("elmo")
    assert stepped.drives["X"].dictionary.get(0x6085) == 1_000_000
    assert arranged(first).stop_s == pytest.approx(0.1)


def test_a_joint_that_cannot_be_told_is_promised_the_longest_stop() -> None:
    _, (first, _) = family("pilz_prbt")
    assert arranged(first).stop_s == 3.0
    assert any("measure it" in english(note) for note in arranged(first).notes)
    assert GENERIC.quick_stop_code == 2
