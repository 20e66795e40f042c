"""A node id by layer setting services: to the drive of a serial number, or to the only one without an id."""

from __future__ import annotations

import pytest
from support.drives.stepped_drives import EDS

from drives import commission, pdo
from drives.bench.simulated import SimulatedDrive
from drives.bench.simulated.data_sheet import key
from drives.bench.virtual.virtual_bus import SteppedBus
from drives.commissioning import survey
from drives.commissioning.lss import Lss
from drives.settings import MasterSettings, NodeSettings

UNCONFIGURED = 255


class Bench:
    def __init__(self, *nodes: int) -> None:
        self.bus = SteppedBus(1_000_000)
        self.drives = [SimulatedDrive(node) for node in nodes]
        for serial, drive in enumerate(self.drives, 1001):
            drive.dictionary.factory[key(0x1018, 4)] = serial
            drive.dictionary.values[key(0x1018, 4)] = serial
            self.bus.attach(drive)
        port = self.bus.port(pdo.SERVICE_FILTERS)
        self.network = commission.Network(port, commission.stepped_pump(self.bus))
        self.bus.advance(self.bus.now_s + 0.1)
        self.lss = Lss(self.network)

    def nodes(self) -> list[int]:
        return [found.node for found in survey.scan(self.network)]


def test_the_only_drive_without_an_id_gets_one_and_can_be_commissioned() -> None:
    bench = Bench(UNCONFIGURED, 2)
    assert bench.nodes() == [2]
    assert bench.lss.assign(7, None, store=True) == (0xD1E, 0x402, 0x10000, 1001)
    assert bench.nodes() == [2, 7]
    assert bench.drives[0].lss.stored == 7
    commission.commission(bench.network, [NodeSettings("X", "can", 7, EDS)], MasterSettings())
    assert bench.drives[0].nmt == pdo.NMT_OPERATIONAL


def test_the_drive_of_a_serial_number_gets_another_id() -> None:
    bench = Bench(1, 2)
    bench.lss.assign(9, (0xD1E, 0x402, 0x10000, 1002), store=False)
    assert bench.nodes() == [1, 9]
    assert bench.drives[1].lss.stored == 2, "without storing it is for this time only"


def test_of_two_drives_without_an_id_the_serial_number_decides() -> None:
    bench = Bench(UNCONFIGURED, UNCONFIGURED)
    bench.lss.assign(3, (0xD1E, 0x402, 0x10000, 1002), store=True)
    assert [drive.node for drive in bench.drives] == [UNCONFIGURED, 3]


def test_two_drives_without_an_id_and_no_serial_number_are_refused() -> None:
    bench = Bench(UNCONFIGURED, UNCONFIGURED)
    with pytest.raises(commission.CommissionError, match=r"another drive without a node id .* one by one"):
        bench.lss.assign(3, None, store=True)
    assert all(drive.lss.stored == UNCONFIGURED for drive in bench.drives)


def test_nobody_without_an_id_is_a_sentence() -> None:
    with pytest.raises(
        commission.CommissionError, match=r"no drive without a node id answers .* exactly one"
    ):
        Bench(1).lss.assign(3, None, store=False)


def test_an_unknown_serial_number_is_a_sentence() -> None:
    with pytest.raises(
        commission.CommissionError, match=r"serial number 0x7 answers to LSS; check the serial"
    ):
        Bench(1).lss.assign(3, (0xD1E, 0x402, 0x10000, 7), store=False)
