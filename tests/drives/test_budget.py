import json

import pytest

from drives import budget
from drives.settings import BusSettings, MasterSettings, NodeSettings

MASTER = MasterSettings()


def axes(*counts):
    """Nodes and buses: so many drives on each bus."""
    buses = [BusSettings(f"can{i}", "virtual", "hub", 1_000_000) for i in range(len(counts))]
    names = iter("XYZACUVW")
    nodes = [
        NodeSettings(next(names), f"can{i}", k + 1, "a.eds") for i, n in enumerate(counts) for k in range(n)
    ]
    return nodes, buses


@pytest.mark.parametrize(("data_bytes", "bits"), [(0, 55), (1, 65), (4, 95), (6, 115), (8, 135)])
def test_the_worst_stuffed_frame_has_the_published_length(data_bytes, bits):
    assert budget.worst_bits(data_bytes) == bits
    assert 8 * data_bytes + 47 < budget.typical_bits(data_bytes) < bits


def test_five_drives_take_60_percent_of_2_ms():
    (one,) = budget.of(*axes(5), MASTER, 0.002)
    assert one.total_us == pytest.approx(1205.0)
    assert one.share == pytest.approx(0.6025)
    assert one.typical_us == pytest.approx(1050, abs=1)
    assert one.fits()


def test_five_drives_on_one_bus_do_not_fit_into_1_ms():
    nodes, buses = axes(5)
    assert not budget.of(nodes, buses, MASTER, 0.001)[0].fits()
    (sentence,) = budget.advice(nodes, buses, MASTER, period_s=0.001)
    assert "a period of 2 ms" in sentence
    assert "2 buses with at most 3 drives each" in sentence


def test_two_buses_with_three_and_two_drives_fit_into_1_ms():
    three, two = budget.of(*axes(3, 2), MASTER, 0.001)
    assert three.total_us == pytest.approx(745.0)
    assert two.total_us == pytest.approx(515.0)
    assert three.fits()
    assert two.fits()


def test_half_a_millisecond_takes_a_bus_per_axis():
    nodes, buses = axes(1, 1, 1, 1, 1)
    assert all(one.fits() for one in budget.of(nodes, buses, MASTER, 0.0005))
    (sentence,) = budget.advice(*axes(5), MASTER, period_s=0.0005)
    assert "5 buses with at most 1 drive each" in sentence


def test_a_slow_bus_is_told_the_bit_rate_that_fits():
    nodes, _ = axes(5)
    slow = [BusSettings("can0", "socketcan", "can0", 250_000)]
    (sentence,) = budget.advice(nodes, slow, MASTER)
    assert "a bit rate of 1000 kbit/s" in sentence


def test_what_the_advice_names_does_fit():
    for drives in range(1, 9):
        for period_s in (0.0005, 0.001, 0.002):
            nodes, buses = axes(drives)
            if budget.advice(nodes, buses, MASTER, period_s=period_s):
                longer = next(p for p in budget.PERIODS_S if budget.of(nodes, buses, MASTER, p)[0].fits())
                assert f"{longer * 1000:g} ms" in budget.advice(nodes, buses, MASTER, period_s=period_s)[0]


def test_without_bit_timing_everything_fits():
    nodes, _ = axes(5)
    (one,) = budget.of(nodes, [BusSettings("can0", "virtual", "hub", 0)], MASTER, 0.0005)
    assert one.share == 0.0
    assert one.fits()


def test_the_rows_add_up_and_go_to_json():
    (one,) = budget.of(*axes(5), MASTER)
    plain = json.loads(json.dumps(one.to_dict()))
    assert len(plain["rows"]) == 1 + 5 * 2 + 6
    summed = sum(row["worst_us"] * row["per_tick"] for row in plain["rows"])
    assert summed == pytest.approx(plain["total_us"] + plain["background_us"])
    assert plain["share"] == pytest.approx(0.6025)
