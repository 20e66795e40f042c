"""Two drives with one node id are refused by name, and nothing else is taken for them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.drives.group_bench import inputs_and_outputs
from support.drives.stepped_drives import Bench, nodes

from drives import commission, pdo
from drives.bench.simulated import IoNode, Rig, SimulatedDrive, rig
from drives.bench.simulated.dictionary import key
from drives.commission import CommissionError
from drives.commissioning import survey, twins
from drives.settings import BusSettings, MasterSettings

BUSES = [BusSettings("can", "virtual", "", 1_000_000)]


def bench(names: str = "XY") -> tuple[Rig, commission.Network]:
    made = rig(nodes(names), BUSES)
    return made, commission.Network(made.port(pdo.SERVICE_FILTERS), commission.stepped_pump(made))


def second(made: Rig, node: int, serial: int) -> SimulatedDrive:
    """Another drive with a node id that is taken."""
    drive = SimulatedDrive(node)
    drive.dictionary.values[key(0x1018, 4)] = drive.dictionary.factory[key(0x1018, 4)] = serial
    made.buses["can"].attach(drive)
    return drive


@pytest.mark.parametrize("serial", [0x4711, 0, 2], ids=["another", "none", "the same"])
def test_two_drives_with_one_node_id_are_refused_with_both_serial_numbers(serial: int) -> None:
    made, network = bench()
    twin = second(made, 2, serial)
    with pytest.raises(CommissionError) as refused:
        commission.commission(network, nodes("XY"), MasterSettings())
    said = str(refused.value)
    assert said.startswith("drive Y (node 2): 2 drives answer with this node id")
    for word in ("0x2", f"{serial:#x}", "switch", "--set-node"):
        assert word in said
    assert "drive X" not in said
    assert pdo.NMT_OPERATIONAL not in (twin.nmt, made.drives["Y"].nmt), "neither of them is started"


def test_three_are_counted() -> None:
    made, network = bench("X")
    second(made, 1, 0x11)
    second(made, 1, 0x12)
    with pytest.raises(CommissionError, match=r"3 drives answer .* 0x1 and 0x11 and 0x12"):
        commission.commission(network, nodes("X"), MasterSettings())


def test_an_io_node_in_a_drives_place_is_a_twin_too() -> None:
    made, network = bench("X")
    made.buses["can"].attach(IoNode(1))
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): 2 drives answer"):
        commission.commission(network, nodes("X"), MasterSettings())


def test_every_pair_is_named() -> None:
    made, network = bench()
    second(made, 1, 0x11)
    second(made, 2, 0x12)
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): 2 drives.*drive Y \(node 2\): 2 drives"):
        commission.commission(network, nodes("XY"), MasterSettings())


def test_a_second_drive_that_is_switched_on_meanwhile_is_found_before_anything_is_started() -> None:
    made, network = bench("X")
    drive = made.drives["X"]
    added: list[SimulatedDrive] = []
    own = drive.dictionary.writers.get(key(0x6065))

    def written(value: int) -> None:
        if own is not None:
            own(value)
        if not added:
            added.append(second(made, 1, 0x11))

    drive.dictionary.writers[key(0x6065)] = written
    slow = commission.Network(made.port(pdo.SERVICE_FILTERS), slowly(made))
    with pytest.raises(CommissionError, match=r"2 drives answer with this node id|boot-up message came"):
        commission.commission(slow, nodes("X", following_error_counts=77), MasterSettings())
    assert added and drive.nmt != pdo.NMT_OPERATIONAL
    assert network is not slow


def slowly(made: Rig) -> Callable[[], float]:
    """A pump that gives drives time to start up between two requests."""
    return commission.stepped_pump(made, 0.05)


def test_a_drive_that_restarts_meanwhile_is_told_as_that() -> None:
    made, _ = bench("X")
    drive = made.drives["X"]
    restarted: list[float] = []

    def written(_: int) -> None:
        if not restarted:
            restarted.append(made.now_s)
            drive.alarm("blink", made.now_s + 0.01, lambda now_s: drive.link and _blink(drive, now_s))

    drive.dictionary.writers[key(0x6065)] = written
    network = commission.Network(made.port(pdo.SERVICE_FILTERS), slowly(made))
    with pytest.raises(CommissionError, match=r"drive X \(node 1\): its boot-up message came while"):
        commission.commission(network, nodes("X", following_error_counts=77), MasterSettings())


def _blink(drive: SimulatedDrive, now_s: float) -> None:
    drive.send(now_s, pdo.HEARTBEAT + drive.node, b"\0")


def test_an_answer_that_is_sent_twice_is_no_second_drive() -> None:
    made, network = bench("X")
    made.advance(0.5)
    bus, doubled = made.buses["can"], list[bytes]()

    def again(frame: bytes, _: float) -> None:
        if not doubled:
            doubled.append(frame)
            made.port().send(bytes(frame))

    bus.watch(0x581, again)
    assert twins.doubled(network, [1]) == {}
    assert doubled


def test_one_drive_is_nobodys_twin() -> None:
    found = Bench("XYZAC")
    assert twins.doubled(found.network, range(1, 128)) == {}
    assert all(one.twins == () for one in survey.scan(found.network))


def test_a_scan_names_twins() -> None:
    made, network = bench()
    made.advance(0.5)
    second(made, 2, 0x4711)
    made.advance(1.0)
    x, y = survey.scan(network)
    assert (x.twins, y.twins) == ((), (2, 0x4711))


def test_inputs_and_outputs_are_looked_at_as_well() -> None:
    made = rig([], BUSES, io=[inputs_and_outputs()])
    made.buses["can"].attach(IoNode(20))
    network = commission.Network(made.port(pdo.SERVICE_FILTERS), commission.stepped_pump(made))
    with pytest.raises(CommissionError, match=r"drive panel \(node 20\): 2 drives answer"):
        commission.commission(network, [inputs_and_outputs()], MasterSettings())
