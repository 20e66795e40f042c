"""Commissioning on the stepped bus: no thread, no wall clock; every mismatch is a sentence."""

from __future__ import annotations

from dataclasses import replace

import pytest
from stepped_drives import Bench, nodes

from drives import commission, pdo
from drives.cia402 import State, Wanted
from drives.commission import CommissionError
from drives.drive import Drive
from drives.group import DriveFault, Group
from drives.settings import BusSettings, MasterSettings
from drives.simulated import Parameters, rig
from drives.simulated.dictionary import Abort, Code, key

BUSES = [BusSettings("can", "virtual", "", 1_000_000)]


def test_after_commissioning_every_drive_is_operational_and_set() -> None:
    bench = Bench("XYZAC", counts_min=-5, counts_max=5000, following_error_counts=777)
    for drive in bench.rig.drives.values():
        get = drive.dictionary.get
        assert drive.nmt == pdo.NMT_OPERATIONAL
        assert drive.axis.mode == 8
        assert (get(0x60C2, 1), get(0x60C2, 2)) == (2, -3)
        assert get(0x1016, 1) == 127 << 16 | 200
        assert get(0x1017) == 50
        assert (get(0x6007), get(0x605A), get(0x6065)) == (3, 2, 777)
        assert (get(0x607D, 1), get(0x607D, 2)) == (-5, 5000)


def test_commissioning_again_changes_nothing() -> None:
    bench = Bench("XY")
    before = [dict(drive.dictionary.values) for drive in bench.rig.drives.values()]
    commission.commission(bench.network, bench.nodes, MasterSettings())
    assert [drive.dictionary.values for drive in bench.rig.drives.values()] == before


def test_a_missing_drive_is_named_with_what_to_look_for() -> None:
    made = nodes("XY")
    stepped = rig(made[:1], BUSES)
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    with pytest.raises(CommissionError, match=r"drive Y \(node 2\): no answer .* check power"):
        commission.commission(network, made, MasterSettings())


def test_another_product_than_the_data_sheets_is_refused() -> None:
    made = nodes("X")
    stepped = rig(made, BUSES)
    stepped.drives["X"].dictionary.values[key(0x1018, 2)] = 0x999
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    with pytest.raises(CommissionError, match=r"product code .* is 0x999"):
        commission.commission(network, made, MasterSettings())


def test_a_setting_that_does_not_stick_is_found_by_reading_back() -> None:
    made = nodes("X")
    stepped = rig(made, BUSES)
    stepped.drives["X"].dictionary.readers[key(0x605A)] = lambda: 6
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    with pytest.raises(CommissionError, match="605Ah:00 was set to 2 but reads 6"):
        commission.commission(network, made, MasterSettings())


def test_a_refused_period_is_a_sentence_with_the_drives_reason() -> None:
    def milliseconds_only(exponent: int) -> None:
        if exponent != -3:
            raise Abort(Code.VALUE)

    made = nodes("X", period_s=0.0005)
    stepped = rig(made, BUSES)
    stepped.drives["X"].dictionary.writers[key(0x60C2, 2)] = milliseconds_only
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    with pytest.raises(CommissionError, match=r"60C2h:02 refuses -4: .*0x06090030.*tick of 0.5 ms"):
        commission.commission(network, made, MasterSettings())


@pytest.mark.parametrize(
    ("period_s", "told"), [(0.002, (2, -3)), (0.01, (10, -3)), (0.0005, (5, -4)), (0.00125, (125, -5))]
)
def test_a_period_is_told_in_the_coarsest_exact_unit(period_s: float, told: tuple[int, int]) -> None:
    assert commission.interpolation_time(period_s) == told


def test_a_period_that_cannot_be_told_is_refused() -> None:
    with pytest.raises(CommissionError, match="60C2h"):
        commission.interpolation_time(0.0012345678)


def test_a_mode_the_drive_does_not_know_is_refused() -> None:
    bench = Bench()
    with pytest.raises(CommissionError, match="6060h:00 refuses 4"):
        commission.set_mode(bench.network, bench.nodes[0], 4)


def test_two_buses_are_commissioned_one_by_one() -> None:
    made = nodes("XY")
    made[1] = replace(made[1], bus="other")
    stepped = rig(made, [*BUSES, BusSettings("other", "virtual", "", 0)])
    for node in made:
        port = stepped.port(pdo.SERVICE_FILTERS, bus=node.bus)
        commission.commission(
            commission.Network(port, commission.stepped_pump(stepped)), [node], MasterSettings()
        )
    assert all(drive.nmt == pdo.NMT_OPERATIONAL for drive in stepped.drives.values())


def test_the_controllers_group_enables_and_moves_commissioned_drives() -> None:
    bench = Bench("XYZAC", parameters=Parameters(position_counts=4321))
    group = Group([Drive(node) for node in bench.nodes], {"can": bench.port}, MasterSettings())
    group.want(Wanted.ENABLED)
    start_s, target = bench.rig.now_s, 4321
    for k in range(1, 301):
        now_s = start_s + k * 0.002
        bench.rig.advance(now_s)
        group.receive(now_s)
        group.sync(now_s)
        if all(drive.following for drive in group.drives):
            target += 100
        group.command([target] * 5, now_s)
        assert group.fault(now_s)[0] is DriveFault.NONE
    assert all(drive.state is State.OPERATION_ENABLED for drive in group.drives)
    assert target > 20_000
    assert all(0 < target - position < 1000 for position in group.positions)
