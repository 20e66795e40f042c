"""The machine file's spindle, inputs and outputs, clamps and homing: what they give and what they refuse."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from support.machines.spindle_machine import IO, SPINDLE, mill, text

from controller.machine import machine_file
from controller.machine.machine_file import ConfigError
from controller.machine.model import AdaptiveFeed, Clamp
from controller.state import stop_times
from drives.settings import IoSettings

README = Path(__file__).parents[3] / "config" / "README.md"


def refusal(machine_text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        machine_file.read(machine_text, "m.toml", machine_file.SHIPPED)
    return str(caught.value)


def test_a_spindle_with_a_node_is_driven_and_one_without_is_not() -> None:
    driven = mill().spindle
    assert driven is not None and driven.is_driven and driven.counts_per_rev == 4096.0
    for by in ("", 'by = "hand"\n'):
        by_hand = mill(f"[spindle]\nmax_rev_min = 24000\n{by}")
        assert by_hand.spindle is not None and not by_hand.spindle.is_driven
        assert machine_file.spindle_settings(by_hand) is None


def test_a_spindle_with_anything_of_a_drive_needs_its_node() -> None:
    for key in ('by = "drive"', 'bus = "can1"', "counts_per_rev = 4096"):
        found = refusal(text(f"[spindle]\nmax_rev_min = 24000\n{key}\n"))
        assert "[spindle]: node: is missing" in found, found


def test_a_spindle_by_hand_has_no_key_of_a_drive() -> None:
    found = refusal(text('[spindle]\nmax_rev_min = 24000\nby = "hand"\nnode = 10\n'))
    assert "[spindle]: node" in found and "allowed: by, by_hand_s, max_rev_min" in found, found


def test_the_bus_side_gets_every_node_of_the_machine() -> None:
    machine = mill()
    names = [settings.name for settings in machine_file.all_settings(machine)]
    assert names == ["X", "Y", "Z", "A", "C", "spindle", "io"]
    io = machine_file.io_settings(machine)[0]
    assert isinstance(io, IoSettings) and (io.inputs, io.outputs) == (1, 1)
    spindle = machine_file.spindle_settings(machine)
    assert spindle is not None and (spindle.bus, spindle.node, spindle.mode) == ("can1", 10, 9)


def test_as_many_bytes_of_inputs_are_mapped_as_the_highest_bit_needs() -> None:
    machine = mill(SPINDLE, IO.replace("door = 1", "door = 17"))
    assert machine_file.io_settings(machine)[0].inputs == 3


def test_a_clamp_names_its_bits() -> None:
    machine = mill()
    assert machine.axes[4].clamp == Clamp("clamp_C", "clamp_C_closed", 0.1)
    assert machine.axes[0].clamp is None
    assert machine.io is not None and machine.io.output("clamp_C") == 3 and machine.io.input("door") == 1


@pytest.mark.parametrize(
    ("old", "new", "told"),
    (
        ("counts_per_rev = 4096", "counts_per_rev = 0", "[spindle]: counts_per_rev = 0: is zero"),
        ("counts_per_rev = 4096", "counts_per_rev = 1e9", "32-bit velocity"),
        ("counts_per_rev = 4096", "", "counts_per_rev: is missing"),
        ("node = 10", "node = 11", "a node per device"),
        ("node = 10", 'node = 5\nprofile = "nobody"', '"nobody"'),
        ("node = 10", 'node = 10\nmode = "pp"', "mode"),
        ("node = 10", "node = 10\nat_speed = 3", "this key is not known"),
        ("max_rev_min = 12000", "max_rev_min = -1", "is not above zero"),
        ("estop = 0", "estop = 64", "is out of range"),
        ("estop = 0", "estop = 1", "has this bit, too"),
        ("estop = 0", "stop = 0", "this key is not known"),
        (", clamp_A = 2", "", "there is no such output in [io]"),
        ("clamp_A_closed = 2,", "", "there is no such input in [io]"),
        ("[io]", '[io]\ninverted = ["dor"]', "no input or output"),
        ("[io]", '[io]\neds = "nowhere.eds"', "there is no such file"),
        ("[io]", "[io]\nheartbeat = 1", "this key is not known"),
    ),
)
def test_a_mistake_is_told_with_its_table_and_key(old: str, new: str, told: str) -> None:
    whole = text()
    assert old in whole
    said = refusal(whole.replace(old, new, 1))
    assert re.match(r"m\.toml:\d+: \[", said) and told in said, said


TELLS = "counts_per_rev = 4096\nposition = { load = true }"
LAW = "adaptive = { load_percent = 60.0, overload_percent = 120.0 }"


def test_adaptive_feed_has_its_law_in_shares() -> None:
    assert mill().spindle.adaptive is None  # type: ignore[union-attr]
    spindle = mill(SPINDLE.replace("counts_per_rev = 4096", f"{TELLS}\n{LAW}")).spindle
    assert spindle is not None and spindle.adaptive == AdaptiveFeed(0.6, 0.2, 1.0, 0.3, 3.0, 1.2, 0.5)


@pytest.mark.parametrize(
    ("told", "law", "why"),
    (
        ("counts_per_rev = 4096", LAW, "does not tell its load"),
        ("counts_per_rev = 4096\nposition = {}", LAW, "does not tell its load"),
        ("counts_per_rev = 4096", LAW, "allowed: position = { load = true } beside it; write load = true"),
        (TELLS, LAW.replace("60.0", "4.0"), "load_percent = 4.0: is out of range"),
        (TELLS, LAW.replace("120.0", "60.0"), "overload_percent = 60.0: is no more than the load"),
        (TELLS, LAW.replace(" }", ", fall_s = 2.0, rise_s = 1.0 }"), "rise_s = 1.0: is shorter than fall_s"),
        (TELLS, LAW.replace(" }", ", max_share = 2.0 }"), "max_share = 2.0: is out of range"),
        (TELLS, LAW.replace(" }", ", min_share = 0.0 }"), "min_share = 0.0: is out of range"),
        (TELLS, LAW.replace("load_percent", "load_per_cent"), "did you mean"),
    ),
)
def test_a_law_that_cannot_be_kept_is_told_with_its_key(told: str, law: str, why: str) -> None:
    said = refusal(text(SPINDLE.replace("counts_per_rev = 4096", f"{told}\n{law}")))
    assert why in said and re.match(r"m\.toml:\d+: \[spindle\]", said), said


def test_a_clamp_without_an_io_table_is_refused() -> None:
    assert "for there is no [io]" in refusal(text(SPINDLE, ""))


def test_two_devices_on_one_node_are_refused() -> None:
    shared = text().replace('bus = "can1"\nnode = 10', 'bus = "can0"\nnode = 3')
    assert "axis Z is this node on bus can0" in refusal(shared)


# ---- homing --------------------------------------------------------------------

Z = "{ method = 37, group = 0, position_mm = 260.0 }"


def test_homing_has_its_method_its_speeds_and_its_acceleration_in_counts() -> None:
    homing = "{ method = 24, fast_mm_s = 20.0, slow_mm_s = 2.0, acceleration_mm_s2 = 100.0 }"
    z = machine_file.node_settings(mill(changes=((Z, homing),)))[2]
    assert z.homing_method == 24
    assert (z.homing_fast_counts_s, z.homing_slow_counts_s) == (4_000_000, 400_000)
    assert z.homing_acceleration_counts_s2 == 20_000_000


def test_rotaries_home_in_degrees_and_a_speed_has_no_sign() -> None:
    homing = "{ method = 24, fast_deg_s = 18.0, group = 1, position_deg = 0.0 }"
    machine = mill(changes=(("{ method = 37, group = 1, position_deg = 0.0 }", homing),))
    assert machine.axes[3].homing.fast == pytest.approx(math.radians(18.0))
    assert machine_file.node_settings(machine)[3].homing_fast_counts_s == 3_600_000


@pytest.mark.parametrize(
    "homing", ("{ absolute = true }", "{ method = 0 }", "{ method = 37, absolute = true }")
)
def test_an_absolute_encoder_is_told_not_to_home(homing: str) -> None:
    machine = mill(changes=((Z, homing),))
    assert machine.axes[2].homing.absolute and machine_file.node_settings(machine)[2].homing_method == 0


def test_a_homing_speed_of_nothing_is_refused() -> None:
    assert "fast_mm_s = 0" in refusal(text(SPINDLE, IO, "AC", (Z, "{ method = 24, fast_mm_s = 0 }")))


def test_the_tables_of_the_page_are_a_machine() -> None:
    block = next(part for part in README.read_text().split("```") if part.startswith("toml\n[spindle]"))
    tables, axis = block.removeprefix("toml\n").split("[[axis]]")
    clamp, homing, group = (line for line in axis.splitlines() if " = " in line)
    old = 'node = 5\nprofile = "simulated"\nhoming = { method = 37, group = 1, position_deg = 0.0 }'
    machine = mill(tables, "", "", changes=((old, f"node = 5\n{clamp}\n{homing}\n{group}"),))
    assert machine.io is not None and machine.io.inverted == ("door",)
    assert machine.axes[4].clamp == Clamp("clamp_C", "clamp_C_closed", 0.5)
    assert (machine.axes[4].homing.method, machine.axes[4].enable_group) == (24, 0)


def test_an_axis_has_its_ways_on_the_bus() -> None:
    extra = "node = 1\nfeedback_every = 2\nfeed_forward = true\nenable_group = 3\nunsupervised = true\n"
    x = machine_file.node_settings(mill(changes=(("node = 1\n", extra),)))[0]
    assert (x.feedback_every, x.feed_forward, x.enable_group, x.unsupervised) == (2, True, 3, True)


def test_an_axis_says_how_its_drive_stops_and_in_what_it_is_told() -> None:
    extra = (
        "node = 1\nquick_stop_mm_s2 = 3000.0\nvelocity_unit_counts_s = 68.25\n"
        "acceleration_unit_counts_s2 = 4.5\nfollowing_error_mm = 4.0\n"
    )
    rotary = ("counts_per_deg = 200_000\n", "counts_per_deg = 200_000\nquick_stop_deg_s2 = 5000.0\n")
    made = mill(changes=(("following_error_mm = 4.0\n", ""), ("node = 1\n", extra), rotary))
    x, _, _, a, _ = machine_file.node_settings(made)
    assert (x.velocity_counts_s, x.acceleration_counts_s2) == pytest.approx((4e7, 4e8))
    assert (x.quick_stop_counts_s2, x.rotary, x.counts_per_si) == (pytest.approx(6e8), False, 2e8)
    assert (x.velocity_unit_counts_s, x.acceleration_unit_counts_s2) == (68.25, 4.5)
    assert (a.quick_stop_counts_s2, a.rotary) == (pytest.approx(1e9), True)
    assert a.counts_per_si == pytest.approx(200_000 * 180 / math.pi)
    assert x.most_quick_stop_s == 3.0
    assert stop_times.quick_stop_s(made) == pytest.approx(0.12), "C; X takes 67 ms now"


def test_the_longest_quick_stop_is_the_machines() -> None:
    made = mill(changes=(("period_s = 0.002", "period_s = 0.002\nmax_quick_stop_s = 12.0"),))
    assert {node.most_quick_stop_s for node in machine_file.node_settings(made)} == {12.0}


def test_a_unit_of_acceleration_without_one_of_velocity_is_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"acceleration_unit_counts_s2 = 2.*: velocity_unit_counts_s is missing"
    ):
        mill(changes=(("node = 1\n", "node = 1\nacceleration_unit_counts_s2 = 2.0\n"),))
