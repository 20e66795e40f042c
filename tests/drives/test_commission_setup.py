"""A drive's set-up as a DCF: kept, compared, put back; read again by canopen and by a plain parser."""

from __future__ import annotations

import configparser
from dataclasses import replace
from pathlib import Path

import canopen
import pytest
from support.drives.makers_sheets import SHEETS, sheet_of
from support.drives.stepped_drives import Bench, nodes

from controller.machine import drive_profiles
from drives import commission, pdo
from drives.bench.simulated import Rig, rig
from drives.bench.simulated.dictionary import Abort, Code, key
from drives.commission import CommissionError
from drives.commissioning import dcf, setup, sheet
from drives.profile import Profile
from drives.settings import BusSettings, MasterSettings, NodeSettings
from drives.texts import english

BUSES = [BusSettings("can", "virtual", "", 1_000_000)]


class Shop:
    """Drives on a stepped bus; each may be kept in a file, and another put in its place."""

    def __init__(self, made: list[NodeSettings]) -> None:
        self.rig: Rig = rig(made, BUSES)
        self.rig.advance(0.5)
        self.network = commission.Network(
            self.rig.port(pdo.SERVICE_FILTERS), commission.stepped_pump(self.rig)
        )
        self.settings = {node.name: node for node in made}

    def drive(self, name: str) -> commission.Drive:
        return commission.Drive(self.network, self.settings[name])

    def save(self, name: str, path: Path) -> dict[dcf.Place, dcf.Value]:
        node = self.settings[name]
        values, failed = setup.read(self.drive(name))
        integers = [
            row for row in failed if "data size" not in english(row.refused)
        ]  # it simulates no floats
        assert integers == []
        about = sheet.own(node.eds, node.node)
        path.write_text(dcf.written(about, node.node, 1_000_000, values, path.name), "latin-1")
        return values

    def set(self, name: str, index: int, sub: int, value: int) -> None:
        self.rig.drives[name].dictionary.values[key(index, sub)] = value

    def get(self, name: str, index: int, sub: int = 0) -> int:
        return self.rig.drives[name].dictionary.get(index, sub)


@pytest.fixture
def kept(tmp_path: Path) -> tuple[Path, dict[dcf.Place, dcf.Value]]:
    """A commissioned drive's set-up, with some values of somebody's tuning."""
    shop = Shop(nodes("XY"))
    made = [replace(node, following_error_counts=777, counts_min=-5) for node in nodes("XY")]
    commission.commission(shop.network, made, MasterSettings())
    shop.drive("X").put(0x6085, 0, 123_456)
    return tmp_path / "x.dcf", shop.save("X", tmp_path / "x.dcf")


def test_canopen_reads_back_what_was_kept(kept: tuple[Path, dict[dcf.Place, dcf.Value]]) -> None:
    path, values = kept
    read = canopen.import_od(str(path))
    assert (read.node_id, read.bitrate) == (1, 1_000_000)
    assert len(values) > 60
    for (index, sub), value in values.items():
        entry = read[index] if sub == 0 and not hasattr(read[index], "subindices") else read[index][sub]
        assert entry.value == value, (hex(index), sub)


def test_so_does_a_plain_parser(kept: tuple[Path, dict[dcf.Place, dcf.Value]]) -> None:
    """CiA 306: [DeviceComissioning], and ParameterValue in the section of the entry."""
    path, values = kept
    parser = configparser.ConfigParser(interpolation=None)
    parser.read(path, "latin-1")
    assert parser["DeviceComissioning"]["NodeID"] == "1"
    assert parser["DeviceComissioning"]["Baudrate"] == "1000"
    assert int(parser["6085"]["ParameterValue"], 0) == 123_456
    assert int(parser["607Dsub1"]["ParameterValue"], 0) == -5
    assert int(parser["1400sub1"]["ParameterValue"], 0) == 0x201
    told = [name for name in parser.sections() if "ParameterValue" in parser[name]]
    assert len(told) == len(values)
    listed = {
        int(word, 16)
        for name in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
        for number, word in parser[name].items()
        if number.isdigit()
    }
    assert {index for index, _ in values} <= listed


def test_commands_process_data_and_histories_are_left_out(
    kept: tuple[Path, dict[dcf.Place, dcf.Value]],
) -> None:
    _, values = kept
    for index in (0x1003, 0x1010, 0x1011, 0x1018, 0x6040, 0x6041, 0x6060, 0x6064, 0x607A, 0x60FF, 0x60B1):
        assert not any(place[0] == index for place in values), hex(index)
    for place in ((0x1016, 1), (0x1400, 1), (0x1A00, 1), (0x6065, 0), (0x607D, 2), (0x60C2, 1), (0x6098, 0)):
        assert place in values


def test_the_same_drive_does_not_differ(kept: tuple[Path, dict[dcf.Place, dcf.Value]]) -> None:
    shop = Shop(nodes("X"))
    found = dcf.read(kept[0])
    assert [row.place for row in setup.differences(shop.drive("X"), found)]
    setup.restore(shop.drive("X"), found)
    assert list(setup.differences(shop.drive("X"), found)) == []
    assert setup.restore(shop.drive("X"), found) == []


def test_a_replaced_drive_gets_its_predecessors_values(
    kept: tuple[Path, dict[dcf.Place, dcf.Value]],
) -> None:
    path, values = kept
    shop = Shop(nodes("X"))
    shop.network.send_message(0, bytes([0x80, 1]))
    rows = setup.restore(shop.drive("X"), dcf.read(path))
    assert rows and all(not row.refused for row in rows), [row for row in rows if row.refused]
    changed = {row.place for row in rows}
    assert {(0x6085, 0), (0x6065, 0), (0x607D, 1), (0x1400, 2), (0x1016, 1)} <= changed
    assert setup.read(shop.drive("X"))[0] == values


def test_process_data_is_put_back_in_the_standards_order(
    kept: tuple[Path, dict[dcf.Place, dcf.Value]],
) -> None:
    shop = Shop(nodes("X"))
    setup.restore(shop.drive("X"), dcf.read(kept[0]))
    for sub, entry in ((1, 0x6041_0010), (2, 0x606C_0020)):
        shop.set("X", 0x1A00, sub, entry)
    listener = shop.rig.port()
    setup.restore(shop.drive("X"), dcf.read(kept[0]))
    buffer, written = bytearray(16), []
    while listener.receive_into(buffer):
        can_id, data = pdo.unpack(buffer)
        if can_id == 0x601 and data[0] & 0xE0 == 0x20:
            written.append((int.from_bytes(data[1:3], "little"), data[3], int.from_bytes(data[4:], "little")))
    mapping = [row for row in written if row[0] == 0x1A00]
    assert written[0] == (0x1800, 1, written[0][2]) and written[0][2] & 0x8000_0000
    assert mapping[0] == (0x1A00, 0, 0) and mapping[-1] == (0x1A00, 0, 2)
    assert (0x1A00, 2, 0x6064_0020) in mapping
    assert written[-1][:2] == (0x1800, 1) and not written[-1][2] & 0x8000_0000


def test_what_is_refused_is_told_and_the_rest_is_done(kept: tuple[Path, dict[dcf.Place, dcf.Value]]) -> None:
    def refuses(_: int) -> None:
        raise Abort(Code.VALUE)

    shop = Shop(nodes("X"))
    shop.rig.drives["X"].dictionary.writers[key(0x6085)] = refuses
    rows = setup.restore(shop.drive("X"), dcf.read(kept[0]))
    (bad,) = [row for row in rows if row.refused]
    assert bad.place == (0x6085, 0) and "0x06090030" in english(bad.refused)
    assert shop.get("X", 0x6065) == 777


def test_one_value_that_needs_another_first_is_tried_again(
    kept: tuple[Path, dict[dcf.Place, dcf.Value]],
) -> None:
    shop = Shop(nodes("X"))
    drive = shop.rig.drives["X"]

    def needs(value: int) -> None:
        if drive.dictionary.get(0x6085) != 123_456:
            raise Abort(Code.VALUE)

    drive.dictionary.writers[key(0x6065)] = needs  # 6065h comes before 6085h
    rows = setup.restore(shop.drive("X"), dcf.read(kept[0]))
    assert all(not row.refused for row in rows)
    assert shop.get("X", 0x6065) == 777


def test_identifiers_follow_the_node_id(kept: tuple[Path, dict[dcf.Place, dcf.Value]]) -> None:
    shop = Shop(nodes("XY"))
    setup.restore(shop.drive("Y"), dcf.read(kept[0]))
    assert (shop.get("Y", 0x1400, 1), shop.get("Y", 0x1800, 1)) == (0x202, 0x182)
    assert shop.get("Y", 0x1014) & 0x7FF == 0x82


def test_a_file_of_another_product_is_refused(tmp_path: Path) -> None:
    bench = Bench("X")
    path = tmp_path / "other.dcf"
    about = sheet.own(bench.nodes[0].eds, 1)
    about.dictionary.device_information.product_number = 0x999
    about.dictionary[0x1018][2].default_raw = "0x999"
    path.write_text(dcf.written(about, 1, 0, {(0x6085, 0): 1}, "other.dcf"), "latin-1")
    with pytest.raises(CommissionError, match=r"product code .* is 0x402, other\.dcf is of 0x999"):
        setup.belongs(commission.Drive(bench.network, bench.nodes[0]), dcf.read(path))


def test_a_data_sheet_is_no_set_up() -> None:
    with pytest.raises(sheet.SheetError, match="it has no ParameterValue"):
        dcf.read(Path(nodes("X")[0].eds))


def test_a_drive_with_torque_is_left_alone() -> None:
    bench = Bench("X")
    bench.enable()
    with pytest.raises(CommissionError, match="6041h shows that it is enabled"):
        setup.see_off(commission.Drive(bench.network, bench.nodes[0]))


@pytest.mark.parametrize(
    ("name", "address"),
    [("Node-ID", True), ("CAN bitrate", True), ("Baud rate", True), ("Gain of the position loop", False)],
)
def test_makers_node_ids_and_bit_rates_stay_where_they_are(name: str, address: bool, tmp_path: Path) -> None:
    text = Path(nodes("X")[0].eds).read_text("latin-1")
    text += (
        f"\n[2FF0]\nParameterName={name}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=1\n"
    )
    eds = tmp_path / "mine.eds"
    eds.write_text(text, "latin-1")
    shop = Shop(nodes("X", eds=str(eds)))
    shop.save("X", tmp_path / "x.dcf")
    shop.set("X", 0x2FF0, 0, 9)
    found = dcf.read(tmp_path / "x.dcf")
    assert found.values[0x2FF0, 0] == 1
    differ = [row.place for row in setup.differences(shop.drive("X"), found)]
    assert differ == ([] if address else [(0x2FF0, 0)])
    assert [row.place for row in setup.differences(shop.drive("X"), found, address=True)] == [(0x2FF0, 0)]


@pytest.mark.parametrize("name", SHEETS)
def test_drives_by_their_makers_sheets_are_kept_and_put_back(name: str, tmp_path: Path) -> None:
    profile: Profile = drive_profiles.load(name)
    master = MasterSettings(period_s=0.01)
    made = NodeSettings("X", "can", 1, sheet_of(name), period_s=0.01, profile=profile)
    made = replace(made, homing_method=profile.homing_methods[0], following_error_counts=900)
    shop = Shop([made])
    commission.commission(shop.network, [made], master)
    values = shop.save("X", tmp_path / "x.dcf")
    fresh = Shop([made])
    fresh.network.send_message(0, bytes([0x80, 1]))
    rows = setup.restore(fresh.drive("X"), dcf.read(tmp_path / "x.dcf"))
    assert [row for row in rows if row.refused] == []
    assert {place: value for place, value in setup.read(fresh.drive("X"))[0].items() if value != ""} == {
        place: value for place, value in values.items() if value != ""
    }
