"""Where a data sheet is wrong: overridden by name it is tried on the drive, and told once."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from support.drives.group_bench import GroupBench

from controller.machine import drive_profiles
from drives import commission, pdo
from drives.bench.simulated import SimulatedDrive, families, family_sheet
from drives.bench.simulated.dictionary import Abort, Code, key
from drives.bench.simulated.io_node import IoNode
from drives.bench.virtual.virtual_bus import SteppedBus
from drives.commission import CommissionError
from drives.commissioning import possible, sheet
from drives.cyclic.drive_fault import DriveFault
from drives.profile import GENERIC, Override, Supervision
from drives.settings import IoSettings, MasterSettings, NodeSettings, SpindleSettings
from drives.texts import english

ROOT = Path(__file__).parents[2]
EDS, IO_EDS = ROOT / "config" / "eds" / "simulated_drive.eds", ROOT / "config" / "eds" / "simulated_io.eds"
MASTER = MasterSettings()
REASON = "node << 16 | ms does not fit"
WIDER = Override(0x1016, 1, REASON, high=0xFFFF_FFFF)


def edited(text: str, section: str, **changes: str | None) -> str:
    """A sheet's text with keys of a section replaced, added, or (None) the whole section away."""
    parts = re.split(r"(?m)^(?=\[)", text)
    made = []
    for part in parts:
        if part.startswith(f"[{section}]"):
            if None in changes.values():
                continue
            lines = [line for line in part.splitlines() if line.partition("=")[0] not in changes]
            part = "\n".join([*lines[:1], *(f"{k}={v}" for k, v in changes.items()), *lines[1:], "", ""])
        made.append(part)

    return "".join(made)


def slipped(folder: Path, section: str = "1016sub1", source: Path = EDS, **changes: str | None) -> Path:
    """The simulated drive's sheet with a slip, as a file."""
    path = folder / "slipped.eds"
    path.write_text(edited(source.read_text("latin-1"), section, **changes), "latin-1")
    return path


def commissioned(
    device: SimulatedDrive | IoNode, settings: commission.Settings
) -> tuple[commission.Outcome, SteppedBus]:
    bus = SteppedBus()
    bus.attach(device)
    network = commission.Network(bus.port(pdo.SERVICE_FILTERS), commission.stepped_pump(bus))
    (outcome,) = commission.commission(network, [settings], MASTER)
    return outcome, bus


def node(eds: Path, **changes: object) -> NodeSettings:
    return NodeSettings("X", "can", 1, str(eds), **changes)  # type: ignore[arg-type]


# ---- overrides ----------------------------------------------------------------------


def test_a_range_that_the_drive_contradicts_is_refused_from_paper_and_named_with_the_way_out(
    tmp_path: Path,
) -> None:
    eds = slipped(tmp_path, HighLimit="65535")
    with pytest.raises(
        CommissionError, match=r"1016h:01: 0x7f00c8 is needed .* allows 0x0 to 0xffff; .*overr"
    ):
        commissioned(SimulatedDrive(1), node(eds))


def test_overridden_it_is_tried_on_the_drive_and_told_once(tmp_path: Path) -> None:
    eds = slipped(tmp_path, HighLimit="65535")
    drive = SimulatedDrive(1)
    outcome, _ = commissioned(drive, node(eds, overrides=(WIDER,)))
    assert drive.dictionary.get(0x1016, 1) == 127 << 16 | 200
    (told,) = map(english, outcome.warnings)
    for word in ("1016h:01", "slipped.eds", "65535", "4294967295", REASON):
        assert word in told


def test_what_the_drive_refuses_all_the_same_is_a_sentence(tmp_path: Path) -> None:
    eds = slipped(tmp_path, HighLimit="65535")
    with pytest.raises(CommissionError, match=r"1016h:01 refuses .*0x06090031"):
        commissioned(SimulatedDrive(1, eds=eds), node(eds, overrides=(WIDER,)))


def test_the_profile_may_say_it_for_its_family(tmp_path: Path) -> None:
    eds = slipped(tmp_path, HighLimit="65535")
    outcome, _ = commissioned(SimulatedDrive(1), node(eds, profile=replace(GENERIC, overrides=(WIDER,))))
    assert len(outcome.warnings) == 1


@pytest.mark.parametrize(
    ("section", "changes", "known"),
    [
        ("605A", {"AccessType": "ro", "DefaultValue": "6"}, Override(0x605A, 0, "so", access="rw")),
        ("605A", {"LowLimit": "3", "HighLimit": "6"}, Override(0x605A, 0, "so", low=0)),
        ("607A", {"PDOMapping": "0"}, Override(0x607A, 0, "so", mappable=True)),
        ("607A", {"DataType": "0x0003"}, Override(0x607A, 0, "so", data_type=0x04)),
        ("6502", {"DefaultValue": "0x1"}, Override(0x6502, 0, "so", default=0x3ED)),
        ("1000", {"DefaultValue": "0x191"}, Override(0x1000, 0, "so", default=0x20192)),
        ("6065", {"AccessType": None}, Override(0x6065, 0, "so", access="rw", data_type=0x07)),
        ("1018sub2", {"DefaultValue": "0x99"}, Override(0x1018, 2, "so", default=0x402)),
    ],
)
def test_every_word_that_a_sheet_may_have_wrong(
    section: str, changes: dict[str, str | None], known: Override, tmp_path: Path
) -> None:
    text = EDS.read_text("latin-1")
    if section == "1018sub2":
        text = edited(text, "DeviceInfo", ProductNumber="0x99")
    eds = tmp_path / "wrong.eds"
    eds.write_text(edited(text, section, **changes), "latin-1")
    with pytest.raises(CommissionError, match=known.index.to_bytes(2).hex().upper() + "h"):
        commissioned(SimulatedDrive(1), node(eds))
    outcome, _ = commissioned(SimulatedDrive(1), node(eds, overrides=(known,)))
    assert outcome.warnings and all(f"{known.index:04X}h" in english(told) for told in outcome.warnings)


def test_a_sheet_that_says_so_already_is_not_told_of() -> None:
    outcome, _ = commissioned(SimulatedDrive(1), node(EDS, overrides=(WIDER,)))
    assert outcome.warnings == []


def test_an_override_of_what_the_sheet_lacks_adds_nothing_without_a_type_and_says_so(tmp_path: Path) -> None:
    found = sheet.load(str(EDS), 1, (Override(0x2FFF, 3, "so", high=3),))
    assert not found.has(0x2FFF, 3)
    assert "does nothing; name its type" in english(found.overridden[0])
    found = sheet.load(str(EDS), 1, (Override(0x2FFF, 3, "so", access="rw", data_type=0x05),))
    assert found.writable(0x2FFF, 3)
    assert "taken for granted: so" in english(found.overridden[0])


def test_an_override_is_of_its_drive_alone(tmp_path: Path) -> None:
    eds = str(slipped(tmp_path, HighLimit="65535"))
    wider, plain = sheet.load(eds, 1, (WIDER,)), sheet.load(eds, 1)
    assert wider.find(0x1016, 1).max == 0xFFFF_FFFF  # type: ignore[union-attr]
    assert plain.find(0x1016, 1).max == 0xFFFF  # type: ignore[union-attr]


# ---- Elmo Gold, with the slip of its maker's sheet -----------------------------------------


def gold(folder: Path) -> Path:
    made = family_sheet.write(folder / "gold.eds", drive_profiles.load("elmo_gold"))
    made.write_text(edited(made.read_text("latin-1"), "1016sub1", HighLimit="65535"), "latin-1")
    return made


def test_the_gold_sheet_as_its_maker_ships_it_does_all_that_the_profile_needs(tmp_path: Path) -> None:
    family, found = drive_profiles.load("elmo_gold"), sheet.load(str(gold(tmp_path)), 1)
    assert possible.of_profile(family, found, MASTER)[0]
    found = sheet.load(str(gold(tmp_path)), 1, family.overrides)
    problems, remarks, _ = possible.of_profile(family, found, MASTER, 1_000_000)
    assert problems == []
    assert sum("1016h:01" in english(remark) for remark in remarks) == 1


def test_five_gold_drives_are_commissioned_enabled_and_moved(tmp_path: Path) -> None:
    family = drive_profiles.load("elmo_gold")
    one = node(gold(tmp_path), profile=family, feed_forward=True)
    bench = GroupBench([replace(one, name=name, node=n) for n, name in enumerate("XYZAC", 1)])
    assert all(drive.dictionary.get(0x1016, 1) == 127 << 16 | 200 for drive in bench.devices)
    bench.enable()
    bench.tick(100, step=10)
    bench.tick(50)
    assert bench.fault == (DriveFault.NONE, -1)
    assert [drive.position for drive in bench.group.drives] == bench.setpoints


# ---- unsupervised ---------------------------------------------------------------------------


UNSUPERVISED = [
    ("1016sub1", {"HighLimit": None}, Supervision.HEARTBEAT, "1016h"),
    ("1016sub1", {"HighLimit": "65535"}, Supervision.HEARTBEAT, "1016h"),
    ("1016sub1", {"AccessType": "ro", "DefaultValue": "0"}, Supervision.HEARTBEAT, "1016h"),
    ("6007", {"DataType": None}, Supervision.HEARTBEAT, "6007h"),
    ("6007", {"HighLimit": "2", "LowLimit": "0"}, Supervision.HEARTBEAT, "6007h"),
    ("100C", {"DataType": None}, Supervision.GUARDING, "100Ch"),
    ("100D", {"DataType": None}, Supervision.GUARDING, "100Dh"),
    ("100D", {"HighLimit": "1", "LowLimit": "0"}, Supervision.GUARDING, "100Dh"),
]


@pytest.mark.parametrize(("section", "changes", "supervision", "index"), UNSUPERVISED)
def test_whatever_recommends_unsupervised_is_accepted_with_it_and_warned_of_each_time(
    section: str, changes: dict[str, str | None], supervision: Supervision, index: str, tmp_path: Path
) -> None:
    eds = slipped(tmp_path, section, **changes)
    settings = node(eds, profile=replace(GENERIC, supervision=supervision))
    with pytest.raises(CommissionError, match=f"{index}.* unsupervised = true"):
        commissioned(SimulatedDrive(1, eds=eds), settings)
    accepted = replace(settings, unsupervised=True)
    bus = SteppedBus()
    bus.attach(SimulatedDrive(1, eds=eds))
    network = commission.Network(bus.port(pdo.SERVICE_FILTERS), commission.stepped_pump(bus))
    for _ in range(2):
        (outcome,) = commission.commission(network, [accepted], MASTER)
        assert any(
            re.search(f"{index}.*accepted with unsupervised = true", english(w)) for w in outcome.warnings
        )


@pytest.mark.parametrize(("section", "changes", "supervision", "index"), UNSUPERVISED)
def test_and_it_is_enabled_and_moves(
    section: str, changes: dict[str, str | None], supervision: Supervision, index: str, tmp_path: Path
) -> None:
    eds = slipped(tmp_path, section, **changes)
    profile = replace(GENERIC, supervision=supervision)
    bench = GroupBench([node(eds, profile=profile, unsupervised=True)])
    bench.enable()
    bench.tick(100, step=10)
    bench.tick(50)
    assert bench.fault == (DriveFault.NONE, -1), index
    assert bench.group.drives[0].position == bench.setpoints[0]


def test_a_drive_that_refuses_its_supervision_on_the_bus_is_accepted_too() -> None:
    drive = SimulatedDrive(1)

    def refuses(_: int) -> None:
        raise Abort(Code.VALUE)

    drive.dictionary.writers[key(0x1016, 1)] = refuses
    outcome, _ = commissioned(drive, node(EDS, unsupervised=True))
    (told,) = map(english, outcome.warnings)
    assert re.search("1016h:01 refuses .*0x06090030.*accepted with unsupervised = true", told)


def test_one_that_is_supervised_after_all_is_not_warned_of() -> None:
    outcome, _ = commissioned(SimulatedDrive(1), node(EDS, unsupervised=True))
    assert outcome.warnings == []


def test_a_drive_that_is_gone_is_not_unsupervised_but_missing() -> None:
    bus = SteppedBus()
    network = commission.Network(bus.port(pdo.SERVICE_FILTERS), commission.stepped_pump(bus))
    with pytest.raises(CommissionError, match="no answer"):
        commission.commission(network, [node(EDS, unsupervised=True)], MASTER)


def test_a_spindle_may_be_unsupervised() -> None:
    profile = replace(GENERIC, supervision=Supervision.NONE)
    settings = SpindleSettings("S", "can", 10, str(EDS), 4000.0, profile=profile)
    drive = families.restrict(SimulatedDrive(10), profile)
    with pytest.raises(CommissionError, match="unsupervised = true"):
        commissioned(drive, settings)
    drive = families.restrict(SimulatedDrive(10), profile)
    outcome, _ = commissioned(drive, replace(settings, unsupervised=True))
    assert any("accepted with unsupervised = true" in english(told) for told in outcome.warnings)


def test_an_io_node_without_heartbeat_consumer_may_be_unsupervised(tmp_path: Path) -> None:
    eds = slipped(tmp_path, "1016sub1", IO_EDS, DataType=None)
    settings = IoSettings("io", "can", 20, str(eds))
    with pytest.raises(CommissionError, match=r"1016h.*unsupervised = true"):
        commissioned(IoNode(20, eds=eds), settings)
    outcome, _ = commissioned(IoNode(20, eds=eds), replace(settings, unsupervised=True))
    assert "1016h" in english(outcome.warnings[0])


# ---- who the sheet says the drive is ------------------------------------------------------


def test_a_sheet_that_contradicts_itself_about_the_vendor_is_told_once_with_the_drives_word(
    tmp_path: Path,
) -> None:
    own = sheet.load(str(EDS), 1).identities(1)
    assert len(own) == 1
    eds = slipped(tmp_path, "DeviceInfo", VendorNumber="0x123")
    outcome, _ = commissioned(SimulatedDrive(1), node(eds))
    (told,) = map(english, outcome.warnings)
    for word in (
        "1018h:01",
        "vendor",
        "0x123 in its head",
        f"{own[0]:#x} in the object",
        f"says {own[0]:#x}",
    ):
        assert word in told, told


def test_a_drive_that_is_neither_is_refused(tmp_path: Path) -> None:
    eds = slipped(tmp_path, "DeviceInfo", ProductNumber="0x123")
    drive = SimulatedDrive(1)
    drive.dictionary.values[key(0x1018, 2)] = 0x999
    with pytest.raises(CommissionError, match=r"product code .* is 0x999, .* says 0x123 or 0x402"):
        commissioned(drive, node(eds))
