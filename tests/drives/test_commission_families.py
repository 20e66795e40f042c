"""Every shipped family's drive, simulated by its maker's data sheet, takes its commissioning whole."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from support.drives.group_bench import GroupBench
from support.drives.makers_sheets import SHEETS, sheet_of

from controller.machine import drive_profiles
from drives import commission, pdo
from drives.bench.simulated import Rig, rig
from drives.commissioning import possible, sheet
from drives.cyclic.drive_fault import DriveFault
from drives.profile import Supervision
from drives.settings import BusSettings, MasterSettings, NodeSettings
from drives.texts import english

BUS = BusSettings("can", "virtual", "", 1_000_000)
MASTER = MasterSettings(period_s=0.01)


def five(name: str, **changes: object) -> list[NodeSettings]:
    profile = drive_profiles.load(name)
    node = NodeSettings(
        "",
        "can",
        1,
        sheet_of(name),
        counts_min=-1000,
        counts_max=5000,
        following_error_counts=900,
        homing_method=profile.homing_methods[-1],
        period_s=MASTER.period_s,
        profile=profile,
    )
    return [replace(node, name=axis, node=n, **changes) for n, axis in enumerate("XYZAC", 1)]  # type: ignore[arg-type]


def bench(nodes: list[NodeSettings]) -> tuple[Rig, commission.Network]:
    made = rig(nodes, [BUS])
    return made, commission.Network(made.port(pdo.SERVICE_FILTERS), commission.stepped_pump(made))


@pytest.mark.parametrize("name", SHEETS)
def test_a_family_has_all_that_its_profile_needs(name: str) -> None:
    found, *_ = possible.of_profile(
        drive_profiles.load(name), sheet.load(sheet_of(name), 1), MASTER, 1_000_000
    )
    assert found == []


@pytest.mark.parametrize("name", SHEETS)
def test_five_drives_of_a_family_are_commissioned_within_two_seconds_and_once(name: str) -> None:
    nodes = five(name)
    made, network = bench(nodes)
    began_s = made.now_s
    first = commission.commission(network, nodes, MASTER, bit_rate=BUS.bit_rate)
    assert made.now_s - began_s < 2.0
    assert all(outcome.changes for outcome in first)
    assert all(drive.nmt == pdo.NMT_OPERATIONAL for drive in made.drives.values())
    assert all(drive.axis.mode == drive_profiles.load(name).mode.value for drive in made.drives.values())
    second = commission.commission(network, nodes, MASTER, bit_rate=BUS.bit_rate)
    assert [outcome.changes for outcome in second] == [[]] * 5


@pytest.mark.parametrize("name", SHEETS)
def test_setpoint_and_feedback_are_mapped_where_the_profile_says(name: str) -> None:
    nodes = five(name)
    made, network = bench(nodes)
    commission.commission(network, nodes, MASTER)
    profile, get = nodes[0].profile, made.drives["X"].dictionary.get
    target = 0x607A_0020 if profile.mode.value == 8 else 0x60C1_0120
    mapping = 0x1600 + profile.rpdo - 1
    assert [get(mapping, sub) for sub in range(3)] == [2, 0x6040_0010, target]
    mapping = 0x1A00 + profile.tpdo - 1
    assert [get(mapping, sub) for sub in range(3)] == [2, 0x6041_0010, 0x6064_0020]
    assert get(0x1400 + profile.rpdo - 1, 2) == 1
    assert (get(0x60C2, 1), get(0x60C2, 2)) == (10, -3)


@pytest.mark.parametrize("name", SHEETS)
def test_a_drive_notices_a_dead_controller_in_the_way_it_can(name: str) -> None:
    nodes = five(name)
    made, network = bench(nodes)
    commission.commission(network, nodes, MASTER)
    get, has = made.drives["X"].dictionary.get, made.drives["X"].dictionary.has
    if nodes[0].profile.supervision is Supervision.GUARDING:
        assert get(0x100C) * get(0x100D) == 200
        assert get(0x1017) == 0
    else:
        assert get(0x1016, 1) == 127 << 16 | 200
        assert get(0x1017) == 50
        assert not has(0x100C) or get(0x100C) == 0


@pytest.mark.parametrize(
    ("name", "period_s", "why"),
    [
        ("maxon_epos4", 0.0005, r"0\.5 ms cannot .*60C2h.* multiples of 1 ms from 1 to 100 ms"),
        ("maxon_epos4", 0.0015, r"1\.5 ms cannot"),
        ("technosoft_ipos", 0.05, r"50 ms cannot .* from 1 to 20 ms"),
        ("pilz_prbt", 0.0005, r"0\.5 ms cannot"),
        ("elmo", 0.0005, r"0\.5 ms cannot"),
    ],
)
def test_a_period_that_a_family_cannot_do_is_refused_before_a_frame_is_sent(
    name: str, period_s: float, why: str
) -> None:
    nodes = five(name, period_s=period_s)
    made, network = bench(nodes)
    heard = made.port()
    with pytest.raises(commission.CommissionError, match=rf"drive X \(node 1\): .*{why}"):
        commission.commission(network, nodes, replace(MASTER, period_s=period_s))
    made.advance(made.now_s + 0.1)
    buffer = bytearray(16)
    asked = []
    while heard.receive_into(buffer):
        asked.append(pdo.unpack(buffer)[0])
    assert all(can_id > pdo.HEARTBEAT for can_id in asked), "boot-up messages only"


@pytest.mark.parametrize(
    ("name", "changes", "why"),
    [
        ("technosoft_ipos", {"feed_forward": True}, "60B1h.* feed_forward = false"),
        ("elmo", {"feed_forward": True}, "60B1h"),
        ("maxon_epos4", {"homing_method": 35}, r"homing method 35 \(object 6098h\) .* allowed are -4, -3"),
        ("elmo", {"bit": 250_000}, "250 kbit/s is none of its bit rates; allowed are 500, 1000"),
        ("pilz_prbt", {"probe_tpdo": 2}, "object 60B9h:00 is not in"),
        ("maxon_epos4", {"probe_tpdo": 1}, "TPDO 1 carries the feedback already"),
        (
            "maxon_epos4",
            {"temperature_tpdo": 1, "temperature_entry": 0x2035_0010},
            "TPDO 1 carries something else already",
        ),
        (
            "elmo",
            {"temperature_tpdo": 4, "temperature_entry": 0x2EEE_0010},
            "object 2EEEh:00 is not in",
        ),
    ],
)
def test_what_a_family_cannot_do_is_refused_with_the_reason(
    name: str, changes: dict[str, object], why: str
) -> None:
    changes = dict(changes)
    bit_rate = int(str(changes.pop("bit", 1_000_000)))
    nodes = five(name, **changes)
    _, network = bench(nodes)
    with pytest.raises(commission.CommissionError, match=rf"drive X \(node 1\): .*{why}"):
        commission.commission(network, nodes, MASTER, bit_rate=bit_rate)


@pytest.mark.parametrize(
    ("sheet_name", "name", "why"),
    [
        ("technosoft_ipos", "generic", "object 1016h:01 is not in"),
        ("technosoft_ipos", "generic", "6502h.* without mode of operation 8"),
        ("pilz_prbt", "generic", "object 6007h:00 is not in"),
        ("pilz_prbt", "generic", "6098h:00.* read only"),
        ("maxon_epos4", "generic", "607Ch:00 is not in"),
        ("maxon_epos4", "technosoft_ipos", "100Ch:00 is not in"),
        ("maxon_epos4", "technosoft_ipos", "60C1h:01 is not in"),
        ("maxon_epos4", "technosoft_ipos", "1018h:01.* 0xfb, profile technosoft_ipos is for 0x1a3"),
        ("elmo", "maxon_epos4", "30B0h:00 is not in"),
    ],
)
def test_a_profile_of_another_family_is_found_out_object_by_object(
    sheet_name: str, name: str, why: str
) -> None:
    found, *_ = possible.of_profile(drive_profiles.load(name), sheet.load(sheet_of(sheet_name), 1), MASTER)
    assert any(re.search(why, english(sentence)) for sentence in found), found


@pytest.mark.parametrize(
    ("name", "feed_forward"), [*((name, False) for name in SHEETS), ("maxon_epos4", True)]
)
def test_five_drives_of_a_family_are_enabled_and_moved_by_the_group(name: str, feed_forward: bool) -> None:
    """Its mode, its PDOs, its supervision: whatever commissioning chose is what the cyclic side speaks."""
    bench = GroupBench(five(name, feed_forward=feed_forward))
    bench.enable()
    for _ in range(100):
        bench.setpoints = [setpoint + 10 for setpoint in bench.setpoints]
        bench.tick()
    bench.tick(50)
    assert bench.fault == (DriveFault.NONE, -1)
    assert bench.group.following()
    assert [drive.position for drive in bench.group.drives] == [1000] * 5
