"""Scan, status and dump change nothing and see what is there."""

from __future__ import annotations

from support.drives.stepped_drives import Bench

from drives import commission
from drives.commissioning import survey


def test_a_scan_finds_every_node_and_who_it_is() -> None:
    bench = Bench("XYZAC")
    found = survey.scan(bench.network)
    assert [one.node for one in found] == [1, 2, 3, 4, 5]
    assert {one.profile for one in found} == {402}
    assert {(one.vendor, one.product) for one in found} == {(0xD1E, 0x402)}


def test_a_scan_takes_less_than_a_second_of_bus_time() -> None:
    bench = Bench("XYZAC")
    began_s = bench.rig.now_s
    survey.scan(bench.network)
    assert bench.rig.now_s - began_s < 1.0


def test_looking_changes_nothing() -> None:
    bench = Bench("X")
    values = dict(bench.drive.dictionary.values)
    survey.scan(bench.network)
    survey.status(bench.network, bench.nodes)
    list(survey.dump(bench.network, bench.nodes[0]))
    assert bench.drive.dictionary.values == values


def test_status_tells_nmt_power_state_mode_and_errors() -> None:
    bench = Bench("XY")
    x, y = survey.status(bench.network, bench.nodes)
    assert (x.name, x.nmt, x.state, x.mode_name) == ("X", "operational", "switch on disabled", "csp")
    assert (x.error_code, x.history) == (0, ())
    bench.drive.dictionary.put(0x6060 << 8, 6)
    bench.rig.advance(bench.rig.now_s + 0.1)
    assert survey.status(bench.network, bench.nodes)[0].mode_name == "hm"
    assert y.position_counts == 0


def test_a_dump_reads_every_readable_object_and_names_it() -> None:
    bench = Bench("X")
    entries = list(survey.dump(bench.network, bench.nodes[0]))
    by_place = {(entry.index, entry.sub): entry for entry in entries}
    assert by_place[0x60C2, 1].value == 2
    assert isinstance(by_place[0x1008, 0].value, str)
    sheet = commission.Drive(bench.network, bench.nodes[0]).sheet
    readable = [
        (index, sub)
        for index in sheet.dictionary.indices
        for sub in (0, *sheet.subs(index))
        if index >= 0x1000 and (found := sheet.find(index, sub)) is not None and found.readable
    ]
    assert sorted(by_place) == sorted(readable)
    without = {entry.index for entry in entries if entry.refused}
    assert without <= {0x1003, 0x60BB, 0x60BC, 0x60BD}, "an empty history has nothing to show"
