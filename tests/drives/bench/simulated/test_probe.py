"""Touch probes: what is latched, when, and to which fraction of a period."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import Lone, Refused

from drives.bench.simulated import Parameters

ON, CONTINUOUS, INDEX, RISING, FALLING = 0x01, 0x02, 0x04, 0x10, 0x20


def moving(
    function: int, speed: int = 100_000, walls: tuple[float | None, float | None] = (None, None)
) -> Lone:
    """In profile velocity mode, the probes armed from the start."""
    lone = Lone(Parameters(index_counts=10_000.0, index_offset=2_500.0))
    lone.write(0x60C2, 1, 2, 1)
    lone.drive.axis.sensors.probes.walls = list(walls)
    lone.write(0x60B8, 0, function, 2)
    lone.enable(3)
    lone.write(0x60FF, 0, speed, 4)
    return lone


@pytest.mark.parametrize("probe", [0, 1])
def test_a_wall_is_latched_where_it_stands_between_two_periods(probe: int) -> None:
    walls = (12_345.0, None) if probe == 0 else (None, 12_345.0)
    lone = moving((ON | RISING) << 8 * probe, walls=walls)
    lone.wait(0.1)
    assert lone.read(0x60B9) == 0x01 << 8 * probe
    lone.wait(0.1)
    assert lone.read(0x60B9) == 0x03 << 8 * probe
    assert lone.read(0x60BA + 2 * probe) == 12_345
    assert lone.read(0x60FD) & 1 << 16 + probe


def test_the_falling_edge_is_latched_on_the_way_back_and_the_first_stays() -> None:
    lone = moving(ON | RISING | FALLING, walls=(5_000.0, None))
    lone.wait(0.1)
    lone.write(0x60FF, 0, -100_000 & 0xFFFF_FFFF, 4)
    lone.wait(0.2)
    assert lone.read(0x60B9) == 0x07
    assert (lone.read(0x60BA), lone.read(0x60BB)) == (5_000, 5_000)


def test_one_latch_keeps_the_first_contact_and_continuous_the_newest() -> None:
    for function, latched in ((ON | RISING, 2_500), (ON | RISING | CONTINUOUS, 12_500)):
        lone = moving(function | INDEX)
        lone.wait(0.2)
        assert lone.read(0x60BA) == latched


def test_an_input_set_by_hand_latches_the_present_position() -> None:
    lone = moving(ON | RISING)
    lone.wait(0.1)
    position = lone.drive.axis.actual()
    lone.drive.axis.sensors.probes.set_input(0, True)
    assert lone.read(0x60BA) == position


def test_arming_again_forgets_what_was_stored() -> None:
    lone = moving(ON | RISING)
    lone.drive.axis.sensors.probes.set_input(0, True)
    lone.write(0x60B8, 0, 0, 2)
    assert lone.read(0x60B9) == 0
    lone.write(0x60B8, 0, ON | RISING, 2)
    assert lone.read(0x60B9) == 1


def test_nothing_is_looked_at_while_no_probe_is_on() -> None:
    lone = moving(0, walls=(5_000.0, None))
    assert lone.drive.axis.sensors.watches == ()
    lone.wait(0.2)
    assert lone.read(0x60B9) == 0


def test_reserved_bits_are_refused() -> None:
    with pytest.raises(Refused, match="06090030"):
        Lone().write(0x60B8, 0, 0x80, 2)


def test_the_source_may_be_chosen_by_60d0() -> None:
    lone = Lone()
    lone.write(0x60D0, 1, 5, 2)
    lone.write(0x60B8, 0, 0x0019, 2)
    probes = lone.drive.axis.sensors.probes
    assert probes._by_index(0)
    lone.write(0x60D0, 1, 1, 2)
    assert not probes._by_index(0)
    for sub, source in ((1, 2), (2, 1), (1, 9)):
        with pytest.raises(Refused, match="06090030"):
            lone.write(0x60D0, sub, source, 2)
    with pytest.raises(Refused, match="06090030"):
        lone.write(0x60B8, 0, 0x001D, 2)
