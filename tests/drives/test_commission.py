"""Commissioning on the stepped bus: no thread, no wall clock; every mismatch is a sentence."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.drives import group_bench
from support.drives.group_bench import GroupBench, inputs_and_outputs
from support.drives.stepped_drives import Bench, nodes

from drives import commission, pdo
from drives.bench.simulated import Parameters, rig
from drives.bench.simulated.dictionary import Abort, Code, key
from drives.cia402 import State, Wanted
from drives.commission import CommissionError
from drives.cyclic.drive import Drive
from drives.cyclic.group import DriveFault, Group
from drives.profile import GENERIC, CyclicMode, Supervision, Write
from drives.settings import BusSettings, MasterSettings

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
    assert commission.interpolation_time(0.0012345678) is None
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): .* 1.23457 ms .*60C2h.* change period_s"):
        Bench(period_s=0.0012345678)


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


# ---- what else is told -------------------------------------------------------------


def test_a_second_run_writes_nothing() -> None:
    bench = Bench("XYZAC", feed_forward=True)
    downloads: list[int] = []
    listener = bench.rig.port()
    outcomes = commission.commission(bench.network, bench.nodes, MasterSettings())
    buffer = bytearray(16)
    while listener.receive_into(buffer):
        can_id, data = pdo.unpack(buffer)
        if 0x600 < can_id < 0x680 and data[0] & 0xE0 == 0x20:
            downloads.append(can_id)
    assert downloads == []
    assert all(not outcome.changes and outcome.already_so > 30 for outcome in outcomes)


def test_one_wrong_object_is_all_that_is_written_again() -> None:
    bench = Bench("XY")
    bench.rig.drives["Y"].dictionary.values[key(0x605A)] = 6
    x, y = commission.commission(bench.network, bench.nodes, MasterSettings())
    assert x.changes == []
    assert [(c.index, c.sub, c.was, c.now) for c in y.changes] == [(0x605A, 0, 6, 2)]


def test_a_mapping_that_is_not_so_is_written_in_the_standards_order() -> None:
    bench = Bench("X")
    bench.rig.drives["X"].dictionary.values[key(0x1600, 2)] = 0x60FF_0020
    listener = bench.rig.port()
    commission.commission(bench.network, bench.nodes, MasterSettings())
    buffer, written = bytearray(16), []
    while listener.receive_into(buffer):
        can_id, data = pdo.unpack(buffer)
        if can_id == 0x601 and data[0] & 0xE0 == 0x20:
            written.append((int.from_bytes(data[1:3], "little"), data[3], int.from_bytes(data[4:], "little")))
    assert written == [
        (0x1400, 1, 0x8000_0201),
        (0x1400, 2, 1),
        (0x1400, 5, 200),
        (0x1600, 0, 0),
        (0x1600, 1, 0x6040_0010),
        (0x1600, 2, 0x607A_0020),
        (0x1600, 0, 2),
        (0x1400, 1, 0x201),
    ]


def test_five_drives_take_less_than_two_seconds_of_bus_time() -> None:
    made = nodes("XYZAC")
    stepped = rig(made, BUSES)
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    commission.commission(network, made, MasterSettings(), store=True)
    assert stepped.now_s < 2.0


def test_drives_that_were_told_to_store_come_back_commissioned() -> None:
    bench = Bench("X")
    drive = bench.drive
    first = commission.commission(bench.network, bench.nodes, MasterSettings(), store=True)
    assert not first[0].stored, "nothing was changed, so nothing is worn out by storing"
    drive.dictionary.values[key(0x605A)] = 6
    assert commission.commission(bench.network, bench.nodes, MasterSettings(), store=True)[0].stored
    drive.power_cycle(bench.rig.now_s)
    bench.rig.advance(bench.rig.now_s + 0.5)
    (outcome,) = commission.commission(bench.network, bench.nodes, MasterSettings())
    assert [change.index for change in outcome.changes] == [0x6060], "the mode alone is not stored"


def test_with_feed_forward_the_controlword_has_a_pdo_of_its_own() -> None:
    get = Bench("X", feed_forward=True).drive.dictionary.get
    assert [get(0x1600, sub) for sub in range(3)] == [2, 0x607A_0020, 0x60B1_0020]
    assert [get(0x1601, sub) for sub in range(2)] == [1, 0x6040_0010]
    assert (get(0x1400, 2), get(0x1401, 2), get(0x1401, 1)) == (1, 255, 0x301)


def test_pdos_have_the_numbers_of_the_profile_and_all_others_are_off() -> None:
    profile = replace(GENERIC, rpdo=3, tpdo=4)
    get = Bench("X", profile=profile, feedback_every=4).drive.dictionary.get
    assert [get(0x1602, sub) for sub in range(3)] == [2, 0x6040_0010, 0x607A_0020]
    assert [get(0x1A03, sub) for sub in range(3)] == [2, 0x6041_0010, 0x6064_0020]
    assert (get(0x1402, 1), get(0x1803, 1), get(0x1803, 2)) == (0x401, 0x481, 4)
    assert [get(0x1A00, sub) for sub in range(2)] == [1, 0x6061_0008], "the mode, by the first that is free"
    off = [get(0x1400 + n, 1) for n in (0, 1, 3)] + [get(0x1800 + n, 1) for n in (1, 2)]
    assert all(can_id & 0x8000_0000 for can_id in off)


def test_interpolated_position_maps_its_data_record_and_is_the_mode() -> None:
    profile = replace(GENERIC, mode=CyclicMode.IP, takes_feed_forward=False)
    drive = Bench("X", profile=profile).drive
    get = drive.dictionary.get
    assert [get(0x1600, sub) for sub in range(3)] == [2, 0x6040_0010, 0x60C1_0120]
    assert (drive.axis.mode, get(0x60C0)) == (7, 0)


def test_a_guarded_drive_has_guard_time_and_life_time_and_no_heartbeat() -> None:
    profile = replace(GENERIC, supervision=Supervision.GUARDING)
    drive = Bench("X", profile=profile).drive
    get = drive.dictionary.get
    assert (get(0x100C), get(0x100D), get(0x1017)) == (50, 4, 0)
    assert drive.nmt == pdo.NMT_OPERATIONAL


def test_a_heartbeat_drive_is_not_guarded_as_well() -> None:
    bench = Bench("X")
    bench.drive.dictionary.values[key(0x100C)] = 100
    commission.commission(bench.network, bench.nodes, MasterSettings())
    assert bench.drive.dictionary.get(0x100C) == 0


def test_a_drive_without_any_supervision_needs_the_operators_word() -> None:
    profile = replace(GENERIC, supervision=Supervision.NONE)
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): .*dead controller.* unsupervised = true"):
        Bench("X", profile=profile)
    Bench("X", profile=profile, unsupervised=True)


def test_what_a_profile_writes_beyond_is_written_with_its_reason() -> None:
    profile = replace(GENERIC, writes=(Write(0x6085, 0, 4711, "a quick stop must be short"),))
    bench = Bench("X", profile=profile)
    assert bench.drive.dictionary.get(0x6085) == 4711
    bench.drive.dictionary.readers[key(0x6085)] = lambda: 5
    with pytest.raises(
        CommissionError, match=r"6085h:00 was set to 4711 .* reads 5; a quick stop must be short"
    ):
        commission.commission(bench.network, bench.nodes, MasterSettings())


def test_homing_speeds_and_acceleration_of_the_machine_file_are_written() -> None:
    get = Bench(
        "X", homing_fast_counts_s=5000, homing_slow_counts_s=300, homing_acceleration_counts_s2=7000
    ).drive.dictionary.get
    assert (get(0x6099, 1), get(0x6099, 2), get(0x609A)) == (5000, 300, 7000)


def test_a_homing_method_that_the_family_does_not_have_is_refused() -> None:
    profile = replace(GENERIC, homing_methods=(35, 37))
    with pytest.raises(CommissionError, match=r"homing method 18 \(object 6098h\) .* allowed are 35, 37"):
        Bench("X", profile=profile, homing_method=18)
    Bench("X", profile=profile, homing_method=18, absolute=True)


def test_too_large_a_following_error_window_is_refused() -> None:
    with pytest.raises(CommissionError, match=r"window of 5000 counts \(object 6065h\).* up to 4000"):
        Bench("X", profile=replace(GENERIC, most_following_error=4000), following_error_counts=5000)


def test_the_machine_files_serial_number_must_be_found() -> None:
    Bench("X", serial=1)
    with pytest.raises(CommissionError, match=r"serial number \(object 1018h:04\) is 0x1, the machine file"):
        Bench("X", serial=77)


def test_an_enabled_drive_is_not_reconfigured() -> None:
    bench = Bench("X")
    bench.drive.dictionary.readers[key(0x6041)] = lambda: 0x0637
    with pytest.raises(CommissionError, match=r"6041h shows that it is enabled.*another controller"):
        commission.commission(bench.network, bench.nodes, MasterSettings())


def test_a_drive_in_motion_is_not_taken_out_of_operation_by_the_attempt() -> None:
    bench = Bench("X")
    bench.enable()
    listener = bench.rig.port()
    bench.network.patience_s = 0.05  # less than the drive waits for its master's heartbeat
    with pytest.raises(CommissionError, match="is enabled"):
        commission.commission(bench.network, bench.nodes, MasterSettings())
    buffer, told = bytearray(16), []
    while listener.receive_into(buffer):
        told.append(pdo.unpack(buffer)[0])
    assert pdo.NMT not in told


def test_a_stopped_drive_is_deaf_to_sdo_and_is_woken() -> None:
    bench = Bench("X")
    bench.network.send_message(pdo.NMT, bytes([2, 1]))
    bench.wait()
    assert bench.drive.nmt == pdo.NMT_STOPPED
    commission.commission(bench.network, bench.nodes, MasterSettings())
    assert bench.drive.nmt == pdo.NMT_OPERATIONAL


def test_a_missing_data_sheet_is_a_sentence() -> None:
    made = nodes("X")
    stepped = rig(made, BUSES)
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): its data sheet gone.eds cannot be read"):
        commission.commission(network, [replace(made[0], eds="gone.eds")], MasterSettings())


# ---- spindle, inputs and outputs ---------------------------------------------------


def test_spindle_and_io_node_are_commissioned_beside_the_axes() -> None:
    bench = GroupBench(group_bench.nodes("X"), spindle=group_bench.spindle(), io=[inputs_and_outputs()])
    spindle, io = bench.rig.spindle, bench.rig.io["panel"]
    get = spindle.dictionary.get
    assert [get(0x1600, sub) for sub in range(3)] == [2, 0x6040_0010, 0x60FF_0020]
    assert [get(0x1A00, sub) for sub in range(3)] == [2, 0x6041_0010, 0x606C_0020]
    assert (get(0x1400, 2), get(0x1800, 2), spindle.axis.mode) == (255, 10, 9)
    get = io.dictionary.get
    assert [get(0x1600, sub) for sub in range(2)] == [1, 0x6200_0108]
    assert [get(0x1A00, sub) for sub in range(2)] == [1, 0x6000_0108]
    assert (get(0x1400, 2), get(0x1800, 2), get(0x1800, 5)) == (255, 255, 50)
    assert get(0x1016, 1) == 127 << 16 | 200
    assert io.nmt == pdo.NMT_OPERATIONAL


def test_a_drive_in_the_io_nodes_place_is_refused() -> None:
    made = nodes("X")
    stepped = rig(made, BUSES)
    network = commission.Network(stepped.port(pdo.SERVICE_FILTERS), commission.stepped_pump(stepped))
    with pytest.raises(CommissionError, match=r"drive panel \(node 1\): .*device profile 402, needed is 401"):
        commission.commission(network, [inputs_and_outputs(node=1)], MasterSettings())
